//! Minima of functions of a few variables, without derivatives: Nelder and Mead's simplex, begun anew where it has stopped.

use std::cell::Cell;

/// Least gain for which a search goes on.
const GAIN: f64 = 1e-5;

/// A point and what the function is there.
type Point = (Vec<f64>, f64);

/// Searches from `start`, with first steps of `steps`, until a new simplex around the best point no longer helps or the function
/// was asked `most` times.
pub(crate) fn minimum(start: &[f64], steps: &[f64], most: usize, mut f: impl FnMut(&[f64]) -> f64) -> Point {
    let asked = Cell::new(0);
    let mut told = |point: Vec<f64>| {
        asked.set(asked.get() + 1);
        let value = f(&point);
        (point, value)
    };
    let mut best = told(start.to_vec());
    let mut scale = 1.0;
    loop {
        let steps: Vec<f64> = steps.iter().map(|step| step * scale).collect();
        let found = simplex(&best, &steps, &mut told, || asked.get() >= most);
        let gain = best.1 - found.1;
        best = found;
        scale *= 0.5;
        if asked.get() >= most || (gain < GAIN && scale < 0.2) {
            return best;
        }
    }
}

fn simplex(
    best: &Point,
    steps: &[f64],
    told: &mut impl FnMut(Vec<f64>) -> Point,
    enough: impl Fn() -> bool,
) -> Point {
    let n = steps.len();
    let mut points = vec![best.clone()];
    for (index, step) in steps.iter().enumerate() {
        let mut point = best.0.clone();
        point[index] += step;
        points.push(told(point));
    }
    loop {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        if points[n].1 - points[0].1 < GAIN || enough() {
            return points.swap_remove(0);
        }
        let centre: Vec<f64> =
            (0..n).map(|k| points[..n].iter().map(|point| point.0[k]).sum::<f64>() / n as f64).collect();
        let worst = points[n].0.clone();
        let along = |part: f64| (0..n).map(|k| centre[k] + part * (worst[k] - centre[k])).collect();
        let reflected = told(along(-1.0));
        if reflected.1 < points[0].1 {
            let expanded = told(along(-2.0));
            points[n] = if expanded.1 < reflected.1 { expanded } else { reflected };
        } else if reflected.1 < points[n - 1].1 {
            points[n] = reflected;
        } else {
            let contracted = told(along(if reflected.1 < points[n].1 { -0.5 } else { 0.5 }));
            if contracted.1 < reflected.1.min(points[n].1) {
                points[n] = contracted;
            } else {
                let best = points[0].0.clone();
                for point in &mut points[1..] {
                    *point = told(point.0.iter().zip(&best).map(|(a, b)| 0.5 * (a + b)).collect());
                }
            }
        }
    }
}
