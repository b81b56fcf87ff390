//! Depth images on the CPU, one thread.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::geometry::Pose;
use capsense_core::glam::DVec3;
use capsense_core::occupancy::DepthLayers;
use capsense_render::{Backend, DepthRenderer};
use common::{BAR, VIEW};
use criterion::{Criterion, criterion_group, criterion_main};

fn depth(criterion: &mut Criterion) {
    let mut renderer = DepthRenderer::new(Backend::Cpu, VIEW, &[BAR]).unwrap();
    let mut layers = DepthLayers::empty(VIEW, 1);
    criterion.bench_function("depth/bar 64x64 on the CPU", |b| {
        b.iter(|| renderer.render(&[Pose::at(DVec3::new(0.0, 0.0, 0.06))], &mut layers).unwrap());
    });
}

criterion_group!(benches, depth);
criterion_main!(benches);
