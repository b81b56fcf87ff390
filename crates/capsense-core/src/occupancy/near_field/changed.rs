//! Which edges of a lattice nodes near edges of conductors have changed.

use super::{CARRIER, Room, Wedges};
use crate::few::Few;
use crate::mesh::Edges;
use crate::occupancy::coupling::Coupling;
use crate::occupancy::index_set::IndexSet;

impl Wedges {
    /// Adds the edges that the last update may have changed, whose ends' `conductors` are known, and what they were.
    pub(in super::super) fn add_changed_edges(
        &self,
        edges: &Edges,
        conductors: &[u16],
        couplings: &Few<Coupling>,
        changed: &mut IndexSet,
    ) {
        let Edges::Lattice(lattice) = edges else { return };
        let strides = lattice.strides();
        // Edges below a node have the number of the node at their other end.
        for Room { looked_at, relinked, .. } in &self.rooms {
            changed.expect(3 * looked_at.start.saturating_sub(strides[2])..3 * looked_at.end);
            relinked.iter().for_each(|&node| changed.insert_expected(3 * node as usize + CARRIER));
        }
        for &(node, sides) in self.rooms.iter().flat_map(|room| &room.near_ends) {
            let node = node as usize;
            for (axis, stride) in strides.into_iter().enumerate() {
                let sides = sides >> (2 * axis);
                if sides & 1 != 0 {
                    changed.insert_expected(3 * (node - stride) + axis);
                }
                if sides & 2 != 0 {
                    changed.insert_expected(3 * node + axis);
                }
            }
        }
        for &(node, sides) in self.rooms.iter().flat_map(|room| &room.around) {
            let node = node as usize;
            // Others change only if they are not plain, or walls may pass beside them: beside both their ends.
            let may_be_beside = self.at[node].may_be_beside(conductors[node]);
            if !may_be_beside {
                for (axis, stride) in strides.into_iter().enumerate() {
                    // Edges that do not exist are plain.
                    let below = (3 * node + axis).wrapping_sub(3 * stride);
                    for edge in [below, 3 * node + axis] {
                        if edge < couplings.len() && couplings.has_own(edge) {
                            changed.insert_expected(edge);
                        }
                    }
                }
                continue;
            }
            let is_changed = |edge: usize, other: usize| {
                couplings.has_own(edge)
                    || self.may_be_beside([node as u32, other as u32], [conductors[node], conductors[other]])
            };
            for (axis, stride) in strides.into_iter().enumerate() {
                let sides = sides >> (2 * axis);
                if sides & 1 != 0 && is_changed(3 * (node - stride) + axis, node - stride) {
                    changed.insert_expected(3 * (node - stride) + axis);
                }
                if sides & 2 != 0 && is_changed(3 * node + axis, node + stride) {
                    changed.insert_expected(3 * node + axis);
                }
            }
        }
    }
}
