//! The 3D view of a scene: what stands where, and what it does to the mesh and to the field.

mod frame;

pub use frame::{BodyPose, Frame3d, Frame3dBuilder};

use eframe::egui_wgpu::RenderState;
use egui::Ui;

/// What became of the scene while it was shown.
#[derive(Clone, Debug, Default)]
pub struct SceneResponse {
    /// A body stands elsewhere than before.
    pub moved: bool,
    /// A drag of a body ended, by letting go of it or with Esc.
    pub drag_ended: bool,
}

/// The 3D view: camera, gizmo and what is to be seen.
#[derive(Debug, Default)]
pub struct Scene3d {}

impl Scene3d {
    /// Makes a view that draws with the window's graphics device; without one it says so in place of the picture.
    pub fn new(_render_state: Option<&RenderState>) -> Self {
        Self {}
    }

    /// Shows a frame in all the space that is left, and lets the pointer turn the camera and move bodies. `bodies` are
    /// drawn where they are asked to stand, which may be ahead of the frame.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        _frame: &Frame3d,
        _bodies: &mut [BodyPose],
        _selected: &mut Option<usize>,
    ) -> SceneResponse {
        let _ = ui.allocate_space(ui.available_size());
        SceneResponse::default()
    }

    /// Check boxes and sliders for what is to be seen.
    pub fn options_ui(&mut self, _ui: &mut Ui) {}
}
