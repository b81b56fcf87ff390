//! What one frame asks of its objects: which conductor holds a node, and what an edge passes through.

use super::coupling::touches;
use super::near_field::{KnownField, PlateEnds};
use super::{Contact, EdgeGeometry, NO_OBJECT, Span, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Background, Edges};
use crate::sensor::{FREE, GROUND, Terminal};
use glam::DVec3;

/// Where everything is in one frame.
pub(super) struct Scene<'a> {
    pub(super) mesh: EdgeGeometry<'a>,
    pub(super) materials: &'a [Material],
    pub(super) surfaces: &'a dyn Surfaces,
    pub(super) bounds: &'a [Aabb],
    /// What is known of the field around each object.
    pub(super) fields: &'a [KnownField],
    /// What the ends of each object change, if it is a plate, and whether any do.
    pub(super) ends: &'a [PlateEnds],
    pub(super) has_ends: bool,
    /// The relative permittivity of each cell of a lattice without objects, where it is known not to be the same everywhere.
    pub(super) cells: Option<&'a Background>,
    /// Whether there are dielectrics that are taken along lines.
    pub(super) has_lines: bool,
    /// Whether surfaces are exact and the mesh is a lattice, so that walls of conductors are looked for.
    pub(super) has_silhouettes: bool,
    /// Whether a camera sees conductors or strong dielectrics on a lattice.
    pub(super) has_camera_walls: bool,
    /// Whether nodes where a lattice ends stand for the space beyond.
    pub(super) has_open_wall: bool,
}

impl Scene<'_> {
    pub(super) fn is_conductor(&self, object: usize) -> bool {
        matches!(self.materials[object], Material::Conductor(_))
    }

    pub(super) fn has_conductors(&self) -> bool {
        (0..self.materials.len()).any(|object| self.is_conductor(object))
    }

    pub(super) fn has_only_conductors(&self) -> bool {
        (0..self.materials.len()).all(|object| self.is_conductor(object))
    }

    /// The conductor that holds a node.
    pub(super) fn holder(&self, node: usize) -> u16 {
        if self.mesh.terminals[node] != FREE {
            return NO_OBJECT;
        }
        let point = self.mesh.nodes[node];
        let holder = (0..self.materials.len()).find(|&object| {
            self.is_conductor(object)
                && self.bounds[object].contains(point)
                && self.surfaces.contains(object, point)
        });
        holder.map_or(NO_OBJECT, |object| object as u16)
    }

    /// Collects the objects that an edge passes through, in the order in which they are listed.
    #[inline]
    pub(super) fn find_spans(&self, ends: [u32; 2], spans: &mut Vec<(u16, Span)>) {
        self.find_spans_between(ends.map(|node| self.mesh.nodes[node as usize]), spans);
    }

    #[inline]
    pub(super) fn find_spans_between(&self, [a, b]: [DVec3; 2], spans: &mut Vec<(u16, Span)>) {
        let around = Aabb { min: a.min(b), max: a.max(b) };
        spans.clear();
        for (object, bounds) in self.bounds.iter().enumerate() {
            if bounds.intersects(&around)
                && let Some(span) = self.span(object, a, b)
            {
                spans.push((object as u16, span));
            }
        }
    }

    /// The part of a segment that is in an object.
    #[inline(always)]
    pub(super) fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        match self.fields[object].of_box() {
            Some((angles, half)) => angles.span_in_box(half, a, b),
            None => self.surfaces.span(object, a, b),
        }
    }

    /// What multiplies the weight of an edge near ends of plates.
    pub(super) fn end_factor(&self, edge: usize) -> f64 {
        match self.mesh.edges {
            Edges::Lattice(lattice) if self.has_ends => {
                let ends = self.ends.iter().filter(|ends| ends.are_of_use);
                ends.map(|ends| ends.factor(lattice, edge, self.bounds)).product()
            }
            _ => 1.0,
        }
    }

    /// Whether an end of an edge is on an electrode.
    #[inline]
    pub(super) fn is_at_electrode(&self, ends: [u32; 2]) -> bool {
        ends.into_iter().any(|node| is_electrode(self.mesh.terminals[node as usize]))
    }

    /// Electrodes at the ends of an edge with the conductors that touch them there.
    pub(super) fn contacts<'b>(
        &'b self,
        ends: [u32; 2],
        spans: &'b [(u16, Span)],
    ) -> impl Iterator<Item = Contact> + 'b {
        let terminals = ends.map(|node| self.mesh.terminals[node as usize]);
        let touching = spans.iter().filter(|(object, _)| self.is_conductor(usize::from(*object)));
        touching.flat_map(move |&(object, span)| {
            let touched = terminals.into_iter().zip(touches(span));
            let electrodes = touched.filter(move |&(terminal, touched)| touched && is_electrode(terminal));
            electrodes.map(move |(terminal, _)| Contact {
                object: usize::from(object),
                electrode: usize::from(terminal) - 1,
            })
        })
    }
}

pub(super) fn is_electrode(terminal: Terminal) -> bool {
    terminal != FREE && terminal != GROUND
}
