//! Bodies of high permittivity, which have directions of their own.

use super::*;

/// What the island adds to rᵀz is (1ᵀr)²/(1ᵀK1), 1 its indicator, from which both sums follow without the solver.
#[test]
fn an_island_is_corrected_by_its_own_stiffness() {
    let mut scene = Scene::new(5_000);
    let mut solver = scene.solver(2, Preconditioner::Jacobi, 1);
    scene.move_object(0.03, Material::Dielectric(RelativePermittivity::new(1e6).unwrap()));
    scene.tell(&mut solver);
    let network = scene.matrix.network();
    let mut inside = vec![false; scene.matrix.nodes()];
    for (edge, coupling) in scene.occupancy.couplings().enumerate() {
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
    while islands.nodes().count() < 2 {
        height += 1e-4;
        assert!(height < 0.06);
        scene.move_object(height, Material::Dielectric(RelativePermittivity::new(1e6).unwrap()));
        islands.find(&scene.matrix, &scene.occupancy, &scene.fixed(), &scene.all_nodes());
    }
    let mut expected = vec![0.0; scene.matrix.nodes()];
    for (nodes, height) in islands.nodes().zip([1.0, -0.3, 2.0]) {
        nodes.iter().for_each(|&node| expected[node as usize] += height);
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
        assert_eq!(fresh.nodes().count(), usize::from(height < 0.1 && seen), "{height}");
    }
}
