//! Curves of chosen entries of the Maxwell matrix, over the time of the session or of the scene's trajectories.

use crate::history::{Overlay, Sample, TimeAxis};
use crate::palette::palette;
use crate::preferences::CurvePreferences;
use crate::quantity::{Quantity, Unit};
use crate::session::Session;
use crate::style::{self, chip, faint, segmented};
use capsense::core::capacitance::upper_triangle;
use egui::{RichText, Ui};
use egui_plot::{
    AxisHints, HoverPosition, Line, LineStyle, Plot, PlotBounds, PlotPoint, PlotUi, Points, VLine,
};

/// A curve has no more points than this: more than a screen has columns.
const MOST_POINTS: usize = 4000;

/// Up to so many electrodes, all entries are shown at first.
const FEW_ELECTRODES: usize = 4;

/// Room for the switches of curves: two rows; more are scrolled to.
const CHIPS_HEIGHT: f32 = 52.0;

/// Room above and below curves, in parts of their height.
const MARGIN: f64 = 0.06;

/// What the panel remembers while the window is open.
#[derive(Debug, Default)]
pub struct CurvesPanel {
    /// Whether each entry is hidden.
    hidden: Vec<bool>,
    /// Where time stood when the axis was held.
    held_at: Option<f64>,
    /// Time of the last sample of any curve.
    latest_s: f64,
    /// Capacitances that changes are told from, in place of those without objects.
    tare: Option<Vec<f64>>,
    fit: bool,
    /// End of the trajectories that the axis was last made for.
    shown_end: Option<f64>,
    /// Time under the pointer.
    cursor: Option<f64>,
}

impl CurvesPanel {
    /// Whether the axis follows time.
    pub fn is_paused(&self) -> bool {
        self.held_at.is_some()
    }

    /// Holds the axis, or lets it follow time again.
    pub fn toggle_pause(&mut self) {
        self.held_at = match self.held_at {
            Some(_) => None,
            None => Some(self.latest_s),
        };
    }

    /// Shows all of the curves again.
    pub fn fit(&mut self) {
        self.fit = true;
        self.held_at = None;
    }

    /// Whether an entry is shown.
    pub fn is_shown(&self, entry: usize) -> bool {
        !self.hidden.get(entry).copied().unwrap_or(false)
    }

    /// Draws the panel.
    pub fn ui(
        &mut self,
        ui: &mut Ui,
        session: &Session,
        preferences: &mut CurvePreferences,
        overlays: &[Overlay],
    ) {
        let electrodes = session.history.electrodes().len();
        let entries = electrodes * (electrodes + 1) / 2;
        if self.hidden.len() != entries {
            // Of many electrodes only the self-capacitances are shown at first.
            let is_hidden = |(row, column)| electrodes > FEW_ELECTRODES && row != column;
            self.hidden = upper_triangle(electrodes).map(is_hidden).collect();
        }
        if self.tare.as_ref().is_some_and(|tare| tare.len() != self.hidden.len()) {
            self.tare = None;
        }
        self.bar(ui, session, preferences);
        let samples = session.history.samples(preferences.axis);
        self.chips(ui, session, preferences, &samples);
        self.plot(ui, session, preferences, &samples, overlays);
    }

    fn bar(&mut self, ui: &mut Ui, session: &Session, preferences: &mut CurvePreferences) {
        ui.horizontal_wrapped(|ui| {
            ui.strong("Curves");
            ui.separator();
            segmented(
                ui,
                &mut preferences.quantity,
                &[
                    (Quantity::Change, "ΔC", "change by the objects"),
                    (Quantity::Absolute, "C", "entry of the Maxwell matrix"),
                ],
            );
            let units = [(Unit::Femtofarad, "fF", "1e-15 F"), (Unit::Picofarad, "pF", "1e-12 F")];
            segmented(ui, &mut preferences.unit, &units);
            ui.separator();
            let axes = [
                (TimeAxis::Scene, "trajectory", "over the time of the trajectories"),
                (TimeAxis::Session, "live", "over the time since the program began; scrolls"),
            ];
            if segmented(ui, &mut preferences.axis, &axes) {
                self.fit();
            }
            ui.toggle_value(&mut preferences.normalised, "normalised")
                .on_hover_text("each curve from its least value at 0 to its greatest at 1");
            if session.history.has_converters() {
                ui.toggle_value(&mut preferences.as_read, "as read")
                    .on_hover_text("what the scene's converters read, dashed");
            }
            ui.separator();
            if preferences.axis == TimeAxis::Session {
                let text = if self.is_paused() { "follow" } else { "hold" };
                if ui.button(text).on_hover_text("hold the time axis (P)").clicked() {
                    self.toggle_pause();
                }
                let window = egui::DragValue::new(&mut preferences.window_s).range(1.0..=600.0).suffix(" s");
                ui.add(window).on_hover_text("length of the time axis");
            }
            if ui.button("all").on_hover_text("every entry").clicked() {
                self.hidden.fill(false);
            }
            if ui.button("none").on_hover_text("no entry").clicked() {
                self.hidden.fill(true);
            }
            if ui.button("fit").on_hover_text("show all of the curves (A)").clicked() {
                self.fit();
            }
            let is_tared = self.tare.is_some();
            if ui
                .selectable_label(is_tared, "tare")
                .on_hover_text("tell changes from now on, in place of from the scene without objects")
                .clicked()
            {
                let now = session.history.last().map(|sample| sample.farads.clone());
                self.tare = if is_tared { None } else { now };
            }
        });
    }

    /// Switches of the curves, each with its value under the pointer, or else the last.
    fn chips(&mut self, ui: &mut Ui, session: &Session, preferences: &CurvePreferences, samples: &[&Sample]) {
        let electrodes = session.history.electrodes();
        let read = match (self.cursor, preferences.axis) {
            (Some(time), _) => nearest(samples, time),
            (None, TimeAxis::Scene) => nearest(samples, session.transport.time_s()),
            (None, TimeAxis::Session) => samples.last().copied(),
        };
        egui::ScrollArea::vertical().max_height(CHIPS_HEIGHT).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                ui.spacing_mut().item_spacing = egui::vec2(6.0, 4.0);
                for (entry, (row, column)) in upper_triangle(electrodes.len()).enumerate() {
                    let value = read.map_or(String::new(), |sample| {
                        preferences
                            .unit
                            .text(sample.farads[entry] - self.reference(session, preferences, entry))
                    });
                    let name = format!("{}–{}", electrodes[row], electrodes[column]);
                    let mut on = !self.hidden[entry];
                    chip(ui, &mut on, palette(entry), &name, &value);
                    self.hidden[entry] = !on;
                }
                if let (Some(time), Some(_)) = (self.cursor, read) {
                    ui.label(RichText::new(format!("at {time:.3} s")).color(faint(ui)).monospace());
                }
            })
        });
    }

    fn reference(&self, session: &Session, preferences: &CurvePreferences, entry: usize) -> f64 {
        match preferences.quantity {
            Quantity::Absolute => 0.0,
            Quantity::Change => self.tare.as_deref().unwrap_or(session.history.base())[entry],
        }
    }

    fn plot(
        &mut self,
        ui: &mut Ui,
        session: &Session,
        preferences: &CurvePreferences,
        samples: &[&Sample],
        overlays: &[Overlay],
    ) {
        let unit = if preferences.normalised { "" } else { preferences.unit.symbol() };
        let follows = preferences.axis == TimeAxis::Session;
        let ends = overlays.iter().filter_map(|overlay| overlay.points.last()).map(|point| point[0]);
        let last = samples.last().map_or(0.0, |sample| sample.time_s);
        self.latest_s = ends.fold(last, f64::max);
        let now = self.held_at.unwrap_or(self.latest_s);
        let window = (now - preferences.window_s).max(0.0)..=now.max(1.0);
        let seen: Vec<&Sample> = match follows {
            true => samples.iter().copied().filter(|s| window.contains(&s.time_s)).collect(),
            false => samples.to_vec(),
        };
        let shown: Vec<usize> = (0..self.hidden.len()).filter(|&entry| !self.hidden[entry]).collect();
        let curves = shown.iter().map(|&entry| {
            let reference = self.reference(session, preferences, entry);
            let points = thinned(&seen).map(|s| [s.time_s, s.farads[entry] - reference]).collect();
            (entry, points)
        });
        let mut curves: Vec<(usize, Vec<[f64; 2]>)> = curves.collect();
        let is_overlaid = |overlay: &&Overlay| !self.hidden.get(overlay.entry).copied().unwrap_or(true);
        let mut over: Vec<Overlay> = overlays.iter().filter(is_overlaid).cloned().collect();
        for overlay in &mut over {
            let reference = self.reference(session, preferences, overlay.entry);
            overlay.points.iter_mut().for_each(|point| point[1] -= reference);
            if follows {
                overlay.points.retain(|point| window.contains(&point[0]));
            }
        }
        for points in
            curves.iter_mut().map(|(_, points)| points).chain(over.iter_mut().map(|o| &mut o.points))
        {
            scale(points, preferences);
        }
        let fits = std::mem::take(&mut self.fit);
        let y_range = range(curves.iter().map(|(_, p)| p).chain(over.iter().map(|o| &o.points)));
        let cursor_line = (!follows && session.transport.frames() > 1).then(|| session.transport.time_s());
        let scene_end = (!follows && session.transport.frames() > 1).then(|| session.transport.end_s());
        let is_first = scene_end.is_some() && std::mem::replace(&mut self.shown_end, scene_end) != scene_end;
        let faint = faint(ui);
        let symbol = preferences.quantity.symbol();
        let y_label = match preferences.normalised {
            true => format!("{symbol}, normalised"),
            false => format!("{symbol} / {unit}"),
        };
        let electrodes = session.history.electrodes();
        let names: Vec<String> = upper_triangle(electrodes.len())
            .map(|(a, b)| format!("{}–{}", electrodes[a], electrodes[b]))
            .collect();
        let is_held = self.held_at.is_some();
        // Each quantity, unit and axis remembers its own zoom.
        let id = ("curves", preferences.quantity, preferences.unit, preferences.axis, preferences.normalised);
        let y_axis = AxisHints::new_y().label(y_label).min_thickness(56.0).label_spacing(14.0..=36.0);
        let x_axis = AxisHints::new_x().label("time / s").label_spacing(30.0..=70.0);
        let response = Plot::new(id)
            .custom_x_axes(vec![x_axis])
            .custom_y_axes(vec![y_axis])
            .label_formatter(move |at: &HoverPosition<'_>| Some(hover_text(at, unit)))
            .set_margin_fraction(egui::vec2(0.01, MARGIN as f32))
            .grid_color(faint.gamma_multiply(0.5))
            .show_background(true)
            .show(ui, |plot| {
                if fits {
                    plot.set_auto_bounds([true, true]);
                }
                if follows && !is_held {
                    follow(plot, (*window.start(), *window.end()), y_range);
                }
                if let Some(end) = scene_end.filter(|_| fits || is_first) {
                    plot.set_plot_bounds_x(0.0..=end);
                }
                if let Some(time) = cursor_line {
                    plot.vline(VLine::new("", time).color(faint).width(1.0).allow_hover(false));
                }
                for (entry, points) in curves {
                    if points.len() < 3 {
                        let dots = Points::new(names[entry].clone(), points.clone()).radius(3.0);
                        plot.points(dots.id(("dots", entry)).color(palette(entry)));
                    }
                    let line = Line::new(names[entry].clone(), points);
                    plot.line(line.id(entry).color(palette(entry)).width(1.8));
                }
                for (index, overlay) in over.into_iter().enumerate() {
                    let line = Line::new(overlay.name, overlay.points).id(("overlay", index));
                    let colour = palette(overlay.entry).gamma_multiply(0.85);
                    plot.line(line.color(colour).width(1.6).style(LineStyle::dashed_dense()));
                }
                plot.pointer_coordinate().map(|point| point.x)
            });
        self.cursor = response.inner.filter(|_| response.response.hovered());
        let is_moved = response.response.dragged()
            || (response.response.hovered() && ui.input(|input| input.smooth_scroll_delta.length() > 0.0));
        if follows && is_moved && self.held_at.is_none() {
            self.held_at = Some(now);
        }
        if seen.is_empty() {
            let at = response.response.rect.center();
            let font = egui::TextStyle::Body.resolve(ui.style());
            ui.painter().text(at, egui::Align2::CENTER_CENTER, "nothing computed yet", font, faint);
        }
    }
}

/// The time axis ends now; values fill the height.
fn follow(plot: &mut PlotUi<'_>, (from, to): (f64, f64), range: Option<[f64; 2]>) {
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let margin = MARGIN * (high - low).max(1e-9);
    plot.set_plot_bounds(PlotBounds::from_min_max([from, low - margin], [to, high + margin]));
}

fn hover_text(at: &HoverPosition<'_>, unit: &str) -> String {
    let text = |point: &PlotPoint| format!("{:.3} s\n{:.3} {unit}", point.x, point.y);
    match at {
        HoverPosition::NearDataPoint { plot_name, position, .. } => {
            format!("{plot_name}\n{}", text(position))
        }
        HoverPosition::Elsewhere { position } => text(position),
    }
}

/// Samples, as many as can be told apart.
fn thinned<'a>(samples: &'a [&'a Sample]) -> impl Iterator<Item = &'a Sample> {
    let every = samples.len().div_ceil(MOST_POINTS).max(1);
    samples.iter().copied().step_by(every)
}

/// The sample whose time is nearest.
fn nearest<'a>(samples: &[&'a Sample], time: f64) -> Option<&'a Sample> {
    let after = samples.partition_point(|sample| sample.time_s < time);
    let around = samples.get(after.saturating_sub(1)..(after + 1).min(samples.len()))?;
    around.iter().copied().min_by(|a, b| (a.time_s - time).abs().total_cmp(&(b.time_s - time).abs()))
}

/// From farads to what is on the axis.
fn scale(points: &mut [[f64; 2]], preferences: &CurvePreferences) {
    let [low, high] =
        range(std::iter::once(points.to_vec()).collect::<Vec<_>>().iter()).unwrap_or([0.0, 1.0]);
    for point in points {
        point[1] = match preferences.normalised {
            true if high > low => (point[1] - low) / (high - low),
            true => 0.5,
            false => point[1] * preferences.unit.per_farad(),
        };
    }
}

/// Least and greatest value of curves.
fn range<'a>(curves: impl Iterator<Item = &'a Vec<[f64; 2]>>) -> Option<[f64; 2]> {
    let values = curves.flatten().map(|point| point[1]).filter(|value| value.is_finite());
    values.fold(None, |range: Option<[f64; 2]>, value| {
        Some(range.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
    })
}

/// A heading for the panel where there is nothing to show.
pub fn nothing(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).color(style::faint(ui)));
}
