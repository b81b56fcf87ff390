//! What the drawings of evidence share: colours, logarithmic axes, and a legend in a column of its own.

use plotters::coord::Shift;
use plotters::coord::combinators::LogCoord;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

pub(super) const FONT: &str = "sans-serif";

/// Okabe and Ito's colours, which people with any colour vision can tell apart.
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub(super) const AMBER: RGBColor = RGBColor(230, 159, 0);
pub(super) const RED: RGBColor = RGBColor(213, 94, 0);
pub(super) const DARK: RGBColor = RGBColor(40, 40, 40);
pub(super) const GREY: RGBColor = RGBColor(120, 120, 120);
const GRID: RGBColor = RGBColor(225, 225, 225);

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;
pub(super) type Drawn = Result<(), Box<dyn std::error::Error>>;
pub(super) type Point = (f64, f64);

/// How the points of a series look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    /// Disks on a line that is so many pixels wide.
    Line(u32),
    /// Circles on a dashed line.
    Dashed,
    /// Small disks without a line.
    Dots,
    /// A line in steps, without points.
    Steps,
}

/// One line of the legend and all that it stands for.
pub(super) struct Series {
    pub(super) label: String,
    pub(super) colour: RGBColor,
    pub(super) look: Look,
    pub(super) points: Vec<Point>,
}

/// The smallest ranges of whole powers of ten around values; that of one to ten where there are none.
pub(super) fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let [low, high] = values
        .filter(|value| *value > 0.0 && value.is_finite())
        .fold([f64::INFINITY, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)]);
    if low > high {
        return 1.0..10.0;
    }
    let [low, high] = [low.log10().floor(), high.log10().ceil()];
    10f64.powf(low)..10f64.powf(if high > low { high } else { low + 1.0 })
}

/// Half a decade more on both sides would be too much; this is a little.
pub(super) fn padded(values: impl Iterator<Item = f64> + Clone) -> Range<f64> {
    let whole = decades(values.clone());
    let positive = || values.clone().filter(|value| *value > 0.0 && value.is_finite());
    let low = positive().fold(f64::INFINITY, f64::min) / 1.6;
    let high = positive().fold(0.0, f64::max) * 1.6;
    if low < high { low..high } else { whole }
}

/// An empty chart with logarithmic axes.
pub(super) fn axes<'a, 'b>(
    area: &'a Area<'b>,
    [x_name, y_name]: [&str; 2],
    [x, y]: [Range<f64>; 2],
) -> Result<Chart<'a, 'b>, Box<dyn std::error::Error>> {
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .margin_top(4)
        .x_label_area_size(52)
        .y_label_area_size(72)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .x_desc(x_name)
        .y_desc(y_name)
        .axis_desc_style((FONT, 17))
        .label_style((FONT, 15))
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .x_labels(12)
        .y_labels(12)
        .x_label_formatter(&|value| tick(*value))
        .y_label_formatter(&|value| tick(*value))
        .draw()?;
    Ok(chart)
}

/// Powers of ten, and what else has a short name.
fn tick(value: f64) -> String {
    match value {
        1e6.. => format!("{}M", short(value / 1e6)),
        1e3.. => format!("{}k", short(value / 1e3)),
        _ => short(value),
    }
}

fn short(value: f64) -> String {
    let decimals = (1.0 - value.log10()).ceil().clamp(0.0, 4.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The number of tetrahedra as people say it.
pub(super) fn tets_text(tets: f64) -> String {
    if tets >= 0.95e6 { format!("{:.0}M", tets / 1e6) } else { format!("{:.0}k", tets / 1e3) }
}

/// Draws one series.
pub(super) fn draw_series(chart: &mut Chart<'_, '_>, series: &Series) -> Drawn {
    let Series { colour, look, points, .. } = series;
    let line = |width| colour.stroke_width(width);
    match look {
        Look::Line(width) => {
            chart.draw_series(LineSeries::new(points.iter().copied(), line(*width)))?;
            let radius = 3 + *width as i32 / 2;
            chart.draw_series(points.iter().map(|p| Circle::new(*p, radius, colour.filled())))?;
        }
        Look::Dashed => {
            chart.draw_series(DashedLineSeries::new(points.iter().copied(), 5, 4, line(2)))?;
            chart.draw_series(points.iter().map(|p| Circle::new(*p, 5, WHITE.filled())))?;
            chart.draw_series(points.iter().map(|p| Circle::new(*p, 5, line(2))))?;
        }
        Look::Dots => {
            chart.draw_series(points.iter().map(|p| Circle::new(*p, 3, colour.mix(0.45).filled())))?;
        }
        Look::Steps => {
            let corners = points.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
            let steps = corners.chain(points.last().copied());
            chart.draw_series(LineSeries::new(steps, line(4)))?;
        }
    }
    Ok(())
}

/// Writes beside a point, so many pixels to the right and down.
pub(super) fn draw_note(
    chart: &mut Chart<'_, '_>,
    point: Point,
    (dx, dy): (i32, i32),
    text: &str,
    colour: &RGBColor,
) -> Drawn {
    let pos = Pos::new(HPos::Center, VPos::Center);
    let style = (FONT, 14).into_text_style(chart.plotting_area()).color(colour).pos(pos);
    let note = EmptyElement::at(point) + Text::new(text.to_owned(), (dx, dy), style);
    chart.draw_series(std::iter::once(note))?;
    Ok(())
}

/// Draws samples and labels, one below the other.
pub(super) fn draw_legend<'s>(area: &Area<'_>, all: impl Iterator<Item = &'s Series>, top: i32) -> Drawn {
    const LINE: i32 = 24;
    for (index, series) in all.enumerate() {
        let (y, colour) = (top + LINE * index as i32, series.colour);
        let sample = [(0, y), (30, y)];
        match series.look {
            Look::Line(width) => {
                area.draw(&PathElement::new(sample, colour.stroke_width(width)))?;
                area.draw(&Circle::new((15, y), 3 + width as i32 / 2, colour.filled()))?;
            }
            Look::Dashed => {
                area.draw(&DashedPathElement::new(sample, 5, 4, colour.stroke_width(2)))?;
                area.draw(&Circle::new((15, y), 5, WHITE.filled()))?;
                area.draw(&Circle::new((15, y), 5, colour.stroke_width(2)))?;
            }
            Look::Dots => area.draw(&Circle::new((15, y), 3, colour.mix(0.45).filled()))?,
            Look::Steps => area.draw(&PathElement::new(sample, colour.stroke_width(4)))?,
        }
        area.draw(&Text::new(series.label.clone(), (40, y - 8), (FONT, 15)))?;
    }
    Ok(())
}

/// Writes lines of text below each other.
pub(super) fn draw_lines(area: &Area<'_>, lines: &[&str], (x, y): (i32, i32)) -> Drawn {
    for (index, line) in lines.iter().enumerate() {
        let style = (FONT, 14).into_text_style(area).color(&GREY);
        area.draw(&Text::new((*line).to_owned(), (x, y + 19 * index as i32), style))?;
    }
    Ok(())
}
