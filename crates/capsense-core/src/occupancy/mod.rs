//! Which nodes lie in which object, and how objects change the mesh edges that their surfaces cut.
//!
//! The edge rule is the ghost-fluid idea of Gibou, Fedkiw et al. on a network: along an edge, the parts in air and in
//! dielectrics are capacitors in series, and a conductor ends the edge where its surface is. The other interface models,
//! which fill whole elements, are told in [`Interface`].

mod changes;
mod comparison;
mod coupling;
mod crossing;
mod depth;
mod elements;
mod fraction;
mod index_set;
mod interface;
mod near_field;
mod parallel;
mod scene;
mod silhouette;
mod sorted;
mod surfaces;
mod unresolved;
mod unstructured;

pub use changes::{Earlier, Regions};
pub use coupling::{Coupling, SMALLEST_PART};
pub use depth::{DepthLayers, InvalidDepth, OrthographicView};
pub(crate) use index_set::IndexList;
pub use interface::Interface;
pub use near_field::{RightAngle, RightAngled, RightAngles, Round};
pub use surfaces::{Frame, Span, Surfaces};
pub(crate) use unresolved::unresolved;

use crate::material::Material;
use crate::mesh::{Background, Edges, TetMesh};
use crate::sensor::Terminal;
use changes::Changes;
use coupling::EdgeRule;
use elements::Elements;
use glam::DVec3;
use index_set::IndexSet;
use near_field::{Row, Wedges};
use scene::Scene;
use sorted::SortedList;
use unstructured::{HeldEdge, Unstructured};

/// The nodes and edges that objects are to be found on.
#[derive(Clone, Copy, Debug)]
pub struct EdgeGeometry<'a> {
    /// Node positions in the sensor frame.
    pub nodes: &'a [DVec3],
    /// Terminal of each node without objects; nodes that have one keep it.
    pub terminals: &'a [Terminal],
    /// The mesh edges.
    pub edges: &'a Edges,
    /// Mean relative permittivity of the background around each edge.
    pub permittivity: &'a Background,
}

/// Marks a node that lies in no conductor.
pub const NO_OBJECT: u16 = u16::MAX;

/// A conducting object that touches or covers an electrode: a short circuit. The capacitance that the mesh has between
/// the two follows from [`SMALLEST_PART`] and the size of its cells alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Contact {
    /// Index of the object.
    pub object: usize,
    /// Index of the electrode.
    pub electrode: usize,
}

/// What the objects of one frame do to nodes and edges, and what changed since the frame before.
///
/// All of it is a function of the present frame, whatever the frames before; only its cost is that of what changed.
#[derive(Clone, Debug)]
pub struct Occupancy {
    conductor: Vec<u16>,
    couplings: Vec<Coupling>,
    linked_edges: SortedList<u32>,
    changed_edges: Vec<u32>,
    /// Edges and couplings before that changed, in the same order.
    replaced: Vec<(u32, Coupling)>,
    changed_nodes: Vec<u32>,
    touches: SortedList<Touch>,
    contacts: Vec<Contact>,
    changes: Changes,
    scratch: Scratch,
    /// What fills elements, if the interface model is one of these.
    elements: Option<Box<Elements>>,
    /// What becomes of edges if the mesh is no lattice.
    unstructured: Option<Box<Unstructured>>,
    /// What nodes of a lattice make of edges of conductors.
    wedges: Wedges,
}

/// An edge at whose end, or an element at whose corner, a conducting object touches an electrode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Touch {
    place: u32,
    contact: Contact,
}

/// Storage that is kept from frame to frame so that an update allocates nothing once it has grown.
#[derive(Clone, Debug)]
struct Scratch {
    /// Objects that the edge at hand passes through.
    spans: Vec<(u16, Span)>,
    /// The same for lines parallel to it.
    beside: Vec<(u16, Span)>,
    breaks: Vec<f64>,
    row: Row,
    node_changed: Vec<bool>,
    /// Edges that are to be looked at.
    edges: IndexSet,
    /// Edges around which something differs. If they are not among those above, surfaces cut them as before.
    around: IndexSet,
    /// Whether an object meets an edge, or more than what is on it tells what it is without what is around it.
    is_met: Vec<bool>,
    /// The frame in which each edge was last looked at.
    edge_seen: Vec<u8>,
    frame: u8,
    /// Whether edges of the frame before depend on what is beside them.
    looked_beside: bool,
}

impl Occupancy {
    /// Nothing is occupied; surfaces will cut edges.
    pub fn empty(nodes: usize, edges: usize) -> Self {
        Self {
            conductor: vec![NO_OBJECT; nodes],
            couplings: vec![Coupling::PLAIN; edges],
            linked_edges: SortedList::new(),
            changed_edges: Vec::new(),
            replaced: Vec::new(),
            changed_nodes: Vec::new(),
            touches: SortedList::new(),
            contacts: Vec::new(),
            changes: Changes::default(),
            scratch: Scratch {
                spans: Vec::new(),
                beside: Vec::new(),
                breaks: Vec::new(),
                row: Row::default(),
                node_changed: vec![false; nodes],
                edges: IndexSet::below(edges),
                around: IndexSet::below(edges),
                is_met: vec![false; edges],
                edge_seen: vec![0; edges],
                frame: 0,
                looked_beside: false,
            },
            elements: None,
            unstructured: None,
            wedges: Wedges::default(),
        }
    }

    /// The same for the edge rule on a mesh that is no lattice, whose edges have these weights: what negative ones are to
    /// conductors, and, if `are_scaled`, to dielectrics and several conductors. A lattice has none.
    #[must_use]
    pub fn with_weights(self, mesh: &TetMesh, edges: &Edges, weights: &[f64], are_scaled: bool) -> Self {
        let unstructured = match (edges, &self.elements) {
            (Edges::List(_), None) => Some(Box::new(Unstructured::new(mesh, edges, weights, are_scaled))),
            _ => None,
        };
        Self { unstructured, ..self }
    }

    /// Nothing is occupied; `interface` tells what surfaces will do. `edges` are those along which elements weigh
    /// anything: for models that fill elements, those of [`EdgeNetwork::of_sensor_elements`].
    ///
    /// [`EdgeNetwork::of_sensor_elements`]: crate::stiffness::EdgeNetwork::of_sensor_elements
    pub fn with_interface(interface: Interface, mesh: &TetMesh, edges: &Edges) -> Self {
        let elements = match interface {
            Interface::EdgeCut => None,
            Interface::Centroid | Interface::VolumeFraction => {
                Some(Box::new(Elements::new(interface, mesh, edges)))
            }
        };
        Self { elements, ..Self::empty(mesh.nodes().len(), edges.len()) }
    }

    /// Moves to the next frame, on the same mesh as all frames before. Of two conductors that overlap the first listed
    /// wins, a conductor wins over a dielectric, and nodes with a terminal keep it. Only nodes and edges near where an
    /// object's surface is another than in the frame before are visited.
    pub fn update(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &dyn Surfaces) {
        self.start_frame();
        self.changes.find(&mesh, materials, surfaces);
        let changes = std::mem::take(&mut self.changes);
        let has_weak = parallel::is_of_use(mesh.edges, materials);
        let has_silhouettes = surfaces.are_exact() && matches!(mesh.edges, Edges::Lattice(_));
        let (bounds, fields) = (changes.bounds(), changes.fields());
        let has_faces = parallel::may_hold_edges(mesh.edges, materials, surfaces);
        let scene = Scene { mesh, materials, surfaces, bounds, fields, has_weak, has_silhouettes, has_faces };
        // What was left beside surfaces in the frame before goes with them.
        let looks_beside = has_weak || has_faces;
        let looks_beside = std::mem::replace(&mut self.scratch.looked_beside, looks_beside) || looks_beside;
        let mut links_lost = false;
        if let Some(mut elements) = self.elements.take() {
            self.update_elements(&scene, changes.regions(), &mut elements);
            self.elements = Some(elements);
        } else {
            for region in changes.regions() {
                mesh.edges.for_nodes_near(mesh.nodes, region, |node| {
                    self.set_holder(node, scene.holder(node));
                });
            }
            let mut wedges = std::mem::take(&mut self.wedges);
            wedges.update(&scene, changes.around_edges(), &self.conductor);
            links_lost = self.update_edges(&scene, &changes, looks_beside, &wedges);
            self.wedges = wedges;
        }
        links_lost |= self.update_unstructured(&scene, changes.around_edges());
        self.changes = changes;
        self.replaced.sort_unstable_by_key(|(edge, _)| *edge);
        self.changed_edges.extend(self.replaced.iter().map(|(edge, _)| *edge));
        self.changed_nodes.sort_unstable();
        if links_lost || self.linked_edges.grows() {
            let couplings = &self.couplings;
            self.linked_edges.merge(|&edge| couplings[edge as usize].is_linked());
        }
        self.update_contacts();
    }

    fn start_frame(&mut self) {
        let scratch = &mut self.scratch;
        scratch.frame = scratch.frame.wrapping_add(1);
        if scratch.frame == 0 {
            // After 255 frames, numbers come again.
            scratch.edge_seen.fill(0);
            self.elements.iter_mut().for_each(|elements| elements.forget_frames());
            scratch.frame = 1;
        }
        for &node in &self.changed_nodes {
            scratch.node_changed[node as usize] = false;
        }
        self.changed_nodes.clear();
        self.changed_edges.clear();
        self.replaced.clear();
    }

    fn set_holder(&mut self, node: usize, holder: u16) {
        if holder != self.conductor[node] {
            self.conductor[node] = holder;
            self.changed_nodes.push(node as u32);
            self.scratch.node_changed[node] = true;
        }
    }

    /// Applies the edge rule to all edges that may have changed, and returns whether one had a link and has none now.
    fn update_edges(
        &mut self,
        scene: &Scene<'_>,
        changes: &Changes,
        looks_beside: bool,
        wedges: &Wedges,
    ) -> bool {
        let mesh = &scene.mesh;
        let mut edges = std::mem::take(&mut self.scratch.edges);
        for region in changes.regions() {
            mesh.edges.for_edges_near(mesh.nodes, region, |edge, _| edges.insert(edge));
        }
        for region in changes.regions().iter().filter(|_| looks_beside) {
            let around = parallel::up_to_planes(mesh.edges, region);
            mesh.edges.for_edges_near(mesh.nodes, &around, |edge, _| edges.insert(edge));
        }
        let mut around = std::mem::take(&mut self.scratch.around);
        wedges.add_changed_edges(mesh.edges, &self.conductor, &self.couplings, &mut around);
        let mut links_lost = false;
        edges.drain_with(&mut around, |edge, is_cut_anew| {
            let ends = mesh.edges.ends_of_existing(edge);
            links_lost |= if is_cut_anew || scene.has_weak || self.scratch.is_met[edge] {
                self.update_edge(scene, wedges, edge, ends)
            } else {
                self.scratch.spans.clear();
                self.update_around(scene, wedges, (edge, ends), [NO_OBJECT; 2], Coupling::PLAIN)
            };
        });
        (self.scratch.edges, self.scratch.around) = (edges, around);
        links_lost
    }

    /// Applies the edge rule to an edge and returns whether it had a link and has none now.
    fn update_edge(&mut self, scene: &Scene<'_>, wedges: &Wedges, edge: usize, ends: [u32; 2]) -> bool {
        let Scratch { spans, beside, breaks, edge_seen, frame, is_met, .. } = &mut self.scratch;
        edge_seen[edge] = *frame;
        scene.find_spans(ends, spans);
        for contact in scene.contacts(ends, spans) {
            self.touches.add(Touch { place: edge as u32, contact });
        }
        let owners = ends.map(|node| self.conductor[node as usize]);
        let is_free = owners == [NO_OBJECT; 2];
        let parallel = scene.has_weak.then(|| scene.along_lines(edge, owners, spans, beside, breaks));
        if let Some(through) = parallel.flatten() {
            is_met[edge] = true;
            return self.couple(edge, ends, Coupling::only_through(through));
        }
        let in_face = (scene.has_faces && is_free).then(|| scene.in_face(edge, spans, beside, breaks));
        let in_face = in_face.flatten();
        is_met[edge] = in_face.is_some() || !spans.is_empty() || !is_free;
        let cut = match in_face {
            Some(through) => Coupling::only_through(through),
            None => {
                let background = scene.mesh.permittivity.at(edge);
                EdgeRule { owners, spans, materials: scene.materials, background }.coupling(breaks)
            }
        };
        self.update_around(scene, wedges, (edge, ends), owners, cut)
    }

    /// Couples an edge by what the edge rule makes of it and what is around it, its spans being those found last, and
    /// returns whether it had a link and has none now.
    #[inline]
    fn update_around(
        &mut self,
        scene: &Scene<'_>,
        wedges: &Wedges,
        (edge, ends): (usize, [u32; 2]),
        owners: [u16; 2],
        cut: Coupling,
    ) -> bool {
        let covered = if wedges.may_be_beside(ends, owners) {
            let Scratch { spans, beside, breaks, row, .. } = &mut self.scratch;
            let star = wedges.star(ends[0] as usize, row);
            scene.at_silhouette((edge, &star), owners, spans, beside, breaks, cut)
        } else {
            cut
        };
        let coupling = match wedges.between(ends) {
            Some(wedges) => scene.between_wedges(edge, ends, wedges, owners, cut, covered),
            None => covered,
        };
        if let Some(unstructured) = &mut self.unstructured {
            let is_moved = ends.iter().any(|&node| self.scratch.node_changed[node as usize]);
            unstructured.take(HeldEdge { edge, owners }, ends, is_moved, coupling);
            return false;
        }
        self.couple(edge, ends, coupling)
    }

    /// Couples an edge and returns whether it had a link and has none now.
    fn couple(&mut self, edge: usize, ends: [u32; 2], coupling: Coupling) -> bool {
        let node_changed = &self.scratch.node_changed;
        let before = self.couplings[edge];
        let moved = !self.changed_nodes.is_empty() && ends.iter().any(|&node| node_changed[node as usize]);
        let is_other = !coupling.is(&before);
        if moved || is_other {
            self.replaced.push((edge as u32, before));
        }
        if is_other {
            self.couplings[edge] = coupling;
        }
        if coupling.is_linked() && !before.is_linked() {
            self.linked_edges.add(edge as u32);
        }
        before.is_linked() && !coupling.is_linked()
    }

    /// Contacts last where no edge, or no element, was looked at again.
    fn update_contacts(&mut self) {
        if self.touches.items().is_empty() && !self.touches.grows() {
            return;
        }
        let Scratch { edge_seen, frame, .. } = &self.scratch;
        let seen = self.elements.as_ref().map_or(&edge_seen[..], |elements| elements.seen());
        self.touches.merge(|touch| seen[touch.place as usize] != *frame);
        self.contacts.clear();
        self.contacts.extend(self.touches.items().iter().map(|touch| touch.contact));
        self.contacts.sort_unstable();
        self.contacts.dedup();
    }

    /// The conducting object that holds each node; [`NO_OBJECT`] for the others.
    pub fn conductors(&self) -> &[u16] {
        &self.conductor
    }

    /// What is left of each edge.
    pub fn couplings(&self) -> &[Coupling] {
        &self.couplings
    }

    /// Whether objects scale weights of any sign, rather than those of capacitors alone.
    pub fn scales_negative_weights(&self) -> bool {
        self.elements.is_some() || self.unstructured.is_some()
    }

    /// Relative permittivity of each element, in conductors that without objects, and the conductor that it belongs to
    /// or [`NO_OBJECT`]; `None` when surfaces cut edges.
    pub fn elements(&self) -> Option<(&[f64], &[u16])> {
        self.elements.as_ref().map(|elements| (elements.permittivity(), elements.conductors()))
    }

    /// By what factor the permittivity along an edge is raised: what multiplies its weight, but for weights that may be
    /// negative, where it is the mean factor of the elements around.
    pub(crate) fn contrast(&self, edge: usize) -> f64 {
        let told = match (&self.elements, &self.unstructured) {
            (Some(elements), _) => Some(elements.contrast(edge)),
            (None, Some(unstructured)) => unstructured.contrast(edge),
            _ => None,
        };
        told.unwrap_or(self.couplings[edge].through)
    }

    /// The edges of which links are left, in increasing order.
    pub fn linked_edges(&self) -> &[u32] {
        self.linked_edges.items()
    }

    /// Conducting objects that touch electrodes, in increasing order.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Edges that are coupled differently than in the frame before, in increasing order.
    pub fn changed_edges(&self) -> &[u32] {
        &self.changed_edges
    }

    /// The same with the couplings that they had.
    pub(crate) fn replaced_couplings(&self) -> &[(u32, Coupling)] {
        &self.replaced
    }

    /// Nodes that belong to another conductor, or none, than in the frame before, in increasing order.
    pub fn changed_nodes(&self) -> &[u32] {
        &self.changed_nodes
    }
}
