//! The elements around a rim, and how far the discrete field of a half-plane on them is from the true one.
//!
//! With d the distance outside of the rim in the electrode's plane and r that from the rim, u = √((r + d)/2) = √r cos θ/2
//! is the potential of a half-plane, of energy density 1/(4r) (e.g. Jackson, Classical Electrodynamics, 2.11). Where the
//! normal n of the outline turns, Δu = (div n) ∂u/∂d = (div n) u/(2r) =: g, and u minimises Φ(u) = ∫ |∇u|² + 2 g u dV
//! among all fields that have its values on the wall of a tube around the rim and are 0 on the electrode. Linear elements
//! have some other least Φ, which falls as the links at the rim weaken. So Φ tells how far out the discrete rim looks.

use super::Link;
use super::cut::link_of;
use super::place::{Place, Places};
use super::plane::{Plane, PlaneNode};
use super::relax::{Network, relax};
use super::sheet::exact_energy;
use super::side::Frame;
use crate::electrode::Electrode;
use crate::mesh::{EdgeShare, TetMesh, barycentric_gradients, signed_volume};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// The tube's wall is so many edges from the edges that the outline cuts. With more, few electrodes have room for it.
const RINGS: u8 = 2;

/// Rows of nodes from a corner of the outline within which the field is another one.
const ROWS_AT_CORNER: f64 = 1.0;

/// How often elements near the rim are divided to integrate 1/r.
const DIVISIONS: usize = 5;

/// R is looked for between these: that of flat cells, and that with which a row of nodes on the rim is free.
const PLAUSIBLE: [f64; 2] = [1.0, 4.0];

/// Halvings of that interval: to a thousandth of a row.
const HALVINGS: usize = 10;

/// Nodes closer to the outline than this part of a row lie on it.
const ON_OUTLINE: f64 = 1e-6;

/// The elements around a rim as a network.
#[derive(Clone, Debug, Default)]
pub(super) struct Tube {
    nodes: Vec<TubeNode>,
    edges: Vec<([u32; 2], f64)>,
    /// ∫ g λ dV of each node's λ.
    load: Vec<f64>,
    /// Φ(u).
    exact: f64,
}

#[derive(Clone, Copy, Debug)]
struct TubeNode {
    /// In the electrode's plane, near the rim.
    in_plane: Option<PlaneNode>,
    /// In its plane, far inside.
    held: bool,
    on_wall: bool,
    /// Out of the electrode across the rim.
    normal: DVec2,
    /// u.
    potential: f64,
    /// What of its area in the plane belongs to the tube's elements.
    area: f64,
}

/// What an outline is to elements and nodes.
struct Around<'a> {
    mesh: &'a TetMesh,
    plane: &'a Plane,
    places: &'a Places<'a>,
    z: f64,
    slack: f64,
}

impl Around<'_> {
    /// Distance from the rim, and where the point is in the plane.
    fn at(&self, point: DVec3) -> (f64, Place) {
        let place = self.places.at(point.truncate(), self.slack);
        (DVec2::new(place.distance, point.z - self.z).length(), place)
    }

    fn node(&self, node: u32, on_wall: bool) -> TubeNode {
        let (r, place) = self.at(self.mesh.nodes()[node as usize]);
        TubeNode {
            in_plane: self.plane.near.get(&node).copied(),
            held: self.plane.held.binary_search(&node).is_ok(),
            on_wall,
            normal: place.normal,
            potential: potential(r, place.distance),
            area: 0.0,
        }
    }
}

fn potential(r: f64, distance: f64) -> f64 {
    (0.5 * (r + distance)).max(0.0).sqrt()
}

impl Tube {
    /// None where the outline is hardly more than corners.
    pub(super) fn around(
        mesh: &TetMesh,
        electrode: &Electrode,
        plane: &Plane,
        places: &Places<'_>,
    ) -> Option<Self> {
        let ring = ring_of_nodes(mesh, plane);
        let rows = plane.mean_rows()?;
        let around = Around { mesh, plane, places, z: electrode.z, slack: ON_OUTLINE * rows };
        let corners = electrode.outline.sharp_corners();
        let mut tube = Self::default();
        let mut index: BTreeMap<u32, u32> = BTreeMap::new();
        let mut weights: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for (element, tet) in mesh.tets().iter().enumerate() {
            let [Some(a), Some(b), Some(c), Some(d)] = tet.map(|node| ring[node as usize]) else { continue };
            let (_, place) = around.at(mesh.centroid(element));
            let foot = mesh.centroid(element).truncate() - place.normal * place.distance;
            let at_corner = corners.iter().any(|corner| corner.distance(foot) < ROWS_AT_CORNER * rows);
            if a.min(b).min(c).min(d) == RINGS || at_corner {
                continue;
            }
            let local = tet.map(|node| {
                *index.entry(node).or_insert_with(|| {
                    tube.nodes.push(around.node(node, ring[node as usize] == Some(RINGS)));
                    tube.load.push(0.0);
                    tube.nodes.len() as u32 - 1
                })
            });
            tube.add(&around, element, local);
            for share in EdgeShare::of_element(mesh.corners(element)) {
                let [a, b] = share.corners.map(|corner| local[corner]);
                *weights.entry([a.min(b), a.max(b)]).or_default() += share.weight;
            }
        }
        tube.edges = weights.into_iter().collect();
        (!tube.edges.is_empty()).then_some(tube)
    }

    /// Adds what an element has of Φ(u), of loads and of area.
    fn add(&mut self, around: &Around<'_>, element: usize, local: [u32; 4]) {
        let (points, centroid) = (around.mesh.corners(element), around.mesh.centroid(element));
        let (r, place) = around.at(centroid);
        let foot = centroid.truncate() - place.normal * place.distance;
        let frame = Frame::across_line(foot.extend(around.z), place.normal.extend(0.0));
        let gradients = barycentric_gradients(points);
        let divergence: f64 =
            (0..4).map(|k| gradients[k].truncate().dot(self.nodes[local[k] as usize].normal)).sum();
        let u = potential(r, place.distance);
        let load = signed_volume(points) * divergence * u / (2.0 * r).max(f64::MIN_POSITIVE);
        self.exact += exact_energy(&frame, points, DIVISIONS) + 2.0 * load * u;
        local.iter().for_each(|&k| self.load[k as usize] += 0.25 * load);
        for skipped in 0..4 {
            let face = [1, 2, 3].map(|k| (skipped + k) % 4);
            let in_plane = |k: usize| {
                let node = &self.nodes[local[k] as usize];
                node.in_plane.is_some() || node.held
            };
            if face.into_iter().all(in_plane) {
                let [a, b, c] = face.map(|k| points[k]);
                let share = Plane::share_of_face([a, b, c]);
                face.iter().for_each(|&k| self.nodes[local[k] as usize].area += share);
            }
        }
    }

    /// The R of links with which the discrete field has the true one's Φ, or the nearest plausible one.
    pub(super) fn root(&self) -> f64 {
        let mut potentials: Vec<f64> = self.nodes.iter().map(|node| node.potential).collect();
        let [mut low, mut high] = PLAUSIBLE;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            // It falls with R.
            if self.least(middle, &mut potentials) > self.exact { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// The least Φ of linear elements with the links of some R. Potentials are where the search begins and ends.
    fn least(&self, root: f64, potentials: &mut [f64]) -> f64 {
        let mut links = vec![0.0; self.nodes.len()];
        let mut fixed = vec![false; self.nodes.len()];
        for (k, node) in self.nodes.iter().enumerate() {
            let link = node.in_plane.map_or(Link::None, |of| link_of(&of, root));
            let held = node.held || matches!(link, Link::Held);
            if node.on_wall || held {
                fixed[k] = true;
                potentials[k] = if held { 0.0 } else { node.potential };
            } else if let Link::Weight(weight) = link {
                links[k] = weight * node.area;
            }
        }
        let network = Network { edges: &self.edges, links: &links, fixed: &fixed };
        relax(&network, &self.load, potentials)
    }
}

/// For the nodes at most [`RINGS`] edges from the nodes of edges that are cut: how many.
fn ring_of_nodes(mesh: &TetMesh, plane: &Plane) -> Vec<Option<u8>> {
    let mut ring: Vec<Option<u8>> = vec![None; mesh.nodes().len()];
    for &node in &plane.cut {
        ring[node as usize] = Some(0);
    }
    for at in 1..=RINGS {
        for tet in mesh.tets().iter() {
            if tet.iter().any(|&node| ring[node as usize] == Some(at - 1)) {
                for node in tet {
                    ring[node as usize].get_or_insert(at);
                }
            }
        }
    }
    ring
}
