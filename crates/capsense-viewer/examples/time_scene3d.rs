//! How long a window of 800 by 600 takes that shows the 3D view of the built-in scene on 30 000 tetrahedra and nothing
//! else: building the window's shapes, and drawing them on the graphics device up to the read-back of the picture, which
//! a window on a screen does not need. Medians of 60 frames, wall clock; and, where the system tells it (Linux), the mean
//! processor time of all threads, a software driver's among them, which other programs disturb less.

use anyhow::{Result, anyhow};
use capsense::{Pipeline, Scene};
use capsense_viewer::frame_rate::processor_s;
use capsense_viewer::plain_painter;
use capsense_viewer::scene3d::{BodyPose, Frame3d, Frame3dBuilder, Quantity, Scene3d, ViewOptions};
use egui::Vec2;
use egui_kittest::Harness;
use std::path::Path;
use std::time::Instant;

const FRAMES: usize = 60;

struct View {
    scene3d: Scene3d,
    frame: Frame3d,
    bodies: Vec<BodyPose>,
}

impl eframe::App for View {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        egui::CentralPanel::no_frame().show(ui, |ui| {
            self.scene3d.show(ui, &self.frame, &mut self.bodies, &mut Some(0));
        });
    }
}

/// What differs from frame to frame.
#[derive(Clone, Copy, PartialEq)]
enum Motion {
    Nothing,
    Camera,
    CameraAndScene,
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Processor time of the program so far in ms; not a number where it is not known.
fn processor_ms() -> f64 {
    processor_s().map_or(f64::NAN, |seconds| 1e3 * seconds)
}

fn main() -> Result<()> {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/steel_bar.toml"));
    let text = std::fs::read_to_string(file)?.replace("elements = 100000", "elements = 30000");
    let scene = Scene::parse("steel_bar.toml", &text, Path::new("."))?;
    let mut pipeline = Pipeline::new(&scene)?;
    let mut builder = Frame3dBuilder::new(&scene, &pipeline);
    let (mut frames, mut snapshots) = (Vec::new(), Vec::new());
    for index in 0..FRAMES {
        pipeline.frame(100 + index)?;
        let started = Instant::now();
        frames.push(builder.snapshot(&pipeline));
        snapshots.push(started.elapsed().as_secs_f64() * 1e3);
    }
    println!("snapshot of a frame: {:.2} ms", median(snapshots));
    let pose = scene.objects[0].motion.pose_at(1.0);
    let first = frames[0].clone();
    let mut harness = Harness::builder().with_size(Vec2::new(800.0, 600.0)).wgpu().build_eframe(move |cc| {
        let state = cc.wgpu_render_state.as_ref();
        state.inspect(|state| plain_painter::install(&cc.egui_ctx, state));
        View { scene3d: Scene3d::new(state), frame: first, bodies: vec![BodyPose::new("bar", &pose)] }
    });
    let plain = ViewOptions { slice: false, ..ViewOptions::default() };
    let all = ViewOptions {
        slice: true,
        mesh: true,
        occupied: true,
        cut_edges: true,
        changed: true,
        depth: true,
        ..plain
    };
    let cases = [
        ("nothing but bodies", plain),
        ("slice, potential", ViewOptions { slice: true, ..plain }),
        ("slice, |E|", ViewOptions { slice: true, quantity: Quantity::Field, ..plain }),
        ("mesh, cut open", ViewOptions { mesh: true, ..plain }),
        ("occupied elements and cut edges", ViewOptions { occupied: true, cut_edges: true, ..plain }),
        ("changed elements", ViewOptions { changed: true, ..plain }),
        ("all of it", all),
    ];
    for (motion, name) in [
        (Motion::Nothing, "nothing moves"),
        (Motion::Camera, "the camera turns"),
        (Motion::CameraAndScene, "camera and scene"),
    ] {
        for (case, options) in &cases {
            *harness.state_mut().scene3d.options_mut() = *options;
            let (mut shapes, mut drawing) = (Vec::new(), Vec::new());
            let before = processor_ms();
            for frame in &frames {
                if motion != Motion::Nothing {
                    harness.state_mut().scene3d.camera_mut().turn(Vec2::new(3.0, 0.2));
                }
                if motion == Motion::CameraAndScene {
                    harness.state_mut().frame = frame.clone();
                }
                let started = Instant::now();
                harness.step();
                shapes.push(started.elapsed().as_secs_f64() * 1e3);
                let started = Instant::now();
                harness.render().map_err(|reason| anyhow!(reason))?;
                drawing.push(started.elapsed().as_secs_f64() * 1e3);
            }
            let processor = (processor_ms() - before) / FRAMES as f64;
            let (shapes, drawing) = (median(shapes), median(drawing));
            println!(
                "{name:16} {case:31} shapes {shapes:5.2} ms, drawing {drawing:6.2} ms, processor {processor:6.2} ms"
            );
        }
    }
    Ok(())
}
