//! The solver on a small graded lattice with a thin plate that moves through it.

mod ahead;
mod following;

use super::LatticeSolver;
use super::layout::{BLACK, RED};
use super::stencil::Stencil;
use crate::geometry::Aabb;
use crate::material::{Connection, Material, RelativePermittivity};
use crate::mesh::Lattice;
use crate::occupancy::{DepthLayers, EdgeGeometry, NO_OBJECT, Occupancy, OrthographicView};
use crate::sensor::{FREE, GROUND};
use crate::solver::SolverOptions;
use crate::solver::demand::Demand;
use crate::solver::energy_error::{ErrorRule, Experience};
use crate::solver::operator::{Operator, State};
use crate::solver::pcg::ConjugateGradients;
use crate::stiffness::{EdgeNetwork, StiffnessMatrix};
use crate::workers::Workers;
use glam::{DVec2, DVec3};

const DOMAIN: Aabb = Aabb { min: DVec3::ZERO, max: DVec3::ONE };
const COLUMNS: usize = 3;

/// Grounded walls, a grounded plate and a dielectric one, and fields without a pattern.
struct Scene {
    nodes: Vec<DVec3>,
    terminals: Vec<u16>,
    matrix: StiffnessMatrix,
    occupancy: Occupancy,
    fixed: Vec<bool>,
    columns: usize,
    solver: LatticeSolver,
}

/// Numbers between -1/2 and 1/2 without a pattern.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5
    }
}

impl Scene {
    fn new() -> Self {
        Self::with_columns(COLUMNS)
    }

    fn with_columns(columns: usize) -> Self {
        let axis = |planes: usize, low: usize| -> Vec<f64> {
            let last = planes - 1;
            (0..planes).map(|i| ((i * (i + low)) as f64) / (last * (last + low)) as f64).collect()
        };
        let lattice = Lattice::new([axis(23, 3), axis(18, 5), axis(21, 2)]).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap();
        let network = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
        let on_wall = |p: &DVec3| p.min_element() == 0.0 || p.max_element() == 1.0;
        let terminals: Vec<u16> =
            mesh.nodes().iter().map(|p| if on_wall(p) { GROUND } else { FREE }).collect();
        let fixed: Vec<bool> = terminals.iter().map(|&terminal| terminal != FREE).collect();
        let occupancy = Occupancy::empty(mesh.nodes().len(), network.edges().len());
        let matrix = StiffnessMatrix::new(network, mesh.nodes().len());
        let mut solver = LatticeSolver::new(&lattice, columns, 2, &fixed, Workers::default());
        let mut next = noise(7);
        for (node, _) in fixed.iter().enumerate().filter(|(_, fixed)| !**fixed) {
            (0..columns).for_each(|column| solver.set_potential(column, node, next()));
        }
        let nodes = mesh.nodes().to_vec();
        let mut scene = Self { nodes, terminals, matrix, occupancy, fixed, columns, solver };
        scene.refresh();
        scene
    }

    /// Plates between the heights 0.3 and 0.36, and 0.5 and 0.7, cover parts of the view.
    fn step(&mut self, corner: f64) {
        let mut depth = DepthLayers::empty(OrthographicView { domain: DOMAIN, width: 32, height: 32 }, 2);
        let view = *depth.view();
        for (object, heights) in [(0, (0.3, 0.36)), (1, (0.5, 0.7))] {
            let (front, back) = depth.layer_mut(object);
            for pixel in 0..32 * 32 {
                let from_corner = view.pixel_centre(pixel % 32, pixel / 32) - DVec2::new(corner, 0.3);
                if from_corner.min_element() > 0.0 && from_corner.max_element() < 0.1 {
                    (front[pixel], back[pixel]) = heights;
                }
            }
        }
        let network = self.matrix.network();
        let mesh = EdgeGeometry {
            nodes: &self.nodes,
            terminals: &self.terminals,
            edges: network.edges(),
            permittivity: network.permittivity(),
        };
        let plastic = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
        let materials = [Material::Conductor(Connection::Grounded), plastic];
        self.occupancy.update(mesh, &materials, &depth);
        self.matrix.update(&self.occupancy);
        self.refresh();
    }

    fn refresh(&mut self) {
        let conductors = self.occupancy.conductors();
        for &node in self.occupancy.changed_nodes() {
            let is_held = conductors[node as usize] != NO_OBJECT;
            self.fixed[node as usize] = is_held;
            if is_held {
                (0..self.columns).for_each(|column| self.solver.set_potential(column, node as usize, 0.0));
            }
        }
        let changed: Vec<u32> =
            self.matrix.changed_rows().iter().chain(self.occupancy.changed_nodes()).copied().collect();
        self.solver.refresh(&self.matrix, &self.fixed, &changed);
    }

    fn find_islands(&mut self) {
        let Self { matrix, occupancy, fixed, solver, nodes, .. } = self;
        let all: Vec<u32> = (0..nodes.len() as u32).collect();
        solver.find_islands(matrix, occupancy, fixed, &all);
    }

    /// Holds a bar at 1 V in each column, and solves.
    fn solve(&mut self, tolerance: f64) {
        for (node, p) in self.nodes.iter().enumerate() {
            let column = (3.0 * p.x) as usize;
            if (p.z - 0.85).abs() < 0.06 && (p.y - 0.5).abs() < 0.1 && (3.0 * p.x).fract() > 0.5 && p.x < 0.95
            {
                self.fixed[node] = true;
                (0..COLUMNS)
                    .for_each(|c| self.solver.set_potential(c, node, f64::from(u8::from(c == column))));
            }
        }
        let all: Vec<u32> = (0..self.nodes.len() as u32).collect();
        self.solver.refresh(&self.matrix, &self.fixed, &all);
        let rule = ErrorRule::Experience(Experience::default());
        let options = SolverOptions { tolerance, ..SolverOptions::default() };
        let _ = ConjugateGradients::new(COLUMNS, rule)
            .solve(&mut self.solver, &mut Demand::new(COLUMNS, &[]), &options)
            .unwrap();
    }

    /// Puts noise in place of the residuals and returns it with what the cycle makes of it: column by column.
    fn precondition(&mut self, seed: u64) -> [Vec<Vec<f64>>; 2] {
        let mut next = noise(seed);
        let free: Vec<usize> = (0..self.nodes.len()).filter(|&node| !self.fixed[node]).collect();
        for (column, &node) in (0..COLUMNS).flat_map(|column| free.iter().map(move |node| (column, node))) {
            let (colour, at) = self.solver.place(column, node);
            self.solver.hierarchy.levels[0].b[colour][at] = next() as f32;
        }
        self.solver.descend(&[true; COLUMNS]);
        self.solver.precondition(&[true; COLUMNS]);
        let level = &self.solver.hierarchy.levels[0];
        [&level.b, &level.x].map(|of| {
            let value = |column, node| {
                let (colour, at) = self.solver.place(column, node);
                f64::from(of[colour][at])
            };
            (0..COLUMNS).map(|column| free.iter().map(|&node| value(column, node)).collect()).collect()
        })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Columns that have converged keep their fields while others go on.
#[test]
fn columns_that_are_done_stay_as_they_are() {
    let mut scene = Scene::new();
    scene.step(0.3);
    scene.solver.go_ahead();
    // All columns have a last step.
    scene.solver.descend(&[true; COLUMNS]);
    scene.solver.precondition_and_step(&[true; COLUMNS], &[1.0; COLUMNS], &[0.0; COLUMNS]);
    let is_active = [true, false, true];
    let nodes = scene.nodes.len();
    let potentials = |solver: &LatticeSolver, column: usize| -> Vec<u64> {
        (0..nodes).map(|node| solver.potential(column, node).to_bits()).collect()
    };
    let before = [0, 1, 2].map(|column| potentials(&scene.solver, column));
    let a = is_active.map(|active| f64::from(u8::from(active)));
    for _ in 0..2 {
        scene.solver.descend(&is_active);
        scene.solver.precondition(&is_active);
        let _ = scene.solver.curvatures(&is_active);
        scene.solver.step(&a, &[0.0; COLUMNS]);
        scene.solver.descend(&is_active);
        scene.solver.precondition_and_step(&is_active, &a, &[0.0; COLUMNS]);
    }
    for (column, before) in before.iter().enumerate() {
        assert_eq!(potentials(&scene.solver, column) == *before, !is_active[column], "{column}");
    }
}

/// Coarser levels leave out what is negligible, each of up to three stages a little more; nothing that was not reached stays
/// behind.
#[test]
fn refreshing_what_changed_gives_a_fresh_hierarchy() {
    let mut moving = Scene::new();
    for corner in [0.1, 0.12, 0.4, 0.44, 0.5, 0.52, 0.33] {
        moving.step(corner);
    }
    let mut fresh = Scene::new();
    fresh.step(0.33);
    let levels = moving.solver.hierarchy.levels.iter().zip(&fresh.solver.hierarchy.levels);
    for (depth, (a, b)) in levels.enumerate() {
        let slack = 0.12 * depth as f32;
        let numbers = |stencil: &Stencil<f32>| -> Vec<f32> {
            let all = stencil.next.iter().chain([&stencil.centre]).flatten().flatten();
            all.copied().collect()
        };
        for (a, b) in numbers(&a.stencil).into_iter().zip(numbers(&b.stencil)) {
            assert!((a - b).abs() <= slack * a.min(b), "level {depth}: {a} {b}");
        }
    }
}

/// But for rounding, as relaxed nodes pass on what they change.
#[test]
fn the_residual_of_changed_rows_is_that_computed_everywhere() {
    for single in [false, true] {
        let mut scene = Scene::new();
        scene.solve(1e-3);
        if single {
            scene.solver.switch_precision(&scene.matrix);
        }
        scene.solver.evaluate();
        for corner in [0.1, 0.12, 0.4, 0.44] {
            scene.step(corner);
            let incremental = scene.solver.hierarchy.levels[0].b.clone();
            let followed = scene.solver.state().clone();
            scene.solver.evaluate();
            let pairs = incremental.iter().flatten().zip(scene.solver.hierarchy.levels[0].b.iter().flatten());
            let away = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let diagonal = (0..scene.nodes.len()).map(|node| scene.matrix.diagonal(node)).fold(0.0, f64::max);
            assert!(f64::from(away) < 2e-7 * diagonal, "{corner}: {away} {diagonal}");
            let State { energies, residual, charge, .. } = scene.solver.state();
            let are_near =
                |a: &[f64], b: &[f64], part| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= part * b.abs());
            assert!(are_near(&followed.energies, energies, 1e-6), "{corner}: {followed:?} {energies:?}");
            assert!(are_near(&followed.residual, residual, 1e-5), "{corner}: {followed:?} {residual:?}");
            assert_eq!(&followed.charge, charge, "{corner}");
        }
    }
}

/// One column, and more than are relaxed together.
#[test]
fn relaxed_nodes_are_followed_in_any_number_of_columns() {
    for columns in [1, 6] {
        let mut scene = Scene::with_columns(columns);
        scene.solver.evaluate();
        for (corner, single) in [(0.1, false), (0.15, true), (0.2, true)] {
            if single && !scene.solver.is_single() {
                scene.solver.switch_precision(&scene.matrix);
                scene.solver.evaluate();
            }
            let potentials = |scene: &Scene| -> Vec<f64> {
                let all = 0..scene.nodes.len() * columns;
                all.map(|at| scene.solver.potential(at % columns, at / columns)).collect()
            };
            let before = potentials(&scene);
            scene.step(corner);
            let now = potentials(&scene);
            let are_free = |node: usize| !scene.fixed[node];
            let relaxed = (0..before.len()).filter(|&at| are_free(at / columns) && before[at] != now[at]);
            assert!(relaxed.count() > 10 * columns);
            let followed = scene.solver.state().clone();
            scene.solver.evaluate();
            let State { energies, residual, .. } = scene.solver.state();
            let largest = energies.iter().copied().fold(0.0, f64::max);
            let pairs = || followed.energies.iter().zip(energies);
            assert!(pairs().all(|(a, b)| (a - b).abs() <= 1e-6 * largest), "{followed:?} {energies:?}");
            let mut pairs = followed.residual.iter().zip(residual);
            assert!(pairs.all(|(a, b)| (a - b).abs() <= 1e-5 * b), "{followed:?} {residual:?}");
        }
    }
}

/// The energy of each column's potentials with the matrix as it is.
fn energies_of(scene: &Scene, fields: &[Vec<f64>]) -> Vec<f64> {
    let matrix = scene.matrix.to_csr();
    let energy = |x: &Vec<f64>| matrix.triplet_iter().map(|(i, j, value)| x[i] * value * x[j]).sum();
    fields.iter().map(energy).collect()
}

/// The potentials of nodes, of each column.
fn fields_of(scene: &Scene) -> Vec<Vec<f64>> {
    let field = |column| (0..scene.nodes.len()).map(|node| scene.solver.potential(column, node)).collect();
    (0..COLUMNS).map(field).collect()
}

/// Nodes that a body left or came to keep their potentials otherwise.
#[test]
fn nodes_whose_rows_changed_are_relaxed() {
    for single in [false, true] {
        let mut scene = Scene::new();
        scene.step(0.1);
        scene.solve(1e-9);
        if single {
            scene.solver.switch_precision(&scene.matrix);
        }
        scene.solver.evaluate();
        for corner in [0.12, 0.16, 0.2] {
            let before = fields_of(&scene);
            scene.step(corner);
            let now = fields_of(&scene);
            let mut stayed = before;
            for (node, _) in scene.fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
                stayed.iter_mut().zip(&now).for_each(|(stayed, now)| stayed[node] = now[node]);
            }
            let (stayed, now) = (energies_of(&scene, &stayed), energies_of(&scene, &now));
            assert!(stayed.iter().zip(&now).all(|(stayed, now)| now < stayed), "{stayed:?} {now:?}");
            let followed = scene.solver.state().energies.iter().step_by(COLUMNS + 1);
            assert!(followed.zip(&now).all(|(a, b)| (a - b).abs() < 1e-6 * b), "{now:?}");
        }
    }
}

/// The largest difference between the energies and those that the assembled matrix gives, relative to the latter.
fn error_of_energies(scene: &Scene) -> f64 {
    let matrix = scene.matrix.to_csr();
    let field = |column| -> Vec<f64> {
        (0..scene.nodes.len()).map(|node| scene.solver.potential(column, node)).collect()
    };
    let fields: Vec<Vec<f64>> = (0..COLUMNS).map(field).collect();
    let energies = &scene.solver.state().energies;
    let pairs = (0..COLUMNS).flat_map(|s| (0..COLUMNS).map(move |t| (s, t)));
    let errors = pairs.map(|(s, t)| {
        let applied: f64 =
            matrix.triplet_iter().map(|(i, j, value)| fields[s][i] * value * fields[t][j]).sum();
        let scale = (energies[s * COLUMNS + s] * energies[t * COLUMNS + t]).sqrt();
        (energies[s * COLUMNS + t] - applied).abs() / scale
    });
    errors.fold(0.0, f64::max)
}

/// Residuals are multiplied in single precision, which costs the less the smaller they are.
#[test]
fn energies_are_those_of_the_assembled_matrix() {
    let mut scene = Scene::new();
    scene.step(0.2);
    scene.solver.evaluate();
    let without_pattern = error_of_energies(&scene);
    assert!(without_pattern < 1e-7, "{without_pattern}");
    for tolerance in [1e-4, 1e-7, 1e-10] {
        scene.solve(tolerance);
        let error = error_of_energies(&scene);
        // The residual goes with the root of the error that is left.
        let expected = 1e-8 * f64::sqrt(tolerance) + 1e-15;
        assert!(error < expected, "{tolerance}: {error}");
    }
}

/// Rounded potentials have energies of their own, which differ from those of the exact ones by squares of the rounding;
/// what they are computed to be has the rounding of the weights.
#[test]
fn single_precision_changes_energies_by_little() {
    let mut scene = Scene::new();
    scene.step(0.2);
    scene.solve(1e-12);
    let exact = scene.solver.state().energies.clone();
    scene.solver.switch_precision(&scene.matrix);
    scene.solver.evaluate();
    assert!(scene.solver.is_single());
    let own = error_of_energies(&scene);
    assert!(own < 5e-8, "{own}");
    for (single, double) in scene.solver.state().energies.iter().zip(&exact) {
        assert!((single - double).abs() < 1e-7 * exact[0], "{single} {double}");
    }
    scene.solver.switch_precision(&scene.matrix);
    scene.solver.evaluate();
    let of_rounded = error_of_energies(&scene);
    assert!(of_rounded < 1e-12, "{of_rounded}");
}

/// A step on the way out of a cycle is the same as one after it.
#[test]
fn a_step_behind_the_cycle_has_the_bits_of_one_after_it() {
    let (a, b) = ([0.9, 1.1, 1.0], [0.0; COLUMNS]);
    let after = |together: bool| {
        let mut scene = Scene::new();
        scene.step(0.2);
        scene.solver.switch_precision(&scene.matrix);
        scene.solver.evaluate();
        let active = [true; COLUMNS];
        scene.solver.descend(&active);
        if together {
            scene.solver.precondition_and_step(&active, &a, &b);
        } else {
            scene.solver.precondition(&active);
            scene.solver.step(&a, &b);
        }
        let potentials: Vec<u64> = (0..scene.nodes.len() * COLUMNS)
            .map(|at| scene.solver.potential(at % COLUMNS, at / COLUMNS).to_bits())
            .collect();
        (potentials, scene.solver.state().energies.clone())
    };
    assert!(after(true) == after(false));
}

#[test]
fn the_cycle_is_symmetric_and_positive() {
    let mut scene = Scene::new();
    scene.step(0.2);
    let [a, of_a] = scene.precondition(1);
    let gains = scene.solver.gains().to_vec();
    let [b, of_b] = scene.precondition(2);
    for column in 0..COLUMNS {
        let (a_a, b_b) = (dot(&a[column], &of_a[column]), dot(&b[column], &of_b[column]));
        let (b_of_a, a_of_b) = (dot(&b[column], &of_a[column]), dot(&a[column], &of_b[column]));
        assert!(a_a > 0.0 && b_b > 0.0);
        assert!((b_of_a - a_of_b).abs() < 1e-5 * (a_a * b_b).sqrt(), "{b_of_a} {a_of_b}");
        // The way down alone told as much.
        for other in 0..COLUMNS {
            let (told, product) = (gains[column * COLUMNS + other], dot(&a[other], &of_a[column]));
            assert!((told - product).abs() < 1e-5 * a_a, "{column} {other}: {told} {product}");
        }
    }
}

/// Padding must stay zero: a node at the end of a row meets nodes of other rows with the weight zero only.
#[test]
fn nothing_is_written_where_no_free_node_is() {
    let mut scene = Scene::new();
    scene.step(0.2);
    let _ = scene.precondition(5);
    let level = &scene.solver.hierarchy.levels[0];
    let mut free = [RED, BLACK].map(|colour| vec![false; level.x[colour].len()]);
    for node in (0..scene.nodes.len()).filter(|&node| !scene.fixed[node]) {
        for column in 0..COLUMNS {
            let (colour, at) = scene.solver.place(column, node);
            free[colour][at] = true;
        }
    }
    for colour in [RED, BLACK] {
        for (x, free) in level.x[colour].iter().zip(&free[colour]) {
            assert!(*free || *x == 0.0);
        }
    }
}
