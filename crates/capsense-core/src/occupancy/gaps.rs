//! Gaps between conductors that an edge leads across from one to the other.
//!
//! Where no node is in such a gap, no potential is solved for there, and what couples the two conductors is in no row of the
//! stiffness matrix: both ends of what is left of the edge are held. It is a capacitor of its own between the two, the edge's
//! weight over the part of it that the gap takes, as by the edge rule between two ends that conductors hold.

use super::coupling::{Coupling, EdgeRule};
use super::scene::Scene;
use super::{NO_OBJECT, Span};
use crate::capacitance::own_potential;
use crate::few::Few;
use crate::material::Material;

/// A capacitor between two conducting objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gap {
    /// The edge across it, and what multiplies the weight of that.
    pub(crate) edge: u32,
    pub(crate) factor: f64,
    /// The objects on either side.
    pub(crate) objects: [u16; 2],
}

/// Those of one frame, and working storage.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    found: Vec<Gap>,
    spans: Vec<(u16, Span)>,
    on_the_way: Vec<(u16, Span)>,
    breaks: Vec<f64>,
}

impl Gaps {
    /// In the order of edges.
    pub(super) fn found(&self) -> &[Gap] {
        &self.found
    }

    /// Looks at all edges with links; where there are no two conductors of which one finds its own potential, at none.
    pub(super) fn find(
        &mut self,
        scene: &Scene<'_>,
        holders: &[u16],
        couplings: &Few<Coupling>,
        linked: &[u32],
    ) {
        self.found.clear();
        if !are_of_use(scene.materials) {
            return;
        }
        for &edge in linked {
            let ends = scene.mesh.edges.ends_of_existing(edge as usize);
            let owners = ends.map(|node| holders[node as usize]);
            if couplings.get(edge as usize).meets_two(owners) {
                scene.find_spans(ends, &mut self.spans);
                self.add(edge, owners, scene);
            }
        }
    }

    /// Adds the gaps along an edge, from the conductors up to some place on it to the next. Those that overlap touch.
    fn add(&mut self, edge: u32, owners: [u16; 2], scene: &Scene<'_>) {
        let Self { found, spans, on_the_way, breaks } = self;
        let (materials, background) = (scene.materials, scene.mesh.permittivity.at(edge as usize));
        let rule = EdgeRule { owners, spans, materials, background };
        on_the_way.clear();
        on_the_way.extend(rule.conductors());
        for (owner, end) in owners.into_iter().zip([0.0, 1.0]) {
            // Rounding may have it that what holds a node does not meet the edge.
            if owner != NO_OBJECT && on_the_way.iter().all(|(object, _)| *object != owner) {
                on_the_way.push((owner, Span { enter: end, exit: end }));
            }
        }
        on_the_way
            .sort_unstable_by(|(first, a), (second, b)| a.enter.total_cmp(&b.enter).then(first.cmp(second)));
        let Some((&(mut last, Span { mut exit, .. }), others)) = on_the_way.split_first() else { return };
        for &(object, span) in others {
            let factor = rule.only_through(exit, span.enter, breaks).through;
            found.push(Gap { edge, factor, objects: [last, object] });
            if span.exit > exit {
                (last, exit) = (object, span.exit);
            }
        }
    }
}

/// What is between conductors at 0 V does not matter.
fn are_of_use(materials: &[Material]) -> bool {
    let conductors = materials.iter().filter(|material| matches!(material, Material::Conductor(_)));
    conductors.count() > 1 && materials.iter().any(|material| own_potential(material).is_some())
}
