//! Bodies at places of the workspace, and how far what they change of C on one mesh is from that on a finer lattice.

use super::balance::{Balance, LARGEST};
use super::probed::Probed;
use super::{Change, WorkspaceError};
use crate::geometry::Shape;
use crate::sensor::Sensor;
use glam::DVec3;

/// For how many changes C without bodies counts.
const OF_EMPTY: f64 = 12.0;

/// For how many changes by a grounded body that by a floating one counts. Where they are far away and cells large, floating ones are off by the
/// most, for other reasons than links; with one in place of a quarter, grounded bodies are off by 4.0 instead of 2.2 % over one square, on
/// 28,000 tetrahedra.
const FLOATING: f64 = 0.25;

/// Steps to the best factors of links: changes of C are not quite straight lines over their logarithms.
const STEPS: usize = 2;

/// What meshes are compared by.
pub(super) struct Comparison {
    pub(super) bodies: Vec<Shape>,
    /// Bodies by their index, and where they are put.
    pub(super) places: Vec<(usize, DVec3)>,
    /// Of so many of them, the first, links are to know.
    known: usize,
    /// What each of them changes there, grounded and floating.
    pub(super) changes: Vec<[Change; 2]>,
    /// C without them.
    empty: Change,
    /// Tetrahedra of the lattice on which these are exact.
    pub(super) tets: usize,
    tolerance: f64,
    threads: Option<usize>,
}

impl Comparison {
    /// With bodies at places, on a lattice that is finer than what will be compared with it, and so exactly that it can be told
    /// whether a mesh meets a tolerance of ΔC. Links will be weighed by the first so many places. Threads are all cores where there is
    /// no number.
    pub(super) fn new(
        finer: Sensor,
        bodies: Vec<Shape>,
        places: Vec<(usize, DVec3)>,
        known: usize,
        tolerance: f64,
        threads: Option<usize>,
    ) -> Result<Self, WorkspaceError> {
        let tets = finer.mesh().tets().len();
        let mut probed = Probed::new(finer, &bodies, tolerance, threads)?;
        let changes = places.iter().map(|&(body, place)| probed.changes(body, place));
        let changes = changes.collect::<Result<_, _>>()?;
        Ok(Self { bodies, places, known, changes, empty: probed.empty().change, tets, tolerance, threads })
    }

    /// Another mesh with the same bodies.
    pub(super) fn probed(&self, sensor: Sensor) -> Result<Probed, WorkspaceError> {
        Probed::new(sensor, &self.bodies, self.tolerance, self.threads)
    }

    /// What is known of the factors of a mesh's links by C without bodies and the places that they are to know. After C, and after each
    /// place, `goes_on` is shown what is known so far; none as soon as it says no.
    pub(super) fn balance(
        &self,
        sensor: &Sensor,
        mut goes_on: impl FnMut(&Balance) -> bool,
    ) -> Result<Option<Balance>, WorkspaceError> {
        let mut probed = self.probed(sensor.clone())?;
        let mut balance = Balance::new(sensor);
        balance.add(&probed.empty(), &self.empty, OF_EMPTY);
        if !goes_on(&balance) {
            return Ok(None);
        }
        for (&(body, place), exact) in self.places.iter().zip(&self.changes).take(self.known) {
            let weights = [1.0, FLOATING];
            for ((felt, exact), weight) in probed.felt(body, place)?.iter().zip(exact).zip(weights) {
                balance.add(felt, exact, weight);
            }
            if !goes_on(&balance) {
                return Ok(None);
            }
        }
        Ok(Some(balance))
    }

    /// The same mesh with the best factors for its links.
    pub(super) fn balanced(&self, sensor: Sensor) -> Result<Sensor, WorkspaceError> {
        let mut factors = vec![1.0; sensor.electrode_names().len()];
        for _ in 0..STEPS {
            let weighed = sensor.clone().with_rims_weighed(&factors);
            let Some(balance) = self.balance(&weighed, |_| true)? else { break };
            for (factor, more) in factors.iter_mut().zip(balance.factors()) {
                *factor = (*factor * more).clamp(1.0 / LARGEST, LARGEST);
            }
        }
        Ok(sensor.with_rims_weighed(&factors))
    }
}
