//! Fields that are led on along their last change, and rows that are relaxed.

use super::*;

/// Where fields are led along their last change they have less energy, and energies and K x are those of where they are.
#[test]
fn going_ahead_takes_fields_to_less_energy() {
    for (columns, preconditioner) in
        [(3, Preconditioner::Multigrid), (10, Preconditioner::Multigrid), (3, Preconditioner::Ic0)]
    {
        let mut scene = Scene::new(20_000);
        let mut solvers = [1, 3].map(|threads| scene.solver(columns, preconditioner, threads));
        solvers.iter_mut().for_each(|solver| iterate(solver, 6));
        for height in [0.0309, 0.0307, 0.0305] {
            scene.move_plate(height);
            for solver in &mut solvers {
                scene.tell(solver);
                solver.go_ahead();
                iterate(solver, 3);
            }
        }
        // Once more without a step; what gains less than 1e-7 is left.
        for (height, least) in [(0.0303, 1e-6), (0.0301, -1e-7)] {
            scene.move_plate(height);
            let standing = solvers.each_mut().map(|solver| {
                scene.tell(solver);
                let standing = solver.state().energies.clone();
                solver.go_ahead();
                standing
            });
            let [solver, other] = &mut solvers;
            let (rows, ahead) = (scene.holders.len(), solver.state().energies.clone());
            for column in 0..columns {
                let own = column * (columns + 1);
                assert!(ahead[own] <= (1.0 - least) * standing[0][own], "{height} {column}");
                assert!(bits(solver, column, rows) == bits(other, column, rows), "{height} {column}");
            }
            let mut moved = solver.clone();
            moved.evaluate();
            let largest = moved.state().energies.iter().copied().fold(0.0, f64::max);
            for (ahead, expected) in ahead.iter().zip(&moved.state().energies) {
                assert!((ahead - expected).abs() < 1e-12 * largest, "{ahead} {expected}");
            }
            let nodes = scene.matrix.nodes();
            for (column, row) in (0..columns).flat_map(|column| (0..nodes).map(move |row| (column, row))) {
                let (charge, expected) = (solver.charge(column, row), moved.charge(column, row));
                assert!((charge - expected).abs() < 1e-12 * largest, "{column} {row}");
            }
            // What a cycle makes of them is the same whether they are moved there or not.
            let mut told = solver.clone();
            let [of_told, of_moved] = [&mut told, &mut moved].map(|solver| {
                let active = vec![true; columns];
                solver.descend(&active);
                solver.precondition(&active);
                let curvatures = solver.curvatures(&active).0.to_vec();
                [solver.gains().to_vec(), curvatures]
            });
            for (told, moved) in of_told.iter().zip(&of_moved) {
                for (told, expected) in told.iter().zip(moved) {
                    assert!((told - expected).abs() < 1e-4 * moved[0], "{told} {expected}");
                }
            }
            // And once more without a step, energies are still right.
            told.go_ahead();
            let energies = told.state().energies.clone();
            told.evaluate();
            for (ahead, expected) in energies.iter().zip(&told.state().energies) {
                assert!((ahead - expected).abs() < 1e-12 * largest, "{ahead} {expected}");
            }
        }
    }
}

/// Threads share rows whose values are taken over or whose charges are computed anew, and those that are relaxed, which happens
/// while coarse networks follow.
#[test]
fn threads_share_what_follows_from_rows_that_changed_to_the_same_bits() {
    let mut scene = Scene::new(150_000);
    let mut solvers = [1, 2].map(|threads| scene.solver(3, Preconditioner::Multigrid, threads));
    let _awake = solvers.each_ref().map(|solver| of_four(solver).workers.wake_all());
    for height in [0.0309, 0.0307, 0.0305, 0.0303] {
        scene.move_plate(height);
        for solver in &mut solvers {
            scene.tell(solver);
            solver.go_ahead();
            iterate(solver, 1);
        }
        let [alone, shared] = &solvers;
        assert!(of_four(alone).rows.changed().len() > 4 * rows::ROWS_OF_A_TASK);
        assert_eq!(alone.state().energies, shared.state().energies, "{height}");
        for column in 0..3 {
            let rows = scene.holders.len();
            assert!(bits(alone, column, rows) == bits(shared, column, rows), "{height} {column}");
        }
    }
    // Once more without a step.
    scene.move_plate(0.0301);
    for solver in &mut solvers {
        scene.tell(solver);
        solver.go_ahead();
    }
    let [alone, shared] = &solvers;
    assert!(of_four(alone).increments[0].relaxed.len() > 100);
    assert_eq!(alone.state().energies, shared.state().energies);
    for column in 0..3 {
        let rows = scene.holders.len();
        assert!(bits(alone, column, rows) == bits(shared, column, rows), "{column}");
    }
}

/// What going ahead gains is learned of inverses, too, for which fields are moved there.
#[test]
fn steady_motion_is_followed_whatever_the_inverse() {
    for preconditioner in [Preconditioner::Multigrid, Preconditioner::Ic0, Preconditioner::Direct] {
        let mut scene = Scene::new(20_000);
        let mut solver = scene.solver(3, preconditioner, 1);
        let is_led = (0..12).map(|frame| {
            scene.move_plate(0.0309 - 1e-4 * f64::from(frame));
            scene.tell(&mut solver);
            solver.go_ahead();
            let is_led =
                of_four(&solver).increments[0].charges_of(&of_four(&solver).groups[0]).ahead.is_some();
            iterate(&mut solver, 12);
            is_led
        });
        let is_led: Vec<bool> = is_led.collect();
        assert!(is_led[2..].iter().all(|led| *led), "{preconditioner:?} {is_led:?}");
    }
}

fn of_four(solver: &CsrSolver) -> &Solver<4> {
    match solver {
        CsrSolver::Four(solver) => solver,
        CsrSolver::Eight(_) => panic!("more than four columns"),
    }
}

/// Of up to four columns, row by row.
fn fields(solver: &CsrSolver) -> Vec<[f64; 4]> {
    of_four(solver).groups[0].x.clone()
}

/// What rows were relaxed by before a step belongs to the change that fields are led on by, and its charges are those of it.
#[test]
fn the_last_change_is_all_that_fields_changed_by() {
    let mut scene = Scene::new(20_000);
    let mut solver = scene.solver(3, Preconditioner::Multigrid, 1);
    iterate(&mut solver, 6);
    for height in [0.0309, 0.0307] {
        scene.move_plate(height);
        scene.tell(&mut solver);
        solver.go_ahead();
        iterate(&mut solver, 1);
    }
    let (before, was_fixed) = (fields(&solver), of_four(&solver).rows.fixed().to_vec());
    // A frame without a step, and one with.
    for height in [0.0305, 0.0303] {
        scene.move_plate(height);
        scene.tell(&mut solver);
        solver.go_ahead();
    }
    let relaxed = &of_four(&solver).increments[0].relaxed;
    assert!(relaxed.is_done());
    let relaxed = relaxed.len();
    iterate(&mut solver, 1);
    let (solver, now) = (of_four(&solver), fields(&solver));
    let (increment, rows) = (&solver.increments[0], &solver.rows);
    let free: Vec<usize> = (0..rows.len()).filter(|&row| !was_fixed[row] && !rows.fixed()[row]).collect();
    assert!(relaxed > 20, "{relaxed}");
    for &row in &free {
        for lane in 0..3 {
            let (change, expected) = (increment.fields[row][lane], now[row][lane] - before[row][lane]);
            assert!((change - expected).abs() < 1e-12, "{row} {lane}: {change} {expected}");
        }
        let (charge, expected) = (increment.charges[row], rows.product(row, &increment.fields, 0));
        for lane in 0..3 {
            assert!((charge[lane] - expected[lane]).abs() < 1e-12, "{row} {lane}: {charge:?} {expected:?}");
        }
    }
}
