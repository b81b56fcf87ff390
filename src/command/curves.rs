//! `capacitance.svg`: how every entry of the Maxwell matrix changes over time.

use super::text::Prefix;
use anyhow::anyhow;
use capsense::Frame;
use capsense::core::capacitance::{CapacitanceMatrix, upper_triangle};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// Okabe and Ito's colours, which people with any colour vision can tell apart; the yellow is left out as too pale.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];

const WIDTH: u32 = 1000;

/// Width of the column with the legend.
const LEGEND: u32 = 150;

/// Height of a line of the legend.
const LINE: u32 = 20;

/// Where the legend begins.
const TOP: i32 = 52;

/// Stroke and gap of the dashes of couplings, in turn when the colours are used up.
const DASHES: [(u32, u32); 3] = [(8, 4), (2, 3), (14, 5)];

/// Draws the change against the scene without objects. Self-capacitances are solid, couplings dashed.
pub(super) fn curves(
    electrodes: &[String],
    base: &CapacitanceMatrix,
    frames: &[Frame],
) -> anyhow::Result<String> {
    let mut text = String::new();
    draw(&mut text, electrodes, base, frames).map_err(|error| anyhow!("cannot draw the curves: {error}"))?;
    Ok(text)
}

/// How the curve of one entry is drawn: solid, or in dashes of a stroke and a gap.
struct CurveStyle {
    line: ShapeStyle,
    dash: Option<(u32, u32)>,
}

/// Self-capacitances and couplings are numbered apart, and each number has a colour.
fn curve_styles(entries: &[(usize, usize)]) -> Vec<CurveStyle> {
    let mut couplings = 0;
    let style_of = |&(row, column): &(usize, usize)| {
        let (number, dash) = if row == column {
            (row, None)
        } else {
            couplings += 1;
            (couplings - 1, Some(DASHES[(couplings - 1) / COLOURS.len() % DASHES.len()]))
        };
        CurveStyle { line: COLOURS[number % COLOURS.len()].stroke_width(2), dash }
    };
    entries.iter().map(style_of).collect()
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn draw(text: &mut String, electrodes: &[String], base: &CapacitanceMatrix, frames: &[Frame]) -> Drawn {
    let change = |frame: &Frame, (row, column): (usize, usize)| {
        frame.capacitance.get(row, column) - base.get(row, column)
    };
    let entries: Vec<(usize, usize)> = upper_triangle(electrodes.len()).collect();
    let all = frames.iter().flat_map(|frame| entries.iter().map(|&entry| change(frame, entry)));
    let (low, high) = all.fold((0.0_f64, 0.0_f64), |(low, high), c| (low.min(c), high.max(c)));
    let unit = Prefix::for_magnitude(high.max(-low));
    let (low, high) = (unit.of(low), unit.of(high));
    let margin = if high > low { 0.06 * (high - low) } else { 1.0 };
    let end = frames.last().map_or(0.0, |frame| frame.time_s);

    // The legend has a column of its own, so that it never covers a curve; it may make the drawing taller.
    let height = (entries.len() as u32 * LINE + 2 * TOP as u32).max(600);
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let (plot, legend) = root.split_horizontally(WIDTH - LEGEND);
    let mut chart = ChartBuilder::on(&plot)
        .caption("Change of the capacitance matrix by the objects", ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(76)
        .build_cartesian_2d(0.0..if end > 0.0 { end } else { 1.0 }, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc("time [s]")
        .y_desc(format!("C - C without objects [{}]", unit.symbol))
        .axis_desc_style(("sans-serif", 16))
        .label_style(("sans-serif", 13))
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(220, 220, 220))
        .y_label_formatter(&|value| tick(*value, high - low))
        .draw()?;
    for (index, (&entry, style)) in entries.iter().zip(curve_styles(&entries)).enumerate() {
        let label = format!("{} {}", electrodes[entry.0], electrodes[entry.1]);
        draw_legend_line(&legend, index, &style, label)?;
        let points = frames.iter().map(|frame| (frame.time_s, unit.of(change(frame, entry))));
        draw_curve(&mut chart, &style, points)?;
    }
    root.present()?;
    Ok(())
}

fn draw_legend_line(
    legend: &DrawingArea<SVGBackend<'_>, Shift>,
    index: usize,
    style: &CurveStyle,
    label: String,
) -> Drawn {
    let y = TOP + (LINE * index as u32) as i32;
    let sample = [(0, y), (28, y)];
    match style.dash {
        Some((stroke, gap)) => legend.draw(&DashedPathElement::new(sample, stroke, gap, style.line))?,
        None => legend.draw(&PathElement::new(sample.to_vec(), style.line))?,
    }
    legend.draw(&Text::new(label, (36, y - 8), ("sans-serif", 14)))?;
    Ok(())
}

/// A single point is no line, and so becomes a disk.
fn draw_curve<'b>(
    chart: &mut ChartContext<'_, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    style: &CurveStyle,
    points: impl ExactSizeIterator<Item = (f64, f64)> + Clone,
) -> Drawn {
    match style.dash {
        _ if points.len() == 1 => {
            chart.draw_series(points.map(|point| Circle::new(point, 4, style.line.filled())))?;
        }
        None => {
            chart.draw_series(LineSeries::new(points, style.line))?;
        }
        Some((stroke, gap)) => {
            chart.draw_series(DashedLineSeries::new(points, stroke, gap, style.line))?;
        }
    }
    Ok(())
}

/// A label with as many decimals as the range needs.
fn tick(value: f64, range: f64) -> String {
    let decimals = if range >= 50.0 {
        0
    } else if range >= 5.0 {
        1
    } else {
        2
    };
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { "0".to_owned() } else { text }
}
