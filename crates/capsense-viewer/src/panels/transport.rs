//! Play, pause, step, scrub.

use crate::icons::{self, Icon};
use crate::session::Session;
use crate::style::{faint, named};
use egui::{RichText, Slider, Ui};

/// From this width on there is room for the number of the frame.
const WIDE: f32 = 420.0;

/// Below this width there is no time either.
const CRAMPED: f32 = 130.0;

/// Below this width there is no slider.
const NARROW: f32 = 60.0;

/// Draws the bar; nothing where there is nothing to play.
pub fn ui(ui: &mut Ui, session: &mut Session) {
    let frames = session.transport.frames();
    ui.add_enabled_ui(frames > 1, |ui| {
        ui.horizontal(|ui| {
            let transport = &mut session.transport;
            ui.spacing_mut().item_spacing.x = 4.0;
            let press = |ui: &mut Ui, icon, name: &str, keys: &str| {
                icons::button(ui, icon, name, false).on_hover_text(format!("{name} ({keys})")).clicked()
            };
            if press(ui, Icon::Start, "To the beginning", "Home") {
                transport.seek(0);
            }
            if press(ui, Icon::Back, "One frame back", "left arrow") {
                transport.step(-1);
            }
            let (icon, name) =
                if transport.is_playing { (Icon::Pause, "Pause") } else { (Icon::Play, "Play") };
            if press(ui, icon, name, "Space") {
                transport.toggle();
            }
            if press(ui, Icon::On, "One frame on", "right arrow") {
                transport.step(1);
            }
            let repeat = icons::button(ui, Icon::Repeat, "Repeat", transport.repeats);
            if repeat.on_hover_text("begin again at the end").clicked() {
                transport.repeats = !transport.repeats;
            }
            ui.add_space(4.0);
            let speed = egui::DragValue::new(&mut transport.speed).range(0.01..=20.0).speed(0.01);
            ui.add(speed.prefix("× ").max_decimals(2)).on_hover_text("scene seconds per second");
            ui.add_space(4.0);
            if ui.button("all frames").on_hover_text("compute every frame of the scene (R)").clicked() {
                session.run(0..frames);
            }
            let transport = &mut session.transport;
            if ui.available_width() < CRAMPED {
                return;
            }
            let mut text = format!("{:>7.3} / {:.3} s", transport.time_s(), transport.end_s());
            if ui.available_width() > WIDE {
                text += &format!("   frame {} of {frames}", transport.frame());
            }
            let ink = faint(ui);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.label(RichText::new(text).monospace().color(ink));
                let width = ui.available_width() - 12.0;
                if width < NARROW {
                    return;
                }
                let mut frame = transport.frame();
                ui.spacing_mut().slider_width = width;
                let slider = Slider::new(&mut frame, 0..=frames - 1).show_value(false).trailing_fill(true);
                if named(ui.add(slider), "frame").changed() {
                    transport.is_playing = false;
                    transport.seek(frame);
                }
            });
        });
    });
}
