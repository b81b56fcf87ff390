//! The operator against closed identities.

mod ahead;
mod groups;
mod islands;

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

/// Without factors an iteration would take the matrix for an indefinite one.
#[test]
fn what_cannot_be_factorised_is_told() {
    let scene = Scene::new(2_000);
    let mut solver = scene.solver_of_four(2, Preconditioner::Direct, 1);
    assert_eq!(solver.inverse.failure(), None);
    let Solver { inverse, rows, .. } = &mut *solver;
    inverse.run_out_of_memory(rows);
    let mut solver = CsrSolver::Four(solver);
    assert_eq!(solver.failure(), Some("there is not enough memory for its factors"));
    solver.descend(&[true; 2]);
    assert!(solver.gains()[0] < 0.0, "{}", solver.gains()[0]);
}
