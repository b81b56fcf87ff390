//! Where the time of frames goes: depth, update, solve and drawing, stacked, frame after frame.

use crate::history::Sample;
use crate::session::Session;
use crate::style::faint;
use egui::{Align2, Color32, CornerRadius, FontId, RichText, Ui, Vec2, pos2};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Frames that are shown.
const SHOWN: usize = 120;

/// Depth, update, solve and draw: blue to yellow, told apart in grey too.
const COLOURS: [Color32; 4] = [
    Color32::from_rgb(0x3b, 0x6f, 0xb6),
    Color32::from_rgb(0x2f, 0xa5, 0x94),
    Color32::from_rgb(0xe8, 0xb5, 0x3a),
    Color32::from_rgb(0x8a, 0x8f, 0x99),
];

/// Times of the window's own frames.
#[derive(Debug, Default)]
pub struct Performance {
    /// Seconds that drawing took, the last of them last.
    drawing: VecDeque<f32>,
    /// When frames of the last second began.
    begun: VecDeque<Instant>,
}

impl Performance {
    /// Takes a frame of the window: when it began, and how long it took.
    pub fn note(&mut self, begun: Instant, drawing: Duration) {
        if self.drawing.len() >= SHOWN {
            self.drawing.pop_front();
        }
        self.drawing.push_back(drawing.as_secs_f32());
        self.begun.push_back(begun);
        while self.begun.front().is_some_and(|first| begun - *first > Duration::from_secs(1)) {
            self.begun.pop_front();
        }
    }

    /// What the last frame of the window took.
    pub fn drawing(&self) -> Duration {
        Duration::from_secs_f32(self.drawing.back().copied().unwrap_or(0.0))
    }

    /// Frames of the window in the last second before its last frame.
    pub fn frames_per_second(&self) -> usize {
        self.begun.len()
    }

    /// Draws the panel.
    pub fn ui(&self, ui: &mut Ui, session: &Session) {
        let samples = session.history.session();
        let seen = &samples[samples.len().saturating_sub(SHOWN)..];
        let Some(last) = seen.last() else { return };
        let drawing = median(self.drawing.iter().map(|seconds| f64::from(*seconds) * 1e3));
        let parts = |sample: &Sample| {
            let took = sample.milliseconds;
            [took.geometry, took.update, took.solve, drawing]
        };
        stack(ui, seen.iter().map(parts).collect());
        ui.add_space(4.0);
        let names = ["depth", "update", "solve", "draw"];
        egui::Grid::new("costs").num_columns(4).spacing([10.0, 3.0]).show(ui, |ui| {
            for header in ["", "in ms", "last", "median"] {
                ui.label(RichText::new(header).color(faint(ui)).small());
            }
            ui.end_row();
            for (part, name) in names.into_iter().enumerate() {
                let (rect, _) = ui.allocate_exact_size(Vec2::splat(10.0), egui::Sense::hover());
                ui.painter().rect_filled(rect, 2.0, COLOURS[part]);
                ui.label(name);
                ui.monospace(format!("{:.3}", parts(last)[part]));
                ui.monospace(format!("{:.3}", median(seen.iter().map(|sample| parts(sample)[part]))));
                ui.end_row();
            }
        });
        ui.add_space(4.0);
        let skipped = seen.iter().filter(|sample| sample.solve.skipped).count();
        let facts = [
            ("iterations", format!("{} (error ≤ {:.0e})", last.solve.iterations, last.solve.relative_error)),
            ("changed edges", last.changed_edges.to_string()),
            ("skipped", format!("{skipped} of the last {}", seen.len())),
            ("superseded", format!("{} requests", session.superseded())),
            ("window", format!("{} frames in the last second", self.frames_per_second())),
        ];
        for (name, text) in facts {
            crate::style::row(ui, name, |ui| ui.label(text));
        }
    }
}

/// Bars, one a frame, the last at the right.
fn stack(ui: &mut Ui, bars: Vec<[f64; 4]>) {
    let (rect, response) =
        ui.allocate_exact_size(Vec2::new(ui.available_width(), 84.0), egui::Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, CornerRadius::same(3), ui.visuals().extreme_bg_color);
    let mut totals: Vec<f64> = bars.iter().map(|bar| bar.iter().sum()).collect();
    totals.sort_by(f64::total_cmp);
    // One frame that took very long does not flatten all others.
    let usual = totals[(totals.len() - 1) * 95 / 100];
    let top = nice(1.15 * usual.max(1e-3));
    let width = rect.width() / SHOWN as f32;
    let first = SHOWN - bars.len();
    for (index, bar) in bars.iter().enumerate() {
        let left = rect.left() + width * (first + index) as f32;
        let mut bottom = rect.bottom();
        for (part, milliseconds) in bar.iter().enumerate() {
            let height = (*milliseconds / top) as f32 * rect.height();
            let cell =
                egui::Rect::from_min_max(pos2(left, bottom - height), pos2(left + width - 0.5, bottom));
            painter.rect_filled(cell, 0.0, COLOURS[part]);
            bottom -= height;
        }
    }
    let ink = faint(ui);
    let half = rect.center().y;
    painter.hline(rect.x_range(), half, egui::Stroke::new(0.5, ink.gamma_multiply(0.4)));
    let font = FontId::proportional(10.0);
    let corner = rect.left_top() + Vec2::new(4.0, 2.0);
    painter.text(corner, Align2::LEFT_TOP, format!("{top} ms"), font.clone(), ink);
    painter.text(pos2(corner.x, half), Align2::LEFT_BOTTOM, format!("{} ms", 0.5 * top), font, ink);
    if let Some(at) = response.hover_pos() {
        let index = ((at.x - rect.left()) / width) as usize;
        if let Some(bar) = index.checked_sub(first).and_then(|index| bars.get(index)) {
            let [depth, update, solve, draw] = bar;
            response.on_hover_text(format!(
                "depth {depth:.3} ms\nupdate {update:.3} ms\nsolve {solve:.3} ms\ndraw {draw:.3} ms"
            ));
        }
    }
}

/// The next 1, 2 or 5 times a power of ten.
fn nice(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let lead = [1.0, 2.0, 5.0, 10.0].into_iter().find(|lead| lead * power >= value).unwrap_or(10.0);
    let text = format!("{:.4}", lead * power);
    text.parse().unwrap_or(value)
}

pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_at_round_numbers() {
        assert_eq!([nice(0.03), nice(0.7), nice(1.0), nice(42.0)], [0.05, 1.0, 1.0, 50.0]);
    }

    #[test]
    fn frames_are_counted_over_a_second() {
        let mut performance = Performance::default();
        let begun = Instant::now();
        for frame in 0..300 {
            performance.note(begun + Duration::from_millis(20 * frame), Duration::from_millis(4));
        }
        assert_eq!(performance.frames_per_second(), 51, "both ends of a second count");
        assert!((performance.drawing().as_secs_f64() - 4e-3).abs() < 1e-6);
    }
}
