//! The line at the bottom: what is being done, what went wrong, and on what.

use crate::panels::simulation::grouped;
use crate::session::{Session, Severity};
use crate::style::{error_colour, faint, named, warning_colour};
use crate::worker::Activity;
use egui::{Color32, RichText, Ui};

/// What is being done, in words.
pub(crate) fn doing(activity: Activity) -> &'static str {
    match activity {
        Activity::Idle => "ready",
        Activity::Loading => "reading the scene and making its mesh …",
        Activity::Solving => "computing …",
        Activity::Bars => "telling error bars …",
    }
}

/// Draws the line.
pub(crate) fn ui(ui: &mut Ui, session: &mut Session) {
    ui.horizontal(|ui| {
        let activity = session.activity();
        let colour = match activity {
            Activity::Idle => Color32::from_rgb(0x4c, 0xaf, 0x6d),
            _ => Color32::from_rgb(0xe8, 0xb5, 0x3a),
        };
        let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(10.0), egui::Sense::hover());
        ui.painter().circle_filled(dot.center(), 4.0, colour);
        let ink = faint(ui);
        ui.label(RichText::new(doing(activity)).color(ink));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            facts(ui, session);
            message(ui, session);
        });
    });
}

fn facts(ui: &mut Ui, session: &Session) {
    let ink = faint(ui);
    if let Some(last) = &session.last {
        let text = format!("{:.2} ms a frame", last.frame.milliseconds.total);
        ui.label(RichText::new(text).color(ink).monospace());
    }
    if let Some(open) = &session.open {
        ui.label(RichText::new(format!("{} tets", grouped(open.mesh.tets))).color(ink));
    }
    let contact = session.last.as_ref().and_then(|last| last.contacts.first().copied());
    if let (Some(contact), Some(open)) = (contact, &session.open) {
        let name = |names: Option<&String>| names.cloned().unwrap_or_default();
        let object = name(open.scene.objects.get(contact.object).map(|object| &object.name));
        let electrode = name(open.scene.electrodes.get(contact.electrode));
        let text = format!("{object} touches {electrode}: a short circuit");
        ui.label(RichText::new(text).color(warning_colour(ui)));
    }
}

fn message(ui: &mut Ui, session: &mut Session) {
    let Some(message) = &session.message else { return };
    let colour = match message.severity {
        Severity::Note => faint(ui),
        Severity::Warning => warning_colour(ui),
        Severity::FrameError | Severity::Error => error_colour(ui),
    };
    let text = message.text.clone();
    let is_dismissed = named(ui.small_button("×"), "dismiss").on_hover_text("dismiss").clicked();
    let label = egui::Label::new(RichText::new(&text).color(colour)).truncate();
    ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| ui.add(label).on_hover_text(text));
    if is_dismissed {
        session.message = None;
    }
}
