//! The solver reaches what it reports: the tolerance on C holds over whole runs, for every preconditioner.

use crate::common::edges_alone::EdgesAlone;
use crate::common::{
    DIRECT, DOMAIN, EXACT, bar, both, depth_of_boxes, rectangle, relative_error, stripes_sensor,
    three_stripes, without_lattice,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::Surfaces;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};
use capsense_core::stiffness::EdgeNetwork;

fn materials() -> Vec<Material> {
    let weak = Material::Dielectric(RelativePermittivity::new(4.0).unwrap());
    vec![Material::Conductor(Connection::Grounded), Material::Conductor(Connection::Floating), weak]
}

/// A bar that sweeps past in small steps, a floating one that jumps, and a dielectric that comes and goes.
fn boxes(frame: usize) -> [Aabb; 3] {
    let step = frame as f64;
    let jump = if frame % 17 < 8 { 0.05 } else { 0.2 };
    let gone = if frame.is_multiple_of(5) { 3.0 } else { 0.02 };
    [bar(0.08, 0.002 * step - 0.1), bar(jump, -0.1), bar(gone, 0.1 - 0.001 * step)]
}

fn error(of: &Simulator, truth: &Simulator) -> f64 {
    relative_error(of.capacitance(), truth.capacitance())
}

/// Over a run: at most one frame in a hundred above the tolerance, none above three times it.
fn assert_tolerance_holds(sensor: &Sensor, materials: &[Material], preconditioners: &[Preconditioner]) {
    let simulator = |options| Simulator::new(sensor.clone(), materials.to_vec(), options).unwrap();
    let mut truth = simulator(SolverOptions { preconditioner: Preconditioner::Multigrid, ..EXACT });
    let mut tested = Vec::new();
    for &preconditioner in preconditioners {
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-6, 1e-8] {
            let options = SolverOptions { tolerance, preconditioner, ..SolverOptions::default() };
            tested.push((options, simulator(options), Vec::new()));
        }
    }
    for frame in 0..100 {
        let depth = depth_of_boxes([80, 80], &boxes(frame));
        let _ = truth.step(&depth).unwrap();
        for (_, simulator, errors) in &mut tested {
            let report = simulator.step(&depth).unwrap();
            errors.push((error(simulator, &truth), report.solve.relative_error));
        }
    }
    for (options, _, errors) in &tested {
        let above = errors.iter().filter(|(error, _)| *error > options.tolerance).count();
        let worst = errors.iter().map(|(error, _)| *error).fold(0.0, f64::max);
        assert!(
            above <= 1 && worst <= 3.0 * options.tolerance,
            "{options:?}: {above} above, worst {worst:e}"
        );
        assert!(errors.iter().all(|(_, reported)| *reported <= options.tolerance));
    }
}

fn with_dielectric(permittivity: f64) -> Vec<Material> {
    let mut materials = materials();
    materials[2] = Material::Dielectric(RelativePermittivity::new(permittivity).unwrap());
    materials
}

#[test]
fn the_tolerance_holds_in_every_frame() {
    let all = [Preconditioner::Multigrid, Preconditioner::Ic0, Preconditioner::Jacobi, Preconditioner::None];
    assert_tolerance_holds(&stripes_sensor(12_000), &materials(), &all);
}

#[test]
fn the_tolerance_holds_whatever_the_permittivity() {
    let lattice = stripes_sensor(12_000);
    let mesh = without_lattice(&lattice);
    for permittivity in [1e-6, 80.0, 1e3, 1e6] {
        for sensor in [&lattice, &mesh] {
            let materials = with_dielectric(permittivity);
            assert_tolerance_holds(sensor, &materials, &[Preconditioner::Multigrid, Preconditioner::Jacobi]);
        }
    }
}

/// The geometric and the aggregation multigrid solve the same equations, once surfaces are told alike: of walls that a camera
/// sees only lattices know.
#[test]
fn a_lattice_and_its_tetrahedra_give_the_same_capacitances() {
    let lattice = stripes_sensor(12_000);
    let mut by_index = Simulator::new(lattice.clone(), with_dielectric(80.0), EXACT).unwrap();
    let mut by_list = Simulator::new(without_lattice(&lattice), with_dielectric(80.0), EXACT).unwrap();
    for frame in 0..20 {
        let surfaces = EdgesAlone(depth_of_boxes([80, 80], &boxes(frame)));
        let _ = by_index.step(&surfaces).unwrap();
        let _ = by_list.step(&surfaces).unwrap();
        assert!(error(&by_index, &by_list) < 1e-11, "frame {frame}");
    }
}

#[test]
fn multigrid_needs_a_handful_of_iterations_whatever_the_mesh() {
    for tets in [10_000, 40_000, 120_000] {
        let sensor = stripes_sensor(tets);
        let options = SolverOptions { tolerance: 1e-10, ..SolverOptions::default() };
        let mut simulator = Simulator::new(sensor.clone(), materials(), options).unwrap();
        let cold = simulator.step(&depth_of_boxes([80, 80], &boxes(0))).unwrap().solve;
        assert!(cold.iterations <= 16, "{tets}: {cold:?}");
        let mut listed = Simulator::new(without_lattice(&sensor), materials(), options).unwrap();
        let cold = listed.step(&depth_of_boxes([80, 80], &boxes(0))).unwrap().solve;
        assert!(cold.iterations <= 40, "{tets} by aggregation: {cold:?}");
    }
}

#[test]
fn results_are_the_same_bits_on_every_run() {
    let run = || {
        let options = SolverOptions::default();
        let mut simulator = Simulator::new(stripes_sensor(12_000), materials(), options).unwrap();
        for frame in 0..5 {
            let _ = simulator.step(&depth_of_boxes([80, 80], &boxes(frame))).unwrap();
        }
        simulator.capacitance().clone()
    };
    assert_eq!(run(), run());
}

/// On a lattice that is large enough for five threads to share, and its tetrahedra.
#[test]
fn results_are_the_same_bits_on_any_number_of_threads() {
    let lattice = Lattice::uniform(DOMAIN, [25, 25, 40]).unwrap();
    for electrodes in [1, 3, 5, 9] {
        let stripe = |k: i32| rectangle(&format!("E{k}"), [0.0, 0.04 * f64::from(k) - 0.09], [0.1, 0.02]);
        let electrodes = (0..electrodes).map(stripe).collect();
        let design = SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded };
        for sensor in both(Sensor::on_lattice(&design, &lattice).unwrap()) {
            let mut simulators = [1, 2, 3, 5].map(|threads| {
                let options = SolverOptions { threads: Some(threads), ..SolverOptions::default() };
                Simulator::new(sensor.clone(), materials(), options).unwrap()
            });
            for frame in 0..20 {
                let depth = depth_of_boxes([80, 80], &boxes(frame));
                let results = simulators.each_mut().map(|simulator| {
                    let report = simulator.step(&depth).unwrap();
                    (report.solve, simulator.capacitance().clone())
                });
                assert!(results.iter().all(|result| *result == results[0]), "frame {frame}");
            }
        }
    }
}

/// The direct assembly of a graded, layered lattice equals the sum over its tetrahedra.
#[test]
fn a_lattice_is_a_network_of_seven_points() {
    let axes = [vec![0.0, 0.1, 0.25, 0.3], vec![0.0, 0.2, 0.21], vec![-0.1, 0.0, 0.05, 0.25]];
    let lattice = Lattice::new(axes).unwrap();
    let mesh = lattice.to_tet_mesh().unwrap();
    let below: Vec<bool> = (0..mesh.tets().len()).map(|e| mesh.centroid(e).z < 0.0).collect();
    let mesh = mesh.with_permittivity(|e| if below[e] { 4.4 } else { 1.0 }).unwrap();
    let direct = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
    let summed = EdgeNetwork::assemble(&mesh);
    let numbered =
        (0..direct.edges().len()).filter_map(|edge| direct.edges().ends(edge).map(|ends| (edge, ends)));
    let mut found = 0;
    for (edge, ends) in numbered {
        let other = (0..summed.edges().len()).find(|&e| summed.edges().ends(e) == Some(ends)).unwrap();
        let (a, b) = (direct.weights()[edge], summed.weights()[other]);
        assert!((a / b - 1.0).abs() < 1e-12, "{ends:?}: {a} {b}");
        let (a, b) = (direct.permittivity().at(edge), summed.permittivity().at(other));
        assert!((a / b - 1.0).abs() < 1e-12, "{ends:?}: {a} {b}");
        found += 1;
    }
    assert_eq!(found, summed.edges().len(), "diagonals of Kuhn tetrahedra have no weight");
}

/// Edges near a box, on a lattice by index and from a list by search.
#[test]
fn edges_near_a_box_are_all_found() {
    let lattice = Lattice::uniform(DOMAIN, [5, 7, 6]).unwrap();
    let mesh = lattice.to_tet_mesh().unwrap();
    let by_index = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
    let by_search = EdgeNetwork::assemble(&mesh);
    for shift in 0..20 {
        let centre = DVec3::new(0.013 * f64::from(shift) - 0.1, 0.07, 0.3 - 0.02 * f64::from(shift));
        let region = Aabb { min: centre - 0.03, max: centre + 0.05 };
        let near = |network: &EdgeNetwork| {
            let mut found = std::collections::BTreeSet::new();
            network.edges().for_edges_near(mesh.nodes(), &region, |_, ends| {
                let [a, b] = ends.map(|node| mesh.nodes()[node as usize]);
                if region.intersects(&Aabb { min: a.min(b), max: a.max(b) }) {
                    found.insert(ends);
                }
            });
            found
        };
        assert_eq!(near(&by_index), near(&by_search));
    }
}

/// Frames in which nothing moves cost nothing; those in which little does are bounded from both sides and not solved.
#[test]
fn frames_that_cannot_matter_are_skipped() {
    let scenes = both(stripes_sensor(12_000))
        .into_iter()
        .flat_map(|sensor| [materials(), with_dielectric(80.0)].map(|materials| (sensor.clone(), materials)));
    for (sensor, materials) in scenes {
        let options = SolverOptions { tolerance: 1e-3, ..SolverOptions::default() };
        let mut truth = Simulator::new(sensor.clone(), materials.clone(), EXACT).unwrap();
        let mut simulator = Simulator::new(sensor.clone(), materials, options).unwrap();
        let mut skipped = 0;
        for frame in 0..60 {
            // Far away, a tenth of a millimetre a frame, down, up, and still.
            let step = 1e-4 * f64::from(30 - i32::min((30 - frame % 40i32).abs(), 25));
            let boxes = [bar(0.25 - step, 0.0), bar(0.33 + step, -0.1), bar(0.4, 0.1)];
            let depth = depth_of_boxes([80, 80], &boxes);
            let report = simulator.step(&depth).unwrap();
            let _ = truth.step(&depth).unwrap();
            assert!(error(&simulator, &truth) <= options.tolerance, "frame {frame}: {report:?}");
            assert!(report.solve.relative_error <= options.tolerance);
            assert!(!report.solve.skipped || report.solve.iterations == 0);
            skipped += usize::from(report.solve.skipped);
            let before = simulator.capacitance().clone();
            let again = simulator.step(&depth).unwrap();
            assert!(again.solve.skipped && again.changed_edges == 0, "frame {frame}: {report:?} {again:?}");
            assert_eq!(simulator.capacitance(), &before);
        }
        assert!(skipped > 30, "{skipped}");
        // What happens nearby is never skipped.
        let near = depth_of_boxes([80, 80], &[bar(0.02, 0.0), bar(0.33, -0.1), bar(0.4, 0.1)]);
        assert!(!simulator.step(&near).unwrap().solve.skipped);
    }
}

/// Frames of a smooth motion may need no new fields: what these would take from the capacitances is seen before.
#[test]
fn capacitances_are_known_before_fields_move() {
    let options = SolverOptions { tolerance: 1e-4, ..SolverOptions::default() };
    for sensor in both(stripes_sensor(12_000)) {
        let materials = vec![Material::Conductor(Connection::Grounded)];
        let mut truth = Simulator::new(sensor.clone(), materials.clone(), EXACT).unwrap();
        let mut simulator = Simulator::new(sensor, materials, options).unwrap();
        let mut foreseen = Vec::new();
        for frame in 0..150 {
            let before = simulator.capacitance().get(0, 0);
            let depth = depth_of_boxes([80, 80], &[bar(0.05 - 2e-4 * f64::from(frame), 0.0)]);
            let report = simulator.step(&depth).unwrap().solve;
            let _ = truth.step(&depth).unwrap();
            if report.iterations == 0 && !report.skipped {
                assert!(report.relative_error <= options.tolerance && report.residual > 0.0, "{report:?}");
                assert_ne!(simulator.capacitance().get(0, 0), before, "frame {frame}");
                foreseen.push(error(&simulator, &truth));
            }
        }
        let above = foreseen.iter().filter(|error| **error > options.tolerance).count();
        let worst = foreseen.iter().copied().fold(0.0, f64::max);
        assert!(
            foreseen.len() > 10 && above <= 1 && worst <= 3.0 * options.tolerance,
            "{} foreseen: {foreseen:?}",
            foreseen.len()
        );
    }
}

/// A body that moves steadily leads the fields on: 50 of 90 frames need no step, where fields are not led 30.
#[test]
fn a_steady_motion_is_followed_without_steps() {
    let options = SolverOptions { tolerance: 1e-4, ..SolverOptions::default() };
    let materials = vec![Material::Conductor(Connection::Grounded)];
    let design = three_stripes();
    let sensor = Sensor::on_lattice(&design, &design.lattice(25_000).unwrap()).unwrap();
    let mut truth = Simulator::new(sensor.clone(), materials.clone(), EXACT).unwrap();
    let mut simulator = Simulator::new(sensor, materials, options).unwrap();
    let (mut without, mut errors) = (0, Vec::new());
    for frame in 0..90 {
        let depth = depth_of_boxes([80, 80], &[bar(0.11 - 1e-3 * f64::from(frame), 0.0)]);
        let report = simulator.step(&depth).unwrap().solve;
        let _ = truth.step(&depth).unwrap();
        without += usize::from(report.iterations == 0);
        errors.push(error(&simulator, &truth));
    }
    let above = errors.iter().filter(|error| **error > options.tolerance).count();
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert!(
        without > 40 && above <= 1 && worst <= 3.0 * options.tolerance,
        "{without} frames; {above} above, {worst:e}"
    );
}

/// The changes that objects make are known to the tolerance asked for, however small they are: of a column by its own, between two
/// by the geometric mean of both.
#[test]
fn the_tolerance_on_changes_holds() {
    let materials =
        vec![Material::Conductor(Connection::Grounded), Material::Conductor(Connection::Floating)];
    for sensor in both(stripes_sensor(12_000)) {
        let simulator = |options| Simulator::new(sensor.clone(), materials.clone(), options).unwrap();
        let mut truth = simulator(EXACT);
        let mut tested = [1e-2, 1e-3, 1e-4].map(|of_change| {
            let options = SolverOptions {
                tolerance: 1e-2,
                change_tolerance: Some(of_change),
                ..SolverOptions::default()
            };
            (of_change, simulator(options), Vec::new())
        });
        for frame in 0..60 {
            let step = f64::from(frame);
            // Far enough apart for nodes between them.
            let boxes = [bar(0.35 - 0.003 * step, 0.0), bar(0.03 + 0.0005 * step, -0.1 + 0.003 * step)];
            let depth = depth_of_boxes([80, 80], &boxes);
            let _ = truth.step(&depth).unwrap();
            let change = |row, column| truth.capacitance().get(row, column) - truth.base().get(row, column);
            assert!((0..3).all(|own| change(own, own) > 0.0), "frame {frame}");
            for (_, simulator, errors) in &mut tested {
                let _ = simulator.step(&depth).unwrap();
                let worst = (0..9).map(|pair| {
                    let (row, column) = (pair / 3, pair % 3);
                    let of = |s: &Simulator| s.capacitance().get(row, column);
                    (of(simulator) - of(&truth)).abs() / (change(row, row) * change(column, column)).sqrt()
                });
                errors.push(worst.fold(0.0, |worst, error| if error <= worst { worst } else { error }));
            }
        }
        for (tolerance, _, errors) in &tested {
            assert!(errors.iter().all(|error| error <= tolerance), "{tolerance:e}: {errors:?}");
        }
    }
}

/// A simulator that saw one frame.
fn after(
    sensor: &Sensor,
    materials: &[Material],
    options: SolverOptions,
    surfaces: &impl Surfaces,
) -> Simulator {
    let mut simulator = Simulator::new(sensor.clone(), materials.to_vec(), options).unwrap();
    let _ = simulator.step(surfaces).unwrap();
    simulator
}

/// An object that leaves through a wall is linked to nodes of the wall, which the lattice solver does not walk over.
#[test]
fn an_object_in_the_wall_has_its_capacitance_to_it() {
    let lattice = stripes_sensor(12_000);
    let mesh = without_lattice(&lattice);
    let floating = vec![Material::Conductor(Connection::Floating)];
    for place in [DVec3::new(0.0, -0.26, 0.02), DVec3::new(-0.26, 0.0, 0.02), DVec3::new(0.0, 0.0, 0.4)] {
        let solid = Aabb { min: place, max: place + DVec3::new(0.1, 0.12, 0.06) };
        // With the walls of bodies that a camera sees, of which only lattices know.
        let depth = depth_of_boxes([80, 80], &[solid]);
        let [walked, direct] = [EXACT, DIRECT].map(|options| after(&lattice, &floating, options, &depth));
        assert!(error(&walked, &direct) < 1e-11, "{place}");
        // And without.
        let alone = EdgesAlone(depth);
        let [by_index, by_list] = [&lattice, &mesh].map(|sensor| after(sensor, &floating, EXACT, &alone));
        assert!(error(&by_index, &by_list) < 1e-11, "{place}");
    }
}
