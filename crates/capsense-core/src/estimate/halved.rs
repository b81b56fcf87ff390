//! Lattices and meshes with all edges halved.

use crate::mesh::{InvalidAxis, Lattice, MeshError, TetMesh, signed_volume};
use glam::DVec3;

/// Corners of a tetrahedron that its edges join.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// The two edges without a common corner whose middles an octahedron's diagonal joins, and the other four in their order
/// around it, as indices into [`EDGES`].
const DIAGONALS: [([usize; 2], [usize; 4]); 3] =
    [([0, 5], [1, 2, 4, 3]), ([1, 4], [0, 2, 5, 3]), ([2, 3], [0, 1, 5, 4])];

/// Tetrahedra that one is cut into.
const PARTS: usize = 8;

/// The lattice with a plane in the middle of any two.
///
/// # Errors
/// When planes are so close that there is no number between them.
pub fn halved_lattice(lattice: &Lattice) -> Result<Lattice, InvalidAxis> {
    let halve = |axis: &Vec<f64>| {
        let halves = axis.windows(2).flat_map(|pair| [0.5 * (pair[0] + pair[1]), pair[1]]);
        axis[..1].iter().copied().chain(halves).collect()
    };
    let [x, y, z] = lattice.axes();
    Lattice::new([halve(x), halve(y), halve(z)])
}

/// A mesh of which each tetrahedron is cut into eight: one at each corner, and four around the shortest diagonal of the
/// octahedron between these. Nodes of the mesh keep their numbers; the middles of its edges follow.
#[derive(Clone, Debug, PartialEq)]
pub struct HalvedMesh {
    mesh: TetMesh,
    middles: Middles,
}

impl HalvedMesh {
    /// Cuts all tetrahedra of a mesh. Parts have the permittivity of the whole.
    ///
    /// # Errors
    /// When there are more nodes or tetrahedra than 32-bit indices can name, or elements are too flat to be cut.
    pub fn new(mesh: &TetMesh) -> Result<Self, MeshError> {
        let middles = Middles::of(mesh);
        let mut nodes = mesh.nodes().to_vec();
        nodes.extend(middles.ends.iter().map(|ends| {
            let [a, b] = ends.map(|node| mesh.nodes()[node as usize]);
            0.5 * (a + b)
        }));
        let count = mesh.tets().len().saturating_mul(PARTS);
        if u32::try_from(nodes.len()).is_err() {
            return Err(MeshError::TooManyNodes(nodes.len()));
        }
        if u32::try_from(count).is_err() {
            return Err(MeshError::TooManyElements(count));
        }
        let mut tets = Vec::with_capacity(count);
        for tet in mesh.tets().iter() {
            tets.extend(parts(
                tet,
                EDGES.map(|edge| middles.between(edge.map(|corner| tet[corner]))),
                &nodes,
            ));
        }
        let permittivity = mesh.relative_permittivity();
        let mesh = TetMesh::new(nodes, tets)?.with_permittivity(|part| permittivity.at(part / PARTS))?;
        Ok(Self { mesh, middles })
    }

    /// The nodes that lie on what some nodes of the mesh before were given for: these, and the middles between any of them
    /// that are corners of a face of which all corners are given.
    pub fn nodes_on(&self, given: &[u32]) -> Vec<u32> {
        let before = self.mesh.nodes().len() - self.middles.ends.len();
        let mut is_given = vec![false; self.mesh.nodes().len()];
        for &node in given.iter().filter(|node| (**node as usize) < before) {
            is_given[node as usize] = true;
        }
        // The first four parts of an element are at its corners, in their order.
        let tets = self.mesh.tets();
        let elements =
            (0..tets.len()).step_by(PARTS).map(|first| [0, 1, 2, 3].map(|k| tets.at(first + k)[k]));
        let on: Vec<[u32; 4]> = elements
            .filter(|tet| tet.iter().filter(|corner| is_given[**corner as usize]).count() >= 3)
            .collect();
        for tet in on {
            for ends in EDGES.map(|edge| edge.map(|corner| tet[corner])) {
                if ends.iter().all(|end| is_given[*end as usize]) {
                    is_given[self.middles.between(ends) as usize] = true;
                }
            }
        }
        (0..).zip(is_given).filter(|(_, is_given)| *is_given).map(|(node, _)| node).collect()
    }

    /// The mesh.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// The mesh alone.
    pub fn into_mesh(self) -> TetMesh {
        self.mesh
    }
}

/// The middles of a mesh's edges.
#[derive(Clone, Debug, PartialEq)]
struct Middles {
    /// The ends of each edge, the smaller first, in increasing order.
    ends: Vec<[u32; 2]>,
    /// The number of the first middle: that of nodes in the mesh.
    first: usize,
}

impl Middles {
    fn of(mesh: &TetMesh) -> Self {
        let all =
            mesh.tets().iter().flat_map(|tet| EDGES.map(|edge| ordered(edge.map(|corner| tet[corner]))));
        let mut ends: Vec<[u32; 2]> = all.collect();
        ends.sort_unstable();
        ends.dedup();
        Self { ends, first: mesh.nodes().len() }
    }

    /// The node in the middle of an edge of the mesh.
    fn between(&self, ends: [u32; 2]) -> u32 {
        let place = self.ends.partition_point(|other| *other < ordered(ends));
        (self.first + place) as u32
    }
}

fn ordered([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// What a tetrahedron with these nodes in the middles of its edges is cut into; the part at each corner has it in its place.
fn parts(tet: [u32; 4], middles: [u32; 6], nodes: &[DVec3]) -> [[u32; 4]; PARTS] {
    let place = |node: u32| nodes[node as usize];
    let length = |[a, b]: [usize; 2]| place(middles[a]).distance_squared(place(middles[b]));
    let mut shortest = DIAGONALS[0];
    for diagonal in &DIAGONALS[1..] {
        if length(diagonal.0) < length(shortest.0) {
            shortest = *diagonal;
        }
    }
    let ([a, b], around) = shortest;
    std::array::from_fn(|part| match part {
        0..4 => std::array::from_fn(|k| match k {
            _ if k == part => tet[k],
            _ => middles[edge_between([k, part])],
        }),
        _ => {
            let (c, d) = (around[part - 4], around[(part - 3) % 4]);
            let [a, b, c, d] = [a, b, c, d].map(|middle| middles[middle]);
            if signed_volume([a, b, c, d].map(place)) < 0.0 { [a, b, d, c] } else { [a, b, c, d] }
        }
    })
}

/// Which of [`EDGES`] joins two corners.
fn edge_between([a, b]: [usize; 2]) -> usize {
    if a.min(b) == 0 { a.max(b) - 1 } else { a + b }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;

    #[test]
    fn edges_are_found_by_their_corners() {
        for (edge, [a, b]) in EDGES.into_iter().enumerate() {
            assert_eq!((edge_between([a, b]), edge_between([b, a])), (edge, edge));
        }
    }

    #[test]
    fn parts_are_as_much_as_the_whole_and_conform() {
        let lattice =
            Lattice::uniform(Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 0.5, 2.0) }, [2, 3, 2]).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap().with_permittivity(|element| 1.0 + element as f64).unwrap();
        let halved = HalvedMesh::new(&mesh).unwrap();
        for element in 0..mesh.tets().len() {
            let of_parts = (0..PARTS).map(|part| PARTS * element + part);
            let volume: f64 = of_parts.clone().map(|part| signed_volume(halved.mesh().corners(part))).sum();
            assert!((volume / signed_volume(mesh.corners(element)) - 1.0).abs() < 1e-12);
            for part in of_parts {
                assert_eq!(halved.mesh().relative_permittivity().at(part), 1.0 + element as f64);
            }
        }
        // Nodes of the halved lattice are those of the halved mesh, and so all faces have their neighbours.
        let mut nodes: Vec<[u64; 3]> =
            halved.mesh().nodes().iter().map(|node| node.to_array().map(f64::to_bits)).collect();
        let finer = halved_lattice(&lattice).unwrap();
        let mut of_lattice: Vec<[u64; 3]> = finer
            .to_tet_mesh()
            .unwrap()
            .nodes()
            .iter()
            .map(|node| node.to_array().map(f64::to_bits))
            .collect();
        nodes.sort_unstable();
        of_lattice.sort_unstable();
        assert_eq!(nodes, of_lattice);
        let mut faces = std::collections::BTreeMap::new();
        for tet in halved.mesh().tets().iter() {
            for left_out in 0..4 {
                let mut face: Vec<u32> = (0..4).filter(|k| *k != left_out).map(|k| tet[k]).collect();
                face.sort_unstable();
                *faces.entry(face).or_insert(0) += 1;
            }
        }
        let outside = faces.values().filter(|count| **count == 1).count();
        assert_eq!(outside, 4 * 2 * 2 * (2 * 3 + 2 * 2 + 3 * 2), "four for each triangle of the boundary");
        assert!(faces.values().all(|count| *count <= 2));
    }

    #[test]
    fn surfaces_have_the_middles_of_their_faces() {
        let lattice = Lattice::uniform(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, [3; 3]).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap();
        let halved = HalvedMesh::new(&mesh).unwrap();
        let on = |mesh: &TetMesh, holds: &dyn Fn(DVec3) -> bool| -> Vec<u32> {
            (0..).zip(mesh.nodes()).filter(|(_, node)| holds(**node)).map(|(index, _)| index).collect()
        };
        let floor = |node: DVec3| node.z == 0.0;
        assert_eq!(halved.nodes_on(&on(&mesh, &floor)), on(halved.mesh(), &floor));
        // Between the floor and the ceiling are edges within, but no faces of both.
        let both = |node: DVec3| node.z == 0.0 || node.z == 1.0;
        assert_eq!(halved.nodes_on(&on(&mesh, &both)), on(halved.mesh(), &both));
    }
}
