//! Open walls: what stands for the space beyond them, against closed forms and against larger domains.

use crate::common::{
    DOMAIN, FLOATING, GROUNDED, dielectric, oracle, rectangle, relative_error, three_stripes, to,
    with_moved_nodes,
};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Material, RelativePermittivity};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{
    ElectrodeNodes, FREE, GROUND, Sensor, SensorDesign, SensorError, Substrate, Wall,
};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::{Preconditioner, SolverOptions};
use capsense_core::units::VACUUM_PERMITTIVITY;
use std::collections::HashMap;
use std::f64::consts::PI;

/// C/4πε₀ of a square plate of side 1 in free space (Wintle 2004).
const SQUARE: f64 = 0.366_789_2;

const BAR: DVec3 = DVec3::new(0.15, 0.15, 0.02);

fn capacitance(sensor: Sensor) -> f64 {
    Simulator::new(sensor, vec![], to(1e-6)).unwrap().base().get(0, 0)
}

/// The relative error of C of a square of side 1 in the middle of a cube.
fn error_of_square(wall: Wall, half_width: f64) -> f64 {
    let domain = Aabb { min: DVec3::splat(-half_width), max: DVec3::splat(half_width) };
    let design =
        SensorDesign { domain, electrodes: vec![rectangle("E", [0.0; 2], [1.0; 2])], substrate: None, wall };
    let lattice = design.lattice_of_spacing(1.0 / 16.0, 1.2).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    capacitance(sensor) / (4.0 * PI * VACUUM_PERMITTIVITY * SQUARE) - 1.0
}

#[test]
fn a_square_plate_has_the_capacitance_that_it_has_in_free_space() {
    for (half_width, allowed) in [(1.0, 0.006), (1.5, 0.005), (3.0, 0.012)] {
        let [open, grounded] = [Wall::Open, Wall::Grounded].map(|wall| error_of_square(wall, half_width));
        println!("{half_width}: open {open:+.5}, grounded {grounded:+.5}");
        assert!(open.abs() < allowed, "{half_width}: {open}");
        assert!(grounded > 0.1, "{half_width}: {grounded}");
    }
}

/// The shell between the spheres of radius 0.5 and 1: eight octants, each mapped from the shell of a cube.
fn shell(cells: usize) -> TetMesh {
    let lattice = Lattice::uniform(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, [cells; 3]).unwrap();
    let cube = lattice.to_tet_mesh().unwrap();
    let (mut nodes, mut tets) = (Vec::new(), Vec::new());
    let mut index = HashMap::new();
    for octant in 0..8 {
        let signs = DVec3::from_array([1, 2, 4].map(|bit| if octant & bit == 0 { 1.0 } else { -1.0 }));
        for tet in cube.tets().iter() {
            let places = tet.map(|node| cube.nodes()[node as usize]);
            if places.iter().all(|place| place.max_element() >= 0.5 - 1e-12) {
                let mut tet = places.map(|place| {
                    let at = signs * place;
                    let key = (2.0 * cells as f64 * at).round().as_i64vec3();
                    *index.entry(key).or_insert_with(|| {
                        nodes.push(at.abs().max_element() * at.normalize());
                        nodes.len() as u32 - 1
                    })
                });
                if signs.element_product() < 0.0 {
                    tet.swap(0, 1);
                }
                tets.push(tet);
            }
        }
    }
    TetMesh::new(nodes, tets).unwrap()
}

fn nodes_where(mesh: &TetMesh, holds: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..).zip(mesh.nodes()).filter(|(_, place)| holds(**place)).map(|(node, _)| node).collect()
}

#[test]
fn a_sphere_has_the_capacitance_that_it_has_in_free_space() {
    let mesh = shell(12);
    let on = |radius: f64| nodes_where(&mesh, |place| (place.length() - radius).abs() < 1e-9);
    let sensor = |wall| {
        let inner = vec![("E".to_owned(), ElectrodeNodes::Nodes(on(0.5)))];
        Sensor::on_mesh_within(wall, mesh.clone(), &on(1.0), inner).unwrap()
    };
    let unit = 4.0 * PI * VACUUM_PERMITTIVITY;
    let open = capacitance(sensor(Wall::Open)) / (0.5 * unit) - 1.0;
    let grounded = capacitance(sensor(Wall::Grounded)) / unit - 1.0;
    println!("open {open:+.5}, grounded {grounded:+.5}");
    assert!(open.abs() < 0.012, "{open}");
    assert!(grounded.abs() < 0.02, "{grounded}");
}

/// The stripes on one lattice, continued by growing cells to the walls of a larger domain.
fn stripes_within(wall: Wall, scale: f64) -> Sensor {
    let domain = Aabb { min: scale * DOMAIN.min, max: scale * DOMAIN.max };
    let mut axes = three_stripes().lattice(60_000).unwrap().axes().clone();
    for (axis, planes) in axes.iter_mut().enumerate() {
        for end in [domain.max[axis], domain.min[axis]] {
            let count = planes.len();
            let (last, step) = (planes[count - 1], (planes[count - 1] - planes[count - 2]).abs());
            let steps = (1.0 + 0.3 * (end - last).abs() / step).ln() / 1.3_f64.ln();
            let steps = steps.ceil() as i32;
            planes.extend(
                (1..=steps)
                    .map(|k| last + (end - last) * (1.3_f64.powi(k) - 1.0) / (1.3_f64.powi(steps) - 1.0)),
            );
            planes.reverse();
        }
    }
    let design = SensorDesign { domain, wall, ..three_stripes() };
    Sensor::on_lattice(&design, &Lattice::new(axes).unwrap()).unwrap()
}

fn box_at(size: DVec3, place: DVec3) -> Solids {
    let mut solids = Solids::new(&[Shape::Box { size }]).unwrap();
    solids.place(&[Pose::at(place)]).unwrap();
    solids
}

/// Change of C by a bar, all entries.
fn change(sensor: &Sensor, material: Material, height: f64) -> Vec<f64> {
    let mut simulator = Simulator::new(sensor.clone(), vec![material], to(1e-6)).unwrap();
    let _ = simulator.step(&box_at(BAR, DVec3::new(0.0, 0.0, height + 0.01))).unwrap();
    let [now, base] = [simulator.capacitance(), simulator.base()].map(entries);
    now.iter().zip(base).map(|(now, base)| now - base).collect()
}

fn entries(capacitance: &CapacitanceMatrix) -> Vec<f64> {
    capacitance.rows().flatten().copied().collect()
}

/// The largest difference in parts of the largest value.
fn apart(values: &[f64], limits: &[f64]) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, v| most.max(v.abs()));
    largest(&mut values.iter().zip(limits).map(|(a, b)| a - b)) / largest(&mut limits.iter().copied())
}

#[test]
fn an_open_wall_may_be_near() {
    let near = [Wall::Open, Wall::Grounded].map(|wall| stripes_within(wall, 1.0));
    let far = stripes_within(Wall::Open, 4.0);
    for (material, allowed) in [(GROUNDED, 0.015), (FLOATING, 0.05)] {
        for height in [0.02, 0.05, 0.1] {
            let limits = change(&far, material, height);
            let [open, grounded] = [0, 1].map(|wall| apart(&change(&near[wall], material, height), &limits));
            println!("{material:?} at {height}: open {open:.4}, grounded {grounded:.4}");
            assert!(open < allowed, "{material:?} at {height}: {open}");
            assert!(grounded > 4.0 * open, "{material:?} at {height}: {grounded} {open}");
        }
    }
}

/// A body that is so thick that it holds nodes of coarse lattices too.
const BLOCK: DVec3 = DVec3::new(0.15, 0.15, 0.1);

/// Into the wall beside, and out through it.
const WAY: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.08],
    [0.1, 0.0, 0.08],
    [0.2, 0.0, 0.08],
    [0.23, 0.02, 0.08],
    [0.23, 0.02, 0.12],
    [0.3, 0.0, 0.2],
    [0.0, 0.0, 0.2],
];

/// A design of few nodes.
fn small(wall: Wall) -> Sensor {
    let design = three_stripes();
    Sensor::on_lattice(&SensorDesign { wall, ..design.clone() }, &design.lattice(12_000).unwrap()).unwrap()
}

/// The same on a mesh with obtuse angles.
fn moved() -> Sensor {
    let sensor = with_moved_nodes(&small(Wall::Grounded));
    let owned_by = |terminal: u16| -> Vec<u32> {
        (0..).zip(sensor.owners()).filter(|(_, owner)| **owner == terminal).map(|(node, _)| node).collect()
    };
    let names = sensor.electrode_names().iter().cloned().zip(1..);
    let electrodes =
        names.map(|(name, terminal)| (name, ElectrodeNodes::Nodes(owned_by(terminal)))).collect();
    Sensor::on_mesh_within(Wall::Open, sensor.mesh().clone(), &owned_by(GROUND), electrodes).unwrap()
}

#[test]
fn all_solvers_agree_on_bodies_that_stick_out_of_the_wall() {
    let lattice = small(Wall::Open);
    let meshes = [lattice.clone().off_lattice(), lattice];
    for (material, sensor) in
        [GROUNDED, FLOATING, dielectric(5.0)].into_iter().flat_map(|m| meshes.iter().map(move |s| (m, s)))
    {
        let mut truth = oracle(sensor, &[material]);
        let solvers = [Preconditioner::Multigrid, Preconditioner::Direct, Preconditioner::Ic0];
        let mut tested = solvers.map(|preconditioner| {
            let options = SolverOptions { preconditioner, ..to(1e-5) };
            Simulator::new(sensor.clone(), vec![material], options).unwrap()
        });
        for place in WAY {
            let block = box_at(BLOCK, DVec3::from(place));
            let _ = truth.step(&block).unwrap();
            for simulator in &mut tested {
                let _ = simulator.step(&block).unwrap();
                let error = relative_error(simulator.capacitance(), truth.capacitance());
                // What is exact would show if a link through the wall were forgotten within the block.
                let allowed = if simulator.preconditioner() == Preconditioner::Direct { 1e-10 } else { 3e-5 };
                assert!(error < allowed, "{material:?}, {:?}: {error}", simulator.preconditioner());
            }
        }
        let fresh = Simulator::new(sensor.clone(), vec![material], to(1e-5)).unwrap();
        for simulator in &mut tested[..1] {
            let _ = simulator.step(&box_at(BLOCK, DVec3::splat(9.0))).unwrap();
            assert_eq!(simulator.matrix().to_csr(), fresh.matrix().to_csr(), "the block left a trace");
        }
    }
}

#[test]
fn what_does_not_end_on_electrodes_ends_on_ground() {
    let lattice = small(Wall::Open);
    for sensor in [moved(), lattice.clone().off_lattice(), lattice] {
        for material in [GROUNDED, FLOATING] {
            let mut simulator = oracle(&sensor, &[material]);
            for place in WAY {
                let _ = simulator.step(&box_at(BLOCK, DVec3::from(place))).unwrap();
                let c = simulator.capacitance();
                for (row, to_ground) in simulator.capacitance_to_ground().unwrap().into_iter().enumerate() {
                    let sum: f64 = (0..c.size()).map(|column| c.get(row, column)).sum();
                    assert!(to_ground < 0.0 && (sum + to_ground).abs() < 1e-9 * c.get(row, row), "{sum}");
                    for column in 0..c.size() {
                        assert!(c.get(row, column).to_bits() == c.get(column, row).to_bits());
                        assert!((c.get(row, column) > 0.0) == (row == column));
                    }
                }
            }
        }
    }
}

#[test]
fn a_grounded_wall_is_what_it_was() {
    let design = three_stripes();
    let lattice = design.lattice(5_000).unwrap();
    let grounded =
        Sensor::on_lattice(&SensorDesign { wall: Wall::Grounded, ..design.clone() }, &lattice).unwrap();
    assert!(Sensor::on_lattice(&design, &lattice).unwrap() == grounded);
    assert_eq!(grounded.wall(), Wall::Grounded);
    let open = Sensor::on_lattice(&SensorDesign { wall: Wall::Open, ..design.clone() }, &lattice).unwrap();
    assert_eq!(open.wall(), Wall::Open);
    assert!(!open.terminals().contains(&GROUND));
    // Without links its wall is grounded again.
    let [opened, grounded] = [open, grounded].map(|sensor| sensor.with_rims_held());
    let is_grounded = |terminals: &[u16]| terminals.iter().map(|&t| t == GROUND).collect::<Vec<_>>();
    assert!(is_grounded(opened.terminals()) == is_grounded(grounded.terminals()));
}

#[test]
fn a_shield_that_reaches_an_open_wall_stays_grounded() {
    let board = Substrate {
        thickness: 0.01,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::splat(0.5),
        grounded_back: true,
    };
    let design = SensorDesign { substrate: Some(board), ..three_stripes() };
    let lattice = design.lattice(20_000).unwrap();
    let sensor = Sensor::on_lattice(&SensorDesign { wall: Wall::Open, ..design.clone() }, &lattice).unwrap();
    for (place, &terminal) in sensor.mesh().nodes().iter().zip(sensor.terminals()) {
        assert_eq!(terminal == GROUND, board.is_on_back(*place, 1e-9), "{place}");
    }
    let simulator = Simulator::new(sensor, vec![], to(1e-6)).unwrap();
    let c = simulator.base();
    let to_ground = simulator.capacitance_to_ground().unwrap();
    assert!((0..3).all(|row| -to_ground[row] > 0.5 * c.get(row, row)), "{to_ground:?}");
}

#[test]
fn only_the_outer_surface_of_a_mesh_is_opened() {
    let domain = Aabb { min: DVec3::ZERO, max: DVec3::splat(5.0) };
    let cells = Lattice::uniform(domain, [5; 3]).unwrap().to_tet_mesh().unwrap();
    let is_middle = |place: DVec3| (place - 2.5).abs().max_element() < 0.6;
    let is_kept = |tet: &[u32; 4]| !tet.iter().all(|&node| is_middle(cells.nodes()[node as usize]));
    let tets: Vec<[u32; 4]> = cells.tets().iter().filter(|tet| is_kept(tet)).collect();
    let mesh = TetMesh::new(cells.nodes().to_vec(), tets).unwrap();
    let is_outer = |place: DVec3| place.min_element() == 0.0 || place.max_element() == 5.0;
    let electrode = || vec![("E".to_owned(), ElectrodeNodes::Nodes(nodes_where(&mesh, |p| p == DVec3::ONE)))];
    let ground = nodes_where(&mesh, |place| is_outer(place) || is_middle(place));
    let sensor = Sensor::on_mesh_within(Wall::Open, mesh.clone(), &ground, electrode()).unwrap();
    for (&place, &terminal) in mesh.nodes().iter().zip(sensor.terminals()) {
        let expected = if is_middle(place) { GROUND } else { FREE };
        assert!(place == DVec3::ONE || terminal == expected, "{place}");
    }
    let hole = nodes_where(&mesh, is_middle);
    let refused = Sensor::on_mesh_within(Wall::Open, mesh.clone(), &hole, electrode());
    assert_eq!(refused, Err(SensorError::NoWall));
}
