//! Edges near which a box has no surface but a face, or two that are opposite: most of those that a flat body is near.
//!
//! What of lines is in the body then follows from where they are along one axis of it. Quarters that are alike there are told once: where the
//! face is level, all four around an edge that is normal to it, and two each around one along it. Lines tell the same, to the bit, as when all
//! faces are asked.

use super::around::{QUARTERS, Quarters};
use super::lines::{Faces, InFrame};
use super::strong::PassedBy;
use super::{Fill, Scene, SideBySide, Span};
use crate::instructions::vectorised_by_eight;

/// A quarter where lines are all that counts, and what multiplies its weight. Others that are like it have the same.
#[derive(Clone, Copy)]
struct Seen {
    /// How far it is from the edge along the axis across the faces, by either way.
    offset: [f64; 2],
    background: f64,
    through: f64,
}

impl Scene<'_> {
    /// What multiplies the weight of an edge that one solid alone is near, and no other surface of it than these faces.
    pub(super) fn along_faces(
        &self,
        (edge, lines): (usize, SideBySide),
        (body, faces): (&InFrame<'_>, Faces),
        quarters: &Quarters,
        on_edge: &[(u16, Span)],
    ) -> Option<f64> {
        let mut seen = [None; QUARTERS];
        vectorised_by_eight(
            #[inline(always)]
            || {
                self.mean_over_quarters(
                    edge,
                    quarters,
                    #[inline(always)]
                    |number, background| {
                        let quarter = &quarters[number];
                        let offset = body.offset_on_axis(quarter, faces.axis);
                        let is_alike =
                            |other: &&Seen| (other.offset, other.background) == (offset, background);
                        if let Some(alike) = seen.iter().flatten().find(is_alike) {
                            return Some(alike.through);
                        }
                        let fill = body.fill_between(faces, offset);
                        let through = if fill.part == Fill::NOTHING.part {
                            1.0
                        } else {
                            let ratio = self.ratio(body.object, background)?;
                            if let Some(strength) = self.strength_beside(body.object, on_edge, background) {
                                let passed_by =
                                    self.passed_by_strong(strength, &body.lines(quarter, None), &fill);
                                return Some(lines.through_filled(&fill, ratio, passed_by));
                            }
                            lines.through_filled(&fill, ratio, PassedBy::LINES_ALONE)
                        };
                        seen[number] = Some(Seen { offset, background, through });
                        Some(through)
                    },
                )
            },
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::{Around, Met};
    use super::*;
    use crate::geometry::{Pose, Shape};
    use crate::material::{Material, RelativePermittivity};
    use crate::mesh::{Background, Edges, Lattice};
    use crate::occupancy::near_field::KnownField;
    use crate::occupancy::{EdgeGeometry, NO_OBJECT, Surfaces};
    use crate::sensor::FREE;
    use crate::solids::Solids;
    use glam::{DQuat, DVec3};
    use proptest::prelude::*;

    /// Planes of a lattice at unequal distances.
    fn planes() -> Vec<f64> {
        [0.0, 0.1, 0.25, 0.35, 0.5, 0.55, 0.7, 0.9, 1.0].to_vec()
    }

    /// What a number of edges tell of a box of some permittivity, and how many of these have nothing but faces near: as a box that is
    /// known to be one, and as any body.
    fn ask(rotation: DQuat, place: DVec3, permittivity: f64, of_cells: bool) -> usize {
        let lattice = Lattice::new([planes(), planes(), planes()]).unwrap();
        let nodes = lattice.to_tet_mesh().unwrap().nodes().to_vec();
        let cells: Vec<f64> = (0..512).map(|cell| if cell / 64 < 4 { 2.0 } else { 1.0 }).collect();
        let cells = of_cells.then(|| Background::new(cells));
        let terminals = vec![FREE; nodes.len()];
        let edges = Edges::Lattice(lattice.clone());
        let background = Background::new(vec![1.0; edges.len()]);
        let mesh =
            EdgeGeometry { nodes: &nodes, terminals: &terminals, edges: &edges, permittivity: &background };
        let mut solids = Solids::new(&[Shape::Box { size: DVec3::new(0.8, 0.7, 0.3) }]).unwrap();
        solids.place(&[Pose { translation: place, rotation }]).unwrap();
        let materials = [Material::Dielectric(RelativePermittivity::new(permittivity).unwrap())];
        let bounds = [solids.bounds(0)];
        let known = [KnownField::around(&solids, 0)];
        let scene = |fields| Scene {
            mesh,
            materials: &materials,
            surfaces: &solids,
            bounds: &bounds,
            fields,
            ends: &[],
            has_ends: false,
            cells: cells.as_ref(),
            has_lines: true,
            has_silhouettes: true,
            has_camera_walls: false,
            has_open_wall: false,
        };
        let [known, any] = [&known[..], &[KnownField::None]].map(scene);
        let (mut spans, mut beside, mut breaks) = (Vec::new(), Vec::new(), Vec::new());
        let mut by_faces = 0;
        for edge in 0..edges.len() {
            let (Some(around), Some(ends)) = (Around::edge(&lattice, edge), edges.ends(edge)) else {
                continue;
            };
            known.find_spans(ends, &mut spans);
            let mut ask = |scene: &Scene<'_>| {
                scene.along_lines((edge, ends), [NO_OBJECT; 2], &spans, &mut beside, &mut breaks)
            };
            let (found, expected) = (ask(&known), ask(&any));
            let through = |found: Option<super::super::ByLines>| found.map(|found| found.through.to_bits());
            assert_eq!(through(found), through(expected), "{edge} {spans:?} {found:?} {expected:?}");
            let is_by_faces = matches!(known.in_frame(0, &around).met(), Met::Faces(_));
            by_faces += usize::from(found.is_some() && is_by_faces);
            if found.is_some_and(|found| found.is_far_from_edges) {
                // Up to the next edges.
                let (mut bounds, middle) = (around.bounds(), around.from);
                for axis in around.across {
                    bounds.min[axis] -= middle[axis] - bounds.min[axis];
                    bounds.max[axis] += bounds.max[axis] - middle[axis];
                }
                assert!(!solids.has_edge_in(0, &bounds), "{edge}");
            }
        }
        by_faces
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn faces_tell_what_all_surfaces_tell(
            yaw in prop_oneof![Just(0.0), -3.0..3.0],
            tilt in prop_oneof![2 => Just(0.0), 1 => -0.3..0.3],
            place in [0.4..0.6, 0.4..0.6, 0.3..0.7],
            permittivity in prop_oneof![Just(80.0), Just(3.0)],
            of_cells: bool,
        ) {
            let rotation = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(tilt);
            prop_assert!(ask(rotation, DVec3::from_array(place), permittivity, of_cells) > 20);
        }
    }
}
