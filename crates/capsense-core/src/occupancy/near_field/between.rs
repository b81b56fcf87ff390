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
        if !is_free {
            // To a node in the conductor the edge itself is what others are linked by.
            coupling.through *= 1.0 - f64::from(wedges[0].share.max(wedges[1].share));
        }
        for end in 0..2 {
            let AtWedge { object, share, link, potential, .. } = *wedges[end];
            coupling.factor[end] *= 1.0 - f64::from(share);
            if share > 0.0 {
                // The link was found for what surfaces on the edge make of it.
                if is_free && covered.through != cut.through {
                    let slope = self.slope_from(object, potential, [ends[end], ends[1 - end]]);
                    coupling.factor[end] += f64::from(share) * (covered.through - cut.through) * slope;
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

    /// (u(Q) - u(P)) / u(P) for the field of a conductor's edge near a node P, whose potential is known, and its neighbour Q.
    fn slope_from(&self, object: u16, potential: f64, nodes: [u32; 2]) -> f64 {
        let [from, to] = nodes.map(|node| self.mesh.nodes[node as usize]);
        let field = &self.fields[usize::from(object)];
        let other = match (field.of_box(), field) {
            (Some((angles, half)), _) => {
                let [p, q] = angles.before_of_box(half, from, to);
                let [other] = wedge_potentials(&[p], &[q]);
                other
            }
            (None, KnownField::Edges(angles)) => {
                let Some(angle) = angles.nearest(from) else { return 0.0 };
                let mut place = Places::<1>::ORIGIN;
                place.set(0, angle.coordinates(to));
                let [other] = place.potentials(angle.radius);
                other
            }
            _ => return 0.0,
        };
        other / potential - 1.0
    }
}
