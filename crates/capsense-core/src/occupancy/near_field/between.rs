//! What nodes near edges of conductors make of the edges between them.

use super::box_field::BoxField;
use super::field::Places;
use super::{AtWedge, CARRIER, KnownField, Row, Stars};
use crate::occupancy::coupling::Coupling;
use crate::occupancy::{NO_OBJECT, Scene};

impl Scene<'_> {
    /// What is left of an edge of the lattice if nodes near edges of conductors are at its ends. `cut` is what surfaces on
    /// the edge make of it, `covered` what walls make of it as well.
    pub(in super::super) fn between_wedges(
        &self,
        stars: &Stars,
        (edge, ends): (usize, [u32; 2]),
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
        for end in 0..2 {
            let AtWedge { object, share, link, .. } = *wedges[end];
            coupling.factor[end] *= 1.0 - f64::from(share);
            if share > 0.0 {
                if is_free && missing != 0.0 {
                    coupling.factor[end] += f64::from(share)
                        * missing
                        * self.slope_from(stars, wedges[end], [ends[end], ends[1 - end]]);
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

    /// (u(Q) - u(P)) / u(P) for the field of a conductor's edge near a node P, whose potential is known, and its neighbour Q, by as much as
    /// the edge has of the node's share: before what is round there are no walls, but for ends of slim cylinders, where what they take is left out.
    fn slope_from(&self, stars: &Stars, wedge: &AtWedge, nodes: [u32; 2]) -> f64 {
        if wedge.of_edge == 0.0 {
            return 0.0;
        }
        let [from, to] = nodes.map(|node| self.mesh.nodes[node as usize]);
        let field = &self.fields[usize::from(wedge.object)];
        let other = match (field.of_box(), field) {
            (Some((angles, half)), _) => {
                let star = stars.at(nodes[0] as usize, &mut Row::default());
                BoxField::seen_from(&star, angles, half).potential(to)
            }
            (None, KnownField::Edges(angles)) => {
                let Some(angle) = angles.nearest(from) else { return 0.0 };
                let mut place = Places::<1>::ORIGIN;
                place.set(0, angle.coordinates()(to));
                let [potential] = place.potentials(angle.radius);
                potential
            }
            _ => return 0.0,
        };
        f64::from(wedge.of_edge) * (other / wedge.potential - 1.0)
    }
}
