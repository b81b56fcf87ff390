//! The methods that the simulator is compared with agree with it where they should, and fail in words where they fail.

use crate::common::{
    DOMAIN, EXACT, FLOATING, GROUNDED, bar, depth_of_boxes, relative_error, stripes_sensor, three_stripes,
    without_lattice,
};
use capsense_core::baseline::{
    AccumulatedStiffness, BaselineError, CentroidOccupancy, CgOptions, Ic0Method, PaperMethod, STEEL,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;

fn permittivity(value: f64) -> RelativePermittivity {
    RelativePermittivity::new(value).unwrap()
}

#[test]
fn ic0_gives_the_capacitances_of_the_simulator() {
    let lattice = stripes_sensor(10_000);
    let weak = Material::Dielectric(permittivity(4.0));
    let tied = Material::Conductor(Connection::Capacitance(1e-12));
    for sensor in [without_lattice(&lattice), lattice] {
        for material in [GROUNDED, FLOATING, tied, weak] {
            let materials = vec![material, FLOATING];
            let mut simulator = Simulator::new(sensor.clone(), materials.clone(), EXACT).unwrap();
            let mut ic0 = Ic0Method::new(sensor.clone(), materials, CgOptions::USUAL).unwrap();
            // The second object comes later and leaves again.
            for (height, other) in [(0.05, 2.0), (0.049, 0.15), (0.03, 0.15), (0.03, 2.0)] {
                let depth = depth_of_boxes([64, 64], &[bar(height, 0.01), bar(other, -0.02)]);
                let _ = simulator.step(&depth).unwrap();
                let _ = ic0.step(&depth).unwrap();
                assert_eq!(ic0.matrix().to_csr(), simulator.matrix().to_csr());
                let error = relative_error(ic0.capacitance(), simulator.capacitance());
                assert!(error < 1e-6, "{material:?} at {height}: {error}");
            }
        }
    }
}

#[test]
fn a_frame_like_the_last_costs_ic0_no_iteration() {
    let sensor = without_lattice(&stripes_sensor(10_000));
    let mut ic0 = Ic0Method::new(sensor, vec![GROUNDED], CgOptions::USUAL).unwrap();
    let depth = depth_of_boxes([64, 64], &[bar(0.05, 0.0)]);
    let first = ic0.step(&depth).unwrap();
    let again = ic0.step(&depth).unwrap();
    assert!(first.changed > 0 && first.iterations > 3, "{first:?}");
    assert_eq!((again.changed, again.iterations), (0, 0));
}

/// The charges on electrodes are wrong in proportion to the error of the field, which the residual only hints at.
#[test]
fn the_papers_method_agrees_on_an_empty_scene() {
    let sensor = stripes_sensor(10_000).with_rims_held();
    let simulator = Simulator::new(sensor.clone(), vec![], EXACT).unwrap();
    let empty = depth_of_boxes([64, 64], &[]);
    for (relative_residual, allowed) in [(1e-5, 3e-5), (1e-11, 1e-10)] {
        let options = CgOptions { relative_residual, ..CgOptions::PAPER };
        let mut paper = PaperMethod::<f64>::new(&sensor, &[], options);
        let report = paper.step(&empty).unwrap();
        assert_eq!(report.changed, 0);
        let error = relative_error(paper.capacitance(), simulator.base());
        assert!(error < allowed, "{relative_residual}: {error}");
    }
    let mut single = PaperMethod::<f32>::new(&sensor, &[], CgOptions::PAPER);
    let _ = single.step(&empty).unwrap();
    let error = relative_error(single.capacitance(), simulator.base());
    assert!(error < 3e-5, "single precision: {error}");
}

/// The camera looks past cells 12 to 16 along y.
const CELLS: usize = 20;
const VIEW: OrthographicView = OrthographicView { domain: DOMAIN, width: CELLS, height: CELLS };

/// A block from cell layer 8 to the far wall that fills columns 5 to 12 of cells, one pixel a column of cells, and
/// whether a point lies in it.
fn aligned_block() -> (DepthLayers, impl Fn(DVec3) -> bool) {
    let cell = DOMAIN.size() / CELLS as f64;
    let block = Aabb {
        min: DOMAIN.min + cell * DVec3::new(5.0, 5.0, 8.0),
        max: (DOMAIN.min + cell * 12.0).with_z(DOMAIN.max.z),
    };
    let mut depth = DepthLayers::empty(VIEW, 1);
    let (front, back) = depth.layer_mut(0);
    for pixel in 0..CELLS * CELLS {
        let at = VIEW.pixel_centre(pixel % CELLS, pixel / CELLS).extend(block.min.z);
        if block.contains(at) {
            (front[pixel], back[pixel]) = (block.min.z as f32, block.min.z as f32 + 0.01);
        }
    }
    (depth, move |point| block.contains(point))
}

fn aligned_sensor() -> Sensor {
    let lattice = Lattice::uniform(DOMAIN, [CELLS; 3]).unwrap();
    Sensor::on_lattice(&three_stripes(), &lattice).unwrap().with_rims_held()
}

#[test]
fn a_block_along_the_cells_is_occupied_exactly() {
    let (depth, inside) = aligned_block();
    let sensor = aligned_sensor();
    let mut occupancy = CentroidOccupancy::new(sensor.mesh());
    occupancy.update(&depth, &[80.0]);
    for (element, &found) in occupancy.permittivity().iter().enumerate() {
        let expected = if inside(sensor.mesh().centroid(element)) { 80.0 } else { 1.0 };
        assert!(found == expected, "element {element}: {found} {expected}");
    }
    assert_eq!(occupancy.changed().len(), 6 * 7 * 7 * 12);
    occupancy.update(&depth, &[80.0]);
    assert!(occupancy.changed().is_empty());
    occupancy.update(&DepthLayers::empty(VIEW, 1), &[80.0]);
    assert_eq!(occupancy.changed().len(), 6 * 7 * 7 * 12);
    assert_eq!(occupancy.permittivity(), sensor.mesh().relative_permittivity().iter().collect::<Vec<_>>());
}

#[test]
fn updating_elements_equals_assembling_them_afresh() {
    let (depth, inside) = aligned_block();
    let sensor = aligned_sensor();
    let mesh = sensor.mesh().clone();
    let filled: Vec<f64> =
        (0..mesh.tets().len()).map(|e| if inside(mesh.centroid(e)) { 80.0 } else { 1.0 }).collect();
    let mut fresh = AccumulatedStiffness::<f64>::new(&mesh.with_permittivity(|e| filled[e]).unwrap());
    let mut updated = AccumulatedStiffness::<f64>::new(sensor.mesh());
    let mut occupancy = CentroidOccupancy::new(sensor.mesh());
    occupancy.update(&depth, &[80.0]);
    for &element in occupancy.changed() {
        updated.set_permittivity(element as usize, occupancy.permittivity()[element as usize]);
    }
    let (fresh, updated) = (fresh.to_csr(), updated.to_csr());
    assert_eq!(fresh.pattern(), updated.pattern());
    let largest = fresh.values().iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    for (a, b) in fresh.values().iter().zip(updated.values()) {
        assert!((a - b).abs() < 1e-15 * largest, "{a} {b}");
    }
}

/// The same block as the background of a mesh on which the simulator sees no objects.
#[test]
fn the_papers_method_agrees_on_a_block_along_the_cells() {
    let (depth, inside) = aligned_block();
    let sensor = aligned_sensor();
    let mesh = sensor.mesh().clone();
    let centroids: Vec<_> = (0..mesh.tets().len()).map(|element| mesh.centroid(element)).collect();
    let filled = mesh.with_permittivity(|e| if inside(centroids[e]) { 80.0 } else { 1.0 }).unwrap();
    let reference = Simulator::new(crate::common::on_other_mesh(&sensor, filled), vec![], EXACT).unwrap();
    let options = CgOptions { relative_residual: 1e-11, ..CgOptions::PAPER };
    let mut paper = PaperMethod::<f64>::new(&sensor, &[permittivity(80.0)], options);
    let _ = paper.step(&depth).unwrap();
    let error = relative_error(paper.capacitance(), reference.base());
    assert!(error < 1e-10, "{error}");
}

#[test]
fn failures_are_told() {
    let sensor = stripes_sensor(10_000).with_rims_held();
    let depth = depth_of_boxes([64, 64], &[bar(0.05, 0.0)]);
    let mut paper = PaperMethod::<f64>::new(&sensor, &[permittivity(STEEL)], CgOptions::PAPER);
    assert!(paper.step(&depth).unwrap().changed > 0);
    let none = depth_of_boxes([64, 64], &[]);
    let count = BaselineError::ObjectCount { seen: 0, known: 1 };
    assert_eq!(paper.step(&none).unwrap_err(), count);
    assert!(paper.capacitance().get(0, 0) > 0.0, "as before the failed frame");

    let few = CgOptions { max_iterations: 3, ..CgOptions::PAPER };
    let mut paper = PaperMethod::<f64>::new(&sensor, &[permittivity(STEEL)], few);
    let error = paper.step(&depth).unwrap_err();
    assert!(
        matches!(error, BaselineError::NotConverged { column: 0, iterations: 3, residual } if residual > 1e-5),
        "{error}"
    );
    assert_eq!(paper.capacitance().get(0, 0), 0.0, "there was none before");

    let mut ic0 = Ic0Method::new(sensor, vec![GROUNDED], few).unwrap();
    assert_eq!(ic0.step(&none).unwrap_err(), count);
    assert!(matches!(ic0.step(&depth).unwrap_err(), BaselineError::NotConverged { iterations: 3, .. }));
    let mut broken = depth.clone();
    broken.layer_mut(0).0[7] = f32::NAN;
    assert!(matches!(ic0.step(&broken).unwrap_err(), BaselineError::Depth(_)));
}
