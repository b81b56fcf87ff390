//! Buttons with signs that no font of the program has.

use egui::{Color32, Pos2, Response, Role, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, pos2, vec2};

/// A sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Icon {
    /// To the beginning.
    Start,
    /// One back.
    Back,
    /// Play.
    Play,
    /// Pause.
    Pause,
    /// One on.
    On,
    /// Begin again at the end.
    Repeat,
}

/// A button with a sign; `name` is what it is called where it cannot be seen.
pub fn button(ui: &mut Ui, icon: Icon, name: &str, is_on: bool) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(28.0, 22.0), Sense::click());
    let is_enabled = ui.is_enabled();
    response.widget_info(|| WidgetInfo::selected(Role::Button, is_enabled, is_on, name));
    let visuals = ui.style().interact_selectable(&response, is_on);
    ui.painter().rect_filled(rect, visuals.corner_radius, visuals.weak_bg_fill);
    let ink = ui.visuals().override_text_color.unwrap_or(visuals.text_color());
    let ink = if is_enabled { ink } else { ink.gamma_multiply(0.4) };
    ui.painter().extend(shapes(icon, rect.center(), ink));
    response
}

fn shapes(icon: Icon, at: Pos2, ink: Color32) -> Vec<Shape> {
    let bar = |x: f32| {
        let rect = egui::Rect::from_center_size(at + vec2(x, 0.0), vec2(2.5, 10.0));
        Shape::rect_filled(rect, 0.5, ink)
    };
    match icon {
        Icon::Start => vec![bar(-5.0), triangle(at + vec2(1.0, 0.0), -1.0, ink)],
        Icon::Back => vec![bar(4.5), triangle(at + vec2(-1.5, 0.0), -1.0, ink)],
        Icon::Play => vec![triangle(at + vec2(0.5, 0.0), 1.25, ink)],
        Icon::Pause => vec![bar(-3.0), bar(3.0)],
        Icon::On => vec![bar(-4.5), triangle(at + vec2(1.5, 0.0), 1.0, ink)],
        Icon::Repeat => {
            let turn = |k: usize| Vec2::angled(-0.9 + 0.26 * k as f32);
            let arc: Vec<Pos2> = (0..=18).map(|k| at + 5.0 * turn(k)).collect();
            let end = arc[0];
            let head = [end + vec2(-4.0, 0.0), end + vec2(1.5, 0.5), end + vec2(0.5, -5.0)];
            let head = Shape::convex_polygon(head.to_vec(), ink, Stroke::NONE);
            vec![Shape::line(arc, Stroke::new(1.6, ink)), head]
        }
    }
}

/// A triangle that points to the right, or to the left for sizes below 0.
fn triangle(at: Pos2, size: f32, ink: Color32) -> Shape {
    let corners = [pos2(-3.5 * size, -5.0 * size), pos2(4.0 * size, 0.0), pos2(-3.5 * size, 5.0 * size)];
    let corners = corners.map(|corner| at + corner.to_vec2());
    Shape::convex_polygon(corners.to_vec(), ink, Stroke::NONE)
}
