//! Relaxation of the nodes whose rows changed: each takes the potential that its neighbours ask for, one after the other
//! (Gauss-Seidel).
//!
//! Where a body comes or goes, nodes find themselves in another material or released from a conductor, and their potentials
//! are those of before: far too much energy in very few nodes. A cycle takes it away, but all fields must move for that. Done
//! where it is, it costs a few operations for each node, and what is left is smooth enough to be foreseen. Where a steady
//! motion leads the fields on (`increment`), nodes are relaxed as they will be there.
//!
//! Sweeps change nothing but potentials and residuals, which are taken out of the vectors for that, four columns side by
//! side. The rest follows once from what they were and what they have become. With C, the change of the fields, r becomes
//! r - K C; so, K being symmetric, products with r change by products with C, which is zero at all but the relaxed nodes.
//!
//! Nodes on either side of a plane across y are not beside each other, so two threads share them, and those in the plane come
//! last. Where that is depends on which nodes changed, not on the threads.

use super::charges::{Place, StoredPlace};
use super::groups::{GROUP, Group};
use super::increment::Increment;
use super::layout::{Coloured, Layout};
use super::level::Level;
use super::links::ObjectLinks;
use super::potentials::Potentials;
use super::refreshed::Refreshed;
use crate::workers::Workers;
use glam::{DVec4, Vec4};

/// How often the nodes are gone through at most, and what part of any column's energy that must have taken to be done again.
const SWEEPS: usize = 6;
const WORTH_AGAIN: f32 = 3e-5;

/// Nodes are left as they are while all of them together would take no more than this part of any column's energy.
const LEAST_GAIN: f32 = 3e-5;

/// Where more than one node in so many has changed, the fields are another scene's.
const FEW: usize = 8;

/// Fewer nodes are not worth a second thread, and so few in all of the lattice never are.
const WORTH_SHARING: usize = 256;
const NEVER_SHARED: usize = 20_000;

/// The free nodes that changed, and what they are relaxed with.
#[derive(Clone, Debug)]
pub(super) struct Relaxation {
    columns: Columns,
    /// Where they are, each with its index along y; and how many have that.
    changed: Vec<(StoredPlace, u32)>,
    at_y: Vec<u32>,
    /// If more than this change, none are relaxed.
    most: usize,
    /// Of the nodes before and behind a plane, if they are to be shared.
    rooms: Vec<Room>,
}

/// Groups of columns, how far the fields will go along their last change, and one over their energies.
#[derive(Clone, Debug)]
struct Columns {
    groups: Vec<Group>,
    ahead: Vec<Vec4>,
    per_energy: Vec<Vec4>,
}

/// What nodes are relaxed by.
struct Rule<'a> {
    of_nodes: &'a Layout,
    finest: &'a Level,
    potentials: &'a Potentials,
    links: &'a ObjectLinks,
    columns: &'a Columns,
    /// A node that takes no more than this part of any column's energy is left as it is.
    least: f32,
}

/// Nodes that may be relaxed and those beside them, taken out of the vectors. All groups of columns of a node are one after
/// the other.
#[derive(Clone, Debug)]
struct Room {
    /// The free ones among the nodes that changed, which have the first numbers.
    nodes: Vec<Node>,
    relaxed: Vec<Relaxed>,
    fields: Vec<Field>,
    /// Where nodes are and their residuals by their number here, from 1 on: 0 stands for all that are held.
    places: Vec<StoredPlace>,
    residuals: Vec<Residual>,
    /// The number of each node, zero where it has none.
    numbers: Coloured<u32>,
    /// One node, as it was changed.
    changes: Vec<Change>,
    /// By how much -Σ x_s r_t over free rows is more and Σ d_s r_t less: for each column s all t.
    products: Vec<[DVec4; 2]>,
}

/// A free node that changed.
#[derive(Clone, Debug)]
struct Node {
    inverse: f32,
    /// Behind how many others it was relaxed first, if it was.
    relaxed: Option<u32>,
}

/// A node that is relaxed: where the residuals beside it are, and the weights to them, zero to what is held.
#[derive(Clone, Debug)]
struct Relaxed {
    node: u32,
    diagonal: f32,
    beside: [u32; 6],
    weights: [f32; 6],
}

/// Its potential in a group of columns now and before, which is taken for zero where potentials are in double precision; and
/// Σ weight times potential of what is held beside it.
#[derive(Clone, Debug)]
struct Field {
    now: Vec4,
    before: Vec4,
    held: Vec4,
}

/// The residual of a node in a group of columns now and before, and the charge of the fields' last change.
#[derive(Clone, Debug, Default)]
struct Residual {
    now: Vec4,
    before: Vec4,
    of_increment: Vec4,
}

/// How a node was changed, in a group of columns.
#[derive(Clone, Debug, Default)]
struct Change {
    /// By how much the potential changed, and the residual before.
    potential: Vec4,
    residual: Vec4,
    /// Σ w (x - x') over free neighbours at x', and the charge of the fields' last change.
    charge: Vec4,
    of_increment: Vec4,
}

impl Relaxation {
    /// No nodes. Layouts are those of numbers which are there once for each node, and of vectors.
    pub(super) fn new(of_nodes: &Layout, layout: &Layout) -> Self {
        let (groups, nodes) = (Group::all(layout), layout.counts.into_iter().product::<usize>());
        let rooms = if nodes < NEVER_SHARED { 1 } else { 2 };
        Self {
            changed: Vec::new(),
            at_y: vec![0; layout.counts[1]],
            most: nodes / FEW,
            rooms: vec![Room::new(of_nodes, groups.len()); rooms],
            columns: Columns::new(groups),
        }
    }

    /// Lists a free node that changed, with its index along y.
    pub(super) fn list(&mut self, place: Place, y: usize) {
        if self.changed.len() <= self.most {
            self.changed.push((place.stored(), y as u32));
            self.at_y[y] += 1;
        }
    }

    /// Where the plane is on whose sides nodes are relaxed by one thread each: where these then have the least to do one after
    /// the other.
    fn plane_between(&self) -> Option<u32> {
        let all = self.changed.len() as u32;
        if self.changed.len() < WORTH_SHARING || self.rooms.len() < 2 {
            return None;
        }
        let mut before = 0;
        let one_after_the_other = self.at_y.iter().map(|&within| {
            let behind = all - before - within;
            let most = before.max(behind) + within;
            before += within;
            most
        });
        let least = (0..).zip(one_after_the_other).min_by_key(|&(_, most)| most);
        least.filter(|&(_, most)| most < all).map(|(y, _)| y)
    }
}

impl Columns {
    fn new(groups: Vec<Group>) -> Self {
        let zeros = vec![Vec4::ZERO; groups.len()];
        Self { ahead: zeros.clone(), per_energy: zeros, groups }
    }

    /// Takes their energies, and how far their fields will go.
    fn take(&mut self, increment: &Increment, energy: impl Fn(usize) -> f64) {
        let Self { groups, ahead, per_energy } = self;
        for (group, (ahead, per_energy)) in groups.iter().zip(ahead.iter_mut().zip(per_energy)) {
            *ahead = group.of_columns(|column| increment.length(column, energy(column)) as f32);
            *per_energy = group.of_columns(|column| energy(column).recip() as f32);
        }
    }
}

impl Room {
    /// `of_nodes` is the layout of numbers which are there once for each node.
    fn new(of_nodes: &Layout, groups: usize) -> Self {
        Self {
            nodes: Vec::new(),
            relaxed: Vec::new(),
            fields: Vec::new(),
            places: Vec::new(),
            residuals: Vec::new(),
            numbers: of_nodes.zeros(),
            changes: vec![Change::default(); groups],
            products: vec![[DVec4::ZERO; 2]; groups * groups * GROUP],
        }
    }

    /// Relaxes some nodes, in the room alone.
    fn relax(&mut self, rule: &Rule<'_>, nodes: impl Iterator<Item = StoredPlace>) {
        self.take(rule, nodes);
        for _ in 0..SWEEPS {
            if self.sweep(rule) <= WORTH_AGAIN {
                break;
            }
        }
        for relaxed in 0..self.relaxed.len() {
            self.look_at_change(relaxed, rule.columns.groups.len());
            self.multiply();
        }
    }

    /// Takes nodes into the room.
    fn take(&mut self, rule: &Rule<'_>, nodes: impl Iterator<Item = StoredPlace>) {
        self.places.push(Place { colour: 0, at: 0, first: 0 }.stored());
        self.residuals.resize(rule.columns.groups.len(), Residual::default());
        for place in nodes.map(StoredPlace::get) {
            let inverse = rule.finest.stencil.centre[place.colour][place.at];
            let is_there = self.numbers[place.colour][place.at] != 0;
            if inverse != 0.0 && !is_there {
                self.enter(rule, place);
                self.nodes.push(Node { inverse, relaxed: None });
            }
        }
    }

    /// Forgets all nodes.
    fn clear(&mut self) {
        let Self { nodes, relaxed, fields, places, residuals, numbers, products, .. } = self;
        for place in places.drain(..) {
            let Place { colour, at, .. } = place.get();
            numbers[colour][at] = 0;
        }
        nodes.clear();
        relaxed.clear();
        fields.clear();
        residuals.clear();
        products.fill([DVec4::ZERO; 2]);
    }

    /// The number of a free node, which gets one if it has none.
    #[inline(always)]
    fn number(&mut self, rule: &Rule<'_>, place: Place) -> u32 {
        let number = self.numbers[place.colour][place.at];
        if number != 0 { number } else { self.enter(rule, place) }
    }

    /// Gives a free node the next number.
    fn enter(&mut self, rule: &Rule<'_>, place: Place) -> u32 {
        let Level { b, charges, .. } = rule.finest;
        let number = self.places.len() as u32;
        self.numbers[place.colour][place.at] = number;
        self.places.push(place.stored());
        let (b, charges) = (&b[place.colour], &charges[place.colour]);
        for group in &rule.columns.groups {
            let now = Vec4::from_array(group.gather(b, place.first));
            let of_increment = Vec4::from_array(group.gather(charges, place.first));
            self.residuals.push(Residual { now, before: now, of_increment });
        }
        number
    }

    /// Relaxes all nodes that take more than such a part of energies, one after the other. Returns what part all of them took.
    fn sweep(&mut self, rule: &Rule<'_>) -> f32 {
        let mut gained = 0.0;
        for index in 0..self.nodes.len() {
            let gain = self.gain(rule.columns, index);
            if gain > rule.least {
                let relaxed = self.nodes[index].relaxed.unwrap_or_else(|| self.meet(rule, index));
                self.relax_one(rule.columns, index, relaxed as usize);
                gained += gain;
            }
        }
        gained
    }

    /// What relaxing a node takes from the energy of a column, as a part of that: the most of any.
    fn gain(&self, columns: &Columns, index: usize) -> f32 {
        let (inverse, groups) = (self.nodes[index].inverse, columns.groups.len());
        let residuals = &self.residuals[(index + 1) * groups..][..groups];
        let (ahead, per_energy) = (&columns.ahead[..groups], &columns.per_energy[..groups]);
        let mut most = Vec4::ZERO;
        for group in 0..groups {
            let residual = residuals[group].now - ahead[group] * residuals[group].of_increment;
            // In this order, as squares are too small.
            most = ((residual * inverse) * (residual * per_energy[group])).max(most);
        }
        most.max_element()
    }

    /// Takes the potential of a node that is to be relaxed, and what is around it. Returns how many others it is behind.
    fn meet(&mut self, rule: &Rule<'_>, index: usize) -> u32 {
        let &Rule { of_nodes, finest, potentials, links, columns, .. } = rule;
        let (place, groups) = (self.places[index + 1].get(), columns.groups.len());
        let (layout, other) = (finest.layout, 1 - place.colour);
        let (number, first) = (self.relaxed.len() as u32, self.fields.len());
        for group in &columns.groups {
            let now = if potentials.is_single() {
                potentials.gather(group, place.colour, place.first)
            } else {
                Vec4::ZERO
            };
            let held = group.of_columns(|column| links.pull(column, layout.columns, place) as f32);
            self.fields.push(Field { now, before: now, held });
        }
        let (mut beside, mut weights) = ([0; 6], finest.stencil.weights(place.colour, place.at));
        let around = of_nodes.around(place.colour, place.at);
        let in_vectors = layout.around(place.colour, place.first);
        for side in 0..6 {
            let place = Place { colour: other, at: around[side], first: in_vectors[side] };
            if finest.stencil.centre[other][place.at] != 0.0 {
                beside[side] = self.number(rule, place) * groups as u32;
                continue;
            }
            for (group, field) in columns.groups.iter().zip(&mut self.fields[first..]) {
                field.held += weights[side] * potentials.gather(group, other, place.first);
            }
            weights[side] = 0.0;
        }
        let node = &mut self.nodes[index];
        node.relaxed = Some(number);
        self.relaxed.push(Relaxed { node: index as u32, diagonal: node.inverse.recip(), beside, weights });
        number
    }

    /// Potential and residual of a node, and the residuals beside it.
    fn relax_one(&mut self, columns: &Columns, index: usize, relaxed: usize) {
        let Self { nodes, fields, residuals, .. } = self;
        let (inverse, node, groups) = (nodes[index].inverse, &self.relaxed[relaxed], columns.groups.len());
        for (group, &ahead) in columns.ahead.iter().enumerate() {
            let residual = &mut residuals[(index + 1) * groups + group];
            let field = &mut fields[relaxed * groups + group];
            let potential = field.now + (residual.now - ahead * residual.of_increment) * inverse;
            let change = potential - field.now;
            field.now = potential;
            residual.now -= change * node.diagonal;
            for (&beside, weight) in node.beside.iter().zip(node.weights) {
                residuals[beside as usize + group].now += change * weight;
            }
        }
    }

    /// Takes what was changed at a node that was relaxed.
    fn look_at_change(&mut self, relaxed: usize, groups: usize) {
        let number = self.relaxed[relaxed].node as usize + 1;
        for (group, change) in self.changes.iter_mut().enumerate() {
            let field = &self.fields[relaxed * groups + group];
            let residual = &self.residuals[number * groups + group];
            *change = Change {
                potential: field.now - field.before,
                residual: residual.before,
                charge: field.held - residual.now,
                of_increment: residual.of_increment,
            };
        }
    }

    /// Adds what follows from the change of a node to products of all pairs of columns.
    fn multiply(&mut self) {
        let Self { changes, products, .. } = self;
        let mut products = products.iter_mut();
        for of_s in &*changes {
            let [potential, charge, of_increment] =
                [of_s.potential, of_s.charge, of_s.of_increment].map(|of| of.to_array());
            for s in 0..GROUP {
                for (of_t, products) in changes.iter().zip(&mut products) {
                    let energy = of_t.potential * charge[s] - of_t.residual * potential[s];
                    products[0] += energy.as_dvec4();
                    products[1] += (of_t.potential * of_increment[s]).as_dvec4();
                }
            }
        }
    }
}

impl Refreshed<'_> {
    /// Relaxes the free ones of so many nodes that changed, those that are listed, and lists none any more.
    pub(super) fn relax(&mut self, workers: &Workers, changed: usize) {
        if changed <= self.relaxation.most {
            let columns = self.finest.layout.columns;
            let energy = |column: usize| self.state.energies[column * columns + column];
            self.relaxation.columns.take(self.increment, energy);
            match self.relaxation.plane_between() {
                None => self.relax_where(|_| true),
                Some(plane) => {
                    self.relax_beside(plane, workers);
                    self.relax_where(|y| y == plane);
                }
            }
        }
        self.relaxation.changed.clear();
        self.relaxation.at_y.fill(0);
    }

    /// Relaxes the nodes on either side of a plane.
    fn relax_beside(&mut self, plane: u32, workers: &Workers) {
        let (rule, changed, rooms) = self.rule();
        let [first, second] = rooms else { return };
        let before = || first.relax(&rule, places(changed, |y| y < plane));
        let behind = || second.relax(&rule, places(changed, |y| y > plane));
        workers.both(before, behind);
        (0..2).for_each(|room| self.follow(room));
    }

    /// Relaxes nodes with such indices along y.
    fn relax_where(&mut self, is_meant: impl Fn(u32) -> bool) {
        let (rule, changed, rooms) = self.rule();
        rooms[0].relax(&rule, places(changed, is_meant));
        self.follow(0);
    }

    fn rule(&mut self) -> (Rule<'_>, &[(StoredPlace, u32)], &mut [Room]) {
        let Self { of_nodes, potentials, links, finest, relaxation, .. } = self;
        let Relaxation { columns, changed, rooms, .. } = &mut **relaxation;
        let least = LEAST_GAIN / changed.len().max(1) as f32;
        (Rule { of_nodes, finest, potentials, links, columns, least }, changed, rooms)
    }

    /// Hands over what was relaxed in a room.
    fn follow(&mut self, room: usize) {
        self.follow_potentials(room);
        self.follow_residuals(room);
        self.relaxation.rooms[room].clear();
    }

    /// Hands over potentials, and what changed with them.
    fn follow_potentials(&mut self, room: usize) {
        let Self { finest, potentials, increment, of_free, relaxation, .. } = self;
        let (room, groups) = (&relaxation.rooms[room], &relaxation.columns.groups);
        let columns = finest.layout.columns;
        for (relaxed, fields) in room.relaxed.iter().zip(room.fields.chunks_exact(groups.len())) {
            let place @ Place { colour, first, .. } = room.places[relaxed.node as usize + 1].get();
            for (at, (group, field)) in groups.iter().zip(fields).enumerate() {
                potentials.move_to(group, colour, first, field.now);
                if potentials.is_single() {
                    increment.relaxed.note(place, at, field.now - field.before);
                }
            }
        }
        for s in 0..columns {
            for t in 0..columns {
                let products = &room.products[s * groups.len() + t / GROUP];
                let [energy, with_residual] = products.map(|of| of[t % GROUP]);
                if s <= t {
                    of_free[s * columns + t] += energy;
                }
                if increment.is_known {
                    increment.sums.add_with_residual([s, t], -with_residual);
                }
            }
        }
    }

    /// Hands over residuals, and what changed with them. Beside the plane between two rooms both have a part in them.
    fn follow_residuals(&mut self, room: usize) {
        let Self { finest, increment, state, relaxation, .. } = self;
        let (room, groups) = (&relaxation.rooms[room], &relaxation.columns.groups);
        for (at, group) in groups.iter().enumerate() {
            let (mut squares, mut crossed) = (DVec4::ZERO, DVec4::ZERO);
            let residuals = room.residuals[at..].iter().step_by(groups.len());
            for (place, residual) in room.places.iter().zip(residuals).skip(1) {
                if residual.now == residual.before {
                    continue;
                }
                let Place { colour, first, .. } = place.get();
                let b = &mut finest.b[colour];
                let before = Vec4::from_array(group.gather(b, first));
                let now = residual.now + (before - residual.before);
                group.scatter(b, first, now);
                let (now, before) = (now.as_dvec4(), before.as_dvec4());
                squares += now * now - before * before;
                crossed += residual.of_increment.as_dvec4() * (now - before);
            }
            for (lane, column) in group.columns().enumerate() {
                state.residual[column] += squares[lane];
                if increment.is_known {
                    increment.sums.add_crossed(column, crossed[lane]);
                }
            }
        }
    }
}

/// Where those of the nodes that changed are which have such indices along y.
fn places(
    changed: &[(StoredPlace, u32)],
    is_meant: impl Fn(u32) -> bool,
) -> impl Iterator<Item = StoredPlace> {
    changed.iter().filter(move |(_, y)| is_meant(*y)).map(|(place, _)| *place)
}
