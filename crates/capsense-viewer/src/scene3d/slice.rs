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

#[cfg(test)]
mod tests {
    use super::*;
    use capsense::{Pipeline, Scene};
    use std::path::Path;

    fn scene() -> StaticScene {
        let text = r#"
            mesh.generate = { elements = 5000 }
            [[sensor.electrode]]
            name = "E1"
            disk = { center = [0.0, 0.0], radius = 0.05 }
            [[object]]
            name = "ball"
            sphere = { radius = 0.05 }
            material = { conductor = "grounded" }
            position = [0.0, 0.0, 0.12]
        "#;
        let scene = Scene::parse("scene.toml", text, Path::new(".")).unwrap();
        StaticScene::new(&scene, Pipeline::new(&scene).unwrap().simulator())
    }

    /// Planes between those of the lattice, in one of them, and at the ends of the domain.
    fn planes(scene: &StaticScene) -> Vec<Plane> {
        let plane = |axis, position| Plane { axis, position };
        let node = scene.nodes[scene.nodes.len() / 2];
        let mut planes = vec![plane(0, 0.0123), plane(1, -0.077), plane(2, 0.2), plane(2, 0.0)];
        planes.extend((0..3).map(|axis| plane(axis, node[axis])));
        planes.push(plane(2, scene.domain.max.z));
        planes
    }

    #[test]
    fn a_slice_covers_the_plane_once() {
        let scene = scene();
        for plane in planes(&scene) {
            let slice = Slice::new(&scene, plane);
            let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
            let covered: f64 = slice.positions().as_chunks::<3>().0.iter().map(area).sum();
            let size = scene.domain.size();
            let whole = size[(plane.axis + 1) % 3] * size[(plane.axis + 2) % 3];
            assert!((covered / whole - 1.0).abs() < 1e-6, "{plane:?}: {covered} {whole}");
            // Nothing lies over anything else.
            for k in 1..40 {
                let parts = [0.618_034, 0.754_878, 0.569_84].map(|step| (f64::from(k) * step).fract());
                let mut place = scene.domain.min + scene.domain.size() * DVec3::from(parts);
                place[plane.axis] = plane.position;
                let holds = |[a, b, c]: &&[DVec3; 3]| {
                    let sides = [[a, b], [b, c], [c, a]];
                    let turns = sides.map(|[from, to]| (to - from).cross(place - from)[plane.axis]);
                    turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0)
                };
                let count = slice.positions().as_chunks::<3>().0.iter().filter(holds).count();
                assert_eq!(count, 1, "{plane:?} at {place}");
            }
        }
        let outside = Plane { axis: 0, position: 7.0 };
        assert!(Slice::new(&scene, outside).positions().is_empty());
    }

    /// The interpolated potential at a point, from the barycentric coordinates in any element that holds it.
    fn interpolated(scene: &StaticScene, of_nodes: &[f32], point: DVec3) -> f64 {
        let mut best = (f64::NEG_INFINITY, 0.0);
        for (element, tet) in scene.tets.iter().enumerate() {
            let corners = scene.corners(element as u32);
            let gradients = barycentric_gradients(corners);
            let coordinates: [f64; 4] =
                std::array::from_fn(|k| gradients[k].dot(point - corners[(k + 1) % 4]));
            let least = coordinates.into_iter().fold(f64::INFINITY, f64::min);
            if least > best.0 {
                let value = (0..4).map(|k| coordinates[k] * f64::from(of_nodes[tet[k] as usize])).sum();
                best = (least, value);
            }
        }
        best.1
    }

    #[test]
    fn values_are_those_of_the_interpolated_field() {
        let scene = scene();
        // Nothing that is linear, so that every element matters.
        let wavy = |p: &DVec3| ((20.0 * p.x).sin() + (31.0 * p.y).cos() * (17.0 * p.z).sin()) as f32;
        let of_nodes: Vec<f32> = scene.nodes.iter().map(wavy).collect();
        for plane in planes(&scene) {
            let slice = Slice::new(&scene, plane);
            let values = slice.values(&of_nodes);
            let triangles = slice.positions().as_chunks::<3>().0.iter().zip(values.as_chunks::<3>().0);
            for (corners, values) in triangles.step_by(37) {
                // Within each triangle, too, the colours are those of the element.
                let weights = [0.2, 0.5, 0.3];
                let point = (0..3).map(|k| weights[k] * corners[k]).sum::<DVec3>();
                let value: f64 = (0..3).map(|k| weights[k] * f64::from(values[k])).sum();
                let expected = interpolated(&scene, &of_nodes, point);
                assert!((value - expected).abs() < 1e-5, "{plane:?} at {point}: {value} {expected}");
            }
        }
    }

    #[test]
    fn an_even_field_is_as_strong_everywhere_and_none_is_within_conductors() {
        let scene = scene();
        let slope = DVec3::new(30.0, -40.0, 120.0);
        let potentials: Vec<f32> = scene.nodes.iter().map(|p| p.dot(slope) as f32).collect();
        let slice = Slice::new(&scene, Plane { axis: 1, position: 0.01 });
        let free = vec![NO_OBJECT; scene.nodes.len()];
        let values = slice.values(&slice.field_at_nodes(&scene, &potentials, &free));
        let worst = values.iter().map(|value| (value - 130.0).abs()).fold(0.0, f32::max);
        assert!(worst < 0.02, "{worst}");
        let held = vec![0; scene.nodes.len()];
        let values = slice.values(&slice.field_at_nodes(&scene, &potentials, &held));
        assert!(values.iter().all(|&value| value == 0.0));
    }

    #[test]
    fn quantiles_leave_the_largest_out() {
        let values: Vec<f32> = (0..=100).map(|k| k as f32).chain([f32::NAN]).collect();
        assert_eq!(quantile(&values, 0.95), 95.0);
        assert_eq!(quantile(&values, 7.0), 100.0);
        assert_eq!(quantile(&[], 0.5), 0.0);
    }
}
