//! Fields that are led on along their last change.

use super::*;
use crate::mesh::{Background, Edges};

/// With the plate moved once more after the fields moved, the same fields set one by one have the same energies, residuals
/// and gains; and they lack less than those that stand still. Also where a body of high permittivity is an island.
#[test]
fn going_ahead_is_as_good_as_moving_the_fields() {
    for has_islands in [false, true] {
        let mut scene = Scene::new();
        scene.step(0.3);
        scene.solver.switch_precision(&scene.matrix);
        scene.solve(1e-4);
        let active = [true; COLUMNS];
        let step = |scene: &mut Scene, corner: f64| {
            scene.step(corner);
            if has_islands {
                scene.find_islands();
            }
        };
        for corner in [0.335, 0.365] {
            step(&mut scene, corner);
            scene.solver.go_ahead();
            scene.solver.descend(&active);
            scene.solver.precondition_and_step(&active, &[0.9, 1.0, 1.1], &[0.0; COLUMNS]);
        }
        step(&mut scene, 0.395);
        assert_eq!(!scene.solver.islands.is_empty(), has_islands);
        let State { energies: standing, residual: before, .. } = scene.solver.state().clone();
        scene.solver.go_ahead();
        scene.solver.descend(&active);
        let (ahead, gains) = (scene.solver.state().clone(), scene.solver.gains().to_vec());
        let potentials: Vec<f64> = (0..scene.nodes.len() * COLUMNS)
            .map(|at| scene.solver.potential(at % COLUMNS, at / COLUMNS))
            .collect();
        scene.solver.evaluate();
        for (at, potential) in potentials.into_iter().enumerate() {
            scene.solver.set_potential(at % COLUMNS, at / COLUMNS, potential);
        }
        scene.solver.evaluate();
        scene.solver.descend(&active);
        let moved = scene.solver.state();
        for (column, before) in before.into_iter().enumerate() {
            let own = column * (COLUMNS + 1);
            let gained = standing[own] - ahead.energies[own];
            assert!(gained > 0.0, "{column}: {gained:e} of {}", standing[own]);
            // A difference of sums in single precision, which are as large as what was there before.
            let error = (ahead.residual[column] - moved.residual[column]).abs();
            assert!(error < 1e-6 * before && ahead.residual[column] < 1e-3 * before, "{column}");
            for other in 0..COLUMNS {
                let at = column * COLUMNS + other;
                let error = (ahead.energies[at] - moved.energies[at]).abs();
                assert!(error < 1e-7 * standing[own], "{column} {other}: {error:e}, {gained:e}");
                let error = (gains[at] - scene.solver.gains()[at]).abs();
                assert!(error < 1e-3 * gains[own], "{column} {other}: {error:e} of {:e}", gains[own]);
            }
        }
    }
}

/// What nodes were relaxed by between two steps belongs to the change that is followed; so do their charges.
#[test]
fn the_last_change_is_all_that_fields_changed_by() {
    let mut scene = Scene::new();
    scene.step(0.3);
    scene.solver.switch_precision(&scene.matrix);
    scene.solve(1e-4);
    let active = [true; COLUMNS];
    let step = |scene: &mut Scene| {
        scene.solver.go_ahead();
        scene.solver.descend(&active);
        scene.solver.precondition_and_step(&active, &[1.0; COLUMNS], &[0.0; COLUMNS]);
    };
    for corner in [0.33, 0.35] {
        scene.step(corner);
        step(&mut scene);
    }
    let (before, was_fixed) = (fields_of(&scene), scene.fixed.clone());
    scene.step(0.37);
    let relaxed = fields_of(&scene);
    step(&mut scene);
    let now = fields_of(&scene);
    let free: Vec<usize> = (0..scene.nodes.len()).filter(|&n| !was_fixed[n] && !scene.fixed[n]).collect();
    for column in 0..COLUMNS {
        assert!(free.iter().filter(|&&n| before[column][n] != relaxed[column][n]).count() > 20);
        for &node in &free {
            let (colour, at) = scene.solver.place(column, node);
            let change = f64::from(scene.solver.increment.fields[colour][at]);
            let expected = now[column][node] - before[column][node];
            assert!((change - expected).abs() < 1e-6, "{column} {node}: {change} {expected}");
        }
    }
    // Charges computed anew are the same.
    let all: Vec<u32> = (0..scene.nodes.len() as u32).collect();
    let charges = scene.solver.hierarchy.levels[0].charges.clone();
    scene.solver.refresh(&scene.matrix, &scene.fixed, &all);
    let largest = charges.iter().flatten().fold(0.0f32, |most, charge| most.max(charge.abs()));
    let pairs = charges.iter().flatten().zip(scene.solver.hierarchy.levels[0].charges.iter().flatten());
    assert!(pairs.clone().count() > 0 && largest > 0.0);
    for (followed, computed) in pairs {
        assert!((followed - computed).abs() < 1e-4 * largest, "{followed} {computed} of {largest}");
    }
}

/// While fields are led on, coarse networks wait for what changes weights by little, but for few frames; and not for a weight that
/// is another, nor for a potential that is fixed or released.
#[test]
fn coarse_networks_wait_for_what_changes_little() {
    let mut scene = Scene::new();
    scene.solver.switch_precision(&scene.matrix);
    scene.solve(1e-4);
    let (network, all) = (scene.matrix.network().clone(), (0..scene.nodes.len() as u32).collect::<Vec<_>>());
    let times = |factor: f64| {
        let Edges::Lattice(lattice) = network.edges() else { panic!("no lattice") };
        let permittivity = Background::new(vec![factor; lattice.tet_count()]);
        StiffnessMatrix::new(EdgeNetwork::assemble_lattice(lattice, &permittivity), scene.nodes.len())
    };
    let (active, mut solver, mut fixed) = ([true; COLUMNS], scene.solver.clone(), scene.fixed.clone());
    let step = |solver: &mut LatticeSolver| {
        solver.go_ahead();
        solver.descend(&active);
        solver.precondition_and_step(&active, &[1.0; COLUMNS], &[0.0; COLUMNS]);
    };
    let follows = |solver: &mut LatticeSolver, matrix: &StiffnessMatrix, fixed: &[bool]| {
        let coarse = |of: &LatticeSolver| {
            of.hierarchy.levels[1..].iter().map(|level| level.stencil.centre.clone()).collect::<Vec<_>>()
        };
        let before = coarse(solver);
        solver.refresh(matrix, fixed, &all);
        solver.go_ahead();
        coarse(solver) != before
    };
    step(&mut solver);
    let frames = [1.5, 1.6, 1.7, 1.8].map(|factor| follows(&mut solver, &times(factor), &fixed));
    assert_eq!(frames, [false, false, false, true]);
    step(&mut solver);
    assert!(!follows(&mut solver, &times(1.0), &fixed) && follows(&mut solver, &times(5.0), &fixed));
    step(&mut solver);
    assert!(follows(&mut solver, &times(1.1), &fixed));
    step(&mut solver);
    let free = (0..all.len()).find(|node| !fixed[*node] && scene.nodes[*node].z > 0.3).unwrap();
    for is_fixed in [true, false] {
        fixed[free] = is_fixed;
        assert!(follows(&mut solver, &times(1.1), &fixed), "{is_fixed}");
        step(&mut solver);
    }
}
