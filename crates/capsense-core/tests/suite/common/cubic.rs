//! The capacitance of a sphere in the middle of a grounded cube of side 1. Its walls are mirrors: they repeat the sphere in
//! all cells of a lattice of cubes, with alternating signs. Sphere and images carry a charge and, as little else has the
//! symmetry of a cube, multipoles of degree 4 and 6; those of degree 8 and above are left out, which leaves 2e-6 of C at a
//! radius of 0.3 and 2e-4 at 0.4.

#![allow(unreachable_pub)]

use capsense_core::glam::DVec3;

/// Cells on either side along each axis.
const SHELLS: i32 = 16;

/// Potentials of a unit charge and of multipoles with the symmetry of a cube.
fn multipoles(p: DVec3) -> [f64; 3] {
    let (square, r2) = (p * p, p.length_squared());
    let fourth = square.dot(square) - 0.6 * r2 * r2;
    let sixth = square.x * square.y * square.z + fourth * r2 / 22.0 - r2 * r2 * r2 / 105.0;
    [1.0 / r2.sqrt(), fourth / r2.powf(4.5), sixth / r2.powf(6.5)]
}

/// Those of all images: sums over a large cube of cells, of which those on its surface count by their part within (Evjen).
fn images(p: DVec3) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let share = |i: i32| if i.abs() == SHELLS { 0.5 } else { 1.0 };
    let cells = || -SHELLS..=SHELLS;
    for (i, j, k) in cells().flat_map(|i| cells().flat_map(move |j| cells().map(move |k| (i, j, k)))) {
        if (i, j, k) != (0, 0, 0) {
            let sign = if (i + j + k) % 2 == 0 { 1.0 } else { -1.0 };
            let weight = sign * share(i) * share(j) * share(k);
            let of = multipoles(p - DVec3::new(f64::from(i), f64::from(j), f64::from(k)));
            (0..3).for_each(|m| sum[m] += weight * of[m]);
        }
    }
    sum
}

/// Divided by 4πε₀. The mean over the sphere is 1 V, to which all but its own charge add what they have in its middle; and
/// so are the potentials towards the middle of a face and a corner of the cube.
pub fn capacitance(radius: f64) -> f64 {
    let scales = [radius, radius.powi(5), radius.powi(7)];
    let in_all = |p: DVec3| {
        let (own, others) = (multipoles(p), images(p));
        std::array::from_fn(|m| own[m] + others[m])
    };
    let mut mean = images(DVec3::ZERO);
    mean[0] += 1.0 / radius;
    let equations = [mean, in_all(radius * DVec3::X), in_all(radius * DVec3::ONE.normalize())];
    let mut rows = equations.map(|of| [of[0] * scales[0], of[1] * scales[1], of[2] * scales[2], 1.0]);
    // Gauss and Jordan.
    for pivot in 0..3 {
        let lead = rows[pivot].map(|entry| entry / rows[pivot][pivot]);
        for (other, row) in rows.iter_mut().enumerate() {
            let factor = row[pivot];
            *row = if other == pivot { lead } else { std::array::from_fn(|c| row[c] - factor * lead[c]) };
        }
    }
    rows[0][3] * scales[0]
}
