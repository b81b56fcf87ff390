//! Links at the rims of thin electrodes: few cells give what many give, wherever the outline lies.

use crate::common::{GROUNDED, three_stripes, to};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Material, RelativePermittivity};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{ElectrodeNodes, FREE, GROUND, Sensor, SensorDesign, Substrate, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

/// A grounded box three times as large as the electrodes in it, which are about 1 m wide.
const BOX: Aabb = Aabb { min: DVec3::splat(-1.5), max: DVec3::splat(1.5) };

fn sensor(outline: Outline, cells: [usize; 3]) -> Sensor {
    let electrodes = vec![Electrode { name: "E".to_owned(), outline, z: 0.0 }];
    let design = SensorDesign { domain: BOX, electrodes, substrate: None, wall: Wall::Grounded };
    Sensor::on_lattice(&design, &Lattice::uniform(BOX, cells).unwrap()).unwrap()
}

fn capacitance(sensor: Sensor) -> f64 {
    Simulator::new(sensor, vec![], to(1e-7)).unwrap().base().get(0, 0)
}

fn square(size: f64) -> Outline {
    Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(size) }
}

fn turned_square(degrees: f64) -> Outline {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(DVec2::from);
    Outline::Polygon(corners.map(|corner| DVec2::from_angle(degrees.to_radians()).rotate(corner)).to_vec())
}

/// What the square has by another method, and converges to with all refinements tried, in farads.
const SQUARE: f64 = 51.929e-12;

#[test]
fn squares_of_few_cells_have_the_capacitance_of_squares_of_many() {
    for (across, links, held) in [(4, 1e-3, 0.2), (8, 5e-4, 0.1), (16, 3e-4, 0.05)] {
        let sensor = sensor(square(1.0), [3 * across; 3]);
        let error = capacitance(sensor.clone()) / SQUARE - 1.0;
        assert!(error.abs() < links, "{across} cells: {error}");
        let error = capacitance(sensor.with_rims_held()) / SQUARE - 1.0;
        assert!(error > held, "{across} cells, held: {error}");
    }
}

#[test]
fn flat_and_high_cells_do_as_well() {
    for (layers, allowed) in [(96, 2e-3), (48, 1e-3), (24, 1e-3), (12, 2e-3), (8, 5e-3)] {
        let error = capacitance(sensor(square(1.0), [24, 24, layers])) / SQUARE - 1.0;
        assert!(error.abs() < allowed, "{layers} layers: {error}");
    }
}

#[test]
fn outlines_need_not_follow_the_lattice() {
    for degrees in [10.0, 26.565, 30.0, 45.0] {
        let error = capacitance(sensor(turned_square(degrees), [48; 3])) / SQUARE - 1.0;
        assert!(error.abs() < 0.01, "{degrees} degrees: {error}");
    }
    let disk = |radius| Outline::Disk { center: DVec2::new(0.011, 0.023), radius };
    let [coarse, fine] = [8, 16].map(|across| capacitance(sensor(disk(0.5), [3 * across; 3])));
    assert!((coarse / fine - 1.0).abs() < 5e-3, "disk: {coarse} {fine}");
}

/// Corners count the same wherever they are between nodes.
#[test]
fn squares_may_lie_anywhere_between_the_nodes() {
    for (x, y) in [(0.0, 0.5), (0.25, 0.25), (0.25, 0.5), (0.5, 0.5), (0.125, 0.375)] {
        let center = DVec2::new(x, y) / 8.0;
        let displaced = Outline::Rectangle { center, size: DVec2::ONE };
        // Nearer to a wall it has up to 0.03 % more.
        let error = capacitance(sensor(displaced, [24; 3])) / SQUARE - 1.0;
        assert!((-1e-3..4e-3).contains(&error), "{x} {y}: {error}");
    }
}

/// Capacitances of another method, of a board of 4.4 that is half a cell, one cell or two cells thick, with air or a shield
/// below it, 8 cells across. `examples/accuracy/rims.rs` has more.
#[test]
fn boards_may_be_as_thin_as_cells() {
    let cases = [
        (0.0625, false, 68.766e-12),
        (0.125, false, 80.010e-12),
        (0.25, false, 97.156e-12),
        (0.0625, true, 732.6e-12),
        (0.125, true, 416.0e-12),
        (0.25, true, 257.12e-12),
    ];
    for (thickness, grounded_back, expected) in cases {
        let board = Substrate {
            thickness,
            relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
            size: DVec2::splat(3.0),
            grounded_back,
        };
        let electrodes = vec![Electrode { name: "E".to_owned(), outline: square(1.0), z: 0.0 }];
        let design = SensorDesign { domain: BOX, electrodes, substrate: Some(board), wall: Wall::Grounded };
        let equal: Vec<f64> = (0..=24).map(|k| -1.5 + 0.125 * f64::from(k)).collect();
        let mut heights = equal.clone();
        heights.push(-thickness);
        heights.sort_by(f64::total_cmp);
        heights.dedup();
        let lattice = Lattice::new([equal.clone(), equal, heights]).unwrap();
        let error = capacitance(Sensor::on_lattice(&design, &lattice).unwrap()) / expected - 1.0;
        assert!(error.abs() < 2e-3, "{thickness} {grounded_back}: {error}");
    }
}

/// In steps of a fortieth of a cell, over two cells.
#[test]
fn capacitances_grow_smoothly_with_the_electrode() {
    let values: Vec<f64> =
        (0..80).map(|k| capacitance(sensor(square(0.9 + 0.00625 * f64::from(k)), [24; 3]))).collect();
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = (values[79] - values[0]) / 79.0;
    assert!(steps.iter().all(|step| (0.5 * mean..2.0 * mean).contains(step)), "{mean:e}: {steps:?}");
}

/// References of another method, in fF, with an error of 0.1 %.
#[test]
fn stripes_have_the_capacitances_of_the_references() {
    let design = three_stripes();
    let lattice = design.lattice_of_spacing(2.5e-3, 1.3).unwrap();
    let on_lattice = Sensor::on_lattice(&design, &lattice).unwrap();
    let nodes_of = |terminal: u16| -> Vec<u32> {
        (0..)
            .zip(on_lattice.owners())
            .filter(|(_, owner)| **owner == terminal)
            .map(|(node, _)| node)
            .collect()
    };
    let names = on_lattice.electrode_names().iter().cloned().zip(1..);
    let sheets = names.map(|(name, t)| (name, ElectrodeNodes::Nodes(nodes_of(t)))).collect();
    let off_lattice = Sensor::on_mesh(lattice.to_tet_mesh().unwrap(), &nodes_of(GROUND), sheets).unwrap();
    assert_eq!(off_lattice.rim().len(), on_lattice.rim().len());
    for sensor in [on_lattice, off_lattice] {
        let simulator = Simulator::new(sensor, vec![], to(1e-6)).unwrap();
        for (i, j, reference) in [(0, 0, 2912.15), (1, 1, 3261.0), (0, 1, -947.04), (0, 2, -135.58)] {
            let error = simulator.base().get(i, j) * 1e15 / reference - 1.0;
            assert!((-0.005..0.02).contains(&error), "C{i}{j}: {error}");
        }
    }
}

/// Cells of 30,000 tetrahedra are 6.8 mm high above the electrodes, and each has three rows of nodes along it, two of them at its rims.
/// While links there knew nothing of conductors that are closer, what a plate changes 1 mm away was 31 % too small, and 11 % at 4 mm. Those of
/// 9,000 are 24 mm high above rows that are 10 mm apart: a rule for flat cells alone left 44 and 24 %.
#[test]
fn a_conductor_closer_than_a_cell_sees_all_of_an_electrode() {
    let design = three_stripes();
    let lattice = |design: &SensorDesign, tets| design.lattice(tets).unwrap();
    let changes = |sensor: Sensor| {
        let mut simulator = Simulator::new(sensor, vec![GROUNDED], to(1e-6)).unwrap();
        let mut plate = Solids::new(&[Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) }]).unwrap();
        [1e-3, 2e-3, 4e-3].map(|gap| {
            plate.place(&[Pose::at(DVec3::new(0.0, 0.0, gap + 0.01))]).unwrap();
            let _ = simulator.step(&plate).unwrap();
            [0, 1, 2].map(|k| simulator.capacitance().get(k, k) - simulator.base().get(k, k))
        })
    };
    let fine = changes(Sensor::on_lattice(&design, &lattice(&design, 300_000)).unwrap());
    let coarse = lattice(&design, 30_000);
    let on_lattice = Sensor::on_lattice(&design, &coarse).unwrap();
    // Links lead to nodes a cell outside of an outline, too, which are not the sheet's.
    let within = on_lattice.clone().with_rims_held();
    let nodes_of = |terminal: u16| -> Vec<u32> {
        let held = (0..).zip(within.terminals());
        held.filter(|(_, holder)| **holder == terminal).map(|(node, _)| node).collect()
    };
    let ground = nodes_of(GROUND);
    let on_mesh = |lattice: &Lattice, electrodes: Vec<ElectrodeNodes>| {
        let named =
            electrodes.into_iter().zip(&design.electrodes).map(|(nodes, of)| (of.name.clone(), nodes));
        Sensor::on_mesh(lattice.to_tet_mesh().unwrap(), &ground, named.collect()).unwrap()
    };
    let sheets =
        on_mesh(&coarse, (1..=3).map(|terminal| ElectrodeNodes::Nodes(nodes_of(terminal))).collect());
    // Outlines lie between the nodes of the same lattice moved along y, walls and all but for the nodes in the electrodes' plane.
    let [xs, ys, zs] = coarse.axes().clone();
    let last = ys.len() - 1;
    let moved = ys.iter().enumerate().map(|(k, y)| if k == 0 || k == last { *y } else { y + 3e-3 }).collect();
    let moved = Lattice::new([xs, moved, zs]).unwrap();
    let cut = on_mesh(&moved, design.electrodes.iter().cloned().map(ElectrodeNodes::Shape).collect());
    let coarser = Sensor::on_lattice(&design, &lattice(&design, 9_000)).unwrap();
    let cases = [
        ("lattice", on_lattice.clone(), 0.03, &[0, 1, 2][..]),
        ("coarser", coarser, 0.05, &[0, 1, 2]),
        ("tetrahedra", on_lattice.off_lattice(), 0.03, &[0, 1, 2]),
        ("cut", cut, 0.05, &[0, 1, 2]),
        // Their links make the middle one, between two others a cell away, too strong by a fifth wherever the plate is.
        ("sheets", sheets, 0.08, &[0, 2]),
    ];
    for (name, sensor, most, electrodes) in cases {
        for (found, exact) in changes(sensor).into_iter().zip(fine) {
            for &k in electrodes {
                let error = found[k] / exact[k] - 1.0;
                assert!(error.abs() < most, "{name}, electrode {k}: {error:.3}");
            }
        }
    }
}

/// All weights are those of vacuum times the permittivity, links included.
#[test]
fn a_scene_filled_with_a_dielectric_multiplies_every_capacitance() {
    let permittivity = RelativePermittivity::new(50.0).unwrap();
    let sensor = sensor(square(1.0), [12; 3]);
    let mut simulator = Simulator::new(sensor, vec![Material::Dielectric(permittivity)], to(1e-9)).unwrap();
    let view = OrthographicView { domain: BOX, width: 16, height: 16 };
    let mut depth = DepthLayers::empty(view, 1);
    let (front, back) = depth.layer_mut(0);
    front.fill(-2.0);
    back.fill(2.0);
    let _ = simulator.step(&depth).unwrap();
    let ratio = simulator.capacitance().get(0, 0) / simulator.base().get(0, 0);
    assert!((ratio / 50.0 - 1.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn nodes_at_the_rim_are_free_and_the_electrodes() {
    let sensor = sensor(square(1.0), [12; 3]);
    assert_eq!(sensor.rim().len(), 16);
    for link in sensor.rim() {
        let node = link.node as usize;
        assert!(sensor.terminals()[node] == FREE && sensor.owners()[node] == 1 && link.inside);
    }
    let held = sensor.with_rims_held();
    assert_eq!(held.terminals(), held.owners());
    assert_eq!(held.terminals().iter().filter(|&&terminal| terminal == 1).count(), 25);
}
