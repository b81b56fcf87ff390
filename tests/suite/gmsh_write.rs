//! Gmsh files that are written: what is read back from them, and what cannot be written.

use capsense::gmsh::{self, SurfaceGroup, VolumeGroup, WriteError};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::units::LengthUnit;
use glam::DVec3;

fn lattice() -> TetMesh {
    let axis = |step: f64| vec![-0.1, -0.1 + step, 1.0 / 3.0, 0.7];
    Lattice::new([axis(0.1), axis(1e-7), vec![0.0, 0.05]]).unwrap().to_tet_mesh().unwrap()
}

#[test]
fn what_is_written_is_read_back() {
    let mesh = lattice();
    let bottom: Vec<u32> =
        (0..mesh.nodes().len() as u32).filter(|&node| mesh.nodes()[node as usize].z == 0.0).collect();
    let electrode = gmsh::faces_among(&mesh, &bottom[..6]);
    let wall = gmsh::boundary_faces(&mesh);
    assert!(!electrode.is_empty());
    let all: Vec<u32> = (0..mesh.tets().len() as u32).collect();
    let (board, air) = all.split_at(10);
    let surfaces = [
        SurfaceGroup { name: "ground", triangles: &wall },
        SurfaceGroup { name: "E 1 µ", triangles: &electrode },
    ];
    let volumes = [
        VolumeGroup { name: "board", tets: board },
        VolumeGroup { name: "air", tets: air },
        VolumeGroup { name: "part", tets: &all[5..15] },
    ];
    let text = gmsh::write(&mesh, &surfaces, &volumes).unwrap();
    let file = gmsh::parse(text.as_bytes()).unwrap();
    let read = file.to_tet_mesh(LengthUnit::Metre).unwrap();
    // Positions survive bit for bit; nodes and elements are found again by their tags.
    let mut order: Vec<usize> = (0..file.nodes.len()).collect();
    order.sort_by_key(|&node| file.node_tags[node]);
    assert_eq!(order.iter().map(|&node| file.nodes[node]).collect::<Vec<_>>(), mesh.nodes());
    let original = |nodes: &[u32]| -> Vec<u32> {
        nodes.iter().map(|&node| file.node_tags[node as usize] as u32 - 1).collect()
    };
    let mut tets: Vec<Vec<u32>> = file.tets.iter().map(|tet| original(&tet.nodes)).collect();
    tets.sort();
    let mut expected: Vec<Vec<u32>> = mesh.tets().iter().map(|tet| tet.to_vec()).collect();
    expected.sort();
    assert_eq!(tets, expected);
    assert_eq!(read.tets().len(), mesh.tets().len());
    for volume in &volumes {
        let mut found: Vec<Vec<u32>> = file
            .tets_of(volume.name)
            .unwrap()
            .iter()
            .map(|&tet| original(&file.tets[tet as usize].nodes))
            .collect();
        found.sort();
        let mut expected: Vec<Vec<u32>> =
            volume.tets.iter().map(|&tet| mesh.tets().at(tet as usize).to_vec()).collect();
        expected.sort();
        assert_eq!(found, expected, "{}", volume.name);
    }
    let mut nodes = original(&file.nodes_of("E 1 µ").unwrap());
    nodes.sort_unstable();
    let mut expected: Vec<u32> = electrode.iter().flatten().copied().collect();
    expected.sort_unstable();
    expected.dedup();
    assert_eq!(nodes, expected);
    let summary = file.surface_summary().unwrap();
    assert_eq!((summary.boundary_faces, summary.unlabelled_boundary_faces), (wall.len(), 0));
    assert!(summary.detached_triangles.is_empty());
}

#[test]
fn boundary_faces_point_outwards() {
    // On a Kuhn lattice some sides of the elements are never on the boundary; on one tetrahedron all are.
    let corners = [DVec3::ONE, DVec3::ONE + DVec3::X, DVec3::ONE + DVec3::Y, DVec3::ONE + DVec3::Z];
    let single = TetMesh::new(corners.to_vec(), vec![[0, 1, 2, 3]]).unwrap();
    assert_eq!(gmsh::boundary_faces(&single).len(), 4);
    for mesh in [lattice(), single] {
        let faces = gmsh::boundary_faces(&mesh);
        let corners = faces.iter().map(|face| face.map(|node| mesh.nodes()[node as usize]));
        let volume: f64 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!((volume / mesh.volume() - 1.0).abs() < 1e-12, "{volume}");
    }
}

#[test]
fn a_mesh_without_groups_can_be_written() {
    let mesh = lattice();
    let file = gmsh::parse(gmsh::write(&mesh, &[], &[]).unwrap().as_bytes()).unwrap();
    assert!(file.groups.is_empty());
    assert_eq!(file.to_tet_mesh(LengthUnit::Metre).unwrap().tets().len(), mesh.tets().len());
}

#[test]
fn groups_that_cannot_be_written_are_told() {
    let mesh = lattice();
    let surface = |name, triangles| gmsh::write(&mesh, &[SurfaceGroup { name, triangles }], &[]).unwrap_err();
    let long = "x".repeat(128);
    for name in ["", "a\"b", "a\nb", &long] {
        assert_eq!(surface(name, &[]), WriteError::Name(name.to_owned()));
    }
    let (nodes, tets) = (mesh.nodes().len(), mesh.tets().len());
    let node = nodes as u32;
    let group = "E1".to_owned();
    assert_eq!(surface("E1", &[[0, 1, node]]), WriteError::NodeOutOfRange { group, node, nodes });
    let tet = tets as u32;
    let volume = VolumeGroup { name: "air", tets: &[0, tet] };
    assert_eq!(
        gmsh::write(&mesh, &[], &[volume]).unwrap_err(),
        WriteError::TetOutOfRange { group: "air".to_owned(), tet, tets }
    );
    let twins = [SurfaceGroup { name: "air", triangles: &[] }];
    let volume = VolumeGroup { name: "air", tets: &[0] };
    assert_eq!(
        gmsh::write(&mesh, &twins, &[volume]).unwrap_err(),
        WriteError::DuplicateName("air".to_owned())
    );
}
