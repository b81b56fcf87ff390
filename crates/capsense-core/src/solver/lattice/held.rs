//! What terminals hold at 1 V: their charges are the part of the energies that is not of free rows, where all but a
//! residual cancels.

use super::LatticeSolver;
use super::charges::{NodeCharges, Place};
use super::layout::Layout;
use super::level::Level;
use super::links::ObjectLinks;
use super::potentials::Potentials;
use crate::solver::operator::State;

/// The nodes that are at 1 V in some column.
#[derive(Clone, Debug)]
pub(super) struct Held {
    /// In the order in which they were found; no longer held, they leave with the next sum.
    nodes: Vec<u32>,
    is_listed: Vec<bool>,
}

impl Held {
    pub(super) fn new(nodes: usize) -> Self {
        Self { nodes: Vec::new(), is_listed: vec![false; nodes] }
    }
}

/// What the energies of fields are made of.
pub(super) struct Energies<'a> {
    pub(super) of_nodes: Layout,
    pub(super) potentials: &'a Potentials,
    pub(super) links: &'a ObjectLinks,
    pub(super) finest: &'a Level,
    pub(super) of_free: &'a [f64],
    pub(super) held: &'a mut Held,
    pub(super) state: &'a mut State,
    /// Room for one node.
    pub(super) node: &'a mut NodeCharges,
}

impl Held {
    /// Lists a node that is held now, if its potential is not zero in some column.
    pub(super) fn list(&mut self, layout: &Layout, potentials: &Potentials, node: u32, place: Place) {
        let is_listed = &mut self.is_listed[node as usize];
        let potential = |column| potentials.get(place.colour, layout.in_column(column, place.first));
        if !*is_listed && (0..layout.columns).any(|column| potential(column) != 0.0) {
            *is_listed = true;
            self.nodes.push(node);
        }
    }
}

impl LatticeSolver {
    /// The energies: those of free rows, and with them what is held.
    pub(super) fn add_held(&mut self) {
        let Self { of_nodes, potentials, links, of_free, held, state, node, .. } = self;
        let (of_nodes, finest) = (*of_nodes, &self.hierarchy.levels[0]);
        Energies { of_nodes, potentials, links, finest, of_free, held, state, node }.add_held();
    }
}

impl Energies<'_> {
    /// The energies: those of free rows, and with them what is held.
    pub(super) fn add_held(&mut self) {
        let columns = self.finest.layout.columns;
        self.state.energies.copy_from_slice(self.of_free);
        self.state.charge.fill(0.0);
        let mut nodes = std::mem::take(&mut self.held.nodes);
        nodes.retain(|&node| {
            let is_held = self.add_node(node as usize);
            self.held.is_listed[node as usize] = is_held;
            is_held
        });
        self.held.nodes = nodes;
        self.add_links();
        for t in 0..columns {
            for s in 0..t {
                self.state.energies[t * columns + s] = self.state.energies[s * columns + t];
            }
        }
    }

    /// Adds what one node holds. Returns whether it does.
    fn add_node(&mut self, node: usize) -> bool {
        let Self { of_nodes, potentials, links, finest, node: of_node, state, .. } = self;
        let columns = finest.layout.columns;
        let place = Place::of(node, of_nodes, &finest.layout);
        if finest.stencil.centre[place.colour][place.at] != 0.0 {
            return false;
        }
        of_node.look(potentials, finest, links, place);
        let NodeCharges { potentials, charges } = &*of_node;
        let mut is_held = false;
        for (s, &potential) in potentials.iter().enumerate().filter(|(_, potential)| **potential != 0.0) {
            is_held = true;
            state.charge[s] += (potential * charges[s]).powi(2);
            for (t, charge) in charges.iter().enumerate().skip(s) {
                state.energies[s * columns + t] += potential * charge;
            }
        }
        is_held
    }

    /// Adds the charges that links bring to electrodes and objects, each as if it led to a node of its own.
    fn add_links(&mut self) {
        let Self { potentials, links, finest, state, .. } = self;
        let (layout, columns) = (finest.layout, finest.layout.columns);
        for link in links.all() {
            let of_object = &links.potentials[link.object * columns..][..columns];
            for (t, &at_object) in of_object.iter().enumerate() {
                let at_node = potentials.get(link.colour, layout.in_column(t, link.place));
                let on_object = link.weight * (at_object - at_node);
                for (s, &potential) in of_object[..=t].iter().enumerate() {
                    state.energies[s * columns + t] += potential * on_object;
                }
                state.charge[t] += (at_object * on_object).powi(2);
            }
        }
    }
}
