//! Two conductors so close to each other that no node of the mesh is between them: what couples them is in no field, and shields or
//! lifts the potential of a floating one all the same.

use crate::common::{FLOATING, GROUNDED, both, conductor, depth_of_boxes, dielectric, three_stripes, to};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

const BAR: DVec3 = DVec3::new(0.15, 0.15, 0.02);

fn sensor(tets: usize) -> Sensor {
    let design = three_stripes();
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// A bar so high above the electrodes, another one above it with a gap between them, and what they change of C11, C22 and C12.
struct Stack {
    simulator: Simulator,
    solids: Solids,
    lowest: f64,
    size: DVec3,
    /// Where further bodies are.
    more: Vec<Pose>,
}

impl Stack {
    fn of(sensor: Sensor, materials: &[Material], lowest: f64, size: DVec3) -> Self {
        Self {
            simulator: Simulator::new(sensor, materials.to_vec(), to(1e-6)).unwrap(),
            solids: Solids::new(&vec![Shape::Box { size }; materials.len()]).unwrap(),
            lowest,
            size,
            more: Vec::new(),
        }
    }

    fn change(&mut self, gap: f64) -> [f64; 3] {
        let lower = Pose::at(DVec3::new(0.0, 0.0, self.lowest + 0.5 * self.size.z));
        let upper = Pose::at(DVec3::new(0.0, 0.03, self.lowest + 1.5 * self.size.z + gap));
        let poses: Vec<Pose> = [lower, upper].into_iter().chain(self.more.iter().copied()).collect();
        self.solids.place(&poses).unwrap();
        let _ = self.simulator.step(&self.solids).unwrap();
        let change = |i, j| self.simulator.capacitance().get(i, j) - self.simulator.base().get(i, j);
        [change(0, 0), change(1, 1), change(0, 1)]
    }
}

/// 100 mm above the electrodes, cells of 30,000 tetrahedra are as high as both bars and the gap. Without capacitors across gaps,
/// changes are 2.7 times too small up to 8 mm, and jump there; those by plates of 2 mm are up to seven times too small.
#[test]
fn a_grounded_body_shields_a_floating_one_across_a_gap_without_nodes() {
    let materials = [FLOATING, GROUNDED];
    let gaps = [1e-3, 3e-3, 6e-3, 1e-2, 1.5e-2];
    for size in [BAR, DVec3 { z: 2e-3, ..BAR }] {
        let mut fine = Stack::of(sensor(300_000), &materials, 0.1, size);
        let exact = gaps.map(|gap| fine.change(gap));
        for coarse in both(sensor(30_000)) {
            let mut coarse = Stack::of(coarse, &materials, 0.1, size);
            for (gap, exact) in gaps.into_iter().zip(exact) {
                for (change, exact) in coarse.change(gap).into_iter().zip(exact) {
                    let ratio = change / exact;
                    assert!((ratio - 1.0).abs() < 0.08, "{size} {gap}: {change:e} {exact:e} {ratio}");
                }
            }
        }
    }
}

/// The further the bars are from each other, the less the grounded one does, but for 3.5 % as nodes pass through the gap.
#[test]
fn changes_fall_steadily_as_a_gap_opens() {
    for sensor in both(sensor(30_000)) {
        for lowest in [0.1, 0.13, 0.16, 0.2] {
            let mut stack = Stack::of(sensor.clone(), &[FLOATING, GROUNDED], lowest, BAR);
            let changes: Vec<_> = (1..80).map(|half| stack.change(5e-4 * f64::from(half))).collect();
            for (step, pair) in changes.windows(2).enumerate() {
                for (before, after) in pair[0].into_iter().zip(pair[1]) {
                    let fall = 1.0 - after / before;
                    assert!((-0.035..0.06).contains(&fall), "{lowest}, step {step}: {before:e} {after:e}");
                }
            }
        }
    }
}

/// The lower and the upper half of a floating bar, a micrometre from each other, are the bar, as well as cells as high as it know it.
/// Without a capacitor between them they do a tenth of what it does.
#[test]
fn halves_of_a_floating_bar_are_the_bar() {
    let at = |z: f64| Pose::at(DVec3::new(0.0, 0.0, z));
    let half = DVec3 { z: 0.5 * BAR.z - 5e-7, ..BAR };
    for sensor in both(sensor(30_000)) {
        let changed = |size: DVec3, poses: &[Pose]| {
            let materials = vec![FLOATING; poses.len()];
            let mut simulator = Simulator::new(sensor.clone(), materials, to(1e-6)).unwrap();
            let mut solids = Solids::new(&vec![Shape::Box { size }; poses.len()]).unwrap();
            solids.place(poses).unwrap();
            let _ = simulator.step(&solids).unwrap();
            [(0, 0), (1, 1), (0, 1)]
                .map(|(i, j)| simulator.capacitance().get(i, j) - simulator.base().get(i, j))
        };
        for height in [0.105, 0.11, 0.115, 0.12, 0.125] {
            let away = 0.5 * half.z + 5e-7;
            let whole = changed(BAR, &[at(height)]);
            let halves = changed(half, &[at(height - away), at(height + away)]);
            for (whole, halves) in whole.into_iter().zip(halves) {
                let ratio = halves / whole;
                assert!((ratio - 1.0).abs() < 0.1, "{height}: {whole:e} {halves:e} {ratio}");
            }
        }
    }
}

/// A dielectric in the gap couples its sides by so much more; and capacitances to ground know of a gap to a grounded body.
#[test]
fn gaps_are_filled_by_dielectrics_and_lead_charge_to_ground() {
    let gap = 2e-3;
    let mut empty = Stack::of(sensor(30_000), &[FLOATING, GROUNDED], 0.1, BAR);
    let mut filled = Stack::of(sensor(30_000), &[FLOATING, GROUNDED, dielectric(20.0)], 0.1, BAR);
    filled.more = vec![Pose::at(DVec3::new(0.0, 0.015, 0.12 + 0.5 * gap))];
    let near = empty.change(gap / 10.0);
    for (near, filled) in near.into_iter().zip(filled.change(gap)) {
        assert!((filled / near - 1.0).abs() < 0.03, "{near:e} {filled:e}");
    }
    let _ = empty.change(gap);
    let (c, to_ground) = (empty.simulator.capacitance(), empty.simulator.capacitance_to_ground().unwrap());
    for (electrode, to_ground) in to_ground.into_iter().enumerate() {
        let row: f64 = (0..c.size()).map(|other| c.get(electrode, other)).sum();
        assert!((row + to_ground).abs() < 1e-3 * row, "{row:e} {to_ground:e}");
    }
}

/// A rod through a floating bar is a part of it, wherever along the edges it ends: across the gap it is the bar that couples.
#[test]
fn what_is_within_a_conductor_takes_nothing_from_its_gap() {
    let materials = [FLOATING, FLOATING, GROUNDED];
    let changed = |rod: f64| {
        let mut simulator = Simulator::new(sensor(30_000), materials.to_vec(), to(1e-6)).unwrap();
        let inner = DVec3::new(0.14, 0.14, 4e-3);
        let mut solids = Solids::new(&[BAR, inner, BAR].map(|size| Shape::Box { size })).unwrap();
        let poses = [0.11, rod, 0.133].map(|z| Pose::at(DVec3::new(0.0, 0.0, z)));
        solids.place(&poses).unwrap();
        let _ = simulator.step(&solids).unwrap();
        simulator.capacitance().get(0, 0) - simulator.base().get(0, 0)
    };
    let [low, middle, high] = [0.103, 0.1095, 0.111].map(changed);
    assert!(
        (low / middle - 1.0).abs() < 0.02 && (high / middle - 1.0).abs() < 0.02,
        "{low:e} {middle:e} {high:e}"
    );
}

/// Seen by a camera it is the same, and a body that much ties to ground is a grounded one.
#[test]
fn the_camera_and_capacitances_to_ground_know_of_gaps() {
    let tied = conductor(Connection::Capacitance(1e-6));
    let [low, gap] = [0.1, 3e-3];
    let above =
        |low: f64| Aabb { min: DVec3::new(-0.075, -0.075, low), max: DVec3::new(0.075, 0.075, low + 0.02) };
    let depth = depth_of_boxes([64, 64], &[above(low), above(low + 0.02 + gap)]);
    let [grounded, tied] = [GROUNDED, tied].map(|upper| {
        let mut simulator = Simulator::new(sensor(30_000), vec![FLOATING, upper], to(1e-6)).unwrap();
        let _ = simulator.step(&depth).unwrap();
        simulator.capacitance().get(0, 0) - simulator.base().get(0, 0)
    });
    let mut fine = Simulator::new(sensor(300_000), vec![FLOATING, GROUNDED], to(1e-6)).unwrap();
    let _ = fine.step(&depth).unwrap();
    let exact = fine.capacitance().get(0, 0) - fine.base().get(0, 0);
    assert!((tied / grounded - 1.0).abs() < 1e-4, "{grounded:e} {tied:e}");
    assert!((grounded / exact - 1.0).abs() < 0.07, "{grounded:e} {exact:e}");
}
