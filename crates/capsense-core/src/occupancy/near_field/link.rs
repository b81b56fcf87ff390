//! The links of nodes near conductors, several found at a time.

use super::super::coupling::SMALLEST_PART;
use super::field::{around_rim, wedge_potentials};
use super::row::larger;
use super::{AtWedge, RightAngle, smooth};
use crate::instructions::widest;
use glam::DVec3;

/// Links of so many nodes are found together.
pub(super) const TOGETHER: usize = 16;

/// Neighbours of a node: along each axis that below, then that above.
pub(super) const NEIGHBOURS: usize = 6;

/// The same number of each of the nodes.
type Nodes = [f64; TOGETHER];

/// A node near an edge of a conductor, or before a round one, but for what its neighbours are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unlinked {
    pub(super) node: usize,
    /// Which of its edges exist.
    pub(super) sides: u8,
    pub(super) at: AtWedge,
    pub(super) share: f64,
    /// How much of a negative link is left: the less, the narrower the conductor is than edges are long.
    pub(super) of_negative: f64,
    /// Of the edge that carries the link, the length over the area of the dual face.
    pub(super) carrier: f64,
    /// The link that what is round makes, as [`AtWedge::link`].
    pub(super) besides: f64,
}

/// Nodes near edges of conductors whose links are to be found, one array for each number.
#[derive(Clone, Debug)]
pub(super) struct LinkBatch {
    count: usize,
    unlinked: [Unlinked; TOGETHER],
    /// How far each node is before either face.
    own: [Nodes; 2],
    /// How much further behind the node either face seems a cell from it, and one over the size of a cell.
    inwards: [Nodes; 2],
    per_size: [Nodes; 2],
    /// By how much both grow along each axis of the sensor frame.
    slopes: [[Nodes; 3]; 2],
    /// By how much the way along the edge does; of any numbers for straight edges.
    along: [Nodes; 3],
    /// One over the radius of the edge, and whether that is anything but zero for any of them.
    curvature: Nodes,
    is_round: bool,
    /// What the potentials of neighbours are multiplied with, and of the node itself, if an edge is round.
    factors: [Nodes; NEIGHBOURS],
    own_factor: Nodes,
    of_negative: Nodes,
    /// The way to each neighbour.
    steps: [Nodes; NEIGHBOURS],
    /// Of the edges to neighbours that the conductor does not hold, the area of the dual face over the length.
    weights: [Nodes; NEIGHBOURS],
    /// How far neighbours are before either face.
    before: [[Nodes; 2]; NEIGHBOURS],
    /// How many neighbours of each node no face tells to be seen.
    doubtful: Nodes,
}

/// What the field of a conductor's edge makes of nodes, for each of them.
#[derive(Clone, Copy, Debug)]
struct Links<const N: usize> {
    potential: [f64; N],
    /// Σ w (u(Q) - u(P)) / u(P), w being areas over distances.
    weight: [f64; N],
}

impl<const N: usize> Links<N> {
    /// From the potentials of nodes, and the weights of their edges to neighbours with the potentials of these.
    #[inline(always)]
    fn of(
        own: &[f64; N],
        weights: &Neighbours<N>,
        potentials: &Neighbours<N>,
        of_negative: &[f64; N],
    ) -> Self {
        let (mut sum, mut of_weights, mut highest) = ([0.0; N], [0.0; N], *own);
        for (weights, potentials) in weights.iter().zip(potentials) {
            for at in 0..N {
                sum[at] += weights[at] * potentials[at];
                of_weights[at] += weights[at];
                highest[at] = larger(highest[at], potentials[at]);
            }
        }
        let mut links = Self { potential: [0.0; N], weight: [0.0; N] };
        for at in 0..N {
            let potential = larger(larger(own[at], SMALLEST_PART * highest[at]), f64::MIN_POSITIVE);
            let weight = sum[at] / potential - of_weights[at];
            links.potential[at] = potential;
            links.weight[at] = if weight < 0.0 { of_negative[at] * weight } else { weight };
        }
        links
    }
}

/// A number of each neighbour of each node.
pub(super) type Neighbours<const N: usize> = [[f64; N]; NEIGHBOURS];

impl Unlinked {
    const NONE: Self = Self {
        node: 0,
        sides: 0,
        at: AtWedge::NONE,
        share: 0.0,
        of_negative: 0.0,
        carrier: 0.0,
        besides: 0.0,
    };

    /// What the node makes of the conductor, its potentials and those of its neighbours, with their weights, being known.
    pub(super) fn linked(&self, own: f64, weights: &Neighbours<1>, potentials: &Neighbours<1>) -> AtWedge {
        let Links { potential: [potential], weight: [weight] } =
            Links::of(&[own], weights, potentials, &[self.of_negative]);
        self.linked_by(potential, weight)
    }

    fn linked_by(&self, potential: f64, weight: f64) -> AtWedge {
        let of_edge = f64::from(self.at.of_edge) * self.share * weight * self.carrier;
        AtWedge { potential, link: of_edge + self.besides, ..self.at }
    }
}

impl LinkBatch {
    pub(super) const EMPTY: Self = Self {
        count: 0,
        unlinked: [Unlinked::NONE; TOGETHER],
        own: [[0.0; TOGETHER]; 2],
        inwards: [[0.0; TOGETHER]; 2],
        per_size: [[0.0; TOGETHER]; 2],
        slopes: [[[0.0; TOGETHER]; 3]; 2],
        along: [[0.0; TOGETHER]; 3],
        curvature: [0.0; TOGETHER],
        is_round: false,
        factors: [[1.0; TOGETHER]; NEIGHBOURS],
        own_factor: [1.0; TOGETHER],
        of_negative: [0.0; TOGETHER],
        steps: [[0.0; TOGETHER]; NEIGHBOURS],
        weights: [[0.0; TOGETHER]; NEIGHBOURS],
        before: [[[0.0; TOGETHER]; 2]; NEIGHBOURS],
        doubtful: [0.0; TOGETHER],
    };

    pub(super) fn is_full(&self) -> bool {
        self.count == TOGETHER
    }

    /// Takes a node near a straight edge, so far before either face, and what [`Look::neighbours`] tells.
    ///
    /// [`Look::neighbours`]: super::look::Look::neighbours
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        unlinked: Unlinked,
        before: [f64; 2],
        normals: &[DVec3; 2],
        [steps, weights]: [[f64; NEIGHBOURS]; 2],
    ) {
        let at = self.count;
        self.count += 1;
        self.unlinked[at] = unlinked;
        for (face, before) in before.into_iter().enumerate() {
            (self.own[face][at], self.inwards[face][at], self.per_size[face][at]) = (before, 0.0, 0.0);
        }
        for (slopes, normal) in self.slopes.iter_mut().zip(normals) {
            slopes.iter_mut().zip(normal.to_array()).for_each(|(slope, along)| slope[at] = along);
        }
        self.curvature[at] = 0.0;
        self.of_negative[at] = unlinked.of_negative;
        for number in 0..NEIGHBOURS {
            (self.steps[number][at], self.weights[number][at]) = (steps[number], weights[number]);
        }
    }

    /// Lets faces of the node that was taken last seem further in, a cell from them, where cells have such sizes.
    #[inline(always)]
    pub(super) fn move_last(&mut self, inwards: [f64; 2], sizes: [f64; 2]) {
        let Some(at) = self.count.checked_sub(1) else { return };
        for face in 0..2 {
            (self.inwards[face][at], self.per_size[face][at]) = (inwards[face], 1.0 / sizes[face]);
        }
    }

    /// Makes the edge of the node that was taken last as round as it is.
    pub(super) fn bend_last(&mut self, angle: &RightAngle) {
        let Some(at) = self.count.checked_sub(1) else { return };
        self.curvature[at] = angle.radius.recip();
        self.is_round = true;
        self.along.iter_mut().zip(angle.along().to_array()).for_each(|(slope, along)| slope[at] = along);
    }

    /// Finds the links of all nodes and visits each with what it makes of the conductor; none is left. `is_hidden` tells of a
    /// neighbour of a node whether the conductor is between both.
    pub(super) fn drain(
        &mut self,
        is_hidden: impl Fn(&Unlinked, usize) -> bool,
        mut visit: impl FnMut(&Unlinked, AtWedge),
    ) {
        let arch = widest();
        arch.dispatch(PlaceNeighbours(self));
        let count = std::mem::take(&mut self.count);
        if self.is_round {
            arch.dispatch(Bend(self));
        }
        for at in (0..count).filter(|&at| self.doubtful[at] != 0.0) {
            for number in 0..NEIGHBOURS {
                if self.weights[number][at] != 0.0
                    && !self.is_seen(number, at)
                    && is_hidden(&self.unlinked[at], number)
                {
                    self.weights[number][at] = 0.0;
                }
            }
        }
        let links = arch.dispatch(FindLinks(self));
        self.is_round = false;
        for at in 0..count {
            let unlinked = &self.unlinked[at];
            visit(unlinked, unlinked.linked_by(links.potential[at], links.weight[at]));
        }
    }

    /// How far a point seems before a face that is so far from it.
    #[inline(always)]
    fn seen(&self, face: usize, at: usize, before: f64) -> f64 {
        before + self.inwards[face][at] * smooth(super::smaller(before.abs() * self.per_size[face][at], 1.0))
    }

    /// Whether no straight way from a node to a neighbour passes the object: a face is behind both of them.
    #[inline(always)]
    fn is_seen(&self, number: usize, at: usize) -> bool {
        let is_before = |face: usize| {
            let step = self.steps[number][at] * self.slopes[face][number / 2][at];
            (self.own[face][at] >= 0.0) & (self.own[face][at] + step >= 0.0)
        };
        is_before(0) | is_before(1)
    }
}

/// Finds where neighbours are, with the widest instructions of this machine; none of them fuses or reorders operations, so
/// that links are the same on every machine. A closure in its place is not compiled for them.
struct PlaceNeighbours<'a>(&'a mut LinkBatch);

impl pulp::NullaryFnOnce for PlaceNeighbours<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let batch = self.0;
        batch.doubtful = [0.0; TOGETHER];
        for number in 0..NEIGHBOURS {
            for at in 0..TOGETHER {
                let step = batch.steps[number][at];
                let [p, q] = [0, 1].map(|face: usize| step * batch.slopes[face][number / 2][at]);
                let is_plain = batch.is_seen(number, at) | (batch.weights[number][at] == 0.0);
                batch.doubtful[at] += if is_plain { 0.0 } else { 1.0 };
                batch.before[number][0][at] = batch.seen(0, at, batch.own[0][at] + p);
                batch.before[number][1][at] = batch.seen(1, at, batch.own[1][at] + q);
            }
        }
    }
}

/// Makes round edges bend away from their tangents, in the same way.
struct Bend<'a>(&'a mut LinkBatch);

impl pulp::NullaryFnOnce for Bend<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let batch = self.0;
        for at in 0..TOGETHER {
            [_, batch.own_factor[at]] = around_rim(batch.curvature[at], batch.own[0][at], 0.0);
        }
        for number in 0..NEIGHBOURS {
            for at in 0..TOGETHER {
                let along = batch.steps[number][at] * batch.along[number / 2][at];
                let before = &mut batch.before[number][0][at];
                [*before, batch.factors[number][at]] = around_rim(batch.curvature[at], *before, along);
            }
        }
    }
}

/// Finds the potentials of nodes and what their links weigh in the same way.
struct FindLinks<'a>(&'a LinkBatch);

impl pulp::NullaryFnOnce for FindLinks<'_> {
    type Output = Links<TOGETHER>;

    #[inline(always)]
    fn call(self) -> Links<TOGETHER> {
        let batch = self.0;
        let mut own_places = batch.own;
        for (face, places) in own_places.iter_mut().enumerate() {
            for (at, place) in places.iter_mut().enumerate() {
                *place = batch.seen(face, at, *place);
            }
        }
        let mut own = wedge_potentials(&own_places[0], &own_places[1]);
        let mut of_neighbours = [[0.0; TOGETHER]; NEIGHBOURS];
        for (potentials, [p, q]) in of_neighbours.iter_mut().zip(&batch.before) {
            *potentials = wedge_potentials(p, q);
        }
        if batch.is_round {
            multiply(&mut own, &batch.own_factor);
            of_neighbours.iter_mut().zip(&batch.factors).for_each(|(of, factors)| multiply(of, factors));
        }
        Links::of(&own, &batch.weights, &of_neighbours, &batch.of_negative)
    }
}

#[inline(always)]
fn multiply(numbers: &mut Nodes, factors: &Nodes) {
    for at in 0..TOGETHER {
        numbers[at] *= factors[at];
    }
}
