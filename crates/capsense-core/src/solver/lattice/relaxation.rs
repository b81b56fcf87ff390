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

use super::charges::{Place, StoredPlace};
use super::groups::{GROUP, Group};
use super::layout::{Coloured, Layout};
use super::level::Level;
use super::refreshed::Refreshed;
use glam::{DVec4, Vec4};

/// How often the nodes are gone through at most, and what part of any column's energy that must have taken to be done again.
const SWEEPS: usize = 6;
const WORTH_AGAIN: f32 = 3e-5;

/// Nodes are left as they are while all of them together would take no more than this part of any column's energy.
const LEAST_GAIN: f32 = 3e-5;

/// Where more than one node in so many has changed, the fields are another scene's.
const FEW: usize = 8;

/// Nodes that may be relaxed and those beside them, taken out of the vectors. All groups of columns of a node are one after
/// the other.
#[derive(Clone, Debug)]
pub(super) struct Room {
    groups: Vec<Group>,
    /// How far the fields will go along their last change, and one over their energies.
    ahead: Vec<Vec4>,
    per_energy: Vec<Vec4>,
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

impl Room {
    /// Layouts are those of numbers which are there once for each node, and of vectors.
    pub(super) fn new(of_nodes: &Layout, layout: &Layout) -> Self {
        let groups = Group::all(layout);
        let zeros = vec![Vec4::ZERO; groups.len()];
        Self {
            ahead: zeros.clone(),
            per_energy: zeros,
            nodes: Vec::new(),
            relaxed: Vec::new(),
            fields: Vec::new(),
            places: Vec::new(),
            residuals: Vec::new(),
            numbers: of_nodes.zeros(),
            changes: vec![Change::default(); groups.len()],
            products: vec![[DVec4::ZERO; 2]; groups.len() * groups.len() * GROUP],
            groups,
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
    fn number(&mut self, finest: &Level, place: Place) -> u32 {
        let number = self.numbers[place.colour][place.at];
        if number != 0 { number } else { self.enter(finest, place) }
    }

    /// Gives a free node the next number.
    fn enter(&mut self, finest: &Level, place: Place) -> u32 {
        let Level { b, charges, .. } = finest;
        let number = self.places.len() as u32;
        self.numbers[place.colour][place.at] = number;
        self.places.push(place.stored());
        let (b, charges) = (&b[place.colour], &charges[place.colour]);
        for group in &self.groups {
            let now = Vec4::from_array(group.gather(b, place.first));
            let of_increment = Vec4::from_array(group.gather(charges, place.first));
            self.residuals.push(Residual { now, before: now, of_increment });
        }
        number
    }

    /// What relaxing a node takes from the energy of a column, as a part of that: the most of any.
    fn gain(&self, index: usize) -> f32 {
        let (inverse, groups) = (self.nodes[index].inverse, self.ahead.len());
        let residuals = &self.residuals[(index + 1) * groups..][..groups];
        let (ahead, per_energy) = (&self.ahead[..groups], &self.per_energy[..groups]);
        let mut most = Vec4::ZERO;
        for group in 0..groups {
            let residual = residuals[group].now - ahead[group] * residuals[group].of_increment;
            // In this order, as squares are too small.
            most = ((residual * inverse) * (residual * per_energy[group])).max(most);
        }
        most.max_element()
    }

    /// Potential and residual of a node, and the residuals beside it.
    fn relax(&mut self, index: usize, relaxed: usize) {
        let Self { groups, ahead, nodes, fields, residuals, .. } = self;
        let (inverse, node, groups) = (nodes[index].inverse, &self.relaxed[relaxed], groups.len());
        for group in 0..groups {
            let residual = &mut residuals[(index + 1) * groups + group];
            let field = &mut fields[relaxed * groups + group];
            let potential = field.now + (residual.now - ahead[group] * residual.of_increment) * inverse;
            let change = potential - field.now;
            field.now = potential;
            residual.now -= change * node.diagonal;
            for (&beside, weight) in node.beside.iter().zip(node.weights) {
                residuals[beside as usize + group].now += change * weight;
            }
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
    /// Relaxes those of some nodes that are free.
    pub(super) fn relax(&mut self, nodes: &[u32]) {
        let layout = self.finest.layout;
        if FEW * nodes.len() > layout.counts.into_iter().product() {
            return;
        }
        self.list(nodes);
        let least = LEAST_GAIN / self.room.nodes.len().max(1) as f32;
        for _ in 0..SWEEPS {
            if self.sweep(least) <= WORTH_AGAIN {
                break;
            }
        }
        self.follow_potentials();
        self.follow_residuals();
        self.room.clear();
    }

    /// Takes the nodes that are free.
    fn list(&mut self, nodes: &[u32]) {
        let Self { of_nodes, finest, increment, state, room, .. } = self;
        let (layout, finest) = (finest.layout, &**finest);
        let energy = |column: usize| state.energies[column * layout.columns + column];
        let own = room.groups.iter().zip(room.ahead.iter_mut().zip(&mut room.per_energy));
        for (group, (ahead, per_energy)) in own {
            *ahead = group.of_columns(|column| increment.length(column, energy(column)) as f32);
            *per_energy = group.of_columns(|column| energy(column).recip() as f32);
        }
        room.places.push(Place { colour: 0, at: 0, first: 0 }.stored());
        room.residuals.resize(room.groups.len(), Residual::default());
        for &node in nodes {
            let place = Place::of(node as usize, of_nodes, &layout);
            let inverse = finest.stencil.centre[place.colour][place.at];
            let is_listed = room.numbers[place.colour][place.at] != 0;
            if inverse != 0.0 && !is_listed {
                room.enter(finest, place);
                room.nodes.push(Node { inverse, relaxed: None });
            }
        }
    }

    /// Relaxes all nodes that take more than such a part of energies, one after the other. Returns what part all of them took.
    fn sweep(&mut self, least: f32) -> f32 {
        let mut gained = 0.0;
        for index in 0..self.room.nodes.len() {
            let gain = self.room.gain(index);
            if gain > least {
                let relaxed = self.room.nodes[index].relaxed.unwrap_or_else(|| self.meet(index));
                self.room.relax(index, relaxed as usize);
                gained += gain;
            }
        }
        gained
    }

    /// Takes the potential of a node that is to be relaxed, and what is around it. Returns how many others it is behind.
    fn meet(&mut self, index: usize) -> u32 {
        let Self { of_nodes, finest, potentials, links, room, .. } = self;
        let (finest, place, groups) = (&**finest, room.places[index + 1].get(), room.groups.len());
        let (layout, other) = (finest.layout, 1 - place.colour);
        let (number, first) = (room.relaxed.len() as u32, room.fields.len());
        for group in &room.groups {
            let now = if potentials.is_single() {
                potentials.gather(group, place.colour, place.first)
            } else {
                Vec4::ZERO
            };
            let held = group.of_columns(|column| links.pull(column, layout.columns, place) as f32);
            room.fields.push(Field { now, before: now, held });
        }
        let (mut beside, mut weights) = ([0; 6], finest.stencil.weights(place.colour, place.at));
        let around = of_nodes.around(place.colour, place.at);
        let in_vectors = layout.around(place.colour, place.first);
        for side in 0..6 {
            let place = Place { colour: other, at: around[side], first: in_vectors[side] };
            if finest.stencil.centre[other][place.at] != 0.0 {
                beside[side] = room.number(finest, place) * groups as u32;
                continue;
            }
            for (group, field) in room.groups.iter().zip(&mut room.fields[first..]) {
                field.held += weights[side] * potentials.gather(group, other, place.first);
            }
            weights[side] = 0.0;
        }
        let node = &mut room.nodes[index];
        node.relaxed = Some(number);
        room.relaxed.push(Relaxed { node: index as u32, diagonal: node.inverse.recip(), beside, weights });
        number
    }

    /// Hands over potentials, and what changed with them.
    fn follow_potentials(&mut self) {
        let Self { finest, potentials, increment, of_free, room, .. } = self;
        let (layout, groups) = (finest.layout, room.groups.len());
        for relaxed in 0..room.relaxed.len() {
            let number = room.relaxed[relaxed].node as usize + 1;
            let place @ Place { colour, first, .. } = room.places[number].get();
            for group in 0..groups {
                let field = &room.fields[relaxed * groups + group];
                let residual = &room.residuals[number * groups + group];
                room.changes[group] = Change {
                    potential: field.now - field.before,
                    residual: residual.before,
                    charge: field.held - residual.now,
                    of_increment: residual.of_increment,
                };
                potentials.move_to(&room.groups[group], colour, first, field.now);
                if potentials.is_single() {
                    increment.relaxed.note(place, group, field.now - field.before);
                }
            }
            room.multiply();
        }
        for s in 0..layout.columns {
            for t in 0..layout.columns {
                let [energy, with_residual] = room.products[s * groups + t / GROUP].map(|of| of[t % GROUP]);
                if s <= t {
                    of_free[s * layout.columns + t] += energy;
                }
                if increment.is_known {
                    increment.sums.add_with_residual([s, t], -with_residual);
                }
            }
        }
    }

    /// Hands over residuals, and what changed with them.
    fn follow_residuals(&mut self) {
        let Self { finest, increment, state, room, .. } = self;
        let groups = room.groups.len();
        for (at, group) in room.groups.iter().enumerate() {
            let (mut squares, mut crossed) = (DVec4::ZERO, DVec4::ZERO);
            let residuals = room.residuals[at..].iter().step_by(groups);
            for (place, residual) in room.places.iter().zip(residuals).skip(1) {
                if residual.now == residual.before {
                    continue;
                }
                let (now, before) = (residual.now.as_dvec4(), residual.before.as_dvec4());
                squares += now * now - before * before;
                crossed += residual.of_increment.as_dvec4() * (now - before);
                let Place { colour, first, .. } = place.get();
                group.scatter(&mut finest.b[colour], first, residual.now);
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
