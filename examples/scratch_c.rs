use capsense::core::electrode::*;
use capsense::core::geometry::*;
use capsense::core::glam::*;
use capsense::core::sensor::*;
use capsense::core::workspace::*;
fn main() {
    let e = |y| Electrode { name: format!("E{y}"), outline: Outline::Rectangle { center: DVec2::new(0.0, y), size: DVec2::new(0.1, 0.02) }, z: 0.0 };
    let d = SensorDesign { domain: Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) }, electrodes: [-0.03, 0.0, 0.03].map(e).to_vec(), substrate: None, wall: Wall::Grounded };
    for t in [0.03, 0.01, 0.003] {
        let c = MeshRequest::new(&d, t, MeshKind::Lattice).choose(&d).unwrap();
        println!("{t}: {} error {:.4} with {}", c.sensor.mesh().tets().len(), c.error, c.compared_with);
    }
}
