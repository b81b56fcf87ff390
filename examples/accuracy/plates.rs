//! Capacitances of plates in grounded boxes without a mesh: charges that have the right singularity at rims, potentials as
//! a double Fourier series, each mode of it a transmission line through the layers above and below.
//!
//! On a square the charge is Σ c_ij T_i(u) T_j(v) / √((1-u²)(1-v²)), of which the transform is a product of Bessel
//! functions; on a disk it is the sum of those functions of which the transform is a spherical Bessel function times
//! cos mφ. Energies of charges are sums over modes. Their tails behave as (b + c ln K)/K, K the largest wave number, and
//! are extrapolated from sums to K/4, K/2 and K. The capacitance is then a maximum over all charges.

use std::f64::consts::PI;

/// Of vacuum, in farads per metre.
const EPSILON: f64 = 8.854_187_812_8e-12;

/// Half waves of the last mode along an axis, and the highest degree of charges. With twice as many of both C of a square
/// in air is 5e-6 smaller, that of a disk 3e-6.
const MODES: usize = 480;
const DEGREE: usize = 10;

/// The parts of the wave numbers that the three sums end at.
const PARTS: [f64; 3] = [0.25, 0.5, 1.0];

/// A plate around the middle of a square box.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Plate {
    /// A square of so many metres, turned by so many degrees.
    Square { size: f64, degrees: f64 },
    /// A disk.
    Disk { radius: f64 },
}

/// A medium between the plate and a grounded wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    /// In metres.
    pub(crate) thickness: f64,
    /// Relative.
    pub(crate) permittivity: f64,
}

/// C in farads of a plate in a box of width `side`, between the layers above and below it, those at the plate first.
pub(crate) fn capacitance(plate: Plate, side: f64, media: [&[Layer]; 2]) -> f64 {
    capacitance_with(plate, side, media, [MODES, DEGREE])
}

fn capacitance_with(plate: Plate, side: f64, media: [&[Layer]; 2], [modes, degree]: [usize; 2]) -> f64 {
    let basis = Basis::new(plate, degree);
    let [first, second, third] = energies(&basis, side, media, modes);
    let last = modes as f64;
    let limit = (0..first.len()).map(|at| extrapolated([first[at], second[at], third[at]], last)).collect();
    largest_charge(limit, basis.orders.len())
}

/// Twice the energies of pairs of charges, in 1/F: the sums that end at the three parts of all wave numbers.
fn energies(basis: &Basis, side: f64, media: [&[Layer]; 2], modes: usize) -> [Vec<f64>; 3] {
    let count = basis.orders.len();
    let mut sums = PARTS.map(|_| vec![0.0; count * count]);
    let mut charge = vec![0.0; count];
    let unit = PI / side;
    for p in 1..=modes {
        // Plates are the same when turned by half a turn: no mode is odd along one axis and even along the other.
        for q in (1..=modes).filter(|q| (p + q) % 2 == 0) {
            let radius = f64::hypot(p as f64, q as f64);
            let Some(shell) = PARTS.iter().position(|part| radius <= part * modes as f64) else { break };
            basis.charge_of_mode([unit * p as f64, unit * q as f64], p % 2 == 1, &mut charge);
            let admittance: f64 = media.iter().map(|layers| admittance(layers, unit * radius)).sum();
            let weight = 4.0 / (side * side * EPSILON * admittance);
            for (row, a) in charge.iter().enumerate() {
                let sums = &mut sums[shell][row * count..=row * count + row];
                sums.iter_mut().zip(&charge).for_each(|(sum, b)| *sum += weight * a * b);
            }
        }
    }
    for shell in 1..sums.len() {
        let (inner, outer) = sums.split_at_mut(shell);
        outer[0].iter_mut().zip(&inner[shell - 1]).for_each(|(sum, inner)| *sum += inner);
    }
    sums
}

/// What a wave sees of layers that end at a grounded wall: relative permittivity over metres.
fn admittance(layers: &[Layer], wave: f64) -> f64 {
    layers.iter().rev().fold(f64::INFINITY, |beyond, layer| {
        let (own, tanh) = (layer.permittivity * wave, (wave * layer.thickness).tanh());
        if beyond.is_infinite() { own / tanh } else { own * (beyond + own * tanh) / (own + beyond * tanh) }
    })
}

/// Charges on a plate. The first is 1 in total, the others 0.
struct Basis {
    plate: Plate,
    /// Square: i and j of T_i T_j + (-1)^i T_j T_i, which a quarter of a turn leaves as it is. Disk: m, and the order of
    /// the spherical Bessel function.
    orders: Vec<[usize; 2]>,
}

impl Basis {
    fn new(plate: Plate, degree: usize) -> Self {
        let all = (0..=degree).flat_map(|j| (j % 2..=j).step_by(2).map(move |i| [i, j]));
        let fits = |[i, j]: &[usize; 2]| match plate {
            Plate::Square { .. } => i != j || i % 2 == 0,
            Plate::Disk { .. } => i % 4 == 0,
        };
        Self { plate, orders: all.filter(fits).collect() }
    }

    /// ∫ of each charge times a mode of the box: cosines of the two wave numbers if `cosine`, or else sines.
    fn charge_of_mode(&self, [k, l]: [f64; 2], cosine: bool, charge: &mut [f64]) {
        self.transform([k, -l], 0.5, charge);
        let mut other = vec![0.0; charge.len()];
        self.transform([k, l], if cosine { 0.5 } else { -0.5 }, &mut other);
        charge.iter_mut().zip(other).for_each(|(charge, other)| *charge += other);
    }

    /// Transforms of all charges at one wave vector, times a factor.
    fn transform(&self, wave: [f64; 2], factor: f64, values: &mut [f64]) {
        let degree = self.orders.last().map_or(0, |order| order[1]);
        match self.plate {
            Plate::Square { size, degrees } => {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let along = [wave[0] * cos + wave[1] * sin, wave[1] * cos - wave[0] * sin];
                let [x, y] = along.map(|k| bessel(0.5 * size * k, degree));
                for (value, &[i, j]) in values.iter_mut().zip(&self.orders) {
                    // The transform of T_i is i^i J_i.
                    let sign = if (i + j) % 4 == 0 { 0.5 } else { -0.5 };
                    let swapped = if i % 2 == 0 { x[j] * y[i] } else { -x[j] * y[i] };
                    *value = factor * sign * (x[i] * y[j] + swapped);
                }
            }
            Plate::Disk { radius } => {
                let angle = f64::atan2(wave[1], wave[0]);
                let of_radius = spherical_bessel(radius * f64::hypot(wave[0], wave[1]), degree);
                for (value, &[m, order]) in values.iter_mut().zip(&self.orders) {
                    *value = factor * of_radius[order] * (m as f64 * angle).cos();
                }
            }
        }
    }
}

/// J_0 to J_degree.
fn bessel(signed: f64, degree: usize) -> Vec<f64> {
    let x = signed.abs();
    let ratio = |n: usize| 2.0 * n as f64 / x;
    let mut values = if x > 30.0 + degree as f64 {
        upward([0.0, 1.0].map(|order| far_bessel(order, x)), degree, ratio)
    } else {
        let values = downward(degree, x, ratio);
        let sum = values[0] + 2.0 * values.iter().skip(2).step_by(2).sum::<f64>();
        values.into_iter().take(degree + 1).map(|value| value / sum).collect()
    };
    if signed < 0.0 {
        values.iter_mut().skip(1).step_by(2).for_each(|odd| *odd = -*odd);
    }
    values
}

/// j_0 to j_degree, for a positive argument.
fn spherical_bessel(x: f64, degree: usize) -> Vec<f64> {
    let ratio = |n: usize| (2 * n + 1) as f64 / x;
    let first = [x.sin() / x, (x.sin() / x - x.cos()) / x];
    if x > 1.0 + degree as f64 {
        return upward(first, degree, ratio);
    }
    let values = downward(degree, x, ratio);
    // They have no common zero.
    let larger = usize::from(first[1].abs() > first[0].abs());
    let factor = first[larger] / values[larger];
    values.into_iter().take(degree + 1).map(|value| factor * value).collect()
}

/// By the recurrence f_{n+1} = ratio(n) f_n - f_{n-1}, stable up to degrees of about the argument.
fn upward(first: [f64; 2], degree: usize, ratio: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut values = first.to_vec();
    for n in 1..degree {
        values.push(ratio(n) * values[n] - values[n - 1]);
    }
    values
}

/// By the same from so far up that any start ends at the solution which is small there; times an unknown factor.
fn downward(degree: usize, x: f64, ratio: impl Fn(usize) -> f64) -> Vec<f64> {
    const TOO_LARGE: f64 = 1e100;
    let top = degree.max(x as usize) + 40;
    let mut values = vec![0.0; top + 2];
    if x < 1e-9 {
        values[0] = 1.0;
        return values;
    }
    values[top] = 1.0;
    for n in (1..=top).rev() {
        values[n - 1] = ratio(n) * values[n] - values[n + 1];
        if values[n - 1].abs() > TOO_LARGE {
            values.iter_mut().for_each(|value| *value /= TOO_LARGE);
        }
    }
    values
}

/// Hankel's series of J_order far out.
fn far_bessel(order: f64, x: f64) -> f64 {
    const TERMS: usize = 20;
    let (mut even, mut odd, mut term) = (1.0, 0.0, 1.0);
    for k in 1..TERMS {
        let factor = (2 * k - 1) as f64;
        term *= (4.0 * order * order - factor * factor) / (8.0 * k as f64 * x);
        match k % 4 {
            0 => even += term,
            1 => odd += term,
            2 => even -= term,
            _ => odd -= term,
        }
    }
    let angle = x - (0.5 * order + 0.25) * PI;
    (2.0 / (PI * x)).sqrt() * (even * angle.cos() - odd * angle.sin())
}

/// The limit of values limit + (b + c ln K)/K at a quarter, a half and the whole of the last K.
fn extrapolated([quarter, half, whole]: [f64; 3], last: f64) -> f64 {
    // K v(K) grows by (K/2) limit + c ln 2 when K doubles.
    let growth = [0.5 * half - 0.25 * quarter, whole - 0.5 * half].map(|growth| last * growth);
    (growth[1] - growth[0]) / (0.25 * last)
}

/// The total charge at 1 V: the first entry of the inverse of a matrix of which the lower half is given, by elimination
/// of all other charges.
fn largest_charge(mut energies: Vec<f64>, count: usize) -> f64 {
    for pivot in (1..count).rev() {
        let of_pivot = energies[pivot * count..=pivot * count + pivot].to_vec();
        for row in 0..pivot {
            let factor = of_pivot[row] / of_pivot[pivot];
            for column in 0..=row {
                energies[row * count + column] -= factor * of_pivot[column];
            }
        }
    }
    1.0 / energies[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_functions_have_their_tabulated_values() {
        for (x, expected) in
            [(1.0, [0.765197686558, 0.440050585745]), (40.0, [0.007366890584, 0.126038318038])]
        {
            let values = bessel(x, 10);
            assert!(
                (values[0] - expected[0]).abs() < 1e-11 && (values[1] - expected[1]).abs() < 1e-11,
                "{x} {values:?}"
            );
        }
    }
}
