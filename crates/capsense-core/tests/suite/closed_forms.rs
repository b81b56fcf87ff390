//! Capacitances that have a closed form.

use crate::common::EXACT;
use approx::assert_relative_eq;
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::units::VACUUM_PERMITTIVITY;

fn nodes_where(mesh: &TetMesh, holds: impl Fn(DVec3) -> bool) -> Vec<u32> {
    mesh.nodes().iter().zip(0..).filter(|(p, _)| holds(**p)).map(|(_, n)| n).collect()
}

fn capacitance(mesh: TetMesh, ground: impl Fn(DVec3) -> bool, electrode: impl Fn(DVec3) -> bool) -> f64 {
    let (ground, electrode) = (nodes_where(&mesh, ground), nodes_where(&mesh, electrode));
    let electrodes = vec![("E".to_owned(), ElectrodeNodes::Nodes(electrode))];
    let sensor = Sensor::on_mesh(mesh, &ground, electrodes).unwrap();
    Simulator::new(sensor, vec![], EXACT).unwrap().capacitance().get(0, 0)
}

/// Prints a row of docs/validation.md.
fn print(name: &str, elements: usize, found: f64, exact: f64) {
    let percent = 100.0 * (found / exact - 1.0);
    println!("{name}, {elements} tetrahedra: {found:.9e} F of {exact:.9e} F, {percent:+.2e} %");
}

/// A brick 20 mm x 30 mm x 4 mm with unequal cells, its six sides insulated but for top and bottom.
fn brick() -> TetMesh {
    let axes = [
        vec![0.0, 0.004, 0.013, 0.02],
        vec![0.0, 0.011, 0.018, 0.025, 0.03],
        vec![0.0, 0.0005, 0.001, 0.0032, 0.004],
    ];
    Lattice::new(axes).unwrap().to_tet_mesh().unwrap()
}

#[test]
fn parallel_plates_with_insulated_sides_are_exact() {
    let c = capacitance(brick(), |p| p.z == 0.0, |p| p.z == 0.004);
    let expected = VACUUM_PERMITTIVITY * 0.02 * 0.03 / 0.004;
    print("plates", brick().tets().len(), c, expected);
    assert_relative_eq!(c, expected, max_relative = 1e-9);
}

#[test]
fn two_layers_between_plates_are_capacitors_in_series() {
    let mesh = brick();
    let low: Vec<bool> = (0..mesh.tets().len()).map(|e| mesh.centroid(e).z < 0.001).collect();
    let mesh = mesh.with_permittivity(|e| if low[e] { 4.4 } else { 1.5 }).unwrap();
    let c = capacitance(mesh, |p| p.z == 0.0, |p| p.z == 0.004);
    let expected = VACUUM_PERMITTIVITY * 0.02 * 0.03 / (0.001 / 4.4 + 0.003 / 1.5);
    print("two layers", low.len(), c, expected);
    assert_relative_eq!(c, expected, max_relative = 1e-9);
}

/// An octant of the shell between the spheres of radius 0.5 and 1. The cube's shell 0.5 <= max(x, y, z) <= 1 is mapped
/// onto it; Kuhn tetrahedra never straddle the planes where the largest coordinate changes.
fn shell_octant(cells: usize) -> TetMesh {
    let lattice = Lattice::uniform(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, [cells; 3]).unwrap();
    let cube = lattice.to_tet_mesh().unwrap();
    let mut index = vec![None; cube.nodes().len()];
    let mut nodes = Vec::new();
    let mut tets = Vec::new();
    for tet in cube.tets().iter() {
        let in_shell = |node: &u32| cube.nodes()[*node as usize].max_element() >= 0.5 - 1e-12;
        if tet.iter().all(in_shell) {
            tets.push(tet.map(|node| {
                *index[node as usize].get_or_insert_with(|| {
                    let p = cube.nodes()[node as usize];
                    nodes.push(p.max_element() * p.normalize());
                    nodes.len() as u32 - 1
                })
            }));
        }
    }
    TetMesh::new(nodes, tets).unwrap()
}

#[test]
fn concentric_spheres_converge_with_the_square_of_the_mesh_size() {
    let exact = 4.0 * std::f64::consts::PI * VACUUM_PERMITTIVITY * (0.5 * 1.0 / 0.5) / 8.0;
    let error = |cells| {
        let on = |radius: f64| move |p: DVec3| (p.length() - radius).abs() < 1e-9;
        let mesh = shell_octant(cells);
        let elements = mesh.tets().len();
        let c = capacitance(mesh, on(1.0), on(0.5));
        print("spheres", elements, c, exact);
        c / exact - 1.0
    };
    let errors = [6, 12, 24].map(error);
    assert!(errors[2].abs() < 4e-3, "{errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.7..2.3).contains(&order), "order {order} from {errors:?}");
    }
}
