//! What the wall of a body leaves of an edge across a camera's rays, by how much of the edge's dual face the body fills and by the field
//! around a right angle.

use super::RAYS;
use crate::instructions::vectorised;
use crate::mesh::Lattice;
use crate::occupancy::SMALLEST_PART;
use crate::occupancy::near_field::Places;

/// How much further than it does a body is taken to reach along the rays, in parts of the longer one of the edge and of the
/// height of its dual face; no more than half of that. `tests/suite/fringe.rs` tells what it is to the field around a right angle. In the mean
/// over all places in a cell more would be right, but with more, responses to narrow bodies have more and larger kinks.
const FRINGE: f64 = 0.2;

/// No more of the other end's potential is at the end under a face.
const LARGEST_SHARE: f64 = 0.9;

/// How far the dual face of an edge reaches along the rays: half-way to the planes beside its own.
pub(super) struct DualFace {
    pub(super) plane: f64,
    pub(super) planes: [f64; 2],
    ends: [f64; 2],
}

/// How far the wall of a body is from the end of an edge outside of it, and from that behind it, in metres.
pub(super) struct Wall {
    pub(super) outside: f64,
    pub(super) behind: f64,
    /// How much of the edge it counts for.
    pub(super) abruptness: f64,
}

/// What a wall leaves of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Past {
    /// What multiplies the edge's weight.
    pub(super) through: f64,
    /// What is added, in parts of that weight, between the end under a face and the body.
    pub(super) tap: f64,
    /// How much of both counts.
    pub(super) abruptness: f64,
}

impl Wall {
    fn length(&self) -> f64 {
        self.outside + self.behind
    }
}

impl DualFace {
    /// That of edges in a plane of the lattice.
    pub(super) fn at(lattice: &Lattice, number: usize) -> Self {
        let all = &lattice.axes()[RAYS];
        let plane = all[number];
        let planes = [number.saturating_sub(1), (number + 1).min(all.len() - 1)].map(|beside| all[beside]);
        Self { plane, planes, ends: planes.map(|beside| 0.5 * (plane + beside)) }
    }

    pub(super) fn height(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// Whether some of a layer is between the planes beside.
    #[inline]
    pub(super) fn has_between_planes(&self, [front, back]: [f64; 2]) -> bool {
        (front < back) & (front < self.planes[1]) & (self.planes[0] < back)
    }

    /// What there is of such a layer between the planes beside.
    #[inline]
    pub(super) fn clipped(&self, layer: [f64; 2]) -> [f64; 2] {
        [layer[0].max(self.planes[0]), layer[1].min(self.planes[1])]
    }

    /// How far the plane is before the nearer one of two faces, or behind it; zero between them.
    pub(super) fn distance_to(&self, faces: [f64; 2]) -> f64 {
        (faces[0] - self.plane).max(self.plane - faces[1]).max(0.0)
    }

    /// Whether a body with these faces ends on both sides before the planes beside.
    pub(super) fn is_around(&self, faces: [f64; 2]) -> bool {
        faces[0] > self.planes[0] && faces[1] < self.planes[1]
    }

    /// The part of the dual face that a body with these faces is taken to fill.
    fn part_filled(&self, faces: [f64; 2], length: f64) -> f64 {
        let fringe = FRINGE * length.max(self.height());
        let low = faces[0] - fringe.min(self.plane - self.ends[0]);
        let high = faces[1] + fringe.min(self.ends[1] - self.plane);
        (high.min(self.ends[1]) - low.max(self.ends[0])).max(0.0) / self.height()
    }

    /// How far each face is before the end of the dual face on its side, and before the plane.
    fn before_ends(&self, faces: [f64; 2]) -> [[f64; 2]; 2] {
        [1.0, -1.0].map(|forwards| {
            let side = usize::from(forwards < 0.0);
            [self.ends[side], self.plane].map(|to| forwards * (faces[side] - to))
        })
    }

    /// The part of the link past a wall that is less because of the potential under the faces, and the share of the other end's potential
    /// that is at the end so far under them, both in the field around a right angle.
    fn part_and_share_under(&self, faces: [f64; 2], distance: f64, wall: &Wall) -> [f64; 2] {
        let before = self.before_ends(faces);
        if distance == 0.0 && before.iter().all(|&[depth, _]| depth <= 0.0) {
            return [0.0; 2];
        }
        let ([[depth_0, plane_0], [depth_1, plane_1]], outside, behind) =
            (before, wall.outside, -wall.behind);
        let at_end = distance.max(SMALLEST_PART * wall.length());
        // All at once: what waits for one of them waits for all. They are put together where they are used, as vectors are slow to be read
        // that were just written number by number.
        let potentials = vectorised(
            #[inline(always)]
            || {
                let across = [outside, behind, behind, outside, behind, behind, outside, behind];
                let along =
                    [plane_0, 0.5 * depth_0, plane_0, plane_1, 0.5 * depth_1, plane_1, at_end, at_end];
                Places::in_plane(across, along).potentials(f64::INFINITY)
            },
        );
        let under = |side: usize| {
            let depth = before[side][0];
            if depth <= 0.0 {
                return 0.0;
            }
            let [outside, half_way, behind] = [0, 1, 2].map(|point| potentials[3 * side + point]);
            let more = (half_way - behind).clamp(0.0, outside.max(0.0));
            depth / self.height() * more / outside.max(f64::MIN_POSITIVE)
        };
        let share = (potentials[7] / potentials[6]).clamp(SMALLEST_PART, LARGEST_SHARE);
        [under(0) + under(1), share]
    }

    /// What the wall of a body with these faces leaves of an edge. `contrast` is one for a conductor, and zero for what is as the
    /// background.
    pub(super) fn past(&self, wall: &Wall, faces: [f64; 2], contrast: f64) -> Past {
        let distance = self.distance_to(faces);
        let near = wall.behind * wall.behind / (wall.behind * wall.behind + distance * distance);
        let part = self.part_filled(faces, wall.length());
        let way = wall.outside.hypot(distance) / wall.length();
        let [under, share] = self.part_and_share_under(faces, distance, wall);
        let under = contrast * under;
        let link = (near * (part / (1.0 - contrast + contrast * way) - under)).max(0.0);
        let (through, abruptness) = (1.0 - near * part + link, wall.abruptness);
        if distance == 0.0 {
            return Past { through, tap: 0.0, abruptness };
        }
        let tap = contrast * link / share;
        Past { through: through + contrast * link * share / (1.0 - share), tap, abruptness }
    }
}
