//! `continuity.svg`: the curves of a moving bar, and below them how much each step changes.

use crate::continuity::{CAMERA, CENTROID, Curve, MODELS, Model, SOLID, WAYS, Way};
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::coord::combinators::LogCoord;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 820);

/// Height of the strip with the legend.
const LEGEND: u32 = 70;

const FONT: &str = "sans-serif";

const GREY: RGBColor = RGBColor(150, 150, 150);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, LogCoord<f64>>>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Draws all curves: one column of charts for each way.
pub(crate) fn plot(curves: &[Curve]) -> Result<String> {
    let mut text = String::new();
    draw(&mut text, curves).map_err(|error| anyhow!("cannot draw the curves: {error}"))?;
    Ok(text)
}

/// Okabe and Ito's colours, which people with any colour vision can tell apart.
fn colour(model: Model) -> RGBColor {
    match model {
        SOLID => RGBColor(0, 114, 178),
        CAMERA => RGBColor(230, 159, 0),
        _ => RGBColor(213, 94, 0),
    }
}

fn draw(text: &mut String, curves: &[Curve]) -> Drawn {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (head, charts) = root.split_vertically(LEGEND);
    draw_legend(&head)?;
    let columns = charts.split_evenly((1, WAYS.len()));
    for (way, column) in WAYS.iter().zip(&columns) {
        let of_way: Vec<&Curve> = curves.iter().filter(|curve| curve.way.name == way.name).collect();
        let (_, height) = column.dim_in_pixel();
        let (top, bottom) = column.split_vertically(height / 2);
        draw_changes(&top, way, &of_way)?;
        draw_steps(&bottom, way, &of_way)?;
    }
    root.present()?;
    Ok(())
}

/// A line of text above all charts, and below it a sample for each model.
fn draw_legend(area: &Area<'_>) -> Drawn {
    let title = "A grounded bar above three stripes, on 30,000 tetrahedra: change of C11";
    area.draw(&Text::new(title, (24, 14), (FONT, 20)))?;
    for (index, model) in [SOLID, CAMERA, CENTROID].into_iter().enumerate() {
        let x = 24 + 200 * index as i32;
        area.draw(&PathElement::new([(x, 54), (x + 30, 54)], colour(model).stroke_width(2)))?;
        area.draw(&Circle::new((x + 15, 54), 3, colour(model).filled()))?;
        area.draw(&Text::new(model.name, (x + 38, 46), (FONT, 15)))?;
    }
    let note = "dots below the grey line: steps that change nothing, or the wrong way";
    area.draw(&Text::new(note, (24 + 200 * MODELS.len() as i32, 46), (FONT, 15)))?;
    Ok(())
}

/// The lowest and the highest of some values that are positive, with a margin on a logarithmic axis.
fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let positive = values.filter(|value| *value > 0.0);
    let [low, high] = positive.fold([f64::INFINITY, 0.0_f64], |[l, h], value| [l.min(value), h.max(value)]);
    if low < high { [0.7 * low, 1.4 * high] } else { [0.1, 10.0] }
}

/// A chart with its axes; there are no labels below `lowest_label`.
fn chart<'a, 'b>(
    area: &'a Area<'b>,
    way: &Way,
    description: &str,
    [low, high]: [f64; 2],
    lowest_label: f64,
) -> Result<Chart<'a, 'b>, Box<dyn std::error::Error>> {
    let [from, to] = way.range;
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .margin_right(28)
        .x_label_area_size(44)
        .y_label_area_size(76)
        .build_cartesian_2d(from..to, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(way.label)
        .y_desc(description)
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 13))
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(220, 220, 220))
        .y_labels(6)
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|&value| if value < lowest_label { String::new() } else { label(value) })
        .draw()?;
    Ok(chart)
}

/// One significant digit.
fn label(value: f64) -> String {
    let decimals = (-value.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// Curves that leave the chart run along its lower edge, which leaves room below the lowest of edge-cut with solids.
fn draw_changes(area: &Area<'_>, way: &Way, curves: &[&Curve]) -> Drawn {
    let [of_solid, of_all] = [true, false].map(|only_solid| {
        let shown = curves.iter().filter(|curve| !only_solid || curve.model == SOLID);
        span(shown.flat_map(|curve| curve.changes.iter().copied()))
    });
    let low = of_all[0].max(0.4 * of_solid[0]);
    let mut chart = chart(area, way, "C11 - C11 of the empty scene [fF]", [low, of_all[1]], low)?;
    for curve in curves {
        let points = curve.places.iter().zip(&curve.changes).map(|(&place, change)| (place, change.max(low)));
        chart.draw_series(LineSeries::new(points, colour(curve.model).stroke_width(2)))?;
    }
    Ok(())
}

/// What each step takes from C11, as dots. Steps that take nothing or less have no logarithm: they form a row of dots for
/// each model at the lower edge.
fn draw_steps(area: &Area<'_>, way: &Way, curves: &[&Curve]) -> Drawn {
    /// Height of a row, as a factor.
    const ROW: f64 = 1.6;
    let falls: Vec<Vec<f64>> = curves.iter().map(|curve| curve.falls()).collect();
    let [low, high] = span(falls.iter().flatten().copied());
    let edge = low / ROW.powi(curves.len() as i32 + 1);
    let mut chart = chart(area, way, "fall of C11 in a step of 0.5 mm [fF]", [edge, high], low)?;
    chart.draw_series(LineSeries::new([(way.range[0], low), (way.range[1], low)], GREY.stroke_width(1)))?;
    for (row, (curve, falls)) in (1..).zip(curves.iter().zip(&falls)) {
        let colour = colour(curve.model);
        let beneath = low / ROW.powi(row);
        let dots = curve.places.windows(2).zip(falls).map(|(pair, &fall)| {
            let place = 0.5 * (pair[0] + pair[1]);
            Circle::new((place, if fall > 0.0 { fall } else { beneath }), 2, colour.filled())
        });
        chart.draw_series(dots)?;
    }
    Ok(())
}
