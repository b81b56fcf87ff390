//! A plane through the mesh and the field on it.
//!
//! Potentials are those of the linear elements, exactly: the plane cuts each element into one or two triangles, and their
//! corners lie on the element's edges. The magnitude of E is constant in an element; at a node it is the mean of the
//! elements around, weighted by volume, without those that lie within a conductor.

use super::static_scene::StaticScene;
use capsense_core::mesh::{barycentric_gradients, signed_volume};
use capsense_core::occupancy::NO_OBJECT;
use glam::DVec3;

/// A plane across one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Coordinate along it, metres.
    pub position: f64,
}

/// A corner of a triangle of a slice.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Crossing {
    /// The nodes of the edge it lies on.
    ends: [u32; 2],
    /// How far it is along, in parts of the edge.
    part: f32,
}

/// Where a plane cuts a mesh: three corners for each triangle.
#[derive(Debug)]
pub(super) struct Slice {
    crossings: Vec<Crossing>,
    positions: Vec<DVec3>,
    /// Elements at one of the nodes that matter, for the magnitude of E.
    around: Vec<u32>,
}

impl Slice {
    pub(super) fn new(scene: &StaticScene, plane: Plane) -> Self {
        let above = |node: u32| scene.nodes[node as usize][plane.axis] >= plane.position;
        let mut crossings = Vec::new();
        let mut is_used = vec![false; scene.nodes.len()];
        for tet in &scene.tets {
            let count = tet.iter().filter(|&&node| above(node)).count();
            if count == 0 || count == 4 {
                continue;
            }
            tet.iter().for_each(|&node| is_used[node as usize] = true);
            let mut sorted = *tet;
            sorted.sort_by_key(|&node| !above(node));
            let (upper, lower) = sorted.split_at(count);
            let crossing = |a: u32, b: u32| {
                let [from, to] = [a, b].map(|node| scene.nodes[node as usize][plane.axis]);
                Crossing { ends: [a, b], part: ((plane.position - from) / (to - from)) as f32 }
            };
            match (upper, lower) {
                (&[a], others) | (others, &[a]) => {
                    crossings.extend(others.iter().map(|&other| crossing(a, other)));
                }
                (&[a, b], &[c, d]) => {
                    let corners = [crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)];
                    crossings.extend([0, 1, 2, 0, 2, 3].map(|corner| corners[corner]));
                }
                _ => {}
            }
        }
        let position = |crossing: &Crossing| {
            let [a, b] = crossing.ends.map(|node| scene.nodes[node as usize]);
            let mut point = a.lerp(b, f64::from(crossing.part));
            point[plane.axis] = plane.position;
            point
        };
        let positions = crossings.iter().map(position).collect();
        let touches = |tet: &[u32; 4]| tet.iter().any(|&node| is_used[node as usize]);
        let around = scene.tets.iter().zip(0..).filter(|(tet, _)| touches(tet)).map(|(_, index)| index);
        Self { crossings, positions, around: around.collect() }
    }

    /// Corners of the triangles, metres.
    pub(super) fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// What a quantity that is linear in each element is at the corners, from its values at the nodes.
    pub(super) fn values(&self, of_nodes: &[f32]) -> Vec<f32> {
        let value = |crossing: &Crossing| {
            let [a, b] = crossing.ends.map(|node| of_nodes[node as usize]);
            a + crossing.part * (b - a)
        };
        self.crossings.iter().map(value).collect()
    }

    /// The magnitude of E at the nodes around the plane, V/m, from the potentials of all nodes in V; zero at others.
    /// `holders` are as [`Occupancy::conductors`](capsense_core::occupancy::Occupancy::conductors).
    pub(super) fn field_at_nodes(
        &self,
        scene: &StaticScene,
        potentials: &[f32],
        holders: &[u16],
    ) -> Vec<f32> {
        let mut sums = vec![[0.0f32; 2]; scene.nodes.len()];
        for &element in &self.around {
            let tet = scene.tets[element as usize];
            let holder = holders[tet[0] as usize];
            if holder != NO_OBJECT && tet.iter().all(|&node| holders[node as usize] == holder) {
                continue;
            }
            let corners = scene.corners(element);
            let gradients = barycentric_gradients(corners);
            let field: DVec3 = (0..4).map(|k| gradients[k] * f64::from(potentials[tet[k] as usize])).sum();
            let volume = signed_volume(corners);
            for node in tet {
                let [weighted, weight] = &mut sums[node as usize];
                *weighted += (volume * field.length()) as f32;
                *weight += volume as f32;
            }
        }
        sums.iter().map(|&[weighted, weight]| if weight > 0.0 { weighted / weight } else { 0.0 }).collect()
    }
}

/// The value that a part of all values do not exceed; 0 when there are none.
pub(super) fn quantile(values: &[f32], part: f64) -> f32 {
    let mut sorted: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    if sorted.is_empty() {
        return 0.0;
    }
    let place = ((sorted.len() - 1) as f64 * part.clamp(0.0, 1.0)) as usize;
    *sorted.select_nth_unstable_by(place, f32::total_cmp).1
}
