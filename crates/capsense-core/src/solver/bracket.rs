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

impl EdgeFields {
    /// Whether a link is left. Number by number, as arrays are compared by a loop.
    #[inline]
    fn is_linked(&self) -> bool {
        self.links[0] != 0.0 || self.links[1] != 0.0
    }
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
        let of_columns = self.energies.chunks_exact_mut(self.columns.max(1)).zip(before.iter().zip(after));
        for (energies, own) in of_columns {
            let [had, has] = [own.0, own.1].map(Flow::of);
            for (energy, (before, after)) in energies.iter_mut().zip(before.iter().zip(after)) {
                *energy += weight * (has.energy_with(after) - had.energy_with(before));
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

/// What one column drives through an edge and along its links, for a weight of one: the same beside all other columns.
struct Flow {
    through: f64,
    along: [f64; 2],
}

impl Flow {
    #[inline]
    fn of(s: &EdgeFields) -> Self {
        let along = |end: usize| s.links[end] * (s.ends[end] - s.objects[end]);
        Self { through: s.through * (s.ends[0] - s.ends[1]), along: [along(0), along(1)] }
    }

    /// The energy of that in the field of another column.
    #[inline]
    fn energy_with(&self, t: &EdgeFields) -> f64 {
        let along = |end: usize| self.along[end] * (t.ends[end] - t.objects[end]);
        self.through * (t.ends[0] - t.ends[1]) + along(0) + along(1)
    }
}

/// Σ (i - w Δφ)²/w with the old currents led along the new coupling; `None` when there is no way for them.
fn gap(before: &EdgeFields, after: &EdgeFields, free: [bool; 2]) -> Option<f64> {
    /// Currents that cancel to this part of them cancel.
    const ROUNDING: f64 = 1e-10;
    // Beside edges of conductors links may be negative; no current takes such a way by itself.
    let has_negative = |edge: &EdgeFields| edge.links[0] < 0.0 || edge.links[1] < 0.0;
    if has_negative(before) || has_negative(after) {
        return None;
    }
    let (old, new) = (currents(before), currents(after));
    let excess: [f64; 2] = std::array::from_fn(|end| if free[end] { old[end] - new[end] } else { 0.0 });
    let over = |current: f64, weight: f64| match weight {
        _ if current == 0.0 => Some(0.0),
        weight if weight > 0.0 => Some(current * current / weight),
        _ => None,
    };
    if is_mixed(after) && free[0] && free[1] {
        let [[a, b], [l, m]] = [excess, after.links];
        let resisted = after.through * (a + b).powi(2) + m * a * a + l * b * b;
        return Some(resisted / (l * m + after.through * (l + m)));
    }
    if after.is_linked() || after.through == 0.0 {
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
    edge.through > 0.0 && edge.is_linked()
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// An edge between two nodes, each of which may be linked to an object; column s has object s at 1 V.
    #[derive(Clone, Copy, Debug)]
    struct Edge {
        nodes: [usize; 2],
        weight: f64,
        through: f64,
        links: [f64; 2],
        objects: [usize; 2],
    }

    impl Edge {
        fn fields(&self, potentials: &[f64], column: usize) -> EdgeFields {
            let objects = self.objects.map(|object| if object == column { 1.0 } else { 0.0 });
            let ends = self.nodes.map(|node| potentials[node]);
            EdgeFields { through: self.through, links: self.links, ends, objects }
        }
    }

    const COLUMNS: usize = 2;
    const NODES: usize = 4;
    /// The last node is held.
    const HELD: usize = NODES - 1;

    type Fields = [[f64; NODES]; COLUMNS];

    /// XᵀKX.
    fn energies(edges: &[Edge], x: &Fields) -> Vec<f64> {
        let pairs = (0..COLUMNS).flat_map(|s| (0..COLUMNS).map(move |t| (s, t)));
        let of_pair = |(s, t): (usize, usize)| {
            let of_edge =
                |e: &Edge| e.weight * Flow::of(&e.fields(&x[s], s)).energy_with(&e.fields(&x[t], t));
            edges.iter().map(of_edge).sum()
        };
        pairs.map(of_pair).collect()
    }

    /// Gauss and Seidel's iteration, to rounding: every free node is linked to something.
    fn solution(edges: &[Edge]) -> Fields {
        let mut x = [[0.25; NODES]; COLUMNS];
        for (column, x) in x.iter_mut().enumerate() {
            for node in (0..3000).flat_map(|_| 0..HELD) {
                let (mut sum, mut weights) = (0.0, 0.0);
                for edge in edges {
                    let fields = edge.fields(x, column);
                    for end in (0..2).filter(|&end| edge.nodes[end] == node) {
                        sum += edge.weight * fields.through * fields.ends[1 - end];
                        sum += edge.weight * fields.links[end] * fields.objects[end];
                        weights += edge.weight * (fields.through + fields.links[end]);
                    }
                }
                x[node] = sum / weights;
            }
        }
        x
    }

    /// Leads a bracket from fields over the changes of all edges.
    fn bracket_over(before: &[Edge], after: &[Edge], x: &Fields) -> Bracket {
        let exact = energies(before, &solution(before));
        let known = energies(before, x);
        let mut bracket = Bracket::new(COLUMNS);
        let own = |column: usize| column * COLUMNS + column;
        let errors = (0..COLUMNS).map(|c| (known[own(c)] - exact[own(c)]).max(0.0) / known[own(c)]);
        bracket.reset(&known, &[0.0; COLUMNS * COLUMNS], errors);
        bracket.start_changes();
        for (before, after) in before.iter().zip(after) {
            let fields = |edge: &Edge| -> Vec<_> { (0..COLUMNS).map(|c| edge.fields(&x[c], c)).collect() };
            let free = before.nodes.map(|node| node != HELD);
            bracket.change(before.weight, &fields(before), &fields(after), free);
        }
        bracket.finish_changes();
        bracket
    }

    /// Edges between all nodes and a weak link of each to object 0, which stays.
    fn network(couplings: &[(f64, [f64; 2])]) -> Vec<Edge> {
        let pairs = (0..NODES).flat_map(|a| (a + 1..NODES).map(move |b| [a, b]));
        let changing = pairs.zip(couplings).enumerate().map(|(k, (nodes, &(through, links)))| Edge {
            nodes,
            weight: 1.0 + 0.3 * k as f64,
            through,
            links,
            objects: [k % 2, (k / 2) % 2],
        });
        let weak =
            |a| Edge { nodes: [a, HELD], weight: 0.1, through: 0.0, links: [1.0, 0.0], objects: [0; 2] };
        changing.chain((0..HELD).map(weak)).collect()
    }

    /// Either link, or both, beside what passes through.
    fn mixed() -> impl Strategy<Value = (f64, [f64; 2])> {
        let some = || 0.02..2.0;
        let links =
            prop_oneof![[some(), some()], (some()).prop_map(|l| [l, 0.0]), some().prop_map(|m| [0.0, m])];
        (some(), links)
    }

    fn any_coupling() -> impl Strategy<Value = (f64, [f64; 2])> {
        prop_oneof![mixed(), Just((1.0, [0.0; 2])), (0.0..1.0, 0.0..1.0).prop_map(|(l, m)| (0.0, [l, m]))]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Of solutions and of fields with errors, to edges of which conductors take a part.
        #[test]
        fn energies_lie_between_the_bounds(
            before in prop::collection::vec(any_coupling(), 6),
            after in prop::collection::vec(mixed(), 6),
            errors in prop::array::uniform3(-0.2..0.2),
            is_solved in any::<bool>(),
        ) {
            // Where only one end is free, currents are led along its link, so that there must be one.
            let with_link = |(k, (through, links)): (usize, &(f64, [f64; 2]))| match k {
                2 | 4 | 5 => (*through, [links[0].max(0.1), links[1]]),
                _ => (*through, *links),
            };
            let after: Vec<_> = after.iter().enumerate().map(with_link).collect();
            let [before, after] = [network(&before), network(&after)];
            let mut x = solution(&before);
            for column in x.iter_mut().filter(|_| !is_solved) {
                column.iter_mut().zip(errors).for_each(|(potential, error)| *potential += error);
            }
            let bracket = bracket_over(&before, &after, &x);
            prop_assert!(!bracket.is_lost);
            for (kept, anew) in bracket.energies.iter().zip(energies(&after, &x)) {
                prop_assert!((kept - anew).abs() < 1e-12, "{kept} {anew}");
            }
            let exact = energies(&after, &solution(&after));
            for column in 0..COLUMNS {
                let own = column * COLUMNS + column;
                let (above, gap) = (bracket.energies[own], bracket.gap[column]);
                prop_assert!(exact[own] <= above + 1e-12 && above - gap <= exact[own] + 1e-12, "{} in {above} - {gap}", exact[own]);
            }
        }
    }

    /// Two nodes that nothing else holds: there is only one way for the currents, and the lower bound is the energy.
    #[test]
    fn the_gap_of_an_edge_alone_is_exact() {
        let edge = |through, links| Edge { nodes: [0, 1], weight: 1.5, through, links, objects: [0, 1] };
        let before = edge(1.0, [0.4, 0.3]);
        for (through, links) in [(0.2, [0.5, 0.7]), (1.0, [0.1, 2.0]), (3.0, [0.0, 0.6]), (0.4, [0.9, 0.0])] {
            // Two more nodes beside, which nothing changes.
            let rest = Edge { nodes: [2, HELD], weight: 1.0, through: 1.0, links: [0.0; 2], objects: [0; 2] };
            let [before, after] = [before, edge(through, links)].map(|edge| [edge, rest]);
            let bracket = bracket_over(&before, &after, &solution(&before));
            let exact = energies(&after, &solution(&after));
            for column in 0..COLUMNS {
                let own = column * COLUMNS + column;
                let below = bracket.energies[own] - bracket.gap[column];
                assert!((below - exact[own]).abs() < 1e-9, "{through} {links:?}: {below} {}", exact[own]);
            }
        }
    }

    /// Errors weigh more where couplings weaken, by the factor of the mode of which that holds most.
    #[test]
    fn weakening_is_at_least_that_of_every_field() {
        let of = |through: f64, links| EdgeFields { through, links, ends: [0.0; 2], objects: [0.0; 2] };
        let before = of(1.0, [0.5, 2.0]);
        for after in [of(0.01, [0.5, 2.0]), of(1.0, [0.005, 0.02]), of(0.3, [0.0, 0.7]), of(2.0, [1.0, 4.0])]
        {
            let factor = weakening(&before, &after, [true; 2]);
            let worst = (0..200).map(|k| {
                let (b, a) = (f64::from(k) * std::f64::consts::PI / 200.0).sin_cos();
                // The currents of the old coupling, led along the new one: their energy against what they had.
                let (from, to) = (EdgeFields { ends: [a, b], ..before }, after);
                let led = gap(&from, &to, [true; 2]).unwrap_or(f64::NAN);
                let [i, j] = currents(&from);
                led / (i * a + j * b)
            });
            let worst = worst.fold(1.0, f64::max);
            assert!((worst..=2.0 * worst).contains(&factor), "{after:?}: {factor} {worst}");
        }
    }

    #[test]
    fn no_current_takes_a_negative_link() {
        let edge =
            |link| EdgeFields { through: 1.0, links: [link, 0.0], ends: [0.4, 0.5], objects: [0.0; 2] };
        assert!(gap(&edge(0.1), &edge(0.2), [true; 2]).is_some());
        for (before, after) in [(-0.1, 0.1), (0.1, -0.1)] {
            assert!(gap(&edge(before), &edge(after), [true; 2]).is_none());
        }
    }
}
