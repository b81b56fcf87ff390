//! What is known of edges, and what a frame replaces of it, by threads that share the edges if need be.

use super::coupling::Coupling;
use crate::few::Few;

/// What is known of successive edges.
pub(super) struct KnownEdges<'a> {
    /// The first of these edges.
    pub(super) first: usize,
    /// Those of all edges of the mesh, before this frame.
    pub(super) couplings: &'a Few<Coupling>,
    /// Whether an object meets an edge, or more than what is on it tells what it is without what is around it.
    pub(super) is_met: &'a mut [bool],
    /// The frame in which each edge was last looked at.
    pub(super) seen: &'a mut [u8],
    /// Whether a conductor took or left each node of the mesh in this frame, if one did.
    pub(super) moved: Option<&'a [bool]>,
    /// Number of this frame.
    pub(super) frame: u8,
}

/// What a frame replaced.
#[derive(Clone, Debug, Default)]
pub(super) struct Replaced {
    /// Edges that are not what they were, or at whose end a node moved, with what is left of them now; once all are known, with their
    /// couplings before.
    pub(super) couplings: Vec<(u32, Coupling)>,
    /// Edges that have links and had none.
    pub(super) linked: Vec<u32>,
    /// Whether an edge had a link and has none now.
    pub(super) links_lost: bool,
}

impl<'a> KnownEdges<'a> {
    /// Takes off what is known of the edges below one.
    pub(super) fn split_to(&mut self, end: usize) -> KnownEdges<'a> {
        fn take<'a, T>(from: &mut &'a mut [T], count: usize) -> &'a mut [T] {
            from.split_off_mut(..count).unwrap_or_default()
        }
        let Self { first, couplings, moved, frame, .. } = *self;
        let count = (end - first).min(self.seen.len());
        self.first += count;
        KnownEdges {
            first,
            couplings,
            is_met: take(&mut self.is_met, count),
            seen: take(&mut self.seen, count),
            moved,
            frame,
        }
    }

    /// Whether an object meets an edge.
    #[inline]
    pub(super) fn is_met(&self, edge: usize) -> bool {
        self.is_met[edge - self.first]
    }

    /// Notes that an edge was looked at in this frame, and whether an object meets it.
    #[inline]
    pub(super) fn see(&mut self, edge: usize, is_met: bool) {
        self.seen[edge - self.first] = self.frame;
        self.is_met[edge - self.first] = is_met;
    }

    /// Whether a conductor took or left one of the ends of an edge.
    #[inline]
    pub(super) fn is_moved(&self, ends: [u32; 2]) -> bool {
        self.moved.is_some_and(|moved| ends.iter().any(|&node| moved[node as usize]))
    }

    /// Couples an edge.
    #[inline(always)]
    pub(super) fn couple(&self, edge: usize, ends: [u32; 2], coupling: Coupling, replaced: &mut Replaced) {
        let before = self.couplings.get(edge);
        if coupling.is(before) {
            if self.is_moved(ends) {
                replaced.couplings.push((edge as u32, coupling));
            }
            return;
        }
        replaced.couplings.push((edge as u32, coupling));
        match (before.is_linked(), coupling.is_linked()) {
            (false, true) => replaced.linked.push(edge as u32),
            (true, false) => replaced.links_lost = true,
            _ => (),
        }
    }
}

impl Replaced {
    /// Nothing.
    pub(super) fn clear(&mut self) {
        self.couplings.clear();
        self.linked.clear();
        self.links_lost = false;
    }

    /// Couples the edges, of which it keeps what they were.
    pub(super) fn exchange(&mut self, couplings: &mut Few<Coupling>) {
        for (edge, coupling) in &mut self.couplings {
            let own = (!coupling.is(&Coupling::PLAIN)).then_some(*coupling);
            *coupling = couplings.set(*edge as usize, own);
        }
    }

    /// Takes over what was replaced elsewhere, of edges that come after those here.
    pub(super) fn append(&mut self, other: &mut Self) {
        fn take<T>(to: &mut Vec<T>, from: &mut Vec<T>) {
            if to.is_empty() { std::mem::swap(to, from) } else { to.append(from) }
        }
        take(&mut self.couplings, &mut other.couplings);
        take(&mut self.linked, &mut other.linked);
        self.links_lost |= std::mem::take(&mut other.links_lost);
    }
}
