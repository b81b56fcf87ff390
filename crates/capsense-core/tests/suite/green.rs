//! Frames answered through the Green's function of the empty scene, against a factorisation of the whole matrix.

use crate::common::{
    DIRECT, Dice, bar, both, conductor, depth_of_boxes, dielectric, relative_error, stripes_sensor,
    with_moved_nodes, without_lattice,
};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::{Interface, Surfaces};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::{Preconditioner, SolverOptions};

/// Largest difference of an entry relative to √(C_ii C_jj).
const ROUNDING: f64 = 1e-11;

const GREEN: SolverOptions = SolverOptions {
    tolerance: 1e-9,
    change_tolerance: None,
    preconditioner: Preconditioner::Direct,
    max_iterations: 100,
    threads: Some(1),
};

/// The same scene by both schemes.
struct Pair {
    green: Simulator,
    truth: Simulator,
    /// Of the last frame that was factorised: it stays as it was where a frame is answered otherwise.
    residual: f64,
    answered: usize,
    frames: usize,
    worst: f64,
}

impl Pair {
    fn new(sensor: &Sensor, materials: &[Material], interface: Interface) -> Self {
        let of = |options| {
            Simulator::with_interface(sensor.clone(), materials.to_vec(), options, interface).unwrap()
        };
        let mut green = of(GREEN);
        let nothing = depth_of_boxes([8, 8], &vec![nowhere(); materials.len()]);
        let residual = green.step(&nothing).unwrap().solve.residual;
        Self { green, truth: of(DIRECT), residual, answered: 0, frames: 0, worst: 0.0 }
    }

    fn step(&mut self, surfaces: &impl Surfaces) {
        let report = self.green.step(surfaces).unwrap().solve;
        let _ = self.truth.step(surfaces).unwrap();
        self.frames += 1;
        let before = std::mem::replace(&mut self.residual, report.residual);
        self.answered += usize::from(before.to_bits() == report.residual.to_bits());
        let error = relative_error(self.green.capacitance(), self.truth.capacitance());
        assert!(error < ROUNDING, "frame {}: {error:e}, {report:?}", self.frames);
        self.worst = self.worst.max(error);
        let [here, there] = [&self.green, &self.truth].map(|of| of.capacitance_to_ground().unwrap());
        for (electrode, (here, there)) in here.iter().zip(there).enumerate() {
            let scale = self.truth.capacitance().get(electrode, electrode);
            assert!((here - there).abs() < 1e-9 * scale, "to ground: {here:e} {there:e}");
        }
    }
}

/// A box that no pixel sees.
fn nowhere() -> Aabb {
    Aabb { min: DVec3::splat(0.9), max: DVec3::splat(1.0) }
}

fn material(dice: &mut Dice) -> Material {
    match dice.below(5) {
        0 => conductor(Connection::Grounded),
        1 => conductor(Connection::Floating),
        2 => conductor(Connection::Capacitance(10_f64.powf(dice.between(-14.0, -10.0)))),
        3 => dielectric(10_f64.powf(dice.between(-6.0, 6.0))),
        _ => dielectric(10_f64.powf(dice.between(-1.0, 1.0))),
    }
}

/// A box above the electrodes or around them.
fn solid(dice: &mut Dice) -> Aabb {
    let size = DVec3::new(dice.between(0.01, 0.2), dice.between(0.01, 0.2), dice.between(0.002, 0.1));
    let low = DVec3::new(dice.between(-0.25, 0.1), dice.between(-0.25, 0.1), dice.between(-0.03, 0.25));
    Aabb { min: low, max: low + size }
}

#[test]
fn frames_agree_with_a_factorisation_in_scenes_thrown_by_dice() {
    let lattice = stripes_sensor(3_000);
    let sensors = [without_lattice(&lattice), with_moved_nodes(&lattice), lattice];
    let mut dice = Dice(17);
    let (mut answered, mut frames) = (0, 0);
    let mut worst = 0.0_f64;
    for scene in 0..60 {
        let materials: Vec<Material> = (0..1 + dice.below(3)).map(|_| material(&mut dice)).collect();
        let interface = match scene % 6 {
            4 => Interface::Centroid,
            5 => Interface::VolumeFraction,
            _ => Interface::EdgeCut,
        };
        let mut pair = Pair::new(&sensors[dice.below(3)], &materials, interface);
        for _ in 0..8 {
            let some = |dice: &mut Dice| if dice.below(5) == 0 { nowhere() } else { solid(dice) };
            let boxes: Vec<Aabb> = materials.iter().map(|_| some(&mut dice)).collect();
            pair.step(&depth_of_boxes([40, 40], &boxes));
        }
        eprintln!("{interface:?} {}/{} {:e} {materials:?}", pair.answered, pair.frames, pair.worst);
        answered += pair.answered;
        frames += pair.frames;
        worst = worst.max(pair.worst);
    }
    eprintln!("{answered} of {frames} frames answered, worst {worst:e}");
    assert!(2 * answered > frames, "{answered} of {frames}");
}

/// Solids have links at their edges, which may weigh less than nothing.
#[test]
fn frames_of_turned_solids_agree_with_a_factorisation() {
    let mut dice = Dice(3);
    let shapes = [
        Shape::Box { size: DVec3::new(0.08, 0.06, 0.04) },
        Shape::Cylinder { radius: 0.02, length: 0.05 },
        Shape::Sphere { radius: 0.03 },
    ];
    for (scene, sensor) in both(stripes_sensor(4_000)).iter().cycle().take(8).enumerate() {
        let materials: Vec<Material> = shapes.iter().map(|_| material(&mut dice)).collect();
        let mut pair = Pair::new(sensor, &materials, Interface::EdgeCut);
        let mut solids = Solids::new(&shapes).unwrap();
        for _ in 0..8 {
            let poses: Vec<Pose> = (0..3)
                .map(|k| Pose {
                    rotation: DQuat::from_rotation_x(dice.between(0.0, 3.0)),
                    ..Pose::at(DVec3::new(
                        0.1 * (f64::from(k) - 1.0),
                        dice.between(-0.05, 0.05),
                        dice.between(0.06, 0.2),
                    ))
                })
                .collect();
            solids.place(&poses).unwrap();
            pair.step(&solids);
        }
        eprintln!("{scene}: {}/{} {:e} {materials:?}", pair.answered, pair.frames, pair.worst);
        assert!(pair.answered > 0);
    }
}

/// Nothing, a corner, half, and all of the domain, all of it around the electrodes too.
#[test]
fn full_and_empty_scenes_agree_with_a_factorisation() {
    let low = DVec3::splat(-0.5);
    let corners = [DVec3::splat(0.9), DVec3::splat(-0.1), DVec3::new(0.5, 0.0, 0.5), DVec3::splat(0.5)];
    for sensor in both(stripes_sensor(3_000)) {
        for material in [
            conductor(Connection::Grounded),
            conductor(Connection::Floating),
            dielectric(1e6),
            dielectric(1e-6),
        ] {
            let mut pair = Pair::new(&sensor, &[material], Interface::EdgeCut);
            for corner in corners.into_iter().chain(corners.into_iter().rev()) {
                let solid = if corner.x > 0.8 { nowhere() } else { Aabb { min: low, max: corner } };
                pair.step(&depth_of_boxes([40, 40], &[solid]));
            }
            assert!(pair.answered > 1 && pair.answered <= pair.frames, "{} {material:?}", pair.answered);
        }
    }
}

/// Whatever came before, a frame has the bits that it has in a new simulator.
#[test]
fn nothing_is_left_of_frames_before() {
    let sensor = stripes_sensor(3_000);
    let materials = [conductor(Connection::Floating), dielectric(30.0)];
    let of_frame = |k: u32| {
        let other = Aabb { min: DVec3::new(0.02, 0.0, 0.1), max: DVec3::new(0.08, 0.05, 0.14) };
        depth_of_boxes([40, 40], &[bar(0.05 + 0.003 * f64::from(k), 0.01 * f64::from(k)), other])
    };
    let mut simulator = Simulator::new(sensor.clone(), materials.to_vec(), GREEN).unwrap();
    // Between frames the scene is full, so that it is factorised.
    let full = Aabb { min: DVec3::new(-0.2, -0.2, 0.02), max: DVec3::splat(0.4) };
    for k in 0..6 {
        let _ = simulator.step(&of_frame(k)).unwrap();
        let mut fresh = Simulator::new(sensor.clone(), materials.to_vec(), GREEN).unwrap();
        let _ = fresh.step(&of_frame(k)).unwrap();
        assert_eq!(simulator.capacitance(), fresh.capacitance());
        let _ = simulator.step(&depth_of_boxes([40, 40], &[nowhere(), full])).unwrap();
    }
}
