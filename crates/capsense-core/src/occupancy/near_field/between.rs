//! What nodes near edges of conductors make of the edges between them.

use super::field::{Places, wedge_potentials};
use super::{AtWedge, CARRIER, KnownField};
use crate::occupancy::coupling::Coupling;
use crate::occupancy::{NO_OBJECT, Scene};

impl Scene<'_> {
    /// What is left of an edge of the lattice if nodes near edges of conductors are at its ends. `cut` is what surfaces on
    /// the edge make of it, `covered` what walls make of it as well.
    pub(in super::super) fn between_wedges(
        &self,
        edge: usize,
        ends: [u32; 2],
        wedges: [&AtWedge; 2],
        owners: [u16; 2],
        cut: Coupling,
        covered: Coupling,
    ) -> Coupling {
        let is_free = owners == [NO_OBJECT; 2];
        let mut coupling = covered;
        // What the ends of plates change is in the weights that links were found for.
        let by_ends = if is_free { self.end_factor(edge) } else { 1.0 };
        coupling.through *= by_ends;
        if !is_free {
            // To a node in the conductor the edge itself is what others are linked by.
            coupling.through *= 1.0 - f64::from(wedges[0].share.max(wedges[1].share));
        }
        // The links were found for what surfaces on the edge make of it.
        let missing = by_ends * (covered.through - cut.through);
        let slopes = if is_free && missing != 0.0 { self.slopes(wedges, ends) } else { [0.0; 2] };
        for end in 0..2 {
            let AtWedge { object, share, link, .. } = *wedges[end];
            coupling.factor[end] *= 1.0 - f64::from(share);
            if share > 0.0 {
                if is_free && missing != 0.0 {
                    coupling.factor[end] += f64::from(share) * missing * slopes[end];
                }
                if end == 0 && edge % 3 == CARRIER {
                    coupling.factor[end] += link;
                }
                coupling.object[end] = object;
            }
            if coupling.factor[end] == 0.0 {
                coupling.object[end] = NO_OBJECT;
            }
        }
        coupling
    }

    /// (u(Q) - u(P)) / u(P) for the field of a conductor's edge near a node P, whose potential is known, and its neighbour Q:
    /// from either node to the other.
    fn slopes(&self, wedges: [&AtWedge; 2], nodes: [u32; 2]) -> [f64; 2] {
        let [a, b] = wedges;
        let nearest = if a.share > 0.0 { a.object } else { b.object };
        let has_one = a.object == b.object || a.share == 0.0 || b.share == 0.0;
        match self.fields[usize::from(nearest)].of_box().filter(|_| has_one) {
            Some((angles, half)) => {
                let places = nodes.map(|node| self.mesh.nodes[node as usize]);
                let [p, q] = angles.before_each_other(half, places);
                let others = wedge_potentials(&p, &q);
                [0, 1].map(|end| others[end] / wedges[end].potential - 1.0)
            }
            None => [0, 1].map(|end| self.slope_from(wedges[end], [nodes[end], nodes[1 - end]])),
        }
    }

    /// The same for one node and one neighbour, by as much as the edge has of the node's share: before what is round there are no
    /// walls.
    fn slope_from(&self, wedge: &AtWedge, nodes: [u32; 2]) -> f64 {
        if wedge.share == 0.0 || wedge.of_edge == 0.0 {
            return 0.0;
        }
        let [from, to] = nodes.map(|node| self.mesh.nodes[node as usize]);
        let field = &self.fields[usize::from(wedge.object)];
        let [other] = match (field.of_box(), field) {
            (Some((angles, half)), _) => {
                let [[p, _], [q, _]] = angles.before_each_other(half, [from, to]);
                wedge_potentials(&[p], &[q])
            }
            (None, KnownField::Edges(angles)) => {
                let Some(angle) = angles.nearest(from) else { return 0.0 };
                let mut place = Places::<1>::ORIGIN;
                place.set(0, angle.coordinates()(to));
                place.potentials(angle.radius)
            }
            _ => return 0.0,
        };
        f64::from(wedge.of_edge) * (other / wedge.potential - 1.0)
    }
}
