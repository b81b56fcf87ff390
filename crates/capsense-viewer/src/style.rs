//! How the window looks: spacing, ground and ink in dark and light, and small widgets that panels share.

use crate::preferences::Theme;
use egui::{Color32, CornerRadius, Frame, Margin, Response, RichText, Stroke, TextStyle, Ui, Vec2, Visuals};

/// Width of the column of labels in forms.
const LABEL_WIDTH: f32 = 92.0;

/// Sets both themes and which is in use.
pub fn apply(ctx: &egui::Context, theme: Theme) {
    ctx.set_theme(match theme {
        Theme::System => egui::ThemePreference::System,
        Theme::Dark => egui::ThemePreference::Dark,
        Theme::Light => egui::ThemePreference::Light,
    });
    ctx.set_visuals_of(egui::Theme::Dark, dark());
    ctx.set_visuals_of(egui::Theme::Light, light());
    ctx.all_styles_mut(|style| {
        style.spacing.item_spacing = Vec2::new(8.0, 5.0);
        style.spacing.button_padding = Vec2::new(8.0, 3.0);
        style.spacing.indent = 14.0;
        style.spacing.slider_width = 120.0;
        style.spacing.interact_size.y = 20.0;
        style.interaction.selectable_labels = false;
    });
}

fn dark() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.panel_fill = Color32::from_rgb(0x1b, 0x1e, 0x24);
    visuals.window_fill = Color32::from_rgb(0x22, 0x26, 0x2d);
    visuals.extreme_bg_color = Color32::from_rgb(0x12, 0x14, 0x18);
    visuals.faint_bg_color = Color32::from_rgb(0x23, 0x27, 0x2f);
    visuals.override_text_color = Some(Color32::from_rgb(0xd6, 0xda, 0xe0));
    visuals.selection.bg_fill = Color32::from_rgb(0x2b, 0x5c, 0x8a);
    rounded(visuals)
}

fn light() -> Visuals {
    let mut visuals = Visuals::light();
    visuals.panel_fill = Color32::from_rgb(0xf6, 0xf7, 0xf9);
    visuals.window_fill = Color32::WHITE;
    visuals.extreme_bg_color = Color32::WHITE;
    visuals.faint_bg_color = Color32::from_rgb(0xec, 0xee, 0xf2);
    visuals.override_text_color = Some(Color32::from_rgb(0x24, 0x29, 0x30));
    visuals.selection.bg_fill = Color32::from_rgb(0xb5, 0xd3, 0xf0);
    rounded(visuals)
}

fn rounded(mut visuals: Visuals) -> Visuals {
    let corner = CornerRadius::same(4);
    let widgets = &mut visuals.widgets;
    for widget in [&mut widgets.inactive, &mut widgets.hovered, &mut widgets.active, &mut widgets.open] {
        widget.corner_radius = corner;
    }
    visuals
}

/// The frame of a panel.
pub fn panel_frame(ui: &Ui) -> Frame {
    Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(10, 8))
}

/// A section of a side panel, which can be folded.
pub fn section(ui: &mut Ui, title: &str, content: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(RichText::new(title).strong()).id_salt(title).default_open(true).show(
        ui,
        |ui| {
            ui.add_space(2.0);
            content(ui);
            ui.add_space(6.0);
        },
    );
}

/// A row of a form: a label of fixed width, then what it is about.
pub fn row<R>(ui: &mut Ui, label: &str, content: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let height = ui.spacing().interact_size.y;
        ui.allocate_ui_with_layout(
            Vec2::new(LABEL_WIDTH, height),
            egui::Layout::left_to_right(egui::Align::Center),
            |ui| {
                ui.set_min_width(LABEL_WIDTH);
                ui.add(egui::Label::new(RichText::new(label).color(faint(ui))).truncate());
            },
        );
        content(ui)
    })
    .inner
}

/// What a widget without a text of its own is called for those who cannot see what stands beside it.
pub fn named(response: Response, name: &str) -> Response {
    response.ctx.accesskit_node_builder(response.id, |node| node.set_label(name));
    response
}

/// Ink for what is less important.
pub fn faint(ui: &Ui) -> Color32 {
    ui.visuals().weak_text_color()
}

/// Ink for failures.
pub fn error_colour(ui: &Ui) -> Color32 {
    match ui.visuals().dark_mode {
        true => Color32::from_rgb(0xff, 0x7b, 0x72),
        false => Color32::from_rgb(0xc0, 0x2b, 0x2b),
    }
}

/// Ink for what is odd.
pub fn warning_colour(ui: &Ui) -> Color32 {
    match ui.visuals().dark_mode {
        true => Color32::from_rgb(0xe3, 0xb3, 0x41),
        false => Color32::from_rgb(0x8a, 0x5d, 0x00),
    }
}

/// One of several values, side by side.
pub fn segmented<T: PartialEq + Copy>(ui: &mut Ui, value: &mut T, choices: &[(T, &str, &str)]) -> bool {
    let before = *value;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (choice, text, hint) in choices {
            ui.selectable_value(value, *choice, *text).on_hover_text(*hint);
        }
    });
    *value != before
}

/// A curve's switch: a dot in its colour, its name and its value.
pub fn chip(ui: &mut Ui, on: &mut bool, colour: Color32, name: &str, value: &str) -> Response {
    let font = TextStyle::Body.resolve(ui.style());
    let mono = TextStyle::Monospace.resolve(ui.style());
    let ink = if *on { ui.visuals().text_color() } else { faint(ui).gamma_multiply(0.7) };
    let name_text = ui.painter().layout_no_wrap(name.to_owned(), font, ink);
    let value_text = ui.painter().layout_no_wrap(value.to_owned(), mono, ink);
    let width =
        24.0 + name_text.size().x + if value.is_empty() { 0.0 } else { 8.0 + value_text.size().x } + 8.0;
    let (rect, mut response) = ui.allocate_exact_size(Vec2::new(width, 22.0), egui::Sense::click());
    if response.clicked() {
        *on = !*on;
        response.mark_changed();
    }
    let label = format!("{name} {value}");
    response.widget_info(|| egui::WidgetInfo::selected(egui::Role::CheckBox, true, *on, label.trim()));
    let fill = if response.hovered() {
        ui.visuals().widgets.hovered.weak_bg_fill
    } else {
        ui.visuals().faint_bg_color
    };
    ui.painter().rect_filled(rect, CornerRadius::same(11), fill);
    let dot = rect.left_center() + Vec2::new(12.0, 0.0);
    if *on {
        ui.painter().circle_filled(dot, 4.5, colour);
    } else {
        ui.painter().circle_stroke(dot, 4.0, Stroke::new(1.2, colour.gamma_multiply(0.6)));
    }
    let at = |x: f32, height: f32| egui::pos2(rect.left() + x, rect.center().y - 0.5 * height);
    let name_width = name_text.size().x;
    ui.painter().galley(at(22.0, name_text.size().y), name_text, ink);
    ui.painter().galley(at(30.0 + name_width, value_text.size().y), value_text, ink);
    response
}
