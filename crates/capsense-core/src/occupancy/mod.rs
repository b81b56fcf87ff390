//! Which nodes lie in which object, and how objects change the mesh edges that their surfaces cut.
//!
//! The edge rule is the ghost-fluid idea of Gibou, Fedkiw et al. on a network: along an edge, the parts in air and in
//! dielectrics are capacitors in series, and a conductor ends the edge where its surface is.

mod changes;
mod comparison;
mod coupling;
mod crossing;
mod depth;
mod sorted;

pub use changes::{Earlier, Regions};
pub use coupling::{Coupling, SMALLEST_PART};
pub use depth::{DepthLayers, InvalidDepth, OrthographicView};

use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Background, Edges};
use crate::sensor::{FREE, GROUND, Terminal};
use changes::Changes;
use coupling::{EdgeRule, touches};
use glam::DVec3;
use sorted::SortedList;

/// The part of a segment from a (0) to b (1) that lies in an object: first entry and last exit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Where the segment first enters, in [0, 1].
    pub enter: f64,
    /// Where it last leaves, in [enter, 1].
    pub exit: f64,
}

/// Where objects are: answers for points and segments in the sensor frame.
pub trait Surfaces {
    /// Number of objects.
    fn objects(&self) -> usize;

    /// A box outside of which the object certainly is not; [`Aabb::EMPTY`] when it is not seen at all.
    fn bounds(&self, object: usize) -> Aabb;

    /// Whether a point lies inside an object.
    fn contains(&self, object: usize, point: DVec3) -> bool;

    /// The part of the segment from `a` to `b` that lies in an object; `None` when it passes by.
    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span>;

    /// Finds where answers may differ from those of an earlier frame, and has `before` remember this one instead.
    /// Returns whether that can be told; if not, all that is within the bounds of either frame is looked at again.
    fn find_changes(&self, before: &mut Earlier, _regions: &mut Regions) -> bool {
        before.forget();
        false
    }

    /// Whether these answers can be trusted at all; called once before any of them.
    ///
    /// # Errors
    /// Says what is no surface.
    fn validate(&self) -> Result<(), InvalidDepth> {
        Ok(())
    }
}

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
}

/// An edge at whose end a conducting object touches an electrode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Touch {
    edge: u32,
    contact: Contact,
}

/// Storage that is kept from frame to frame so that an update allocates nothing once it has grown.
#[derive(Clone, Debug)]
struct Scratch {
    /// Objects that the edge at hand passes through.
    spans: Vec<(u16, Span)>,
    breaks: Vec<f64>,
    node_changed: Vec<bool>,
    /// The frame in which each edge was last looked at; regions overlap.
    edge_seen: Vec<u8>,
    frame: u8,
}

/// Where everything is in one frame.
struct Scene<'a> {
    mesh: EdgeGeometry<'a>,
    materials: &'a [Material],
    surfaces: &'a dyn Surfaces,
    bounds: &'a [Aabb],
}

impl Scene<'_> {
    fn is_conductor(&self, object: usize) -> bool {
        matches!(self.materials[object], Material::Conductor(_))
    }

    /// The conductor that holds a node.
    fn holder(&self, node: usize) -> u16 {
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
    fn find_spans(&self, ends: [u32; 2], spans: &mut Vec<(u16, Span)>) {
        let [a, b] = ends.map(|node| self.mesh.nodes[node as usize]);
        let around = Aabb { min: a.min(b), max: a.max(b) };
        spans.clear();
        for (object, bounds) in self.bounds.iter().enumerate() {
            if bounds.intersects(&around)
                && let Some(span) = self.surfaces.span(object, a, b)
            {
                spans.push((object as u16, span));
            }
        }
    }

    /// Electrodes at the ends of an edge with the conductors that touch them there.
    fn contacts<'b>(
        &'b self,
        ends: [u32; 2],
        spans: &'b [(u16, Span)],
    ) -> impl Iterator<Item = Contact> + 'b {
        let terminals = ends.map(|node| self.mesh.terminals[node as usize]);
        let of_electrode = move |terminal: Terminal| terminal != FREE && terminal != GROUND;
        let touching = spans.iter().filter(|(object, _)| self.is_conductor(usize::from(*object)));
        touching.flat_map(move |&(object, span)| {
            let touched = terminals.into_iter().zip(touches(span));
            let electrodes = touched.filter(move |&(terminal, touched)| touched && of_electrode(terminal));
            electrodes.map(move |(terminal, _)| Contact {
                object: usize::from(object),
                electrode: usize::from(terminal) - 1,
            })
        })
    }
}

impl Occupancy {
    /// Nothing is occupied.
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
                breaks: Vec::new(),
                node_changed: vec![false; nodes],
                edge_seen: vec![0; edges],
                frame: 0,
            },
        }
    }

    /// Moves to the next frame, on the same mesh as all frames before. Of two conductors that overlap the first listed
    /// wins, a conductor wins over a dielectric, and nodes with a terminal keep it. Only nodes and edges near where an
    /// object's surface is another than in the frame before are visited.
    pub fn update(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &dyn Surfaces) {
        self.start_frame();
        self.changes.find(&mesh, materials, surfaces);
        let changes = std::mem::take(&mut self.changes);
        let scene = Scene { mesh, materials, surfaces, bounds: changes.bounds() };
        for region in changes.regions() {
            mesh.edges.for_nodes_near(mesh.nodes, region, |node| self.update_node(&scene, node));
        }
        let mut links_lost = false;
        for region in changes.regions() {
            mesh.edges.for_edges_near(mesh.nodes, region, |edge, ends| {
                links_lost |= self.update_edge(&scene, edge, ends);
            });
        }
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
            scratch.frame = 1;
        }
        for &node in &self.changed_nodes {
            scratch.node_changed[node as usize] = false;
        }
        self.changed_nodes.clear();
        self.changed_edges.clear();
        self.replaced.clear();
    }

    fn update_node(&mut self, scene: &Scene<'_>, node: usize) {
        let holder = scene.holder(node);
        if holder != self.conductor[node] {
            self.conductor[node] = holder;
            self.changed_nodes.push(node as u32);
            self.scratch.node_changed[node] = true;
        }
    }

    /// Applies the edge rule to an edge and returns whether it had a link and has none now.
    fn update_edge(&mut self, scene: &Scene<'_>, edge: usize, ends: [u32; 2]) -> bool {
        let Scratch { spans, breaks, node_changed, edge_seen, frame } = &mut self.scratch;
        if std::mem::replace(&mut edge_seen[edge], *frame) == *frame {
            return false;
        }
        scene.find_spans(ends, spans);
        for contact in scene.contacts(ends, spans) {
            self.touches.add(Touch { edge: edge as u32, contact });
        }
        let rule = EdgeRule {
            owners: ends.map(|node| self.conductor[node as usize]),
            spans,
            materials: scene.materials,
            background: scene.mesh.permittivity.at(edge),
        };
        let coupling = rule.coupling(breaks);
        let before = std::mem::replace(&mut self.couplings[edge], coupling);
        let moved = !self.changed_nodes.is_empty() && ends.iter().any(|&node| node_changed[node as usize]);
        if moved || !coupling.is(&before) {
            self.replaced.push((edge as u32, before));
        }
        if coupling.is_linked() && !before.is_linked() {
            self.linked_edges.add(edge as u32);
        }
        before.is_linked() && !coupling.is_linked()
    }

    /// Contacts last where no edge was looked at again.
    fn update_contacts(&mut self) {
        if self.touches.items().is_empty() && !self.touches.grows() {
            return;
        }
        let Scratch { edge_seen, frame, .. } = &self.scratch;
        self.touches.merge(|touch| edge_seen[touch.edge as usize] != *frame);
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
