//! Minima of functions of a few variables, without derivatives: Nelder and Mead's simplex, begun anew where it has stopped.

/// Searches from `start`, with first steps of `steps`, until a new simplex around the best point no longer helps.
pub(crate) fn minimum(start: &[f64], steps: &[f64], mut f: impl FnMut(&[f64]) -> f64) -> (Vec<f64>, f64) {
    let mut best = (start.to_vec(), f(start));
    for round in 0..12 {
        let shrink = 0.7_f64.powi(round);
        let steps: Vec<f64> = steps.iter().map(|step| step * shrink).collect();
        let found = simplex(&best.0, &steps, &mut f);
        let gain = best.1 - found.1;
        if gain > 0.0 {
            best = found;
        }
        if round > 4 && gain < 1e-6 {
            break;
        }
    }
    best
}

fn simplex(start: &[f64], steps: &[f64], f: &mut impl FnMut(&[f64]) -> f64) -> (Vec<f64>, f64) {
    let n = start.len();
    let mut points = vec![(start.to_vec(), f(start))];
    for (index, step) in steps.iter().enumerate() {
        let mut point = start.to_vec();
        point[index] += step;
        let value = f(&point);
        points.push((point, value));
    }
    for _ in 0..200 * n {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        if points[n].1 - points[0].1 < 1e-7 {
            break;
        }
        let centre: Vec<f64> =
            (0..n).map(|k| points[..n].iter().map(|point| point.0[k]).sum::<f64>() / n as f64).collect();
        let along = |part: f64| -> Vec<f64> {
            (0..n).map(|k| centre[k] + part * (points[n].0[k] - centre[k])).collect()
        };
        let mut tried = |part: f64| {
            let point = along(part);
            let value = f(&point);
            (point, value)
        };
        let reflected = tried(-1.0);
        let next = if reflected.1 < points[0].1 {
            let expanded = tried(-2.0);
            if expanded.1 < reflected.1 { expanded } else { reflected }
        } else if reflected.1 < points[n - 1].1 {
            reflected
        } else {
            let contracted = tried(if reflected.1 < points[n].1 { -0.5 } else { 0.5 });
            if contracted.1 < reflected.1.min(points[n].1) {
                contracted
            } else {
                shrink(&mut points, f);
                continue;
            }
        };
        points[n] = next;
    }
    points.sort_by(|a, b| a.1.total_cmp(&b.1));
    points.swap_remove(0)
}

fn shrink(points: &mut [(Vec<f64>, f64)], f: &mut impl FnMut(&[f64]) -> f64) {
    let best = points[0].0.clone();
    for (point, value) in &mut points[1..] {
        for (x, to) in point.iter_mut().zip(&best) {
            *x = 0.5 * (*x + to);
        }
        *value = f(point);
    }
}
