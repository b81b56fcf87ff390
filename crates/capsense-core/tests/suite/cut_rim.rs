//! Thin electrodes by shape on meshes whose edges do not follow the outline.

use crate::common::{Dice, to};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;

/// A grounded box three times as large as the electrode in it, which is about 1 m wide.
const BOX: Aabb = Aabb { min: DVec3::splat(-1.5), max: DVec3::splat(1.5) };

/// The square of 1 m, in farads, as in `tests/suite/rim.rs`; one turned by 20 degrees has 0.03 % more.
const SQUARE: f64 = 51.929e-12;

/// Coordinates from -1.5 to 1.5, `across` to a metre, one of which is `phase` cells before -0.5.
fn axis(across: f64, phase: f64) -> Vec<f64> {
    let step = 1.0 / across;
    let first = -0.5 - phase * step;
    let inner = (-(across as i32) - 2..=3 * across as i32 + 2).map(|k| first + f64::from(k) * step);
    let inner = inner.filter(|x| x.abs() < 1.5 - 0.5 * step);
    [-1.5].into_iter().chain(inner).chain([1.5]).collect()
}

/// Kuhn tetrahedra whose nodes are moved by up to a part of a cell; those of the walls and of the plane stay in them.
fn mesh(across: f64, phase: [f64; 2], jitter: f64) -> TetMesh {
    let axes =
        [axis(across, phase[0]), axis(across, phase[1]), axis(across, (-0.5 * across).rem_euclid(1.0))];
    let lattice = Lattice::new(axes).unwrap().to_tet_mesh().unwrap();
    let mut dice = Dice(1 + (1e3 * (across + phase[0])) as u64);
    let mut moved = |node: &DVec3| {
        let free = DVec3::new(1.0, 1.0, if node.z.abs() < 1e-9 { 0.0 } else { 1.0 });
        let to = DVec3::from_array([(); 3].map(|()| dice.between(-jitter, jitter))) / across;
        if node.abs().max_element() < 1.499 { *node + free * to } else { *node }
    };
    let nodes = lattice.nodes().iter().map(&mut moved).collect();
    TetMesh::new(nodes, lattice.tets().to_vec()).unwrap()
}

fn walls(mesh: &TetMesh) -> Vec<u32> {
    let on_wall = |node: &DVec3| node.abs().max_element() > 1.5 - 1e-9;
    mesh.nodes().iter().zip(0..).filter(|(node, _)| on_wall(node)).map(|(_, index)| index).collect()
}

fn sensor(mesh: TetMesh, outline: &Outline) -> Sensor {
    let shape = Electrode { name: "E".to_owned(), outline: outline.clone(), z: 0.0 };
    let ground = walls(&mesh);
    Sensor::on_mesh(mesh, &ground, vec![("E".to_owned(), ElectrodeNodes::Shape(shape))]).unwrap()
}

fn capacitance(sensor: Sensor) -> f64 {
    Simulator::new(sensor, vec![], to(1e-6)).unwrap().base().get(0, 0)
}

fn turned_square(degrees: f64) -> Outline {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(DVec2::from);
    Outline::Polygon(corners.map(|corner| DVec2::from_angle(degrees.to_radians()).rotate(corner)).to_vec())
}

fn square() -> Outline {
    Outline::Rectangle { center: DVec2::ZERO, size: DVec2::ONE }
}

fn disk() -> Outline {
    Outline::Disk { center: DVec2::new(0.011, 0.023), radius: 0.5 }
}

/// Of the disk, by the links of a fine lattice.
fn disk_on_lattice(cells: usize) -> f64 {
    let electrodes = vec![Electrode { name: "E".to_owned(), outline: disk(), z: 0.0 }];
    let design = SensorDesign { domain: BOX, electrodes, substrate: None, wall: Wall::Grounded };
    capacitance(Sensor::on_lattice(&design, &Lattice::uniform(BOX, [cells; 3]).unwrap()).unwrap())
}

/// Where in a cell the outline lies; together with half a cell more across, on both sides.
const PHASES: [[f64; 2]; 4] = [[0.0, 0.0], [0.25, 0.25], [0.5, 0.5], [0.75, 0.25]];

/// Mean, smallest and largest error over places of the outline in its cells.
fn errors(outline: &Outline, reference: f64, across: f64, jitter: f64) -> [f64; 3] {
    let places = [across, across + 0.5].into_iter().flat_map(|across| PHASES.map(|phase| (across, phase)));
    let errors = places
        .map(|(across, phase)| capacitance(sensor(mesh(across, phase, jitter), outline)) / reference - 1.0);
    let all: Vec<f64> = errors.collect();
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [all.iter().sum::<f64>() / all.len() as f64, least, most]
}

/// Errors over places of the outline, for meshes with so many cells across as the variable `CELLS` says. With 8 and 16 it
/// prints what docs/electrodes.md says.
#[test]
fn errors_over_places_are_small() {
    let cells: f64 = std::env::var("CELLS").map_or(4.0, |cells| cells.parse().unwrap());
    let disk_reference = disk_on_lattice(if cells > 4.0 { 96 } else { 48 });
    for (name, outline, reference) in [
        ("square", square(), SQUARE),
        ("turned by 20 degrees", turned_square(20.0), SQUARE),
        ("disk", disk(), disk_reference),
    ] {
        for jitter in [0.0, 0.15] {
            let [mean, low, high] = errors(&outline, reference, cells, jitter);
            let [in_mean, least, most] = [mean, low, high].map(|e| 100.0 * e);
            println!("{name}, moved by {jitter}, {cells} cells: {in_mean:.2} ({least:.2} to {most:.2})");
            assert!(
                mean.abs() < 0.04 && low.abs().max(high.abs()) < 0.06,
                "{name} {jitter}: {mean} {low} {high}"
            );
        }
    }
}

/// Without links, squares are off by up to 28, 12 and 6 %, turned ones by 36, 19 and 10 %.
#[test]
fn outlines_may_lie_anywhere_in_a_mesh() {
    for (across, allowed) in [(4.0, 0.05), (8.0, 0.015), (16.0, 0.005)] {
        for (outline, phase) in
            [(square(), [0.5, 0.5]), (square(), [0.75, 0.25]), (turned_square(20.0), [0.1, 0.3])]
        {
            let error = capacitance(sensor(mesh(across, phase, 0.15), &outline)) / SQUARE - 1.0;
            assert!(error.abs() < allowed, "{across} cells, {phase:?}: {error}");
        }
    }
    let [coarse, fine] =
        [8.0, 16.0].map(|across| capacitance(sensor(mesh(across, [0.3, 0.6], 0.15), &disk())));
    assert!((coarse / fine - 1.0).abs() < 0.01, "disk: {coarse} {fine}");
}

/// Where it lies in a cell makes little difference, and less on finer meshes. The electrode is moved, not the mesh.
#[test]
fn capacitances_hardly_depend_on_the_place_in_a_cell() {
    for (across, steps, allowed) in [(8.0, 8, 0.012), (16.0, 3, 0.004)] {
        let mesh = mesh(across, [0.0, 0.0], 0.15);
        let values: Vec<f64> = (0..=steps)
            .map(|k| {
                let center = DVec2::new(1.0, 0.6) * f64::from(k) / (f64::from(steps) * across);
                let moved = Outline::Rectangle { center, size: DVec2::ONE };
                capacitance(sensor(mesh.clone(), &moved))
            })
            .collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(0.0, f64::max);
        assert!(most / least - 1.0 < allowed, "{across} cells: {} {values:?}", most / least - 1.0);
    }
}

/// In steps of a twentieth of a cell, over two cells: none is further from the mean than two of them.
#[test]
fn steps_of_a_growing_electrode_are_alike() {
    let mesh = mesh(8.0, [0.0, 0.0], 0.15);
    let values: Vec<f64> = (0..40)
        .map(|k| {
            let size = DVec2::splat(0.9 + 0.0125 * f64::from(k));
            capacitance(sensor(mesh.clone(), &Outline::Rectangle { center: DVec2::ZERO, size }))
        })
        .collect();
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = (values[39] - values[0]) / 39.0;
    assert!(steps.iter().all(|step| (-mean..3.0 * mean).contains(step)), "{mean:e}: {steps:?}");
}

/// By symmetry no field crosses the plane outside of the electrode, so both halves are as in vacuum.
#[test]
fn a_substrate_below_counts_by_the_mean_of_both_sides() {
    for (jitter, allowed) in [(0.0, 1e-4), (0.15, 0.01)] {
        let vacuum = mesh(8.0, [0.3, 0.6], jitter);
        let below: Vec<bool> = (0..vacuum.tets().len()).map(|e| vacuum.centroid(e).z < 0.0).collect();
        let board = vacuum.clone().with_permittivity(|e| if below[e] { 4.4 } else { 1.0 }).unwrap();
        let [vacuum, board] = [vacuum, board].map(|mesh| capacitance(sensor(mesh, &square())));
        assert!((board / vacuum / 2.7 - 1.0).abs() < allowed, "{jitter}: {board:e} {vacuum:e}");
    }
}

/// Half of a sheet's field is there where the mesh ends in its plane.
#[test]
fn a_sheet_at_the_surface_of_the_mesh_has_half_the_capacitance() {
    let whole = mesh(8.0, [0.3, 0.6], 0.15);
    let above: Vec<[u32; 4]> =
        (0..whole.tets().len()).filter(|&e| whole.centroid(e).z > 0.0).map(|e| whole.tets().at(e)).collect();
    let first = whole.nodes().iter().position(|node| node.z > -1e-9).unwrap() as u32;
    let nodes = whole.nodes()[first as usize..].to_vec();
    let half = TetMesh::new(nodes, above.iter().map(|tet| tet.map(|node| node - first)).collect()).unwrap();
    let error = 2.0 * capacitance(sensor(half, &square())) / SQUARE - 1.0;
    assert!(error.abs() < 0.015, "{error}");
}

/// An outline that edges follow is the sheet that its nodes are.
#[test]
fn outlines_along_edges_are_the_sheets_of_their_nodes() {
    let mesh = mesh(8.0, [0.0, 0.0], 0.0);
    let by_shape = sensor(mesh.clone(), &square());
    let nodes =
        (0..).zip(by_shape.owners()).filter(|(_, owner)| **owner == 1).map(|(node, _)| node).collect();
    let ground = walls(&mesh);
    let by_nodes =
        Sensor::on_mesh(mesh, &ground, vec![("E".to_owned(), ElectrodeNodes::Nodes(nodes))]).unwrap();
    assert_eq!(by_shape.rim(), by_nodes.rim());
    let [by_shape, by_nodes] = [by_shape, by_nodes].map(capacitance);
    assert!(
        (by_shape / by_nodes - 1.0).abs() < 1e-9 && (by_shape / SQUARE - 1.0).abs() < 0.015,
        "{by_shape:e}"
    );
}
