//! `timing.svg`, like the paper's Fig. 8: time of a frame over the number of tetrahedra, all through the depth camera.

use super::ladder::{PAPER, SIZES, USUAL, patience_of_paper};
use super::plot::{
    BLUE, Drawn, FONT, GREEN, GREY, Look, Point, RED, Series, axes, draw_legend, draw_lines, draw_series,
    padded,
};
use super::published::PAPER_TIMES;
use super::setting::{MeshPlan, Setting, Storage};
use super::stage::Patience;
use super::table::Row;
use crate::scene::GeometrySource;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1000, 600);

/// Width of the column with the legend.
const LEGEND: u32 = 270;

/// Height of the strip with the title.
const HEAD: u32 = 44;

/// The tolerance of C that scene files have by default.
const TOLERANCE: f64 = 1e-4;

/// Tetrahedra above which a frame of the paper's method takes seconds.
const LARGEST_OF_PAPER: usize = 100_000;

/// Milliseconds that a control loop of 100 Hz has for a frame.
const CONTROL_LOOP: f64 = 10.0;

const LATTICE: Setting = Setting { geometry: GeometrySource::Camera, tolerance: TOLERANCE, ..USUAL };
const CSR: Setting = Setting { storage: Storage::Csr, ..LATTICE };

/// The settings that are timed.
pub fn settings() -> Vec<Setting> {
    let of = |base: Setting| SIZES.map(|tets| Setting { mesh: MeshPlan::Adapted(tets), ..base });
    let published = PAPER_TIMES.iter().map(|(tets, _)| *tets);
    let mut of_paper: Vec<usize> =
        SIZES.into_iter().filter(|tets| *tets <= LARGEST_OF_PAPER).chain(published).collect();
    of_paper.sort_unstable();
    of_paper.dedup();
    let paper = of_paper.into_iter().map(|tets| Setting {
        mesh: MeshPlan::Adapted(tets),
        patience: patience_of_paper(tets),
        ..PAPER
    });
    of(LATTICE).into_iter().chain(of(CSR)).chain(paper).collect()
}

/// One small mesh for each method, and few frames, to see that it can be done.
pub fn smallest() -> Vec<Setting> {
    [LATTICE, CSR, PAPER].map(|base| Setting { patience: Patience::Little, ..base }).to_vec()
}

/// The drawing.
///
/// # Errors
/// None that can happen.
pub fn draw(rows: &[Row]) -> Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    draw_into(&mut text, rows)?;
    Ok(text)
}

fn draw_into(text: &mut String, rows: &[Row]) -> Drawn {
    let of = |label: &str, colour, look, base: Setting| Series {
        label: label.to_owned(),
        colour,
        look,
        points: points(rows.iter().filter(|row| row.is_like(&base))),
    };
    let published = Series {
        label: "the paper's, published".to_owned(),
        colour: RED,
        look: Look::Dashed,
        points: PAPER_TIMES.iter().map(|(tets, time)| (*tets as f64, *time)).collect(),
    };
    let all = [
        published,
        of("the paper's method, here", RED, Look::Line(2), PAPER),
        of("plain tetrahedra (csr)", GREEN, Look::Line(2), CSR),
        of("lattice", BLUE, Look::Line(3), LATTICE),
    ];
    let points = || all.iter().flat_map(|series| &series.points);
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(HEAD);
    head.draw(&Text::new("Time of a frame over the size of the mesh", (24, 14), (FONT, 21)))?;
    let (plot, legend) = body.split_horizontally(SIZE.0 - LEGEND);
    let (x, y) = (padded(points().map(|p| p.0)), padded(points().map(|p| p.1)));
    let mut chart = axes(&plot, ["tetrahedra", "time of a frame [ms]"], [x.clone(), y])?;
    let control = [(x.start, CONTROL_LOOP), (x.end, CONTROL_LOOP)];
    chart.draw_series(DashedLineSeries::new(control, 3, 5, GREY.stroke_width(1)))?;
    for series in &all {
        draw_series(&mut chart, series)?;
    }
    draw_legend(&legend, all.iter(), 26)?;
    draw_lines(&legend, &EXPLANATION, (0, 140))?;
    root.present()?;
    Ok(())
}

/// What stands below the legend.
const EXPLANATION: [&str; 9] = [
    "Three electrodes, a grounded bar that",
    "moves 1 mm a frame; one thread.",
    "Medians, from the bar\u{2019}s pose to C;",
    "lattice and csr to 1e-4 of C.",
    "",
    "Published: i7 at 3.4 GHz, on",
    "unstructured meshes.",
    "",
    "Dashed: 10 ms, a loop of 100 Hz.",
];

fn points<'a>(rows: impl Iterator<Item = &'a Row>) -> Vec<Point> {
    let mut points: Vec<Point> = rows.filter_map(|row| Some((row.tets? as f64, row.median_ms?))).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}
