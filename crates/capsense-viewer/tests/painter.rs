//! What the plain painter draws on software drivers is what egui's own painter draws.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense::{Pipeline, Scene};
use capsense_viewer::plain_painter;
use capsense_viewer::scene3d::{BodyPose, Frame3d, Frame3dBuilder, Scene3d};
use common::SCENE;
use egui::{Color32, ColorImage, Panel, Rect, TextureHandle, TextureOptions, Vec2, pos2};
use egui_kittest::Harness;
use std::path::Path;

const SIZE: Vec2 = Vec2::new(640.0, 480.0);

/// Panels and pictures around, under and over the 3D view.
struct View {
    scene3d: Scene3d,
    frame: Frame3d,
    bodies: Vec<BodyPose>,
    texts: usize,
    pictures: Vec<TextureHandle>,
}

impl View {
    /// A new picture, or another look of the last one, when `step` changes.
    fn change(&mut self, ctx: &egui::Context, step: usize) {
        let pixel = |index: usize| Color32::from_rgb((40 * (index % 7)) as u8, (60 * step) as u8, 200);
        let image = |side: usize| ColorImage::new([side, side], (0..side * side).map(pixel).collect());
        match step {
            0 => self.pictures.push(ctx.load_texture("a", image(5), TextureOptions::NEAREST)),
            1 => self.pictures.push(ctx.load_texture("b", image(9), TextureOptions::LINEAR_REPEAT)),
            2 => self.pictures[0].set_partial([1, 2], image(2), TextureOptions::NEAREST),
            _ => drop(self.pictures.remove(1)),
        }
        self.texts = step;
        // Behind the depth pictures are textures, too; they come and go.
        self.scene3d.options_mut().depth = step != 2;
    }
}

impl eframe::App for View {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        Panel::left("side").exact_size(200.0).show(ui, |ui| {
            for index in 0..12 * (1 + self.texts) {
                ui.label(format!("Ä line {index} of text with {} glyphs", "ΔCμ".repeat(self.texts)));
            }
        });
        egui::CentralPanel::no_frame().show(ui, |ui| {
            self.scene3d.show(ui, &self.frame, &mut self.bodies, &mut Some(1));
        });
        let painter = ui.ctx().layer_painter(egui::LayerId::debug());
        let clipped = painter.with_clip_rect(Rect::from_min_max(pos2(340.0, 140.5), pos2(420.0, 250.0)));
        clipped.circle_filled(pos2(400.0, 200.0), 90.0, Color32::from_rgba_unmultiplied(200, 60, 20, 128));
        for (index, picture) in (0u8..).zip(&self.pictures) {
            let place =
                Rect::from_min_size(pos2(250.0 + 150.0 * f32::from(index), 330.0), Vec2::splat(120.0));
            let part = Rect::from_min_max(pos2(-0.5, -0.5), pos2(1.5, 1.5));
            clipped.with_clip_rect(Rect::EVERYTHING).image(picture.id(), place, part, Color32::WHITE);
        }
    }
}

fn harness(is_plain: bool, pixels_per_point: f32) -> Harness<'static, View> {
    let scene = Scene::parse("scene.toml", SCENE, Path::new(".")).unwrap();
    let mut pipeline = Pipeline::new(&scene).unwrap();
    let mut builder = Frame3dBuilder::new(&scene, &pipeline);
    pipeline.frame(0).unwrap();
    let frame = builder.snapshot(&pipeline);
    let body =
        |object: &capsense::scene::SceneObject| BodyPose::new(&object.name, &object.motion.pose_at(0.0));
    let bodies: Vec<BodyPose> = scene.objects.iter().map(body).collect();
    let builder = Harness::builder().with_size(SIZE).with_pixels_per_point(pixels_per_point).wgpu();
    builder.build_eframe(move |cc| {
        let state = cc.wgpu_render_state.as_ref().unwrap();
        if is_plain {
            plain_painter::install(&cc.egui_ctx, state);
        }
        View {
            scene3d: Scene3d::new(Some(state)),
            frame: frame.clone(),
            bodies: bodies.clone(),
            texts: 0,
            pictures: Vec::new(),
        }
    })
}

#[test]
fn it_draws_what_egui_draws() {
    for pixels_per_point in [1.0, 1.5] {
        let mut both = [false, true].map(|is_plain| harness(is_plain, pixels_per_point));
        for step in 0..5 {
            let [expected, drawn] = both.each_mut().map(|harness| {
                if step < 4 {
                    let ctx = harness.ctx.clone();
                    harness.state_mut().change(&ctx, step);
                }
                harness.run_steps(3);
                harness.render().unwrap()
            });
            assert_eq!(expected.dimensions(), drawn.dimensions());
            let off = |(a, b): (&image::Rgba<u8>, &image::Rgba<u8>)| {
                (0..3).map(|c| a.0[c].abs_diff(b.0[c])).max().unwrap_or(0)
            };
            let offs: Vec<u8> = expected.pixels().zip(drawn.pixels()).map(off).collect();
            // egui filters by itself in tests, the driver with fewer bits: letters and pictures differ by a little.
            let far = offs.iter().filter(|off| **off > 8).count();
            assert!(far < 40, "step {step} at {pixels_per_point}: {far} pixels differ");
            let grounds = expected.pixels().filter(|pixel| *pixel == expected.get_pixel(3, 3)).count();
            assert!(grounds < expected.pixels().len() / 2, "there is something to see");
        }
    }
}
