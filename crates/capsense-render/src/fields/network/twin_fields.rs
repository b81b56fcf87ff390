//! What [`GpuNetwork`](super::GpuNetwork) does, with twins in place of kernels.

use super::changes::{Asked, Network};
use super::plan::Plan;
use super::rules::{CAUTION, LEAST_RATIO};
use super::twin::Twin;
use crate::fields::gpu::UNKNOWN;
use crate::fields::iteration::MOST_RATIO;
use capsense_core::solver::{Changes, NetworkProblem, RemoteFields, RemoteSolution, SolveError};
use std::sync::{Arc, Mutex};

#[derive(Debug)]
pub(super) struct TwinFields {
    network: Network,
    /// Shared with who looks at its numbers.
    pub(super) twin: Arc<Mutex<Twin>>,
}

impl TwinFields {
    pub(super) fn new(problem: NetworkProblem) -> Self {
        let twin = Twin::new(Plan::new(&problem).unwrap());
        Self { twin: Arc::new(Mutex::new(twin)), network: Network::new(problem) }
    }
}

/// What the energy of one column may still fall by, after a step that lowered it by `drop`, and one before that by `before`.
fn to_come(drop: f32, before: Option<f32>) -> f32 {
    let Some(before) = before else { return f32::MAX };
    let ratio = if before > 0.0 { (drop / before).clamp(LEAST_RATIO, MOST_RATIO) } else { MOST_RATIO };
    CAUTION * drop * ratio / (1.0 - ratio)
}

impl RemoteFields for TwinFields {
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError> {
        assert!(self.network.take(&changes));
        Ok(())
    }

    fn solve(&mut self, allowed: Option<&[f64]>, most: usize) -> Result<RemoteSolution, SolveError> {
        let mut twin = self.twin.lock().unwrap();
        let columns = twin.plan.columns;
        let (allowed, most) = match allowed {
            Some(allowed) => (allowed.to_vec(), most),
            None => (vec![0.0; columns], most.min(UNKNOWN as usize)),
        };
        let mut words = Vec::new();
        let _ = self.network.tell(Asked { allowed: &[], most_iterations: 0 }, &mut words);
        twin.take_changes(&words);
        twin.empty_columns(&words);
        (1..twin.plan.levels.len()).for_each(|number| twin.coarsen(number - 1));
        twin.find_residual();
        let mut still = vec![f64::from(f32::MAX); columns];
        let mut before = vec![None; columns];
        let mut is_active = vec![true; columns];
        let mut iterations = 0;
        while iterations < most && is_active.contains(&true) {
            for column in (0..columns).filter(|&column| is_active[column]) {
                let [along, drop] = twin.iterate(iterations, column);
                still[column] = match along > 0.0 {
                    true => f64::from(to_come(drop as f32, before[column])),
                    false => 0.0,
                };
                before[column] = Some(drop as f32);
            }
            iterations += 1;
            for column in 0..columns {
                is_active[column] &= still[column] > allowed[column];
            }
        }
        let energies = twin.energies();
        Ok(RemoteSolution { energies, to_come: still, iterations, ..RemoteSolution::default() })
    }

    fn shape(&self) -> [usize; 2] {
        let twin = self.twin.lock().unwrap();
        [twin.plan.nodes(), twin.plan.columns]
    }

    fn is_of_network(&self) -> bool {
        true
    }

    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError> {
        let twin = self.twin.lock().unwrap();
        let potential = |&row: &u32| {
            twin.vectors[twin.plan.potential as usize + row as usize * twin.plan.columns + column]
        };
        Ok(twin.plan.row_of_node.iter().map(potential).collect())
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        Err(SolveError::Device { reason: "twins are not copied".to_owned() })
    }
}
