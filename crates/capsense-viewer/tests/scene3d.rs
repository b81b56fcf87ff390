//! The 3D view, drawn without a display on whatever Vulkan driver there is, and what the pointer does in it.
//!
//! The pictures in `tests/snapshots` are written by `UPDATE_SNAPSHOTS=true cargo test --workspace`.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use capsense::{Pipeline, Scene};
use capsense_core::geometry::Pose;
use capsense_viewer::scene3d::{BodyPose, Camera, Clip, Frame3d, Frame3dBuilder, Plane, Quantity, Scene3d};
use egui::{Key, Pos2, Rect, Theme, Vec2};
use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, SnapshotOptions};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;
use std::path::Path;

const SCENE: &str = r#"
mesh.generate = { elements = 30000 }
sensor.substrate = { thickness = 3e-3, relative_permittivity = 4.4, size = [0.16, 0.14], back = "open" }
sensor.electrode = [
    { name = "E1", rectangle = { center = [0.0, -0.035], size = [0.12, 0.02] } },
    { name = "E2", rectangle = { center = [0.0, 0.0], size = [0.12, 0.02] } },
    { name = "E3", rectangle = { center = [0.0, 0.035], size = [0.12, 0.02] } },
]
[[object]]
name = "bar"
box = { size = [0.15, 0.1, 0.03] }
material = { conductor = "grounded" }
trajectory = { waypoints = [[0.0, -0.09, 0.07], [0.0, 0.09, 0.07]], speed = 1.0 }
[[object]]
name = "ball"
sphere = { radius = 0.035 }
material = { conductor = "floating" }
position = [0.02, 0.09, 0.06]
[[object]]
name = "rod"
capsule = { radius = 0.02, length = 0.08 }
material = { relative_permittivity = 3.0 }
position = [-0.12, 0.06, 0.12]
rotation = [0.0, 0.5, 0.0, 0.8660254037844386]
"#;

struct View {
    scene3d: Scene3d,
    frame: Frame3d,
    bodies: Vec<BodyPose>,
    selected: Option<usize>,
    moved: usize,
    drags_ended: usize,
}

impl eframe::App for View {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let Self { scene3d, frame, bodies, selected, .. } = self;
            let outcome = scene3d.show(ui, frame, bodies, selected);
            self.moved += usize::from(outcome.moved);
            self.drags_ended += usize::from(outcome.drag_ended);
        });
    }
}

/// The third frame of [`SCENE`], what was computed for it, and where its bodies are.
fn computed() -> (Pipeline, Frame3d, Vec<BodyPose>) {
    let scene = Scene::parse("scene.toml", SCENE, Path::new(".")).unwrap();
    let mut pipeline = Pipeline::new(&scene).unwrap();
    let mut builder = Frame3dBuilder::new(&scene, &pipeline);
    let index = 3;
    for frame in 0..=index {
        pipeline.frame(frame).unwrap();
    }
    let time = index as f64 / scene.frame_rate;
    let bodies = scene.objects.iter().map(|object| BodyPose::new(&object.name, &object.motion.pose_at(time)));
    let frame = builder.snapshot(&pipeline);
    (pipeline, frame, bodies.collect())
}

fn harness(theme: Theme) -> Harness<'static, View> {
    let (_, frame, bodies) = computed();
    let builder = Harness::builder().with_size(Vec2::new(800.0, 600.0)).with_theme(theme).wgpu();
    let mut harness = builder.build_eframe(move |cc| View {
        scene3d: Scene3d::new(cc.wgpu_render_state.as_ref()),
        frame,
        bodies,
        selected: None,
        moved: 0,
        drags_ended: 0,
    });
    harness.run_steps(2);
    harness
}

/// Drivers round differently: pixels on the edges of lines and letters may differ.
fn options() -> SnapshotOptions {
    SnapshotOptions::new().threshold(1.0).max_failed_pixels(1500)
}

/// Nearer to the sensor than all of the domain.
fn look_closer(harness: &mut Harness<'_, View>) {
    let camera = harness.state_mut().scene3d.camera_mut();
    camera.target = DVec3::new(0.0, 0.0, 0.04);
    camera.distance = 0.95;
}

fn picture() -> Rect {
    Rect::from_min_size(Pos2::ZERO, Vec2::new(800.0, 600.0))
}

#[test]
fn a_slice_shows_the_potential() {
    let mut harness = harness(Theme::Dark);
    harness.get_by_label_contains("3D view");
    harness.snapshot_options("scene_potential", &options());
}

#[test]
fn a_slice_shows_the_field_on_light_ground() {
    let mut harness = harness(Theme::Light);
    look_closer(&mut harness);
    let options_3d = harness.state_mut().scene3d.options_mut();
    (options_3d.quantity, options_3d.electrode) = (Quantity::Field, 1);
    harness.run_steps(2);
    harness.snapshot_options("scene_field", &options());
}

#[test]
fn occupied_elements_and_cut_edges_are_coloured() {
    let mut harness = harness(Theme::Dark);
    look_closer(&mut harness);
    let options_3d = harness.state_mut().scene3d.options_mut();
    (options_3d.slice, options_3d.occupied, options_3d.cut_edges) = (false, true, true);
    harness.run_steps(2);
    harness.snapshot_options("scene_occupied", &options());
}

#[test]
fn elements_that_changed_are_highlighted() {
    let mut harness = harness(Theme::Light);
    look_closer(&mut harness);
    let options_3d = harness.state_mut().scene3d.options_mut();
    (options_3d.slice, options_3d.changed, options_3d.depth) = (false, true, true);
    harness.run_steps(2);
    harness.snapshot_options("scene_changed", &options());
}

#[test]
fn the_mesh_is_cut_open() {
    let mut harness = harness(Theme::Dark);
    let options_3d = harness.state_mut().scene3d.options_mut();
    (options_3d.slice, options_3d.mesh) = (false, true);
    options_3d.clip = Clip { plane: Plane { axis: 0, position: 0.003 }, keeps_lower: true };
    harness.run_steps(2);
    harness.snapshot_options("scene_mesh", &options());
}

#[test]
fn a_selected_body_has_handles() {
    let mut harness = harness(Theme::Dark);
    look_closer(&mut harness);
    harness.state_mut().selected = Some(0);
    harness.run_steps(2);
    harness.snapshot_options("scene_gizmo", &options());
}

fn on_screen(harness: &Harness<'_, View>, point: DVec3) -> Pos2 {
    harness.state().scene3d.camera().project(point, picture()).unwrap()
}

fn click(harness: &mut Harness<'_, View>, at: Pos2) {
    harness.hover_at(at);
    harness.run_steps(1);
    harness.drag_at(at);
    harness.run_steps(1);
    harness.drop_at(at);
    harness.run_steps(2);
}

#[test]
fn a_click_selects_what_is_under_the_pointer() {
    let mut harness = harness(Theme::Dark);
    for body in [1, 0, 2] {
        let at = on_screen(&harness, harness.state().bodies[body].position);
        click(&mut harness, at);
        assert_eq!(harness.state().selected, Some(body));
    }
    click(&mut harness, Pos2::new(20.0, 300.0));
    assert_eq!(harness.state().selected, None);
    assert_eq!(harness.state().moved, 0);
}

/// Presses at a place, moves by steps, and leaves the button down.
fn start_drag(harness: &mut Harness<'_, View>, from: Pos2, by: Vec2) {
    harness.hover_at(from);
    harness.run_steps(1);
    harness.drag_at(from);
    harness.run_steps(1);
    for step in 1..=4 {
        harness.hover_at(from + by * (step as f32 / 4.0));
        harness.run_steps(1);
    }
}

#[test]
fn the_body_follows_the_pointer_and_escape_puts_it_back() {
    let mut harness = harness(Theme::Dark);
    harness.state_mut().selected = Some(1);
    harness.run_steps(1);
    let before = harness.state().bodies.clone();
    let camera = *harness.state().scene3d.camera();
    // Beside the handles, on the ball.
    let middle = on_screen(&harness, before[1].position);
    let (from, by) = (middle + Vec2::new(-9.0, 14.0), Vec2::new(70.0, -40.0));
    start_drag(&mut harness, from, by);
    let moved = harness.state().bodies[1].position;
    assert!(harness.state().scene3d.is_dragging());
    let [_, _, forward] = camera.axes();
    assert!((moved - before[1].position).dot(forward).abs() < 1e-9, "it moves across the line of sight");
    let seen = on_screen(&harness, moved);
    // The ball's surface is a little nearer to the camera than its middle.
    assert!(seen.distance(middle + by) < 6.0, "{seen:?}, {:?}", middle + by);
    assert!(harness.state().moved > 0);
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert_eq!(harness.state().bodies, before);
    assert!(!harness.state().scene3d.is_dragging());
    assert_eq!(harness.state().drags_ended, 1);
    assert_eq!(*harness.state().scene3d.camera(), camera, "the camera stood still all the time");
}

#[test]
fn an_arrow_moves_its_body_along_its_axis_alone() {
    let mut harness = harness(Theme::Dark);
    harness.state_mut().selected = Some(0);
    harness.run_steps(1);
    let before = harness.state().bodies[0].position;
    let ahead = on_screen(&harness, before + DVec3::Z * 0.01) - on_screen(&harness, before);
    let from = on_screen(&harness, before) + ahead.normalized() * 66.0;
    start_drag(&mut harness, from, ahead.normalized() * 30.0);
    harness.drop_at(from + ahead.normalized() * 30.0);
    harness.run_steps(2);
    let moved = harness.state().bodies[0].position - before;
    let asked = on_screen(&harness, before + moved) - on_screen(&harness, before);
    assert!(moved.truncate().length() < 1e-12 && moved.z > 0.0, "{moved}");
    assert!((asked.length() - 30.0).abs() < 3.0, "{asked:?}");
    assert_eq!(harness.state().drags_ended, 1);
}

#[test]
fn dragging_beside_bodies_turns_the_camera_and_f_shows_all_again() {
    let mut harness = harness(Theme::Dark);
    let before = *harness.state().scene3d.camera();
    let from = Pos2::new(60.0, 500.0);
    start_drag(&mut harness, from, Vec2::new(80.0, 30.0));
    harness.drop_at(from + Vec2::new(80.0, 30.0));
    harness.run_steps(2);
    let turned = *harness.state().scene3d.camera();
    assert!(turned.yaw != before.yaw && turned.pitch != before.pitch);
    assert_eq!((turned.target, turned.distance), (before.target, before.distance));
    harness.state_mut().scene3d.camera_mut().target = DVec3::splat(0.3);
    harness.hover_at(from);
    harness.key_press(Key::F);
    harness.run_steps(2);
    let all = *harness.state().scene3d.camera();
    assert!(all.target.distance(before.target) < 1e-12);
    assert_eq!(all.yaw, turned.yaw);
}

#[test]
fn options_choose_what_is_seen() {
    let mut scene3d = Scene3d::new(None);
    let mut harness = Harness::builder().with_size(Vec2::new(260.0, 420.0)).build_ui(move |ui| {
        scene3d.options_ui(ui);
    });
    harness.run();
    for label in ["Bodies", "Occupied elements", "Cut edges", "Changed elements", "Depth pictures", "Slice"] {
        harness.get_by_label(label);
    }
    assert!(harness.query_by_label("Keep the lower side").is_none());
    harness.get_by_label("Mesh").click();
    harness.run();
    harness.get_by_label("Keep the lower side");
}

#[test]
fn without_a_graphics_device_the_view_says_so() {
    let (_, frame, mut bodies) = computed();
    let mut scene3d = Scene3d::new(None);
    let mut selected = Some(7);
    let mut harness = Harness::builder().with_size(Vec2::new(300.0, 200.0)).build_ui(move |ui| {
        let outcome = scene3d.show(ui, &frame, &mut bodies, &mut selected);
        assert!(!outcome.moved && selected.is_none());
    });
    harness.run();
    harness.get_by_label_contains("needs a graphics device");
}

#[test]
fn a_frame_holds_what_was_computed() {
    let (pipeline, frame, bodies) = computed();
    let mesh = pipeline.simulator().sensor().mesh();
    let is_near = |element: usize, body: &BodyPose, half: DVec3| {
        (body.pose().object_from_sensor(mesh.centroid(element)).abs() - half).max_element() < 0.02
    };
    let halves = [DVec3::new(0.075, 0.05, 0.015), DVec3::splat(0.035), DVec3::new(0.02, 0.02, 0.06)];
    let near = |element: usize| bodies.iter().zip(halves).any(|(body, half)| is_near(element, body, half));
    assert!(frame.occupied_elements().len() > 50);
    assert!(frame.occupied_elements().all(near), "nothing is occupied beside bodies");
    let volume: f64 = frame
        .occupied_elements()
        .map(|element| capsense_core::mesh::signed_volume(mesh.corners(element)))
        .sum();
    let of_bodies = 0.15 * 0.1 * 0.03 + 4.0 / 3.0 * PI * 0.035f64.powi(3) + PI * 0.02f64.powi(2) * 0.1067;
    assert!((volume / of_bodies - 1.0).abs() < 0.5, "{volume} {of_bodies}");
    // Only the bar moved.
    let changed: Vec<usize> = frame.changed_elements().collect();
    assert!(!changed.is_empty() && changed.len() < mesh.tets().len() / 4, "{}", changed.len());
    assert!(changed.iter().all(|&element| {
        (bodies[0].pose().object_from_sensor(mesh.centroid(element)).abs() - halves[0]).max_element() < 0.06
    }));
    // A cut edge has its ends on both sides of a surface.
    let conductors = pipeline.simulator().occupancy().conductors();
    let crosses = |[a, b]: [u32; 2]| conductors[a as usize] != conductors[b as usize];
    assert!(frame.cut_edges().iter().filter(|&&ends| crosses(ends)).count() > 50);
}

#[test]
fn isolated_bodies_have_their_own_potential_and_others_none() {
    let (pipeline, frame, _) = computed();
    let conductors = pipeline.simulator().occupancy().conductors();
    let of = |body: u16| {
        let nodes = (0..conductors.len()).filter(move |&node| conductors[node] == body);
        nodes.map(|node| frame.potentials(2)[node]).collect::<Vec<f32>>()
    };
    assert!(!of(0).is_empty() && of(0).iter().all(|&volts| volts == 0.0), "the bar is grounded");
    let ball = of(1);
    assert!(ball.iter().all(|volts| (volts - ball[0]).abs() < 1e-6), "{ball:?}");
    assert!(ball[0] > 0.05 && ball[0] < 0.9, "{}", ball[0]);
    // Nearer to E3 than to E1.
    let node = (0..conductors.len()).find(|&node| conductors[node] == 1).unwrap();
    assert!(frame.potentials(0)[node] < ball[0]);
    assert!(frame.potentials(9).is_empty());
}

#[test]
fn a_body_stands_where_its_pose_says() {
    let pose = Pose { translation: DVec3::new(1.0, 2.0, 3.0), rotation: DQuat::from_rotation_y(0.3) };
    assert_eq!(BodyPose::new("a", &pose).pose(), pose);
    assert!(Camera::default().distance > 0.0);
}
