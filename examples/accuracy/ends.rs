//! `accuracy ends`: where the factors come from by which weights of edges near the ends of thin floating plates are changed.
//!
//! Between planes of a lattice, plates thinner than a cell are told of by weights and links alone, and how much field a
//! floating one short-circuits is off by up to tens of percent, depending on where between two planes it is. Here a long
//! plate across a section of a lattice ([`crate::section`]) stands for all of them: cells are as wide as asked and 1 high, and
//! potentials at the section's boundary are those of fields without the plate, one uniform across the plate and some
//! exp(-kz) cos kx. On the lattice their waves are those that solve the lattice's own equations, so that what differs is due
//! to the plate.
//!
//! The response of a plate is the energy that it adds, floating or grounded; for fields that decay it is told in those at the
//! plate's middle. It is compared with that in a fine lattice with planes through all faces, which is graded towards the
//! plate's edges, in the limit of three such. Errors are means over places of the plate's end between columns. Over places of
//! its middle between rows they are taken in pairs, as far above a row as below one: half the sum is symmetric and half the
//! difference antisymmetric.
//!
//! Four patterns of edges get factors 1 + y: two antisymmetric ones above and below the plate (of edges along z and along x)
//! and two symmetric ones (of edges along z that pass the plate outside its end, and along x). The y are those that make the
//! sum of squares least of symmetric and antisymmetric errors of floating plates, antisymmetric ones of grounded plates and
//! by how much symmetric ones of grounded plates change, as they are right without, each with a weight, and of y.

use crate::section::{Energies, Field, Plate, Section, X, Z};
use anyhow::Result;
use capsense::core::glam::{DMat4, DVec4};
use clap::Args;
use std::array::from_fn;

/// Of cells, in their heights.
const WIDTHS: [f64; 4] = [0.55, 1.0, 1.6, 2.4];

/// Of plates, in heights of cells, as all lengths are.
const THICKNESSES: [f64; 12] = [0.1, 0.2, 0.35, 0.55, 0.75, 0.9, 1.1, 1.3, 1.6, 1.9, 2.2, 2.6];
const QUICK_THICKNESSES: [f64; 2] = [0.2, 0.9];

/// From the nearest row to the plate's middle.
const PLACES: [f64; 7] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5];

/// Where faces would be in planes, or two rows as near, it is done for a place so far beside.
const ASIDE: f64 = 0.005;

/// From the plate's end to the next column, in widths of cells.
const END_PLACES: [f64; 5] = [0.08, 0.3, 0.5, 0.7, 0.92];

/// How fast fields decay.
const DECAYS: [f64; 4] = [0.18, 0.27, 0.36, 0.45];

/// From the middle to the boundary, above and below.
const ROWS: f64 = 11.0;

/// About half the plate's width. Wide cells are told of by a wider plate, of so many columns at least, in fields that decay as much over it
/// and in a section as large over it.
const HALF_WIDTH: f64 = 2.78;
const COLUMNS: f64 = 3.0;

/// From the middle to the boundary aside, in half widths of the plate.
const ASIDE_OF_PLATE: f64 = 3.6;

/// What gap, in cells, or what overlap, in thicknesses of the plate, makes a change a whole one.
const RAMP: f64 = 0.2;

/// In a fit: what differences of y are told from, how far y goes in a step, how many steps there are, and what y costs.
const DIFFERENCE: f64 = 0.03;
const LARGEST_STEP: f64 = 0.5;
const STEPS: usize = 2;
const COST: f64 = 0.3;

/// Terms in a fit.
const TERMS: usize = 12;

/// What the y of edges along z and x that change sign, of edges that pass the plate, and of edges along x are to be
#[derive(Args, Debug)]
pub(crate) struct EndsArguments {
    /// Errors before and after instead of factors
    #[arg(long)]
    errors: bool,
    /// Only two thicknesses
    #[arg(long)]
    quick: bool,
}

/// Prints a row of factors for each thickness, or one of errors for each place.
pub(crate) fn ends(arguments: &EndsArguments) -> Result<()> {
    let thicknesses = if arguments.quick { &QUICK_THICKNESSES[..] } else { &THICKNESSES[..] };
    if arguments.errors {
        println!("{HEADING}");
    }
    for width in WIDTHS {
        if !arguments.errors {
            println!("// Cells {width:.2} times as wide as high.");
        }
        for &thickness in thicknesses {
            let study = Study::new(width, thickness, GRADING);
            if arguments.errors {
                PLACES.iter().for_each(|&place| println!("{}", study.row(place)));
            } else {
                let rows = PLACES.map(|place| in_brackets(&study.fit(place).to_array(), 3));
                println!("({thickness}, [{}]),", rows.join(", "));
            }
        }
    }
    Ok(())
}

const HEADING: &str = "Errors in percent, before → after. In brackets: symmetric ones of the floating plate, in the \
uniform field and in the three that decay least; antisymmetric ones in these three; the same of the grounded plate. Last: \
how the first four scatter over places of the end.";

/// Of planes in fine lattices: distances of the first from a face, and by how much distances grow with that from the face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grading {
    pub(crate) finest: f64,
    pub(crate) growth: f64,
}

const GRADING: Grading = Grading { finest: 0.015, growth: 0.08 };

impl Grading {
    /// Distances from a face, up to `length`.
    fn distances(self, length: f64) -> Vec<f64> {
        let whole = 1.0 + self.growth * length / self.finest;
        let count = (whole.ln() / self.growth).ceil();
        let distance = |k: usize| self.finest / self.growth * (whole.powf(k as f64 / count) - 1.0);
        (0..=count as usize).map(distance).collect()
    }

    /// From `from` through a face to `to`.
    fn planes(self, from: f64, face: f64, to: f64) -> Vec<f64> {
        let before = self.distances(face - from).into_iter().rev().map(|distance| face - distance);
        before.chain(self.distances(to - face).into_iter().skip(1).map(|distance| face + distance)).collect()
    }
}

/// Of floating plates in the uniform field and in those that decay, and of grounded ones in those that decay: responses,
/// or errors of them in percent.
pub(crate) type PerField = [f64; 9];

const GROUNDED: usize = 1 + DECAYS.len();

fn responses(of: &Energies, empty: &Energies) -> PerField {
    from_fn(|k| match k {
        ..GROUNDED => of.floating[k] - empty.floating[k],
        _ => of.grounded[k + 1 - GROUNDED] - empty.grounded[k + 1 - GROUNDED],
    })
}

/// Factors are 1 plus these: of edges along z and x that change sign, of those that pass the plate, of edges along x.
pub(crate) type Changes = DVec4;

/// Plates of one thickness in sections of one lattice.
pub(crate) struct Study {
    width: f64,
    thickness: f64,
    decays: [f64; DECAYS.len()],
    fields: Vec<Field>,
    section: Section,
    empty: Energies,
    /// Half the plate's width for each place of its end, and what is right.
    plates: [(f64, PerField); END_PLACES.len()],
}

impl Study {
    pub(crate) fn new(width: f64, thickness: f64, grading: Grading) -> Self {
        let half = (HALF_WIDTH / width).round().max(COLUMNS);
        let scale = f64::max(half * width / HALF_WIDTH, 1.0);
        let decays = DECAYS.map(|decay| decay / scale);
        let columns = (ASIDE_OF_PLATE * half) as usize;
        let xs: Vec<f64> = (0..=columns).map(|k| width * k as f64).collect();
        let rows = (ROWS * scale).round();
        let zs = (0..=2 * rows as usize).map(|k| k as f64 - rows).collect();
        let fields = fields(decays, |decay| 2.0 / width * (width * (0.5 * decay).sinh()).asin());
        let section = Section::new([xs, zs]);
        let empty = section.energies(&fields);
        let plates = END_PLACES.map(|place| {
            let end = (half - place) * width;
            let boundary = width * columns as f64;
            (end, limit(grading, |grading| reference(grading, decays, [end, boundary, rows], thickness)))
        });
        Self { width, thickness, decays, fields, section, empty, plates }
    }

    /// For each place of the end, with the plate's middle so far above a row.
    fn errors(&self, middle: f64, changes: Changes) -> [PerField; END_PLACES.len()] {
        self.plates.map(|(end, right)| {
            let half = 0.5 * self.thickness;
            let plate = Plate { end, bottom: middle - half, top: middle + half };
            let mut section = self.section.clone();
            section.insert(plate);
            if changes != Changes::ZERO {
                section.change_weights(|axis, from, to| change(plate, self.width, changes, axis, from, to));
            }
            section.link_near_end(plate, self.width);
            let responses = responses(&section.energies(&self.fields), &self.empty);
            from_fn(|k| {
                let decay = match k {
                    0 => 0.0,
                    _ => self.decays[(k - 1) % DECAYS.len()],
                };
                100.0 * (responses[k] * (2.0 * decay * middle).exp() / right[k] - 1.0)
            })
        })
    }

    /// For a plate so far above a row, and for one so far below; what is antisymmetric changes its sign.
    pub(crate) fn pair(&self, place: f64, changes: Changes) -> Pair {
        let place = place.clamp(ASIDE, 0.5 - ASIDE);
        let mirrored = changes * Changes::new(-1.0, -1.0, 1.0, 1.0);
        Pair([self.errors(place, changes), self.errors(1.0 - place, mirrored)])
    }

    /// What is best at a place.
    pub(crate) fn fit(&self, place: f64) -> Changes {
        let before = self.pair(place, Changes::ZERO).symmetric();
        let terms = |changes| self.pair(place, changes).terms(&before);
        let mut changes = Changes::ZERO;
        for _ in 0..STEPS {
            let at = terms(changes);
            let slopes = Changes::AXES.map(|axis| {
                let beside = terms(changes + DIFFERENCE * axis);
                from_fn::<f64, TERMS, _>(|k| (beside[k] - at[k]) / DIFFERENCE)
            });
            let products =
                slopes.map(|a| DVec4::from_array(slopes.map(|b| a.iter().zip(&b).map(|(a, b)| a * b).sum())));
            let downhill =
                DVec4::from_array(slopes.map(|a| -a.iter().zip(&at).map(|(a, b)| a * b).sum::<f64>()));
            let [a, b, c, d] = products;
            let normal = DMat4::from_cols(a, b, c, d) + DMat4::from_diagonal(DVec4::splat(COST * COST));
            let step = normal.inverse() * (downhill - COST * COST * changes);
            changes += step.clamp(DVec4::splat(-LARGEST_STEP), DVec4::splat(LARGEST_STEP));
        }
        // A plate in the middle between rows, or on one, has its mirror image at the same place.
        if place == 0.0 || place == 0.5 {
            changes.x = 0.0;
            changes.y = 0.0;
        }
        changes
    }

    fn row(&self, place: f64) -> String {
        let [before, after] = [Changes::ZERO, self.fit(place)].map(|changes| self.pair(place, changes).row());
        let (width, thickness) = (self.width, self.thickness);
        format!("width {width:.2} thickness {thickness:.2} place {place:.2}: {before} → {after}")
    }
}

/// Uniform and decaying, with as many waves as fit the decay.
fn fields(decays: [f64; DECAYS.len()], wave: impl Fn(f64) -> f64) -> Vec<Field> {
    let decaying = decays.map(|decay| Field::Wave { decay, wave: wave(decay) });
    [Field::Uniform].into_iter().chain(decaying).collect()
}

/// Responses of a plate in the middle of a fine section, which is as large as the other.
fn reference(
    grading: Grading,
    decays: [f64; DECAYS.len()],
    [end, aside, above]: [f64; 3],
    thickness: f64,
) -> PerField {
    let above = grading.planes(0.0, 0.5 * thickness, above);
    let zs = above.iter().skip(1).rev().map(|z| -z).chain(above.iter().copied()).collect();
    let fields = fields(decays, |decay| decay);
    let mut section = Section::new([grading.planes(0.0, end, aside), zs]);
    let empty = section.energies(&fields);
    section.insert(Plate { end, bottom: -0.5 * thickness, top: 0.5 * thickness });
    responses(&section.energies(&fields), &empty)
}

/// Of what depends on a grading. Errors at edges are in proportion to what is finest, those of waves that reach the plate
/// through wide cells to the square of the growth: without the latter these were too large by up to 3 %, or 5 if grounded.
fn limit(grading: Grading, of: impl Fn(Grading) -> PerField) -> PerField {
    let at = of(grading);
    let finer = of(Grading { finest: 0.5 * grading.finest, ..grading });
    let slower = of(Grading { growth: 0.5 * grading.growth, ..grading });
    from_fn(|k| at[k] + 2.0 * (finer[k] - at[k]) + 4.0 / 3.0 * (slower[k] - at[k]))
}

/// By how much the weight of an edge changes.
fn change(plate: Plate, width: f64, changes: Changes, axis: usize, from: [f64; 2], to: [f64; 2]) -> f64 {
    let [along_z, along_x, passing, both] = changes.to_array();
    let outside = (0.5 * (from[X] + to[X]) - plate.end) / width;
    let [above, below] = [from[Z] - plate.top, plate.bottom - to[Z]].map(in_first_row);
    if axis == X {
        let antisymmetric = along_x * hat(outside, -0.3, 1.25);
        let symmetric = both * hat(outside, 0.0, 1.0);
        return above * (symmetric + antisymmetric) + below * (symmetric - antisymmetric);
    }
    let overlap = (plate.top.min(to[Z]) - plate.bottom.max(from[Z])).max(0.0) / (plate.top - plate.bottom);
    let passes = (overlap / RAMP).min(1.0) * hat(outside, 0.8, 0.8);
    along_z * hat(outside, 0.5, 1.0) * (above - below) + passing * passes
}

/// How much of a change an edge gets that is so far from the plate: rows take it over from those before as gaps grow.
fn in_first_row(gap: f64) -> f64 {
    let ramp = |gap: f64| (gap / RAMP).clamp(0.0, 1.0);
    ramp(gap) - ramp(gap - 1.0)
}

fn hat(at: f64, middle: f64, half_width: f64) -> f64 {
    (1.0 - (at - middle).abs() / half_width).max(0.0)
}

/// Errors at a place and at its mirror image, for each place of the end.
pub(crate) struct Pair([[PerField; END_PLACES.len()]; 2]);

impl Pair {
    fn means(&self) -> [PerField; 2] {
        self.0.map(|errors| from_fn(|k| mean(errors.map(|of| of[k]))))
    }

    pub(crate) fn symmetric(&self) -> PerField {
        let [above, below] = self.means();
        from_fn(|k| 0.5 * (above[k] + below[k]))
    }

    pub(crate) fn antisymmetric(&self) -> PerField {
        let [above, below] = self.means();
        from_fn(|k| 0.5 * (above[k] - below[k]))
    }

    /// What is to be small, with weights: longer waves count more, grounded plates more than floating ones.
    fn terms(&self, before: &PerField) -> [f64; TERMS] {
        let (symmetric, antisymmetric) = (self.symmetric(), self.antisymmetric());
        let changed = |k: usize| symmetric[GROUNDED + k] - before[GROUNDED + k];
        let grounded = |k: usize| 3.0 * antisymmetric[GROUNDED + k];
        [
            symmetric[0],
            0.7 * symmetric[1],
            0.5 * symmetric[2],
            2.0 * changed(0),
            2.0 * changed(1),
            2.0 * changed(2),
            antisymmetric[1],
            antisymmetric[2],
            0.7 * antisymmetric[3],
            grounded(0),
            grounded(1),
            grounded(2),
        ]
    }

    /// Of floating plates, but for the field that decays fastest, over places of the end.
    fn scatter(&self) -> f64 {
        let variance = |values: [f64; END_PLACES.len()]| mean(values.map(|v| (v - mean(values)).powi(2)));
        let of = |k: usize| mean(self.0.map(|errors| variance(errors.map(|of| of[k]))));
        mean([0, 1, 2, 3].map(of)).sqrt()
    }

    fn row(&self) -> String {
        let (symmetric, antisymmetric) = (self.symmetric(), self.antisymmetric());
        format!(
            "{} {} {} {:.1}",
            in_brackets(&symmetric[..4], 2),
            in_brackets(&antisymmetric[1..4], 2),
            in_brackets(&antisymmetric[GROUNDED..GROUNDED + 3], 2),
            self.scatter()
        )
    }
}

fn mean<const N: usize>(values: [f64; N]) -> f64 {
    values.iter().sum::<f64>() / N as f64
}

/// Without the sign of what rounds to zero.
fn in_brackets(values: &[f64], decimals: usize) -> String {
    let scale = 10.0_f64.powi(decimals as i32);
    let rounded = |value: &f64| format!("{:.decimals$}", (scale * value).round() / scale + 0.0);
    format!("[{}]", values.iter().map(rounded).collect::<Vec<_>>().join(", "))
}
