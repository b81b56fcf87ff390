//! Which nodes lie in which object, and how objects change the mesh edges that their surfaces cut.
//!
//! The edge rule is the ghost-fluid idea of Gibou, Fedkiw et al. on a network: along an edge, the parts in air and in
//! dielectrics are capacitors in series, and a conductor ends the edge where its surface is.

mod coupling;
mod depth;

pub use coupling::{Coupling, Link, SMALLEST_PART};
pub use depth::{DepthLayers, InvalidDepth, OrthographicView};

use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::Edges;
use crate::sensor::{FREE, GROUND, Terminal};
use coupling::{EdgeRule, touches};
use glam::DVec3;

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
    pub permittivity: &'a [f64],
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
#[derive(Clone, Debug)]
pub struct Occupancy {
    conductor: Vec<u16>,
    through: Vec<f64>,
    links: Vec<Link>,
    changed_edges: Vec<u32>,
    changed_nodes: Vec<u32>,
    contacts: Vec<Contact>,
    scratch: Scratch,
}

/// Storage that is kept from frame to frame so that an update allocates nothing once it has grown.
#[derive(Clone, Debug)]
struct Scratch {
    /// Where each object is, and where it was in the frame before.
    bounds: Vec<Aabb>,
    old_bounds: Vec<Aabb>,
    /// Objects whose bounds meet the edge at hand, with their spans.
    spans: Vec<(u16, Span)>,
    breaks: Vec<f64>,
    old_links: Vec<Link>,
    node_changed: Vec<bool>,
    /// The frame in which each node and edge was last looked at; regions of several objects overlap.
    node_seen: Vec<u32>,
    edge_seen: Vec<u32>,
    frame: u32,
}

impl Scratch {
    /// Where an object is or was.
    fn region(&self, object: usize) -> Aabb {
        let (now, before) = (self.bounds[object], self.old_bounds[object]);
        Aabb { min: now.min.min(before.min), max: now.max.max(before.max) }
    }
}

impl Occupancy {
    /// Nothing is occupied.
    pub fn empty(nodes: usize, edges: usize) -> Self {
        Self {
            conductor: vec![NO_OBJECT; nodes],
            through: vec![1.0; edges],
            links: Vec::new(),
            changed_edges: Vec::new(),
            changed_nodes: Vec::new(),
            contacts: Vec::new(),
            scratch: Scratch {
                bounds: Vec::new(),
                old_bounds: Vec::new(),
                spans: Vec::new(),
                breaks: Vec::new(),
                old_links: Vec::new(),
                node_changed: vec![false; nodes],
                node_seen: vec![0; nodes],
                edge_seen: vec![0; edges],
                frame: 0,
            },
        }
    }

    /// Moves to the next frame. Of two conductors that overlap the first listed wins, a conductor wins over a
    /// dielectric, and nodes with a terminal keep it. Only nodes and edges near where an object is or was are visited.
    pub fn update(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &impl Surfaces) {
        let scratch = &mut self.scratch;
        std::mem::swap(&mut scratch.bounds, &mut scratch.old_bounds);
        scratch.bounds.clear();
        scratch.bounds.extend((0..materials.len()).map(|object| surfaces.bounds(object)));
        scratch.old_bounds.resize(materials.len(), Aabb::EMPTY);
        scratch.frame = scratch.frame.wrapping_add(1);
        for &node in &self.changed_nodes {
            scratch.node_changed[node as usize] = false;
        }
        std::mem::swap(&mut self.links, &mut scratch.old_links);
        self.changed_nodes.clear();
        self.changed_edges.clear();
        self.links.clear();
        self.contacts.clear();
        for object in 0..materials.len() {
            self.update_nodes(self.scratch.region(object), mesh, materials, surfaces);
        }
        for object in 0..materials.len() {
            self.update_edges(self.scratch.region(object), mesh, materials, surfaces);
        }
        // Sums over links must not depend on where objects were before.
        self.links.sort_unstable_by_key(|link| (link.edge, link.node));
        self.compare_links();
        self.changed_edges.sort_unstable();
        self.changed_edges.dedup();
        self.changed_nodes.sort_unstable();
        self.contacts.sort_unstable();
        self.contacts.dedup();
    }

    fn update_nodes(
        &mut self,
        region: Aabb,
        mesh: EdgeGeometry<'_>,
        materials: &[Material],
        surfaces: &impl Surfaces,
    ) {
        let Scratch { bounds, node_seen, node_changed, frame, .. } = &mut self.scratch;
        mesh.edges.for_nodes_near(mesh.nodes, &region, |node| {
            if mesh.terminals[node] != FREE || std::mem::replace(&mut node_seen[node], *frame) == *frame {
                return;
            }
            let point = mesh.nodes[node];
            let owner = (0..materials.len()).find(|&object| {
                matches!(materials[object], Material::Conductor(_))
                    && bounds[object].contains(point)
                    && surfaces.contains(object, point)
            });
            let owner = owner.map_or(NO_OBJECT, |object| object as u16);
            if owner != self.conductor[node] {
                self.conductor[node] = owner;
                self.changed_nodes.push(node as u32);
                node_changed[node] = true;
            }
        });
    }

    fn update_edges(
        &mut self,
        region: Aabb,
        mesh: EdgeGeometry<'_>,
        materials: &[Material],
        surfaces: &impl Surfaces,
    ) {
        let Scratch { bounds, spans, breaks, node_changed, edge_seen, frame, .. } = &mut self.scratch;
        mesh.edges.for_edges_near(mesh.nodes, &region, |edge, ends| {
            if std::mem::replace(&mut edge_seen[edge], *frame) == *frame {
                return;
            }
            let [a, b] = ends.map(|node| mesh.nodes[node as usize]);
            let edge_bounds = Aabb { min: a.min(b), max: a.max(b) };
            let owners = ends.map(|node| self.conductor[node as usize]);
            spans.clear();
            for (object, bounds) in bounds.iter().enumerate() {
                if bounds.intersects(&edge_bounds)
                    && let Some(span) = surfaces.span(object, a, b)
                {
                    spans.push((object as u16, span));
                }
            }
            for &(object, span) in spans.iter() {
                let object = usize::from(object);
                if matches!(materials[object], Material::Conductor(_)) {
                    let terminals = ends.map(|node| mesh.terminals[node as usize]);
                    note_contacts(&mut self.contacts, object, terminals, touches(span));
                }
            }
            let rule = EdgeRule { owners, spans, materials, background: mesh.permittivity[edge] };
            let coupling = rule.coupling(breaks);
            self.links.extend(coupling.links(edge as u32, ends));
            let moved = ends.iter().any(|&node| node_changed[node as usize]);
            if moved || coupling.through.to_bits() != self.through[edge].to_bits() {
                self.through[edge] = coupling.through;
                self.changed_edges.push(edge as u32);
            }
        });
    }

    /// Edges whose links are others than in the frame before changed too. Both lists are in the order of the edges.
    fn compare_links(&mut self) {
        let (mut old, mut new) = (self.scratch.old_links.iter().peekable(), self.links.iter().peekable());
        while let Some(edge) = old.peek().into_iter().chain(new.peek()).map(|link| link.edge).min() {
            if !take_links_of(&mut old, edge).eq(take_links_of(&mut new, edge)) {
                self.changed_edges.push(edge);
                while old.next_if(|link| link.edge == edge).is_some() {}
                while new.next_if(|link| link.edge == edge).is_some() {}
            }
        }
    }

    /// The conducting object that holds each node; [`NO_OBJECT`] for the others.
    pub fn conductors(&self) -> &[u16] {
        &self.conductor
    }

    /// What multiplies each edge's weight.
    pub fn through(&self) -> &[f64] {
        &self.through
    }

    /// Links from nodes to objects, ordered by edge and node.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Conducting objects that touch electrodes, in increasing order.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Edges that are coupled differently than in the frame before, in increasing order.
    pub fn changed_edges(&self) -> &[u32] {
        &self.changed_edges
    }

    /// Nodes that belong to another conductor, or none, than in the frame before, in increasing order.
    pub fn changed_nodes(&self) -> &[u32] {
        &self.changed_nodes
    }
}

/// Notes the electrodes at those ends of an edge that an object touches; most repeat what was noted last.
fn note_contacts(contacts: &mut Vec<Contact>, object: usize, terminals: [Terminal; 2], touched: [bool; 2]) {
    for (terminal, touched) in terminals.into_iter().zip(touched) {
        if touched && terminal != FREE && terminal != GROUND {
            let contact = Contact { object, electrode: usize::from(terminal) - 1 };
            if contacts.last() != Some(&contact) {
                contacts.push(contact);
            }
        }
    }
}

/// Takes those links off the front of an ordered sequence that belong to one edge.
fn take_links_of<'a>(
    links: &mut std::iter::Peekable<std::slice::Iter<'a, Link>>,
    edge: u32,
) -> impl Iterator<Item = &'a Link> {
    std::iter::from_fn(move || links.next_if(|link| link.edge == edge))
}
