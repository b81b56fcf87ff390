//! Charges of single nodes, with the same operations as where all fields are moved.

use super::layout::{Coloured, Layout};
use super::level::Level;
use super::links::ObjectLinks;
use super::potentials::Potentials;
use super::precision::{Leaking, Network};
use super::stencil::Stencil;

/// Where a node is in numbers that are there once for each node, and in the first column of vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) colour: usize,
    pub(super) at: usize,
    pub(super) first: usize,
}

/// The same in half the room.
#[derive(Clone, Copy, Debug)]
pub(super) struct StoredPlace {
    colour: u32,
    at: u32,
    first: u32,
}

impl StoredPlace {
    #[inline(always)]
    pub(super) fn get(self) -> Place {
        Place { colour: self.colour as usize, at: self.at as usize, first: self.first as usize }
    }
}

impl Place {
    #[inline(always)]
    pub(super) fn stored(self) -> StoredPlace {
        StoredPlace { colour: self.colour as u32, at: self.at as u32, first: self.first as u32 }
    }

    /// That of a node by its number, in two layouts.
    pub(super) fn of(node: usize, of_nodes: &Layout, of_vectors: &Layout) -> Self {
        Self::at(of_nodes.indices(node), of_nodes, of_vectors)
    }

    /// That of a node by its indices along the axes.
    pub(super) fn at(indices: [usize; 3], of_nodes: &Layout, of_vectors: &Layout) -> Self {
        let ((colour, at), (_, first)) = (of_nodes.place(indices), of_vectors.place(indices));
        Self { colour, at, first }
    }
}

/// Potentials and charges of one node in every column.
#[derive(Clone, Debug)]
pub(super) struct NodeCharges {
    pub(super) potentials: Vec<f64>,
    pub(super) charges: Vec<f64>,
}

impl NodeCharges {
    pub(super) fn new(columns: usize) -> Self {
        Self { potentials: vec![0.0; columns], charges: vec![0.0; columns] }
    }

    /// Takes those of a node. `layout` is that of vectors.
    pub(super) fn look(&mut self, potentials: &Potentials, finest: &Level, links: &ObjectLinks, node: Place) {
        let layout = &finest.layout;
        match potentials {
            Potentials::Single { x, leak, .. } => {
                let network = Leaking { stencil: &finest.stencil, leak };
                self.look_in(network, x, layout, node, links.seen_from::<Leaking<'_>>(layout.columns, node));
            }
            Potentials::Double { x, stencil, .. } => {
                let linked = links.seen_from::<&Stencil<f64>>(layout.columns, node);
                self.look_in(&**stencil, x, layout, node, linked);
            }
        }
    }

    /// The same in any fields; `linked` gives the charge in a column with what links to objects take from it.
    fn look_in<K: Network>(
        &mut self,
        network: K,
        x: &Coloured<K::Value>,
        layout: &Layout,
        Place { colour, at, first }: Place,
        linked: impl Fn(usize, K::Value) -> K::Value,
    ) {
        let row = network.row(colour, at);
        let around = layout.around(colour, first);
        let (own, other) = (&x[colour], &x[1 - colour]);
        for (column, (potential, to)) in self.potentials.iter_mut().zip(&mut self.charges).enumerate() {
            let shift = layout.in_column(column, 0);
            let [a, b, c, d, e, f] = around;
            let around = [
                other[a + shift],
                other[b + shift],
                other[c + shift],
                other[d + shift],
                other[e + shift],
                other[f + shift],
            ];
            let charge = linked(column, K::charge(&row, own[first + shift], around));
            (*potential, *to) = (own[first + shift].into(), charge.into());
        }
    }
}
