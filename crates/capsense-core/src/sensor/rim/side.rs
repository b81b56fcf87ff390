//! The sides of a sheet's rim, and what lies near them.

use crate::mesh::TetMesh;
use crate::sensor::Terminal;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Rims that turn by an angle of a smaller cosine between two sides have a corner.
const STRAIGHT: f64 = 0.88;

/// Distances differ by less than this part of a side where they are the same but for rounding.
const SAME: f64 = 1e-9;

/// A side of a rim, between two nodes, and the third node of its triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) terminal: Terminal,
    pub(super) ends: [u32; 2],
    pub(super) apex: u32,
}

impl Side {
    fn points(&self, mesh: &TetMesh) -> [DVec3; 2] {
        self.ends.map(|node| mesh.nodes()[node as usize])
    }

    pub(super) fn length(&self, mesh: &TetMesh) -> f64 {
        let [a, b] = self.points(mesh);
        a.distance(b)
    }

    /// Distance of a point from the side, metres.
    pub(super) fn distance(&self, mesh: &TetMesh, point: DVec3) -> f64 {
        let [a, b] = self.points(mesh);
        let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        point.distance(a.lerp(b, along))
    }
}

/// The side nearest to a point. Of two that are as near, where they meet, the one whose middle comes first counts, so that it
/// does not matter how nodes are numbered.
pub(super) fn nearest(
    mesh: &TetMesh,
    sides: &[Side],
    point: DVec3,
    candidates: impl Iterator<Item = u32>,
) -> Option<u32> {
    let middle = |side: u32| {
        let [a, b] = sides[side as usize].points(mesh);
        (a + b).to_array()
    };
    candidates.reduce(|best, other| {
        let [of_best, of_other] = [best, other].map(|side| sides[side as usize].distance(mesh, point));
        let is_nearer = if (of_other - of_best).abs() <= SAME * sides[best as usize].length(mesh) {
            middle(other) < middle(best)
        } else {
            of_other < of_best
        };
        if is_nearer { other } else { best }
    })
}

/// Coordinates across the line through a side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    origin: DVec3,
    along: DVec3,
    /// Out of the sheet, in its plane.
    out: DVec3,
}

impl Frame {
    /// None where the side or its triangle is degenerate.
    pub(super) fn of(mesh: &TetMesh, side: &Side) -> Option<Self> {
        let [a, b] = side.points(mesh);
        let along = (b - a).try_normalize()?;
        let to_apex = mesh.nodes()[side.apex as usize] - a;
        let inward = (to_apex - along * to_apex.dot(along)).try_normalize()?;
        Some(Self { origin: a, along, out: -inward })
    }

    /// Around a line in a plane z = const, across which a unit vector leads out of the sheet.
    pub(super) fn across_line(origin: DVec3, out: DVec3) -> Self {
        Self { origin, along: DVec3::Z.cross(out), out }
    }

    /// From the line to a point, across it.
    pub(super) fn across(&self, point: DVec3) -> DVec3 {
        let from = point - self.origin;
        from - self.along * from.dot(self.along)
    }

    /// r: distance from the line.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        self.across(point).length()
    }

    /// √r cos θ/2: the potential near the rim of a half-plane at 0 V.
    pub(super) fn potential(&self, point: DVec3) -> f64 {
        let across = self.across(point);
        (0.5 * (across.length() + across.dot(self.out))).max(0.0).sqrt()
    }
}

/// Nodes at which a rim turns, branches or ends; at those that are mirrored, where the mesh ends, it goes on.
pub(super) fn corners(mesh: &TetMesh, sides: &[Side], mirrored: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mut directions: BTreeMap<u32, Vec<DVec3>> = BTreeMap::new();
    for side in sides {
        let [a, b] = side.points(mesh);
        let along = (b - a).normalize_or_zero();
        directions.entry(side.ends[0]).or_default().push(along);
        directions.entry(side.ends[1]).or_default().push(-along);
    }
    let turns = |node: u32, directions: &[DVec3]| match directions {
        [a, b] => -a.dot(*b) < STRAIGHT,
        [_] => !mirrored.contains(&node),
        _ => true,
    };
    directions.into_iter().filter(|(node, at)| turns(*node, at)).map(|(node, _)| node).collect()
}

/// For the nodes at most so many edges from a rim: how many, and the index of the nearest side among those of their
/// neighbours.
pub(super) fn nearest_sides(mesh: &TetMesh, sides: &[Side], rings: u8) -> Vec<Option<(u8, u32)>> {
    let mut near: Vec<Option<(u8, u32)>> = vec![None; mesh.nodes().len()];
    for (index, side) in (0..).zip(sides) {
        for node in side.ends {
            let known = near[node as usize].map(|(_, side)| side);
            let point = mesh.nodes()[node as usize];
            near[node as usize] =
                nearest(mesh, sides, point, known.into_iter().chain([index])).map(|side| (0, side));
        }
    }
    for ring in 1..=rings {
        for tet in mesh.tets().iter() {
            let before =
                tet.map(|node| near[node as usize].filter(|(at, _)| *at < ring).map(|(_, side)| side));
            for node in tet {
                let known = near[node as usize];
                if known.is_none_or(|(at, _)| at == ring) {
                    let candidates =
                        known.map(|(_, side)| side).into_iter().chain(before.into_iter().flatten());
                    let side = nearest(mesh, sides, mesh.nodes()[node as usize], candidates);
                    near[node as usize] = side.map(|side| (ring, side));
                }
            }
        }
    }
    near
}
