//! What keys do. [`SHORTCUTS`](crate::panels::dialogs::SHORTCUTS) lists them for the user.

use crate::app::ViewerApp;
use crate::panels::dialogs::{Dialog, Purpose};
use crate::preferences::Theme;
use egui::{Key, Modifiers};
use glam::DVec3;

/// How far one key moves an object, in metres.
const STEP: f64 = 1e-3;

/// Does what the keys of this frame ask for, unless a text is being written.
pub(crate) fn apply(ctx: &egui::Context, app: &mut ViewerApp) {
    if ctx.text_edit_focused() {
        return;
    }
    let pressed = |modifiers: Modifiers, key: Key| ctx.input_mut(|input| input.consume_key(modifiers, key));
    for (key, purpose) in [
        (Key::O, Purpose::Open),
        (Key::S, Purpose::SaveScene),
        (Key::E, Purpose::ExportCsv),
        (Key::P, Purpose::ExportPng),
    ] {
        if pressed(Modifiers::COMMAND, key) {
            app.ask_for_path(purpose);
        }
    }
    if pressed(Modifiers::COMMAND, Key::Z) {
        app.session.undo();
    }
    move_selected(ctx, app);
    let is_help = ctx.input(|input| {
        input.events.iter().any(|event| matches!(event, egui::Event::Text(text) if text == "?"))
    });
    if is_help || pressed(Modifiers::NONE, Key::F1) {
        app.dialog = Some(Dialog::Help);
    }
    // What has the focus may want these keys itself.
    if ctx.memory(|memory| memory.focused().is_some()) {
        return;
    }
    let transport = &mut app.session.transport;
    if pressed(Modifiers::NONE, Key::Space) {
        transport.toggle();
    }
    if pressed(Modifiers::NONE, Key::ArrowLeft) {
        transport.step(-1);
    }
    if pressed(Modifiers::NONE, Key::ArrowRight) {
        transport.step(1);
    }
    if pressed(Modifiers::NONE, Key::Home) {
        transport.seek(0);
    }
    if pressed(Modifiers::NONE, Key::R) {
        let frames = app.session.transport.frames();
        app.session.run(0..frames);
    }
    if pressed(Modifiers::NONE, Key::Delete)
        && let Some(object) = app.session.selected
    {
        app.session.remove_object(object);
    }
    // Else Esc takes the drag back.
    if !app.is_dragging() && pressed(Modifiers::NONE, Key::Escape) {
        app.session.selected = None;
    }
    if pressed(Modifiers::NONE, Key::P) {
        app.curves.toggle_pause();
    }
    if pressed(Modifiers::NONE, Key::A) {
        app.curves.fit();
    }
    let panels = &mut app.preferences.panels;
    for (key, open) in
        [(Key::Num1, &mut panels.scene), (Key::Num2, &mut panels.curves), (Key::Num3, &mut panels.data)]
    {
        *open ^= pressed(Modifiers::NONE, key);
    }
    if pressed(Modifiers::NONE, Key::T) {
        let is_dark = ctx.theme() == egui::Theme::Dark;
        app.preferences.theme = if is_dark { Theme::Light } else { Theme::Dark };
    }
}

fn move_selected(ctx: &egui::Context, app: &mut ViewerApp) {
    let directions = [
        (Key::ArrowLeft, DVec3::NEG_X),
        (Key::ArrowRight, DVec3::X),
        (Key::ArrowDown, DVec3::NEG_Y),
        (Key::ArrowUp, DVec3::Y),
        (Key::PageDown, DVec3::NEG_Z),
        (Key::PageUp, DVec3::Z),
    ];
    let mut way = DVec3::ZERO;
    for (key, direction) in directions {
        for (modifiers, far) in [(Modifiers::ALT | Modifiers::SHIFT, 10.0), (Modifiers::ALT, 1.0)] {
            let times = ctx.input_mut(|input| input.count_and_consume_key(modifiers, key));
            way += direction * (far * times as f64 * STEP);
        }
    }
    let Some(object) = app.session.selected.filter(|_| way != DVec3::ZERO) else { return };
    if let Some(mut pose) = app.session.poses().get(object).copied() {
        pose.translation += way;
        app.session.hold(object, pose);
    }
}
