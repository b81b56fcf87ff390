//! How coarser levels follow the finest one where that changed.
//!
//! It is a chain of stages, each from the network of the one before, with few rows each: threads hardly share it. So the second
//! level follows while residuals are computed, which do not depend on it, and further ones beside what needs no more than
//! the first two: the rest of the residuals, and the first part of the way down.

use super::level::Level;
use super::network::{Changed, Network};
use super::transfer::Transfer;
use crate::instructions::EightLanes;
use crate::workers::Workers;

/// The finest level, and where its network changed that it has not taken over.
pub(super) struct Finest<'a> {
    pub(super) level: &'a mut Level,
    pub(super) changed: Option<(&'a Network, &'a Changed)>,
}

impl<'a> Finest<'a> {
    /// Takes over what changed.
    pub(super) fn refresh(self, arch: EightLanes) -> &'a mut Level {
        if let Some((network, changed)) = self.changed {
            self.level.refresh(arch, network, changed);
        }
        self.level
    }
}

/// All levels but the finest, and where that changed.
pub(super) struct Coarser<'a> {
    pub(super) finest: &'a Network,
    pub(super) pending: &'a mut Changed,
    pub(super) transfers: &'a mut [Transfer],
    pub(super) levels: &'a mut [Level],
    pub(super) followed: &'a mut Option<usize>,
}

/// What follows the network of the second level: those behind it, and the levels.
pub(super) struct Further<'a> {
    pub(super) transfers: &'a mut [Transfer],
    pub(super) levels: &'a mut [Level],
    /// How many stages have followed; none if all have, and the levels too.
    pub(super) followed: &'a mut Option<usize>,
}

impl Coarser<'_> {
    /// Recomputes the network of the second level where the finest changed, and those behind it for as long as `goes_on` says.
    pub(super) fn refresh(self, workers: &Workers, arch: EightLanes, goes_on: impl Fn() -> bool) {
        let Self { finest, pending, transfers, levels, followed } = self;
        if let [first, transfers @ ..] = transfers {
            first.refresh(workers, arch, finest, pending);
            *followed = Some(0);
            Further { transfers, levels, followed }.follow(first.coarse(), workers, arch, goes_on);
        }
        pending.clear();
    }
}

impl Further<'_> {
    /// How many rows are likely to be computed yet: as many as the last time.
    pub(super) fn rows(&self) -> usize {
        let followed = self.followed.unwrap_or(usize::MAX);
        self.transfers
            .iter()
            .flat_map(Transfer::stages)
            .skip(followed)
            .map(|stage| stage.reached.rows())
            .sum()
    }

    /// Goes on for as long as `goes_on` says.
    pub(super) fn follow(
        self,
        second: Option<(&Network, &Changed)>,
        workers: &Workers,
        arch: EightLanes,
        goes_on: impl Fn() -> bool,
    ) {
        let Self { transfers, levels, followed } = self;
        let (Some(done), Some((mut fine, mut changed))) = (&mut *followed, second) else { return };
        for (number, stage) in transfers.iter_mut().flat_map(Transfer::stages_mut).enumerate() {
            if number == *done {
                if !goes_on() {
                    return;
                }
                stage.refresh(workers, arch, fine, changed);
                *done += 1;
            }
            (fine, changed) = stage.coarse();
        }
        let networks = std::iter::once(second).chain(transfers.iter().map(Transfer::coarse));
        let networks = networks.zip(levels).filter_map(|(network, level)| network.zip(Some(level)));
        workers.for_each(networks, |((network, changed), level)| level.refresh(arch, network, changed));
        *followed = None;
    }
}
