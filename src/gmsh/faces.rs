//! Faces of tetrahedra: which are on the boundary, and which are shared.

use capsense_core::mesh::TetMesh;

/// The faces of a tetrahedron of positive volume, each counter-clockwise as seen from outside.
const OUTWARD: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// One face of one tetrahedron.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Face {
    /// Its nodes, ascending.
    pub(super) key: [u32; 3],
    /// Index of the tetrahedron.
    pub(super) tet: usize,
    /// Which row of `OUTWARD`.
    side: u8,
}

/// Three nodes, ascending.
pub(super) fn key(mut nodes: [u32; 3]) -> [u32; 3] {
    nodes.sort_unstable();
    nodes
}

/// All faces of all tetrahedra, the same ones next to each other.
pub(super) fn sorted(tets: impl Iterator<Item = [u32; 4]>) -> Vec<Face> {
    let mut faces: Vec<Face> = tets
        .enumerate()
        .flat_map(|(tet, nodes)| {
            (0..4u8).zip(OUTWARD).map(move |(side, corners)| Face {
                key: key(corners.map(|corner| nodes[corner])),
                tet,
                side,
            })
        })
        .collect();
    faces.sort_unstable();
    faces
}

/// The tetrahedra that share each face.
pub(super) fn groups(faces: &[Face]) -> impl Iterator<Item = &[Face]> {
    faces.chunk_by(|a, b| a.key == b.key)
}

/// The faces that belong to exactly one tetrahedron, counter-clockwise as seen from outside the mesh.
pub fn boundary_faces(mesh: &TetMesh) -> Vec<[u32; 3]> {
    let faces = sorted(mesh.tets().iter());
    groups(&faces)
        .filter(|same| same.len() == 1)
        .map(|same| OUTWARD[usize::from(same[0].side)].map(|corner| mesh.tets().at(same[0].tet)[corner]))
        .collect()
}

/// The faces whose three nodes are all in a set: turns the nodes of an electrode or of the ground into the triangles
/// that [`write`](super::write()) takes. Each face is there once, with its nodes in ascending order; nodes that do not
/// exist are ignored.
pub fn faces_among(mesh: &TetMesh, nodes: &[u32]) -> Vec<[u32; 3]> {
    let mut is_in = vec![false; mesh.nodes().len()];
    for &node in nodes {
        if let Some(flag) = is_in.get_mut(node as usize) {
            *flag = true;
        }
    }
    let among = |nodes: [u32; 3]| nodes.iter().all(|&node| is_in[node as usize]);
    let mut faces: Vec<[u32; 3]> = mesh
        .tets()
        .iter()
        .flat_map(|tet| OUTWARD.map(|corners| key(corners.map(|corner| tet[corner]))))
        .filter(|&face| among(face))
        .collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}
