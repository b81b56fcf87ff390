//! The 3D view of a scene: what stands where, and what it does to the mesh and to the field.
//!
//! The worker makes a [`Frame3d`] of what it computed, [`Scene3d::show`] draws it and lets the pointer move the camera and
//! the bodies. The picture is drawn with depth into a texture (`gpu`), on which axes, scales and handles are painted
//! (`overlay`, `gizmo`).

mod buffers;
mod camera;
mod colour_map;
mod content;
mod frame;
mod gizmo;
mod gpu;
mod options;
mod outlines;
mod overlay;
mod pick;
mod pipelines;
mod slice;
mod static_scene;
mod theme;

pub use camera::{Camera, Ray};
pub use colour_map::colour;
pub use frame::{BodyPose, Frame3d, Frame3dBuilder};
pub use gizmo::Handle;
pub use options::{Clip, Quantity, ViewOptions};
pub use slice::Plane;

use capsense_core::geometry::{Aabb, Pose};
use content::{Content, Seen};
use eframe::egui_wgpu::{Callback, RenderState};
use eframe::wgpu;
use egui::{Key, Modifiers, PointerButton, Pos2, Rect, Response, Role, Sense, Ui};
use gizmo::{Drag, Gizmo, Sight};
use gpu::Gpu;
use overlay::DepthPictures;
use static_scene::StaticScene;
use std::sync::Arc;
use theme::Theme;

/// Samples of a pixel where a graphics processor draws. A software driver would take several times as long.
const SAMPLES: u32 = 4;

/// What is said in place of the picture.
const NO_DEVICE: &str = "needs a graphics device";

/// What became of the scene while it was shown.
#[derive(Clone, Debug, Default)]
pub struct SceneResponse {
    /// A body stands elsewhere than before.
    pub moved: bool,
    /// A drag of a body ended, by letting go of it or with Esc.
    pub drag_ended: bool,
}

/// The 3D view: camera, gizmo and what is to be seen.
pub struct Scene3d {
    can_draw: bool,
    camera: Camera,
    options: ViewOptions,
    content: Content,
    drag: Option<Drag>,
    /// What the camera was made to see all of.
    fitted: Option<Aabb>,
    scene: Option<Arc<StaticScene>>,
    depth: Option<(Arc<frame::Computed>, bool, DepthPictures)>,
}

impl Scene3d {
    /// Makes a view that draws with the window's graphics device; without one it says so in place of the picture.
    pub fn new(render_state: Option<&RenderState>) -> Self {
        if let Some(state) = render_state {
            let is_software = state.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
            let samples = if is_software { 1 } else { SAMPLES };
            let gpu = Gpu::new(&state.device, state.target_format, samples);
            state.renderer.write().callback_resources.insert(gpu);
        }
        Self {
            can_draw: render_state.is_some(),
            camera: Camera { yaw: 0.9, ..Camera::default() },
            options: ViewOptions::default(),
            content: Content::default(),
            drag: None,
            fitted: None,
            scene: None,
            depth: None,
        }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The camera, to be moved.
    pub fn camera_mut(&mut self) -> &mut Camera {
        &mut self.camera
    }

    /// What is to be seen.
    pub fn options(&self) -> &ViewOptions {
        &self.options
    }

    /// What is to be seen, to be chosen.
    pub fn options_mut(&mut self) -> &mut ViewOptions {
        &mut self.options
    }

    /// Whether a body is being dragged.
    pub fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// Shows a frame in all the space that is left, and lets the pointer turn the camera and move bodies. `bodies` are
    /// drawn where they are asked to stand, which may be ahead of the frame.
    ///
    /// Drag: turn. Drag with another button, or with Shift: move. Scroll: zoom. Click: select a body. Drag a handle of the
    /// selected body, or the body: move it; Esc puts it back. F: show sensor and bodies.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        frame: &Frame3d,
        bodies: &mut [BodyPose],
        selected: &mut Option<usize>,
    ) -> SceneResponse {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let info = match self.can_draw {
            true => format!("3D view, {} elements", frame.scene.tets.len()),
            false => format!("3D view: {NO_DEVICE}"),
        };
        response.widget_info(|| egui::WidgetInfo::labeled(Role::Image, true, &info));
        self.follow_scene(frame, bodies, rect);
        *selected = selected.filter(|&body| body < bodies.len().min(frame.scene.bodies.len()));
        let mut outcome = SceneResponse::default();
        self.drag_bodies(ui, &response, frame, bodies, selected, &mut outcome);
        self.move_camera(ui, &response, &focus(frame, bodies));
        if ui.is_rect_visible(rect) {
            self.paint(ui, &response, frame, bodies, *selected);
        }
        outcome
    }

    /// Check boxes and sliders for what is to be seen.
    pub fn options_ui(&mut self, ui: &mut Ui) {
        self.options.ui(ui, &mut self.camera, self.scene.as_deref());
        if ui.button("Show all").on_hover_text("F").clicked() {
            self.fitted = None;
        }
    }

    /// Of a scene of another size, sensor and bodies are shown.
    fn follow_scene(&mut self, frame: &Frame3d, bodies: &[BodyPose], rect: Rect) {
        if self.fitted != Some(frame.scene.domain) {
            self.camera.fit(&focus(frame, bodies), rect);
            self.fitted = Some(frame.scene.domain);
        }
        if self.scene.as_ref().is_none_or(|scene| !Arc::ptr_eq(scene, &frame.scene)) {
            self.scene = Some(frame.scene.clone());
            self.drag = None;
        }
        self.options.electrode = self.options.electrode.min(frame.scene.electrodes.len().saturating_sub(1));
    }

    fn sight(&self, rect: Rect) -> Sight {
        Sight { camera: self.camera, rect }
    }

    fn drag_bodies(
        &mut self,
        ui: &Ui,
        response: &Response,
        frame: &Frame3d,
        bodies: &mut [BodyPose],
        selected: &mut Option<usize>,
        outcome: &mut SceneResponse,
    ) {
        let sight = self.sight(response.rect);
        let body_at = |at: Pos2, bodies: &[BodyPose]| {
            let ray = sight.ray(at);
            pick::first_met(&ray, &frame.scene.bodies, bodies).map(|(body, depth)| (body, ray.at(depth)))
        };
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            let is_handle =
                selected.is_some_and(|body| Gizmo::new(sight, bodies[body].position).handle_at(at).is_some());
            if !is_handle {
                *selected = body_at(at, bodies).map(|(body, _)| body);
            }
        }
        let is_shifted = ui.input(|input| input.modifiers.shift);
        if response.drag_started_by(PointerButton::Primary)
            && !is_shifted
            && let (Some(body), Some(at)) = (*selected, ui.input(|input| input.pointer.press_origin()))
        {
            let met = body_at(at, bodies).filter(|(met, _)| *met == body && self.options.bodies);
            let handle = Gizmo::new(sight, bodies[body].position).handle_at(at);
            let grabbed = met.map_or(bodies[body].position, |(_, place)| place);
            self.drag = handle
                .or(met.map(|_| Handle::Body))
                .map(|handle| Drag::new(body, handle, at, grabbed, &bodies[body]));
        }
        let Some(drag) = self.drag.take() else {
            return;
        };
        let is_cancelled = ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape));
        let pose = match response.interact_pointer_pos() {
            _ if is_cancelled => Some(*drag.start()),
            Some(at) => drag.pose(&sight, at).map(|pose| within(pose, &frame.scene.domain)),
            None => None,
        };
        if let (Some(pose), Some(body)) = (pose, bodies.get_mut(drag.body))
            && pose != body.pose()
        {
            (body.position, body.rotation) = (pose.translation, pose.rotation);
            outcome.moved = true;
        }
        if is_cancelled || response.drag_stopped() || !response.dragged() {
            outcome.drag_ended = true;
            if is_cancelled {
                ui.ctx().stop_dragging();
            }
        } else {
            self.drag = Some(drag);
        }
    }

    fn move_camera(&mut self, ui: &Ui, response: &Response, focus: &Aabb) {
        let rect = response.rect;
        if self.drag.is_none() && response.dragged() {
            let is_shifted = ui.input(|input| input.modifiers.shift);
            match response.dragged_by(PointerButton::Primary) && !is_shifted {
                true => self.camera.turn(response.drag_delta()),
                false => self.camera.pan(response.drag_delta(), rect),
            }
        }
        if let Some(pointer) = response.hover_pos() {
            let (scrolled, pinched) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.camera.zoom(f64::from(scrolled * 0.004).exp() * f64::from(pinched), pointer, rect);
            let is_writing = ui.ctx().egui_wants_keyboard_input();
            if !is_writing && ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F)) {
                self.camera.fit(focus, rect);
            }
        }
    }

    fn paint(
        &mut self,
        ui: &Ui,
        response: &Response,
        frame: &Frame3d,
        bodies: &[BodyPose],
        selected: Option<usize>,
    ) {
        let (rect, theme) = (response.rect, Theme::of(ui.visuals()));
        let (sight, painter) = (self.sight(rect), ui.painter_at(rect));
        if !self.can_draw {
            let text = format!("The 3D view {NO_DEVICE}.");
            let font = egui::TextStyle::Body.resolve(ui.style());
            painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, theme.text);
            return;
        }
        self.content.update(frame, &self.options, &theme);
        let seen = Seen { frame, bodies, selected, options: &self.options, theme: &theme };
        let picture = self.content.picture(&sight, &seen, ui.ctx().pixels_per_point());
        painter.add(Callback::new_paint_callback(rect, picture));
        if self.options.names {
            overlay::names(&painter, &sight, frame, &theme);
        }
        if let Some(body) = selected {
            let gizmo = Gizmo::new(sight, bodies[body].position);
            let hovered = || response.hover_pos().and_then(|at| gizmo.handle_at(at));
            let active = self.drag.as_ref().map(|drag| drag.handle).or_else(hovered);
            gizmo.draw(&painter, &theme, active);
        }
        overlay::axes(&painter, &sight, &theme);
        overlay::scale_bar(&painter, &sight, &theme);
        if let Some(legend) = self.content.legend() {
            overlay::legend(&painter, rect, legend, &theme);
        }
        self.paint_depth(ui, &painter, frame, &theme);
    }

    fn paint_depth(&mut self, ui: &Ui, painter: &egui::Painter, frame: &Frame3d, theme: &Theme) {
        let Some(layers) = frame.computed.depth.as_ref().filter(|_| self.options.depth) else {
            self.depth = None;
            return;
        };
        let is_current = self.depth.as_ref().is_some_and(|(computed, is_dark, _)| {
            Arc::ptr_eq(computed, &frame.computed) && *is_dark == theme.is_dark
        });
        if !is_current {
            let pictures = DepthPictures::new(ui.ctx(), layers, theme);
            self.depth = Some((frame.computed.clone(), theme.is_dark, pictures));
        }
        if let Some((_, _, pictures)) = &self.depth {
            pictures.show(painter, painter.clip_rect(), theme);
        }
    }
}

/// What to look at: sensor and bodies, as far as these are in the domain.
fn focus(frame: &Frame3d, bodies: &[BodyPose]) -> Aabb {
    let scene = &frame.scene;
    let borders = scene.electrodes.iter().flat_map(|electrode| electrode.border.iter().flatten().copied());
    let board = scene.board.iter().flat_map(|board| [board.min, board.max]);
    let of_bodies = scene.bodies.iter().zip(bodies).flat_map(|(surface, body)| {
        camera::corners(&surface.bounds).map(|corner| body.pose().sensor_from_object(corner))
    });
    let of_bodies = of_bodies.map(|corner| corner.clamp(scene.domain.min, scene.domain.max));
    Aabb::around(borders.chain(board).chain(of_bodies))
}

/// A body is not lost far outside: its origin stays in the domain or less than half of its size beside it.
fn within(mut pose: Pose, domain: &Aabb) -> Pose {
    let beside = 0.5 * domain.size();
    pose.translation = pose.translation.clamp(domain.min - beside, domain.max + beside);
    pose
}
