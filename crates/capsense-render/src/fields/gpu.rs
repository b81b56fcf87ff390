//! Scenes on a device as the simulator knows them: each has its own fields, and those of a batch are computed together.

use super::Camera;
use super::device::{FieldDevice, MOST_ITERATIONS, SceneChanges, SceneResult, Traffic};
use super::finder::{Finder, Finding, Objects};
use super::plan::Plan;
use crate::adapter::Adapter;
use crate::error::RenderError;
use capsense_core::geometry::Pose;
use capsense_core::material::Material;
use capsense_core::sensor::Sensor;
use capsense_core::solver::{Changes, RemoteFields, RemoteProblem, RemoteSolution, SolveError};
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Iterations of a solve of which nothing is known yet, and of the first go of others at least.
pub(super) const UNKNOWN: u32 = 12;
pub(super) const LEAST: u32 = 2;

/// Iterations that follow where those of the first go were not enough.
pub(super) const MORE: u32 = 2;

/// Whether there is a graphics adapter that is no software and computes.
pub fn has_adapter() -> bool {
    Adapter::open("capsense fields", false, NEEDS).is_ok()
}

/// What an adapter must have.
pub(super) const NEEDS: (wgpu::DownlevelFlags, &str) =
    (wgpu::DownlevelFlags::COMPUTE_SHADERS, "it has no compute shaders");

/// The fields of some scenes that share a mesh, on one graphics device.
///
/// All scenes that were told of a solve to come ([`RemoteFields::announce`]) are computed by the same launches as the first
/// that is solved for. What comes out for a scene has the same bits whatever others there are.
#[derive(Clone, Debug)]
pub struct GpuFields {
    shared: Arc<Mutex<Shared>>,
}

#[derive(Debug)]
struct Shared {
    device: FieldDevice,
    scenes: Vec<SceneState>,
    traffic: Traffic,
    /// Why the device is of no further use.
    failed: Option<SolveError>,
}

/// What the host keeps of a scene.
#[derive(Clone, Debug, Default)]
struct SceneState {
    /// Whether a simulator has its fields.
    is_taken: bool,
    changes: SceneChanges,
    /// What was announced: how far energies may be from the least.
    announced: Option<Vec<f32>>,
    most_iterations: u32,
    /// Iterations of the last solve.
    last: u32,
    solved: Option<Solved>,
}

#[derive(Clone, Debug)]
struct Solved {
    result: SceneResult,
    launches: usize,
}

/// One scene of [`GpuFields`].
#[derive(Debug)]
struct SceneFields {
    fields: GpuFields,
    scene: usize,
    columns: usize,
}

impl GpuFields {
    /// Opens the fastest graphics adapter, a software one only if that will do, and reserves memory for so many scenes.
    ///
    /// # Errors
    /// When there is no adapter or it cannot be opened, the mesh or the number of scenes exceeds its limits, or its memory
    /// does not suffice.
    pub fn new(problem: &RemoteProblem, scenes: usize, allow_software: bool) -> Result<Self, RenderError> {
        let adapter = Adapter::open("capsense fields", allow_software, NEEDS)?;
        Self::on(adapter, problem, scenes, None)
    }

    /// The same for scenes whose objects are found on the device, too, as surfaces that cut edges, by a depth camera that sees
    /// each scene: poses go in by [`GpuFields::place`], and nothing but capacitances comes out. `problem` is that of the sensor
    /// and the scene of most columns. The processor has nothing to do with objects then:
    /// [`Simulator::update_elsewhere`](capsense_core::simulator::Simulator::update_elsewhere) takes the place of `update`.
    ///
    /// # Errors
    /// As [`GpuFields::new`], and when there are more than sixteen objects in a scene, or not as many materials as shapes, or
    /// shapes have impossible lengths.
    pub fn with_camera(
        (problem, sensor): (&RemoteProblem, &Sensor),
        camera: Camera,
        scenes: &[Objects],
        allow_software: bool,
    ) -> Result<Self, RenderError> {
        let needs =
            "it has no compute shaders, cannot copy depth to a buffer, or has none for vertex shaders";
        let flags = NEEDS.0 | crate::gpu::NEEDS.0;
        let adapter = Adapter::open("capsense fields", allow_software, (flags, needs))?;
        let finder = Finder::new(&adapter, sensor, Some(camera), scenes)?;
        Self::on(adapter, problem, scenes.len(), Some((finder, Finding::of(scenes, false))))
    }

    /// The same for objects that are solids, boxes, spheres, capsules and cylinders: what edges and round surfaces of
    /// conductors make of nodes near them is found on the device, too.
    ///
    /// # Errors
    /// As [`GpuFields::with_camera`], and when an object is a triangle mesh that is no box.
    pub fn with_solids(
        (problem, sensor): (&RemoteProblem, &Sensor),
        scenes: &[Objects],
        allow_software: bool,
    ) -> Result<Self, RenderError> {
        let adapter = Adapter::open("capsense fields", allow_software, NEEDS)?;
        let finder = Finder::new(&adapter, sensor, None, scenes)?;
        Self::on(adapter, problem, scenes.len(), Some((finder, Finding::of(scenes, true))))
    }

    fn on(
        adapter: Adapter,
        problem: &RemoteProblem,
        scenes: usize,
        finder: Option<(Finder, Finding)>,
    ) -> Result<Self, RenderError> {
        let plan = Plan::new(problem).ok_or(RenderError::LimitExceeded {
            what: "the number of values on the mesh",
            needed: problem.lattice.node_counts().iter().product::<usize>() as u64,
            limit: u64::from(u32::MAX),
        })?;
        let device = FieldDevice::new(adapter, plan, scenes, finder)?;
        let scenes = vec![SceneState::default(); scenes];
        let shared = Shared { device, scenes, traffic: Traffic::default(), failed: None };
        Ok(Self { shared: Arc::new(Mutex::new(shared)) })
    }

    /// Takes over where the objects of a scene are, if they are found on the device ([`GpuFields::with_camera`]), and returns
    /// whether that is another place than before. They are found there by the first solve after
    /// [`Simulator::update_elsewhere`](capsense_core::simulator::Simulator::update_elsewhere), which has nothing to do where they are
    /// not.
    ///
    /// # Errors
    /// When there is no such scene, or not one valid pose for each of its objects.
    pub fn place(&self, scene: usize, poses: &[Pose]) -> Result<bool, RenderError> {
        let mut shared = self.lock();
        let Shared { device, scenes, .. } = &mut *shared;
        let Some(finder) = device.finder.as_mut().filter(|_| scene < scenes.len()) else {
            return Err(RenderError::PoseCount { poses: poses.len(), objects: 0 });
        };
        finder.place(scene, poses)
    }

    /// Whether objects are found on the device, too.
    pub fn finds_objects(&self) -> bool {
        self.lock().device.finder.is_some()
    }

    /// The fields of one scene, for one simulator, that needs so many columns. `None` where there is no such scene, another
    /// simulator was given its fields, or the problem has fewer columns.
    pub fn scene(&self, scene: usize, columns: usize) -> Option<Box<dyn RemoteFields>> {
        let mut shared = self.lock();
        let fits = columns <= shared.device.plan.columns;
        let state = shared.scenes.get_mut(scene).filter(|state| fits && !state.is_taken)?;
        state.is_taken = true;
        Some(Box::new(SceneFields { fields: self.clone(), scene, columns }))
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

    /// How many scenes the adapter's limits allow at most, as far as networks and vectors go.
    #[cfg(test)]
    pub(super) fn most_scenes(&self) -> usize {
        let device = &self.lock().device;
        let limits = &device.adapter.limits;
        let largest = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let bytes = 4 * device.plan.network_len.max(device.plan.vectors_len);
        largest as usize / bytes
    }

    #[cfg(test)]
    pub(super) fn potentials(&self, scene: usize, column: usize) -> Vec<f32> {
        self.lock().device.potentials(scene, column).unwrap()
    }

    #[cfg(test)]
    pub(super) fn plan(&self) -> Plan {
        self.lock().device.plan.clone()
    }

    #[cfg(test)]
    pub(super) fn buffers_of(&self, scene: usize) -> [Vec<f32>; 2] {
        self.lock().device.buffers_of(scene)
    }
}

impl Shared {
    fn check(&self) -> Result<(), SolveError> {
        self.failed.clone().map_or(Ok(()), Err)
    }

    /// Solves all scenes that were announced.
    fn solve(&mut self) -> Result<(), RenderError> {
        let columns = self.device.plan.columns;
        let limit = |scene: &SceneState| scene.announced.is_some().then_some(scene.most_iterations);
        let limits: Vec<Option<u32>> = self.scenes.iter().map(limit).collect();
        let nothing = vec![0.0; columns];
        let allowed: Vec<f32> = self
            .scenes
            .iter()
            .flat_map(|scene| scene.announced.as_ref().unwrap_or(&nothing).iter().copied())
            .collect();
        let take = |scene: &mut SceneState| match scene.announced {
            Some(_) => std::mem::take(&mut scene.changes),
            None => SceneChanges::default(),
        };
        let changes: Vec<SceneChanges> = self.scenes.iter_mut().map(take).collect();
        let rows =
            changes.iter().map(|changes| changes.rows.len().max(changes.feeds.len())).max().unwrap_or(0);
        let empties = changes.iter().any(|changes| changes.emptied != 0);
        let sent = self.device.send(&changes, &allowed, &limits)?;
        let announced = || self.scenes.iter().filter(|scene| scene.announced.is_some());
        let most = announced().map(|scene| scene.most_iterations).max().unwrap_or(0).min(MOST_ITERATIONS);
        let first = announced().map(|scene| scene.last).max().unwrap_or(0).max(LEAST);
        let mut iterations = 0..first.min(most);
        let of_iteration = self.device.sharing.bytes_per_iteration(&self.device.plan);
        let mut total = Traffic { sent, ..Traffic::default() };
        loop {
            let (results, traffic) = self.device.run(iterations.clone(), rows, empties)?;
            total.launches += traffic.launches;
            total.sent += traffic.sent;
            total.received += traffic.received;
            let scenes = self.scenes.iter_mut().zip(results).filter(|(scene, _)| scene.announced.is_some());
            let mut goes_on = false;
            for (scene, result) in scenes {
                let allowed = scene.announced.as_deref().unwrap_or(&[]);
                let is_enough = |(still, allowed): (&f64, &f32)| *still <= f64::from(*allowed);
                goes_on |= !result.to_come.iter().zip(allowed).all(is_enough)
                    && result.iterations < scene.most_iterations;
                total.moved += of_iteration * u64::from(result.iterations.saturating_sub(iterations.start));
                scene.last = result.iterations;
                // What was found in the first go is of all that follow.
                let before = scene.solved.take().and_then(|solved| solved.result.found);
                let found = result.found.or(before);
                let result = SceneResult { found, ..result };
                scene.solved = Some(Solved { result, launches: total.launches });
            }
            if !goes_on || iterations.end >= most {
                break;
            }
            iterations = iterations.end..(iterations.end + MORE).min(most);
        }
        self.scenes.iter_mut().for_each(|scene| scene.announced = None);
        self.traffic.launches += total.launches;
        self.traffic.sent += total.sent;
        self.traffic.received += total.received;
        self.traffic.moved += total.moved;
        Ok(())
    }
}

impl SceneState {
    fn announce(&mut self, allowed: Option<&[f64]>, max_iterations: usize, columns: usize) {
        let most = u32::try_from(max_iterations).unwrap_or(u32::MAX).min(MOST_ITERATIONS);
        // Columns that the scene does not need are no reason to go on.
        let padded = |allowed: &[f64]| {
            let known = allowed.iter().map(|&allowed| allowed.min(f64::from(f32::MAX)) as f32);
            known.chain(std::iter::repeat(f32::MAX)).take(columns).collect()
        };
        (self.announced, self.most_iterations) = match allowed {
            Some(allowed) => (Some(padded(allowed)), most),
            None => (Some(vec![0.0; columns]), most.min(UNKNOWN)),
        };
    }

    /// Later rows and feeds replace earlier ones, as kernels take them in no order.
    fn take(&mut self, changes: &Changes<'_>) {
        let SceneChanges { rows, feeds, emptied } = &mut self.changes;
        if !rows.is_empty() {
            let new: HashSet<u32> = changes.rows.iter().map(|row| row.node).collect();
            rows.retain(|row| !new.contains(&row[0]));
        }
        if !feeds.is_empty() {
            let new: HashSet<[u32; 2]> = changes.feeds.iter().map(|feed| [feed.node, feed.column]).collect();
            feeds.retain(|feed| !new.contains(&[feed[0], feed[1]]));
        }
        rows.extend(changes.rows.iter().map(|row| {
            let [x, y, z] = row.next.map(f32::to_bits);
            [row.node, x, y, z, row.leak.to_bits(), row.holder]
        }));
        feeds.extend(changes.feeds.iter().map(|feed| [feed.node, feed.column, feed.charge.to_bits()]));
        for &column in changes.emptied {
            *emptied |= 1 << column;
        }
    }
}

impl RemoteFields for SceneFields {
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError> {
        let mut shared = self.fields.lock();
        shared.check()?;
        let scene = &mut shared.scenes[self.scene];
        scene.solved = None;
        scene.take(&changes);
        Ok(())
    }

    fn announce(&mut self, allowed: Option<&[f64]>, max_iterations: usize) {
        let mut shared = self.fields.lock();
        let columns = shared.device.plan.columns;
        shared.scenes[self.scene].solved = None;
        shared.scenes[self.scene].announce(allowed, max_iterations, columns);
    }

    fn solve(
        &mut self,
        allowed: Option<&[f64]>,
        max_iterations: usize,
    ) -> Result<RemoteSolution, SolveError> {
        let mut shared = self.fields.lock();
        shared.check()?;
        if shared.scenes[self.scene].solved.is_none() {
            let columns = shared.device.plan.columns;
            shared.scenes[self.scene].announce(allowed, max_iterations, columns);
            if let Err(error) = shared.solve() {
                // Changes were told only in part, so nothing that the device has can be trusted any more.
                shared.failed = Some(SolveError::Device { reason: error.to_string() });
            }
            shared.check()?;
        }
        let Solved { mut result, launches } = shared.scenes[self.scene]
            .solved
            .take()
            .unwrap_or(Solved { result: SceneResult::default(), launches: 0 });
        let all = shared.device.plan.columns;
        let row = |s: usize| &result.energies[s * all..][..self.columns];
        Ok(RemoteSolution {
            energies: (0..self.columns).flat_map(row).copied().collect(),
            to_come: result.to_come[..self.columns].to_vec(),
            iterations: result.iterations as usize,
            residual: result.residual,
            launches,
            found: result.found.take(),
        })
    }

    fn shape(&self) -> [usize; 2] {
        [self.fields.lock().device.plan.nodes(), self.columns]
    }

    fn finds(&self) -> Option<Vec<Material>> {
        self.fields.lock().device.finder.as_ref().map(|finder| finder.materials(self.scene))
    }

    fn take_placed(&mut self) -> bool {
        let mut shared = self.fields.lock();
        let Shared { device, scenes, .. } = &mut *shared;
        let is_news = device.finder.as_mut().is_some_and(|finder| finder.take_placed(self.scene));
        if is_news {
            scenes[self.scene].solved = None;
        }
        is_news
    }

    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError> {
        let shared = self.fields.lock();
        shared.check()?;
        let potentials = shared.device.potentials(self.scene, column);
        potentials.map_err(|error| SolveError::Device { reason: error.to_string() })
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        let reason = "fields on a device are not copied: make another simulator, or a batch".to_owned();
        Err(SolveError::Device { reason })
    }
}
