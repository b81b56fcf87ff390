//! The operator against closed identities.

mod ahead;

use super::*;
use crate::electrode::{Electrode, Outline};
use crate::geometry::Aabb;
use crate::material::{Connection, Material, RelativePermittivity};
use crate::mesh::TetMesh;
use crate::occupancy::{DepthLayers, EdgeGeometry, Occupancy, OrthographicView};
use crate::sensor::{ElectrodeNodes, FREE, GROUND, Sensor, SensorDesign, Wall};
use crate::solver::CONTRAST;
use crate::stiffness::EdgeNetwork;
use glam::{DVec2, DVec3};

const DOMAIN: Aabb = Aabb { min: DVec3::splat(-0.1), max: DVec3::splat(0.1) };
const ALL: [Preconditioner; 5] = [
    Preconditioner::Multigrid,
    Preconditioner::Ic0,
    Preconditioner::Direct,
    Preconditioner::Jacobi,
    Preconditioner::None,
];

/// Two electrodes and a grounded plate on a mesh without order.
#[derive(Clone)]
struct Scene {
    sensor: Sensor,
    matrix: StiffnessMatrix,
    occupancy: Occupancy,
    holders: Vec<u16>,
}

impl Scene {
    fn new(tets: usize) -> Self {
        let electrodes = [-0.03, 0.03].map(|x| {
            let outline = Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::splat(0.04) };
            Electrode { name: format!("{x}"), outline, z: 0.0 }
        });
        let design = SensorDesign {
            domain: DOMAIN,
            electrodes: electrodes.to_vec(),
            substrate: None,
            wall: Wall::Grounded,
        };
        // Spacing grows slowly, so that bodies away from the electrodes hold nodes on small meshes too.
        let lattices = (0..).map(|step| design.lattice_of_spacing(0.05 * 0.97_f64.powi(step), 1.3).unwrap());
        let lattice = lattices.take_while(|lattice| lattice.tet_count() <= tets).last().unwrap();
        let flat = Sensor::on_lattice(&design, &lattice).unwrap();
        // Nodes that are free are shaken, so that all edges of the tetrahedra count.
        let mut nodes = flat.mesh().nodes().to_vec();
        for (index, node) in nodes.iter_mut().enumerate().filter(|(i, _)| flat.owners()[*i] == FREE) {
            let angle = index as f64;
            *node += 5e-4 * DVec3::new(angle.sin(), (2.0 * angle).cos(), (3.0 * angle).sin());
        }
        let mesh = TetMesh::new(nodes, flat.mesh().tets().to_vec()).unwrap();
        let held_by = |terminal: u16| -> Vec<u32> {
            (0..).zip(flat.owners()).filter(|(_, held)| **held == terminal).map(|(node, _)| node).collect()
        };
        let electrodes =
            [("a", 1), ("b", 2)].map(|(name, t)| (name.to_owned(), ElectrodeNodes::Nodes(held_by(t))));
        let sensor = Sensor::on_mesh(mesh, &held_by(GROUND), electrodes.to_vec()).unwrap();
        let network = EdgeNetwork::of_sensor(&sensor);
        let nodes = sensor.mesh().nodes().len();
        Self {
            occupancy: Occupancy::empty(nodes, network.edges().len()),
            matrix: StiffnessMatrix::new(network, nodes),
            holders: sensor.terminals().iter().copied().chain([1, 2, 3]).collect(),
            sensor,
        }
    }

    fn all_nodes(&self) -> Vec<u32> {
        (0..self.matrix.nodes() as u32).collect()
    }

    fn fixed(&self) -> Vec<bool> {
        self.holders.iter().map(|&holder| holder != FREE).collect()
    }

    /// Of up to four columns.
    fn solver_of_four(
        &self,
        columns: usize,
        preconditioner: Preconditioner,
        threads: usize,
    ) -> Box<Solver<4>> {
        match self.solver(columns, preconditioner, threads) {
            CsrSolver::Four(mut solver) => {
                solver.refresh_inverse();
                solver
            }
            CsrSolver::Eight(_) => panic!("{columns} columns are more than four"),
        }
    }

    fn solver(&self, columns: usize, preconditioner: Preconditioner, threads: usize) -> CsrSolver {
        let workers = Workers::new(threads, self.matrix.nodes());
        let mut solver = CsrSolver::new(&self.matrix, self.holders.len(), columns, preconditioner, workers);
        for (row, &holder) in self.holders.iter().enumerate() {
            for column in 0..columns {
                // Columns after those of the electrodes and the plate repeat them.
                let held = usize::from(holder) == column % 3 + 1;
                solver.set_potential(column, row, f64::from(u8::from(held)));
            }
        }
        solver.refresh(&self.matrix, &self.fixed(), 0..self.matrix.nodes() as u32);
        solver
    }

    /// Moves a thin plate to a height, which leaves some links.
    fn move_plate(&mut self, height: f64) {
        self.move_object(height, Material::Conductor(Connection::Floating));
    }

    fn move_object(&mut self, height: f64, material: Material) {
        let view = OrthographicView { domain: DOMAIN, width: 20, height: 20 };
        let mut depth = DepthLayers::empty(view, 1);
        // Conductors reach the wall, dielectrics float.
        let floats = matches!(material, Material::Dielectric(_));
        let in_sight = |at: usize| if floats { (7..16).contains(&at) } else { at > 6 };
        let across = |at: usize| !floats || (4..16).contains(&at);
        for pixel in (0..400).filter(|pixel| in_sight(pixel / 20) && across(pixel % 20)) {
            let (front, back) = depth.layer_mut(0);
            (front[pixel], back[pixel]) = (height as f32, height as f32 + thickness(&material));
        }
        let geometry = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.matrix.network().edges(),
            permittivity: self.matrix.network().permittivity(),
        };
        self.occupancy.update(geometry, &[material], &depth);
        self.matrix.update(&self.occupancy);
        for (node, &object) in self.occupancy.conductors().iter().enumerate() {
            if self.sensor.terminals()[node] == FREE {
                self.holders[node] = if object == 0 { 3 } else { FREE };
            }
        }
    }

    /// Tells a solver what the last move changed.
    fn tell(&self, solver: &mut CsrSolver) {
        for &node in self.occupancy.changed_nodes() {
            for column in 0..solver.columns() {
                let held = usize::from(self.holders[node as usize]) == column % 3 + 1;
                let free = self.holders[node as usize] == FREE;
                if !free {
                    solver.set_potential(column, node as usize, f64::from(u8::from(held)));
                }
            }
        }
        let changed = self.matrix.changed_rows().iter().chain(self.occupancy.changed_nodes()).copied();
        solver.refresh(&self.matrix, &self.fixed(), changed);
    }
}

/// Conductors are thinner than the edges that they cut, dielectrics hold nodes.
fn thickness(material: &Material) -> f32 {
    if matches!(material, Material::Dielectric(_)) { 0.04 } else { 0.004 }
}

/// Conjugate gradients by exact minimisation over the span of z and p.
fn iterate(solver: &mut CsrSolver, iterations: usize) {
    let columns = solver.columns();
    let active = vec![true; columns];
    let mut pkp = vec![0.0; columns];
    for iteration in 0..iterations {
        solver.descend(&active);
        let rz: Vec<f64> = solver.gains().iter().step_by(columns + 1).copied().collect();
        solver.precondition(&active);
        let rp = solver.state().along.clone();
        let (zkz, zkp) = solver.curvatures(&active);
        let (zkz, zkp) = (zkz.to_vec(), zkp.to_vec());
        let (mut a, mut b) = (vec![0.0; columns], vec![0.0; columns]);
        for c in 0..columns {
            let determinant = zkz[c] * pkp[c] - zkp[c] * zkp[c];
            if iteration > 0 && determinant > 1e-9 * zkz[c] * pkp[c] {
                a[c] = (rz[c] * pkp[c] - rp[c] * zkp[c]) / determinant;
                b[c] = (rp[c] * zkz[c] - rz[c] * zkp[c]) / determinant;
            } else if zkz[c] > 0.0 {
                a[c] = rz[c] / zkz[c];
            }
            pkp[c] = a[c] * a[c] * zkz[c] + 2.0 * a[c] * b[c] * zkp[c] + b[c] * b[c] * pkp[c];
        }
        solver.step(&a, &b);
    }
}

/// The norm of the residual over that of the charges.
fn residual(solver: &CsrSolver) -> f64 {
    let State { residual, charge, .. } = solver.state();
    residual.iter().zip(charge).map(|(free, held)| (free / held).sqrt()).fold(0.0, f64::max)
}

/// K x and x of all rows as bits.
fn bits(solver: &CsrSolver, column: usize, rows: usize) -> Vec<[u64; 2]> {
    (0..rows)
        .map(|row| [solver.charge(column, row), solver.potential(column, row)].map(f64::to_bits))
        .collect()
}

#[test]
fn every_preconditioner_converges() {
    for (preconditioner, iterations) in ALL.into_iter().zip([20, 60, 2, 150, 400]) {
        let mut scene = Scene::new(5_000);
        let mut solver = scene.solver(3, preconditioner, 1);
        scene.move_plate(0.03);
        scene.tell(&mut solver);
        iterate(&mut solver, iterations);
        assert!(residual(&solver) < 1e-9, "{preconditioner:?}: {:e}", residual(&solver));
    }
}

#[test]
fn one_step_with_the_exact_inverse_leaves_rounding_errors() {
    let mut scene = Scene::new(5_000);
    let mut solver = scene.solver(3, Preconditioner::Direct, 1);
    scene.move_plate(0.03);
    scene.tell(&mut solver);
    solver.descend(&[true; 3]);
    solver.precondition(&[true; 3]);
    solver.step(&[1.0; 3], &[0.0; 3]);
    assert!(residual(&solver) < 1e-13, "{:e}", residual(&solver));
}

/// An inverse that is not positive would not lower the energy.
#[test]
fn linear_inverses_are_symmetric_and_all_are_positive() {
    let mut scene = Scene::new(5_000);
    scene.move_plate(0.03);
    for preconditioner in ALL {
        let mut solver = scene.solver_of_four(3, preconditioner, 1);
        let noise = |row: usize| [0.3, 0.7, 1.1, 1.9].map(|factor| (factor * row as f64).sin());
        let kx: Vec<[f64; 4]> = (0..solver.rows.len()).map(noise).collect();
        let gains =
            solver.inverse.descend(0, &solver.rows, Charges { kx: &kx, ahead: None }, &solver.workers).gains;
        solver.inverse.ascend(0, Charges { kx: &kx, ahead: None }, &solver.workers);
        let z: Vec<[f64; 4]> = match solver.inverse.preconditioned(0) {
            Preconditioned::Single(z) => z.iter().map(|z| z.map(f64::from)).collect(),
            Preconditioned::Double(z) => z.clone(),
            Preconditioned::Work(work) => work.solution().iter().map(|z| z.map(f64::from)).collect(),
        };
        let product = |a: usize, b: usize| -> f64 { kx.iter().zip(&z).map(|(kx, z)| kx[a] * z[b]).sum() };
        for (lane, gains) in gains.iter().enumerate() {
            let own = -product(lane, lane);
            assert!(
                own > 0.0 && (gains[lane] / own - 1.0).abs() < 1e-4,
                "{preconditioner:?}: {gains:?} {own}"
            );
        }
        let asymmetry = (product(0, 1) - product(1, 0)).abs() / (product(0, 0) * product(1, 1)).sqrt();
        // The multigrid is not quite linear.
        let allowed = if preconditioner == Preconditioner::Multigrid { 1e-2 } else { 1e-5 };
        assert!(asymmetry < allowed, "{preconditioner:?}: {asymmetry:e}");
    }
}

#[test]
fn energies_are_those_of_the_matrix() {
    let mut scene = Scene::new(3_000);
    scene.move_plate(0.03);
    let mut solver = scene.solver(11, Preconditioner::Jacobi, 1);
    iterate(&mut solver, 3);
    let potentials = |column: usize| -> Vec<f64> {
        (0..scene.holders.len()).map(|row| solver.potential(column, row)).collect()
    };
    let energies = &solver.state().energies;
    for (s, t) in [(0, 0), (0, 1), (2, 1), (1, 10), (8, 9), (2, 2), (10, 3)] {
        let (x, y) = (potentials(s), potentials(t));
        let mut expected = 0.0;
        for node in 0..scene.matrix.nodes() {
            // Every edge is met at both ends.
            for (other, weight) in scene.matrix.row(node) {
                expected += 0.5 * weight * (x[node] - x[other]) * (y[node] - y[other]);
            }
        }
        for (node, object, weight) in scene.matrix.links() {
            expected += weight * (x[node] - x[object]) * (y[node] - y[object]);
        }
        let found = energies[11 * s + t];
        assert!((found - expected).abs() < 1e-12 * energies[0], "{s} {t}: {found} {expected}");
    }
    assert!(scene.matrix.links().count() > 0);
}

/// What is recomputed where something changed has the bits of what is computed everywhere, and the hierarchy after
/// many moves those of one that took a single move.
#[test]
fn moving_in_steps_is_moving_at_once() {
    for preconditioner in ALL {
        let mut scene = Scene::new(5_000);
        let mut stepwise = scene.solver(3, preconditioner, 1);
        let mut at_once = stepwise.clone();
        for height in [0.08, 0.031, 0.0305, 0.0304] {
            scene.move_plate(height);
            scene.tell(&mut stepwise);
        }
        let everything = 0..scene.matrix.nodes() as u32;
        for (row, column) in (0..scene.holders.len()).flat_map(|row| (0..3).map(move |c| (row, c))) {
            at_once.set_potential(column, row, stepwise.potential(column, row));
        }
        at_once.refresh(&scene.matrix, &scene.fixed(), everything);
        for solver in [&mut stepwise, &mut at_once] {
            solver.descend(&[true; 3]);
            solver.precondition(&[true; 3]);
        }
        for column in 0..3 {
            let rows = scene.holders.len();
            assert!(bits(&stepwise, column, rows) == bits(&at_once, column, rows), "{preconditioner:?}");
        }
        for solver in [&mut stepwise, &mut at_once] {
            solver.step(&[0.9; 3], &[0.0; 3]);
        }
        assert_eq!(stepwise.state().energies, at_once.state().energies, "{preconditioner:?}");
    }
}

/// What the island adds to rᵀz is (1ᵀr)²/(1ᵀK1), 1 its indicator, from which both sums follow without the solver.
#[test]
fn an_island_is_corrected_by_its_own_stiffness() {
    let mut scene = Scene::new(5_000);
    let mut solver = scene.solver(2, Preconditioner::Jacobi, 1);
    scene.move_object(0.03, Material::Dielectric(RelativePermittivity::new(1e6).unwrap()));
    scene.tell(&mut solver);
    let network = scene.matrix.network();
    let mut inside = vec![false; scene.matrix.nodes()];
    for (edge, coupling) in scene.occupancy.couplings().iter().enumerate() {
        if coupling.through >= CONTRAST {
            network.edges().ends(edge).unwrap().iter().for_each(|&node| inside[node as usize] = true);
        }
    }
    let body = || (0..inside.len()).filter(|&node| inside[node]);
    assert!(body().count() > 20);
    let outward =
        |node| scene.matrix.row(node).filter(|(other, _)| !inside[*other]).map(|(_, weight)| weight);
    let stiffness: f64 = body().flat_map(outward).sum();
    // The charges on the electrodes must have reached the body.
    iterate(&mut solver, 10);
    let push: f64 = body().map(|node| -solver.charge(0, node)).sum();
    solver.descend(&[true; 2]);
    let without = solver.gains()[0];
    solver.find_islands(&scene.matrix, &scene.occupancy, &scene.fixed(), &scene.all_nodes());
    solver.descend(&[true; 2]);
    let with = solver.gains()[0];
    let expected = push * push / stiffness;
    assert!(((with - without) / expected - 1.0).abs() < 1e-3, "{with} {without} {expected}");
}

/// A surface just above nodes joins these to the body by weaker edges than its inside, so one body is several islands, one
/// in the other. What K makes of their indicators is led back to them.
#[test]
fn islands_in_islands_are_solved_for_exactly() {
    let mut scene = Scene::new(5_000);
    let mut islands = Islands::from_contrast(CONTRAST);
    let mut height = 0.02;
    while islands.islands().len() < 2 {
        height += 1e-4;
        assert!(height < 0.06);
        scene.move_object(height, Material::Dielectric(RelativePermittivity::new(1e6).unwrap()));
        islands.find(&scene.matrix, &scene.occupancy, &scene.fixed(), &scene.all_nodes());
    }
    let mut expected = vec![0.0; scene.matrix.nodes()];
    for (island, height) in islands.islands().iter().zip([1.0, -0.3, 2.0]) {
        island.nodes().iter().for_each(|&node| expected[node as usize] += height);
    }
    let charge = |node: u32| -> f64 {
        let node = node as usize;
        let around = scene.matrix.row(node).map(|(other, weight)| weight * expected[other]);
        scene.matrix.diagonal(node) * expected[node] - around.sum::<f64>()
    };
    let mut found = vec![0.0; expected.len()];
    islands.correct(charge, |node, shift| found[node as usize] += shift);
    // In a second column, twice as much of the same.
    let mut gains = [0.0; 4];
    islands.add_gains(|node, column| [1.0, 2.0][column] * charge(node), &[0, 1], 2, &mut gains);
    let energy: f64 = expected.iter().zip(0..).map(|(x, node)| x * charge(node)).sum();
    for (gain, factor) in gains.into_iter().zip([1.0, 2.0, 0.0, 4.0]) {
        assert!((gain / energy - factor).abs() < 1e-9, "{gain} {energy}");
    }
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}

/// K x is right where the potential was set and at all its neighbours, without a word about changed rows.
#[test]
fn a_potential_that_is_set_counts_at_all_neighbours() {
    let scene = Scene::new(5_000);
    for node in [scene.matrix.nodes() / 2, scene.matrix.nodes() / 3] {
        let mut told = scene.solver(3, Preconditioner::Jacobi, 1);
        told.set_potential(1, node, 0.7);
        told.refresh(&scene.matrix, &scene.fixed(), std::iter::empty());
        let mut everywhere = told.clone();
        everywhere.evaluate();
        let rows = scene.holders.len();
        assert!(bits(&told, 1, rows) == bits(&everywhere, 1, rows), "node {node}");
        for (other, weight) in scene.matrix.row(node) {
            let before = scene.solver(3, Preconditioner::Jacobi, 1);
            let expected = before.charge(1, other) - weight * (0.7 - before.potential(1, node));
            assert!(
                (told.charge(1, other) - expected).abs() < 1e-12 * scene.matrix.diagonal(other),
                "{other}"
            );
        }
    }
}

/// The factors of the solver's rows, in their own order and with their own diagonal, are those of the same matrix given
/// in compressed rows, which are tested by themselves: every pivot, and none of what is fixed.
#[test]
fn incomplete_factors_are_those_of_the_matrix_in_any_form() {
    let mut scene = Scene::new(3_000);
    scene.move_plate(0.03);
    let mut solver = scene.solver_of_four(1, Preconditioner::Ic0, 1);
    let nodes = scene.matrix.nodes();
    let row = |node: usize| solver.rows.row_of(node);
    let mut node_of_row = vec![0; nodes];
    (0..nodes).for_each(|node| node_of_row[row(node)] = node);
    let csr = scene.matrix.to_csr();
    let mut ordered = nalgebra_sparse::CooMatrix::new(nodes, nodes);
    for (a, b, value) in csr.triplet_iter() {
        ordered.push(row(a), row(b), *value);
    }
    let ordered = nalgebra_sparse::CsrMatrix::from(&ordered);
    let fixed: Vec<bool> = node_of_row.iter().map(|&node| scene.fixed()[node]).collect();
    let mut factors = super::super::IncompleteCholesky::new(ordered.pattern()).unwrap();
    factors.refactor(ordered.values(), &fixed);
    let kx: Vec<[f64; 4]> = (0..solver.rows.len()).map(|row| [(0.3 * row as f64).sin(); 4]).collect();
    let mut expected = kx.clone();
    factors.solve(&kx, &mut expected);
    let _ = solver.inverse.descend(0, &solver.rows, Charges { kx: &kx, ahead: None }, &solver.workers);
    let Preconditioned::Double(z) = solver.inverse.preconditioned(0) else {
        panic!("IC(0) is in double precision")
    };
    for (row, (z, expected)) in z.iter().zip(&expected).enumerate() {
        let expected = if fixed[row] { 0.0 } else { -expected[0] };
        assert!((z[0] - expected).abs() <= 1e-9 * expected.abs().max(1.0), "row {row}: {} {expected}", z[0]);
    }
}

/// Columns that have converged keep their fields while others go on, alone in a group or beside others, and energies between both
/// are right.
#[test]
fn columns_that_are_done_stay_as_they_are() {
    let mut scene = Scene::new(5_000);
    let mut solver = scene.solver(11, Preconditioner::Multigrid, 1);
    iterate(&mut solver, 6);
    for height in [0.0309, 0.0307, 0.0305] {
        scene.move_plate(height);
        scene.tell(&mut solver);
        solver.go_ahead();
        iterate(&mut solver, 3);
    }
    let mut leads = 0;
    for height in [0.0303, 0.0301] {
        // Groups are ahead of what is stored, those that take steps and those that do not.
        scene.move_plate(height);
        scene.tell(&mut solver);
        solver.go_ahead();
        let rows = scene.holders.len();
        let CsrSolver::Eight(of_eight) = &solver else { panic!("11 columns are more than four") };
        let is_led = |of: &Increment<8>| (0..rows).any(|row| of.lead_of(row) != [0.0; 8]);
        leads += usize::from(of_eight.increments.iter().all(is_led));
        let is_active: Vec<bool> = (0..11).map(|column| column < 7).collect();
        let before: Vec<_> = (0..11).map(|column| bits(&solver, column, rows)).collect();
        solver.descend(&is_active);
        solver.precondition(&is_active);
        solver.step(
            &is_active.iter().map(|&active| f64::from(u8::from(active))).collect::<Vec<_>>(),
            &[0.0; 11],
        );
        for (column, before) in before.iter().enumerate() {
            let potentials =
                |of: &[[u64; 2]]| of.iter().map(|bits| f64::from_bits(bits[1])).collect::<Vec<_>>();
            let now = bits(&solver, column, rows);
            assert_eq!(potentials(before) == potentials(&now), !is_active[column], "{height} {column}");
        }
        let told = solver.state().energies.clone();
        let mut moved = solver.clone();
        moved.evaluate();
        for (energy, expected) in told.iter().zip(&moved.state().energies) {
            assert!((energy - expected).abs() < 1e-12 * told[0], "{energy} {expected}");
        }
    }
    assert!(leads > 0, "both groups are led on");
}

#[test]
fn a_column_has_the_same_bits_in_any_company_and_on_any_number_of_threads() {
    let mut scene = Scene::new(150_000);
    let rows = scene.holders.len();
    assert!(rows > 20_000, "too few rows for threads");
    let mut alone = scene.solver(3, Preconditioner::Multigrid, 1);
    let mut shared = scene.solver(3, Preconditioner::Multigrid, 3);
    let mut among_others = scene.solver(10, Preconditioner::Multigrid, 2);
    scene.move_plate(0.03);
    for solver in [&mut alone, &mut shared, &mut among_others] {
        scene.tell(solver);
        iterate(solver, 3);
    }
    for column in 0..3 {
        let expected = bits(&alone, column, rows);
        assert!(bits(&shared, column, rows) == expected, "threads");
        assert!(bits(&among_others, column, rows) == expected, "lanes");
        assert!(bits(&among_others, column + 6, rows) == expected, "groups");
    }
    assert_eq!(shared.state().energies, alone.state().energies);
}

/// Nothing of a frame that was no number is left in the next one, not in its last step either.
#[test]
fn what_was_no_number_is_forgotten() {
    let mut scene = Scene::new(3_000);
    scene.move_plate(0.03);
    for preconditioner in ALL {
        let mut solver = scene.solver(3, preconditioner, 1);
        let free = scene.holders.iter().position(|&holder| holder == FREE).unwrap();
        solver.set_potential(1, free, f64::NAN);
        solver.refresh(&scene.matrix, &scene.fixed(), std::iter::empty());
        solver.descend(&[true; 3]);
        solver.precondition(&[true; 3]);
        solver.step(&[1.0; 3], &[0.0; 3]);
        solver.clear();
        for (row, &holder) in scene.holders.iter().enumerate() {
            (0..3).for_each(|c| {
                solver.set_potential(c, row, f64::from(u8::from(usize::from(holder) == c + 1)))
            });
        }
        solver.evaluate();
        solver.descend(&[true; 3]);
        solver.precondition(&[true; 3]);
        let (own, with_step) = solver.curvatures(&[true; 3]);
        let is_finite = own.iter().chain(with_step).all(|product| product.is_finite());
        assert!(is_finite, "{preconditioner:?}: {own:?} {with_step:?}");
    }
}

/// The energies follow every potential that is set and every row that changes.
#[test]
fn energies_are_those_of_the_fields_before_any_step() {
    let mut scene = Scene::new(5_000);
    for columns in [3, 10] {
        let mut solver = scene.solver(columns, Preconditioner::Multigrid, 1);
        iterate(&mut solver, 3);
        for height in [0.031, 0.0305, 0.0304, 0.05] {
            scene.move_plate(height);
            scene.tell(&mut solver);
            let followed = solver.state().energies.clone();
            solver.evaluate();
            for (followed, expected) in followed.iter().zip(&solver.state().energies) {
                assert!((followed - expected).abs() < 1e-12 * solver.state().energies[0], "{height}");
            }
        }
    }
}

/// What coarse levels know of is not told of twice.
#[test]
fn levels_stand_in_for_islands_of_weak_bodies() {
    let found = |preconditioner, permittivity| {
        let mut scene = Scene::new(5_000);
        let mut solver = scene.solver_of_four(2, preconditioner, 1);
        scene.move_object(0.03, Material::Dielectric(RelativePermittivity::new(permittivity).unwrap()));
        let (fixed, all) = (scene.fixed(), scene.all_nodes());
        solver.islands.find(&scene.matrix, &scene.occupancy, &fixed, &all);
        !solver.islands.is_empty()
    };
    assert!(!found(Preconditioner::Multigrid, 80.0) && found(Preconditioner::Jacobi, 80.0));
    assert!(found(Preconditioner::Multigrid, 1e4));
}

/// Inside it the potential is nearly constant and nearly free: the direction that an iteration finds last.
#[test]
fn a_body_that_nearly_floats_takes_few_iterations() {
    for (preconditioner, iterations) in [(Preconditioner::Multigrid, 20), (Preconditioner::Ic0, 60)] {
        let mut scene = Scene::new(5_000);
        let mut solver = scene.solver(2, preconditioner, 1);
        scene.move_object(0.03, Material::Dielectric(RelativePermittivity::new(1e6).unwrap()));
        scene.tell(&mut solver);
        solver.find_islands(&scene.matrix, &scene.occupancy, &scene.fixed(), &scene.all_nodes());
        iterate(&mut solver, iterations);
        let mut exact = scene.solver(2, Preconditioner::Direct, 1);
        iterate(&mut exact, 2);
        let error = |of: &CsrSolver| (of.state().energies[0] / exact.state().energies[0] - 1.0).abs();
        assert!(error(&solver) < 1e-10, "{preconditioner:?}: {:e}", error(&solver));
    }
}

/// The iteration tells an indefinite matrix by the sign of these.
#[test]
fn an_indefinite_matrix_shows() {
    let scene = Scene::new(3_000);
    let mut solver = scene.solver_of_four(2, Preconditioner::Direct, 1);
    let free = solver.rows.fixed().iter().position(|fixed| !fixed).unwrap();
    solver.rows.set_diagonal(free, -1.0);
    solver.inverse.refresh(&solver.rows);
    solver.descend(&[true; 2]);
    assert!(solver.gains.iter().step_by(3).all(|&gain| gain < 0.0));
}

#[test]
fn islands_found_where_something_changed_are_those_found_at_once() {
    let body = Material::Dielectric(RelativePermittivity::new(50.0).unwrap());
    let mut scene = Scene::new(5_000);
    let mut moving = Islands::from_contrast(CONTRAST);
    for height in [0.03, 0.035, 0.06, 0.01, 0.058, 0.2, 0.03] {
        scene.move_object(height, body);
        let fixed = scene.fixed();
        moving.find(&scene.matrix, &scene.occupancy, &fixed, scene.matrix.changed_rows());
        let mut fresh = Islands::from_contrast(CONTRAST);
        fresh.find(&scene.matrix, &scene.occupancy, &fixed, &scene.all_nodes());
        assert_eq!(moving.islands(), fresh.islands(), "{height}");
        let seen = !scene.occupancy.changed_edges().is_empty();
        assert_eq!(fresh.islands().len(), usize::from(height < 0.1 && seen), "{height}");
    }
}
