//! Section V-C: a plate of 3 by 2 electrodes and a limb on random ways, seeded. Self-capacitances through the camera against exact
//! solids, and the paper's centroid model against cut edges.

use anyhow::Context;
use capsense::core::geometry::{Pose, Shape};
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::occupancy::Interface;
use capsense::core::solids::Solids;
use capsense::motion::{Motion, frames_until_end};
use capsense::scene::Geometry;
use capsense::series::pearson;
use capsense::{Pipeline, Scene};
use clap::Args;
use std::path::{Path, PathBuf};

/// Poses of a trajectory, a second apart.
const POSES: usize = 5;

/// Run random trajectories of a forearm and a leg past the plate
#[derive(Debug, Args)]
pub(crate) struct LimbsArguments {
    /// Folder with forearm.toml and leg.toml
    #[arg(long, default_value = "assets/scenes/section_v_c")]
    scenes: PathBuf,
    /// Trajectories, half of them of each limb
    #[arg(long, default_value_t = 20)]
    trajectories: usize,
    /// Frames per second
    #[arg(long, default_value_t = 10.0)]
    rate: f64,
    /// Seed of the trajectories
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Numbers that look random, the same on every machine: splitmix64.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^= mixed >> 31;
        low + (high - low) * (mixed >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A way with turns about all axes; the lowest point of the limb is 20 to 120 mm above the plate in each pose.
fn motion(random: &mut Random, shape: &Shape) -> anyhow::Result<Motion> {
    let Shape::Mesh(mesh) = shape else { anyhow::bail!("the limb is no mesh") };
    let mut pose = || {
        let tilt = DQuat::from_rotation_x(random.between(-0.35, 0.35));
        let roll = DQuat::from_rotation_y(random.between(-1.0, 1.0));
        let turn = DQuat::from_rotation_z(random.between(-1.2, 1.2));
        let rotation = (turn * tilt * roll).normalize();
        let heights = mesh.vertices().iter().map(|vertex| (rotation * *vertex).z);
        let z = random.between(0.02, 0.12) - heights.fold(f64::INFINITY, f64::min);
        let translation = DVec3::new(random.between(-0.08, 0.08), random.between(-0.06, 0.06), z);
        Pose { translation, rotation }
    };
    let samples = (0..POSES).map(|index| (index as f64, pose())).collect();
    Ok(Motion::sampled(samples)?)
}

/// Changes of self-capacitances over frames, one electrode after the other; and milliseconds of each frame.
struct Run {
    changes: Vec<Vec<f64>>,
    milliseconds: Vec<f64>,
}

fn run(scene: &Scene) -> anyhow::Result<Run> {
    let mut pipeline = Pipeline::new(scene)?;
    let electrodes = scene.electrodes.len();
    let mut run = Run { changes: vec![Vec::new(); electrodes], milliseconds: Vec::new() };
    for index in 0..scene.frames {
        let frame = pipeline.frame(index)?;
        for (electrode, changes) in run.changes.iter_mut().enumerate() {
            let base = pipeline.simulator().base().get(electrode, electrode);
            changes.push(frame.capacitance.get(electrode, electrode) - base);
        }
        run.milliseconds.push(frame.milliseconds.total);
    }
    Ok(run)
}

impl Run {
    /// Mean r over electrodes, and the root mean square difference in parts of the largest change.
    fn against(&self, other: &Run) -> [f64; 2] {
        let pairs = self.changes.iter().zip(&other.changes);
        let r: f64 = pairs.clone().map(|(a, b)| pearson(a, b).unwrap_or(0.0)).sum();
        let all: Vec<(f64, f64)> =
            pairs.flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied())).collect();
        let most = all.iter().fold(0.0_f64, |most, (_, b)| most.max(b.abs()));
        let square = all.iter().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / all.len() as f64;
        [r / self.changes.len() as f64, square.sqrt() / most]
    }

    fn median(&self) -> f64 {
        let mut sorted = self.milliseconds.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    }
}

pub(crate) fn limbs(arguments: &LimbsArguments) -> anyhow::Result<()> {
    let mut random = Random(arguments.seed);
    println!(
        "limb     no.  frames  largest change  camera and solids     centroid and cut edges  ms a frame: camera, solids, centroid"
    );
    println!("                      [fF]            r       rms           r       rms");
    for number in 0..arguments.trajectories {
        let limb = if number % 2 == 0 { "forearm" } else { "leg" };
        let path: &Path = &arguments.scenes.join(format!("{limb}.toml"));
        let mut scene = Scene::load(path).with_context(|| format!("trajectory {number}"))?;
        scene.frame_rate = arguments.rate;
        let shape = scene.objects[0].shape.clone();
        scene.objects[0].motion = motion(&mut random, &shape)?;
        scene.frames = frames_until_end([&scene.objects[0].motion], arguments.rate) as usize;
        let seen = run(&scene)?;
        let mut centroid = scene.clone();
        centroid.interface = Interface::Centroid;
        let centroid = run(&centroid)?;
        scene.geometry = Geometry::Solids(Solids::new(&[shape])?);
        let solid = run(&scene)?;
        let [r, rms] = seen.against(&solid);
        let [r_centroid, rms_centroid] = centroid.against(&seen);
        let most = solid.changes.iter().flatten().fold(0.0_f64, |most, change| most.max(change.abs()));
        println!(
            "{limb:8} {:3}  {:6}  {:8.1}        {r:.4}  {:4.1} %        {r_centroid:.4}  {:4.1} %        {:.2}  {:.2}  {:.2}",
            number + 1,
            scene.frames,
            1e15 * most,
            1e2 * rms,
            1e2 * rms_centroid,
            seen.median(),
            solid.median(),
            centroid.median()
        );
    }
    Ok(())
}
