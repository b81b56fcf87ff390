//! A frame on a graphics device beside one on the processor, of lattices and of other meshes, and many scenes at once: `gpu_step`,
//! `gpu_network` and `gpu_batch`.
//!
//! Without a real graphics adapter there is nothing to time: kernels are compiled and run once in software, which says that
//! they work, never how fast they are. `scripts/gpu.sh` makes a table of it.

mod common;

use capsense::core::batch::Batch;
use capsense::core::geometry::Pose;
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::material::{Connection, Material};
use capsense::core::occupancy::Interface;
use capsense::core::sensor::{MeshKind, Sensor};
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::render::RenderError;
use capsense::render::fields::{Camera, GpuFields, GpuNetwork, Objects, Traffic};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Instant;

const BAR: Material = Material::Conductor(Connection::Grounded);

/// Meshes of one scene, and of the scenes of a batch.
const TETS: [usize; 4] = [24_000, 200_000, 1_500_000, 12_000_000];
/// The largest that is run once in software, to count launches and bytes.
const IN_SOFTWARE: usize = 200_000;
/// Bisected meshes; in software the first is run once, with `CAPSENSE_BENCH_LARGE=1` all are.
const NETWORK_TETS: [usize; 2] = [300_000, 1_000_000];
const BATCH: (usize, usize) = (24_000, 256);

/// The stripes of the other benches.
fn sensor(tets: usize) -> Sensor {
    let lattice = common::design().lattice(tets).expect("the stripes fit the domain");
    common::on_lattice(&lattice)
}

/// A bar that moves 1 mm a frame towards the stripes and away, between 50 and 100 mm above them.
fn pose(frame: usize) -> Pose {
    let step = frame % 100;
    let height = 0.05 + 1e-3 * step.min(100 - step) as f64;
    Pose { translation: DVec3::new(0.0, 0.0, height), rotation: DQuat::IDENTITY }
}

fn place(solids: &mut Solids, frame: usize) {
    solids.place(&[pose(frame)]).expect("a translation is a pose");
}

fn solids() -> Solids {
    Solids::new(&[common::BAR]).expect("a box is a solid")
}

fn simulator_on(sensor: &Sensor, gpu: &GpuFields, scene: usize) -> Simulator {
    let columns = sensor.electrode_names().len();
    let fields = gpu.scene(scene, columns).expect("each scene is asked for once");
    Simulator::with_remote(
        sensor.clone(),
        vec![BAR],
        common::solver_options(Some(1)),
        Interface::EdgeCut,
        fields,
    )
    .expect("the empty scene has a solution")
}

fn fields(sensor: &Sensor, scenes: usize) -> Result<GpuFields, RenderError> {
    let problem = Simulator::remote_problem(sensor, &[BAR]).expect("the mesh is a lattice");
    GpuFields::new(&problem, scenes, true)
}

/// Fields on a device, whatever the mesh.
trait Counted {
    fn is_software(&self) -> bool;
    fn take_traffic(&self) -> Traffic;
    fn description(&self) -> String;
}

impl Counted for GpuFields {
    fn is_software(&self) -> bool {
        self.is_software()
    }

    fn take_traffic(&self) -> Traffic {
        self.take_traffic()
    }

    fn description(&self) -> String {
        self.description()
    }
}

impl Counted for GpuNetwork {
    fn is_software(&self) -> bool {
        self.is_software()
    }

    fn take_traffic(&self) -> Traffic {
        self.take_traffic()
    }

    fn description(&self) -> String {
        self.description()
    }
}

/// The same scenes seen by a depth camera on the device, which finds the objects, too.
fn with_camera(sensor: &Sensor, scenes: usize) -> Result<GpuFields, RenderError> {
    let problem = Simulator::remote_problem(sensor, &[BAR]).expect("the mesh is a lattice");
    let camera = Camera { view: common::VIEW, back_fill: false };
    let objects = Objects { shapes: vec![common::BAR], materials: vec![BAR] };
    GpuFields::with_camera((&problem, sensor), camera, &vec![objects; scenes], true)
}

/// Frames of one scene whose objects the device finds: what they cost, and, on a real adapter, a bench of them.
fn step_with_camera(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    sensor: &Sensor,
) -> Result<(), RenderError> {
    let name = format!("{name}, objects found on the device");
    let gpu = with_camera(sensor, 1)?;
    let mut simulator = simulator_on(sensor, &gpu, 0);
    let mut frame = |index: usize| {
        gpu.place(0, &[pose(index)]).expect("a translation is a pose");
        simulator.step_elsewhere().expect("a frame is solved")
    };
    report(&name, &gpu, 1, |index| {
        let _ = frame(index);
    });
    if !gpu.is_software() {
        let mut index = 0;
        group.bench_function(&name, |bencher| {
            bencher.iter(|| {
                index += 1;
                black_box(frame(index))
            });
        });
    }
    Ok(())
}

/// Frames after the first ones, as many as take some seconds; prints what they cost. In software, one.
fn report(name: &str, gpu: &impl Counted, scenes: usize, mut frame: impl FnMut(usize)) {
    (0..3).for_each(&mut frame);
    let _ = gpu.take_traffic();
    let count = if gpu.is_software() { 1 } else { 100 };
    let started = Instant::now();
    (3..3 + count).for_each(&mut frame);
    let seconds = started.elapsed().as_secs_f64();
    let traffic = gpu.take_traffic();
    let each = |number: f64| number / count as f64;
    let timing = if gpu.is_software() {
        "not timed: software".to_owned()
    } else {
        let bandwidth = traffic.moved as f64 / seconds / 1e9;
        let rate = (scenes * count) as f64 / seconds;
        format!("{:.3} ms, {rate:.0} scenes a second, {bandwidth:.0} GB/s at least", 1e3 * each(seconds))
    };
    println!(
        "{name}: {timing}; {:.1} launches, {:.1} kB sent, {:.2} kB received, {:.1} MB moved a frame; {}",
        each(traffic.launches as f64),
        1e-3 * each(traffic.sent as f64),
        1e-3 * each(traffic.received as f64),
        1e-6 * each(traffic.moved as f64),
        gpu.description(),
    );
}

fn gpu_step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gpu_step");
    group.sample_size(10);
    for tets in TETS {
        let sensor = sensor(tets);
        let name = format!("{} tetrahedra", sensor.mesh().tets().len());
        let gpu = match fields(&sensor, 1) {
            Ok(gpu) => gpu,
            Err(error) => {
                println!("{name}: skipped, {error}");
                return;
            }
        };
        let mut on_gpu = simulator_on(&sensor, &gpu, 0);
        let mut solids = solids();
        report(&name, &gpu, 1, |index| {
            place(&mut solids, index);
            let _ = on_gpu.step(&solids).expect("a frame is solved");
        });
        if let Err(error) = step_with_camera(&mut group, &name, &sensor) {
            println!("{name}, objects found on the device: skipped, {error}");
        }
        if gpu.is_software() && tets < IN_SOFTWARE {
            continue;
        }
        if gpu.is_software() {
            println!("{name}: larger meshes and timing skipped, as there is no real graphics adapter");
            break;
        }
        let mut index = 0;
        group.bench_function(&name, |bencher| {
            bencher.iter(|| {
                index += 1;
                place(&mut solids, index);
                black_box(on_gpu.step(&solids).expect("a frame is solved"))
            });
        });
        if tets > 2_000_000 {
            continue;
        }
        let mut on_cpu = Simulator::new(sensor, vec![BAR], common::solver_options(Some(1)))
            .expect("the empty scene has a solution");
        group.bench_function(format!("{name}, one core of the processor"), |bencher| {
            bencher.iter(|| {
                index += 1;
                place(&mut solids, index);
                black_box(on_cpu.step(&solids).expect("a frame is solved"))
            });
        });
    }
    group.finish();
}

fn gpu_network(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gpu_network");
    group.sample_size(10);
    for tets in NETWORK_TETS {
        let sensor = Sensor::generated(&common::design(), MeshKind::Bisection, tets)
            .expect("the stripes fit the domain");
        let name = format!("{} bisected tetrahedra", sensor.mesh().tets().len());
        let problem = Simulator::network_problem(&sensor, &[BAR], Interface::EdgeCut)
            .expect("a bisected mesh is no lattice");
        let gpu = match GpuNetwork::new(problem, true) {
            Ok(gpu) => gpu,
            Err(error) => {
                println!("{name}: skipped, {error}");
                return;
            }
        };
        let options = common::solver_options(Some(1));
        let fields = gpu.fields().expect("the fields are asked for once");
        let on_gpu = Simulator::with_remote(sensor.clone(), vec![BAR], options, Interface::EdgeCut, fields);
        let mut on_gpu = on_gpu.expect("the empty scene has a solution");
        let mut solids = solids();
        report(&name, &gpu, 1, |index| {
            place(&mut solids, index);
            let _ = on_gpu.step(&solids).expect("a frame is solved");
        });
        if gpu.is_software() && common::is_large() {
            continue;
        }
        if gpu.is_software() {
            println!("{name}: larger meshes and timing skipped, as there is no real graphics adapter");
            break;
        }
        let mut index = 0;
        group.bench_function(&name, |bencher| {
            bencher.iter(|| {
                index += 1;
                place(&mut solids, index);
                black_box(on_gpu.step(&solids).expect("a frame is solved"))
            });
        });
        let mut on_cpu = Simulator::new(sensor, vec![BAR], options).expect("the empty scene has a solution");
        group.bench_function(format!("{name}, one core of the processor"), |bencher| {
            bencher.iter(|| {
                index += 1;
                place(&mut solids, index);
                black_box(on_cpu.step(&solids).expect("a frame is solved"))
            });
        });
    }
    group.finish();
}

fn gpu_batch(criterion: &mut Criterion) {
    let (tets, scenes) = BATCH;
    let sensor = sensor(tets);
    let name = format!("{scenes} scenes of {} tetrahedra", sensor.mesh().tets().len());
    let gpu = match fields(&sensor, scenes) {
        Ok(gpu) if gpu.is_software() => {
            println!("{name}: skipped, as there is no real graphics adapter");
            return;
        }
        Ok(gpu) => gpu,
        Err(error) => {
            println!("{name}: skipped, {error}");
            return;
        }
    };
    let mut batch = Batch::new((0..scenes).map(|scene| simulator_on(&sensor, &gpu, scene)).collect());
    let mut all = vec![solids(); scenes];
    let mut frame = |index: usize| {
        all.iter_mut().enumerate().for_each(|(scene, solids)| place(solids, index + scene));
        batch.step(&all).into_iter().for_each(|report| assert!(report.is_ok(), "{report:?}"));
    };
    report(&name, &gpu, scenes, &mut frame);
    batch_with_camera(&name, &sensor, scenes);
    let mut group = criterion.benchmark_group("gpu_batch");
    group.sample_size(10);
    let mut index = 0;
    group.bench_function(&name, |bencher| {
        bencher.iter(|| {
            index += 1;
            frame(index);
        });
    });
    let simulator = Simulator::new(sensor, vec![BAR], common::solver_options(Some(1)))
        .expect("the empty scene has a solution");
    let mut on_cpu = Batch::new(vec![simulator; scenes]);
    let mut all = vec![solids(); scenes];
    group.bench_function(format!("{name}, processor, all cores"), |bencher| {
        bencher.iter(|| {
            index += 1;
            all.iter_mut().enumerate().for_each(|(scene, solids)| place(solids, index + scene));
            on_cpu.step(&all).into_iter().for_each(|report| assert!(report.is_ok(), "{report:?}"));
        });
    });
    group.finish();
}

/// The same with objects found on the device.
fn batch_with_camera(name: &str, sensor: &Sensor, scenes: usize) {
    let name = format!("{name}, objects found on the device");
    let gpu = match with_camera(sensor, scenes) {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("{name}: skipped, {error}");
            return;
        }
    };
    let mut batch = Batch::new((0..scenes).map(|scene| simulator_on(sensor, &gpu, scene)).collect());
    report(&name, &gpu, scenes, |index| {
        for scene in 0..scenes {
            gpu.place(scene, &[pose(index + scene)]).expect("a translation is a pose");
        }
        batch.step_elsewhere().into_iter().for_each(|report| assert!(report.is_ok(), "{report:?}"));
    });
}

criterion_group!(benches, gpu_step, gpu_network, gpu_batch);
criterion_main!(benches);
