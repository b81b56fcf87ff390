//! Play, pause, step, scrub.

use crate::session::Session;
use crate::style::faint;
use egui::{RichText, Slider, Ui};

/// Draws the bar; nothing where there is nothing to play.
pub fn ui(ui: &mut Ui, session: &mut Session) {
    let frames = session.transport.frames();
    ui.add_enabled_ui(frames > 1, |ui| {
        ui.horizontal(|ui| {
            let transport = &mut session.transport;
            if ui.button("⏮").on_hover_text("to the beginning (Home)").clicked() {
                transport.seek(0);
            }
            if ui.button("◀").on_hover_text("one frame back (←)").clicked() {
                transport.step(-1);
            }
            let (symbol, name) = if transport.is_playing { ("⏸", "Pause") } else { ("▶", "Play") };
            let button = ui.add(egui::Button::new(symbol).min_size(egui::vec2(34.0, 0.0)));
            button.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, name));
            if button.on_hover_text(format!("{name} (Space)")).clicked() {
                transport.toggle();
            }
            if ui.button("▶|").on_hover_text("one frame on (→)").clicked() {
                transport.step(1);
            }
            ui.toggle_value(&mut transport.repeats, "🔁").on_hover_text("begin again at the end");
            let speed = egui::DragValue::new(&mut transport.speed).range(0.01..=20.0).speed(0.01);
            ui.add(speed.prefix("× ").max_decimals(2)).on_hover_text("scene seconds per second");
            if ui.button("⏩ all frames").on_hover_text("compute every frame of the scene (R)").clicked() {
                session.run(0..frames);
            }
            let transport = &mut session.transport;
            let text = format!(
                "{:>7.3} / {:.3} s   frame {} of {}",
                transport.time_s(),
                transport.end_s(),
                transport.frame() + 1,
                frames
            );
            let ink = faint(ui);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.label(RichText::new(text).monospace().color(ink));
                let mut frame = transport.frame();
                ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(40.0);
                let slider = Slider::new(&mut frame, 0..=frames - 1).show_value(false).trailing_fill(true);
                if ui.add(slider).changed() {
                    transport.is_playing = false;
                    transport.seek(frame);
                }
            });
        });
    });
}
