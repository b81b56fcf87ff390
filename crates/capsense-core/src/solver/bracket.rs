//! What changed couplings can do to capacitances at most, without solving: frames that cannot matter are not solved.
//!
//! The energy of the old fields with the new couplings bounds C_ss from above (Dirichlet's principle). The old currents,
//! led along the new couplings so that they still balance at every free node, bound it from below (Thomson's principle).
//! The gap between the two is Σ (i - w Δφ)²/w over the changed couplings: the currents i that the old fields drove against
//! those that they would drive now. What the old fields lacked to the solution, in the norm of the energy, adds to it.

/// One edge with its coupling, as one column sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeFields {
    pub(crate) through: f64,
    pub(crate) links: [f64; 2],
    /// Potentials of the ends, and of the objects that links lead to.
    pub(crate) ends: [f64; 2],
    pub(crate) objects: [f64; 2],
}

/// Upper bounds, kept from one solve to the next.
#[derive(Clone, Debug)]
pub(crate) struct Bracket {
    columns: usize,
    /// XᵀKX of the fields as they are, less what was foreseen of their errors.
    pub(super) energies: Vec<f64>,
    /// By how much the energy of each column's field may exceed that of the solution, and what was foreseen of it.
    pub(super) gap: Vec<f64>,
    foreseen: Vec<f64>,
    /// Sum over the changes under way, and the factor by which they weaken couplings at most.
    added: Vec<f64>,
    weakened: f64,
    /// Whether no bound is known.
    pub(crate) is_lost: bool,
}

impl Bracket {
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns,
            energies: vec![0.0; columns * columns],
            gap: vec![0.0; columns],
            foreseen: vec![0.0; columns],
            added: vec![0.0; columns],
            weakened: 1.0,
            is_lost: true,
        }
    }

    /// Takes over after a solve: the energies of the fields, what is to be taken from them, and the relative errors that
    /// this leaves.
    pub(crate) fn reset(
        &mut self,
        energies: &[f64],
        corrections: &[f64],
        relative_errors: impl Iterator<Item = f64>,
    ) {
        for ((corrected, energy), correction) in self.energies.iter_mut().zip(energies).zip(corrections) {
            *corrected = energy - correction;
        }
        for (column, error) in relative_errors.enumerate() {
            let own = column * self.columns + column;
            self.foreseen[column] = corrections[own];
            self.gap[column] = corrections[own] + error * self.energies[own];
        }
        self.added.fill(0.0);
        self.is_lost = false;
    }

    pub(crate) fn start_changes(&mut self) {
        self.added.fill(0.0);
        self.weakened = 1.0;
    }

    /// Takes one changed edge of base weight `weight`, before and after, column by column. `free` tells which ends are
    /// free now.
    pub(crate) fn change(
        &mut self,
        weight: f64,
        before: &[EdgeFields],
        after: &[EdgeFields],
        free: [bool; 2],
    ) {
        for (column, (before, after)) in before.iter().zip(after).enumerate() {
            match gap(before, after, free) {
                Some(gap) => self.added[column] += weight * gap,
                None => self.is_lost = true,
            }
        }
        if let (Some(before), Some(after)) = (before.first(), after.first()) {
            self.weakened = self.weakened.max(weakening(before, after, free));
        }
        for s in 0..self.columns {
            for t in 0..self.columns {
                let change = energy(&after[s], &after[t]) - energy(&before[s], &before[t]);
                self.energies[s * self.columns + t] += weight * change;
            }
        }
    }

    /// All changes of a frame have been taken.
    pub(crate) fn finish_changes(&mut self) {
        for column in 0..self.columns {
            let added = std::mem::take(&mut self.added[column]);
            self.gap[column] = self.gap_with(column, added);
        }
        self.weakened = 1.0;
    }

    /// The gap of a column after changes that add so much.
    fn gap_with(&self, column: usize, added: f64) -> f64 {
        (added.sqrt() + (self.weakened * self.gap[column]).sqrt()).powi(2)
    }

    /// Whether the gap of a column still is, or with what was taken so far will be, below a part of its energy.
    pub(crate) fn is_below(&self, column: usize, tolerance: f64) -> bool {
        let energy = self.energies[column * self.columns + column];
        let error = self.gap_with(column, self.added[column]) - self.foreseen[column];
        !self.is_lost && (error <= tolerance * energy || energy <= 0.0 && error <= 0.0)
    }

    /// The gap of a column in relation to the energy.
    pub(crate) fn relative_error(&self, column: usize) -> f64 {
        let energy = self.energies[column * self.columns + column];
        if energy > 0.0 { (self.gap[column] - self.foreseen[column]) / energy } else { 0.0 }
    }
}

/// Currents out of either end, through and along the link, for a weight of one.
fn currents(edge: &EdgeFields) -> [f64; 2] {
    let through = edge.through * (edge.ends[0] - edge.ends[1]);
    let along = |end: usize| edge.links[end] * (edge.ends[end] - edge.objects[end]);
    [through + along(0), along(1) - through]
}

fn energy(s: &EdgeFields, t: &EdgeFields) -> f64 {
    let along = |end: usize| s.links[end] * (s.ends[end] - s.objects[end]) * (t.ends[end] - t.objects[end]);
    s.through * (s.ends[0] - s.ends[1]) * (t.ends[0] - t.ends[1]) + along(0) + along(1)
}

/// Σ (i - w Δφ)²/w with the old currents led along the new coupling; `None` when there is no way for them.
fn gap(before: &EdgeFields, after: &EdgeFields, free: [bool; 2]) -> Option<f64> {
    /// Currents that cancel to this part of them cancel.
    const ROUNDING: f64 = 1e-10;
    let (old, new) = (currents(before), currents(after));
    let excess: [f64; 2] = std::array::from_fn(|end| if free[end] { old[end] - new[end] } else { 0.0 });
    let over = |current: f64, weight: f64| match weight {
        _ if current == 0.0 => Some(0.0),
        weight if weight > 0.0 => Some(current * current / weight),
        _ => None,
    };
    if is_mixed(after) && free == [true; 2] {
        let [[a, b], [l, m]] = [excess, after.links];
        let resisted = after.through * (a + b).powi(2) + m * a * a + l * b * b;
        return Some(resisted / (l * m + after.through * (l + m)));
    }
    if after.links != [0.0; 2] || after.through == 0.0 {
        return Some(over(excess[0], after.links[0])? + over(excess[1], after.links[1])?);
    }
    let size = old[0].abs() + old[1].abs() + new[0].abs() + new[1].abs();
    match free {
        [true, true] if (excess[0] + excess[1]).abs() > ROUNDING * size => None,
        [true, _] => over(excess[0], after.through),
        [false, _] => over(excess[1], after.through),
    }
}

/// Whether a conductor takes but a part of an edge.
fn is_mixed(edge: &EdgeFields) -> bool {
    edge.through > 0.0 && edge.links != [0.0; 2]
}

/// The factor where currents can go both ways: at most the trace of A_before A_after⁻¹, with the weights between free
/// ends and from these to all else as matrices A.
fn weakening_of_mixed(before: &EdgeFields, after: &EdgeFields, free: [bool; 2]) -> f64 {
    let (old, new) = (before.links, after.links);
    let (sum, of_sum) = match free {
        [false, false] => return 1.0,
        [true, true] => (
            after.through * (old[0] + old[1])
                + before.through * (new[0] + new[1])
                + new[1] * old[0]
                + new[0] * old[1],
            new[0] * new[1] + after.through * (new[0] + new[1]),
        ),
        [first, _] => {
            let end = usize::from(!first);
            (before.through + old[end], after.through + new[end])
        }
    };
    if of_sum > 0.0 { (sum / of_sum).max(1.0) } else { f64::MAX }
}

/// By what factor errors of the old currents weigh more now: each weight against those that carry its current now.
fn weakening(before: &EdgeFields, after: &EdgeFields, free: [bool; 2]) -> f64 {
    if is_mixed(before) || is_mixed(after) {
        return weakening_of_mixed(before, after, free);
    }
    let over = |old: f64, new: f64| if old > 0.0 && new > 0.0 { old / new } else { 0.0 };
    let link = |end: usize| if free[end] { after.links[end] } else { 0.0 };
    let through = match after.links {
        [0.0, 0.0] => over(before.through, after.through),
        _ => over(before.through, link(0)) + over(before.through, link(1)),
    };
    let along = |end: usize| match (free[end], after.links[end]) {
        (false, _) => 0.0,
        (true, 0.0) => over(before.links[end], after.through),
        (true, link) => over(before.links[end], link),
    };
    through.max(along(0)).max(along(1)).max(1.0)
}
