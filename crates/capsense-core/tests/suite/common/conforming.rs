//! Whether meshes are conforming.

use capsense_core::geometry::Aabb;
use capsense_core::mesh::{TetMesh, signed_volume};
use std::collections::{BTreeMap, BTreeSet};

/// The faces of all elements and in how many they are.
pub fn faces(mesh: &TetMesh) -> BTreeMap<[u32; 3], usize> {
    let mut faces = BTreeMap::new();
    for tet in mesh.tets().iter() {
        for skipped in 0..4 {
            let mut face = [1, 2, 3].map(|k| tet[(skipped + k) % 4]);
            face.sort_unstable();
            *faces.entry(face).or_insert(0) += 1;
        }
    }
    faces
}

/// Every face belongs to two elements or lies in the wall, so no node hangs; volumes are positive and fill the box; no
/// two nodes are in one place.
pub fn assert_conforming(mesh: &TetMesh, domain: &Aabb) {
    for (face, elements) in faces(mesh) {
        let corners = face.map(|node| mesh.nodes()[node as usize]);
        let in_wall = (0..3).any(|axis| {
            let lies_at = |wall: f64| corners.iter().all(|corner| corner[axis] == wall);
            lies_at(domain.min[axis]) || lies_at(domain.max[axis])
        });
        assert_eq!(elements, if in_wall { 1 } else { 2 }, "{face:?} {corners:?}");
    }
    assert!((0..mesh.tets().len()).all(|element| signed_volume(mesh.corners(element)) > 0.0));
    assert!((mesh.volume() / domain.size().element_product() - 1.0).abs() < 1e-12);
    let places: BTreeSet<[u64; 3]> =
        mesh.nodes().iter().map(|node| node.to_array().map(f64::to_bits)).collect();
    assert_eq!(places.len(), mesh.nodes().len());
}
