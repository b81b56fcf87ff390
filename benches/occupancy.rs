//! From where a bar is to the edges that it changes, as it moves 1 mm a frame: by the depth camera, its image given, and
//! by solids, from the pose on. One thread.
//!
//! The bar is a grounded conductor, or of a weak dielectric where so named; it is turned by 20 degrees, or along the axes where solids are
//! asked so. Benches are named source/motion/elements. Throughput is in changed edges, the mean over all frames.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::geometry::Pose;
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{DepthLayers, EdgeGeometry, Occupancy, OrthographicView, Surfaces};
use capsense_core::sensor::Sensor;
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use capsense_render::{Backend, DepthRenderer};
use common::{BAR, DOMAIN, design, on_lattice};
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use std::time::{Duration, Instant};

/// The bar's turn about the sensor's axis, in radians, so that it moves past pixels and nodes at all angles.
const YAW: f64 = 0.35;

/// There and back on a way of 100 mm, 1 mm a frame, turned.
fn poses(centre: impl Fn(f64) -> DVec3) -> Vec<Pose> {
    let way = (0..=100).chain((1..100).rev());
    way.map(|millimetres| Pose {
        rotation: DQuat::from_rotation_z(YAW),
        ..Pose::at(centre(1e-3 * f64::from(millimetres)))
    })
    .collect()
}

/// The same way along the axes, as in the steel-bar scene.
fn straight(poses: &[Pose]) -> Vec<Pose> {
    poses.iter().map(|pose| Pose::at(pose.translation)).collect()
}

struct Subject<'a> {
    sensor: &'a Sensor,
    network: &'a EdgeNetwork,
    material: Material,
    occupancy: Occupancy,
}

impl Subject<'_> {
    fn update(&mut self, surfaces: &dyn Surfaces) -> usize {
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        };
        self.occupancy.update(mesh, &[self.material], surfaces);
        self.occupancy.changed_edges().len()
    }

    /// Measures an update that ends with a frame's changed edges; `frame` tells how many these are.
    fn measure(
        &mut self,
        criterion: &mut Criterion,
        source: &str,
        name: String,
        frames: usize,
        mut frame: impl FnMut(&mut Self, usize) -> usize,
    ) {
        // Once around, so that the first frame, which finds all of the bar, is not among those measured.
        frame(self, frames - 1);
        let changed: usize = (0..frames).map(|index| frame(self, index)).sum();
        let mut group = criterion.benchmark_group(source);
        group.sample_size(20).sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
        group.throughput(Throughput::Elements((changed / frames) as u64));
        let mut next = 0;
        group.bench_function(BenchmarkId::from_parameter(name), |b| {
            b.iter_custom(|iterations| {
                let started = Instant::now();
                for _ in 0..iterations {
                    frame(self, next % frames);
                    next += 1;
                }
                started.elapsed()
            });
        });
        group.finish();
    }
}

fn occupancy(criterion: &mut Criterion) {
    let is_test = std::env::args().any(|argument| argument == "--test");
    let sizes = if is_test { vec![10_000] } else { vec![30_000, 1_000_000] };
    let motions = [
        ("sideways", poses(|metres| DVec3::new(0.0, metres - 0.05, 0.06))),
        ("towards", poses(|metres| DVec3::new(0.0, 0.0, 0.12 - metres))),
    ];
    for size in sizes {
        let sensor = on_lattice(&design().lattice(size).unwrap());
        let network = EdgeNetwork::of_sensor(&sensor);
        let empty = Occupancy::empty(sensor.mesh().nodes().len(), network.edges().len());
        let subject =
            |material| Subject { sensor: &sensor, network: &network, material, occupancy: empty.clone() };
        for (motion, poses) in &motions {
            let name = format!("{motion}/{size}");
            let weak = (", permittivity 3", Material::Dielectric(RelativePermittivity::new(3.0).unwrap()));
            let conductor = ("", Material::Conductor(Connection::Grounded));
            for (pixels, (of, material)) in [(64, conductor), (256, conductor), (64, weak), (256, weak)] {
                let view = OrthographicView { domain: DOMAIN, width: pixels, height: pixels };
                let mut renderer = DepthRenderer::new(Backend::Cpu, view, &[BAR]).unwrap();
                let draw = |pose: &Pose| {
                    let mut depth = DepthLayers::empty(view, 1);
                    renderer.render(std::slice::from_ref(pose), &mut depth).unwrap();
                    depth
                };
                let images: Vec<DepthLayers> = poses.iter().map(draw).collect();
                let source = format!("camera {pixels}x{pixels}{of}");
                let frame = |subject: &mut Subject<'_>, index: usize| {
                    images[index].validate().unwrap();
                    subject.update(&images[index])
                };
                subject(material).measure(criterion, &source, name.clone(), images.len(), frame);
            }
            let straight = straight(poses);
            for (source, poses, (of, material)) in [
                ("solids bar, turned", poses, conductor),
                ("solids bar", &straight, conductor),
                ("solids bar, turned", poses, weak),
            ] {
                let mut solids = Solids::new(&[BAR]).unwrap();
                let frame = |subject: &mut Subject<'_>, index: usize| {
                    solids.place(&poses[index..=index]).unwrap();
                    subject.update(&solids)
                };
                let source = format!("{source}{of}");
                subject(material).measure(criterion, &source, name.clone(), poses.len(), frame);
            }
        }
    }
}

criterion_group!(benches, occupancy);
criterion_main!(benches);
