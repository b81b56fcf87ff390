//! The window: a list of matrix entries on the left, their curves in the middle, the mesh on the right.

use crate::ViewerData;
use crate::curves::Curves;
use crate::palette::palette;
use crate::wireframe::{self, MeshView, Orbit};
use egui::{RichText, ScrollArea, Ui};
use egui_plot::{AxisHints, HoverPosition, Line, Plot, PlotPoint};

/// What there is to show.
#[derive(Clone, Debug)]
pub enum Content {
    /// The program was started without a run.
    Nothing,
    /// The run could not be read; this is the message.
    Failed(String),
    /// A run.
    Run {
        /// What to call it.
        name: String,
        /// Its curves and its mesh.
        data: Box<ViewerData>,
    },
}

/// Which quantity the curves show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// The entry of the Maxwell matrix itself.
    Absolute,
    /// Its change since the first frame.
    #[default]
    Change,
}

impl Quantity {
    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Absolute => "C",
            Self::Change => "ΔC",
        }
    }
}

/// The unit that the curves are drawn in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Unit {
    /// 1e-15 F.
    #[default]
    Femtofarad,
    /// 1e-12 F.
    Picofarad,
}

impl Unit {
    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Femtofarad => "fF",
            Self::Picofarad => "pF",
        }
    }

    /// Decimals that show attofarads.
    fn decimals(self) -> usize {
        match self {
            Self::Femtofarad => 3,
            Self::Picofarad => 6,
        }
    }

    /// How many of them a farad is.
    pub fn per_farad(self) -> f64 {
        match self {
            Self::Femtofarad => 1e15,
            Self::Picofarad => 1e12,
        }
    }
}

/// The points of every curve in one quantity and unit.
pub fn plot_points(curves: &Curves, quantity: Quantity, unit: Unit) -> Vec<Vec<[f64; 2]>> {
    curves
        .entries()
        .iter()
        .map(|entry| {
            let reference = match quantity {
                Quantity::Absolute => 0.0,
                Quantity::Change => entry.farads.first().copied().unwrap_or(0.0),
            };
            let values = entry.farads.iter().map(|farads| (farads - reference) * unit.per_farad());
            curves.time_s().iter().zip(values).map(|(&time, value)| [time, value]).collect()
        })
        .collect()
}

/// The state of the window.
#[derive(Debug)]
pub struct ViewerApp {
    view: View,
}

#[derive(Debug)]
enum View {
    Nothing,
    Failed(String),
    Run(Box<RunView>),
}

impl ViewerApp {
    /// Shows this from now on.
    pub fn new(content: Content) -> Self {
        let view = match content {
            Content::Nothing => View::Nothing,
            Content::Failed(message) => View::Failed(message),
            Content::Run { name, data } => View::Run(Box::new(RunView::new(name, *data))),
        };
        Self { view }
    }
}

impl eframe::App for ViewerApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        match &mut self.view {
            View::Nothing => message(
                ui,
                "No run is open",
                "Start the viewer with the folder of a run:  capsense-viewer capsense-out",
            ),
            View::Failed(text) => message(ui, "The run could not be opened", text),
            View::Run(run) => run.ui(ui),
        }
    }
}

fn mesh_picture(ui: &mut Ui, mesh: &mut MeshView, orbit: &mut Orbit) {
    ui.horizontal_wrapped(|ui| {
        ui.strong("Mesh");
        for group in mesh.groups_mut() {
            let mut text = RichText::new(&group.name);
            if !group.is_background() {
                text = text.color(group.colour);
            }
            ui.checkbox(&mut group.visible, text);
        }
    });
    ui.weak("drag: turn   right drag: move   scroll: zoom   double click: reset");
    wireframe::show(ui, mesh, orbit);
}

fn message(ui: &mut Ui, heading: &str, text: &str) {
    egui::CentralPanel::default().show(ui, |ui| {
        ui.add_space(24.0);
        ui.heading(heading);
        ui.add_space(8.0);
        ui.label(text);
    });
}

/// One run on display.
#[derive(Debug)]
struct RunView {
    name: String,
    curves: Curves,
    mesh: Result<MeshView, String>,
    orbit: Orbit,
    quantity: Quantity,
    unit: Unit,
    /// Whether each entry is drawn.
    shown: Vec<bool>,
    /// The curves in the quantity and unit for which they were last computed.
    points: Vec<Vec<PlotPoint>>,
    points_are_of: Option<(Quantity, Unit)>,
}

impl RunView {
    fn new(name: String, data: ViewerData) -> Self {
        let ViewerData { curves, mut mesh } = data;
        // An electrode looks like the curve of its own capacitance.
        for group in mesh.iter_mut().flat_map(MeshView::groups_mut) {
            let own =
                |e: &crate::curves::Entry| e.row == e.column && curves.electrodes()[e.row] == group.name;
            if let Some(index) = curves.entries().iter().position(own) {
                group.colour = palette(index);
            }
        }
        Self {
            name,
            shown: vec![true; curves.entries().len()],
            curves,
            mesh,
            orbit: Orbit::default(),
            quantity: Quantity::default(),
            unit: Unit::default(),
            points: Vec::new(),
            points_are_of: None,
        }
    }

    fn ui(&mut self, ui: &mut Ui) {
        egui::Panel::left("controls").default_size(190.0).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.controls(ui));
        });
        let (mesh, orbit) = (&mut self.mesh, &mut self.orbit);
        egui::Panel::right("mesh").default_size(420.0).show(ui, |ui| match mesh {
            Ok(mesh) => mesh_picture(ui, mesh, orbit),
            Err(reason) => {
                ui.strong("Mesh");
                ui.label("The mesh cannot be shown:");
                ui.label(reason.as_str());
            }
        });
        egui::CentralPanel::default().show(ui, |ui| self.plot(ui));
    }

    fn controls(&mut self, ui: &mut Ui) {
        ui.add_space(4.0);
        ui.strong(&self.name);
        let frames = self.curves.time_s().len();
        let electrodes = self.curves.electrodes().len();
        ui.label(format!("{frames} {}", if frames == 1 { "frame" } else { "frames" }));
        ui.label(format!("{electrodes} {}", if electrodes == 1 { "electrode" } else { "electrodes" }));
        ui.label(format!("{:.2} ms a frame (median)", self.curves.median_frame_ms()));
        ui.separator();
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.quantity, Quantity::Change, "ΔC")
                .on_hover_text("change since the first frame");
            ui.radio_value(&mut self.quantity, Quantity::Absolute, "C")
                .on_hover_text("entry of the Maxwell matrix");
        });
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.unit, Unit::Femtofarad, "fF");
            ui.radio_value(&mut self.unit, Unit::Picofarad, "pF");
        });
        ui.separator();
        ui.horizontal(|ui| {
            ui.strong("Entries");
            if ui.small_button("All").clicked() {
                self.shown.fill(true);
            }
            if ui.small_button("None").clicked() {
                self.shown.fill(false);
            }
        });
        for (index, (entry, shown)) in self.curves.entries().iter().zip(&mut self.shown).enumerate() {
            ui.checkbox(shown, RichText::new(&entry.label).color(palette(index)));
        }
    }

    fn plot(&mut self, ui: &mut Ui) {
        let (quantity, unit) = (self.quantity, self.unit);
        if self.points_are_of != Some((quantity, unit)) {
            self.points = plot_points(&self.curves, quantity, unit)
                .into_iter()
                .map(|curve| curve.into_iter().map(PlotPoint::from).collect())
                .collect();
            self.points_are_of = Some((quantity, unit));
        }
        ui.strong(format!("{} in {} over time in s", quantity.symbol(), unit.symbol()));
        let hover = move |at: &HoverPosition<'_>| {
            Some(match at {
                HoverPosition::NearDataPoint { plot_name, position, .. } => {
                    format!(
                        "{plot_name}\n{:.4} s\n{:.*} {}",
                        position.x,
                        unit.decimals(),
                        position.y,
                        unit.symbol()
                    )
                }
                HoverPosition::Elsewhere { position } => {
                    format!("{:.4} s\n{:.*} {}", position.x, unit.decimals(), position.y, unit.symbol())
                }
            })
        };
        // Each quantity and unit remembers its own zoom.
        Plot::new(("curves", quantity, unit))
            // Tenths get a number before they are as wide as the default asks for.
            .custom_x_axes(vec![AxisHints::new_x().label_spacing(25.0..=50.0)])
            .label_formatter(hover)
            .show(ui, |plot| {
                for (index, entry) in self.curves.entries().iter().enumerate().filter(|(i, _)| self.shown[*i])
                {
                    plot.line(
                        Line::new(entry.label.as_str(), self.points[index].as_slice())
                            .id(index)
                            .color(palette(index))
                            .width(1.8),
                    );
                }
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn changes_are_since_the_first_frame_and_in_the_unit_asked_for() {
        let text = "frame,time_s,C_A_A_F,changed_edges,iterations,geometry_ms,update_ms,solve_ms\n\
                    0,0,2e-12,0,0,0,0,0\n1,0.5,2.25e-12,0,0,0,0,0\n";
        let curves = Curves::parse(text.as_bytes(), Path::new("x.csv")).unwrap();
        let points = |quantity, unit| plot_points(&curves, quantity, unit);
        let near = |got: Vec<Vec<[f64; 2]>>, want: [[f64; 2]; 2]| {
            assert_eq!(got.len(), 1);
            for (g, w) in got[0].iter().zip(want) {
                assert!((g[0] - w[0]).abs() < 1e-12 && (g[1] - w[1]).abs() < 1e-9, "{g:?} {w:?}");
            }
        };
        near(points(Quantity::Absolute, Unit::Picofarad), [[0.0, 2.0], [0.5, 2.25]]);
        near(points(Quantity::Change, Unit::Femtofarad), [[0.0, 0.0], [0.5, 250.0]]);
    }
}
