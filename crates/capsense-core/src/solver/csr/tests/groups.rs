//! Columns side by side in groups, and beside other groups.

use super::*;

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
