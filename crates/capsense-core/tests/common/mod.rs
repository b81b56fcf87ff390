//! Sensors and depth images that several tests use.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::TetMesh;
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{ElectrodeNodes, GROUND, Sensor, SensorDesign};
use capsense_core::solver::SolverOptions;

/// The domain of the built-in scene.
pub const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

/// Converged to rounding: the tolerance bounds energy, which is quadratic in the field.
pub const EXACT: SolverOptions = SolverOptions {
    tolerance: 1e-22,
    change_tolerance: None,
    preconditioner: capsense_core::solver::Preconditioner::Multigrid,
    max_iterations: 20_000,
    threads: None,
};

pub fn rectangle(name: &str, center: [f64; 2], size: [f64; 2]) -> Electrode {
    let outline = Outline::Rectangle { center: DVec2::from(center), size: DVec2::from(size) };
    Electrode { name: name.to_owned(), outline, z: 0.0 }
}

/// Three stripes 100 mm x 20 mm with gaps of 10 mm.
pub fn three_stripes() -> SensorDesign {
    let electrodes = (0..3)
        .map(|k| rectangle(&format!("E{}", k + 1), [0.0, 0.03 * (f64::from(k) - 1.0)], [0.1, 0.02]))
        .collect();
    SensorDesign { domain: DOMAIN, electrodes, substrate: None }
}

pub fn stripes_sensor(tets: usize) -> Sensor {
    let design = three_stripes();
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// What a camera of so many pixels sees of axis-aligned boxes, one object each.
pub fn depth_of_boxes(pixels: [usize; 2], boxes: &[Aabb]) -> DepthLayers {
    let view = OrthographicView { domain: DOMAIN, width: pixels[0], height: pixels[1] };
    let mut depth = DepthLayers::empty(view, boxes.len());
    for (object, solid) in boxes.iter().enumerate() {
        let (front, back) = depth.layer_mut(object);
        for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
            let at = view.pixel_centre(pixel % pixels[0], pixel / pixels[0]).extend(solid.min.z);
            if solid.contains(at) {
                (*front, *back) = (solid.min.z as f32, solid.max.z as f32);
            }
        }
    }
    depth
}

/// The steel bar, 150 mm x 150 mm x 20 mm, its lower face at a height and its centre shifted along y.
pub fn bar(height: f64, shift: f64) -> Aabb {
    let low = DVec3::new(-0.075, shift - 0.075, height);
    Aabb { min: low, max: low + DVec3::new(0.15, 0.15, 0.02) }
}

/// The same sensor on the same mesh, which no longer is known to be a lattice.
pub fn without_lattice(sensor: &Sensor) -> Sensor {
    on_other_mesh(sensor, sensor.mesh().clone())
}

/// The same terminals on another mesh with the same nodes, not known to be a lattice.
pub fn on_other_mesh(sensor: &Sensor, mesh: TetMesh) -> Sensor {
    let nodes_of = |terminal: u16| -> Vec<u32> {
        let of_terminal = sensor.terminals().iter().zip(0..).filter(|(held, _)| **held == terminal);
        of_terminal.map(|(_, node)| node).collect()
    };
    let names = sensor.electrode_names().iter().cloned();
    let electrodes = names.zip(1..).map(|(name, t)| (name, ElectrodeNodes::Nodes(nodes_of(t)))).collect();
    Sensor::on_mesh(mesh, &nodes_of(GROUND), electrodes).unwrap()
}
