//! Interface models that fill elements: the permittivity of each element, and what that makes of edges and nodes.
//!
//! With linear elements the weight of an edge is Σ ε_e w_e over the elements e around it, w_e what each weighs in
//! vacuum. The sum is taken anew, always in the same order, when one of them changes, and stands as a factor of the
//! weight without objects. A conductor holds all nodes of its elements that no terminal holds.

use super::fraction::Fractions;
use super::{Contact, Coupling, Interface, NO_OBJECT, Occupancy, Scene, Touch};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Background, Bins, CANCELLED, EdgeShare, Edges, TetMesh, Tets};
use crate::sensor::{FREE, GROUND};
use glam::DVec3;

/// Stands in for the number of an edge that is none, because no element weighs anything along it.
pub(super) const NO_EDGE: u32 = u32::MAX;

/// From this filled part on, conductors take an element.
const HALF: f64 = 0.5;

/// The elements of a mesh, what fills them, and how they are connected.
#[derive(Clone, Debug)]
pub(super) struct Elements {
    interface: Interface,
    tables: Tables,
    /// Relative permittivity of each element; in conductors, that without objects.
    permittivity: Vec<f64>,
    /// The conductor that each element belongs to, or [`NO_OBJECT`].
    conductor: Vec<u16>,
    /// The frame in which each element, and each node, was last looked at.
    element_seen: Vec<u8>,
    node_seen: Vec<u8>,
    /// Elements that changed in this frame, and whether their conductor did.
    changed: Vec<(u32, bool)>,
    /// Electrodes at elements of conductors that were looked at in this frame.
    touches: Vec<Touch>,
    fractions: Fractions,
}

/// What never changes.
#[derive(Clone, Debug)]
struct Tables {
    tets: Tets,
    bins: Bins,
    /// Relative permittivity without objects.
    background: Background,
    /// The edges of each element.
    edges: Vec<[u32; 6]>,
    at_node: Lists<u32>,
    /// Elements around each edge and their weights along it in vacuum.
    at_edge: Lists<(u32, f64)>,
    /// The weight of each edge without objects.
    reference: Vec<f64>,
}

/// Many lists, one after the other.
#[derive(Clone, Debug)]
pub(super) struct Lists<T> {
    starts: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy + Default> Lists<T> {
    /// Sorts items into lists; in each they stay in order.
    pub(super) fn new(count: usize, items: impl Iterator<Item = (usize, T)> + Clone) -> Self {
        let mut starts = vec![0; count + 1];
        items.clone().for_each(|(list, _)| starts[list + 1] += 1);
        for list in 0..count {
            starts[list + 1] += starts[list];
        }
        let mut next = starts.clone();
        let mut sorted = vec![T::default(); starts[count] as usize];
        for (list, item) in items {
            sorted[next[list] as usize] = item;
            next[list] += 1;
        }
        Self { starts, items: sorted }
    }

    pub(super) fn of(&self, list: usize) -> &[T] {
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }
}

impl Tables {
    fn new(mesh: &TetMesh, edges: &Edges) -> Self {
        let tets = mesh.tets();
        let of_elements: Vec<[u32; 6]> = tets.iter().map(|tet| edges_of(tet, edges)).collect();
        let shares = of_elements.iter().enumerate().flat_map(|(element, of_element)| {
            let shares = EdgeShare::of_element(mesh.corners(element)).zip(of_element);
            let existing = shares.filter(|(_, edge)| **edge != NO_EDGE);
            existing.map(move |(share, &edge)| (edge as usize, (element as u32, share)))
        });
        let background = mesh.relative_permittivity();
        let (mut reference, mut magnitude) = (vec![0.0; edges.len()], vec![0.0; edges.len()]);
        for (edge, (element, share)) in shares.clone() {
            reference[edge] += background.at(element as usize) * share.weight;
            magnitude[edge] += background.at(element as usize) * share.magnitude;
        }
        for (reference, magnitude) in reference.iter_mut().zip(magnitude) {
            // As the network has it: such an edge weighs too little to matter, but not nothing.
            if f64::abs(*reference) <= CANCELLED * magnitude {
                *reference = CANCELLED * magnitude;
            }
        }
        let corners = tets.iter().zip(0..).flat_map(|(tet, e)| tet.map(|node| (node as usize, e)));
        Self {
            bins: Bins::new(tets.len(), |element| Aabb::around(mesh.corners(element))),
            background: background.clone(),
            at_node: Lists::new(mesh.nodes().len(), corners),
            at_edge: Lists::new(edges.len(), shares.map(|(edge, (e, share))| (edge, (e, share.weight)))),
            tets: tets.clone(),
            edges: of_elements,
            reference,
        }
    }

    fn corners(&self, element: usize, nodes: &[DVec3]) -> [DVec3; 4] {
        self.tets.at(element).map(|node| nodes[node as usize])
    }
}

/// The numbers of an element's six edges, in the order of [`EdgeShare::CORNERS`].
pub(super) fn edges_of(tet: [u32; 4], edges: &Edges) -> [u32; 6] {
    EdgeShare::CORNERS.map(|[i, j]| {
        let wanted = [tet[i].min(tet[j]), tet[i].max(tet[j])];
        let mut found = NO_EDGE;
        edges.for_edges_at(wanted[0] as usize, |edge, end| {
            if end == 0 && edges.ends(edge) == Some(wanted) {
                found = edge as u32;
            }
        });
        found
    })
}

impl Elements {
    pub(super) fn new(interface: Interface, mesh: &TetMesh, edges: &Edges) -> Self {
        let count = mesh.tets().len();
        Self {
            interface,
            tables: Tables::new(mesh, edges),
            permittivity: mesh.relative_permittivity().iter().collect(),
            conductor: vec![NO_OBJECT; count],
            element_seen: vec![0; count],
            node_seen: vec![0; mesh.nodes().len()],
            changed: Vec::new(),
            touches: Vec::new(),
            fractions: Fractions::default(),
        }
    }

    pub(super) fn permittivity(&self) -> &[f64] {
        &self.permittivity
    }

    pub(super) fn conductors(&self) -> &[u16] {
        &self.conductor
    }

    /// The frame in which each element was last looked at.
    pub(super) fn seen(&self) -> &[u8] {
        &self.element_seen
    }

    /// Frames are numbered from one again.
    pub(super) fn forget_frames(&mut self) {
        self.element_seen.fill(0);
        self.node_seen.fill(0);
    }

    /// Finds what fills the elements near a region, once in a frame.
    fn look_at(&mut self, scene: &Scene<'_>, region: &Aabb, frame: u8) {
        let Self { interface, tables, permittivity, conductor, element_seen, changed, .. } = self;
        tables.bins.for_boxes_near(region, |number| {
            let element = number as usize;
            if element_seen[element] == frame {
                return;
            }
            let corners = tables.corners(element, scene.mesh.nodes);
            let around = Aabb::around(corners);
            if !region.intersects(&around) {
                return;
            }
            element_seen[element] = frame;
            let background = tables.background.at(element);
            let (now, holder) = match interface {
                Interface::VolumeFraction => scene.mixed(corners, &around, background, &mut self.fractions),
                Interface::Centroid | Interface::EdgeCut => scene.at_centroid(corners, background),
            };
            let other_holder = holder != conductor[element];
            if other_holder || now.to_bits() != permittivity[element].to_bits() {
                permittivity[element] = now;
                conductor[element] = holder;
                changed.push((number, other_holder));
            }
            if holder != NO_OBJECT {
                let electrodes = tables.tets.at(element).map(|node| scene.mesh.terminals[node as usize]);
                let electrodes =
                    electrodes.into_iter().filter(|terminal| !matches!(*terminal, FREE | GROUND));
                self.touches.extend(electrodes.map(|terminal| {
                    let (object, electrode) = (usize::from(holder), usize::from(terminal) - 1);
                    Touch { place: number, contact: Contact { object, electrode } }
                }));
            }
        });
    }

    /// The conductor that holds a free node: of those whose elements meet there the first listed.
    fn holder(&self, node: usize) -> u16 {
        let around = self.tables.at_node.of(node).iter();
        around.fold(NO_OBJECT, |first, &element| first.min(self.conductor[element as usize]))
    }

    /// What multiplies an edge's weight without objects. Exactly 1 where no element around it is filled.
    fn through(&self, edge: usize) -> f64 {
        let (mut sum, mut is_plain) = (0.0, true);
        for &(element, weight) in self.tables.at_edge.of(edge) {
            let permittivity = self.permittivity[element as usize];
            is_plain &= permittivity == self.tables.background.at(element as usize);
            sum += permittivity * weight;
        }
        if is_plain { 1.0 } else { sum / self.tables.reference[edge] }
    }

    /// The mean of the permittivities around an edge in relation to that without objects, whatever the signs of weights.
    pub(super) fn contrast(&self, edge: usize) -> f64 {
        let around = self.tables.at_edge.of(edge).iter().map(|&(element, w)| (element as usize, w.abs()));
        let (now, without) = around.fold((0.0, 0.0), |(now, without), (element, weight)| {
            let background = self.tables.background.at(element);
            (now + self.permittivity[element] * weight, without + background * weight)
        });
        if without > 0.0 { now / without } else { 1.0 }
    }
}

impl Scene<'_> {
    /// Objects that win over those after them: conductors, then dielectrics, each in the order in which they are listed.
    fn by_rank(&self) -> impl Iterator<Item = usize> {
        let all = 0..self.materials.len();
        let conductors = all.clone().filter(|&object| self.is_conductor(object));
        conductors.chain(all.filter(|&object| !self.is_conductor(object)))
    }

    /// Permittivity and conductor of an element that belongs to the object at its centroid.
    fn at_centroid(&self, corners: [DVec3; 4], background: f64) -> (f64, u16) {
        let centroid = corners.iter().sum::<DVec3>() / 4.0;
        let owner = self.by_rank().find(|&object| {
            self.bounds[object].contains(centroid) && self.surfaces.contains_as_measured(object, centroid)
        });
        match owner.map(|object| (object, self.materials[object])) {
            None => (background, NO_OBJECT),
            Some((_, Material::Dielectric(permittivity))) => (permittivity.value(), NO_OBJECT),
            Some((object, Material::Conductor(_))) => (background, object as u16),
        }
    }

    /// Permittivity and conductor of an element with the mean permittivity of what fills it.
    fn mixed(
        &self,
        corners: [DVec3; 4],
        around: &Aabb,
        background: f64,
        fractions: &mut Fractions,
    ) -> (f64, u16) {
        let near = self.by_rank().filter(|&object| self.bounds[object].intersects(around));
        let span = |object: u16, a, b| self.surfaces.span(usize::from(object), a, b);
        let parts = fractions.of_element(corners, near.map(|object| object as u16), span);
        let (mut conducting, mut largest, mut empty, mut mixed) = (0.0, (NO_OBJECT, 0.0), 1.0, 0.0);
        for &(object, part) in parts {
            match self.materials[usize::from(object)] {
                Material::Conductor(_) => {
                    conducting += part;
                    if part > largest.1 {
                        largest = (object, part);
                    }
                }
                Material::Dielectric(permittivity) => {
                    empty -= part;
                    mixed += part * permittivity.value();
                }
            }
        }
        if conducting >= HALF {
            (background, largest.0)
        } else if mixed > 0.0 {
            // Rounding must not leave less than nothing empty.
            (f64::max(empty, 0.0) * background + mixed, NO_OBJECT)
        } else {
            (background, NO_OBJECT)
        }
    }
}

impl Occupancy {
    /// Finds what fills the elements in some regions, and what that changes.
    pub(super) fn update_elements(&mut self, scene: &Scene<'_>, regions: &[Aabb], elements: &mut Elements) {
        let frame = self.scratch.frame;
        elements.changed.clear();
        for region in regions {
            elements.look_at(scene, region, frame);
        }
        elements.touches.drain(..).for_each(|touch| self.touches.add(touch));
        let changed = std::mem::take(&mut elements.changed);
        for &(element, _) in changed.iter().filter(|(_, other_holder)| *other_holder) {
            for node in elements.tables.tets.at(element as usize).map(|node| node as usize) {
                let is_free = scene.mesh.terminals[node] == FREE;
                if is_free && std::mem::replace(&mut elements.node_seen[node], frame) != frame {
                    self.set_holder(node, elements.holder(node));
                }
            }
        }
        for &(element, _) in &changed {
            let edges = elements.tables.edges[element as usize].into_iter();
            edges.filter(|edge| *edge != NO_EDGE).for_each(|edge| {
                self.update_weight(edge as usize, scene.mesh.edges, elements);
            });
        }
        let moved = std::mem::take(&mut self.changed_nodes);
        for &node in &moved {
            scene.mesh.edges.for_edges_at(node as usize, |edge, _| {
                if scene.mesh.edges.ends(edge).is_some() {
                    self.update_weight(edge, scene.mesh.edges, elements);
                }
            });
        }
        self.changed_nodes = moved;
        elements.changed = changed;
    }

    /// Takes the weight of an edge anew, once in a frame.
    fn update_weight(&mut self, edge: usize, edges: &Edges, elements: &Elements) {
        let frame = self.scratch.frame;
        if std::mem::replace(&mut self.scratch.edge_seen[edge], frame) == frame {
            return;
        }
        let coupling = Coupling::only_through(elements.through(edge));
        let moved = |node: u32| self.scratch.node_changed[node as usize];
        if !coupling.is(self.couplings.get(edge)) || edges.ends_of_existing(edge).into_iter().any(moved) {
            self.replaced.couplings.push((edge as u32, coupling));
        }
    }
}
