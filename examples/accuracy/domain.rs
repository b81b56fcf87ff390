//! `accuracy domain`: prototype.

use crate::cases::{CONNECTIONS, DOMAIN, ENTRIES, bodies, stripes};
use crate::measure::measure;
use anyhow::Result;
use capsense::core::geometry::Aabb;
use capsense::core::mesh::Lattice;
use capsense::core::sensor::{Sensor, SensorDesign, Wall};
use clap::Args;

/// Growing domains
#[derive(Args, Debug)]
pub(crate) struct DomainArguments {
    #[arg(long, default_value_t = 60000)]
    elements: usize,
    #[arg(long, default_value_t = 1.3)]
    growth: f64,
    #[arg(long, value_delimiter = ',')]
    sizes: Vec<f64>,
    #[arg(long)]
    open: bool,
}

pub(crate) fn domain(arguments: &DomainArguments) -> Result<()> {
    let design = stripes();
    let inner = design.lattice(arguments.elements)?;
    let bodies: Vec<_> = bodies()
        .into_iter()
        .filter(|b| b.name.starts_with("bar at") && (b.name.ends_with("mm") || b.name.contains("50 mm side")))
        .collect();
    for &size in &arguments.sizes {
        let scale = size / 0.5;
        let domain = Aabb { min: scale * DOMAIN.min, max: scale * DOMAIN.max };
        let mut axes = inner.axes().clone();
        for (axis, planes) in axes.iter_mut().enumerate() {
            for (end, wall) in [domain.min[axis], domain.max[axis]].into_iter().enumerate() {
                planes.reverse();
                let outward = if end == 0 { -1.0 } else { 1.0 };
                if end == 0 {
                    extend(planes, wall, arguments.growth)
                } else {
                    extend(planes, wall, arguments.growth)
                }
                let _ = outward;
            }
        }
        let lattice = Lattice::new(axes)?;
        let design = SensorDesign { domain, ..design.clone() };
        let wall = if arguments.open { Wall::Open } else { Wall::Grounded };
        let sensor = Sensor::on_lattice_within(wall, &design, &lattice)?;
        let m = measure(&sensor, &bodies)?;
        println!(
            "{size} {wall:?} {:?} {} nothing none {}",
            lattice.node_counts(),
            lattice.tet_count(),
            m.empty.map(|x| format!("{x:.5}")).join(" ")
        );
        for (b, c) in bodies.iter().zip(&m.changes) {
            for (k, (n, _)) in CONNECTIONS.iter().enumerate() {
                println!(
                    "{size} {wall:?} - - {} {n} {}",
                    b.name.replace(' ', "_"),
                    c[k].map(|x| format!("{x:.6}")).join(" ")
                );
            }
        }
    }
    let _ = ENTRIES;
    Ok(())
}

/// Extends planes, whose last is the nearest, to a wall.
fn extend(planes: &mut Vec<f64>, wall: f64, growth: f64) {
    let last = planes[planes.len() - 1];
    let rest = wall - last;
    if rest.abs() < 1e-12 {
        return;
    }
    let first = last - planes[planes.len() - 2];
    let mut count = 0;
    let (mut sum, mut step) = (0.0, first);
    while sum < rest.abs() * 0.999 {
        step *= growth;
        sum += step.abs();
        count += 1;
    }
    let scale = rest.abs() / sum;
    let (mut at, mut step) = (last, first.abs());
    for k in 0..count {
        step *= growth;
        at += rest.signum() * step * scale;
        planes.push(if k + 1 == count { wall } else { at });
    }
}
