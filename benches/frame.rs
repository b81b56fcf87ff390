//! One frame of the steel-bar scene in its parts, on one thread: depth on the CPU, update, solve.
//!
//! The bar moves 1 mm sideways each frame. Throughput is in tetrahedra.

#![allow(clippy::unwrap_used, missing_docs)]

use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{Sensor, SensorDesign};
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;
use capsense_render::{Backend, DepthRenderer};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };
const VIEW: OrthographicView = OrthographicView { domain: DOMAIN, width: 64, height: 64 };

/// Depth images of a bar that passes the sensor in steps of 1 mm.
fn passing_bar() -> Vec<DepthLayers> {
    let bar = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };
    let mut renderer = DepthRenderer::new(Backend::Cpu, VIEW, &[bar]).unwrap();
    (0..100)
        .map(|step| {
            let mut depth = DepthLayers::empty(VIEW, 1);
            let pose = Pose::at(DVec3::new(0.0, -0.05 + 1e-3 * f64::from(step), 0.06));
            renderer.render(&[pose], &mut depth).unwrap();
            depth
        })
        .collect()
}

fn simulator(tets: usize) -> Simulator {
    let electrodes = [-0.03, 0.0, 0.03]
        .into_iter()
        .map(|y| {
            let outline = Outline::Rectangle { center: DVec2::new(0.0, y), size: DVec2::new(0.1, 0.02) };
            Electrode { name: format!("E{y}"), outline, z: 0.0 }
        })
        .collect();
    let design = SensorDesign { domain: DOMAIN, electrodes, substrate: None };
    let sensor = Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap();
    Simulator::new(sensor, vec![Material::Conductor(Connection::Grounded)], SolverOptions::default()).unwrap()
}

fn depth(criterion: &mut Criterion) {
    let bar = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };
    let mut renderer = DepthRenderer::new(Backend::Cpu, VIEW, &[bar]).unwrap();
    let mut layers = DepthLayers::empty(VIEW, 1);
    criterion.bench_function("depth/bar 64x64 on the CPU", |b| {
        b.iter(|| renderer.render(&[Pose::at(DVec3::new(0.0, 0.0, 0.06))], &mut layers).unwrap());
    });
}

fn frame(criterion: &mut Criterion) {
    let frames = passing_bar();
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(20);
    for tets in [10_000, 30_000, 100_000, 300_000] {
        let mut simulator = simulator(tets);
        group.throughput(Throughput::Elements(simulator.sensor().mesh().tets().len() as u64));
        let mut next = 0;
        group.bench_function(BenchmarkId::new("step", tets), |b| {
            b.iter(|| {
                next = (next + 1) % frames.len();
                simulator.step(&frames[next]).unwrap()
            });
        });
        group.bench_function(BenchmarkId::new("update", tets), |b| {
            b.iter(|| {
                next = (next + 1) % frames.len();
                simulator.update(&frames[next]).unwrap()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, depth, frame);
criterion_main!(benches);
