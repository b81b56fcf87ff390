//! What edges that end in conductors make of a node.

use super::super::NO_OBJECT;

/// An edge is cut well where at least this part of it is inside of the conductor.
const WELL_CUT: f64 = 0.5;

/// What a round conductor that cells resolve adds to the links of nodes of which no edge is cut counts less by so much.
const LESS_BEYOND: f64 = 0.5;

/// The edges of a node that end in conductors.
pub(super) struct Ending {
    /// The conductor that the node is linked to most, and by how much; [`NO_OBJECT`] if there is none.
    pub(super) object: u16,
    pub(super) most: f64,
    /// Sum of the weights with which edges end there, and with which they would if weights of any sign were cut.
    pub(super) now: f64,
    pub(super) cut: f64,
    /// How well the one is cut of which the most is inside: from 0, as where none is, to 1.
    well_cut: f64,
    /// Whether they end in different conductors.
    pub(super) are_several: bool,
    /// Whether the permittivity is not the same all around the node.
    pub(super) is_mixed: bool,
}

impl Ending {
    pub(super) const NONE: Self = Self {
        object: NO_OBJECT,
        most: 0.0,
        now: 0.0,
        cut: 0.0,
        well_cut: 0.0,
        are_several: false,
        is_mixed: false,
    };

    /// Notes which part of an edge is inside of a conductor.
    pub(super) fn note_inside(&mut self, part: f64) {
        self.well_cut = self.well_cut.max((part / WELL_CUT).clamp(0.0, 1.0));
    }

    /// What counts of what a conductor's field adds to the node's links, if such a part of it is of a round conductor which cells
    /// resolve.
    ///
    /// K stays positive definite for certain if nothing is taken away from nodes of which no edge ends in the conductor. So that
    /// nothing jumps as the first one does, what is taken away grows with how well edges are cut. As it is missing until then, half
    /// of what round conductors add is left out, too, or they would be too large; where cells do not resolve them, that is all that
    /// tells of them.
    pub(super) fn kept(&self, added: f64, of_resolved: f64) -> f64 {
        match added < 0.0 {
            true => self.well_cut * added,
            false => (1.0 - LESS_BEYOND * of_resolved * (1.0 - self.well_cut)) * added,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a node of which no edge ends in a conductor nothing is taken away; where an edge is cut well, all counts.
    #[test]
    fn links_grow_with_how_well_edges_are_cut() {
        let kept = |inside: &[f64], added| {
            let mut ending = Ending::NONE;
            inside.iter().for_each(|part| ending.note_inside(*part));
            [0.0, 1.0].map(|of_resolved| ending.kept(added, of_resolved))
        };
        assert_eq!(kept(&[], -2.0), [0.0, 0.0]);
        assert_eq!(kept(&[-f64::INFINITY, -0.1], -2.0), [0.0, 0.0]);
        assert_eq!(kept(&[], 2.0), [2.0, 1.0]);
        assert_eq!(kept(&[0.25, 0.1], -2.0), [-1.0, -1.0]);
        assert_eq!(kept(&[0.25], 2.0), [2.0, 1.5]);
        for added in [-2.0, 2.0] {
            assert_eq!(kept(&[0.1, 0.7], added), [added, added]);
        }
    }
}
