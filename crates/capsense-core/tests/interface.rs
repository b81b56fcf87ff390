//! The interface models: what each makes of the mesh, of conductors and of dielectrics, on a lattice and on any mesh.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::baseline::{CgOptions, PaperMethod};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::{Lattice, TetMesh, signed_volume};
use capsense_core::occupancy::{
    Contact, DepthLayers, EdgeGeometry, Interface, NO_OBJECT, Occupancy, OrthographicView, Span, Surfaces,
};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};
use capsense_core::stiffness::{EdgeNetwork, StiffnessMatrix};
use capsense_core::units::VACUUM_PERMITTIVITY;
use common::{
    DOMAIN, Dice, EXACT, bar, conductor, depth_of_boxes, dielectric, on_other_mesh, relative_error,
    stripes_sensor, with_slivers, without_lattice,
};
use proptest::prelude::*;
use std::sync::LazyLock;

const GROUNDED: Material = Material::Conductor(Connection::Grounded);
const FLOATING: Material = Material::Conductor(Connection::Floating);
const OF_ELEMENTS: [Interface; 2] = [Interface::Centroid, Interface::VolumeFraction];
const ALL: [Interface; 3] = [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction];

/// One sensor on a lattice, on the same mesh not known to be one, and on a mesh with negative weights.
static MESHES: LazyLock<[Sensor; 3]> = LazyLock::new(|| {
    let lattice = stripes_sensor(6_000).with_rims_held();
    [without_lattice(&lattice), with_slivers(&lattice), lattice]
});

/// Solids that are cut out of space by half-spaces: inside is where every normal·x is below its offset.
#[derive(Clone)]
struct Convex(Vec<Vec<(DVec3, f64)>>);

impl Convex {
    fn boxes(boxes: &[Aabb]) -> Self {
        let faces = |b: &Aabb| {
            [DVec3::X, DVec3::Y, DVec3::Z]
                .into_iter()
                .flat_map(|n| [(n, n.dot(b.max)), (-n, -n.dot(b.min))])
                .collect()
        };
        Self(boxes.iter().map(faces).collect())
    }

    /// A box around the origin, turned and moved.
    fn turned(half: DVec3, axis: DVec3, angle: f64, centre: DVec3) -> Self {
        let turn = capsense_core::glam::DQuat::from_axis_angle(axis.normalize(), angle);
        let faces = [(DVec3::X, half.x), (DVec3::Y, half.y), (DVec3::Z, half.z)];
        let faces = faces
            .into_iter()
            .flat_map(|(n, h)| [turn * n, -(turn * n)].into_iter().map(move |n| (n, h + n.dot(centre))));
        Self(vec![faces.collect()])
    }

    fn joined(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }
}

impl Surfaces for Convex {
    fn objects(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, _: usize) -> Aabb {
        Aabb { min: DVec3::splat(-9.0), max: DVec3::splat(9.0) }
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        self.0[object].iter().all(|(normal, offset)| normal.dot(point) < *offset)
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        let (mut enter, mut exit) = (0.0, 1.0);
        for (normal, offset) in &self.0[object] {
            let (from, to) = (normal.dot(a) - offset, normal.dot(b) - offset);
            match (from < 0.0, to < 0.0) {
                (true, true) => {}
                (false, false) => return None,
                (true, false) => exit = f64::min(exit, from / (from - to)),
                (false, true) => enter = f64::max(enter, from / (from - to)),
            }
        }
        (enter < exit).then_some(Span { enter, exit })
    }
}

/// The part of a simulator that comes before the solver.
#[derive(Clone)]
struct Updater<'a> {
    interface: Interface,
    sensor: &'a Sensor,
    network: EdgeNetwork,
    materials: Vec<Material>,
    occupancy: Occupancy,
    matrix: StiffnessMatrix,
}

impl<'a> Updater<'a> {
    fn new(interface: Interface, sensor: &'a Sensor, materials: &[Material]) -> Self {
        let network = EdgeNetwork::of_sensor_elements(sensor);
        let occupancy = Occupancy::with_interface(interface, sensor.mesh(), network.edges())
            .with_negative_weights(sensor.mesh(), network.edges());
        let matrix = StiffnessMatrix::new(network.clone(), sensor.mesh().nodes().len());
        Self { interface, sensor, network, materials: materials.to_vec(), occupancy, matrix }
    }

    fn step(&mut self, surfaces: &impl Surfaces) {
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        };
        self.occupancy.update(mesh, &self.materials, surfaces);
        self.matrix.update(&self.occupancy);
    }

    /// Takes a step; what it leaves is that of a fresh build, bit for bit, and what is said to have changed did.
    fn step_checked(&mut self, surfaces: &impl Surfaces) {
        let before = self.clone();
        self.step(surfaces);
        let mut fresh = Self::new(self.interface, self.sensor, &self.materials);
        fresh.step(surfaces);
        let bits = |u: &Self| u.matrix.to_csr().values().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(self) == bits(&fresh), "K differs from a fresh build");
        assert!(self.occupancy.elements() == fresh.occupancy.elements());
        assert_eq!(self.occupancy.couplings(), fresh.occupancy.couplings());
        assert_eq!(self.occupancy.conductors(), fresh.occupancy.conductors());
        assert_eq!(self.occupancy.contacts(), fresh.occupancy.contacts());
        assert_eq!(self.occupancy.linked_edges(), fresh.occupancy.linked_edges());
        let held = |u: &Self, node: u32| u.occupancy.conductors()[node as usize];
        let moved = |node: &u32| held(self, *node) != held(&before, *node);
        let nodes = 0..self.sensor.mesh().nodes().len() as u32;
        assert!(nodes.clone().filter(moved).eq(self.occupancy.changed_nodes().iter().copied()), "nodes");
        let differs = |edge: &u32| {
            let [now, then] = [self, &before].map(|u| u.occupancy.couplings()[*edge as usize]);
            let ends = self.network.edges().ends(*edge as usize).into_iter().flatten();
            now != then || ends.into_iter().any(|node| moved(&node))
        };
        let edges = 0..self.network.edges().len() as u32;
        assert!(edges.filter(differs).eq(self.occupancy.changed_edges().iter().copied()), "edges");
        let (now, then) = (self.matrix.to_csr(), before.matrix.to_csr());
        let mut rows = self.matrix.changed_rows().to_vec();
        rows.sort_unstable();
        let differs = |row: &u32| now.row(*row as usize).values() != then.row(*row as usize).values();
        // Links may lead to another object and weigh the same.
        assert!(nodes.filter(differs).all(|row| rows.binary_search(&row).is_ok()), "rows");
    }

    /// K is that of the mesh with the permittivities that the elements now have.
    fn assert_is_assembled(&self) {
        let (permittivity, _) = self.occupancy.elements().unwrap();
        let mesh = self.sensor.mesh().clone().with_permittivity(|e| permittivity[e]).unwrap();
        let truth = StiffnessMatrix::new(EdgeNetwork::assemble(&mesh), mesh.nodes().len()).to_csr();
        let ours = self.matrix.to_csr();
        let size = ours.values().iter().fold(0.0, |size, value| f64::max(size, value.abs()));
        // Electrode outlines that cross edges shorten them, whatever the elements; these sensors have none.
        let mut row = vec![0.0; mesh.nodes().len()];
        for node in 0..mesh.nodes().len() {
            for (matrix, sign) in [(&truth, -1.0), (&ours, 1.0)] {
                let entries = matrix.row(node);
                entries.col_indices().iter().zip(entries.values()).for_each(|(&c, v)| row[c] += sign * v);
            }
            let mut worst = 0.0;
            for matrix in [&truth, &ours] {
                for &column in matrix.row(node).col_indices() {
                    worst = f64::max(worst, std::mem::take(&mut row[column]).abs());
                }
            }
            assert!(worst < 1e-11 * size, "row {node}: {worst} of {size}");
        }
    }
}

/// Three boxes, perhaps turned, as solids, or what a camera sees of three boxes.
fn random_convex(dice: &mut Dice) -> Convex {
    (0..3).fold(Convex(Vec::new()), |all, _| {
        let half = DVec3::new(dice.between(0.01, 0.1), dice.between(0.01, 0.1), dice.between(0.01, 0.1));
        let (axis, centre) = (dice.point() + 0.4, dice.point());
        all.joined(Convex::turned(half, axis, dice.between(0.0, 3.0), centre))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn frames_leave_no_trace(seed in any::<u64>(), width in 1..60usize, height in 1..60usize) {
        let mut dice = Dice(seed);
        let materials = [dielectric(4.0), GROUNDED, dielectric(30.0)];
        for interface in ALL {
            let mut updaters = MESHES.each_ref().map(|sensor| Updater::new(interface, sensor, &materials));
            for _ in 0..4 {
                let boxes = [0; 3].map(|_| {
                    let (a, b) = (dice.point(), dice.point());
                    Aabb { min: a.min(b), max: a.max(b) }
                });
                let depth = depth_of_boxes([width, height], &boxes);
                updaters.iter_mut().for_each(|updater| updater.step_checked(&depth));
                let convex = random_convex(&mut dice);
                updaters.iter_mut().for_each(|updater| updater.step_checked(&convex));
            }
            if interface != Interface::EdgeCut {
                updaters.iter().for_each(Updater::assert_is_assembled);
            }
        }
    }
}

#[test]
fn many_frames_and_other_materials_leave_no_trace() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let mut updater = Updater::new(interface, sensor, &[dielectric(3.0), GROUNDED]);
            let seen = |step: u32| {
                let near = bar(0.05 - 1e-3 * f64::from(step % 40), 0.0);
                depth_of_boxes([32, 32], &[near, bar(0.1, 0.02)])
            };
            for step in 0..300 {
                updater.step(&seen(step));
            }
            updater.step_checked(&seen(7));
            assert!(!updater.occupancy.changed_edges().is_empty());
            updater.step_checked(&seen(7));
            assert!(updater.occupancy.changed_edges().is_empty() && updater.matrix.changed_rows().is_empty());
            updater.materials = vec![FLOATING, dielectric(9.0)];
            updater.step_checked(&seen(7));
            updater.assert_is_assembled();
        }
    }
}

/// Four elements around an edge along which their weights cancel without objects, and that edge.
fn cancelling() -> (TetMesh, [u32; 2]) {
    // Around the edge up z. With the ring of other nodes at distance R, an element of angle α about the edge weighs
    // R sin(α/2) (R cos(α/2) - 1/(4 R cos(α/2))) / 3 along it: for R² = 2/3, angles of 60° and 120° cancel.
    let round = [0.0, 60.0, 180.0, 240.0].map(f64::to_radians);
    let mut nodes = vec![DVec3::ZERO, DVec3::Z];
    let radius = (2.0_f64 / 3.0).sqrt();
    nodes.extend(round.map(|angle: f64| DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.5)));
    let ring = [[2, 3], [3, 4], [4, 5], [5, 2]];
    let tets = ring.map(|[a, b]| [0, a, b, 1]).map(|tet| {
        let volume = signed_volume(tet.map(|n: u32| nodes[n as usize]));
        if volume < 0.0 { [tet[0], tet[2], tet[1], tet[3]] } else { tet }
    });
    (TetMesh::new(nodes, tets.to_vec()).unwrap(), [0, 1])
}

#[test]
fn weights_that_cancel_in_air_come_back_in_a_dielectric() {
    let (mesh, edge) = cancelling();
    let ends = |network: &EdgeNetwork| {
        (0..network.edges().len()).filter_map(|e| network.edges().ends(e)).any(|ends| ends == edge)
    };
    assert!(!ends(&EdgeNetwork::assemble(&mesh)), "they cancel");
    let electrodes = vec![("E".to_owned(), ElectrodeNodes::Nodes(vec![2]))];
    let sensor = Sensor::on_mesh(mesh.clone(), &[4], electrodes).unwrap();
    for interface in OF_ELEMENTS {
        let mut updater = Updater::new(interface, &sensor, &[dielectric(5.0)]);
        assert!(ends(&updater.network));
        updater.assert_is_assembled();
        let corner = Aabb { min: DVec3::new(0.15, 0.05, -1.0), max: DVec3::new(3.0, 3.0, 3.0) };
        updater.step_checked(&Convex::boxes(&[corner]));
        let (permittivity, _) = updater.occupancy.elements().unwrap();
        assert!(permittivity.iter().any(|p| *p > 1.5) && permittivity.contains(&1.0), "{permittivity:?}");
        updater.assert_is_assembled();
        let row = updater.matrix.to_csr();
        let entry = row.get_entry(0, 1).unwrap().into_value();
        assert!(entry.abs() > 1e-3, "{entry}");
    }
}

#[test]
fn an_element_that_is_filled_has_exactly_the_permittivity_of_the_object() {
    for sensor in &*MESHES {
        let mut updater = Updater::new(Interface::VolumeFraction, sensor, &[dielectric(7.3)]);
        let block = Aabb { min: DVec3::new(-0.21, -0.21, 0.03), max: DVec3::new(0.2, 0.2, 0.41) };
        let within = Aabb { min: block.min + 1e-9, max: block.max - 1e-9 };
        updater.step(&Convex::boxes(&[block]));
        let (permittivity, _) = updater.occupancy.elements().unwrap();
        let (mut full, mut mixed) = (0, 0);
        for (element, &found) in permittivity.iter().enumerate() {
            let corners = sensor.mesh().corners(element);
            if corners.iter().all(|corner| within.contains(*corner)) {
                assert!(found == 7.3, "{found}");
                full += 1;
            }
            assert!((1.0..=7.3 + 1e-13).contains(&found), "{found}");
            mixed += usize::from(found > 1.0 && found < 7.0);
        }
        assert!(full > 10 && mixed > 10, "{full} {mixed}");
    }
}

/// The part of a tetrahedron's volume below a plane: the tetrahedron cut off at the only corner on one side, or, with
/// two on either side, three tetrahedra between them.
fn volume_below(corners: [DVec3; 4], normal: DVec3, offset: f64) -> f64 {
    let mut order = corners.map(|corner| (normal.dot(corner) - offset, corner));
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole = signed_volume(corners).abs();
    let cut = |i: usize, j: usize| {
        let ((a, from), (b, to)) = (order[i], order[j]);
        from.lerp(to, a / (a - b))
    };
    let volume = |corners: [DVec3; 4]| signed_volume(corners).abs();
    match order.iter().filter(|(distance, _)| *distance < 0.0).count() {
        0 => 0.0,
        1 => volume([order[0].1, cut(0, 1), cut(0, 2), cut(0, 3)]) / whole,
        2 => {
            let (a, b) = (order[0].1, order[1].1);
            let (ac, ad, bc, bd) = (cut(0, 2), cut(0, 3), cut(1, 2), cut(1, 3));
            (volume([a, ac, ad, b]) + volume([ac, ad, b, bc]) + volume([ad, b, bc, bd])) / whole
        }
        3 => 1.0 - volume([order[3].1, cut(3, 0), cut(3, 1), cut(3, 2)]) / whole,
        _ => 1.0,
    }
}

/// The bound that the documentation of volume fractions names.
#[test]
fn volume_fractions_of_half_spaces_are_nearly_exact() {
    let mut dice = Dice(3);
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
    for _ in 0..60 {
        let sensor = &MESHES[1];
        let through = dice.point();
        let normal = (DVec3::new(dice.next(), dice.next(), dice.next()) - 0.5).normalize();
        let solid = Convex(vec![vec![(normal, normal.dot(through))]]);
        let mut updater = Updater::new(Interface::VolumeFraction, sensor, &[dielectric(2.0)]);
        updater.step(&solid);
        for (element, permittivity) in updater.occupancy.elements().unwrap().0.iter().enumerate() {
            let exact = volume_below(sensor.mesh().corners(element), normal, normal.dot(through));
            let error = (permittivity - 1.0 - exact).abs();
            if exact > 0.0 && exact < 1.0 {
                (sum, count) = (sum + error * error, count + 1);
            }
            worst = worst.max(error);
        }
    }
    let mean = (sum / f64::from(count)).sqrt();
    println!("fractions: worst {worst}, root mean square {mean} of {count}");
    assert!(count > 10_000 && worst < 0.14 && mean < 0.009, "{worst} {mean} {count}");
}

/// The pattern of jumps of C_11 over a sweep: the largest step in relation to the mean one.
fn roughness(interface: Interface, sensor: &Sensor, material: Material) -> f64 {
    let options = SolverOptions { preconditioner: Preconditioner::Direct, ..EXACT };
    let mut simulator =
        Simulator::with_interface(sensor.clone(), vec![material], options, interface).unwrap();
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
    for sensor in [&MESHES[0], &MESHES[2]] {
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
        let mut simulator =
            Simulator::with_interface(sensor.clone(), vec![material], EXACT, interface).unwrap();
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
    let options = SolverOptions { preconditioner: Preconditioner::Direct, ..EXACT };
    for part in [0.2, 0.45, 0.8] {
        let mut simulator = Simulator::with_interface(
            sensor.clone(),
            vec![dielectric(3.0)],
            options,
            Interface::VolumeFraction,
        )
        .unwrap();
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
            let simulator = |options| {
                Simulator::with_interface(sensor.clone(), materials.to_vec(), options, interface).unwrap()
            };
            let mut truth = simulator(SolverOptions { preconditioner: Preconditioner::Direct, ..EXACT });
            let mut tested = simulator(SolverOptions::default());
            for step in 0..12 {
                let shift = 5e-3 * f64::from(step);
                let boxes =
                    [bar(0.02, shift - 0.1), bar(0.06, 0.1 - shift), bar(0.09, shift), bar(0.3, shift)];
                let solids = Convex::boxes(&boxes);
                let _ = truth.step(&solids).unwrap();
                let report = tested.step(&solids).unwrap();
                let c = truth.capacitance();
                let error = relative_error(tested.capacitance(), c);
                assert!(error < 1e-4, "{interface:?}: {error} reported {}", report.solve.relative_error);
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
                let materials = vec![dielectric(permittivity), dielectric(2.0)];
                let simulator = |options| {
                    Simulator::with_interface(sensor.clone(), materials.clone(), options, interface).unwrap()
                };
                let mut truth = simulator(SolverOptions { preconditioner: Preconditioner::Direct, ..EXACT });
                let mut tested = simulator(SolverOptions::default());
                for step in 0..6 {
                    let shift = 4e-3 * f64::from(step);
                    let solids = Convex::boxes(&[bar(0.03, shift), bar(0.05, shift)]);
                    let _ = truth.step(&solids).unwrap();
                    let report = tested.step(&solids).unwrap();
                    let error = relative_error(tested.capacitance(), truth.capacitance());
                    assert!(error < 1e-4, "{interface:?} {permittivity}: {error}");
                    assert!(report.solve.iterations < 40, "{interface:?} {permittivity}: {report:?}");
                }
            }
        }
    }
}

#[test]
fn electrodes_win_over_conductors_and_conductors_over_dielectrics() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let materials = [dielectric(4.0), FLOATING, GROUNDED];
            let mut updater = Updater::new(interface, sensor, &materials);
            let all = bar(-0.005, 0.0);
            updater.step_checked(&Convex::boxes(&[all, bar(0.0, 0.0), all]));
            let (permittivity, holders) = updater.occupancy.elements().unwrap();
            for (element, (&permittivity, &holder)) in permittivity.iter().zip(holders).enumerate() {
                let corners = sensor.mesh().corners(element);
                let within = |b: Aabb| corners.iter().all(|corner| b.contains(*corner));
                if within(bar(0.0, 0.0)) {
                    assert!(holder == 1 && permittivity == 1.0, "of two conductors the first listed");
                }
                if holder != NO_OBJECT {
                    for node in sensor.mesh().tets()[element].map(|node| node as usize) {
                        let held = updater.occupancy.conductors()[node];
                        let free = sensor.owners()[node] == capsense_core::sensor::FREE;
                        assert_eq!(held == NO_OBJECT, !free);
                    }
                }
            }
            assert!(holders.contains(&1));
            for electrode in 0..3 {
                assert!(updater.occupancy.contacts().contains(&Contact { object: 1, electrode }));
            }
            updater.step_checked(&Convex::boxes(&[all, bar(0.2, 0.0), bar(0.3, 0.0)]));
            assert!(updater.occupancy.contacts().is_empty());
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
    let materials = permittivities.map(dielectric).to_vec();
    for sensor in &*MESHES {
        let mut paper = paper(sensor, &permittivities);
        let mut ours =
            Simulator::with_interface(sensor.clone(), materials.clone(), EXACT, Interface::Centroid).unwrap();
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

#[test]
fn two_layers_end_an_object_at_its_back() {
    let sensor = &MESHES[2];
    let mut updater = Updater::new(Interface::Centroid, sensor, &[dielectric(5.0)]);
    updater.step_checked(&depth_of_boxes([64, 64], &[bar(0.05, 0.0)]));
    for (element, permittivity) in updater.occupancy.elements().unwrap().0.iter().enumerate() {
        let z = sensor.mesh().centroid(element).z;
        assert!(*permittivity == 1.0 || (0.05..0.07).contains(&z));
    }
    assert!(updater.occupancy.elements().unwrap().0.contains(&5.0));
}

#[test]
fn noise_in_depth_images_leaves_no_trace() {
    let mut dice = Dice(11);
    let view = OrthographicView { domain: DOMAIN, width: 9, height: 7 };
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let mut updater = Updater::new(interface, sensor, &[dielectric(4.0), GROUNDED]);
            let mut depth = DepthLayers::empty(view, 2);
            for frame in 0..300 {
                let (front, back) = depth.layer_mut(dice.below(2));
                let pixel = dice.below(front.len());
                let (a, b) = (dice.between(0.0, 0.2) as f32, dice.between(0.0, 0.2) as f32);
                (front[pixel], back[pixel]) =
                    if a <= b { (a, b) } else { (f32::INFINITY, f32::NEG_INFINITY) };
                if frame % 60 == 59 { updater.step_checked(&depth) } else { updater.step(&depth) }
            }
        }
    }
}

/// The same mesh under another name: an independent reference for the whole simulator.
#[test]
fn capacitances_are_those_of_a_mesh_with_these_permittivities() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let options = SolverOptions { preconditioner: Preconditioner::Direct, ..EXACT };
            let mut simulator =
                Simulator::with_interface(sensor.clone(), vec![dielectric(6.0)], options, interface).unwrap();
            let _ = simulator.step(&Convex::boxes(&[bar(0.033, 0.007)])).unwrap();
            let (permittivity, _) = simulator.occupancy().elements().unwrap();
            let mesh = sensor.mesh().clone().with_permittivity(|e| permittivity[e]).unwrap();
            let truth = Simulator::new(on_other_mesh(sensor, mesh), vec![], options).unwrap();
            let error = relative_error(simulator.capacitance(), truth.base());
            assert!(error < 1e-10, "{interface:?}: {error}");
        }
    }
}
