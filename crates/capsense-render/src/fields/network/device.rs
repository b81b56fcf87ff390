//! The buffers and kernels of one network, and how a frame of it is computed: changes go in, energies come out, nothing else.

use super::changes::{Asked, HEADER, Network};
use super::launch::{KERNELS, Kernel, Launch, Sharing};
use super::plan::{Level, MOST_LEVELS, Plan};
use super::shader;
use crate::adapter::Adapter;
use crate::error::RenderError;
use crate::fields::binding::{Buffers, LAUNCH_STRIDE, bind_group, bind_group_layout, pipelines};
use crate::fields::device::{MOST_COLUMNS, MOST_ITERATIONS, SceneResult, Traffic};
use crate::fields::memory::{Reserve, read};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// The plan as the kernels have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PlanUniform {
    levels: [Level; MOST_LEVELS],
    level_count: u32,
    first_of_tail: u32,
    weights: u32,
    links: u32,
    potential: u32,
    feed: u32,
    image: u32,
    allowed_at: u32,
    steps: [u32; 2],
    padding: [u32; 2],
}

/// One network on a device.
#[derive(Debug)]
pub(super) struct NetworkDevice {
    pub(super) adapter: Adapter,
    pub(super) plan: Plan,
    pub(super) sharing: Sharing,
    pipelines: Vec<wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    launches: wgpu::Buffer,
    uniform: wgpu::Buffer,
    buffers: Buffers,
    readback: wgpu::Buffer,
    words: Vec<u32>,
    told: Vec<u8>,
}

impl NetworkDevice {
    /// Reserves memory and compiles the kernels.
    ///
    /// # Errors
    /// When the mesh exceeds the adapter's limits or its memory, or it fails.
    pub(super) fn new(adapter: Adapter, plan: Plan, tail: u32) -> Result<Self, RenderError> {
        if plan.columns > MOST_COLUMNS {
            let (needed, limit) = (plan.columns as u64, MOST_COLUMNS as u64);
            return Err(RenderError::LimitExceeded { what: "the number of terminals", needed, limit });
        }
        let sharing = Sharing::of(&plan, tail);
        let (columns, teams) = (plan.columns, sharing.teams as usize);
        let numbers = 2 * columns * columns + 2 * columns;
        let records = (MOST_ITERATIONS as usize + 1) * columns * 4;
        let scratch_len = 3 * teams * columns + teams * numbers + records;
        let most_launches = sharing.launches(&plan, 0..MOST_ITERATIONS, 1, true).len() as u64;
        use wgpu::BufferUsages as Usage;
        let reserve = Reserve { adapter: &adapter };
        let storage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let words = |len: usize| 4 * len as u64;
        let results_len = numbers + columns + 1;
        let buffers = Buffers {
            maps: reserve.buffer("maps of the hierarchy", words(plan.maps.len()), storage)?,
            networks: reserve.buffer("networks", words(plan.network_len), storage)?,
            vectors: reserve.buffer("vectors", words(plan.vectors_len), storage)?,
            holders: reserve.buffer("holders", words(plan.nodes()), storage)?,
            scratch: reserve.buffer("scratch", words(scratch_len), storage)?,
            changes: reserve.buffer("changes", words(HEADER + columns), storage)?,
            results: reserve.buffer("results", words(results_len), storage)?,
        };
        let uniforms = Usage::UNIFORM | Usage::COPY_DST;
        let launches = reserve.buffer("launches", LAUNCH_STRIDE * most_launches, uniforms)?;
        let uniform = reserve.buffer("plan", size_of::<PlanUniform>() as u64, uniforms)?;
        let readback = reserve.buffer("readback", words(results_len), Usage::MAP_READ | Usage::COPY_DST)?;
        adapter.queue.write_buffer(&buffers.maps, 0, bytemuck::cast_slice(&plan.maps));
        adapter.queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&told(&plan, &sharing)));
        // A buffer starts as zeros, and zero is a column's number.
        let free = vec![capsense_core::solver::NO_HOLDER; plan.nodes()];
        adapter.queue.write_buffer(&buffers.holders, 0, bytemuck::cast_slice(&free));
        let layout = bind_group_layout(&adapter.device);
        let source = shader::source(columns, sharing.teams);
        let pipelines =
            pipelines(&adapter.device, [Some(&layout), None], &KERNELS.map(Kernel::entry), &source);
        let group = bind_group(&adapter.device, &layout, &launches, &uniform, &buffers);
        adapter.faults.check("preparing the kernels")?;
        Ok(Self {
            adapter,
            plan,
            sharing,
            pipelines,
            layout,
            group,
            launches,
            uniform,
            buffers,
            readback,
            words: Vec::new(),
            told: Vec::new(),
        })
    }

    /// Tells the kernels of all that changed in the network. Returns how many rows or feeds that are, whether columns are to start
    /// from zero, and how many bytes were sent.
    ///
    /// # Errors
    /// When the changes are more than the device takes.
    pub(super) fn send(
        &mut self,
        network: &mut Network,
        asked: Asked<'_>,
    ) -> Result<(usize, bool, u64), RenderError> {
        let (rows, empties) = network.tell(asked, &mut self.words);
        let bytes = 4 * self.words.len() as u64;
        if bytes > self.buffers.changes.size() {
            let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            // Whole words.
            let size =
                bytes.next_power_of_two().min(self.adapter.limits.max_storage_buffer_binding_size & !3);
            let reserve = Reserve { adapter: &self.adapter };
            self.buffers.changes = reserve.buffer("changes", size.max(bytes), storage)?;
            self.group =
                bind_group(&self.adapter.device, &self.layout, &self.launches, &self.uniform, &self.buffers);
        }
        self.adapter.queue.write_buffer(&self.buffers.changes, 0, bytemuck::cast_slice(&self.words));
        Ok((rows, empties, bytes))
    }

    /// Runs some iterations, the first of them from what was sent, and reads back what they found.
    ///
    /// # Errors
    /// When the driver fails or the device is lost.
    pub(super) fn run(
        &mut self,
        iterations: Range<u32>,
        rows: usize,
        empties: bool,
    ) -> Result<(SceneResult, Traffic), RenderError> {
        let launches = self.sharing.launches(&self.plan, iterations, rows as u32, empties);
        self.told.clear();
        self.told.resize(LAUNCH_STRIDE as usize * launches.len(), 0);
        for (bytes, (_, launch, _)) in self.told.chunks_exact_mut(LAUNCH_STRIDE as usize).zip(&launches) {
            bytes[..size_of::<Launch>()].copy_from_slice(bytemuck::bytes_of(launch));
        }
        self.adapter.queue.write_buffer(&self.launches, 0, &self.told);
        let mut encoder = self.adapter.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for (number, (kernel, _, groups)) in launches.iter().enumerate() {
            pass.set_pipeline(&self.pipelines[*kernel as usize]);
            pass.set_bind_group(0, &self.group, &[(LAUNCH_STRIDE * number as u64) as u32]);
            pass.dispatch_workgroups(*groups, 1, 1);
        }
        drop(pass);
        encoder.copy_buffer_to_buffer(&self.buffers.results, 0, &self.readback, 0, self.readback.size());
        self.adapter.queue.submit([encoder.finish()]);
        let words = read(&self.adapter, &self.readback, "reading capacitances back")?;
        let traffic = Traffic {
            launches: launches.len(),
            sent: self.told.len() as u64,
            received: self.readback.size(),
            moved: 0,
        };
        Ok((SceneResult::new(&words, self.plan.columns), traffic))
    }

    /// The potentials of all nodes in one column.
    ///
    /// # Errors
    /// When the driver fails or the device is lost.
    pub(super) fn potentials(&self, column: usize) -> Result<Vec<f32>, RenderError> {
        let columns = self.plan.columns;
        let all =
            self.read_back(&self.buffers.vectors, self.plan.potential as usize, columns * self.plan.nodes())?;
        Ok(self.plan.row_of_node.iter().map(|&row| all[row as usize * columns + column]).collect())
    }

    fn read_back(&self, buffer: &wgpu::Buffer, first: usize, len: usize) -> Result<Vec<f32>, RenderError> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = Reserve { adapter: &self.adapter }.buffer("staging", 4 * len as u64, usage)?;
        let mut encoder = self.adapter.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 4 * first as u64, &staging, 0, 4 * len as u64);
        self.adapter.queue.submit([encoder.finish()]);
        read(&self.adapter, &staging, "reading potentials back")
    }

    /// All values of the networks and vectors, for comparisons.
    #[cfg(test)]
    pub(super) fn buffers(&self) -> [Vec<f32>; 2] {
        let read = |buffer, len: usize| self.read_back(buffer, 0, len).unwrap();
        [
            read(&self.buffers.networks, self.plan.network_len),
            read(&self.buffers.vectors, self.plan.vectors_len),
        ]
    }
}

fn told(plan: &Plan, sharing: &Sharing) -> PlanUniform {
    let mut told = PlanUniform::zeroed();
    told.levels[..plan.levels.len()].copy_from_slice(&plan.levels);
    PlanUniform {
        level_count: plan.levels.len() as u32,
        first_of_tail: sharing.tail as u32,
        weights: plan.weights,
        links: plan.links,
        potential: plan.potential,
        feed: plan.feed,
        image: plan.image,
        allowed_at: HEADER as u32,
        steps: plan.steps,
        ..told
    }
}
