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
use crate::sensor::{FREE, Terminal};
use coupling::EdgeRule;
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
    /// The two nodes of each edge.
    pub ends: &'a [[u32; 2]],
    /// Mean relative permittivity of the background around each edge.
    pub permittivity: &'a [f64],
}

/// Marks a node that lies in no conductor.
pub const NO_OBJECT: u16 = u16::MAX;

/// What the objects of one frame do to nodes and edges, and what changed since the frame before.
#[derive(Clone, Debug)]
pub struct Occupancy {
    conductor: Vec<u16>,
    through: Vec<f64>,
    links: Vec<Link>,
    changed_edges: Vec<u32>,
    changed_nodes: Vec<u32>,
    scratch: Scratch,
}

/// Storage that is kept from frame to frame so that an update allocates nothing once it has grown.
#[derive(Clone, Debug, Default)]
struct Scratch {
    bounds: Vec<Aabb>,
    /// Objects whose bounds meet the edge at hand, with their spans.
    spans: Vec<(u16, Span)>,
    breaks: Vec<f64>,
    old_links: Vec<Link>,
    node_changed: Vec<bool>,
}

impl Occupancy {
    /// Nothing is occupied.
    pub fn empty(nodes: usize, edges: usize) -> Self {
        Self {
            conductor: vec![NO_OBJECT; nodes],
            through: vec![1.0; edges],
            links: Vec::new(),
            changed_edges: Vec::with_capacity(edges),
            changed_nodes: Vec::with_capacity(nodes),
            scratch: Scratch { node_changed: vec![false; nodes], ..Scratch::default() },
        }
    }

    /// Moves to the next frame. Of two conductors that overlap the first listed wins, a conductor wins over a
    /// dielectric, and nodes with a terminal keep it.
    pub fn update(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &impl Surfaces) {
        self.scratch.bounds.clear();
        self.scratch.bounds.extend((0..materials.len()).map(|object| surfaces.bounds(object)));
        self.update_nodes(mesh, materials, surfaces);
        self.update_edges(mesh, materials, surfaces);
    }

    fn update_nodes(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &impl Surfaces) {
        for &node in &self.changed_nodes {
            self.scratch.node_changed[node as usize] = false;
        }
        self.changed_nodes.clear();
        for (node, &point) in mesh.nodes.iter().enumerate() {
            if mesh.terminals[node] != FREE {
                continue;
            }
            let owner = (0..materials.len()).find(|&object| {
                matches!(materials[object], Material::Conductor(_))
                    && self.scratch.bounds[object].contains(point)
                    && surfaces.contains(object, point)
            });
            let owner = owner.map_or(NO_OBJECT, |object| object as u16);
            if owner != self.conductor[node] {
                self.conductor[node] = owner;
                self.changed_nodes.push(node as u32);
                self.scratch.node_changed[node] = true;
            }
        }
    }

    fn update_edges(&mut self, mesh: EdgeGeometry<'_>, materials: &[Material], surfaces: &impl Surfaces) {
        let scratch = &mut self.scratch;
        std::mem::swap(&mut self.links, &mut scratch.old_links);
        self.links.clear();
        self.changed_edges.clear();
        let mut old_links = scratch.old_links.iter().peekable();
        for (edge, &ends) in mesh.ends.iter().enumerate() {
            let [a, b] = ends.map(|node| mesh.nodes[node as usize]);
            let edge_bounds = Aabb { min: a.min(b), max: a.max(b) };
            scratch.spans.clear();
            for (object, bounds) in scratch.bounds.iter().enumerate() {
                if bounds.intersects(&edge_bounds)
                    && let Some(span) = surfaces.span(object, a, b)
                {
                    scratch.spans.push((object as u16, span));
                }
            }
            let rule = EdgeRule {
                owners: ends.map(|node| self.conductor[node as usize]),
                spans: &mut scratch.spans,
                materials,
                background: mesh.permittivity[edge],
            };
            let coupling = rule.coupling(&mut scratch.breaks);
            let first_link = self.links.len();
            self.links.extend(coupling.links(edge as u32, ends));
            let relinked = take_links_of(&mut old_links, edge as u32).ne(self.links[first_link..].iter());
            let moved = ends.iter().any(|&node| scratch.node_changed[node as usize]);
            if relinked || moved || coupling.through.to_bits() != self.through[edge].to_bits() {
                self.through[edge] = coupling.through;
                self.changed_edges.push(edge as u32);
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

    /// Links from nodes to objects, ordered by edge.
    pub fn links(&self) -> &[Link] {
        &self.links
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

/// Takes those links off the front of an ordered sequence that belong to one edge.
fn take_links_of<'a>(
    links: &mut std::iter::Peekable<std::slice::Iter<'a, Link>>,
    edge: u32,
) -> impl Iterator<Item = &'a Link> {
    std::iter::from_fn(move || links.next_if(|link| link.edge == edge))
}
