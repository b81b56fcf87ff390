//! What steps of made-up solves tell of the error.

use super::*;

/// Plain conjugate gradients on a diagonal matrix from the error (1, 1, ...) but for its first entries, recorded.
fn solve(error: &mut EnergyError, eigenvalues: &[f64], first: &[f64], iterations: usize) -> f64 {
    let mut e = vec![1.0; eigenvalues.len()];
    e[..first.len()].copy_from_slice(first);
    let mut r: Vec<f64> = e.iter().zip(eigenvalues).map(|(e, k)| e * k).collect();
    let mut p = r.clone();
    let mut rr: f64 = r.iter().map(|r| r * r).sum();
    error.start();
    let mut left: f64 = e.iter().zip(eigenvalues).map(|(e, k)| e * e * k).sum();
    for _ in 0..iterations {
        let q: Vec<f64> = p.iter().zip(eigenvalues).map(|(p, k)| p * k).collect();
        let alpha = rr / p.iter().zip(&q).map(|(p, q)| p * q).sum::<f64>();
        left -= alpha * rr;
        error.record(0, Step { drop: alpha * rr, excess: 0.0, energy: 1e6, length: 1.0 });
        error.advance();
        r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
        let next: f64 = r.iter().map(|r| r * r).sum();
        p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + next / rr * *p);
        rr = next;
    }
    left
}

fn fresh() -> EnergyError {
    EnergyError::new(ErrorRule::Experience(Experience::default()), 1)
}

fn eigenvalues() -> Vec<f64> {
    (0..30).map(|k| 1.0 + 0.05 * f64::from(k)).collect()
}

/// What one long solve shows holds for short ones from other errors.
#[test]
fn the_estimate_bounds_the_error() {
    let (mut error, eigenvalues) = (fresh(), eigenvalues());
    let _ = solve(&mut error, &eigenvalues, &[], 8);
    error.finish();
    for steps in 1..8 {
        let left = solve(&mut error, &eigenvalues, &[2.0, -3.0, 0.5], steps);
        let estimate = error.relative(0).unwrap() * 1e6;
        assert!(estimate >= left && estimate < 10.0 * left, "{steps}: {estimate:e} {left:e}");
    }
}

/// A direction of low energy in the preconditioned matrix, unlike all that was seen before, shows in the third step:
/// drops no longer fall.
#[test]
fn slow_convergence_shows_however_good_the_experience() {
    let (mut error, mut eigenvalues) = (fresh(), eigenvalues());
    let _ = solve(&mut error, &eigenvalues, &[], 8);
    error.finish();
    eigenvalues[0] = 0.1;
    let left = solve(&mut error, &eigenvalues, &[10.0], 4);
    let estimate = error.relative(0).unwrap() * 1e6;
    assert!(estimate > 0.3 * left, "{estimate:e} {left:e}");
}

#[test]
fn nothing_is_known_after_one_step_without_experience() {
    let mut error = fresh();
    let _ = solve(&mut error, &eigenvalues(), &[], 1);
    assert_eq!(error.relative(0), None);
    assert!(!error.is_below(0, 1.0));
}

fn step(drop: f64, length: f64) -> Step {
    Step { drop, excess: 0.0, energy: 1.0, length }
}

fn solve_with(error: &mut EnergyError, steps: &[Step]) {
    error.start();
    for &step in steps {
        error.record(0, step);
        error.advance();
    }
}

/// What the solves of an object that appears show is too little for the motions that follow.
#[test]
fn the_first_motion_after_a_large_change_is_learned_from() {
    let mut error = fresh();
    let motion = [step(1e-4, 1.0), step(1e-6, 1.0), step(1e-8, 1.0), step(1e-10, 1.0)];
    for _ in 0..=FIRST_TO_LEARN {
        solve_with(&mut error, &motion);
        error.finish();
    }
    assert!(!error.is_learning());
    solve_with(&mut error, &[step(1.0, 1.0), step(1e-2, 1.0), step(1e-4, 1.0)]);
    error.finish();
    solve_with(&mut error, &motion[..1]);
    assert!(error.is_estimated_below(0, 1e-4) && !error.is_below(0, 1e-4));
}

/// After a small change, one step is enough to judge; after a larger one two, after a large one three.
#[test]
fn the_larger_a_change_the_more_steps_must_show() {
    let mut error = fresh();
    let motion = [step(1e-4, 1.0), step(1e-6, 1.0), step(1e-8, 1.0), step(1e-10, 1.0)];
    solve_with(&mut error, &motion);
    error.finish();
    for (first, needed) in [(1e-3, 1), (1e-2, 2), (0.1, 3)] {
        let steps = [step(first, 1.0), step(1e-3 * first, 1.0), step(1e-6 * first, 1.0)];
        for taken in 1..=3 {
            solve_with(&mut error, &steps[..taken]);
            assert_eq!(error.relative(0).is_some(), taken >= needed, "{first} {taken}");
        }
    }
}

/// What a column did not do while it was done is nothing, however long ago its remembered steps are.
#[test]
fn a_column_that_goes_on_has_taken_no_steps_meanwhile() {
    let mut error = EnergyError::new(ErrorRule::Experience(Experience::default()), 2);
    error.start();
    for index in 0..REMEMBERED + 8 {
        let drop = 10_f64.powi(-(index as i32) / 8);
        if !(6..REMEMBERED + 7).contains(&index) {
            error.record(1, step(drop, 1.0));
        }
        error.record(0, step(drop, 1.0));
        error.advance();
    }
    let drops: Vec<f64> = error.steps[REMEMBERED..].iter().map(|step| step.drop).collect();
    assert_eq!(drops.iter().filter(|drop| **drop > 0.0).count(), 1, "{drops:?}");
}

/// What is told after a change that is none of a motion is a good part more than after others, for all columns.
#[test]
fn after_a_large_change_more_is_told_to_be_left() {
    let told_after = |error: &mut EnergyError, first: f64| {
        error.start();
        for (of_first, of_second) in [(first, 1e-4), (1e-5, 1e-6), (1e-7, 1e-8), (1e-9, 1e-10)] {
            error.record(0, step(of_first, 1.0));
            error.record(1, step(of_second, 1.0));
            error.advance();
        }
        [0, 1].map(|column| error.relative(column).unwrap())
    };
    let mut error = EnergyError::new(ErrorRule::Experience(Experience::default()), 2);
    let _ = told_after(&mut error, 2e-2);
    error.finish();
    let mut told = [4e-2, 2e-2].map(|first| told_after(&mut error, first));
    told[1].iter_mut().for_each(|told| *told *= CAUTION_AFTER_LARGE_CHANGE);
    assert_eq!(told[0], told[1]);
}

/// A step along a direction that the preconditioner knows badly is longer than others.
#[test]
fn after_a_long_step_much_may_be_left() {
    let mut error = fresh();
    let motion = [step(1e-4, 1.0), step(1e-6, 1.0), step(1e-8, 1.0), step(1e-10, 1.0)];
    solve_with(&mut error, &motion);
    error.finish();
    solve_with(&mut error, &[step(1e-4, 1.0)]);
    assert!(error.relative(0).unwrap() < 1e-5);
    solve_with(&mut error, &[step(1e-4, 2.0)]);
    assert!(error.relative(0).unwrap() > 5e-4);
}

#[test]
fn what_was_seen_fades() {
    let (mut error, eigenvalues) = (fresh(), eigenvalues());
    let bad: Vec<f64> = eigenvalues.iter().map(|k| k * k * k).collect();
    let _ = solve(&mut error, &bad, &[], 8);
    error.finish();
    let share = |error: &EnergyError| match error.rule {
        ErrorRule::Experience(experience) => experience.share(0).unwrap(),
        ErrorRule::Window => f64::NAN,
    };
    let after_bad = share(&error);
    for _ in 0..200 {
        let _ = solve(&mut error, &eigenvalues, &[], 8);
        error.finish();
    }
    assert!(share(&error) < 0.5 * after_bad);
}

/// A direction that one column meets late is one that others may not have met yet: a column that was done goes on.
#[test]
fn a_long_step_of_one_column_tells_of_the_others() {
    let mut error = EnergyError::new(ErrorRule::Experience(Experience::default()), 2);
    let motion = [step(1e-4, 1.0), step(1e-6, 1.0), step(1e-8, 1.0), step(1e-10, 1.0)];
    let solve = |error: &mut EnergyError, lengths: &[f64]| {
        error.start();
        for (index, &length) in lengths.iter().enumerate() {
            if index < 1 {
                error.record(1, motion[index]);
            }
            error.record(0, Step { length, ..motion[index] });
            error.advance();
        }
    };
    solve(&mut error, &[1.0; 4]);
    error.finish();
    solve(&mut error, &[1.0; 3]);
    let told = [0, 1].map(|column| error.relative(column).unwrap());
    assert!(told[1] < 1e-5, "{told:?}");
    // Only the first two steps were long: of what is left after the third the first column knows as much as before.
    solve(&mut error, &[2.0, 2.0, 1.0]);
    let with_long = [0, 1].map(|column| error.relative(column).unwrap());
    assert_eq!(with_long, [told[0], LEFT_AFTER_LONG * 1e-4]);
    // What a first step was tells nothing of others.
    solve(&mut error, &[2.0, 1.0, 1.0]);
    assert_eq!([0, 1].map(|column| error.relative(column).unwrap()), told);
}

/// A step that is a little longer than those learned from means nothing at first, and that much is left once a solve is long.
#[test]
fn long_steps_count_for_more_in_long_solves() {
    let step = |length| Step { drop: 1e-7, excess: 0.0, energy: 1.0, length };
    let mut error = fresh();
    for (count, length) in [(USUAL_STEPS, 1.3), (USUAL_STEPS + 1, 1.3), (USUAL_STEPS + 1, 1.1)] {
        let ErrorRule::Experience(experience) = &mut error.rule else { panic!("experience") };
        experience.lengths = [1.0; KINDS_OF_STEPS];
        error.start();
        for index in 0..count {
            let falling = Step { drop: 10_f64.powi(-(index as i32)), ..step(1.0) };
            error.record(0, if index + 1 == count { Step { length, ..falling } } else { falling });
            error.advance();
        }
        let last = 10_f64.powi(1 - count as i32);
        let is_long = error.relative(0).unwrap() >= LEFT_AFTER_LONG * last;
        assert_eq!(is_long, count > USUAL_STEPS && length > LONG_THEN, "{count} {length}");
    }
}

/// What a slow solve has dropped lately is told from the sums that are kept, whatever their number.
#[test]
fn the_last_sixth_of_a_slow_solve_is_summed() {
    let drops: Vec<f64> = (0..3000).map(|step| 1.0 + f64::from(step * 7 % 11)).collect();
    let mut course = Course::default();
    for (done, drop) in drops.iter().enumerate() {
        course.note(*drop);
        let steps = done + 1;
        let last = |count: usize| drops[steps - count..steps].iter().sum::<f64>();
        match steps > SLOW {
            false => assert_eq!(course.lately(), 0.0),
            true => {
                let told = course.lately();
                let [least, most] = [steps / LATELY, steps / LATELY + course.every];
                assert!((last(least)..=last(most)).contains(&told), "{steps}: {told}");
            }
        }
    }
}
