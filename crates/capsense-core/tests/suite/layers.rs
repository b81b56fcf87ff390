//! A layer in a uniform field along it, at several angles to the lattice: the potential is that of the empty box, and what
//! the layer adds is (ε - 1) times its volume. So this is what interface models make of the tangential field alone.
//! `docs/interface.md` has what this prints: `cargo test -p capsense-core --test suite layers:: -- --nocapture`.

use crate::common::dielectric;
use crate::common::walled::{Body, Held, Rule, WalledBox};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::mesh::Lattice;

const CUBE: Aabb = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
const CELLS: usize = 20;
const PLACES: u32 = 10;

/// 5.6 cells.
const THICKNESS: f64 = 5.6 / CELLS as f64;

/// Relative errors of what a layer adds, its normal turned by an angle from the x axis and its middle moved along x over
/// a cell.
fn errors(permittivity: f64, degrees: f64, cells: usize) -> Vec<f64> {
    let lattice = Lattice::uniform(CUBE, [cells; 3]).unwrap();
    let rotation = DQuat::from_rotation_y(degrees.to_radians());
    let along = rotation * DVec3::Z;
    let place = |k: u32| {
        let translation = DVec3::X * (f64::from(k) + 0.37) / f64::from(PLACES) / cells as f64;
        let body = Body {
            shape: Shape::Box { size: DVec3::new(THICKNESS, 4.0, 4.0) },
            pose: Pose { translation, rotation },
            material: dielectric(permittivity),
        };
        let space = WalledBox::new(&lattice, &[body], Rule::AsSolids);
        let solved = space.solve(&[Held { wall: &|p| along.dot(p), bodies: &[0.0] }]);
        let volume = THICKNESS / degrees.to_radians().cos();
        (solved.energy(0, 0) - 1.0) / ((permittivity - 1.0) * volume) - 1.0
    };
    (0..PLACES).map(place).collect()
}

/// Mean, lowest and highest.
fn summary(errors: &[f64]) -> [f64; 3] {
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let low = errors.iter().copied().fold(f64::INFINITY, f64::min);
    [mean, low, errors.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}

/// Lowest and highest error in % that there may be, by angle; means on the lattice at rest are none.
type Allowed = [[f64; 2]; 4];

#[test]
fn errors_along_a_uniform_field_are_those_that_are_documented() {
    let of_weak: Allowed = [[-0.01, 0.01], [-1.6, -0.2], [-3.4, -1.0], [-5.5, -2.0]];
    let of_strong: Allowed = [[-12.0, 8.0], [-6.0, 0.0], [-9.0, -4.0], [-13.0, -8.0]];
    for permittivity in [2.0, 4.0, 20.0, 80.0] {
        let allowed = if permittivity < 10.0 { of_weak } else { of_strong };
        for (degrees, [least, most]) in [0.0, 5.0, 15.0, 30.0].into_iter().zip(allowed) {
            let [mean, low, high] = summary(&errors(permittivity, degrees, CELLS)).map(|e| 100.0 * e);
            println!("| {permittivity} | {degrees} | {mean:+.1} | {low:+.1} to {high:+.1} |");
            assert!(least < low && high < most, "{permittivity}, {degrees}: {low} {high}");
            // Edges within a strong body count as a whole, those outside as far as lines do.
            let most_at_rest = if permittivity < 10.0 { 0.1 } else { 1.5 };
            assert!(degrees > 0.0 || mean.abs() < most_at_rest, "{permittivity}: {mean}");
        }
    }
}

/// Only edges that surfaces cut, or nearly so, are to blame: errors fall with the size of cells.
#[test]
fn errors_along_a_uniform_field_are_of_first_order() {
    let [coarse, fine] = [CELLS, 2 * CELLS].map(|cells| summary(&errors(80.0, 30.0, cells))[0]);
    assert!((1.7..2.5).contains(&(coarse / fine)), "{coarse} {fine}");
}
