//! What only the inside of a simulator shows.

use super::*;
use crate::electrode::{Electrode, Outline};
use crate::geometry::{Aabb, Pose, Shape};
use crate::material::{Connection, RelativePermittivity};
use crate::mesh::Lattice;
use crate::occupancy::{DepthLayers, NO_OBJECT, OrthographicView};
use crate::sensor::{FREE, SensorDesign, Wall};
use crate::solids::Solids;
use glam::{DVec2, DVec3};

/// From the potentials and K as compressed rows; links to an object at 0 V are on the diagonal alone.
fn residual(simulator: &Simulator) -> f64 {
    let matrix = simulator.matrix.to_csr();
    let of_column = |column: usize| {
        let (mut free, mut held) = (0.0, 0.0);
        let mut linked = vec![0.0; simulator.matrix.nodes()];
        for (node, body, weight) in simulator.matrix.links() {
            let of_body = simulator.fields.potential(column, body);
            linked[node] += weight * of_body;
            held += (weight * of_body * (of_body - simulator.fields.potential(column, node))).powi(2);
        }
        for (node, row) in matrix.row_iter().enumerate() {
            let entries = row.col_indices().iter().zip(row.values());
            let through: f64 = entries.map(|(&other, k)| k * simulator.fields.potential(column, other)).sum();
            let charge = through - linked[node];
            match simulator.occupancy.conductors()[node] == NO_OBJECT {
                true if simulator.sensor.terminals()[node] == FREE => free += charge * charge,
                _ => held += (simulator.fields.potential(column, node) * charge).powi(2),
            }
        }
        f64::sqrt(free / held)
    };
    (0..simulator.fields.columns()).map(of_column).fold(0.0, f64::max)
}

#[test]
fn the_residual_reported_is_that_of_the_potentials() {
    let domain = Aabb { min: DVec3::splat(-0.1), max: DVec3::splat(0.1) };
    let design = square(domain);
    let sensor = Sensor::on_lattice(&design, &design.lattice(5_000).unwrap()).unwrap();
    let mut depth = DepthLayers::empty(OrthographicView { domain, width: 8, height: 8 }, 1);
    let (front, back) = depth.layer_mut(0);
    front[..40].fill(0.03);
    back[..40].fill(0.05);
    // Multigrid has the lattice's operator, in single precision, the others have rows in double.
    let single = (Preconditioner::Multigrid, 2e-5);
    for (preconditioner, slack) in [single, (Preconditioner::Ic0, 1e-6), (Preconditioner::Jacobi, 1e-6)] {
        let options = SolverOptions { preconditioner, ..SolverOptions::default() };
        let plate = Material::Conductor(Connection::Grounded);
        let mut simulator = Simulator::new(sensor.clone(), vec![plate], options).unwrap();
        let reported = simulator.step(&depth).unwrap().solve.residual;
        let expected = residual(&simulator);
        assert!((reported / expected - 1.0).abs() < slack, "{preconditioner:?}: {reported:e} {expected:e}");
    }
}

fn square(domain: Aabb) -> SensorDesign {
    let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.04) };
    let electrodes = vec![Electrode { name: "E1".into(), outline, z: 0.0 }];
    SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded }
}

/// Helpers that sleep leave their work to the calling thread, so they are awake before each frame. One of the bodies has a
/// direction of its own.
#[test]
fn frames_that_threads_share_have_the_same_bits() {
    let design = square(Aabb { min: DVec3::splat(-0.1), max: DVec3::splat(0.1) });
    let lattice = Lattice::uniform(design.domain, [30, 30, 30]).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    let materials = [
        Material::Conductor(Connection::Grounded),
        Material::Conductor(Connection::Floating),
        Material::Dielectric(RelativePermittivity::new(300.0).unwrap()),
    ];
    let mut solids =
        Solids::new(&std::array::from_fn::<_, 3, _>(|_| Shape::Sphere { radius: 0.02 })).unwrap();
    for preconditioner in [Preconditioner::Multigrid, Preconditioner::Ic0, Preconditioner::Jacobi] {
        let mut simulators = [1, 3].map(|threads| {
            let options =
                SolverOptions { preconditioner, threads: Some(threads), ..SolverOptions::default() };
            Simulator::new(sensor.clone(), materials.to_vec(), options).unwrap()
        });
        for frame in 0..6 {
            let shift = 1e-3 * f64::from(frame);
            let places = [[shift, 0.0, 0.04], [-0.05, shift, 0.05], [0.06, -shift, 0.06]];
            solids.place(&places.map(|place| Pose::at(DVec3::from(place)))).unwrap();
            let [one, three] = simulators.each_mut().map(|simulator| {
                let _awake = simulator.fields.workers().wake_all();
                let report = simulator.step(&solids).unwrap();
                (report, simulator.capacitance().clone())
            });
            assert_eq!(one, three, "{preconditioner:?}, frame {frame}");
        }
    }
}
