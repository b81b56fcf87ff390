//! Solids that are cut out of space by half-spaces, of which any line is cut exactly.

use capsense_core::geometry::Aabb;
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::occupancy::{Span, Surfaces};

/// Solids that are cut out of space by half-spaces: inside is where every normal·x is below its offset.
#[derive(Clone)]
pub struct Convex(pub Vec<Vec<(DVec3, f64)>>);

impl Convex {
    pub fn boxes(boxes: &[Aabb]) -> Self {
        let faces = |b: &Aabb| {
            [DVec3::X, DVec3::Y, DVec3::Z]
                .into_iter()
                .flat_map(|n| [(n, n.dot(b.max)), (-n, -n.dot(b.min))])
                .collect()
        };
        Self(boxes.iter().map(faces).collect())
    }

    /// A box around the origin, turned and moved.
    pub fn turned(half: DVec3, axis: DVec3, angle: f64, centre: DVec3) -> Self {
        let turn = DQuat::from_axis_angle(axis.normalize(), angle);
        let faces = [(DVec3::X, half.x), (DVec3::Y, half.y), (DVec3::Z, half.z)];
        let faces = faces
            .into_iter()
            .flat_map(|(n, h)| [turn * n, -(turn * n)].into_iter().map(move |n| (n, h + n.dot(centre))));
        Self(vec![faces.collect()])
    }

    pub fn joined(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }
}

impl Surfaces for Convex {
    fn objects(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, _: usize) -> Aabb {
        Aabb { min: DVec3::splat(-9.0), max: DVec3::splat(9.0) }
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        self.0[object].iter().all(|(normal, offset)| normal.dot(point) < *offset)
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        let (mut enter, mut exit) = (0.0, 1.0);
        for (normal, offset) in &self.0[object] {
            let (from, to) = (normal.dot(a) - offset, normal.dot(b) - offset);
            match (from < 0.0, to < 0.0) {
                (true, true) => {}
                (false, false) => return None,
                (true, false) => exit = f64::min(exit, from / (from - to)),
                (false, true) => enter = f64::max(enter, from / (from - to)),
            }
        }
        (enter < exit).then_some(Span { enter, exit })
    }
}
