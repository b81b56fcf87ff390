//! The links of nodes near conductors, several found at a time.

use super::super::coupling::SMALLEST_PART;
use super::AtWedge;
use super::field::{POINTS, Places};

/// A node near an edge of a conductor, or before a round one, and what its link follows from.
#[derive(Clone, Debug)]
pub(super) struct Unlinked {
    pub(super) node: usize,
    /// Which of its edges exist.
    pub(super) sides: u8,
    pub(super) at: AtWedge,
    pub(super) share: f64,
    /// How much of a negative link is left: the less, the narrower the conductor is than edges are long.
    pub(super) of_negative: f64,
    /// Of the edge that carries the link, the length and the area of the dual face.
    pub(super) length: f64,
    pub(super) area: f64,
    pub(super) places: Places,
    /// Of the edges to the neighbours that are seen: the area of the dual face over the distance.
    pub(super) weights: [f64; POINTS],
    /// Of the edge; or, before a round surface, the potentials themselves.
    pub(super) radius: f64,
    pub(super) potentials: Option<[f64; POINTS]>,
}

impl Unlinked {
    /// Of no node yet. The last of its points never is anything's neighbour.
    pub(super) const NONE: Self = Self {
        node: 0,
        sides: 0,
        at: AtWedge::NONE,
        share: 0.0,
        of_negative: 0.0,
        length: 1.0,
        area: 1.0,
        places: Places::ORIGIN,
        weights: [0.0; POINTS],
        radius: f64::INFINITY,
        potentials: None,
    };
}

/// Nodes whose links are found with the widest instructions of this machine; none of them fuses or reorders operations, so
/// that links are the same on every machine. A closure in its place is not compiled for them.
pub(super) struct FindLinks<'a>(pub(super) &'a mut [Unlinked]);

impl pulp::NullaryFnOnce for FindLinks<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for unlinked in self.0 {
            unlinked.link();
        }
    }
}

impl Unlinked {
    /// Finds the link: Σ w (u(Q) - u(P)) / u(P), w being areas over distances.
    #[inline(always)]
    fn link(&mut self) {
        let potentials = self.potentials.unwrap_or_else(|| self.places.potentials(self.radius));
        let (mut sum, mut of_weights, mut highest) = (0.0, 0.0, potentials[0]);
        for (weight, potential) in self.weights.into_iter().zip(potentials) {
            sum += weight * potential;
            of_weights += weight;
            highest = f64::max(highest, potential);
        }
        self.at.potential = potentials[0].max(SMALLEST_PART * highest).max(f64::MIN_POSITIVE);
        let link = sum / self.at.potential - of_weights;
        let link = if link < 0.0 { self.of_negative * link } else { link };
        self.at.link = self.share * link * self.length / self.area;
    }
}
