//! By how much all links at the rims of an electrode should weigh more or less on one mesh.
//!
//! What a link weighs follows from the cells around it, as if rims were straight and spacing went on for ever. What that leaves of
//! an electrode's field, too weak or too strong by a few percent where cells are few, all bodies feel alike, wherever they are. So
//! does a factor for all of the electrode's links, which therefore is chosen such that C and what bodies at some places change of it
//! are as on a finer lattice: least squares over the logarithms of the factors, by the derivatives that [`Felt`] tells.

use super::Change;
use super::probed::Felt;
use crate::sensor::Sensor;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// Factors that differ from 1 by this, as a logarithm, count like an error of so much at one place.
const UNUSUAL: f64 = 0.3;
const AS_MUCH_AS: f64 = 0.004;

/// Factors are at most this, and at least one by this: derivatives tell nothing of what is beyond.
pub(super) const LARGEST: f64 = 2.0;

/// Weights of links that differ by no more than this part are alike.
const ALIKE: f64 = 1e-9;

/// What is known of the factors of one mesh.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// Which factor each electrode has: those of which the links weigh alike share one, so that mirrored electrodes stay mirrored.
    shared: Vec<usize>,
    /// Of the least squares, A^T A, A^T b and b^T b.
    normal: Mat<f64>,
    right: Mat<f64>,
    square: f64,
    /// Of all changes together.
    weight: f64,
}

impl Balance {
    /// Nothing is known yet. Only lattices have factors: of other meshes, cells at rims are as small as can be.
    pub(super) fn new(sensor: &Sensor) -> Self {
        let shared = if sensor.lattice().is_some() { alike(sensor) } else { Vec::new() };
        let factors = shared.iter().max().map_or(0, |last| last + 1);
        let unusual = (AS_MUCH_AS / UNUSUAL).powi(2);
        let normal = Mat::from_fn(factors, factors, |i, j| if i == j { unusual } else { 0.0 });
        Self { shared, normal, right: Mat::zeros(factors, 1), square: 0.0, weight: 0.0 }
    }

    /// Takes note of a change, and what it should be; the mean square of its entries, as in
    /// [`ChangeError`](super::ChangeError), counts so often. What no electrode feels tells nothing.
    pub(super) fn add(&mut self, felt: &Felt, exact: &Change, weight: f64) {
        let Some(scales) = exact.scales() else { return };
        self.weight += weight;
        let weight = weight / scales.len() as f64;
        let mut slopes = vec![0.0; self.right.nrows()];
        for (entry, scale) in scales.into_iter().enumerate() {
            slopes.fill(0.0);
            for (&factor, of_electrode) in self.shared.iter().zip(&felt.slopes) {
                slopes[factor] += of_electrode[entry] / scale;
            }
            let missing = (exact.farads()[entry] - felt.change.farads()[entry]) / scale;
            for (i, of_i) in slopes.iter().enumerate() {
                for (j, of_j) in slopes.iter().enumerate() {
                    self.normal[(i, j)] += weight * of_i * of_j;
                }
                self.right[(i, 0)] += weight * of_i * missing;
            }
            self.square += weight * missing.powi(2);
        }
    }

    /// The logarithms of the best factors. Where nothing can be told, they are zero.
    fn logarithms(&self) -> Mat<f64> {
        if self.shared.is_empty() {
            return Mat::zeros(0, 1);
        }
        match self.normal.llt(Side::Lower) {
            Ok(factorised) => factorised.solve(&self.right),
            Err(_) => Mat::zeros(self.right.nrows(), 1),
        }
    }

    /// The sum of squared errors, weighted, that is left with the best factors.
    pub(super) fn left(&self) -> f64 {
        let gained = self.logarithms().transpose() * &self.right;
        (self.square - gained[(0, 0)]).max(0.0)
    }

    /// Their mean.
    pub(super) fn mean_square_left(&self) -> f64 {
        self.left() / self.weight
    }

    /// A factor for each electrode's links; of meshes that are no lattices, none.
    pub(super) fn factors(&self) -> Vec<f64> {
        let logarithms = self.logarithms();
        let factor = |&factor: &usize| logarithms[(factor, 0)].exp().clamp(1.0 / LARGEST, LARGEST);
        self.shared.iter().map(factor).collect()
    }
}

/// For each electrode the number of its links' factor.
fn alike(sensor: &Sensor) -> Vec<usize> {
    let mut weights = vec![Vec::new(); sensor.electrode_names().len()];
    for link in sensor.rim() {
        weights[usize::from(link.electrode)].push(link.weight);
    }
    weights.iter_mut().for_each(|weights| weights.sort_unstable_by(f64::total_cmp));
    let are_alike = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ALIKE * a.abs())
    };
    let mut kinds: Vec<&[f64]> = Vec::new();
    let mut shared = Vec::with_capacity(weights.len());
    for of_electrode in &weights {
        let known = kinds.iter().position(|kind| are_alike(kind, of_electrode));
        shared.push(known.unwrap_or_else(|| {
            kinds.push(of_electrode);
            kinds.len() - 1
        }));
    }
    shared
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::electrode::{Electrode, Outline};
    use crate::geometry::{Aabb, Shape};
    use crate::sensor::{MeshKind, SensorDesign, Wall};
    use crate::workspace::probed::Probed;
    use glam::{DVec2, DVec3};

    const BALL: Shape = Shape::Sphere { radius: 0.03 };
    const PLACE: DVec3 = DVec3::new(0.02, 0.01, 0.06);

    /// Two mirrored squares, and a longer stripe between them.
    fn sensor() -> Sensor {
        let rectangle = |name: &str, x: f64, size: DVec2| Electrode {
            name: name.to_owned(),
            outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size },
            z: 0.0,
        };
        let square = DVec2::splat(0.03);
        let design = SensorDesign {
            domain: Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) },
            electrodes: vec![
                rectangle("E1", -0.05, square),
                rectangle("E2", 0.0, DVec2::new(0.02, 0.08)),
                rectangle("E3", 0.05, square),
            ],
            substrate: None,
            wall: Wall::Grounded,
        };
        Sensor::generated(&design, MeshKind::Lattice, 6_000).unwrap()
    }

    fn felt(sensor: Sensor) -> Vec<Felt> {
        let mut probed = Probed::new(sensor, &[BALL], 1e-4, Some(1)).unwrap();
        let with_body = probed.felt(0, PLACE).unwrap();
        [probed.empty()].into_iter().chain(with_body).collect()
    }

    #[test]
    fn slopes_are_what_heavier_links_make_of_c_and_its_changes() {
        let step = 1e-3f64;
        for electrode in 0..3 {
            let weighed = |by: f64| {
                let mut factors = [1.0; 3];
                factors[electrode] = by.exp();
                felt(sensor().with_rims_weighed(&factors))
            };
            let (less, here, more) = (weighed(-step), weighed(0.0), weighed(step));
            for ((less, here), more) in less.iter().zip(&here).zip(&more) {
                let largest = here.slopes.iter().flatten().fold(0.0f64, |most, slope| most.max(slope.abs()));
                for (entry, slope) in here.slopes[electrode].iter().enumerate() {
                    let measured = (more.change.farads()[entry] - less.change.farads()[entry]) / (2.0 * step);
                    assert!(
                        (measured - slope).abs() < 1e-3 * largest,
                        "{electrode} {entry}: {measured} {slope}"
                    );
                }
            }
        }
    }

    /// What other factors made of C and its changes is found out, though it is not quite a straight line.
    #[test]
    fn factors_are_found_again() {
        let true_factors = [1.1, 0.9, 1.1];
        let exact = felt(sensor().with_rims_weighed(&true_factors));
        let mut balance = Balance::new(&sensor());
        assert_eq!(balance.factors(), [1.0; 3]);
        for (ours, exact) in felt(sensor()).iter().zip(&exact) {
            balance.add(ours, &exact.change, 1.0);
        }
        let found = balance.factors();
        assert!(balance.left() < 1e-2 * balance.square, "{} of {}", balance.left(), balance.square);
        assert_eq!(found[0], found[2]);
        for (found, exact) in found.iter().zip(true_factors) {
            assert!((found / exact - 1.0).abs() < 0.02, "{found} {exact}");
        }
    }
}
