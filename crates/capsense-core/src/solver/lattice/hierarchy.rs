//! Geometric multigrid on the tensor lattice: an approximate K⁻¹ in single precision.
//!
//! A graded lattice has cells stretched in every direction somewhere. Point smoothing alone fails on them, so levels
//! are made coarser where spacing is small: each step merges only those neighbouring cells of an axis that together
//! are no longer than a length which grows from step to step. Cells become more equal from level to level, and errors
//! that a level cannot smooth along a short spacing are smooth on the level where that spacing is gone.

use super::descent::OVERCORRECTION;
use super::following::{Coarser, Finest, Further};
use super::layout::Layout;
use super::level::Level;
use super::network::{Changed, Network};
use super::stencil::Stencil;
use super::transfer::Transfer;
use crate::instructions::EightLanes;
use crate::mesh::Lattice;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;

/// Merged cells may exceed the length of a step by this factor, so that equal cells merge in spite of rounding.
const SLACK: f64 = 1.05;

/// By how much the length grows while too few cells merge, and the part of its nodes that a coarser level has at most.
/// Measured: at 200k tetrahedra 0.35 makes a cycle a fifth cheaper, but twice as many frames need two; at 25k it makes it
/// a quarter cheaper for hardly any more.
const STEP: f64 = 1.26;
const REDUCTION: f64 = 0.5;
const REDUCTION_OF_FEW: f64 = 0.35;

/// Coarser levels wait for so many frames at most. Measured: with 7 a bar that comes closer takes a fifth more steps at 1.5 million
/// tetrahedra.
const LONGEST: usize = 3;

/// Coarser levels follow where a weight grew or fell by more than this factor. Measured: with 2 a frame towards takes 2 % more
/// instructions at 200k and 1 % at 25k, and 16 spares nothing more. With no such limit, scenes with contrasts of up to a million were
/// off by up to 7,000 tolerances.
const FAR: f32 = 4.0;

/// Number of nodes that are few.
const FEW_NODES: usize = 10_000;

/// An axis with no more planes than this is coarse enough.
const FEW_PLANES: usize = 4;

/// Symmetric Gauss-Seidel sweeps on the coarsest level.
const COARSEST_SWEEPS: usize = 4;

/// The hierarchy of a lattice.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy {
    /// From fine to coarse.
    pub(super) levels: Vec<Level>,
    /// The first leads from the finest level.
    pub(super) transfers: Vec<Transfer>,
    finest: Network,
    changed: Changed,
    /// What changed since coarser levels followed last, in how many frames before this one, and whether they are to follow now.
    pending: Changed,
    waited: usize,
    is_due: bool,
    /// Once the second level's network has followed and until all others have, which is done beside the way down if not before: how
    /// many stages have.
    followed: Option<usize>,
}

impl Hierarchy {
    /// Plans the levels; weights come with [`Hierarchy::refresh_finest`].
    pub(super) fn new(lattice: &Lattice, layout: Layout, columns: usize, threads: usize) -> Self {
        let few = layout.counts.into_iter().product::<usize>() < FEW_NODES;
        let mut levels = vec![Level::new(layout, columns, threads)];
        let mut transfers = Vec::new();
        for kept in coarsenings(lattice, if few { REDUCTION_OF_FEW } else { REDUCTION }) {
            let (transfer, counts) = Transfer::new(&levels[levels.len() - 1], &kept, threads);
            levels.push(Level::new(Layout::new(counts, layout.margin), columns, threads));
            transfers.push(transfer);
        }
        levels.shrink_to_fit();
        transfers.shrink_to_fit();
        Self {
            finest: Network::new(layout.counts),
            changed: Changed::nothing(layout.counts),
            pending: Changed::nothing(layout.counts),
            waited: 0,
            is_due: true,
            followed: None,
            levels,
            transfers,
        }
    }

    /// Zeros in all vectors, after numbers that were not finite: padding must not keep them.
    pub(super) fn clear(&mut self) {
        for level in &mut self.levels {
            level.b.iter_mut().chain(&mut level.x).for_each(|values| values.fill(0.0));
        }
        self.transfers.iter_mut().for_each(Transfer::clear);
    }

    /// Gives back the room that the first refresh took, in which every row changed and all levels have followed.
    pub(super) fn settle(&mut self) {
        debug_assert!(self.followed.is_none(), "levels that are behind would not see what changed");
        self.changed.release();
        self.pending.release();
        self.transfers.iter_mut().for_each(Transfer::settle);
    }

    /// Zeros in all networks, as before the first refresh.
    pub(super) fn clear_networks(&mut self) {
        self.finest.clear();
        self.followed = None;
        for level in &mut self.levels {
            let Stencil { next, centre, .. } = &mut level.stencil;
            next.iter_mut().flatten().chain(centre).for_each(|values| values.fill(0.0));
        }
        self.transfers.iter_mut().for_each(Transfer::clear_networks);
    }

    /// Takes over the matrix and the fixed rows where they changed on the finest level. `changed` must hold all nodes whose
    /// row or state changed. Coarser levels are to follow unless they can wait; they cannot where a weight is far from what it was,
    /// or a potential was fixed or released. If they are, there is [`Finest::refresh`] to do besides.
    pub(super) fn refresh_finest(
        &mut self,
        arch: EightLanes,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: &[u32],
        can_wait: bool,
    ) {
        let Self { levels, finest, changed: region, pending, waited, is_due, .. } = self;
        region.clear();
        *is_due = !can_wait || *waited == LONGEST;
        for node in changed.iter().map(|&node| node as usize) {
            let [i, j, k] = levels[0].layout.indices(node);
            let at = finest.index([i, j, k]);
            let (leak_before, mut most) = (finest.leak[at], 0.0_f32);
            let leak = if fixed[node] { f32::INFINITY } else { matrix.link_weight(node) as f32 };
            // Within a conductor nothing differs, whatever links its nodes have.
            let mut differs = replace(&mut finest.leak[at], leak);
            let weights = matrix.lattice_weights(node);
            for (axis, next) in finest.next.iter_mut().enumerate() {
                let (before, now) = (next[at], weights[axis] as f32);
                most = most.max(now);
                if replace(&mut next[at], now) {
                    differs = true;
                    *is_due |= is_far(before, now, 0.0);
                    let [i, j, k] = [0, 1, 2].map(|other| [i, j, k][other] + usize::from(other == axis));
                    region.add(i..i + 1, j, k);
                }
            }
            if differs {
                *is_due |= is_far(leak_before, leak, most);
                region.add(i..i + 1, j, k);
            }
        }
        if !*is_due {
            levels[0].refresh(arch, finest, region);
        }
        pending.join(region);
        *waited = if *is_due { 0 } else { *waited + 1 };
    }

    /// The finest level with what it is to take over yet, and what makes the coarser ones follow it if they are to do that now.
    pub(super) fn split(&mut self) -> (Finest<'_>, Option<Coarser<'_>>) {
        let Self { levels, transfers, finest: network, changed, pending, is_due, followed, .. } = self;
        let (first, levels) = levels.split_at_mut(1);
        let coarser = is_due.then_some(Coarser { levels, transfers, finest: network, pending, followed });
        let changed = is_due.then_some((&*network, &*changed));
        (Finest { level: &mut first[0], changed }, coarser)
    }

    /// Lets those levels follow that are behind, before the finest one is another again.
    pub(super) fn follow_all(&mut self, workers: &Workers, arch: EightLanes) {
        let Self { levels, transfers, followed, .. } = self;
        if let ([first, transfers @ ..], [_, levels @ ..]) = (&mut transfers[..], &mut levels[..]) {
            Further { transfers, levels, followed }.follow(first.coarse(), workers, arch, || true);
        }
    }

    /// The second half of a symmetric V-cycle, up to the correction x of the finest level.
    pub(super) fn ascend(&mut self, workers: &Workers, arch: EightLanes, active: &[usize]) {
        self.ascend_coarse(workers, arch, active);
        let Self { levels, transfers, .. } = self;
        if let (Some(transfer), [finest, coarse, ..]) = (transfers.first_mut(), &mut levels[..]) {
            transfer.prolong(workers, arch, finest, coarse, active);
        }
    }

    /// The first half of a symmetric V-cycle: from the right-hand side b of the finest level to the solution of the
    /// coarsest. Tells bᵀMb for all pairs s <= t of active columns, and the finest level's part of it: the sweeps of the second
    /// half mirror those of the first, so it is what each sweep on the way down takes from the energy, and bᵀx on the coarsest level.
    pub(super) fn descend(
        &mut self,
        workers: &Workers,
        arch: EightLanes,
        active: &[usize],
        [gains, of_finest]: [&mut [f64]; 2],
    ) {
        gains.fill(0.0);
        of_finest.fill(0.0);
        // What a level gains it gains of a residual that was raised on the way to it, and back on the finest of z only.
        let mut part = 1.0;
        for index in 0..self.transfers.len() {
            if index == 0 && self.followed.is_some() {
                self.leave_finest(workers, arch, active);
            } else {
                let (fine, coarse) = self.levels.split_at_mut(index + 1);
                self.transfers[index].restrict(workers, arch, &fine[index], &mut coarse[0], active);
            }
            self.transfers[index].add_gains(active, part, gains);
            if index == 0 {
                of_finest.copy_from_slice(gains);
            }
            part /= f64::from(OVERCORRECTION);
        }
        if let Some(coarsest) = self.levels.last_mut() {
            coarsest.solve(arch, COARSEST_SWEEPS, active);
            coarsest.add_products(active, part, gains);
        }
    }

    /// The way down from the finest level to the second one while further ones follow.
    fn leave_finest(&mut self, workers: &Workers, arch: EightLanes, active: &[usize]) {
        let Self { levels, transfers, followed, .. } = self;
        if let ([first, transfers @ ..], [finest, levels @ ..]) = (&mut transfers[..], &mut levels[..])
            && let [second, ..] = levels
        {
            let (layout, mut b) = (second.layout, std::mem::take(&mut second.b));
            let further = Further { transfers, levels, followed };
            first.restrict_beside((workers, arch), finest, (layout, &mut b), active, further);
            levels[0].b = b;
        }
    }

    /// The second half up to where the second level is corrected.
    pub(super) fn ascend_coarse(&mut self, workers: &Workers, arch: EightLanes, active: &[usize]) {
        let Self { levels, transfers, .. } = self;
        for (index, transfer) in transfers.iter_mut().enumerate().skip(1).rev() {
            let (fine, coarse) = levels.split_at_mut(index + 1);
            transfer.prolong(workers, arch, &mut fine[index], &coarse[0], active);
        }
    }
}

/// Stores a number. Returns whether it is another than before.
fn replace(stored: &mut f32, now: f32) -> bool {
    std::mem::replace(stored, now).to_bits() != now.to_bits()
}

/// Whether a weight is so far from what it was that coarser levels must follow, if what is less than another counts as much.
fn is_far(before: f32, now: f32, least: f32) -> bool {
    let (before, now) = (before.max(least), now.max(least));
    now > FAR * before || before > FAR * now
}

/// How a lattice is made coarser, step by step: which planes across each axis are kept of those of the step before. Each
/// step leaves no more than a part of the nodes.
pub(in crate::solver) fn coarsenings(lattice: &Lattice, reduction: f64) -> Vec<[Vec<bool>; 3]> {
    let mut planes = lattice.axes().clone();
    let mut steps = Vec::new();
    let spacings = planes.iter().flat_map(|axis| axis.windows(2)).map(|pair| pair[1] - pair[0]);
    let mut length = spacings.fold(f64::INFINITY, f64::min);
    while planes.iter().any(|axis| axis.len() > FEW_PLANES) {
        length *= STEP;
        let kept = [0, 1, 2].map(|axis| kept_planes(&planes[axis], length * SLACK));
        let nodes = |planes: [usize; 3]| planes.into_iter().product::<usize>() as f64;
        let left = [0, 1, 2].map(|axis| kept[axis].iter().filter(|kept| **kept).count());
        let all_merge =
            planes.iter().flat_map(|axis| axis.windows(3)).all(|three| three[2] - three[0] <= length * SLACK);
        if nodes(left) > reduction * nodes([0, 1, 2].map(|axis| planes[axis].len())) && !all_merge {
            continue;
        }
        for (planes, kept) in planes.iter_mut().zip(&kept) {
            let mut kept = kept.iter();
            planes.retain(|_| kept.next().copied().unwrap_or(true));
        }
        steps.push(kept);
    }
    steps
}

/// Merges neighbouring cells that together are at most so long, each with one neighbour at most.
fn kept_planes(planes: &[f64], length: f64) -> Vec<bool> {
    let mut kept = vec![true; planes.len()];
    let mut start = 0;
    while start + 2 < planes.len() {
        let merge = planes[start + 2] - planes[start] <= length;
        kept[start + 1] = !merge;
        start += if merge { 2 } else { 1 };
    }
    kept
}
