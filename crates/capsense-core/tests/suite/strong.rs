//! Strong dielectrics over three stripes, as exact solids, against lattices of eight million tetrahedra:
//! `cargo run --release -p capsense-core --example strong_bodies` prints what they change there anew.

use crate::common::{dielectric, three_stripes, to};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DQuat, DVec3, EulerRot};
use capsense_core::sensor::{MeshKind, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

/// The entries that are compared.
const ENTRIES: [[usize; 2]; 2] = [[0, 0], [1, 1]];

const PERMITTIVITY: f64 = 80.0;

struct Case {
    name: &'static str,
    shape: Shape,
    middle: [f64; 3],
    /// About z, y and x.
    turns: [f64; 3],
    /// What the body changes of the entries, in fF.
    changes: [f64; ENTRIES.len()],
}

const BAR: Shape = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };
const CUBE: Shape = Shape::Box { size: DVec3::splat(0.04) };
const CYLINDER: Shape = Shape::Cylinder { radius: 0.03, length: 0.1 };

#[rustfmt::skip]
const CASES: [Case; 8] = [
    Case { name: "bar, 50 mm", shape: BAR, middle: [0.0, 0.0, 0.06], turns: [0.0; 3], changes: [42.400, 23.945] },
    Case { name: "bar, 100 mm", shape: BAR, middle: [0.0, 0.0, 0.11], turns: [0.0; 3], changes: [4.822, 2.374] },
    Case { name: "turned bar", shape: BAR, middle: [0.01, 0.02, 0.11], turns: [0.4, 0.35, 0.25], changes: [7.671, 3.804] },
    Case { name: "cube", shape: CUBE, middle: [0.003, 0.004, 0.05], turns: [0.0; 3], changes: [21.174, 27.001] },
    Case { name: "turned cube", shape: CUBE, middle: [0.0, 0.0, 0.06], turns: [0.4, 0.35, 0.25], changes: [13.534, 15.247] },
    Case { name: "cylinder", shape: CYLINDER, middle: [0.02, 0.01, 0.08], turns: [0.0; 3], changes: [35.823, 53.551] },
    Case { name: "sphere", shape: Shape::Sphere { radius: 0.04 }, middle: [0.0, 0.0, 0.06], turns: [0.0; 3], changes: [61.940, 87.411] },
    Case { name: "capsule", shape: Shape::Capsule { radius: 0.02, length: 0.08 }, middle: [0.01, 0.02, 0.0825], turns: [0.0; 3], changes: [7.998, 34.633] },
];

impl Case {
    fn place(&self) -> Solids {
        let [z, y, x] = self.turns;
        let rotation = DQuat::from_euler(EulerRot::ZYX, z, y, x);
        let mut solids = Solids::new(std::slice::from_ref(&self.shape)).unwrap();
        solids.place(&[Pose { translation: DVec3::from_array(self.middle), rotation }]).unwrap();
        solids
    }
}

fn changes(simulator: &mut Simulator, solids: &Solids) -> [f64; ENTRIES.len()] {
    let _ = simulator.step(solids).unwrap();
    let (with, without) = (simulator.capacitance(), simulator.base());
    ENTRIES.map(|[i, j]| 1e15 * (with.get(i, j) - without.get(i, j)))
}

fn simulator(tets: usize, permittivity: f64) -> Simulator {
    let sensor = Sensor::generated(&three_stripes(), MeshKind::Lattice, tets).unwrap();
    println!("{} tetrahedra", sensor.mesh().tets().len());
    Simulator::new(sensor, vec![dielectric(permittivity)], to(1e-7)).unwrap()
}

/// The largest error, and the root of their mean square.
pub(crate) fn errors(tets: usize) -> [f64; 2] {
    let mut simulator = simulator(tets, PERMITTIVITY);
    let (mut largest, mut squares) = (0.0_f64, 0.0);
    for case in &CASES {
        let found = changes(&mut simulator, &case.place());
        let of_case: [f64; ENTRIES.len()] = std::array::from_fn(|at| found[at] / case.changes[at] - 1.0);
        println!("{}: {found:.3?} fF, {:.1?} %", case.name, of_case.map(|error| 100.0 * error));
        largest = of_case.into_iter().fold(largest, |largest, error| largest.max(error.abs()));
        squares += of_case.into_iter().map(|error| error * error).sum::<f64>();
    }
    [largest, (squares / (CASES.len() * ENTRIES.len()) as f64).sqrt()]
}

/// By edges alone they were 62 and 26 % at 30,000 tetrahedra, 62 and 22 % at 120,000.
#[test]
fn strong_bodies_change_what_they_do_on_finer_lattices() {
    for (tets, [largest, mean]) in [(30_000, [0.22, 0.12]), (120_000, [0.12, 0.055])] {
        let found = errors(tets);
        println!("{found:.3?}");
        assert!(found[0] < largest && found[1] < mean, "{tets}: {found:?}");
    }
}

/// One rule goes over into the other.
#[test]
fn nothing_jumps_as_a_permittivity_passes_ten() {
    let [mut below, mut above] = [9.99, 10.01].map(|permittivity| simulator(30_000, permittivity));
    for case in &CASES {
        let [below, above] = [&mut below, &mut above].map(|of| changes(of, &case.place()));
        for (below, above) in below.into_iter().zip(above) {
            assert!((above / below - 1.0).abs() < 3e-3, "{}: {below} {above}", case.name);
        }
    }
}
