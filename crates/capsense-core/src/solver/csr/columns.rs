//! Fields of a few terminals side by side, and what an iteration does to them.

use super::change::{Change, ChangeProducts};
use super::rows::{Rows, STRIP};
use crate::instructions::vectorised_by_eight;
use crate::workers::Workers;
use std::ops::Range;

/// One group of `L` columns. Rows of objects come after those of nodes.
#[derive(Clone, Debug)]
pub(super) struct Columns<const L: usize> {
    pub(super) x: Vec<[f64; L]>,
    /// K x, at all rows.
    pub(super) kx: Vec<[f64; L]>,
    /// The last step.
    pub(super) p: Vec<[f32; L]>,
    /// XᵀKX.
    energies: [[f64; L]; L],
    /// For every strip.
    partial: Vec<Sums<L>>,
}

/// Sums over rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums<const L: usize> {
    /// XᵀKX.
    pub(super) energies: [[f64; L]; L],
    /// (Kx)ᵀp.
    pub(super) along: [f64; L],
    /// Σ (Kx)² over free and fixed rows.
    pub(super) residual: [f64; L],
    pub(super) charge: [f64; L],
    /// Of the change that is followed.
    pub(super) of_change: ChangeProducts<L>,
}

impl<const L: usize> Default for Sums<L> {
    fn default() -> Self {
        let zeros = [0.0; L];
        let of_change = ChangeProducts::default();
        Self { energies: [zeros; L], along: zeros, residual: zeros, charge: zeros, of_change }
    }
}

impl<const L: usize> Sums<L> {
    /// Takes in one row.
    #[inline(always)]
    fn add_row(&mut self, x: &[f64; L], kx: &[f64; L], p: &[f32; L], fixed: bool) {
        add_products(&mut self.energies, x, kx);
        for lane in 0..L {
            self.along[lane] += kx[lane] * f64::from(p[lane]);
        }
        if fixed {
            // Of the rows that are fixed, those of the column's own terminal are at 1 V.
            for ((sum, x), kx) in self.charge.iter_mut().zip(x).zip(kx) {
                *sum += (x * kx) * (x * kx);
            }
        } else {
            for (sum, kx) in self.residual.iter_mut().zip(kx) {
                *sum += kx * kx;
            }
        }
    }

    fn add(&mut self, other: &Self) {
        for (sum, other) in self.energies.iter_mut().zip(&other.energies) {
            add(sum, other);
        }
        add(&mut self.along, &other.along);
        add(&mut self.residual, &other.residual);
        add(&mut self.charge, &other.charge);
        self.of_change.add(&other.of_change);
    }
}

/// sum += other.
#[inline(always)]
pub(super) fn add<const L: usize>(sum: &mut [f64; L], other: &[f64; L]) {
    for lane in 0..L {
        sum[lane] += other[lane];
    }
}

impl<const L: usize> Columns<L> {
    /// Zeros for so many nodes and objects.
    pub(super) fn new(nodes: usize, objects: usize) -> Self {
        Self {
            x: vec![[0.0; L]; nodes + objects],
            kx: vec![[0.0; L]; nodes + objects],
            p: vec![[0.0; L]; nodes],
            energies: [[0.0; L]; L],
            partial: vec![Sums::default(); nodes.div_ceil(STRIP)],
        }
    }

    /// Zeros everywhere. What was no number would not leave sums that it is in.
    pub(super) fn clear(&mut self) {
        self.x.fill([0.0; L]);
        self.kx.fill([0.0; L]);
        self.p.fill([0.0; L]);
        self.energies = [[0.0; L]; L];
    }

    /// K x everywhere, and the sums over it.
    pub(super) fn evaluate(&mut self, rows: &Rows, workers: &Workers) -> Sums<L> {
        self.evaluate_strips(rows, &mut Change::none(), workers, |_, _| true);
        self.evaluate_objects(rows);
        self.total(rows)
    }

    /// p = a z + b p, x += p and what fields are led on by, and then as [`Columns::evaluate`], in one walk: a strip is
    /// evaluated as soon as all that it takes has moved, and the change of the fields with it. Each thread walks along a
    /// slab of rows; strips that take from two slabs come last.
    pub(super) fn step<Z: Copy + Into<f64> + Sync>(
        &mut self,
        rows: &Rows,
        z: &[[Z; L]],
        along: &Along<L>,
        mut change: Change<'_, L>,
        workers: &Workers,
    ) -> Sums<L> {
        let size = slab(rows, workers);
        let Self { x, kx, p, partial, .. } = self;
        let (x, objects) = x.split_at_mut(rows.len());
        let objects = &*objects;
        let fields = x.chunks_mut(size).zip(p.chunks_mut(size)).zip(z.chunks(size));
        let charges = kx[..rows.len()].chunks_mut(size).zip(partial.chunks_mut(size / STRIP));
        let tasks = fields.zip(charges).zip(change.cut(size)).zip((0..).step_by(size));
        workers.for_each(tasks, |(((((x, p), z), (kx, sums)), change), first)| {
            vectorised_by_eight(
                #[inline(always)]
                || walk(rows, along, Slab { first, x, p, z, objects, kx, sums, change }),
            );
        });
        if size < rows.len() {
            self.evaluate_strips(rows, &mut change, workers, |reach, slab| {
                reach.start < slab.start || reach.end > slab.end
            });
        }
        self.evaluate_objects(rows);
        self.total(rows)
    }

    /// K x and its sums at the strips that `choose` names by their reach and their slab.
    fn evaluate_strips(
        &mut self,
        rows: &Rows,
        change: &mut Change<'_, L>,
        workers: &Workers,
        choose: impl Fn(&Range<usize>, &Range<usize>) -> bool + Sync,
    ) {
        let size = slab(rows, workers);
        let Self { x, kx, p, partial, .. } = self;
        let (x, objects) = x.split_at(rows.len());
        let p = p.as_slice();
        let charges = kx[..rows.len()].chunks_mut(size).zip(partial.chunks_mut(size / STRIP));
        let tasks = charges.zip(change.cut(size)).zip((0..).step_by(size));
        workers.for_each(tasks, |(((kx, sums), mut change), first)| {
            let slab = first..first + kx.len();
            vectorised_by_eight(
                #[inline(always)]
                || {
                    for ((kx, sums), from) in kx.chunks_mut(STRIP).zip(sums).zip((first..).step_by(STRIP)) {
                        if choose(&rows.reach(from / STRIP), &slab) {
                            let here = from - first..from - first + kx.len();
                            change.take_charges(here.clone(), kx);
                            evaluate_strip(rows, x, 0, objects, kx, from);
                            *sums = sum_strip(rows, &x[from..], &p[from..], kx, from);
                            sums.of_change = change.give_charges(here, kx);
                        }
                    }
                },
            );
        });
    }

    /// XᵀKX as it is: a sum over rows, so that of a pair and of the pair the other way round are equal but for rounding.
    pub(super) fn energies(&self) -> &[[f64; L]; L] {
        &self.energies
    }

    /// Sets a potential and the energies with it. What K x changes is to be evaluated.
    pub(super) fn set_potential(&mut self, row: usize, lane: usize, potential: f64) {
        let before = std::mem::replace(&mut self.x[row][lane], potential);
        let change = potential - before;
        add(&mut self.energies[lane], &self.kx[row].map(|kx| change * kx));
    }

    /// The sums of all strips and of the bodies. Links count as if each led to a node of its own.
    fn total(&mut self, rows: &Rows) -> Sums<L> {
        let mut sums = Sums::default();
        self.partial.iter().for_each(|partial| sums.add(partial));
        let residual = sums.residual;
        for (x, kx) in self.x.iter().zip(&self.kx).skip(rows.len()) {
            sums.add_row(x, kx, &[0.0; L], false);
        }
        sums.residual = residual;
        for link in rows.links() {
            let (at_node, at_body) = (&self.x[link.row as usize], &self.x[link.object_row as usize]);
            for lane in 0..L {
                let onto_body = link.weight * (at_body[lane] - at_node[lane]);
                sums.charge[lane] += (at_body[lane] * onto_body).powi(2);
            }
        }
        self.energies = sums.energies;
        sums
    }

    /// The charges on objects that links bring.
    pub(super) fn evaluate_objects(&mut self, rows: &Rows) {
        self.kx[rows.len()..].fill([0.0; L]);
        for link in rows.links() {
            let (row, object) = (link.row as usize, link.object_row as usize);
            for lane in 0..L {
                self.kx[object][lane] += link.weight * (self.x[object][lane] - self.x[row][lane]);
            }
        }
    }

    /// x, and K x to be computed anew.
    pub(super) fn parts(&mut self) -> (&[[f64; L]], &mut [[f64; L]]) {
        (&self.x, &mut self.kx)
    }

    /// K x at all objects, and the energies with it.
    pub(super) fn refresh_objects(&mut self, rows: &Rows) {
        self.add_energies_of_objects(rows, -1.0);
        self.evaluate_objects(rows);
        self.add_energies_of_objects(rows, 1.0);
    }

    /// Adds to the energies.
    pub(super) fn add_energies(&mut self, more: &[[f64; L]; L]) {
        self.energies.iter_mut().zip(more).for_each(|(energies, more)| add(energies, more));
    }

    /// The energy of each column.
    pub(super) fn own_energies(&self) -> [f64; L] {
        std::array::from_fn(|lane| self.energies[lane][lane])
    }

    /// Adds `sign` times the part of the energies that is of rows of objects.
    fn add_energies_of_objects(&mut self, rows: &Rows, sign: f64) {
        let Self { x, kx, energies, .. } = self;
        for (x, kx) in x[rows.len()..].iter().zip(&kx[rows.len()..]) {
            add_change(energies, x, &[0.0; L], &kx.map(|kx| sign * kx));
        }
    }

    /// zᵀKz and zᵀKp.
    pub(super) fn curvatures<Z: Copy + Into<f64> + Sync>(
        &mut self,
        rows: &Rows,
        z: &[[Z; L]],
        workers: &Workers,
    ) -> [[f64; L]; 2] {
        let p = self.p.as_slice();
        let size = slab(rows, workers);
        let tasks = self.partial.chunks_mut(size / STRIP).zip((0..).step_by(size));
        workers.for_each(tasks, |(strips, first)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    for (sums, from) in strips.iter_mut().zip((first..).step_by(STRIP)) {
                        let range = from..(from + STRIP).min(rows.len());
                        [sums.energies[0], sums.along] = curvatures_of_strip(rows, z, p, range);
                    }
                },
            );
        });
        let mut sums = [[0.0; L]; 2];
        for partial in &self.partial {
            add(&mut sums[0], &partial.energies[0]);
            add(&mut sums[1], &partial.along);
        }
        sums
    }
}

/// Adds the products of all pairs of columns of two rows.
#[inline(always)]
pub(super) fn add_products<const L: usize>(sums: &mut [[f64; L]; L], a: &[f64; L], b: &[f64; L]) {
    for (sums, &a) in sums.iter_mut().zip(a) {
        for lane in 0..L {
            sums[lane] += a * b[lane];
        }
    }
}

/// Adds to energies what it makes of them that a row of such charges takes another potential.
#[inline(always)]
pub(super) fn add_raise<const L: usize>(
    energies: &mut [[f64; L]; L],
    charges: &[f64; L],
    diagonal: f64,
    by: &[f64; L],
) {
    let after: [f64; L] = std::array::from_fn(|lane| charges[lane] + diagonal * by[lane]);
    add_products(energies, by, &after);
    add_products(energies, charges, by);
}

/// Adds to the energies what it makes of them that the charges of a row have changed.
#[inline(always)]
pub(super) fn add_change<const L: usize>(
    energies: &mut [[f64; L]; L],
    x: &[f64; L],
    before: &[f64; L],
    now: &[f64; L],
) {
    for (energies, &x) in energies.iter_mut().zip(x) {
        for lane in 0..L {
            energies[lane] += x * (now[lane] - before[lane]);
        }
    }
}

/// How fields move: p = a z + b p, x += p.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along<const L: usize> {
    a: [f64; L],
    b: [f64; L],
    /// All bits where the factor is not zero: what stands in a column that is done must not count, whatever it is.
    a_mask: [u64; L],
    b_mask: [u64; L],
}

impl<const L: usize> Along<L> {
    pub(super) fn new(a: [f64; L], b: [f64; L]) -> Self {
        let mask = |factors: [f64; L]| factors.map(|factor| if factor == 0.0 { 0 } else { u64::MAX });
        Self { a, b, a_mask: mask(a), b_mask: mask(b) }
    }

    /// Moves some rows of a slab.
    #[inline(always)]
    fn advance<Z: Copy + Into<f64>>(
        &self,
        rows: Range<usize>,
        x: &mut [[f64; L]],
        p: &mut [[f32; L]],
        z: &[[Z; L]],
        change: &mut Change<'_, L>,
    ) {
        let fields = x[rows.clone()].iter_mut().zip(&mut p[rows.clone()]).zip(&z[rows.clone()]);
        if change.fields.is_empty() {
            for ((x, p), z) in fields {
                add(x, &self.step(p, z));
            }
            return;
        }
        let (follows, Change { fields: d, lead, rest, .. }) = (change.is_followed(), change);
        for (((x, p), z), d) in fields.zip(&mut d[rows]) {
            let mut by = self.step(p, z);
            for lane in 0..L {
                by[lane] += lead[lane] * d[lane];
                d[lane] = if follows { rest[lane] * d[lane] + by[lane] } else { d[lane] };
            }
            add(x, &by);
        }
    }

    /// The step of one row.
    #[inline(always)]
    fn step<Z: Copy + Into<f64>>(&self, p: &mut [f32; L], z: &[Z; L]) -> [f64; L] {
        let Self { a, b, a_mask, b_mask } = self;
        let mut step = [0.0; L];
        for lane in 0..L {
            let z = f64::from_bits(z[lane].into().to_bits() & a_mask[lane]);
            let before = f64::from_bits(f64::from(p[lane]).to_bits() & b_mask[lane]);
            step[lane] = a[lane] * z + b[lane] * before;
            p[lane] = step[lane] as f32;
        }
        step
    }
}

/// Rows that one thread walks along, from `first` on; objects are only read.
struct Slab<'a, const L: usize, Z> {
    first: usize,
    x: &'a mut [[f64; L]],
    p: &'a mut [[f32; L]],
    z: &'a [[Z; L]],
    objects: &'a [[f64; L]],
    kx: &'a mut [[f64; L]],
    sums: &'a mut [Sums<L>],
    change: Change<'a, L>,
}

/// Moves all rows and evaluates the strips that take nothing from elsewhere.
#[inline(always)]
fn walk<const L: usize, Z: Copy + Into<f64>>(rows: &Rows, along: &Along<L>, slab: Slab<'_, L, Z>) {
    let Slab { first, x, p, z, objects, kx, sums, mut change } = slab;
    let mut moved = 0;
    for (strip, (kx, sums)) in kx.chunks_mut(STRIP).zip(sums).enumerate() {
        let at = strip * STRIP;
        let reach = rows.reach((first + at) / STRIP);
        let next = (reach.end - first).clamp(moved, x.len());
        along.advance(moved..next, x, p, z, &mut change);
        moved = next;
        if reach.start >= first && reach.end <= first + x.len() {
            change.take_charges(at..at + kx.len(), kx);
            evaluate_strip(rows, x, first, objects, kx, first + at);
            *sums = sum_strip(rows, &x[at..], &p[at..], kx, first + at);
            sums.of_change = change.give_charges(at..at + kx.len(), kx);
        }
    }
}

/// Number of rows that one thread takes: whole strips.
fn slab(rows: &Rows, workers: &Workers) -> usize {
    rows.len().div_ceil(STRIP).div_ceil(workers.threads()).max(1) * STRIP
}

/// K x at consecutive rows from `from` on. The rows of x count from `first`.
#[inline(always)]
pub(super) fn evaluate_strip<const L: usize>(
    rows: &Rows,
    x: &[[f64; L]],
    first: usize,
    objects: &[[f64; L]],
    kx: &mut [[f64; L]],
    from: usize,
) {
    for (kx, row) in kx.iter_mut().zip(from..) {
        *kx = rows.product(row, x, first);
    }
    for link in rows.links_of(from..from + kx.len()) {
        let (kx, object) =
            (&mut kx[link.row as usize - from], &objects[link.object_row as usize - rows.len()]);
        for lane in 0..L {
            kx[lane] -= link.weight * object[lane];
        }
    }
}

/// The sums over consecutive rows from `from` on, where x and p start.
#[inline(always)]
fn sum_strip<const L: usize>(
    rows: &Rows,
    x: &[[f64; L]],
    p: &[[f32; L]],
    kx: &[[f64; L]],
    from: usize,
) -> Sums<L> {
    let mut sums = Sums::default();
    for (((x, kx), p), &fixed) in x.iter().zip(kx).zip(p).zip(&rows.fixed()[from..]) {
        sums.add_row(x, kx, p, fixed);
    }
    sums
}

#[inline(always)]
fn curvatures_of_strip<const L: usize, Z: Copy + Into<f64>>(
    rows: &Rows,
    z: &[[Z; L]],
    p: &[[f32; L]],
    range: Range<usize>,
) -> [[f64; L]; 2] {
    let mut sums = [[0.0; L]; 2];
    for row in range {
        let kz = rows.product(row, z, 0);
        for lane in 0..L {
            sums[0][lane] += kz[lane] * z[row][lane].into();
            sums[1][lane] += kz[lane] * f64::from(p[row][lane]);
        }
    }
    sums
}
