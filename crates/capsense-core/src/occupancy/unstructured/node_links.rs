//! What nodes are linked to conductors by beyond what each of their edges says.
//!
//! In front of a conductor's face the potential grows with the distance d from it, and this field satisfies the equation of
//! a node if the face is linked by Σ w/θ over the node's edges that it cuts at a part θ of their length, because over all
//! edges Σ w Δd = 0. Over all: without the edges of negative weight, opposite of obtuse angles, the face is somewhere else.
//! But there is no capacitor of negative weight to be cut. So the edge keeps the weight that it has if the conductor holds
//! its other end, and the node is linked by what is missing, as far as K stays positive definite ([`super::obtuse`]).
//!
//! Near an edge of a conductor all of a node's links together are what makes the field of a right angle satisfy the node's
//! equation, as on lattices ([`super::super::near_field`]), as far as edges are cut well ([`super::ending`]).
//!
//! Such a link is carried by the node's end of its heaviest edge.

use super::super::coupling::{Coupling, SMALLEST_PART};
use super::super::index_set::IndexList;
use super::super::near_field::{
    Cells, FAR_OFF_LATTICE, Near, Places, RightAngle, RoundNear, grown, part_within, resolved,
};
use super::super::{NO_OBJECT, Scene};
use super::ending::Ending;
use super::obtuse::Holder;
use super::{HeldEdge, Unstructured};
use crate::geometry::Aabb;
use crate::instructions::vectorised;
use crate::mesh::{Edges, TetMesh, signed_volume};
use crate::sensor::FREE;
use crate::workers::Workers;
use glam::DVec3;

/// Permittivities differ by less than this part of them where they are the same but for rounding.
const SAME: f64 = 1e-9;

/// No length is off by more than this part of it for rounding.
const OF_ROUNDING: f64 = 1e-9;

/// A node and most of its neighbours, whose potentials are computed at once.
const AROUND: usize = 16;

/// So many nodes keep a thread busy for ten times as long as it takes to hand them over.
const NODES_OF_A_TASK: usize = 64;

/// So many slabs for each thread, as nodes are closer to each other in some.
const SLABS_OF_A_THREAD: usize = 4;

/// The link of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
struct NodeLink {
    /// The conductor, or [`NO_OBJECT`].
    object: u16,
    /// In metres.
    weight: f64,
}

impl NodeLink {
    const NONE: Self = Self { object: NO_OBJECT, weight: 0.0 };
}

/// Cells of the same size in all directions.
struct CellsAround {
    node: DVec3,
    size: f64,
    /// Where the mesh ends.
    ends: Aabb,
}

impl Cells for CellsAround {
    fn far(&self) -> f64 {
        FAR_OFF_LATTICE
    }

    fn cells_to(&self, point: DVec3) -> f64 {
        (self.node.distance(point) / self.size).min(FAR_OFF_LATTICE)
    }

    fn reach(&self) -> DVec3 {
        DVec3::splat(FAR_OFF_LATTICE * self.size)
    }

    fn size_along(&self, _: DVec3) -> f64 {
        self.size
    }

    fn size_across(&self, _: DVec3) -> f64 {
        self.size
    }

    fn within(&self, place: DVec3, along: DVec3) -> f64 {
        let Aabb { min, max } = self.ends;
        let within = ((place - min).min(max - place) / self.size).clamp(DVec3::ZERO, DVec3::ONE);
        part_within(within, along)
    }
}

/// The links of all nodes.
#[derive(Clone, Debug)]
pub(super) struct NodeLinks {
    links: Vec<NodeLink>,
    /// The edge that carries each node's link.
    carrier: Vec<u32>,
    /// The edge of a cube as large as what each node has around it, in metres.
    cell: Vec<f64>,
    /// Where the mesh ends.
    ends: Aabb,
    /// From which ends each edge leads into conductors, a bit for each, and how many of each node's edges do from there.
    leads: Vec<u8>,
    leads_at: Vec<u32>,
    /// Nodes to be looked at again in this frame, and what becomes of their links.
    pending: IndexList,
    found: Vec<NodeLink>,
    /// Room for nodes that threads find near edges of conductors.
    near: Vec<Vec<u32>>,
}

/// What potentials of a node and its neighbours ask for, the neighbours one after the other.
struct Balance {
    own: f64,
    /// Sum of weights times potentials, and of weights.
    sum: f64,
    of_weights: f64,
    highest: f64,
}

impl Balance {
    fn of(own: f64) -> Self {
        Self { own, sum: 0.0, of_weights: 0.0, highest: own }
    }

    fn add(&mut self, weight: f64, potential: f64) {
        self.sum += weight * potential;
        self.of_weights += weight;
        self.highest = self.highest.max(potential);
    }

    /// Σ w (u(Q) - u(P)) / u(P).
    fn links(&self) -> f64 {
        self.sum / self.own.max(SMALLEST_PART * self.highest).max(f64::MIN_POSITIVE) - self.of_weights
    }
}

impl NodeLinks {
    pub(super) fn new(mesh: &TetMesh, edges: &Edges, weights: &[f64]) -> Self {
        let nodes = mesh.nodes().len();
        let heaviest = |node: usize| {
            let (mut most, mut carrier) = (f64::NEG_INFINITY, 0);
            edges.for_edges_at(node, |edge, _| {
                if weights[edge] > most {
                    (most, carrier) = (weights[edge], edge as u32);
                }
            });
            carrier
        };
        let longest = match edges {
            Edges::List(list) => list.longest(),
            Edges::Lattice(_) => f64::INFINITY,
        };
        let mut volume = vec![0.0; nodes];
        for (element, tet) in mesh.tets().iter().enumerate() {
            let share = 0.25 * signed_volume(mesh.corners(element));
            tet.iter().for_each(|&node| volume[node as usize] += share);
        }
        Self {
            links: vec![NodeLink::NONE; nodes],
            carrier: (0..nodes).map(heaviest).collect(),
            cell: volume.into_iter().map(|volume| volume.cbrt().min(longest)).collect(),
            ends: Aabb::around(mesh.nodes().iter().copied()),
            leads: vec![0; edges.len()],
            leads_at: vec![0; nodes],
            pending: IndexList::below(nodes),
            found: Vec::new(),
            near: Vec::new(),
        }
    }

    fn cells_at(&self, scene: &Scene<'_>, node: usize) -> CellsAround {
        CellsAround { node: scene.mesh.nodes[node], size: self.cell[node], ends: self.ends }
    }

    /// Notes that a node is to be looked at again.
    pub(super) fn look_at(&mut self, node: usize) {
        self.pending.insert(node);
    }

    /// Notes from which ends an edge leads into conductors.
    pub(super) fn note_leads(
        &mut self,
        HeldEdge { edge, owners }: HeldEdge,
        ends: [u32; 2],
        rule: &Coupling,
    ) {
        let leads = |end: usize| rule.object[end] != NO_OBJECT || owners[1 - end] != NO_OBJECT;
        let now = u8::from(leads(0)) | u8::from(leads(1)) << 1;
        let before = std::mem::replace(&mut self.leads[edge], now);
        if now != before {
            for (end, node) in ends.into_iter().enumerate() {
                let [before, now] = [before, now].map(|of| u32::from(of >> end & 1));
                self.leads_at[node as usize] += now;
                self.leads_at[node as usize] -= before;
            }
        }
    }

    /// Notes the nodes that edges of conductors in some boxes are near. Threads share the room around these.
    fn look_around(&mut self, workers: &Workers, scene: &Scene<'_>, regions: &[Aabb]) {
        if regions.is_empty() {
            return;
        }
        let all = Aabb::around(regions.iter().flat_map(|region| [region.min, region.max]));
        let Aabb { min, max } = grown(scene.mesh.edges, &all);
        let slabs = workers.tasks(SLABS_OF_A_THREAD);
        let mut near = std::mem::take(&mut self.near);
        near.resize_with(slabs, Vec::new);
        let height = |slab: usize| min.z + (max.z - min.z) * (slab as f64 / slabs as f64);
        let this = &*self;
        workers.for_each(near.iter_mut().enumerate(), |(slab, near)| {
            // A node between two is in both.
            let top = if slab + 1 == slabs { max.z } else { height(slab + 1) };
            let slab = Aabb { min: min.with_z(height(slab)), max: max.with_z(top) };
            scene.mesh.edges.for_nodes_near(scene.mesh.nodes, &slab, |node| {
                let point = scene.mesh.nodes[node];
                // Somewhat more than [`CellsAround::cells_to`] would have, which rounds otherwise: nodes may be looked at in vain.
                let reach = (1.0 + OF_ROUNDING) * FAR_OFF_LATTICE * this.cell[node];
                let is_near = |region: &Aabb| {
                    point.distance_squared(point.clamp(region.min, region.max)) <= reach * reach
                };
                if is_near(&all) && regions.iter().any(is_near) {
                    near.push(node as u32);
                }
            });
        });
        for node in near.iter_mut().flat_map(|near| near.drain(..)) {
            self.pending.insert(node as usize);
        }
        self.near = near;
    }
}

impl Unstructured {
    /// Links nodes anew where something changed, and notes the edges that carry these links.
    pub(super) fn update_links(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        around_edges: &[Aabb],
        conductors: &[u16],
    ) {
        self.links.look_around(workers, scene, around_edges);
        self.update_least_links(workers, scene, conductors);
        if workers.threads() == 1 {
            for at in 0..self.links.pending.numbers().len() {
                let node = self.links.pending.numbers()[at] as usize;
                let now = self.link(scene, node, conductors);
                self.take_link(node, now);
            }
        } else {
            self.share_links(workers, scene, conductors);
        }
        self.links.pending.clear();
    }

    /// Finds anew how little links may be, which depends on all edges of elements, and notes the nodes that feel it.
    fn update_least_links(&mut self, workers: &Workers, scene: &Scene<'_>, conductors: &[u16]) {
        let Self { pending, least, obtuse, links, rule, .. } = self;
        pending.numbers().iter().for_each(|&edge| least.look_at(obtuse, edge as usize));
        let holder = |node: u32| match (scene.mesh.terminals[node as usize], conductors[node as usize]) {
            (FREE, NO_OBJECT) => Holder::None,
            (FREE, conductor) => Holder::Conductor(conductor),
            _ => Holder::Sensor,
        };
        let of_element = |element: u32| obtuse.least_links(element, rule, holder);
        least.update(workers, obtuse, of_element, |node| links.pending.insert(node));
    }

    /// The links of all pending nodes, by threads that share them.
    fn share_links(&mut self, workers: &Workers, scene: &Scene<'_>, conductors: &[u16]) {
        let mut found = std::mem::take(&mut self.links.found);
        let nodes = self.links.pending.numbers();
        found.resize(nodes.len(), NodeLink::NONE);
        let tasks = nodes.chunks(NODES_OF_A_TASK).zip(found.chunks_mut(NODES_OF_A_TASK));
        workers.for_each(tasks, |(nodes, found)| {
            let link = |node: &u32| self.link(scene, *node as usize, conductors);
            found.iter_mut().zip(nodes).for_each(|(found, node)| *found = link(node));
        });
        for (at, &now) in found.iter().enumerate() {
            self.take_link(self.links.pending.numbers()[at] as usize, now);
        }
        self.links.found = found;
    }

    /// Takes over the link of a node, and notes the edge that carries it.
    fn take_link(&mut self, node: usize, now: NodeLink) {
        let before = std::mem::replace(&mut self.links.links[node], now);
        if before.object != now.object || before.weight.to_bits() != now.weight.to_bits() {
            self.pending.insert(self.links.carrier[node] as usize);
        }
    }

    /// What is left of an edge.
    pub(super) fn coupling(&self, held: HeldEdge, ends: [u32; 2]) -> Coupling {
        let mut coupling = self.without_links(held);
        for (end, node) in ends.into_iter().enumerate() {
            let NodeLink { object, weight } = self.links.links[node as usize];
            if object != NO_OBJECT && self.links.carrier[node as usize] as usize == held.edge {
                coupling.object[end] = object;
                coupling.factor[end] += weight / self.weights[held.edge];
            }
        }
        coupling
    }

    /// The conductor whose field is known at a node, that field, and its share in the node's links.
    fn nearest(&self, scene: &Scene<'_>, node: usize) -> Option<(usize, Near, f64)> {
        let cells = self.links.cells_at(scene, node);
        let mut near = None;
        let (object, share) = scene.nearest(node, &cells, |object| {
            let (field, share) = scene.near(object, node, &cells)?;
            near = Some(field);
            Some(share)
        })?;
        near.map(|near| (object, near, share))
    }

    fn link(&self, scene: &Scene<'_>, node: usize, conductors: &[u16]) -> NodeLink {
        if conductors[node] != NO_OBJECT {
            return NodeLink::NONE;
        }
        let ending = self.ending(scene, node, conductors);
        let (mut object, mut all) = (ending.object, ending.cut);
        if !ending.is_mixed
            && scene.mesh.terminals[node] == FREE
            && let Some((of, near, share)) = self.nearest(scene, node)
        {
            object = of as u16;
            let (of_round, diameter) = near.of_round();
            let of_resolved = of_round * resolved(diameter / self.links.cell[node]);
            let near = match &near {
                Near::Edge(angle) => self.at_wedge(scene, node, angle, conductors),
                Near::Round(round) => self.at_round(scene, node, round, conductors),
                Near::Cylinder(angle, _, side) => {
                    (1.0 - of_round) * self.at_wedge(scene, node, angle, conductors)
                        + of_round * self.at_round(scene, node, side, conductors)
                }
            };
            all += share * ending.kept(near - all, of_resolved);
        }
        if object != NO_OBJECT {
            all = all.max(self.least_links(node, object));
            if ending.are_several || ending.object != object {
                // Elements count on one conductor.
                all = all.max(ending.now);
            }
        }
        let weight = all - ending.now;
        if object == NO_OBJECT || weight == 0.0 { NodeLink::NONE } else { NodeLink { object, weight } }
    }

    fn least_links(&self, node: usize, object: u16) -> f64 {
        let scale =
            |element: usize| self.negative.as_ref().map_or(1.0, |negative| negative.smallest(element));
        self.least.of_node(&self.obtuse, (node, object), scale)
    }

    /// Sums over the edges of a node that end in conductors.
    fn ending(&self, scene: &Scene<'_>, node: usize, conductors: &[u16]) -> Ending {
        debug_assert_eq!(self.links.leads_at[node], self.count_leads(scene, node, conductors));
        let mut ending = Ending::NONE;
        let is_mixed_nowhere = || scene.mesh.permittivity.is_uniform() && scene.has_only_conductors();
        if self.links.leads_at[node] == 0 && self.negative.is_none() && is_mixed_nowhere() {
            return ending;
        }
        let mut background = None;
        scene.mesh.edges.for_edges_at(node, |edge, end| {
            let permittivity = scene.mesh.permittivity.at(edge);
            let first = *background.get_or_insert(permittivity);
            ending.is_mixed |= f64::abs(permittivity - first) > SAME * first;
            let rule = self.rule.get(edge);
            let held = HeldEdge::of(edge, scene.mesh.edges.ends_of_existing(edge), conductors);
            if rule.object[end] == NO_OBJECT && held.owners[1 - end] == NO_OBJECT {
                ending.is_mixed |= self.part(held) != 1.0;
                return;
            }
            let left = self.without_links(held);
            let (object, factor, now) = match rule.object[end] {
                NO_OBJECT => (held.owners[1 - end], rule.through, left.through),
                object => (object, rule.factor[end], left.factor[end]),
            };
            let weight = self.weights[edge] * if rule.meets_two(held.owners) { 0.0 } else { self.part(held) };
            let now = self.weights[edge] * now;
            let cut = if self.weights[edge] > 0.0 { now } else { weight * factor };
            ending.are_several |= ending.object != NO_OBJECT && ending.object != object;
            if ending.object == NO_OBJECT || cut.abs() > ending.most {
                (ending.object, ending.most) = (object, cut.abs());
            }
            ending.now += now;
            ending.cut += cut;
            if self.weights[edge] > 0.0 {
                let beyond = if rule.object[1 - end] == NO_OBJECT { 0.0 } else { 1.0 / rule.factor[1 - end] };
                ending.note_inside(1.0 - 1.0 / factor - beyond);
            }
        });
        ending
    }

    /// How many edges lead from a node into conductors.
    fn count_leads(&self, scene: &Scene<'_>, node: usize, conductors: &[u16]) -> u32 {
        let mut count = 0;
        scene.mesh.edges.for_edges_at(node, |edge, end| {
            let other = scene.mesh.edges.ends_of_existing(edge)[1 - end] as usize;
            let leads = self.rule.get(edge).object[end] != NO_OBJECT || conductors[other] != NO_OBJECT;
            count += u32::from(leads);
        });
        count
    }

    /// Visits the neighbours of a node to which edges lead that end in no conductor, with the weights of these.
    fn for_seen_neighbours(
        &self,
        scene: &Scene<'_>,
        node: usize,
        conductors: &[u16],
        mut visit: impl FnMut(DVec3, f64),
    ) {
        scene.mesh.edges.for_edges_at(node, |edge, end| {
            let other = scene.mesh.edges.ends_of_existing(edge)[1 - end] as usize;
            if conductors[other] == NO_OBJECT && !self.rule.get(edge).is_linked() {
                visit(scene.mesh.nodes[other], self.weights[edge]);
            }
        });
    }

    /// All of a node's links together in front of a round conductor.
    fn at_round(&self, scene: &Scene<'_>, node: usize, round: &RoundNear, conductors: &[u16]) -> f64 {
        let mut balance = Balance::of(round.potential(scene.mesh.nodes[node]));
        self.for_seen_neighbours(scene, node, conductors, |point, weight| {
            balance.add(weight, round.potential(point));
        });
        balance.links()
    }

    /// The same near a right angle.
    fn at_wedge(&self, scene: &Scene<'_>, node: usize, angle: &RightAngle, conductors: &[u16]) -> f64 {
        let coordinates = angle.coordinates();
        // The node itself comes first, and weighs nothing.
        let (mut places, mut weights, mut count) = (Places::<AROUND>::ORIGIN, [0.0; AROUND], 1);
        places.set(0, coordinates(scene.mesh.nodes[node]));
        let mut balance = None;
        let mut add = |places: &Places<AROUND>, weights: &[f64]| {
            let potentials = vectorised(
                #[inline(always)]
                || places.potentials(angle.radius),
            );
            let balance = balance.get_or_insert(Balance::of(potentials[0]));
            weights.iter().zip(potentials).for_each(|(weight, potential)| balance.add(*weight, potential));
        };
        self.for_seen_neighbours(scene, node, conductors, |point, weight| {
            if count == AROUND {
                add(&places, &weights);
                count = 0;
            }
            places.set(count, coordinates(point));
            weights[count] = weight;
            count += 1;
        });
        add(&places, &weights[..count]);
        balance.as_ref().map_or(0.0, Balance::links)
    }
}
