//! The buffers and kernels of some scenes on one mesh, and how a frame of them is computed: changes go in, capacitances come
//! out, nothing else.

use super::binding::{Buffers, LAUNCH_STRIDE, bind_group, bind_group_layout, pipelines};
use super::finder::{Finder, Finding};
use super::launch::{Launch, Sharing, Work, kernels};
use super::memory::{Reserve, read};
use super::plan::{Grid, Level, MOST_GRIDS, MOST_LEVELS, Plan, Transfer};
use super::shader;
use crate::adapter::Adapter;
use crate::error::RenderError;
use crate::gpu::Rows;
use bytemuck::{Pod, Zeroable};
use capsense_core::solver::Found;

/// Columns that can be told to start from zero.
pub(super) const MOST_COLUMNS: usize = 31;

/// Iterations that are kept account of.
pub(super) const MOST_ITERATIONS: u32 = 30;

/// Words before the rows and feeds of all scenes: for each scene a header.
pub(super) const HEADER: usize = 12;
const ROW: usize = 6;
const FEED: usize = 3;

/// The plan as the kernels have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PlanUniform {
    grids: [Grid; MOST_GRIDS],
    levels: [Level; MOST_LEVELS],
    transfers: [Transfer; MOST_LEVELS],
    level_count: u32,
    potential: u32,
    image: u32,
    feed: u32,
    steps: [u32; 2],
    leak: u32,
    first_of_tail: u32,
    network_len: u32,
    vectors_len: u32,
    scratch_len: u32,
    allowed_at: u32,
}

/// What a frame changes in one scene, in words of the buffer that the kernels read.
#[derive(Clone, Debug, Default)]
pub(super) struct SceneChanges {
    pub(super) rows: Vec<[u32; ROW]>,
    pub(super) feeds: Vec<[u32; FEED]>,
    /// A bit for each column that is to start from zero.
    pub(super) emptied: u32,
}

/// What came back of one scene.
#[derive(Clone, Debug, Default)]
pub(super) struct SceneResult {
    /// Of pairs s <= t of columns, row by row.
    pub(super) energies: Vec<f64>,
    /// The largest of residuals over charges.
    pub(super) residual: f64,
    pub(super) to_come: Vec<f64>,
    pub(super) iterations: u32,
    /// Of objects that were placed anew and found on the device.
    pub(super) found: Option<Found>,
}

impl SceneResult {
    /// From the words that `collect` leaves, of so many columns.
    pub(super) fn new(words: &[f32], columns: usize) -> Self {
        let mut energies = vec![0.0; columns * columns];
        for (s, t) in (0..columns).flat_map(|s| (s..columns).map(move |t| (s, t))) {
            let at = 2 * (s * columns + t);
            let energy = f64::from(words[at]) + f64::from(words[at + 1]);
            (energies[s * columns + t], energies[t * columns + s]) = (energy, energy);
        }
        let (squares, rest) = words[2 * columns * columns..].split_at(2 * columns);
        let (free, held) = squares.split_at(columns);
        let ratios = free.iter().zip(held).filter(|(_, held)| **held > 0.0);
        let residual = ratios.map(|(free, held)| f64::from(free / held).sqrt()).fold(0.0, f64::max);
        let to_come = rest[..columns].iter().map(|&still| f64::from(still)).collect();
        Self { energies, residual, to_come, iterations: rest[columns] as u32, found: None }
    }
}

/// What frames cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Kernels launched.
    pub launches: usize,
    /// Bytes sent to the device, and read back from it.
    pub sent: u64,
    /// Bytes read back.
    pub received: u64,
    /// Bytes that kernels must read and write at least in the iterations that scenes took, caches aside.
    pub moved: u64,
}

/// Some scenes on one mesh.
#[derive(Debug)]
pub(super) struct FieldDevice {
    pub(super) adapter: Adapter,
    pub(super) plan: Plan,
    pub(super) sharing: Sharing,
    pub(super) scenes: usize,
    pipelines: Vec<wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    launches: wgpu::Buffer,
    uniform: wgpu::Buffer,
    buffers: Buffers,
    results_len: usize,
    readback: wgpu::Buffer,
    changes: Vec<u32>,
    /// What the launches were told last.
    told: Vec<u8>,
    /// What finds objects, if they are found on the device, and the scenes in which it is to.
    pub(super) finder: Option<Finder>,
    due: Vec<bool>,
}

impl FieldDevice {
    /// Reserves memory for so many scenes and compiles the kernels.
    ///
    /// # Errors
    /// When the mesh or the scenes exceed the adapter's limits or its memory, or it fails.
    pub(super) fn new(
        adapter: Adapter,
        plan: Plan,
        scenes: usize,
        finder: Option<(Finder, Finding)>,
    ) -> Result<Self, RenderError> {
        if plan.columns > MOST_COLUMNS {
            let (needed, limit) = (plan.columns as u64, MOST_COLUMNS as u64);
            return Err(RenderError::LimitExceeded { what: "the number of terminals", needed, limit });
        }
        let groups = u64::from(adapter.limits.max_compute_workgroups_per_dimension);
        if scenes as u64 > groups {
            let needed = scenes as u64;
            return Err(RenderError::LimitExceeded { what: "the number of scenes", needed, limit: groups });
        }
        let sharing = Sharing::of(&plan);
        let (columns, teams) = (plan.columns, sharing.teams as usize);
        let numbers = 2 * columns * columns + 2 * columns;
        let results_len = numbers + columns + 1;
        let records = (MOST_ITERATIONS as usize + 1) * columns * 4;
        let scratch_len = 2 * teams * columns + teams * numbers + records;
        let (finder, finding) = finder.unzip();
        let flags_len = finder.as_ref().map_or(0, |finder| finder.flags_len);
        let most = Work {
            iterations: 0..MOST_ITERATIONS,
            changed_rows: 1,
            empties: true,
            finds: finder.is_some(),
            is_exact: finding.is_some_and(|finding| finding.is_exact),
        };
        let most_launches = sharing.launches(&plan, &most).len() as u64;
        use wgpu::BufferUsages as Usage;
        let reserve = Reserve { adapter: &adapter };
        let storage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let words = |len: usize| 4 * (len * scenes) as u64;
        let buffers = Buffers {
            maps: reserve.buffer("maps of the hierarchy", 4 * plan.maps.len().max(1) as u64, storage)?,
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
        let readback =
            reserve.buffer("readback", words(results_len + flags_len), Usage::MAP_READ | Usage::COPY_DST)?;
        adapter.queue.write_buffer(&buffers.maps, 0, bytemuck::cast_slice(&plan.maps));
        adapter.queue.write_buffer(
            &uniform,
            0,
            bytemuck::bytes_of(&told(&plan, &sharing, scratch_len, scenes)),
        );
        // A buffer starts as zeros, and zero is a column's number.
        let free = vec![capsense_core::solver::NO_HOLDER; plan.nodes() * scenes];
        adapter.queue.write_buffer(&buffers.holders, 0, bytemuck::cast_slice(&free));
        let layout = bind_group_layout(&adapter.device);
        let source = shader::source(columns, sharing.teams, finding);
        let kernels = kernels(finding.as_ref());
        let of_objects = finder.as_ref().map(|finder| &finder.layout);
        let entries: Vec<_> = kernels.iter().map(|kernel| kernel.entry()).collect();
        let pipelines = pipelines(&adapter.device, [Some(&layout), of_objects], &entries, &source);
        let group = bind_group(&adapter.device, &layout, &launches, &uniform, &buffers);
        adapter.faults.check("preparing the kernels")?;
        Ok(Self {
            adapter,
            plan,
            sharing,
            scenes,
            pipelines,
            layout,
            group,
            launches,
            uniform,
            buffers,
            results_len,
            readback,
            changes: Vec::new(),
            told: Vec::new(),
            finder,
            due: vec![false; scenes],
        })
    }

    /// Tells the kernels of what changed in the scenes, how far their energies may be from the least, column by column, and with
    /// how many iterations at most they are solved, if they are.
    ///
    /// # Errors
    /// When the changes are more than the device takes.
    pub(super) fn send(
        &mut self,
        changes: &[SceneChanges],
        allowed: &[f32],
        most_iterations: &[Option<u32>],
    ) -> Result<u64, RenderError> {
        let mut words = std::mem::take(&mut self.changes);
        let mut placed = 0;
        words.clear();
        words.resize(HEADER * self.scenes, 0);
        words.extend(allowed.iter().map(|allowed| allowed.to_bits()));
        for (scene, (changes, most)) in changes.iter().zip(most_iterations).enumerate() {
            let rows_at = words.len();
            words.extend(changes.rows.as_flattened());
            let feeds_at = words.len();
            words.extend(changes.feeds.as_flattened());
            let counts =
                [rows_at, changes.rows.len(), feeds_at, changes.feeds.len()].map(|count| count as u32);
            words[HEADER * scene..][..4].copy_from_slice(&counts);
            let told = [changes.emptied, u32::from(most.is_some()), most.unwrap_or(0)];
            words[HEADER * scene + 4..][..3].copy_from_slice(&told);
            if let Some(finder) = &mut self.finder {
                self.due[scene] = most.is_some() && finder.is_due(scene);
                let told = finder.tell(scene, most.is_some(), &mut words);
                words[HEADER * scene + 7..][..5].copy_from_slice(&told);
                placed += u64::from(told[0] * told[2]);
            }
        }
        let bytes = 4 * words.len() as u64;
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
        self.adapter.queue.write_buffer(&self.buffers.changes, 0, bytemuck::cast_slice(&words));
        self.changes = words;
        Ok(bytes + placed * size_of::<Rows>() as u64)
    }

    /// Runs some iterations of all scenes, the first of them from what was sent, and reads back what they found.
    ///
    /// # Errors
    /// When the driver fails or the device is lost.
    pub(super) fn run(
        &mut self,
        iterations: std::ops::Range<u32>,
        most_rows: usize,
        empties: bool,
    ) -> Result<(Vec<SceneResult>, Traffic), RenderError> {
        let finds = iterations.start == 0 && self.due.contains(&true);
        // Whether an object is nowhere is known on the device only.
        let empties = empties || self.finder.as_ref().is_some_and(Finder::has_columns);
        let is_exact = self.finder.as_ref().is_some_and(Finder::is_exact);
        let work = Work { iterations, changed_rows: most_rows as u32, empties, finds, is_exact };
        let launches = self.sharing.launches(&self.plan, &work);
        let mut told = vec![0_u8; LAUNCH_STRIDE as usize * launches.len()];
        for (bytes, (_, launch, _)) in told.chunks_exact_mut(LAUNCH_STRIDE as usize).zip(&launches) {
            bytes[..size_of::<Launch>()].copy_from_slice(bytemuck::bytes_of(launch));
        }
        // Frames that are alike have the same launches.
        let is_told = self.told == told;
        if !is_told {
            self.adapter.queue.write_buffer(&self.launches, 0, &told);
            self.told = told;
        }
        let mut encoder = self.adapter.device.create_command_encoder(&Default::default());
        if let Some(finder) = self.finder.as_ref().filter(|_| finds) {
            finder.draw(&self.due, &mut encoder);
        }
        let mut pass = encoder.begin_compute_pass(&Default::default());
        if let Some(finder) = &self.finder {
            pass.set_bind_group(1, &finder.group, &[]);
        }
        for (number, (kernel, _, groups)) in launches.iter().enumerate() {
            pass.set_pipeline(&self.pipelines[*kernel as usize]);
            pass.set_bind_group(0, &self.group, &[(LAUNCH_STRIDE * number as u64) as u32]);
            pass.dispatch_workgroups(*groups, self.scenes as u32, 1);
        }
        drop(pass);
        let results_bytes = 4 * (self.results_len * self.scenes) as u64;
        encoder.copy_buffer_to_buffer(&self.buffers.results, 0, &self.readback, 0, results_bytes);
        if let Some(Finder { flags, .. }) = &self.finder {
            encoder.copy_buffer_to_buffer(flags, 0, &self.readback, results_bytes, flags.size());
        }
        self.adapter.queue.submit([encoder.finish()]);
        let words = read(&self.adapter, &self.readback, "reading capacitances back")?;
        let (words, flags) = words.split_at(self.results_len * self.scenes);
        let traffic = Traffic {
            launches: launches.len(),
            sent: if is_told { 0 } else { self.told.len() as u64 },
            received: self.readback.size(),
            moved: 0,
        };
        let mut results: Vec<_> = words
            .chunks_exact(self.results_len)
            .map(|words| SceneResult::new(words, self.plan.columns))
            .collect();
        if let Some(finder) = self.finder.as_mut().filter(|_| finds) {
            let flags: Vec<u32> = flags.iter().map(|flag| flag.to_bits()).collect();
            for (scene, flags) in flags.chunks_exact(finder.flags_len).enumerate() {
                if std::mem::take(&mut self.due[scene]) {
                    results[scene].found = Some(finder.take_found(scene, flags));
                }
            }
        }
        Ok((results, traffic))
    }

    /// The potentials of all nodes of one scene in one column.
    ///
    /// # Errors
    /// When the driver fails or the device is lost.
    pub(super) fn potentials(&self, scene: usize, column: usize) -> Result<Vec<f32>, RenderError> {
        let stride = self.plan.levels[0].stride as usize;
        let first = scene * self.plan.vectors_len + self.plan.potential as usize + column * stride;
        self.read_back(&self.buffers.vectors, first, self.plan.nodes())
    }

    fn read_back(&self, buffer: &wgpu::Buffer, first: usize, len: usize) -> Result<Vec<f32>, RenderError> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = Reserve { adapter: &self.adapter }.buffer("staging", 4 * len as u64, usage)?;
        let mut encoder = self.adapter.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 4 * first as u64, &staging, 0, 4 * len as u64);
        self.adapter.queue.submit([encoder.finish()]);
        read(&self.adapter, &staging, "reading potentials back")
    }

    /// All values of one scene's networks and vectors, for comparisons.
    #[cfg(test)]
    pub(super) fn buffers_of(&self, scene: usize) -> [Vec<f32>; 2] {
        let read = |buffer, len: usize| self.read_back(buffer, scene * len, len).unwrap();
        [
            read(&self.buffers.networks, self.plan.network_len),
            read(&self.buffers.vectors, self.plan.vectors_len),
        ]
    }
}

fn told(plan: &Plan, sharing: &Sharing, scratch_len: usize, scenes: usize) -> PlanUniform {
    let mut told = PlanUniform::zeroed();
    told.grids[..plan.grids.len()].copy_from_slice(&plan.grids);
    told.levels[..plan.levels.len()].copy_from_slice(&plan.levels);
    told.transfers[..plan.transfers.len()].copy_from_slice(&plan.transfers);
    PlanUniform {
        level_count: plan.levels.len() as u32,
        potential: plan.potential,
        image: plan.image,
        feed: plan.feed,
        steps: plan.steps,
        leak: plan.leak,
        first_of_tail: sharing.tail as u32,
        network_len: plan.network_len as u32,
        vectors_len: plan.vectors_len as u32,
        scratch_len: scratch_len as u32,
        allowed_at: (HEADER * scenes) as u32,
        ..told
    }
}
