//! The interface models: the capacitances that each gives, against exact ones, the oracle, the paper's method and other
//! meshes.

use crate::common::half_spaces::Convex;
use crate::common::{
    DIRECT, EXACT, FLOATING, GROUNDED, bar, conductor, depth_of_boxes, dielectric, on_other_mesh,
    on_three_meshes, relative_error, stripes_sensor, three_stripes,
};
use capsense_core::baseline::{CgOptions, PaperMethod};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::{SolveReport, SolverOptions};
use capsense_core::units::VACUUM_PERMITTIVITY;
use std::sync::LazyLock;

const OF_ELEMENTS: [Interface; 2] = [Interface::Centroid, Interface::VolumeFraction];
const ALL: [Interface; 3] = [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction];

static MESHES: LazyLock<[Sensor; 3]> = LazyLock::new(|| on_three_meshes(&stripes_sensor(6_000)));

fn simulator(
    interface: Interface,
    sensor: &Sensor,
    materials: &[Material],
    options: SolverOptions,
) -> Simulator {
    Simulator::with_interface(sensor.clone(), materials.to_vec(), options, interface).unwrap()
}

/// A factorisation and the usual solver.
struct SideBySide {
    interface: Interface,
    truth: Simulator,
    tested: Simulator,
}

impl SideBySide {
    fn new(interface: Interface, sensor: &Sensor, materials: &[Material]) -> Self {
        let truth = simulator(interface, sensor, materials, DIRECT);
        let tested = simulator(interface, sensor, materials, SolverOptions::default());
        Self { interface, truth, tested }
    }

    /// Both take the frame; the usual solver's error is allowed to be 1e-4.
    fn step(&mut self, solids: &Convex) -> SolveReport {
        let _ = self.truth.step(solids).unwrap();
        let report = self.tested.step(solids).unwrap().solve;
        let error = relative_error(self.tested.capacitance(), self.truth.capacitance());
        assert!(error < 1e-4, "{:?}: {error}, {report:?}", self.interface);
        report
    }
}

/// The pattern of jumps of C_11 over a sweep: the largest step in relation to the mean one.
fn roughness(interface: Interface, sensor: &Sensor, material: Material) -> f64 {
    let mut simulator = simulator(interface, sensor, &[material], DIRECT);
    let values: Vec<f64> = (0..60)
        .map(|step| {
            let centre = DVec3::new(0.01, 0.004, 0.1 - 0.25e-3 * f64::from(step));
            let body = Convex::turned(DVec3::new(0.08, 0.07, 0.05), DVec3::new(1.0, 2.0, 3.0), 0.3, centre);
            let _ = simulator.step(&body).unwrap();
            simulator.capacitance().get(0, 0)
        })
        .collect();
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    steps.iter().fold(0.0, |largest, step| f64::max(largest, (step / mean).abs()))
}

#[test]
fn volume_fractions_are_continuous_and_centroids_move_in_steps() {
    let design = three_stripes();
    let lattice = design.lattice_of_spacing(0.05, 1.3).unwrap();
    let [lattice, _, other] = on_three_meshes(&Sensor::on_lattice(&design, &lattice).unwrap());
    for sensor in [&lattice, &other] {
        let of = |interface, material| roughness(interface, sensor, material);
        let [edge, centroid, volume] = ALL.map(|interface| of(interface, dielectric(4.0)));
        println!("dielectric: {edge} {centroid} {volume}");
        assert!(edge < 4.0 && volume < 4.0 && centroid > 15.0, "{edge} {centroid} {volume}");
        let [edge, centroid, volume] = ALL.map(|interface| of(interface, GROUNDED));
        println!("grounded: {edge} {centroid} {volume}");
        assert!(edge < 4.0 && volume > 15.0 && centroid > 15.0, "{edge} {centroid} {volume}");
    }
}

/// Plates at z = 0 and z = 4 with insulated sides, with layers of unequal height.
fn plates(axes: [Vec<f64>; 3]) -> Sensor {
    let mesh = Lattice::new(axes).unwrap().to_tet_mesh().unwrap();
    let on = |z: f64| -> Vec<u32> {
        mesh.nodes().iter().zip(0..).filter(|(p, _)| p.z == z).map(|(_, node)| node).collect()
    };
    let (ground, electrode) = (on(0.0), vec![("E".to_owned(), ElectrodeNodes::Nodes(on(4.0)))]);
    Sensor::on_mesh(mesh, &ground, electrode).unwrap()
}

#[test]
fn slabs_along_lattice_planes_between_plates_are_exact() {
    let axes = [vec![0.0, 1.0, 2.5], vec![0.0, 0.5, 2.0], vec![0.0, 0.7, 1.0, 2.0, 3.1, 4.0]];
    let sensor = plates(axes);
    let farads = |material: Material, interface: Interface, from: f64, to: f64| {
        let mut simulator = simulator(interface, &sensor, &[material], EXACT);
        let slab = Aabb { min: DVec3::new(-9.0, -9.0, from), max: DVec3::new(9.0, 9.0, to) };
        let _ = simulator.step(&Convex::boxes(&[slab])).unwrap();
        simulator.capacitance().get(0, 0) / VACUUM_PERMITTIVITY
    };
    for interface in ALL {
        for (permittivity, from, to) in [(4.0, 1.0, 3.1), (80.0, -1.0, 2.0), (0.5, 0.7, 9.0)] {
            let thickness = f64::min(to, 4.0) - f64::max(from, 0.0);
            let exact = 5.0 / (4.0 - thickness + thickness / permittivity);
            let found = farads(dielectric(permittivity), interface, from, to);
            assert!((found / exact - 1.0).abs() < 1e-9, "{interface:?} {permittivity}: {found} {exact}");
        }
        for (material, exact) in [(GROUNDED, 5.0 / 0.9), (FLOATING, 5.0 / 1.9)] {
            let found = farads(material, interface, 1.0, 3.1);
            // Where a node lies on the surface, the edge rule leaves a thousandth of an edge before the conductor.
            let allowed = if interface == Interface::EdgeCut { 2e-3 } else { 1e-9 };
            assert!((found / exact - 1.0).abs() < allowed, "{interface:?} {material:?}: {found} {exact}");
        }
    }
}

/// Plates across x: the slab lies along the field, so that permittivities mix arithmetically.
#[test]
fn volume_fractions_along_the_field_mix_arithmetically() {
    let axes = [vec![0.0, 1.0, 2.0], vec![0.0, 1.0], vec![0.0, 1.3, 2.7, 4.0]];
    let sensor = plates(axes);
    for part in [0.2, 0.45, 0.8] {
        let mut simulator = simulator(Interface::VolumeFraction, &sensor, &[dielectric(3.0)], DIRECT);
        let slab = Aabb { min: DVec3::splat(-9.0), max: DVec3::new(2.0 * part, 9.0, 9.0) };
        let _ = simulator.step(&Convex::boxes(&[slab])).unwrap();
        let found = simulator.capacitance().get(0, 0) / VACUUM_PERMITTIVITY;
        let exact = 0.5 * (1.0 + 2.0 * part);
        assert!((found / exact - 1.0).abs() < 0.02, "{part}: {found} {exact}");
    }
}

#[test]
fn every_model_gives_a_maxwell_matrix_and_agrees_with_the_oracle() {
    let materials = [dielectric(40.0), GROUNDED, FLOATING, conductor(Connection::Capacitance(1e-12))];
    for interface in ALL {
        for sensor in &*MESHES {
            let mut both = SideBySide::new(interface, sensor, &materials);
            for step in 0..12 {
                let shift = 5e-3 * f64::from(step);
                let boxes =
                    [bar(0.02, shift - 0.1), bar(0.06, 0.1 - shift), bar(0.09, shift), bar(0.3, shift)];
                let _ = both.step(&Convex::boxes(&boxes));
                let c = both.truth.capacitance();
                for i in 0..3 {
                    assert!(c.get(i, i) > 0.0 && (0..3).all(|j| c.get(i, j) == c.get(j, i)));
                    if sensor.lattice().is_some() {
                        assert!((0..3).all(|j| j == i || c.get(i, j) < 0.0));
                        assert!((0..3).map(|j| c.get(i, j)).sum::<f64>() > 0.0);
                    }
                }
            }
        }
    }
}

/// Strong bodies that nothing holds, and one that may be found strong for its negative weights alone.
#[test]
fn islands_are_found_in_every_model() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            for permittivity in [80.0, 1e4, 1e6] {
                let mut both =
                    SideBySide::new(interface, sensor, &[dielectric(permittivity), dielectric(2.0)]);
                for step in 0..6 {
                    let shift = 4e-3 * f64::from(step);
                    let report = both.step(&Convex::boxes(&[bar(0.03, shift), bar(0.05, shift)]));
                    assert!(report.iterations < 40, "{interface:?} {permittivity}: {report:?}");
                }
            }
        }
    }
}

fn paper(sensor: &Sensor, permittivities: &[f64]) -> PaperMethod<f64> {
    let objects: Vec<_> = permittivities.iter().map(|p| RelativePermittivity::new(*p).unwrap()).collect();
    let options = CgOptions { relative_residual: 1e-11, ..CgOptions::PAPER };
    PaperMethod::new(sensor, &objects, options)
}

#[test]
fn centroids_seen_by_a_back_filling_camera_are_the_papers() {
    let permittivities = [80.0, 3.0];
    let materials = permittivities.map(dielectric);
    for sensor in &*MESHES {
        let mut paper = paper(sensor, &permittivities);
        let mut ours = simulator(Interface::Centroid, sensor, &materials, EXACT);
        for (pixels, height) in [([64, 64], 0.05), ([64, 64], 0.04), ([33, 20], 0.02)] {
            // Beside each other: of objects that hide each other the paper fills in only the nearer.
            let mut depth = depth_of_boxes(pixels, &[bar(height, -0.08), bar(0.03, 0.08)]);
            // A slanted front, which interpolation would smooth.
            let (front, back) = depth.layer_mut(0);
            for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
                if *front <= *back {
                    *front += 1e-3 * (pixel % pixels[0]) as f32;
                    *back = *front + 0.01;
                }
            }
            depth.back_fill();
            let _ = paper.step(&depth).unwrap();
            let _ = ours.step(&depth).unwrap();
            let (permittivity, _) = ours.occupancy().elements().unwrap();
            assert!(permittivity == paper.occupancy().permittivity(), "elements");
            let error = relative_error(ours.capacitance(), paper.capacitance());
            assert!(error < 1e-9, "{error}");
        }
    }
}

/// The same mesh under another name: an independent reference for the whole simulator.
#[test]
fn capacitances_are_those_of_a_mesh_with_these_permittivities() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let mut simulator = simulator(interface, sensor, &[dielectric(6.0)], DIRECT);
            let _ = simulator.step(&Convex::boxes(&[bar(0.033, 0.007)])).unwrap();
            let (permittivity, _) = simulator.occupancy().elements().unwrap();
            let mesh = sensor.mesh().clone().with_permittivity(|e| permittivity[e]).unwrap();
            let truth = Simulator::new(on_other_mesh(sensor, mesh), vec![], DIRECT).unwrap();
            let error = relative_error(simulator.capacitance(), truth.base());
            assert!(error < 1e-10, "{interface:?}: {error}");
        }
    }
}

/// A body that is no other than the air, far from a bar, must not change how the field around the bar's edges is taken.
#[test]
fn weak_dielectrics_leave_edges_of_conductors_elsewhere_as_they_are() {
    let sensor = stripes_sensor(6_000);
    let (bar, air) = (Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) }, Shape::Sphere { radius: 0.02 });
    let poses = [Pose::at(DVec3::new(0.01, 0.02, 0.063)), Pose::at(DVec3::new(-0.2, -0.2, 0.35))];
    let capacitances = |shapes: &[Shape], materials: &[Material]| {
        let mut solids = Solids::new(shapes).unwrap();
        solids.place(&poses[..shapes.len()]).unwrap();
        let mut simulator = simulator(Interface::EdgeCut, &sensor, materials, DIRECT);
        let _ = simulator.step(&solids).unwrap();
        simulator.capacitance().clone()
    };
    let alone = capacitances(std::slice::from_ref(&bar), &[GROUNDED]);
    let with_air = capacitances(&[bar, air], &[GROUNDED, dielectric(1.0)]);
    let error = relative_error(&with_air, &alone);
    assert!(error < 1e-10, "{error:e}");
}
