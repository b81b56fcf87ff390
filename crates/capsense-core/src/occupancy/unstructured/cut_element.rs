//! What conductors leave of an element with obtuse angles, and how little its links may be.
//!
//! As a form in the potentials of the corners that are free, the conductor being at zero, it is Σ w (u_a - u_b)² over the
//! edges that are left between them, and Σ l u_a² of links. There are links with which the form is positive semidefinite
//! for certain, and links that a face asks for, Σ w/θ over edges of any sign. In flat elements the latter are far less than
//! the former at some corners and more at others, and the form stays semidefinite only by both together: a face that cuts a
//! long edge of negative weight has its linear field as a form's null vector. So the form is looked at as a whole: of what
//! is negative in the difference, as large a part counts as leaves it semidefinite; and then its diagonal is scaled down as
//! far as a bound of its largest eigenvalue allows, which is what may be missing where other elements have more.

/// So much of what an element is with certain links it keeps: null vectors of all elements around could be one of K.
const KEPT: f64 = 0.01;

/// By how many halvings the part of negative differences is found.
const HALVINGS: usize = 16;

/// Such an element.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CutElement {
    /// What is left of the edges between free corners.
    pub(super) between: [[f64; 4]; 4],
    /// The sum of the weights of each corner's edges that end in no conductor.
    pub(super) kept: [f64; 4],
    /// Links with which the form is positive semidefinite for certain.
    pub(super) certain: [f64; 4],
    /// Links that a face asks for.
    pub(super) exact: [f64; 4],
}

impl CutElement {
    /// How little the links of each corner may be together.
    pub(super) fn least_links(&self) -> [f64; 4] {
        let certain: [f64; 4] = std::array::from_fn(|k| self.kept[k] + self.certain[k]);
        let missing: [f64; 4] = std::array::from_fn(|k| self.exact[k] - self.certain[k]);
        let diagonal = |part: f64| -> [f64; 4] {
            std::array::from_fn(|k| {
                certain[k] + if missing[k] < 0.0 { part * missing[k] } else { missing[k] }
            })
        };
        let mut part = 1.0;
        if !self.is_semidefinite(diagonal(part)) {
            part = 0.0;
            let mut step = 0.5;
            for _ in 0..HALVINGS {
                if self.is_semidefinite(diagonal(part + step)) {
                    part += step;
                }
                step *= 0.5;
            }
        }
        let diagonal = diagonal(part);
        let highest = self.highest_eigenvalue(&diagonal);
        std::array::from_fn(|k| self.certain[k] + (1.0 - KEPT) * (highest * diagonal[k] - certain[k]))
    }

    /// Whether the form with this diagonal is positive semidefinite, by elimination.
    fn is_semidefinite(&self, diagonal: [f64; 4]) -> bool {
        let mut form = self.between.map(|row| row.map(|weight| -weight));
        (0..4).for_each(|k| form[k][k] = diagonal[k]);
        for k in 0..4 {
            let row = form[k];
            for i in k + 1..4 {
                if row[i] != 0.0 {
                    if row[k] <= 0.0 {
                        return false;
                    }
                    let factor = row[i] / row[k];
                    (k + 1..4).for_each(|j| form[i][j] -= factor * row[j]);
                }
            }
            if row[k] < 0.0 {
                return false;
            }
        }
        true
    }

    /// At least the largest eigenvalue of D^(-1/2) W D^(-1/2), W the weights between corners and D the diagonal, of a form
    /// that is positive semidefinite, where it is at most 1: a symmetric matrix of n rows with a trace of zero has none
    /// above √((n - 1)/n) times its Frobenius norm.
    fn highest_eigenvalue(&self, diagonal: &[f64; 4]) -> f64 {
        let (mut squares, mut coupled) = (0.0, [0.0; 4]);
        for a in 0..4 {
            for b in (0..4).filter(|&b| self.between[a][b] != 0.0) {
                squares += self.between[a][b].powi(2) / (diagonal[a] * diagonal[b]);
                coupled[a] = 1.0;
            }
        }
        let rows: f64 = coupled.iter().sum();
        // What is no number is as what is too large.
        if rows == 0.0 { 0.0 } else { f64::sqrt(squares * (rows - 1.0) / rows).min(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::EdgeShare;
    use glam::DVec3;

    /// The element that a half-space cuts, what is below it being held.
    fn cut(corners: [DVec3; 4], normal: DVec3, height: f64) -> (CutElement, [f64; 4]) {
        let distances = corners.map(|corner| normal.dot(corner) - height);
        let mut cut = CutElement::default();
        for share in EdgeShare::of_element(corners) {
            let [a, b] = share.corners;
            for (own, other) in [(a, b), (b, a)].into_iter().filter(|(own, _)| distances[*own] > 0.0) {
                if distances[other] > 0.0 {
                    cut.kept[own] += share.weight;
                    cut.between[own][other] = share.weight;
                } else {
                    cut.certain[own] += share.weight;
                    cut.exact[own] += share.weight * (distances[own] - distances[other]) / distances[own];
                }
            }
        }
        (cut, distances)
    }

    /// A flat element below whose longest edge's middle the fourth corner lies: that edge weighs less than nothing.
    const FLAT: [DVec3; 4] =
        [DVec3::ZERO, DVec3::new(8.0, 0.0, 0.0), DVec3::new(8.0, 8.0, 0.0), DVec3::new(4.0, 4.0, 0.5)];

    #[test]
    fn flat_elements_have_what_faces_ask_for() {
        for step in 1..40 {
            let (cut, distances) = cut(FLAT, DVec3::X, 0.2 * f64::from(step));
            let least = cut.least_links();
            for k in (0..4).filter(|&k| distances[k] > 0.0) {
                let missing = (least[k] - cut.exact[k]).max(0.0);
                let all = cut.kept[k] + cut.certain[k];
                assert!(missing <= 2.0 * KEPT * all, "{step} {k}: {missing} of {all}");
            }
        }
    }

    #[test]
    fn forms_stay_semidefinite() {
        let mut state = 1_u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        for _ in 0..20_000 {
            let mut point = |z: f64| DVec3::new(number(), number(), z * number());
            let mut corners = [(); 4].map(|()| point(0.2));
            if crate::mesh::signed_volume(corners) < 0.0 {
                corners.swap(2, 3);
            }
            let normal = point(1.0).normalize();
            let (cut, _) = cut(corners, normal, 0.5 * number());
            let least = cut.least_links();
            let scale = cut.kept.iter().chain(&cut.certain).fold(0.0, |most: f64, w| most.max(w.abs()));
            // The form of what is kept for certain is taken from it, but for rounding.
            let diagonal = std::array::from_fn(|k| {
                cut.kept[k] + least[k] - 0.9 * KEPT * (cut.kept[k] + cut.certain[k]) + 1e-9 * scale
            });
            let less = CutElement {
                between: cut.between.map(|row| row.map(|weight| (1.0 - 0.9 * KEPT) * weight)),
                ..cut
            };
            assert!(less.is_semidefinite(diagonal), "{corners:?} {normal} {cut:?} {least:?}");
        }
    }
}
