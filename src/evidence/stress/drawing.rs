//! The map as a drawing: a row for each method, a column for each level of stress, a colour for what came of it.

use super::cell::{Cell, MODEL, SLOW, Status};
use super::{Map, Method, Stress};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A drawing that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the map: {0}")]
pub struct DrawingError(String);

/// Width and height of a field.
const FIELD: (i32, i32) = (34, 21);

/// Between families of stress, and between interface models.
const GAP: i32 = 9;

/// Room for names of methods, and for names of stresses, title and legend.
const LEFT: i32 = 236;
const TOP: i32 = 176;
const BOTTOM: i32 = 62;
const RIGHT: i32 = 22;

const INK: RGBColor = RGBColor(38, 38, 38);
const FAINT: RGBColor = RGBColor(110, 110, 110);
const NOT_OFFERED: RGBColor = RGBColor(246, 246, 246);

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Colours apart in lightness, too, so that they are told by any eye and without colour.
fn colours(status: Status) -> (RGBColor, RGBColor) {
    match status {
        Status::Ok => (RGBColor(214, 236, 245), INK),
        Status::Slow => (RGBColor(244, 208, 96), INK),
        Status::Refused => (RGBColor(120, 128, 138), WHITE),
        Status::Inaccurate => (RGBColor(233, 147, 82), INK),
        Status::Wrong => (RGBColor(142, 22, 28), WHITE),
    }
}

/// What a colour stands for.
fn meaning(status: Status) -> String {
    match status {
        Status::Ok => "ok: iterations".to_owned(),
        Status::Slow => format!("slow: more than {SLOW} iterations"),
        Status::Refused => "refused: an error or a warning says why".to_owned(),
        Status::Inaccurate => "inaccurate: % of the change by objects, within its error bar".to_owned(),
        Status::Wrong => "wrong without notice: % beyond it, or C by so many tolerances (t)".to_owned(),
    }
}

/// Where rows and columns are.
struct Layout {
    columns: Vec<(Stress, i32)>,
    rows: Vec<(Method, i32)>,
}

impl Layout {
    fn of(map: &Map) -> Self {
        let mut stresses: Vec<Stress> = Vec::new();
        for cell in &map.cells {
            if !stresses.contains(&cell.stress) {
                stresses.push(cell.stress);
            }
        }
        let columns = spaced(&stresses, LEFT, FIELD.0, |a, b| a.family() != b.family());
        let rows = spaced(&Method::all(), TOP, FIELD.1, |a, b| a.interface_name() != b.interface_name());
        Self { columns, rows }
    }

    fn size(&self) -> (u32, u32) {
        let right = self.columns.last().map_or(LEFT + 20 * FIELD.0, |&(_, x)| x + FIELD.0) + RIGHT;
        let bottom = self.rows.last().map_or(TOP, |&(_, y)| y + FIELD.1) + BOTTOM;
        (right.max(900) as u32, bottom as u32)
    }
}

/// Places one after the other, with a gap where a group ends.
fn spaced<T: Copy>(items: &[T], start: i32, step: i32, is_other: impl Fn(&T, &T) -> bool) -> Vec<(T, i32)> {
    let mut at = start;
    let mut placed: Vec<(T, i32)> = Vec::with_capacity(items.len());
    for &item in items {
        if let Some((before, _)) = placed.last() {
            at += if is_other(before, &item) { step + GAP } else { step };
        }
        placed.push((item, at));
    }
    placed
}

impl Map {
    /// The drawing.
    ///
    /// # Errors
    /// When it cannot be put together.
    pub fn to_svg(&self) -> Result<String, DrawingError> {
        let mut text = String::new();
        draw(&mut text, self).map_err(|error| DrawingError(error.to_string()))?;
        Ok(text)
    }
}

fn draw(text: &mut String, map: &Map) -> Drawn {
    let layout = Layout::of(map);
    let canvas = SVGBackend::with_string(text, layout.size()).into_drawing_area();
    canvas.fill(&WHITE)?;
    write(&canvas, "Where methods fail", (LEFT, 14), 22, INK, Pos::new(HPos::Left, VPos::Top))?;
    draw_legend(&canvas)?;
    draw_columns(&canvas, &layout)?;
    draw_rows(&canvas, &layout)?;
    for cell in &map.cells {
        let column = layout.columns.iter().find(|(stress, _)| *stress == cell.stress);
        let row = layout.rows.iter().find(|(method, _)| *method == cell.method);
        if let (Some(&(_, x)), Some(&(_, y))) = (column, row) {
            draw_cell(&canvas, cell, (x, y))?;
        }
    }
    draw_notes(&canvas, layout.size().1 as i32)?;
    canvas.present()?;
    Ok(())
}

fn write(canvas: &Canvas<'_>, words: &str, at: (i32, i32), size: i32, ink: RGBColor, pos: Pos) -> Drawn {
    canvas.draw(&Text::new(
        words.to_owned(),
        at,
        TextStyle::from(("sans-serif", size).into_font()).color(&ink).pos(pos),
    ))?;
    Ok(())
}

fn draw_legend(canvas: &Canvas<'_>) -> Drawn {
    let (mut x, y) = (LEFT, 48);
    for status in Status::ALL {
        let (fill, _) = colours(status);
        canvas.draw(&Rectangle::new([(x, y), (x + 22, y + 15)], fill.filled()))?;
        let words = meaning(status);
        write(canvas, &words, (x + 29, y + 1), 13, INK, Pos::new(HPos::Left, VPos::Top))?;
        x += 29 + (6.4 * words.chars().count() as f64) as i32 + 20;
    }
    Ok(())
}

/// Families above, levels below them, turned to fit.
fn draw_columns(canvas: &Canvas<'_>, layout: &Layout) -> Drawn {
    for of_family in layout.columns.chunk_by(|a, b| a.0.family() == b.0.family()) {
        let (Some(&(stress, left)), Some(&(_, last))) = (of_family.first(), of_family.last()) else {
            continue;
        };
        let right = last + FIELD.0 - 1;
        write(canvas, stress.family(), (left, TOP - 88), 14, INK, Pos::new(HPos::Left, VPos::Bottom))?;
        canvas.draw(&PathElement::new(vec![(left, TOP - 84), (right, TOP - 84)], FAINT.stroke_width(1)))?;
        for &(stress, x) in of_family {
            let style = TextStyle::from(("sans-serif", 12).into_font())
                .color(&INK)
                .transform(FontTransform::Rotate270)
                .pos(Pos::new(HPos::Left, VPos::Center));
            canvas.draw(&Text::new(stress.to_string(), (x + FIELD.0 / 2, TOP - 6), style))?;
        }
    }
    Ok(())
}

fn draw_rows(canvas: &Canvas<'_>, layout: &Layout) -> Drawn {
    for of_interface in layout.rows.chunk_by(|a, b| a.0.interface_name() == b.0.interface_name()) {
        for (index, &(method, y)) in of_interface.iter().enumerate() {
            let middle = y + FIELD.1 / 2;
            if index == 0 {
                let left = Pos::new(HPos::Left, VPos::Center);
                write(canvas, method.interface_name(), (12, middle), 14, INK, left)?;
            }
            let right = Pos::new(HPos::Right, VPos::Center);
            write(canvas, method.solver_name(), (LEFT - 9, middle), 12, FAINT, right)?;
        }
    }
    Ok(())
}

fn draw_cell(canvas: &Canvas<'_>, cell: &Cell, (x, y): (i32, i32)) -> Drawn {
    let (fill, ink) = cell.status().map_or((NOT_OFFERED, FAINT), colours);
    let corners = [(x, y), (x + FIELD.0 - 2, y + FIELD.1 - 2)];
    canvas.draw(&Rectangle::new(corners, fill.filled()))?;
    let middle = (x + FIELD.0 / 2 - 1, y + FIELD.1 / 2 - 1);
    write(canvas, &cell.to_string(), middle, 10, ink, Pos::new(HPos::Center, VPos::Center))
}

fn draw_notes(canvas: &Canvas<'_>, height: i32) -> Drawn {
    let of_changes = format!(
        "Errors of C are against a factorisation of the same equations, errors of changes, from {:.0} % on, against a lattice of \
         100,000 tetrahedra with planes in the faces of bodies. –: not offered.",
        100.0 * MODEL
    );
    let notes = [
        "Two stripes of 100 mm x 20 mm, 9,000 tetrahedra, two frames. Tolerance of C: 1e-8; 1e-5 where potentials are in f32; \
         the paper's method stops at a residual of 1e-5.",
        &of_changes,
    ];
    for (line, words) in (0..).zip(notes) {
        let at = (LEFT, height - BOTTOM + 14 + 18 * line);
        write(canvas, words, at, 12, FAINT, Pos::new(HPos::Left, VPos::Top))?;
    }
    Ok(())
}
