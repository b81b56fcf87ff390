//! What is to be seen: the choices, and the check boxes and sliders that make them.

use super::camera::Camera;
use super::slice::Plane;
use super::static_scene::StaticScene;
use egui::{ComboBox, Slider, Ui};
use glam::DVec3;

/// The quantity that a slice shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// The potential with one electrode at 1 V, in V.
    #[default]
    Potential,
    /// The magnitude of E with one electrode at 1 V, in V/m.
    Field,
}

impl Quantity {
    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Potential => "potential",
            Self::Field => "|E|",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Potential => "V",
            Self::Field => "V/m",
        }
    }
}

/// The half of the mesh that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// Where the mesh is cut.
    pub plane: Plane,
    /// Whether the side of smaller coordinates is kept, rather than the other.
    pub keeps_lower: bool,
}

impl Clip {
    /// Whether a point is on the kept side.
    pub fn keeps(&self, point: DVec3) -> bool {
        (point[self.plane.axis] < self.plane.position) == self.keeps_lower
    }
}

/// What is to be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewOptions {
    /// Bodies as glass.
    pub bodies: bool,
    /// Names of electrodes.
    pub names: bool,
    /// The mesh on one side of a plane.
    pub mesh: bool,
    /// That plane.
    pub clip: Clip,
    /// Elements that objects occupy.
    pub occupied: bool,
    /// Edges that surfaces cut.
    pub cut_edges: bool,
    /// Elements that changed in the last frame.
    pub changed: bool,
    /// A slice through the field.
    pub slice: bool,
    /// Where that is.
    pub slice_plane: Plane,
    /// What it shows.
    pub quantity: Quantity,
    /// The electrode at 1 V.
    pub electrode: usize,
    /// What the depth camera sees.
    pub depth: bool,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            bodies: true,
            names: true,
            mesh: false,
            clip: Clip { plane: Plane { axis: 0, position: 0.0 }, keeps_lower: true },
            occupied: false,
            cut_edges: false,
            changed: false,
            slice: true,
            slice_plane: Plane { axis: 0, position: 0.0 },
            quantity: Quantity::default(),
            electrode: 0,
            depth: false,
        }
    }
}

impl ViewOptions {
    /// Check boxes and sliders; with a scene, sliders end where it does.
    pub(super) fn ui(&mut self, ui: &mut Ui, camera: &mut Camera, scene: Option<&StaticScene>) {
        ui.checkbox(&mut self.bodies, "Bodies");
        ui.checkbox(&mut self.names, "Electrode names");
        ui.checkbox(&mut camera.is_orthographic, "Parallel projection")
            .on_hover_text("as the scale bar: sizes do not depend on depth");
        ui.checkbox(&mut self.occupied, "Occupied elements").on_hover_text("elements that objects fill");
        ui.checkbox(&mut self.cut_edges, "Cut edges")
            .on_hover_text("mesh edges that surfaces of objects cut");
        ui.checkbox(&mut self.changed, "Changed elements")
            .on_hover_text("elements that are other than in the frame before");
        ui.checkbox(&mut self.depth, "Depth pictures").on_hover_text("what the depth camera sees");
        ui.checkbox(&mut self.mesh, "Mesh");
        if self.mesh {
            ui.indent("clip", |ui| {
                plane_ui(ui, "clip axis", &mut self.clip.plane, scene);
                ui.checkbox(&mut self.clip.keeps_lower, "Keep the lower side");
            });
        }
        ui.checkbox(&mut self.slice, "Slice");
        if self.slice {
            ui.indent("slice", |ui| self.slice_ui(ui, scene));
        }
    }

    fn slice_ui(&mut self, ui: &mut Ui, scene: Option<&StaticScene>) {
        plane_ui(ui, "slice axis", &mut self.slice_plane, scene);
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.quantity, Quantity::Potential, "Potential");
            ui.radio_value(&mut self.quantity, Quantity::Field, "|E|");
        });
        let electrodes = scene.map_or(&[][..], |scene| scene.electrodes.as_slice());
        let name = electrodes.get(self.electrode).map_or("–", |electrode| electrode.name.as_str());
        ComboBox::from_label("at 1 V").selected_text(name).show_ui(ui, |ui| {
            for (index, electrode) in electrodes.iter().enumerate() {
                ui.selectable_value(&mut self.electrode, index, &electrode.name);
            }
        });
    }
}

/// Axis and position of a plane, in millimetres.
fn plane_ui(ui: &mut Ui, name: &str, plane: &mut Plane, scene: Option<&StaticScene>) {
    ui.horizontal(|ui| {
        ui.label(name);
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            if ui.selectable_label(plane.axis == axis, letter).clicked() {
                plane.axis = axis;
            }
        }
    });
    let range = match scene {
        Some(scene) => scene.domain.min[plane.axis] * 1e3..=scene.domain.max[plane.axis] * 1e3,
        None => -250.0..=250.0,
    };
    let mut millimetres = plane.position * 1e3;
    let slider = Slider::new(&mut millimetres, range).text("position").suffix(" mm").fixed_decimals(1);
    if ui.add(slider).changed() {
        plane.position = millimetres * 1e-3;
    }
}
