//! The Maxwell matrix as a heat map, with numbers and error bars.

use crate::preferences::CurvePreferences;
use crate::quantity::Quantity;
use crate::session::{Bars, Session};
use crate::style::faint;
use capsense::core::capacitance::CapacitanceMatrix;
use egui::text::{LayoutJob, TextWrapping};
use egui::{Align2, Color32, CornerRadius, FontId, Galley, RichText, Ui, Vec2, pos2};
use std::sync::Arc;

/// Cells are not lower than this, so that a number and its bar are legible.
const LOWEST: f32 = 34.0;

/// Of the room for names of rows.
const WIDEST_HEAD: f32 = 64.0;

/// Draws the matrix.
pub fn ui(ui: &mut Ui, session: &mut Session, preferences: &CurvePreferences, bars_at_rest: &mut bool) {
    let (Some(last), Some(open)) = (&session.last, &session.open) else { return };
    let capacitance = &last.frame.capacitance;
    if capacitance.size() != open.base.size() {
        return;
    }
    let values = match preferences.quantity {
        Quantity::Absolute => capacitance.clone(),
        Quantity::Change => capacitance.minus(&open.base),
    };
    let bars = match (&session.bars, preferences.quantity) {
        (Bars::Known(bars), Quantity::Absolute) => Some(&bars.capacitance),
        (Bars::Known(bars), Quantity::Change) => Some(&bars.change),
        _ => None,
    };
    let heading = format!("{} / {}", preferences.quantity.symbol(), preferences.unit.symbol());
    cells(ui, &open.scene.electrodes, &values, bars, preferences, &heading);
    let is_too_large = matches!(session.bars, Bars::TooLarge);
    ui.horizontal(|ui| {
        let hint = "from the same frame on a mesh with all spacings halved, and on this one if its rims are weighed; nine of ten errors are smaller";
        if ui.add_enabled(!is_too_large, egui::Button::new("± error bars")).on_hover_text(hint).clicked() {
            session.tell_bars();
        }
        ui.checkbox(bars_at_rest, "when at rest")
            .on_hover_text("whenever nothing has moved for half a second");
    });
    if is_too_large {
        ui.label(RichText::new("The mesh is too large to be halved for error bars.").color(faint(ui)));
    }
}

fn cells(
    ui: &mut Ui,
    electrodes: &[String],
    values: &CapacitanceMatrix,
    bars: Option<&CapacitanceMatrix>,
    preferences: &CurvePreferences,
    heading: &str,
) {
    let size = values.size();
    let ink = faint(ui);
    let name = |index: usize| electrodes.get(index).map_or("", String::as_str);
    let widest =
        (0..size).map(|index| shortened(ui, name(index), f32::INFINITY).size().x).fold(0.0, f32::max);
    let head = (widest + 10.0).clamp(30.0, WIDEST_HEAD);
    let width = ((ui.available_width() - head) / size as f32).max(26.0);
    let height = (0.55 * width).clamp(LOWEST, 52.0);
    let area = Vec2::new(head + width * size as f32, 20.0 + height * size as f32);
    let (rect, response) = ui.allocate_exact_size(area, egui::Sense::hover());
    let largest = values.rows().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
    let painter = ui.painter_at(rect);
    painter.text(rect.left_top(), Align2::LEFT_TOP, heading, FontId::proportional(10.0), ink);
    let per = preferences.unit.per_farad();
    let mut pointed = None;
    for row in 0..size {
        let top = rect.top() + 20.0 + height * row as f32;
        let left = rect.left() + head;
        let side = shortened(ui, name(row), head - 8.0);
        let at = Align2::RIGHT_CENTER.anchor_size(pos2(left - 6.0, top + 0.5 * height), side.size());
        painter.galley(at.min, side, ink);
        let above = shortened(ui, name(row), width - 2.0);
        let at = pos2(left + width * (row as f32 + 0.5), rect.top() + 18.0);
        painter.galley(Align2::CENTER_BOTTOM.anchor_size(at, above.size()).min, above, ink);
        for column in 0..size {
            let value = values.get(row, column);
            let corner = pos2(left + width * column as f32, top);
            let cell = egui::Rect::from_min_size(corner, Vec2::new(width, height)).shrink(1.0);
            // Square roots keep small couplings visible beside large self-capacitances.
            let part = if largest > 0.0 { value.signum() * (value.abs() / largest).sqrt() } else { 0.0 };
            let fill = diverging(part as f32, ui.visuals().dark_mode);
            painter.rect_filled(cell, CornerRadius::same(3), fill);
            let number = number(value * per, width);
            let on = ink_on(fill);
            match bars {
                None => {
                    painter.text(cell.center(), Align2::CENTER_CENTER, number, FontId::monospace(11.0), on);
                }
                Some(bars) => {
                    let up = cell.center() - Vec2::new(0.0, 6.0);
                    painter.text(up, Align2::CENTER_CENTER, number, FontId::monospace(11.0), on);
                    let bar = format!("± {}", short(bars.get(row, column) * per));
                    let down = cell.center() + Vec2::new(0.0, 8.0);
                    painter.text(
                        down,
                        Align2::CENTER_CENTER,
                        bar,
                        FontId::monospace(9.0),
                        on.gamma_multiply(0.8),
                    );
                }
            }
            if response.hover_pos().is_some_and(|at| cell.contains(at)) {
                let text = preferences.unit.text(value);
                let bar =
                    bars.map_or(String::new(), |bars| format!(" ± {}", short(bars.get(row, column) * per)));
                pointed = Some(format!(
                    "{}–{}: {text}{bar} {}",
                    name(row),
                    name(column),
                    preferences.unit.symbol()
                ));
            }
        }
    }
    if let Some(text) = pointed {
        response.on_hover_text(text);
    }
}

/// From blue over the ground to red, for parts from -1 to 1: lightness tells how much, hue which sign (after ColorBrewer's
/// RdBu).
fn diverging(part: f32, is_dark: bool) -> Color32 {
    let ground =
        if is_dark { Color32::from_rgb(0x2a, 0x2e, 0x36) } else { Color32::from_rgb(0xf4, 0xf5, 0xf7) };
    let [near, far] = match (part < 0.0, is_dark) {
        (true, true) => [Color32::from_rgb(0x2f, 0x5f, 0x8f), Color32::from_rgb(0x6f, 0xb7, 0xe6)],
        (false, true) => [Color32::from_rgb(0x8f, 0x45, 0x3c), Color32::from_rgb(0xf2, 0x8c, 0x6a)],
        (true, false) => [Color32::from_rgb(0x92, 0xc5, 0xde), Color32::from_rgb(0x2b, 0x6c, 0xb0)],
        (false, false) => [Color32::from_rgb(0xf4, 0xa5, 0x82), Color32::from_rgb(0xb7, 0x2b, 0x36)],
    };
    let part = part.abs().clamp(0.0, 1.0);
    if part < 0.5 {
        ground.lerp_to_gamma(near, 2.0 * part)
    } else {
        near.lerp_to_gamma(far, 2.0 * part - 1.0)
    }
}

/// As many digits as there is room for.
fn number(value: f64, width: f32) -> String {
    let digits = ((width - 8.0) / 7.0).max(2.0) as usize;
    (0..=3)
        .rev()
        .map(|decimals| format!("{value:.decimals$}"))
        .find(|text| text.len() <= digits)
        .unwrap_or_else(|| format!("{value:.0}"))
}

/// A name on one line, no wider than this; what is too much of it ends in dots.
fn shortened(ui: &Ui, name: &str, width: f32) -> Arc<Galley> {
    let mut job = LayoutJob::simple_singleline(name.to_owned(), FontId::proportional(11.0), faint(ui));
    job.wrap = TextWrapping::truncate_at_width(width);
    ui.painter().layout_job(job)
}

/// Two digits that count.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

/// Black or white, whichever is legible.
fn ink_on(fill: Color32) -> Color32 {
    let [r, g, b, _] = fill.to_array().map(f32::from);
    if 0.299 * r + 0.587 * g + 0.114 * b > 140.0 {
        Color32::from_gray(0x18)
    } else {
        Color32::from_gray(0xf0)
    }
}

#[cfg(test)]
mod tests {
    use super::{number, short};

    #[test]
    fn numbers_fit_their_cells() {
        assert_eq!(number(123.456_7, 70.0), "123.457");
        assert_eq!(number(-123.456_7, 50.0), "-123.5");
        assert_eq!(number(-1234.5, 26.0), "-1234");
        assert_eq!([short(0.123), short(12.34), short(0.0)], ["0.12", "12", "0"]);
    }
}
