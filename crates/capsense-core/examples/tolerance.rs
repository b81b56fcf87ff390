//! How well tolerances are kept: scenes thrown by dice, against a factorisation.
//!
//! `cargo run --release -p capsense-core --example tolerance -- [FIRST_SEED] [SEEDS]` prints, for each tolerance, how many
//! frames are above it and the largest error in units of it, and then the frames above twice theirs. Lattices of 6,000 to
//! 20,000 tetrahedra, as the product makes them and growing evenly, and the same as plain tetrahedra; one to four objects of all
//! kinds, boxes seen by a camera, that drift, jump, appear and vanish.

#![allow(clippy::unwrap_used)]

#[path = "../tests/suite/common/mod.rs"]
mod common;

use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::Material;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use common::{Dice, any_material, depth_of_boxes, oracle, relative_error, stripes_sensor, three_stripes, to};

const TOLERANCES: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8];
const SCENES: usize = 60;
const FRAMES: usize = 40;

/// A frame that was solved: its error in units of the tolerance, and where it is.
struct Solved {
    error: f64,
    place: String,
}

impl Solved {
    fn is_above(&self, times: f64) -> bool {
        self.error.is_nan() || self.error > times
    }
}

fn sensor(dice: &mut Dice) -> (Sensor, String) {
    let tets = dice.between(6e3, 2e4) as usize;
    let (graded, sensor) = match dice.below(2) {
        0 => ("even", stripes_sensor(tets)),
        _ => {
            let lattice = three_stripes().lattice(tets).unwrap();
            ("graded", Sensor::on_lattice(&three_stripes(), &lattice).unwrap())
        }
    };
    match dice.below(2) {
        0 => (sensor.off_lattice(), format!("csr of {tets}, {graded}")),
        _ => (sensor, format!("lattice of {tets}, {graded}")),
    }
}

/// A box; one in ten is out of sight.
fn solid(dice: &mut Dice) -> Aabb {
    let size = DVec3::new(dice.between(0.03, 0.2), dice.between(0.03, 0.2), dice.between(0.01, 0.1));
    let low = DVec3::new(dice.between(-0.25, 0.1), dice.between(-0.25, 0.1), dice.between(0.01, 0.25));
    let away = if dice.below(10) == 0 { DVec3::X } else { DVec3::ZERO };
    Aabb { min: low + away, max: low + away + size }
}

fn run_scene(seed: u64, scene: usize, solved: &mut [Vec<Solved>; TOLERANCES.len()]) {
    let mut dice = Dice(1000 * seed + scene as u64 + 1);
    dice.next();
    let (sensor, name) = sensor(&mut dice);
    let materials: Vec<Material> = (0..1 + dice.below(4)).map(|_| any_material(&mut dice)).collect();
    let mut boxes: Vec<Aabb> = materials.iter().map(|_| solid(&mut dice)).collect();
    let jumps = [8, 1000][dice.below(2)];
    let speed = 10_f64.powf(dice.between(-3.5, -2.2));
    let mut ways: Vec<DVec3> = boxes.iter().map(|_| speed * dice.point() / 0.3).collect();
    let mut truth = oracle(&sensor, &materials);
    let mut tested =
        TOLERANCES.map(|tolerance| Simulator::new(sensor.clone(), materials.clone(), to(tolerance)).unwrap());
    for frame in 0..FRAMES {
        let depth = depth_of_boxes([48, 48], &boxes);
        let _ = truth.step(&depth).unwrap();
        for ((simulator, solved), tolerance) in tested.iter_mut().zip(solved.iter_mut()).zip(TOLERANCES) {
            let report = simulator.step(&depth).unwrap().solve;
            let error = relative_error(simulator.capacitance(), truth.capacitance()) / tolerance;
            let estimate = report.relative_error / tolerance;
            let place = format!(
                "seed {seed}, scene {scene} ({name}, {materials:?}), frame {frame}: {} iterations, estimated {estimate:.2}{}",
                report.iterations,
                if report.skipped { ", skipped" } else { "" }
            );
            solved.push(Solved { error, place });
        }
        for (at, way) in boxes.iter_mut().zip(&mut ways) {
            *at = Aabb { min: at.min + *way, max: at.max + *way };
            if dice.below(jumps) == 0 {
                *at = solid(&mut dice);
                *way = speed * dice.point() / 0.3;
            }
        }
    }
}

fn main() {
    let mut numbers = std::env::args().skip(1).map(|argument| argument.parse::<u64>().unwrap());
    let (first, seeds) = (numbers.next().unwrap_or(1), numbers.next().unwrap_or(1));
    let mut solved = [const { Vec::new() }; TOLERANCES.len()];
    for seed in first..first + seeds {
        (0..SCENES).for_each(|scene| run_scene(seed, scene, &mut solved));
    }
    println!("| tolerance | frames | above it | above 3 times | worst |");
    for (solved, tolerance) in solved.iter().zip(TOLERANCES) {
        let above = |times: f64| solved.iter().filter(|frame| frame.is_above(times)).count();
        let worst = solved.iter().map(|frame| frame.error).fold(0.0, f64::max);
        println!("| {tolerance:e} | {} | {} | {} | {worst:.2} |", solved.len(), above(1.0), above(3.0));
    }
    for (solved, tolerance) in solved.iter().zip(TOLERANCES) {
        for frame in solved.iter().filter(|frame| frame.is_above(2.0)) {
            println!("{tolerance:e}: {:.2} times, {}", frame.error, frame.place);
        }
    }
}
