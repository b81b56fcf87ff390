//! From one level to the next coarser one and back, plane by plane: the stages of all axes in one go.
//!
//! After a sweep only red nodes have a residual, and the sweep after the correction starts with the black nodes, which
//! it computes from the red ones: so only red nodes are restricted and corrected.

use super::between::{HalfRows, ThickPlane};
use super::descent::Descent;
use super::following::Further;
use super::layout::{Coloured, Layout};
use super::level::{Level, Slab};
use super::network::{Changed, Network};
use super::pairs::{Pairs, Piece, pieces};
use super::parts::{Parts, cut_both};
use super::prolongation::{Behind, Nothing, Prolongation};
use super::restriction::Restriction;
use super::stage::Stage;
use crate::instructions::EightLanes;
use crate::workers::Workers;

/// A row of a coarse network takes as long to follow as the sweep of the finest level and its restriction take for so many nodes in a
/// column. Measured: with 90 two threads take up to 2 % longer at 296k.
const NODES_OF_A_ROW: usize = 120;

/// How a level is made coarser, with storage for each thread.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    stages: Stages,
    between: Vec<Between>,
    /// How threads share the coarse planes.
    coarse: Parts,
    /// That of the fine level's vectors.
    layout: Layout,
}

/// At most one stage for each axis.
#[derive(Clone, Debug)]
pub(super) struct Stages {
    pub(super) z: Option<Stage>,
    pub(super) y: Option<Stage>,
    pub(super) x: Option<Stage>,
    /// How the stage of x takes rows apart.
    pub(super) pieces: Vec<Piece>,
}

/// What is between stages.
#[derive(Clone, Debug)]
pub(super) struct Between {
    /// The fine level on its way to the coarse one.
    pub(super) descent: Descent,
    /// Between the stages of z and y: a coarse plane, and the one before.
    pub(super) thick: [ThickPlane; 2],
    /// Between the stages of y and x: a coarse row, and the one before.
    pub(super) halves: [HalfRows; 2],
    /// A row within the stage of x.
    pub(super) pairs: Pairs,
}

impl Transfer {
    /// Zeros everywhere, after numbers that were not finite.
    pub(super) fn clear(&mut self) {
        for Between { descent, thick, halves, pairs } in &mut self.between {
            descent.clear();
            thick.iter_mut().for_each(ThickPlane::clear);
            halves.iter_mut().for_each(HalfRows::clear);
            pairs.clear();
        }
    }

    /// Gives back the room that the first refresh took.
    pub(super) fn settle(&mut self) {
        self.stages_mut().for_each(Stage::settle);
    }

    /// Zeros in the networks of all stages.
    pub(super) fn clear_networks(&mut self) {
        self.stages_mut().for_each(Stage::clear);
    }

    /// Keeps those planes across x, y and z for which `kept` holds. Returns the counts of the coarse level too.
    pub(super) fn new(fine: &Level, kept: &[Vec<bool>; 3], threads: usize) -> (Self, [usize; 3]) {
        let mut coarse = fine.layout.counts;
        let threads = Parts::worthwhile(&fine.layout, threads);
        let mut stage = |axis: usize| {
            kept[axis].contains(&false).then(|| {
                let stage = Stage::new(coarse, axis, &kept[axis], &fine.stencil.layout, threads);
                coarse = stage.coarse().0.counts;
                stage
            })
        };
        let (z, y, x) = (stage(2), stage(1), stage(0));
        let thick = ThickPlane::zeros(&fine.layout);
        let halves = HalfRows::zeros(&fine.layout, &thick);
        let between = Between {
            descent: Descent::new(&fine.layout),
            pairs: Pairs::zeros(coarse[0], fine.layout.columns),
            thick: [thick.clone(), thick],
            halves: [halves.clone(), halves],
        };
        let layout = Layout::new(coarse, fine.layout.margin).with_columns(fine.layout.columns);
        let stages = Stages { z, y, x, pieces: pieces(&kept[0]) };
        let parts = Parts::apart(&layout, threads, |plane| stages.before(&layout, &fine.layout, plane));
        let tasks = parts.slabs.len().max(fine.parts.slabs.len());
        let transfer = Self { stages, between: vec![between; tasks], coarse: parts, layout: fine.layout };
        (transfer, coarse)
    }

    /// The coarse network and where it changed last; none if nothing is made coarser.
    pub(super) fn coarse(&self) -> Option<(&Network, &Changed)> {
        self.stages.coarse()
    }

    /// Recomputes the coarse network where the fine one changed.
    pub(super) fn refresh(&mut self, workers: &Workers, arch: EightLanes, fine: &Network, changed: &Changed) {
        let (mut fine, mut changed) = (fine, changed);
        for stage in self.stages_mut() {
            stage.refresh(workers, arch, fine, changed);
            (fine, changed) = stage.coarse();
        }
    }

    /// Its stages, in their order.
    pub(super) fn stages(&self) -> impl Iterator<Item = &Stage> {
        let Stages { z, y, x, .. } = &self.stages;
        z.iter().chain(y).chain(x)
    }

    /// The same to be changed.
    pub(super) fn stages_mut(&mut self) -> impl Iterator<Item = &mut Stage> {
        let Stages { z, y, x, .. } = &mut self.stages;
        z.iter_mut().chain(y).chain(x)
    }

    /// The coarse right-hand side: what a sweep from zero leaves over. Each eliminated node's residual goes to the nodes
    /// that it is interpolated from.
    pub(super) fn restrict(
        &mut self,
        workers: &Workers,
        arch: EightLanes,
        fine: &Level,
        coarse: &mut Level,
        active: &[usize],
    ) {
        let Self { stages, between, coarse: parts, .. } = self;
        let tasks = restrictions((stages, between, parts), fine, (coarse.layout, &mut coarse.b), active);
        workers.for_each(tasks, |task| arch.dispatch(task));
    }

    /// The same while networks behind the coarse one follow it. Planes are shared out as if there were helpers.
    pub(super) fn restrict_beside(
        &mut self,
        (workers, arch): (&Workers, EightLanes),
        fine: &Level,
        (layout, b): (Layout, &mut Coloured<f32>),
        active: &[usize],
        further: Further<'_>,
    ) {
        let of_sweep = self.layout.counts.into_iter().product::<usize>() * active.len();
        let all = self.stages.before(&layout, &self.layout, layout.counts[2]);
        self.recut(&layout, all * NODES_OF_A_ROW * further.rows() / of_sweep.max(1));
        let Self { stages, between, coarse: parts, .. } = self;
        let follow = || further.follow(stages.coarse(), workers, arch, || true);
        let tasks = restrictions((stages, between, parts), fine, (layout, b), active);
        workers.beside(follow, tasks, |task| arch.dispatch(task));
        self.recut(&layout, 0);
    }

    /// Cuts the coarse planes anew, for a first thread that comes later.
    fn recut(&mut self, coarse: &Layout, later: usize) {
        let Self { stages, coarse: parts, layout, .. } = self;
        parts.recut(coarse, later, |plane| stages.before(coarse, layout, plane));
    }

    /// Adds bᵀMb, M the sweep of the last restriction, for all pairs s <= t of the active columns to `gains`, or a part of it.
    pub(super) fn add_gains(&self, active: &[usize], part: f64, gains: &mut [f64]) {
        let columns = self.layout.columns;
        for k in self.layout.planes() {
            let Some(descent) =
                self.between.iter().map(|between| &between.descent).find(|of| of.went_through(k))
            else {
                continue;
            };
            for (index, &t) in active.iter().enumerate() {
                for &s in &active[..=index] {
                    gains[s * columns + t] += part * descent.gain(k, s, t);
                }
            }
        }
    }

    /// Adds the interpolated coarse correction to the red nodes of the fine level, and finishes its sweep behind.
    pub(super) fn prolong(
        &mut self,
        workers: &Workers,
        arch: EightLanes,
        fine: &mut Level,
        coarse: &Level,
        active: &[usize],
    ) {
        for phase in [0, 1] {
            let slabs = fine.slabs(phase, active).map(|slab| (slab, Nothing));
            self.prolong_before(workers, arch, slabs, coarse);
        }
    }

    /// The same for the slabs of one phase, each with what goes on behind.
    pub(super) fn prolong_before<'a, B: Behind + Send>(
        &mut self,
        workers: &Workers,
        arch: EightLanes,
        slabs: impl Iterator<Item = (Slab<'a>, B)> + Send,
        coarse: &Level,
    ) {
        let Self { stages, between, .. } = self;
        let stages = &*stages;
        let tasks = slabs.zip(between).map(|((fine, behind), between)| Prolongation {
            stages,
            between,
            fine,
            coarse,
            behind,
        });
        workers.for_each(tasks, |task| arch.dispatch(task));
    }
}

/// What each thread restricts.
fn restrictions<'a>(
    (stages, between, parts): (&'a Stages, &'a mut [Between], &'a Parts),
    fine: &'a Level,
    (layout, b): (Layout, &'a mut Coloured<f32>),
    active: &'a [usize],
) -> impl Iterator<Item = Restriction<'a>> {
    let vectors = cut_both(&parts.slabs, b).zip(between);
    parts.slabs.iter().zip(vectors).map(move |(part, (b, between))| Restriction {
        stages,
        between,
        fine,
        layout,
        part,
        b,
        active,
    })
}

impl Stages {
    /// The network of the last one and where it changed last; none if there is no stage.
    fn coarse(&self) -> Option<(&Network, &Changed)> {
        let last = self.x.as_ref().or(self.y.as_ref()).or(self.z.as_ref())?;
        Some(last.coarse())
    }

    /// How long a sweep of the fine level and its restriction take up to a coarse plane: as many fine and coarse planes as are
    /// before it, fine ones counted twice.
    fn before(&self, coarse: &Layout, fine: &Layout, plane: usize) -> usize {
        let of_fine = if plane < coarse.counts[2] { self.fine_plane(plane) } else { fine.counts[2] };
        2 * of_fine + plane
    }

    /// The fine plane of a coarse one.
    #[inline(always)]
    pub(super) fn fine_plane(&self, coarse: usize) -> usize {
        match &self.z {
            Some(stage) => stage.fine_plane[coarse],
            None => coarse,
        }
    }

    /// The coarse planes at a fine one, or before and after it.
    #[inline(always)]
    pub(super) fn around(&self, fine: usize) -> [usize; 2] {
        match &self.z {
            Some(stage) => stage.around(fine),
            None => [fine, fine],
        }
    }
}
