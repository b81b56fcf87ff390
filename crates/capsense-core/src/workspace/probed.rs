//! What conducting bodies change of C on one mesh, and how that depends on what links at rims weigh there.

use super::{Change, WorkspaceError};
use crate::capacitance::{CapacitanceMatrix, upper_triangle};
use crate::geometry::{Pose, Shape};
use crate::material::{Connection, Material};
use crate::sensor::Sensor;
use crate::simulator::Simulator;
use crate::solids::Solids;
use crate::solver::SolverOptions;
use crate::units::VACUUM_PERMITTIVITY;
use glam::DVec3;

/// What the solver may leave of C, in relation to the tolerance of ΔC: bodies far away change C by a thousandth, and which lattice
/// others are compared with follows from errors to the third digit. With 3e-5, solves that went a little further chose one of 3.75 instead of
/// 3.70 million tetrahedra, on which one place is off by 0.8 %, and so 213,528 instead of 119,808 for 1 %.
const SOLVED: f64 = 3e-6;

/// What it leaves of C at least.
const FINEST_SOLVED: f64 = 1e-10;

/// A sensor with one of some conducting bodies near it, which float: what they change grounded follows from the same fields.
pub(super) struct Probed {
    simulator: Simulator,
    bodies: Vec<Solids>,
    /// Of C without bodies.
    slopes_of_empty: Vec<Vec<f64>>,
}

/// A change, and what heavier links at rims make of it.
#[derive(Clone, Debug)]
pub(super) struct Felt {
    pub(super) change: Change,
    /// For each electrode, dΔC / d ln f with its links f times as heavy, entry by entry as in the change, in farads.
    pub(super) slopes: Vec<Vec<f64>>,
}

impl Probed {
    /// Solves so exactly that it can be told whether the sensor's mesh meets a tolerance of ΔC.
    pub(super) fn new(
        sensor: Sensor,
        bodies: &[Shape],
        tolerance: f64,
        threads: Option<usize>,
    ) -> Result<Self, WorkspaceError> {
        let tolerance = (SOLVED * tolerance).max(FINEST_SOLVED);
        let options = SolverOptions { tolerance, threads, ..SolverOptions::default() };
        let floating = Material::Conductor(Connection::Floating);
        let mut probed = Self {
            simulator: Simulator::new(sensor, vec![floating], options)?,
            bodies: bodies
                .iter()
                .map(|body| Solids::new(std::slice::from_ref(body)))
                .collect::<Result<_, _>>()?,
            slopes_of_empty: Vec::new(),
        };
        let electrodes = probed.simulator.base().size();
        probed.slopes_of_empty = probed.slopes(&vec![0.0; electrodes]);
        Ok(probed)
    }

    /// What a body changes with its centre at a place: grounded, and floating.
    pub(super) fn changes(&mut self, body: usize, place: DVec3) -> Result<[Change; 2], WorkspaceError> {
        self.bodies[body].place(&[Pose::at(place)])?;
        let _ = self.simulator.step(&self.bodies[body])?;
        if !self.simulator.contacts().is_empty() {
            return Err(WorkspaceError::Touches(place));
        }
        let with_body = [self.simulator.with_objects_held(), self.simulator.capacitance()];
        Ok(with_body.map(|with_body| Change::between(self.simulator.base(), with_body)))
    }

    /// The same, and how it depends on the links.
    pub(super) fn felt(&mut self, body: usize, place: DVec3) -> Result<[Felt; 2], WorkspaceError> {
        let [grounded, floating] = self.changes(body, place)?;
        let held = self.simulator.with_objects_held();
        let electrodes = self.simulator.base().size();
        let own = held.get(electrodes, electrodes);
        let volts_of_floating =
            |electrode| if own > 0.0 { -held.get(electrodes, electrode) / own } else { 0.0 };
        let felt = |change: Change, volts: Vec<f64>| {
            let mut slopes = self.slopes(&volts);
            for (slopes, of_empty) in slopes.iter_mut().zip(&self.slopes_of_empty) {
                slopes.iter_mut().zip(of_empty).for_each(|(slope, of_empty)| *slope -= of_empty);
            }
            Felt { change, slopes }
        };
        Ok([
            felt(grounded, vec![0.0; electrodes]),
            felt(floating, (0..electrodes).map(volts_of_floating).collect()),
        ])
    }

    /// C without the bodies, as a change from nothing.
    pub(super) fn empty(&self) -> Felt {
        let empty = self.simulator.base();
        let change = Change::between(&CapacitanceMatrix::zeros(empty.size()), empty);
        Felt { change, slopes: self.slopes_of_empty.clone() }
    }

    /// For each electrode, dC / d ln f with its links f times as heavy, in farads, where a body has so many volts with each of the
    /// electrodes at 1 V. C is the energy of the fields, which is the least there is, so with weights w and potentials φ
    ///
    /// ```text
    /// dC_ij / d ln f = ε0 Σ w (φ_i − u_i)(φ_j − u_j)
    /// ```
    ///
    /// over the electrode's links, where u is 1 V for the electrode itself and 0 V for others.
    fn slopes(&self, volts: &[f64]) -> Vec<Vec<f64>> {
        let electrodes = volts.len();
        let mut slopes = vec![vec![0.0; electrodes * (electrodes + 1) / 2]; electrodes];
        let mut across = vec![0.0; electrodes];
        for link in self.simulator.sensor().rim() {
            let (node, owner) = (link.node as usize, usize::from(link.electrode));
            let potential = |column: usize| self.simulator.potential_with_objects_held(column, node);
            for (electrode, across) in across.iter_mut().enumerate() {
                let of_body = match volts[electrode] {
                    0.0 => 0.0,
                    volts => volts * potential(electrodes),
                };
                *across = potential(electrode) + of_body - if electrode == owner { 1.0 } else { 0.0 };
            }
            for (slope, (i, j)) in slopes[owner].iter_mut().zip(upper_triangle(electrodes)) {
                *slope += VACUUM_PERMITTIVITY * link.weight * across[i] * across[j];
            }
        }
        slopes
    }
}
