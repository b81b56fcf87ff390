//! Which nodes lie in which object, and how objects change the mesh edges that their surfaces cut.
//!
//! The edge rule is the ghost-fluid idea of Gibou, Fedkiw et al. on a network: along an edge, the parts in air and in
//! dielectrics are capacitors in series, and a conductor ends the edge where its surface is. The other interface models,
//! which fill whole elements, are told in [`Interface`].

mod bars;
mod between_faces;
mod camera_wall;
mod changes;
mod comparison;
mod coupling;
mod crossing;
mod depth;
mod edges_anew;
mod edges_near;
mod elements;
mod filled;
mod fraction;
mod gaps;
mod half_pixels;
mod index_set;
mod interface;
mod near_field;
mod parallel;
mod pixel_row;
mod replaced;
mod scene;
mod silhouette;
mod sorted;
mod surfaces;
mod unresolved;
mod unstructured;

pub use bars::{BARS, Bars, Fill, OfBars};
pub(crate) use bars::{OnAxis, of_bars};
pub(crate) use between_faces::{LEAST_REACH, keep_between, within};
pub use changes::{Earlier, Regions};
pub use coupling::{Coupling, SMALLEST_PART};
pub use depth::{DepthLayers, InvalidDepth, OrthographicView};
pub(crate) use index_set::IndexList;
pub use interface::Interface;
pub use near_field::{RightAngle, RightAngled, RightAngles, Round, may_change_weights};
pub(crate) use near_field::{either, larger, smaller, span_in_box};
pub use surfaces::{Frame, LayerWall, LayerWay, LayersWithin, Side, Span, Surfaces};
pub(crate) use unresolved::unresolved;

use crate::few::Few;
use crate::material::Material;
use crate::mesh::{Background, Edges, TetMesh};
use crate::sensor::Terminal;
use crate::workers::Workers;
use camera_wall::CameraWalls;
use changes::Changes;
use edges_anew::{EdgesAnew, Sight};
use edges_near::EdgesNear;
use elements::Elements;
use filled::Filled;
pub(crate) use gaps::Gap;
use gaps::Gaps;
use glam::DVec3;
use index_set::IndexSet;
use near_field::Wedges;
use parallel::Beside;
use replaced::{KnownEdges, Replaced};
use scene::Scene;
use sorted::SortedList;
use unstructured::Unstructured;
pub(crate) use unstructured::may_be_immersed;

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
    /// Most edges are plain.
    couplings: Few<Coupling>,
    linked_edges: SortedList<u32>,
    changed_edges: Vec<u32>,
    /// What is replaced of these, in the same order.
    replaced: Replaced,
    changed_nodes: Vec<u32>,
    touches: SortedList<Touch>,
    contacts: Vec<Contact>,
    gaps: Gaps,
    changes: Changes,
    scratch: Scratch,
    /// What fills elements, if the interface model is one of these.
    elements: Option<Box<Elements>>,
    /// What becomes of edges if the mesh is no lattice.
    unstructured: Option<Box<Unstructured>>,
    /// What nodes of a lattice make of edges of conductors.
    wedges: Wedges,
    /// What walls that a camera sees leave of edges of a lattice.
    camera_walls: CameraWalls,
    /// Whether the wall of the sensor is open.
    has_open_wall: bool,
    /// The relative permittivity of each cell of a lattice, where dielectrics are to know of it.
    cells: Option<Background>,
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
    edges_anew: EdgesAnew,
    node_changed: Vec<bool>,
    /// Edges that are to be looked at.
    edges: EdgesNear,
    /// Edges around which something differs. If they are not among those above, surfaces cut them as before.
    around: IndexSet,
    /// Whether an object meets an edge, or more than what is on it tells what it is without what is around it.
    is_met: Vec<bool>,
    /// The frame in which each edge was last looked at.
    edge_seen: Vec<u8>,
    frame: u8,
    /// What edges of the frame before depend on.
    dependence: Dependence,
}

/// Whether edges depend on what is beside them, or along a camera's rays.
#[derive(Clone, Copy, Debug, Default)]
struct Dependence {
    beside: Beside,
    on_rays: bool,
}

impl Scratch {
    /// What edges depend on now or did in the frame before: what was left beside surfaces there goes with them.
    fn depend(&mut self, beside: Beside, on_rays: bool) -> Dependence {
        let before = std::mem::replace(&mut self.dependence, Dependence { beside, on_rays });
        Dependence { beside: before.beside.max(beside), on_rays: before.on_rays || on_rays }
    }
}

impl Occupancy {
    /// Nothing is occupied; surfaces will cut edges.
    pub fn empty(nodes: usize, edges: usize) -> Self {
        Self {
            conductor: vec![NO_OBJECT; nodes],
            couplings: Few::of(edges, Coupling::PLAIN),
            linked_edges: SortedList::new(),
            changed_edges: Vec::new(),
            replaced: Replaced::default(),
            changed_nodes: Vec::new(),
            touches: SortedList::new(),
            contacts: Vec::new(),
            gaps: Gaps::default(),
            changes: Changes::default(),
            scratch: Scratch {
                edges_anew: EdgesAnew::default(),
                node_changed: vec![false; nodes],
                edges: EdgesNear::below(edges),
                around: IndexSet::below(edges),
                is_met: vec![false; edges],
                edge_seen: vec![0; edges],
                frame: 0,
                dependence: Dependence::default(),
            },
            elements: None,
            unstructured: None,
            wedges: Wedges::default(),
            camera_walls: CameraWalls::below(nodes, edges),
            has_open_wall: false,
            cells: None,
        }
    }

    /// The same where dielectrics are to take the place of the background of each cell of a lattice, which is not the same
    /// everywhere; otherwise they take that of its mean around edges. Nothing for other meshes.
    #[must_use]
    pub fn with_background(self, mesh: &TetMesh, edges: &Edges) -> Self {
        let permittivity = mesh.relative_permittivity();
        let is_of_use = matches!(edges, Edges::Lattice(_)) && !permittivity.is_uniform();
        // Six tetrahedra are a cell.
        let cells = is_of_use.then(|| Background::new(permittivity.iter().step_by(6).collect()));
        Self { cells, ..self }
    }

    /// The same where weights of edges on the wall of a lattice stand for the space beyond it, as those of a sensor with
    /// [`Wall::Open`](crate::sensor::Wall::Open) do.
    #[must_use]
    pub fn with_open_wall(self) -> Self {
        Self { has_open_wall: true, ..self }
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

    /// The same where weak dielectrics are to cut elements, for a mesh and its edges that [`Occupancy::with_weights`] was told of.
    /// `edges` should be those along which elements weigh anything, as others keep to the edge rule. Nothing for a lattice.
    #[must_use]
    pub fn with_immersed_elements(mut self, mesh: &TetMesh, edges: &Edges) -> Self {
        if let Some(unstructured) = &mut self.unstructured {
            unstructured.immerse(mesh, edges);
        }
        self
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
        self.update_with(&Workers::default(), mesh, materials, surfaces);
    }

    /// The same, by threads that share the edges.
    pub(crate) fn update_with(
        &mut self,
        workers: &Workers,
        mesh: EdgeGeometry<'_>,
        materials: &[Material],
        surfaces: &dyn Surfaces,
    ) {
        self.start_frame();
        self.changes.find(&mesh, materials, surfaces);
        let (changes, cells) = (std::mem::take(&mut self.changes), std::mem::take(&mut self.cells));
        let beside = parallel::reach(mesh.edges, materials, surfaces.are_exact());
        let has_silhouettes = surfaces.are_exact() && matches!(mesh.edges, Edges::Lattice(_));
        let (bounds, fields, ends) = (changes.bounds(), changes.fields(), changes.ends());
        let has_camera_walls = camera_wall::is_of_use(mesh.edges, materials, surfaces);
        let scene = Scene {
            mesh,
            materials,
            surfaces,
            bounds,
            fields,
            ends,
            has_ends: has_silhouettes && ends.iter().any(|ends| ends.are_of_use),
            cells: cells.as_ref(),
            has_lines: beside != Beside::Nowhere,
            has_silhouettes,
            has_camera_walls,
            has_open_wall: self.has_open_wall,
        };
        let dependence = self.scratch.depend(beside, has_camera_walls);
        if let Some(mut elements) = self.elements.take() {
            self.update_elements(&scene, changes.regions(), &mut elements);
            self.elements = Some(elements);
        } else {
            let mut edges = std::mem::take(&mut self.scratch.edges);
            let mark_edges = || edges.mark(workers, &mesh, &changes, dependence.beside);
            let find_holders =
                || changes.for_nodes_near(&mesh, |node| self.set_holder(node, scene.holder(node)));
            workers.both(mark_edges, find_holders);
            self.scratch.edges = edges;
            if dependence.on_rays {
                self.camera_walls.start(workers, &scene, changes.planes());
            }
            let mut wedges = std::mem::take(&mut self.wedges);
            wedges.update(workers, &scene, changes.around_edges(), &self.conductor);
            self.update_edges(workers, &scene, dependence, &wedges);
            self.wedges = wedges;
        }
        self.update_unstructured(workers, &scene, changes.around_edges());
        self.replaced.exchange(&mut self.couplings);
        self.replaced.couplings.sort_unstable_by_key(|(edge, _)| *edge);
        self.changed_edges.extend(self.replaced.couplings.iter().map(|(edge, _)| *edge));
        self.changed_nodes.sort_unstable();
        self.replaced.linked.drain(..).for_each(|edge| self.linked_edges.add(edge));
        if self.replaced.links_lost || self.linked_edges.grows() {
            let couplings = &self.couplings;
            self.linked_edges.merge(|&edge| couplings.get(edge as usize).is_linked());
        }
        self.gaps.find(&scene, &self.conductor, &self.couplings, self.linked_edges.items());
        (self.changes, self.cells) = (changes, cells);
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

    /// Applies the edge rule to all edges that may have changed.
    fn update_edges(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        dependence: Dependence,
        wedges: &Wedges,
    ) {
        let mut edges = std::mem::take(&mut self.scratch.edges);
        let mut around = std::mem::take(&mut self.scratch.around);
        wedges.add_changed_edges(scene.mesh.edges, &self.conductor, &self.couplings, &mut around);
        let mut walls = std::mem::take(&mut self.camera_walls);
        if dependence.on_rays {
            let (marked, couplings) = (edges.marked(), &self.couplings);
            // Of edges along the rays, only those through a face have taps beside them.
            let may_differ = |edge| edge % 3 != camera_wall::RAYS || couplings.has_own(edge);
            let matters = |edge| !marked.contains(edge) && may_differ(edge);
            walls.finish(workers, scene, matters, |edge| around.insert(edge));
        }
        let mut anew = std::mem::take(&mut self.scratch.edges_anew);
        let conductor = std::mem::take(&mut self.conductor);
        let sight = Sight { scene, wedges, walls: &walls, conductor: &conductor };
        anew.start(workers, &mut self.replaced);
        let sets = [edges.marked(), &mut around];
        let mut unstructured = self.unstructured.take();
        match &mut unstructured {
            Some(unstructured) => anew.tell_all(workers, sight, sets, self.known().0, unstructured),
            None => anew.take_all(workers, sight, sets, self.known().0),
        }
        self.unstructured = unstructured;
        walls.keep(anew.cuts());
        anew.replaced().for_each(|replaced| self.replaced.append(replaced));
        for (edge, contact) in anew.contacts() {
            self.touches.add(Touch { place: edge, contact });
        }
        self.conductor = conductor;
        (self.scratch.edges, self.scratch.around, self.scratch.edges_anew) = (edges, around, anew);
        self.camera_walls = walls;
    }

    /// What is known of all edges, and what was replaced.
    fn known(&mut self) -> (KnownEdges<'_>, &mut Replaced) {
        let Scratch { is_met, edge_seen, node_changed, frame, .. } = &mut self.scratch;
        let known = KnownEdges {
            first: 0,
            couplings: &self.couplings,
            is_met,
            seen: edge_seen,
            moved: (!self.changed_nodes.is_empty()).then_some(node_changed),
            frame: *frame,
        };
        (known, &mut self.replaced)
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

    /// What is left of an edge.
    ///
    /// # Panics
    /// When there is no such edge.
    pub fn coupling(&self, edge: usize) -> &Coupling {
        self.couplings.get(edge)
    }

    /// What is left of each edge.
    pub fn couplings(&self) -> impl ExactSizeIterator<Item = &Coupling> {
        (0..self.couplings.len()).map(|edge| self.couplings.get(edge))
    }

    /// Edges that are not plain, in increasing order.
    pub(crate) fn coupled_edges(&self) -> impl Iterator<Item = (usize, &Coupling)> {
        self.couplings.all_own()
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
        told.unwrap_or(self.coupling(edge).through)
    }

    /// The edges of which links are left, in increasing order.
    pub fn linked_edges(&self) -> &[u32] {
        self.linked_edges.items()
    }

    /// Gaps between two conducting objects without a node in them, in the order of their edges.
    pub(crate) fn gaps(&self) -> &[Gap] {
        self.gaps.found()
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
        &self.replaced.couplings
    }

    /// Nodes that belong to another conductor, or none, than in the frame before, in increasing order.
    pub fn changed_nodes(&self) -> &[u32] {
        &self.changed_nodes
    }
}
