//! Linear elements as a network: one weight for each mesh edge.
//!
//! With P1 elements the stiffness matrix is a graph Laplacian of the weights
//! w_ij = -Σ_e ε_e ∫_e ∇λ_i·∇λ_j, relative permittivity times length, in metres. Edges without a weight, such as the
//! diagonals of Kuhn tetrahedra, are left out.

use crate::mesh::{Background, CANCELLED, EdgeList, EdgeShare, Edges, Lattice, TetMesh};
use crate::occupancy::SMALLEST_PART;
use crate::sensor::{GROUND, OpenWall, RimLink, Sensor, Terminal, WallEdge};
use glam::DVec3;

pub use crate::mesh::barycentric_gradients;

/// Edges that lead along z by no more than this part of their length are in an electrode's plane.
const IN_PLANE: f64 = 1e-6;

/// The edges of a mesh and their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeNetwork {
    edges: Edges,
    weights: Vec<f64>,
    permittivity: Background,
    /// Number of rows of electrodes and of ground.
    held_rows: usize,
    rim: Vec<RimLink>,
    /// Edges that lead from nodes at rims out of their electrode's plane, in increasing order, and how far along z.
    out_of_plane: Vec<(u32, f64)>,
}

/// What one element adds to one edge.
struct Contribution {
    ends: [u32; 2],
    /// Without permittivity.
    vacuum: f64,
    weight: f64,
    /// Size of the factors that made the weight.
    magnitude: f64,
    /// Whether the weight is more than a rounding error.
    counts: bool,
}

/// Which weights the edges of a lattice have.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Weights {
    OfElements,
    /// To spacing that grows.
    Matched,
}

impl EdgeNetwork {
    /// Assembles the network of any mesh: its edges that carry a weight, ordered by their first, then second node.
    pub fn assemble(mesh: &TetMesh) -> Self {
        Self::assemble_with(mesh, false)
    }

    /// With `keep_cancelled`, edges stay whose elements' contributions cancel, as they do not where objects give these
    /// elements other permittivities. Such an edge has the weight that is the bound of what counts as none.
    fn assemble_with(mesh: &TetMesh, keep_cancelled: bool) -> Self {
        let mut contributions = Vec::with_capacity(6 * mesh.tets().len());
        for (element, (tet, permittivity)) in
            mesh.tets().iter().zip(mesh.relative_permittivity().iter()).enumerate()
        {
            contributions.extend(EdgeShare::of_element(mesh.corners(element)).map(|share| {
                let [a, b] = share.corners.map(|corner| tet[corner]);
                Contribution {
                    ends: [a.min(b), a.max(b)],
                    vacuum: share.weight,
                    weight: permittivity * share.weight,
                    magnitude: permittivity * share.magnitude,
                    counts: share.counts(),
                }
            }));
        }
        // Stable, so that each edge is summed in the order of its elements on every run.
        contributions.sort_by_key(|c| c.ends);
        let (mut ends, mut weights, mut permittivity) = (Vec::new(), Vec::new(), Vec::new());
        for of_edge in contributions.chunk_by(|a, b| a.ends == b.ends) {
            let sum = |part: fn(&Contribution) -> f64| of_edge.iter().map(part).sum::<f64>();
            let (weight, vacuum) = (sum(|c| c.weight), sum(|c| c.vacuum));
            let none = CANCELLED * sum(|c| c.magnitude);
            if weight.abs() > none {
                ends.push(of_edge[0].ends);
                weights.push(weight);
                permittivity.push(mean_permittivity(weight, vacuum));
            } else if keep_cancelled && of_edge.iter().any(|c| c.counts) {
                ends.push(of_edge[0].ends);
                weights.push(none);
                permittivity.push(1.0);
            }
        }
        drop(contributions);
        ends.shrink_to_fit();
        weights.shrink_to_fit();
        Self {
            edges: Edges::List(Box::new(EdgeList::new(ends, mesh.nodes()))),
            weights,
            permittivity: Background::new(permittivity),
            held_rows: 0,
            rim: Vec::new(),
            out_of_plane: Vec::new(),
        }
    }

    /// Assembles the network of a lattice; `permittivity` is that of its tetrahedra, six for each cell.
    ///
    /// A cell of size a b c has the weight bc/a along x: a third of it on each of the two edges on which walks of two
    /// Kuhn tetrahedra start or end, a sixth on each of the other two.
    pub fn assemble_lattice(lattice: &Lattice, permittivity: &Background) -> Self {
        let strides = lattice.strides();
        let edges = Edges::Lattice(lattice.clone());
        let mut vacuum = vec![0.0; edges.len()];
        let mut weights = vacuum.clone();
        for (cell, permittivity) in permittivity.iter().step_by(6).enumerate() {
            let at = lattice.cell_place(cell);
            let size: [f64; 3] = std::array::from_fn(|axis| {
                lattice.axes()[axis][at[axis] + 1] - lattice.axes()[axis][at[axis]]
            });
            let first = lattice.node_index(at);
            for axis in 0..3 {
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let along = size[b] * size[c] / size[axis];
                for (corner, divisor) in
                    [(0, 3.0), (strides[b], 6.0), (strides[c], 6.0), (strides[b] + strides[c], 3.0)]
                {
                    let edge = 3 * (first + corner) + axis;
                    vacuum[edge] += along / divisor;
                    weights[edge] += permittivity * along / divisor;
                }
            }
        }
        let permittivity = weights.iter().zip(&vacuum).map(|(w, v)| mean_permittivity(*w, *v)).collect();
        Self {
            edges,
            weights,
            permittivity: Background::new(permittivity),
            held_rows: 0,
            rim: Vec::new(),
            out_of_plane: Vec::new(),
        }
    }

    /// Assembles the network of a sensor: on lattices with dual lengths that are matched to spacing that grows; edges that cross
    /// the outline of a thin electrode in its plane are as long as their part outside.
    pub fn of_sensor(sensor: &Sensor) -> Self {
        Self::of_sensor_with(sensor, false, Weights::Matched)
    }

    /// The same with all edges along which an element alone has a weight, for weak dielectrics that cut elements. Where these
    /// weights cancel, there is one too small to matter.
    pub(crate) fn of_sensor_with_all_edges(sensor: &Sensor) -> Self {
        Self::of_sensor_with(sensor, true, Weights::Matched)
    }

    /// The same with the weights that linear elements have, for the interface models that change the permittivities of
    /// elements.
    pub fn of_sensor_elements(sensor: &Sensor) -> Self {
        Self::of_sensor_with(sensor, true, Weights::OfElements)
    }

    fn of_sensor_with(sensor: &Sensor, keep_cancelled: bool, weights: Weights) -> Self {
        let mut network = match sensor.lattice() {
            Some(lattice) => Self::assemble_lattice(lattice, sensor.mesh().relative_permittivity()),
            None => Self::assemble_with(sensor.mesh(), keep_cancelled),
        };
        for (edge, weight) in network.weights.iter_mut().enumerate() {
            let Some(ends) = network.edges.ends(edge) else { continue };
            if weights == Weights::Matched {
                *weight *= sensor.dual_area_of_edge(ends);
            }
            if let Some(outside) = sensor.outside_part_of_edge(ends)
                && *weight > 0.0
            {
                *weight /= outside.max(SMALLEST_PART);
            }
        }
        network.rim = sensor.rim().to_vec();
        match weights {
            Weights::OfElements => network.rim.iter_mut().for_each(|link| link.weight = link.of_elements),
            Weights::Matched => {
                for (ends, factor) in sensor.rim_edges() {
                    if let Some(edge) = network.edges.between(ends) {
                        network.weights[edge] *= factor;
                    }
                }
            }
        }
        network.out_of_plane = network.find_out_of_plane(sensor.mesh().nodes());
        network.held_rows = sensor.held_rows().count();
        if let Some(wall) = sensor.open_wall() {
            network.open(wall, sensor.terminals());
        }
        network
    }

    /// Adds what stands for the space beyond an open wall. Links lead to the last of the rows that are held, that of ground.
    fn open(&mut self, wall: &OpenWall, terminals: &[Terminal]) {
        let mut links = vec![0.0; terminals.len()];
        wall.links.iter().for_each(|&(node, weight)| links[node as usize] += weight);
        for &WallEdge { ends, weight, links: [first, second] } in &wall.edges {
            // Along an edge that has no weight in space there is none on the wall either.
            if let Some(edge) = self.edges.between(ends) {
                self.weights[edge] += weight;
                links[ends[0] as usize] += first;
                links[ends[1] as usize] += second;
            }
        }
        let ground = self.held_rows as u16 - 1;
        let is_linked = |&(node, weight): &(u32, f64)| weight != 0.0 && terminals[node as usize] != GROUND;
        let links = (0..).zip(links).filter(is_linked);
        self.rim.extend(links.map(|(node, weight)| RimLink {
            node,
            electrode: ground,
            weight,
            of_elements: weight,
            inside: false,
            covered: 0.0,
            rows: f64::INFINITY,
        }));
    }

    /// The edges.
    pub fn edges(&self) -> &Edges {
        &self.edges
    }

    /// Weight of each edge in metres (times relative permittivity). Unstructured meshes have some negative ones.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of rows after those of the nodes, before the objects: of electrodes, and of ground where links lead to it.
    pub fn held_rows(&self) -> usize {
        self.held_rows
    }

    /// Links between nodes at the rims of electrodes and their electrode, and between nodes of an open wall and ground, which
    /// is numbered like one more electrode.
    pub fn rim(&self) -> &[RimLink] {
        &self.rim
    }

    /// Electrodes of which it is known what their rims' nodes cover are across z.
    fn find_out_of_plane(&self, nodes: &[DVec3]) -> Vec<(u32, f64)> {
        let mut found = Vec::new();
        for link in self.rim.iter().filter(|link| link.covered > 0.0) {
            self.edges.for_edges_at(link.node as usize, |edge, _| {
                if self.weights[edge] > 0.0 {
                    let [a, b] = self.edges.ends_of_existing(edge).map(|end| nodes[end as usize]);
                    let height = (b.z - a.z).abs();
                    if height > IN_PLANE * a.distance(b) {
                        found.push((edge as u32, height));
                    }
                }
            });
        }
        found.sort_unstable_by_key(|(edge, _)| *edge);
        found.dedup();
        found
    }

    /// How far an edge leads from a node at a rim out of its electrode's plane, if it does, in metres.
    pub(super) fn way_out_of_plane(&self, edge: usize) -> Option<f64> {
        let found = self.out_of_plane.binary_search_by_key(&(edge as u32), |(edge, _)| *edge);
        found.ok().map(|at| self.out_of_plane[at].1)
    }

    /// Mean relative permittivity of the background around each edge.
    pub fn permittivity(&self) -> &Background {
        &self.permittivity
    }
}

/// The ratio of a weight to what it would be in vacuum; 1 where rounding leaves none.
fn mean_permittivity(weight: f64, vacuum: f64) -> f64 {
    let ratio = weight / vacuum;
    if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
}
