//! The fields of one scene on the network of any mesh, as the simulator knows them.

use super::changes::{Asked, Network};
use super::device::NetworkDevice;
use super::launch::TAIL;
use super::plan::Plan;
use crate::adapter::Adapter;
use crate::error::RenderError;
use crate::fields::device::{MOST_ITERATIONS, Traffic};
use crate::fields::gpu::{LEAST, MORE, NEEDS, UNKNOWN};
use capsense_core::solver::{Changes, NetworkProblem, RemoteFields, RemoteSolution, SolveError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The fields of one scene on a mesh that is no lattice, on one graphics device.
#[derive(Clone, Debug)]
pub struct GpuNetwork {
    shared: Arc<Mutex<Shared>>,
}

#[derive(Debug)]
struct Shared {
    device: NetworkDevice,
    network: Network,
    /// Whether a simulator has the fields.
    is_taken: bool,
    /// Iterations of the last solve.
    last: u32,
    traffic: Traffic,
    /// Why the device is of no further use.
    failed: Option<SolveError>,
}

#[derive(Debug)]
struct NetworkFields {
    network: GpuNetwork,
    nodes: usize,
    columns: usize,
}

impl GpuNetwork {
    /// Opens the fastest graphics adapter, a software one only if that will do, and reserves memory.
    ///
    /// # Errors
    /// When there is no adapter or it cannot be opened, the mesh exceeds its limits, or its memory does not suffice.
    pub fn new(problem: NetworkProblem, allow_software: bool) -> Result<Self, RenderError> {
        Self::with_tail(problem, allow_software, TAIL)
    }

    /// The same with another bound for levels that are one workgroup's.
    pub(super) fn with_tail(
        problem: NetworkProblem,
        allow_software: bool,
        tail: u32,
    ) -> Result<Self, RenderError> {
        let adapter = Adapter::open("capsense fields", allow_software, NEEDS)?;
        let plan = Plan::new(&problem).ok_or(RenderError::LimitExceeded {
            what: "the number of values on the mesh",
            needed: problem.neighbours.len() as u64,
            limit: u64::from(u32::MAX),
        })?;
        let shared = Shared {
            device: NetworkDevice::new(adapter, plan, tail)?,
            network: Network::new(problem),
            is_taken: false,
            last: 0,
            traffic: Traffic::default(),
            failed: None,
        };
        Ok(Self { shared: Arc::new(Mutex::new(shared)) })
    }

    /// The fields, for one simulator; `None` where another was given them.
    pub fn fields(&self) -> Option<Box<dyn RemoteFields>> {
        let mut shared = self.lock();
        let [nodes, columns] = [shared.device.plan.nodes(), shared.device.plan.columns];
        let is_taken = std::mem::replace(&mut shared.is_taken, true);
        (!is_taken).then(|| Box::new(NetworkFields { network: self.clone(), nodes, columns }) as _)
    }

    /// Name of the adapter and its driver.
    pub fn description(&self) -> String {
        self.lock().device.adapter.description.clone()
    }

    /// Whether the adapter is a software implementation running on the processor.
    pub fn is_software(&self) -> bool {
        self.lock().device.adapter.software
    }

    /// Launches and bytes of all solves since the last call.
    pub fn take_traffic(&self) -> Traffic {
        std::mem::take(&mut self.lock().traffic)
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the device up, as a driver does that fails.
    #[cfg(test)]
    pub(super) fn destroy(&self) {
        self.lock().device.adapter.device.destroy();
    }

    #[cfg(test)]
    pub(super) fn potentials(&self, column: usize) -> Vec<f32> {
        self.lock().device.potentials(column).unwrap()
    }

    #[cfg(test)]
    pub(super) fn buffers(&self) -> [Vec<f32>; 2] {
        self.lock().device.buffers()
    }
}

impl Shared {
    fn check(&self) -> Result<(), SolveError> {
        self.failed.clone().map_or(Ok(()), Err)
    }

    fn solve(&mut self, allowed: Option<&[f64]>, most: u32) -> Result<RemoteSolution, RenderError> {
        let columns = self.device.plan.columns;
        let (asked, most) = match allowed {
            Some(allowed) => {
                (allowed.iter().map(|&allowed| allowed.min(f64::from(f32::MAX)) as f32).collect(), most)
            }
            None => (vec![0.0; columns], most.min(UNKNOWN)),
        };
        let told = Asked { allowed: &asked, most_iterations: most };
        let (rows, empties, sent) = self.device.send(&mut self.network, told)?;
        let mut total = Traffic { sent, ..Traffic::default() };
        let of_iteration = self.device.sharing.bytes_per_iteration(&self.device.plan);
        let mut iterations = 0..self.last.max(LEAST).min(most);
        let result = loop {
            let (result, traffic) = self.device.run(iterations.clone(), rows, empties)?;
            total.launches += traffic.launches;
            total.sent += traffic.sent;
            total.received += traffic.received;
            let reached = |(still, asked): (&f64, &f32)| *still <= f64::from(*asked);
            let is_enough = result.to_come.iter().zip(&asked).all(reached);
            if is_enough || result.iterations < iterations.end || iterations.end >= most {
                break result;
            }
            iterations = iterations.end..(iterations.end + MORE).min(most);
        };
        total.moved = of_iteration * u64::from(result.iterations);
        self.last = result.iterations;
        self.traffic.launches += total.launches;
        self.traffic.sent += total.sent;
        self.traffic.received += total.received;
        self.traffic.moved += total.moved;
        Ok(RemoteSolution {
            energies: result.energies,
            to_come: result.to_come,
            iterations: result.iterations as usize,
            residual: result.residual,
            launches: total.launches,
            ..RemoteSolution::default()
        })
    }
}

impl RemoteFields for NetworkFields {
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError> {
        let mut shared = self.network.lock();
        shared.check()?;
        if !shared.network.take(&changes) {
            // Some were taken, so nothing that is known of the network can be trusted any more.
            let reason = "its fields were made for another mesh".to_owned();
            shared.failed = Some(SolveError::Device { reason });
        }
        shared.check()
    }

    fn solve(
        &mut self,
        allowed: Option<&[f64]>,
        max_iterations: usize,
    ) -> Result<RemoteSolution, SolveError> {
        let mut shared = self.network.lock();
        shared.check()?;
        let most = u32::try_from(max_iterations).unwrap_or(u32::MAX).min(MOST_ITERATIONS);
        shared.solve(allowed, most).map_err(|error| {
            // Changes were told only in part, so nothing that the device has can be trusted any more.
            let error = SolveError::Device { reason: error.to_string() };
            shared.failed = Some(error.clone());
            error
        })
    }

    fn shape(&self) -> [usize; 2] {
        [self.nodes, self.columns]
    }

    fn is_of_network(&self) -> bool {
        true
    }

    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError> {
        let shared = self.network.lock();
        shared.check()?;
        let potentials = shared.device.potentials(column);
        potentials.map_err(|error| SolveError::Device { reason: error.to_string() })
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        let reason = "fields on a device are not copied: make another simulator".to_owned();
        Err(SolveError::Device { reason })
    }
}
