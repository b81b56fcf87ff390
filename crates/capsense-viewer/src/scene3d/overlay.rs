//! What is written over the picture: axes, scale bar, legend, names, and what the depth camera sees.

use super::colour_map::{STOPS, colour, round_down};
use super::frame::Frame3d;
use super::gizmo::{AXIS_COLOURS, Sight};
use super::theme::Theme;
use crate::palette::palette;
use capsense_core::occupancy::{DepthLayers, Surfaces};
use egui::{
    Align2, Color32, ColorImage, Context, CornerRadius, FontId, Mesh, Painter, Pos2, Rect, Shape, Stroke,
    TextureHandle, TextureOptions, Vec2,
};
use glam::DVec3;

/// From the sides of the picture, in points.
const MARGIN: f32 = 14.0;
const NAME: FontId = FontId::proportional(12.0);
const SMALL: FontId = FontId::proportional(11.5);
/// Longest scale bar, in points.
const LONGEST_BAR: f64 = 150.0;

/// A colour map's ends and what they stand for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Legend {
    pub(super) title: String,
    pub(super) unit: &'static str,
    pub(super) range: [f64; 2],
}

/// A round length and what it covers on the screen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScaleBar {
    pub(super) text: String,
    pub(super) points: f32,
}

impl ScaleBar {
    /// The longest round length that covers no more than [`LONGEST_BAR`].
    pub(super) fn new(metres_per_point: f64) -> Self {
        let metres = round_down(LONGEST_BAR * metres_per_point);
        Self { text: length(metres), points: (metres / metres_per_point) as f32 }
    }
}

/// A length with the unit that suits it.
fn length(metres: f64) -> String {
    let (per_metre, unit) = match metres {
        m if m < 1e-3 => (1e6, "µm"),
        m if m < 1.0 => (1e3, "mm"),
        _ => (1.0, "m"),
    };
    format!("{} {unit}", (metres * per_metre * 1e3).round() / 1e3)
}

/// A number in as few digits as tell it.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        large if large >= 1e5 => format!("{value:.0e}"),
        _ => format!("{}", (value * 1e4).round() / 1e4),
    }
}

/// The axes in the lower left corner.
pub(super) fn axes(painter: &Painter, sight: &Sight, theme: &Theme) {
    let middle = sight.rect.left_bottom() + Vec2::new(MARGIN + 30.0, -MARGIN - 30.0);
    let [right, up, forward] = sight.camera.axes();
    let mut order = [0, 1, 2];
    // The one that points away most first.
    order.sort_by(|&a, &b| forward[b].total_cmp(&forward[a]));
    for axis in order {
        let seen = Vec2::new(right[axis] as f32, -up[axis] as f32);
        let tip = middle + seen * 26.0;
        let strength = if forward[axis] > 0.0 { 0.65 } else { 1.0 };
        let colour = AXIS_COLOURS[axis].gamma_multiply(strength);
        painter.line_segment([middle, tip], Stroke::new(2.0, colour));
        let name = ["x", "y", "z"][axis];
        let place = middle + seen * 26.0 + seen.normalized() * 8.0;
        painter.text(place, Align2::CENTER_CENTER, name, FontId::proportional(12.5), colour);
    }
    painter.circle_filled(middle, 2.0, theme.text);
}

/// The scale bar in the lower right corner.
pub(super) fn scale_bar(painter: &Painter, sight: &Sight, theme: &Theme) {
    let bar = ScaleBar::new(sight.camera.metres_per_point(sight.rect));
    let right = sight.rect.right_bottom() - Vec2::splat(MARGIN);
    let left = right - Vec2::X * bar.points;
    let stroke = Stroke::new(1.5, theme.text);
    painter.line_segment([left, right], stroke);
    for end in [left, right] {
        painter.line_segment([end - Vec2::Y * 5.0, end], stroke);
    }
    let middle = left + 0.5 * (right - left) - Vec2::Y * 6.0;
    painter.text(middle, Align2::CENTER_BOTTOM, bar.text, SMALL, theme.text);
}

/// The colour map of the slice at the right side.
pub(super) fn legend(painter: &Painter, rect: Rect, legend: &Legend, theme: &Theme) {
    let height = (0.38 * rect.height()).clamp(60.0, 190.0);
    let top = rect.right_center() + Vec2::new(-MARGIN - 58.0, -0.5 * height);
    let bar = Rect::from_min_size(top, Vec2::new(12.0, height));
    let mut mesh = Mesh::default();
    for stop in 0..STOPS {
        let part = stop as f32 / (STOPS - 1) as f32;
        let y = bar.bottom() - part * height;
        let colour = colour(f64::from(part));
        mesh.colored_vertex(Pos2::new(bar.left(), y), colour);
        mesh.colored_vertex(Pos2::new(bar.right(), y), colour);
        if stop > 0 {
            let first = 2 * stop as u32;
            mesh.add_triangle(first - 2, first - 1, first);
            mesh.add_triangle(first - 1, first, first + 1);
        }
    }
    painter.add(Shape::mesh(mesh));
    painter.rect_stroke(bar, CornerRadius::ZERO, Stroke::new(1.0, theme.domain), egui::StrokeKind::Outside);
    for tick in 0..=4 {
        let part = f64::from(tick) / 4.0;
        let value = legend.range[0] + part * (legend.range[1] - legend.range[0]);
        let at = Pos2::new(bar.right(), bar.bottom() - part as f32 * height);
        painter.line_segment([at, at + Vec2::X * 4.0], Stroke::new(1.0, theme.text));
        painter.text(at + Vec2::X * 7.0, Align2::LEFT_CENTER, number(value), SMALL, theme.text);
    }
    let above = |lines: f32| Pos2::new(rect.right() - MARGIN, bar.top() - 8.0 - 15.0 * lines);
    painter.text(above(1.0), Align2::RIGHT_BOTTOM, &legend.title, SMALL, theme.text);
    painter.text(above(0.0), Align2::RIGHT_BOTTOM, format!("in {}", legend.unit), SMALL, theme.text);
}

/// The name of each electrode beside it.
pub(super) fn names(painter: &Painter, sight: &Sight, frame: &Frame3d, theme: &Theme) {
    for (index, electrode) in frame.scene.electrodes.iter().enumerate() {
        let corners = electrode.border.iter().flatten();
        let mean = corners.clone().sum::<DVec3>() / (2 * electrode.border.len()).max(1) as f64;
        // At the end that is nearest to the viewer.
        let [_, _, forward] = sight.camera.axes();
        let nearest = corners.map(|corner| corner.dot(forward)).fold(f64::INFINITY, f64::min);
        let ends = electrode.border.iter().flatten().filter(|corner| corner.dot(forward) < nearest + 1e-3);
        let (sum, count) = ends.fold((DVec3::ZERO, 0), |(sum, count), corner| (sum + corner, count + 1));
        let end = if count > 0 { sum / f64::from(count) } else { mean };
        if let (Some(end), Some(middle)) = (sight.project(end), sight.project(mean)) {
            let place = end + (end - middle).normalized() * 12.0;
            let name = &electrode.name;
            let half = 0.5 * painter.layout_no_wrap(name.clone(), NAME, theme.text).size();
            let room = sight.rect.shrink2(half);
            // Of an electrode that is seen, all of its name is.
            let is_seen = room.is_positive() && sight.rect.contains(end);
            let place = if is_seen { place.clamp(room.min, room.max) } else { place };
            shadowed(painter, place, name, palette(index), theme);
        }
    }
}

/// Text that can be read on any ground.
fn shadowed(painter: &Painter, at: Pos2, text: &str, colour: Color32, theme: &Theme) {
    let font = NAME;
    for off in [Vec2::new(-1.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(0.0, -1.0), Vec2::new(0.0, 1.0)] {
        painter.text(
            at + off,
            Align2::CENTER_CENTER,
            text,
            font.clone(),
            theme.background.gamma_multiply(0.7),
        );
    }
    painter.text(at, Align2::CENTER_CENTER, text, font, colour);
}

/// Front and back layer as pictures on the device, and the range of z that they show, metres.
#[derive(Clone)]
pub(super) struct DepthPictures {
    textures: [TextureHandle; 2],
    range: [f32; 2],
}

impl DepthPictures {
    /// Of all objects, the nearest front and the farthest back.
    pub(super) fn new(ctx: &Context, layers: &DepthLayers, theme: &Theme) -> Self {
        let [front, back] = merged(layers);
        let seen = front.iter().chain(&back).copied().filter(|z| z.is_finite());
        let range = seen.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        let textures = [("depth front", &front), ("depth back", &back)].map(|(name, depths)| {
            ctx.load_texture(name, image(layers, depths, range, theme), TextureOptions::NEAREST)
        });
        Self { textures, range }
    }

    /// Shows both in the upper right corner.
    pub(super) fn show(&self, painter: &Painter, rect: Rect, theme: &Theme) {
        let side = (0.24 * rect.width().min(rect.height())).clamp(50.0, 150.0);
        let mut corner = rect.right_top() + Vec2::new(-MARGIN, MARGIN + 16.0);
        for (texture, name) in self.textures.iter().zip(["front", "back"]).rev() {
            let size = texture.size_vec2();
            let size = size * (side / size.max_elem());
            let place = Rect::from_min_size(corner - Vec2::X * size.x, size);
            let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            painter.image(texture.id(), place, all, Color32::WHITE);
            let stroke = Stroke::new(1.0, theme.domain);
            painter.rect_stroke(place, CornerRadius::ZERO, stroke, egui::StrokeKind::Outside);
            let above = place.left_top() - Vec2::Y * 3.0;
            painter.text(above, Align2::LEFT_BOTTOM, name, SMALL, theme.text);
            corner.x -= size.x + 8.0;
        }
        let [low, high] = self.range.map(|z| f64::from(z) * 1e3);
        let text =
            if low <= high { format!("z {low:.1} to {high:.1} mm") } else { "no object is seen".to_owned() };
        let place = rect.right_top() + Vec2::new(-MARGIN, MARGIN + side + 20.0);
        painter.text(place, Align2::RIGHT_TOP, text, SMALL, theme.text);
    }
}

/// The nearest front and the farthest back of all objects, row by row.
fn merged(layers: &DepthLayers) -> [Vec<f32>; 2] {
    let pixels = layers.view().width * layers.view().height;
    let mut both = [vec![f32::INFINITY; pixels], vec![f32::NEG_INFINITY; pixels]];
    for object in 0..layers.objects() {
        both[0].iter_mut().zip(layers.front(object)).for_each(|(z, &front)| *z = z.min(front));
        both[1].iter_mut().zip(layers.back(object)).for_each(|(z, &back)| *z = z.max(back));
    }
    both
}

/// Near is light. y grows upwards, as it does in the sensor frame seen from the front.
fn image(layers: &DepthLayers, depths: &[f32], [low, high]: [f32; 2], theme: &Theme) -> ColorImage {
    let (width, height) = (layers.view().width, layers.view().height);
    let ground = theme.section;
    let pixel = |z: f32| match z.is_finite() {
        true => colour(1.0 - 0.85 * f64::from((z - low) / (high - low).max(1e-9))),
        false => ground,
    };
    let rows = depths.chunks_exact(width.max(1)).rev();
    ColorImage::new([width, height], rows.flatten().map(|&z| pixel(z)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bars_are_round_and_as_long_as_they_say() {
        for (metres_per_point, text) in [(1e-3, "100 mm"), (2e-6, "200 µm"), (0.02, "2 m"), (4.1e-4, "50 mm")]
        {
            let bar = ScaleBar::new(metres_per_point);
            assert_eq!(bar.text, text);
            let (value, unit) = text.split_once(' ').unwrap();
            let metres = value.parse::<f64>().unwrap()
                * match unit {
                    "µm" => 1e-6,
                    "mm" => 1e-3,
                    _ => 1.0,
                };
            assert!((f64::from(bar.points) * metres_per_point / metres - 1.0).abs() < 1e-6);
            assert!(bar.points <= 150.001 && bar.points > 59.0, "{}", bar.points);
        }
    }

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        let texts = [0.0, 0.25, 1.0, 12.5, 2000.0, 2e5].map(number);
        assert_eq!(texts, ["0", "0.25", "1", "12.5", "2000", "2e5"]);
    }
}
