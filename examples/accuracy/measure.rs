//! Capacitances of one sensor, empty and with each of some bodies.

use crate::cases::{Body, CONNECTIONS, Entries, entries};
use crate::references::References;
use anyhow::Result;
use capsense::core::material::Material;
use capsense::core::sensor::Sensor;
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;

/// Of the self-capacitances; far below what is compared.
const TOLERANCE: f64 = 1e-6;

/// In femtofarads, or in percent of the references.
pub(crate) struct Measured {
    /// C of the empty scene.
    pub(crate) empty: Entries,
    /// The change by each body, for each connection.
    pub(crate) changes: Vec<[Entries; CONNECTIONS.len()]>,
}

/// Computes the empty scene and all bodies, one after the other, each as an exact solid that cuts edges.
pub(crate) fn measure(sensor: &Sensor, bodies: &[Body]) -> Result<Measured> {
    let mut empty = Entries::default();
    let mut changes = vec![[Entries::default(); CONNECTIONS.len()]; bodies.len()];
    for (number, (_, connection)) in CONNECTIONS.into_iter().enumerate() {
        let options = SolverOptions { tolerance: TOLERANCE, ..SolverOptions::default() };
        let mut simulator = Simulator::new(sensor.clone(), vec![Material::Conductor(connection)], options)?;
        empty = entries(simulator.base());
        for (body, changes) in bodies.iter().zip(&mut changes) {
            let mut solids = Solids::new(std::slice::from_ref(&body.shape))?;
            solids.place(&[body.pose])?;
            let _ = simulator.step(&solids)?;
            changes[number] = difference(&entries(simulator.capacitance()), &empty);
        }
    }
    Ok(Measured { empty, changes })
}

impl Measured {
    /// What was measured for these bodies, as errors in percent of the references.
    pub(crate) fn errors(&self, bodies: &[Body], references: &References) -> Result<Self> {
        let mut changes = self.changes.clone();
        for (body, changes) in bodies.iter().zip(&mut changes) {
            for ((connection, _), change) in CONNECTIONS.into_iter().zip(changes) {
                *change = percent(change, &references.change(body.name, connection)?);
            }
        }
        Ok(Self { empty: percent(&self.empty, &references.empty()?), changes })
    }
}

fn difference(values: &Entries, from: &Entries) -> Entries {
    std::array::from_fn(|entry| values[entry] - from[entry])
}

/// By how much values exceed their references.
pub(crate) fn percent(values: &Entries, references: &Entries) -> Entries {
    std::array::from_fn(|entry| 100.0 * (values[entry] / references[entry] - 1.0))
}
