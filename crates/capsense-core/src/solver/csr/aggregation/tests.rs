//! Aggregates of a square of nodes, and what they weigh.

use super::super::pattern::Pattern;
use super::aggregates::Aggregates;
use super::*;
use std::sync::Arc;

const SIDE: usize = 32;

/// A square of nodes that are coupled along x by so much, along y by 1.
fn square(along_x: f32) -> Level {
    let pattern = Pattern::new(SIDE * SIDE, |row, found| {
        let (x, y) = (row % SIDE, row / SIDE);
        found.extend((y > 0).then(|| (row - SIDE) as u32));
        found.extend((x > 0).then(|| row as u32 - 1));
        found.extend((x + 1 < SIDE).then_some(row as u32 + 1));
        found.extend((y + 1 < SIDE).then_some((row + SIDE) as u32));
    });
    let mut level = Level::new(Arc::new(pattern));
    for row in 0..SIDE * SIDE {
        let columns = &level.pattern.columns()[level.pattern.entries(row)];
        let weight = |&other: &u32| if row.abs_diff(other as usize) == 1 { along_x } else { 1.0 };
        let weights: Vec<f32> = columns.iter().map(weight).collect();
        level.set_diagonal(row, f64::from(weights.iter().sum::<f32>()));
        level.weights[level.pattern.entries(row)].copy_from_slice(&weights);
    }
    level
}

/// Rows in lines of four along x.
fn lines_of_four(level: &Level) -> Aggregates {
    let count = SIDE * SIDE / 4;
    let of_row: Vec<u32> = (0..SIDE * SIDE).map(|row| (row / 4) as u32).collect();
    let (couplings, parts) = Couplings::of(level).merged(&of_row, count);
    Aggregates { of_row, count, couplings, parts }
}

/// What is in line is farther away the longer the line, and what is beside it is not.
#[test]
fn couplings_become_weaker_along_aggregates_only() {
    let lines = lines_of_four(&square(6.0));
    let next = SIDE / 4;
    let of = |other: usize| {
        let mut found = lines.couplings.at(0).iter().filter(|(to, _)| *to as usize == other);
        found.next().map(|(_, weight)| *weight)
    };
    assert_eq!([of(1), of(next), of(next + 1)], [Some(3.0), Some(4.0), None]);
    assert_eq!(lines.parts(0).collect::<Vec<_>>(), [(1, 0.25), (next as u32, 1.0)]);
}

/// Summed weights would make lines of eight.
#[test]
fn aggregates_are_no_lines_where_spacings_differ() {
    let level = square(6.0);
    let Aggregates { of_row, count, .. } = aggregates(&level, &Couplings::of(&level));
    assert!((SIDE * SIDE / 10..SIDE * SIDE / 6).contains(&count), "{count}");
    for own in 0..count as u32 {
        let xs = || (0..SIDE * SIDE).filter(|&row| of_row[row] == own).map(|row| row % SIDE);
        let length = xs().max().unwrap() - xs().min().unwrap() + 1;
        assert!(length < 8, "{length}");
    }
}

/// A field that varies evenly along lines of four takes four times the energy on them: a quarter of their rows is coupled. Coarse
/// weights make up for the fourth root of that, for the root where they have grown since the empty scene, and are the same again
/// once that is over. What is beside a line is as it was.
#[test]
fn coarse_weights_are_less_along_lines_and_still_less_in_strong_dielectrics() {
    let mut fine = square(6.0);
    let (mut transfer, mut coarse) = Transfer::new(&fine, &lines_of_four(&fine));
    let all = Changes { rows: (0..fine.rows() as u32).collect(), weights: pairs_of(&fine) };
    let mut weights = |factor: f32| {
        fine = square(6.0);
        fine.weights.iter_mut().for_each(|weight| *weight *= factor);
        transfer.refresh(&fine, &mut coarse, &all, &mut Changes::default());
        if factor == 1.0 {
            transfer.remember(&coarse);
        }
        let of = |other: usize| coarse.weights[coarse.pattern.find(0, other as u32).unwrap()];
        [of(1), of(SIDE / 4)]
    };
    let (empty, root) = ([6.0 * 0.25_f32.powf(0.25), 4.0], 0.25_f32.sqrt());
    for (factor, expected) in [
        (1.0, empty),
        // A weak dielectric, a strong one, and none again.
        (2.0, empty.map(|weight| 2.0 * weight)),
        (80.0, [80.0 * 6.0 * root, 80.0 * 4.0]),
        (1.0, empty),
    ] {
        for (found, expected) in weights(factor).into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{factor}: {found} {expected}");
        }
    }
}
