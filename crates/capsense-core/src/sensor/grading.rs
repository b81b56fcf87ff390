//! How far lattice planes should be from each other: close at electrodes, and no farther where bodies move than these need.
//!
//! What a lattice gets wrong is what its electrodes make wrong of C, and what it makes wrong of the bodies. Both are little
//! only where spacing grows slowly from the electrodes up, through the room in which bodies move, the workspace, and faster
//! elsewhere.

use crate::geometry::Aabb;
use crate::mesh::Along;
use glam::DVec2;

/// Growth towards walls that are far, in parts of that beyond the workspace, to which it adds.
const FAR: f64 = 2.0;

/// What a lattice should know of the electrodes, besides where its planes must be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pattern {
    /// How long the rims of all electrodes are along x and y, in metres.
    pub(super) rims: DVec2,
    /// How far electrode edges that follow each other along x or y are apart, the median, in metres.
    pub(super) feature: f64,
}

/// How a lattice differs from what is best for most sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Variation {
    /// By which factor layers are higher.
    pub(super) height: f64,
    /// By which factor cells are longer along x, and shorter along y.
    pub(super) aspect: f64,
    /// By which factor cells at an electrode's edge may be larger than the room to the next plane.
    pub(super) crowding: f64,
    /// Within which distance edges of different electrodes share a plane between them, in metres.
    pub(super) sharing: f64,
}

impl Variation {
    pub(super) const USUAL: Self = Self { height: 1.0, aspect: 1.0, crowding: f64::INFINITY, sharing: 0.0 };
}

/// Spacing along the three axes, in metres, as a function of the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grading {
    /// At electrode edges, along x and y.
    finest: [f64; 2],
    /// At electrode planes.
    across: f64,
    /// Growth, in metres per metre, between electrode edges, beside electrodes, below them, above them, and beyond the workspace.
    between: f64,
    beside: f64,
    below: f64,
    above: f64,
    beyond: f64,
    /// What spacing above electrodes does not exceed in the workspace, in parts of its height.
    ceiling: f64,
    /// By which factor cells on both sides of an electrode's edge may differ: rims want them alike.
    unequal: f64,
    variation: Variation,
}

impl Grading {
    /// The same growth everywhere: by a factor of `1 + growth` from cell to cell.
    pub(super) fn even(finest: f64, growth: f64) -> Self {
        Self {
            finest: [finest; 2],
            across: finest,
            between: growth,
            beside: growth,
            below: growth,
            above: growth,
            beyond: 0.0,
            ceiling: f64::INFINITY,
            unequal: f64::INFINITY,
            variation: Variation::USUAL,
        }
    }

    /// What leaves the least errors with so many tetrahedra, of changes of C by grounded and floating bodies all over the
    /// workspace: for three stripes in a cube at 10,000 to 300,000, in scans that are not kept. Across the longer rims it pays
    /// to be finer.
    pub(super) fn for_workspace(finest: f64, variation: Variation, tets: usize, pattern: Pattern) -> Self {
        let Variation { height, aspect, .. } = variation;
        let Pattern { rims: along, feature } = pattern;
        let fewer = 30_000.0 / tets as f64;
        let part = fewer.powf(0.25).min(1.3);
        let unequal = (along.x / along.y).powf(0.09).clamp(0.75, 1.33);
        Self {
            finest: [finest * unequal * aspect, finest / (unequal * aspect)],
            across: 0.56 * height * finest.min(feature) * part.max(1.0).powi(2),
            between: 0.27 * part,
            beside: 0.6 * fewer.cbrt().min(1.3),
            below: 0.4 * height * part,
            above: 0.21 * height * fewer.powf(0.2),
            beyond: 0.15,
            ceiling: 0.165 * height * fewer.powf(0.3),
            unequal: 1.4 * part.max(1.0).powi(2),
            variation,
        }
    }

    /// By which factor cells on both sides of a fixed place may differ in size. Boards are thin, so it is any at their faces.
    pub(super) fn unequal(&self, axis: usize) -> f64 {
        if axis < 2 { self.unequal } else { f64::INFINITY }
    }

    /// Spacing at electrode edges along x (0) or y (1), in metres.
    pub(super) fn finest(&self, axis: usize) -> f64 {
        self.finest[axis]
    }

    /// Within which distance edges of different electrodes share a plane, in metres.
    pub(super) fn sharing(&self) -> f64 {
        self.variation.sharing
    }

    /// What spacing is larger by so far outside of the domain that it is chosen for, in metres.
    pub(super) fn far(&self, outside: f64) -> f64 {
        FAR * self.beyond * outside
    }

    /// Spacing along one axis of a domain at a place among fixed coordinates, of which the first and the last are given; all in
    /// metres.
    pub(super) fn spacing(
        &self,
        axis: usize,
        domain: &Aabb,
        [first, last]: [f64; 2],
        Along { coordinate: place, distance, room }: Along,
    ) -> f64 {
        // The workspace ends half way to the walls.
        let outside =
            distance - 0.5 * if place < first { first - domain.min[axis] } else { domain.max[axis] - last };
        let beyond = self.beyond * outside.max(0.0);
        let crowded = self.variation.crowding * room;
        let least = if axis == 2 { self.across } else { self.finest[axis].min(crowded) };
        if (first..=last).contains(&place) {
            least + self.between * distance
        } else if axis < 2 {
            least + self.beside * distance + beyond
        } else if place < first {
            least + self.below * distance
        } else {
            let ceiling = self.ceiling * 0.5 * (domain.max.z - last);
            (least + self.above * distance).min(ceiling) + beyond
        }
    }
}
