//! The form of an element that a plane cuts in two dielectrics.
//!
//! On either side of the plane the potential is linear, and it has a kink there: u = l + κ min(d, 0), l linear, d the distance
//! from the plane, negative in the body. What is normal to the plane must carry the same flux on both sides, so with the ratio r
//! of the permittivity in the body to that beside it κ = (1/r - 1) ∂l/∂n. Values at the corners are given. With g = n·∇ of their linear
//! interpolant, and w the gradient of the linear interpolant of min(d, 0), this is
//!
//! ```text
//! κ = (1/r - 1) g/(1 + (1/r - 1) n·w).
//! ```
//!
//! The energy is that of both gradients with the volumes of both parts, exactly. It is a sum of squares for any κ, so the form is
//! positive semidefinite whatever the element, and constants have none, so it is six edge weights.
//!
//! In front of obtuse angles n·w may be outside of 0 to 1; where the denominator could then vanish, the nearest of these counts.

use crate::mesh::{EdgeShare, barycentric_gradients, signed_volume};
use glam::DVec3;

/// What an element weighs along its edges, in the order of [`EdgeShare::CORNERS`], for a permittivity of 1 beside the body and
/// `ratio` in it. `levels` are proportional to the corners' distances from the plane; if they are all the same, the element
/// is on one side of it.
pub(super) fn weights(corners: [DVec3; 4], levels: [f64; 4], ratio: f64) -> [f64; 6] {
    let is_inside = levels.map(|level| level < 0.0);
    if let [true, true, true, true] | [false, false, false, false] = is_inside {
        let factor = if is_inside[0] { ratio } else { 1.0 };
        let mut weights = [0.0; 6];
        let shares = EdgeShare::of_element(corners).zip(&mut weights);
        shares.for_each(|(share, weight)| *weight = factor * share.weight);
        return weights;
    }
    let (volume, gradients) = (signed_volume(corners), barycentric_gradients(corners));
    let slope: DVec3 = (0..4).map(|k| levels[k] * gradients[k]).sum();
    let (normal, scale) = (slope.normalize_or_zero(), slope.length_recip());
    let within: DVec3 = (0..4).filter(|&k| is_inside[k]).map(|k| levels[k] * scale * gradients[k]).sum();
    let change = 1.0 / ratio - 1.0;
    let along = if ratio > 1.0 { normal.dot(within).min(1.0) } else { normal.dot(within).max(0.0) };
    let kink = change / (1.0 + change * along);
    let kinks = gradients.map(|gradient| kink * gradient.dot(normal));
    let beside: [DVec3; 4] = std::array::from_fn(|k| gradients[k] - kinks[k] * within);
    let inside: [DVec3; 4] = std::array::from_fn(|k| beside[k] + kinks[k] * normal);
    let part = part_below(levels);
    EdgeShare::CORNERS.map(|[i, j]| {
        -volume * ((1.0 - part) * beside[i].dot(beside[j]) + part * ratio * inside[i].dot(inside[j]))
    })
}

/// The part of an element's volume in which a linear function, given at its corners, is negative.
fn part_below(levels: [f64; 4]) -> f64 {
    let below = levels.map(|level| level < 0.0);
    let count = below.iter().filter(|below| **below).count();
    let others = |k: usize| (0..4).filter(move |&other| other != k);
    // How far from a corner towards another of the other side the function has its sign.
    let reach = |from: usize, to: usize| levels[from] / (levels[from] - levels[to]);
    let cut_off = |k: usize| others(k).map(|other| reach(k, other)).product::<f64>();
    match count {
        0 => 0.0,
        4 => 1.0,
        2 => {
            let [[a, b], [c, d]] = sides(below);
            let [ac, ad, bc, bd] = [reach(a, c), reach(a, d), reach(b, c), reach(b, d)];
            ac * ad + ac * (1.0 - ad) * bd + (1.0 - ac) * bc * bd
        }
        _ => {
            let alone = (0..4).find(|&k| below[k] == (count == 1)).unwrap_or(0);
            if count == 1 { cut_off(alone) } else { 1.0 - cut_off(alone) }
        }
    }
}

/// The two corners for which something holds, and the two others, each in order.
pub(super) fn sides(holds: [bool; 4]) -> [[usize; 2]; 2] {
    [true, false].map(|side| {
        let mut corners = (0..4).filter(|&k| holds[k] == side);
        [corners.next().unwrap_or(0), corners.next().unwrap_or(0)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra_sparse::na::Matrix4;
    use proptest::prelude::*;

    /// Σ w (u_i - u_j)².
    fn energy(weights: [f64; 6], values: [f64; 4]) -> f64 {
        let edges = EdgeShare::CORNERS.into_iter().zip(weights);
        edges.map(|([i, j], weight)| weight * (values[i] - values[j]).powi(2)).sum()
    }

    /// Whether all values have a positive energy, but for constants; not if a weight is no number.
    fn is_positive(weights: [f64; 6]) -> bool {
        let mut matrix = Matrix4::zeros();
        for ([i, j], weight) in EdgeShare::CORNERS.into_iter().zip(weights) {
            (matrix[(i, j)], matrix[(j, i)]) = (-weight, -weight);
            matrix[(i, i)] += weight;
            matrix[(j, j)] += weight;
        }
        matrix.fixed_view::<3, 3>(0, 0).into_owned().cholesky().is_some()
    }

    fn point(range: f64) -> impl Strategy<Value = DVec3> {
        [-range..range, -range..range, -range..range].prop_map(DVec3::from_array)
    }

    fn element() -> impl Strategy<Value = [DVec3; 4]> {
        let any = [point(1.0), point(1.0), point(1.0), point(1.0)].prop_map(|mut corners| {
            if signed_volume(corners) < 0.0 {
                corners.swap(2, 3);
            }
            corners
        });
        any.prop_filter("flat", |corners| signed_volume(*corners) > 1e-3)
    }

    /// From 1/10 to 10.
    fn ratio() -> impl Strategy<Value = f64> {
        (-1.0..1.0).prop_map(|power: f64| 10_f64.powf(power))
    }

    proptest! {
        /// Whatever the element, the plane and the ratio, no values have a negative energy, and only constants have hardly any.
        #[test]
        fn forms_are_positive(
            corners in element(), levels in [-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0_f64], ratio in ratio(),
        ) {
            let [form, plain] = [weights(corners, levels, ratio), weights(corners, [1.0; 4], 1.0)];
            let more = std::array::from_fn(|at| form[at] - 1e-6 * plain[at]);
            prop_assert!(is_positive(more), "{form:?} {plain:?}");
        }

        /// A potential that is linear on either side, with the right kink, has the energy of its gradients.
        #[test]
        fn kinked_potentials_are_exact(corners in element(), normal in point(1.0), field in point(1.0), ratio in ratio()) {
            let normal = normal.normalize_or(DVec3::X);
            let distances = corners.map(|corner| normal.dot(corner - corners.iter().sum::<DVec3>() / 4.0));
            let gradients = barycentric_gradients(corners);
            let within: f64 = (0..4).map(|k| distances[k].min(0.0) * gradients[k].dot(normal)).sum();
            prop_assume!((0.0..=1.0).contains(&within));
            let kink = (1.0 / ratio - 1.0) * field.dot(normal);
            let values = std::array::from_fn(|k| field.dot(corners[k]) + kink * distances[k].min(0.0));
            let part = part_below(distances);
            let inside = field + kink * normal;
            let exact = (1.0 - part) * field.length_squared() + part * ratio * inside.length_squared();
            let found = energy(weights(corners, distances, ratio), values);
            prop_assert!((found - signed_volume(corners) * exact).abs() < 1e-9 * (1.0 + found), "{found} {exact}");
        }

        /// Against points of a grid in barycentric coordinates.
        #[test]
        fn volumes_are_exact(levels in [-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0_f64]) {
            const STEPS: usize = 24;
            let (mut below, mut all) = (0.0, 0.0);
            for a in 0..STEPS {
                for b in 0..STEPS - a {
                    for c in 0..STEPS - a - b {
                        let at = [a, b, c].map(|step| (step as f64 + 0.25) / STEPS as f64);
                        let level: f64 = (0..3).map(|k| at[k] * (levels[k] - levels[3])).sum::<f64>() + levels[3];
                        below += f64::from(u8::from(level < 0.0));
                        all += 1.0;
                    }
                }
            }
            prop_assert!((below / all - part_below(levels)).abs() < 0.05, "{} {}", below / all, part_below(levels));
        }
    }
}
