//! `chart.svg`: error of ΔC over the time of a frame, every setting a point, and the front of those that nothing beats.

use super::ladder::{PAPER, USUAL};
use super::pareto;
use super::plot::{
    AMBER, BLUE, Chart, DARK, Drawn, FONT, GREEN, GREY, Look, PURPLE, Point, RED, SKY, Series, axes,
    draw_legend, draw_lines, draw_note, draw_series, padded, tets_text,
};
use super::published::PAPER_TIMES;
use super::setting::{MeshPlan, Setting};
use super::table::Row;
use crate::scene::GeometrySource;
use capsense_core::occupancy::Interface;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 720);

/// Width of the column with the legend.
const LEGEND: u32 = 310;

/// Height of the strip with the title.
const HEAD: u32 = 44;

/// Milliseconds that a control loop of 100 Hz has for a frame.
const CONTROL_LOOP: f64 = 10.0;

/// Errors above this are drawn here, in percent: a method that is wrong by so much tells nothing.
const MOST_ERROR: f64 = 400.0;

/// Marks the rows on the front of time against error.
pub fn mark_front(rows: &mut [Row]) {
    let points: Vec<Point> =
        rows.iter().map(|row| row.point().unwrap_or((f64::INFINITY, f64::INFINITY))).collect();
    let front = pareto::front(&points);
    for (index, row) in rows.iter_mut().enumerate() {
        row.on_front = front.contains(&index);
    }
}

/// The drawing; rows are marked.
///
/// # Errors
/// None that can happen.
pub fn draw(rows: &[Row]) -> Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    draw_into(&mut text, rows)?;
    Ok(text)
}

/// The series with lines of their own, the last on top.
fn series(rows: &[Row]) -> Vec<Series> {
    let uniform = Setting { mesh: MeshPlan::Uniform(0), ..USUAL };
    let with = |interface| Setting { interface, ..USUAL };
    let of = |label: &str, colour, look, base: Setting| Series {
        label: label.to_owned(),
        colour,
        look,
        points: sorted(rows.iter().filter(|row| row.is_like(&base)).filter_map(shown)),
    };
    vec![
        of("paper's method, measured here", RED, Look::Line(2), PAPER),
        of("centroid, exact solids", PURPLE, Look::Line(2), with(Interface::Centroid)),
        of("volume-fraction, exact solids", GREEN, Look::Line(2), with(Interface::VolumeFraction)),
        of("edge-cut, uniform mesh", AMBER, Look::Line(2), uniform),
        of(
            "edge-cut, depth camera",
            SKY,
            Look::Line(2),
            Setting { geometry: GeometrySource::Camera, ..USUAL },
        ),
        of("edge-cut, exact solids", BLUE, Look::Line(3), USUAL),
    ]
}

/// Where a row is drawn.
fn shown(row: &Row) -> Option<Point> {
    row.point().map(|(time, error)| (time, error.min(MOST_ERROR)))
}

/// From the fastest to the slowest.
fn sorted(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let mut points: Vec<Point> = points.collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}

/// The published time of each mesh size with the error that the paper's method makes on as many tetrahedra.
fn published(rows: &[Row]) -> Vec<Point> {
    let paper = || rows.iter().filter(|row| row.is_like(&PAPER));
    let of = |&(tets, milliseconds): &(usize, f64)| {
        let row = paper().find(|row| row.asked == tets as f64)?;
        shown(row).map(|(_, error)| (milliseconds, error))
    };
    PAPER_TIMES.iter().filter_map(of).collect()
}

fn draw_into(text: &mut String, rows: &[Row]) -> Drawn {
    let lines = series(rows);
    let published = Series {
        label: "its published times, at that error".to_owned(),
        colour: RED,
        look: Look::Dashed,
        points: published(rows),
    };
    let others = Series {
        label: "all other settings".to_owned(),
        colour: GREY,
        look: Look::Dots,
        points: rows.iter().filter_map(shown).collect(),
    };
    let front = Series {
        label: "Pareto front".to_owned(),
        colour: DARK,
        look: Look::Steps,
        points: sorted(rows.iter().filter(|row| row.on_front).filter_map(shown)),
    };
    let all = || others.points.iter().chain(&published.points);
    let own = rows.iter().filter_map(|row| row.reference_rms_percent).fold(0.0, f64::max);

    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(HEAD);
    head.draw(&Text::new("Speed against accuracy: a grounded bar moves 1 mm a frame", (24, 14), (FONT, 21)))?;
    let (plot, legend) = body.split_horizontally(SIZE.0 - LEGEND);
    let x = padded(all().map(|p| p.0).chain([CONTROL_LOOP]));
    let y = padded(all().map(|p| p.1).chain([own]));
    let names = ["time of a frame [ms]", "error of ΔC [%]"];
    let mut chart = axes(&plot, names, [x.clone(), y.clone()])?;
    draw_bounds(&mut chart, x, y, own)?;
    for series in [&others, &front].into_iter().chain(&lines).chain([&published]) {
        draw_series(&mut chart, series)?;
    }
    draw_sizes(&mut chart, rows)?;
    let from_best = lines.iter().rev();
    draw_legend(&legend, [&front].into_iter().chain(from_best).chain([&published, &others]), 26)?;
    draw_lines(&legend, &explanation(rows), (0, 290))?;
    root.present()?;
    Ok(())
}

/// What a control loop allows, and what the reference does not tell.
fn draw_bounds(
    chart: &mut Chart<'_, '_>,
    x: std::ops::Range<f64>,
    y: std::ops::Range<f64>,
    own: f64,
) -> Drawn {
    let control = [(CONTROL_LOOP, y.start), (CONTROL_LOOP, y.end)];
    chart.draw_series(DashedLineSeries::new(control, 3, 5, GREY.stroke_width(1)))?;
    draw_note(chart, (CONTROL_LOOP, y.end), (52, 10), "100 Hz loop", &GREY)?;
    if own > y.start {
        let unknown = Rectangle::new([(x.start, own), (x.end, y.start)], GREY.mix(0.12).filled());
        chart.draw_series(std::iter::once(unknown))?;
        draw_note(chart, (x.end, own), (-104, 12), "error bar of the reference", &GREY)?;
    }
    Ok(())
}

/// How many tetrahedra stand behind the points of the best and of the paper's series.
fn draw_sizes(chart: &mut Chart<'_, '_>, rows: &[Row]) -> Drawn {
    for (base, colour, place) in [(USUAL, BLUE, (-16, 14)), (PAPER, RED, (-2, 17))] {
        for row in rows.iter().filter(|row| row.is_like(&base)) {
            let Some((time, error)) = row.point() else { continue };
            let size = tets_text(row.asked);
            let (text, place) = match error {
                beyond if beyond > MOST_ERROR => (format!("{size}: {error:.0} % \u{2191}"), (-62, 0)),
                _ => (size, place),
            };
            draw_note(chart, (time, error.min(MOST_ERROR)), place, &text, &colour)?;
        }
    }
    Ok(())
}

/// What stands below the legend.
fn explanation(rows: &[Row]) -> Vec<&'static str> {
    let mut lines = vec![
        "k, M: thousand, million tetrahedra.",
        "Meshes are graded for the sensor where",
        "nothing else is said.",
        "",
        "Time: what a frame takes of a core, from",
        "the bar\u{2019}s pose to the full matrix; median.",
        "Error: root mean square over entries of ΔC",
        "and poses from 20 to 200 mm, against a",
        "converged reference.",
        "",
        "Nobody has published errors of the paper\u{2019}s",
        "method: circles are its times (i7, 3.4 GHz)",
        "at the error that it makes here on as many",
        "tetrahedra.",
    ];
    if rows.iter().all(|row| row.threads == 1) {
        lines.extend(["", "One thread."]);
    }
    lines
}
