//! Relaxation of the nodes whose rows changed: each takes the potential that its neighbours ask for, one after the other
//! (Gauss-Seidel).
//!
//! Where a body comes or goes, nodes find themselves in another material or released from a conductor, and their potentials
//! are those of before: far too much energy in very few nodes. A cycle takes it away, but all fields must move for that. Done
//! where it is, it costs a few operations for each node, and what is left is smooth enough to be foreseen. Where a steady
//! motion leads the fields on (`increment`), nodes are relaxed as they will be there.

use super::charges::Place;
use super::refreshed::Refreshed;

/// How often the nodes are gone through at most, and what part of any column's energy that must have taken to be done again.
const SWEEPS: usize = 4;
const WORTH_AGAIN: f64 = 1e-4;

/// A node is left as it is while that would take no more than this part of any column's energy.
const LEAST_GAIN: f64 = 1e-7;

/// Where more than one node in so many has changed, the fields are another scene's.
const FEW: usize = 8;

/// Room for all columns of one node.
#[derive(Clone, Debug)]
pub(super) struct Room {
    /// r, by how much the potential changes, and what of the charge is due to neighbours that are held.
    residuals: Vec<f64>,
    changes: Vec<f64>,
    held: Vec<f64>,
    /// How far the fields will go along their last change.
    ahead: Vec<f64>,
}

impl Room {
    pub(super) fn new(columns: usize) -> Self {
        let zeros = || vec![0.0; columns];
        Self { residuals: zeros(), changes: zeros(), held: zeros(), ahead: zeros() }
    }
}

impl Refreshed<'_> {
    /// Relaxes those of some nodes that are free.
    pub(super) fn relax(&mut self, nodes: &[u32]) {
        let layout = self.finest.layout;
        if FEW * nodes.len() > layout.counts.into_iter().product() {
            return;
        }
        for t in 0..layout.columns {
            self.room.ahead[t] = self.increment.length(t, self.state.energies[t * layout.columns + t]);
        }
        for _ in 0..SWEEPS {
            let mut gained = 0.0_f64;
            for &node in nodes {
                let place = Place::of(node as usize, &self.of_nodes, &layout);
                let gain = self.gain(place);
                if gain > LEAST_GAIN {
                    self.relax_node(place);
                    gained += gain;
                }
            }
            if gained <= WORTH_AGAIN {
                break;
            }
        }
    }

    /// The residual of a node in a column where the fields will be.
    fn residual_ahead(&self, t: usize, Place { colour, first, .. }: Place) -> f64 {
        let at = self.finest.layout.in_column(t, first);
        f64::from(self.finest.b[colour][at]) - self.room.ahead[t] * f64::from(self.finest.charges[colour][at])
    }

    /// What relaxing a node takes from the energy of a column, as a part of that: the most of any.
    fn gain(&self, place: Place) -> f64 {
        let columns = self.finest.layout.columns;
        let inverse = f64::from(self.finest.stencil.centre[place.colour][place.at]);
        let gain = |t: usize| {
            let residual = self.residual_ahead(t, place);
            residual * residual * inverse / self.state.energies[t * columns + t]
        };
        (0..columns).map(gain).fold(0.0, f64::max)
    }

    /// Potential and residual of the node, residuals of those around it, and all that depends on these.
    fn relax_node(&mut self, place: Place) {
        let Place { colour, at, first } = place;
        let (layout, other) = (self.finest.layout, 1 - colour);
        let inverse = f64::from(self.finest.stencil.centre[colour][at]);
        for t in 0..layout.columns {
            let own = layout.in_column(t, first);
            let asked = self.residual_ahead(t, place) * inverse;
            let before = self.potentials.get(colour, own);
            self.potentials.set(colour, own, before + asked);
            let change = self.potentials.get(colour, own) - before;
            let residual = f64::from(self.finest.b[colour][own]);
            self.room.residuals[t] = residual;
            self.room.changes[t] = change;
            self.room.held[t] = self.links.pull(t, layout.columns, place);
            self.set_residual(t, [colour, first], residual - change / inverse);
        }
        let weights = self.finest.stencil.weights(colour, at).map(f64::from);
        let beside = self.of_nodes.around(colour, at).into_iter().zip(layout.around(colour, first));
        for (weight, (beside, first)) in weights.into_iter().zip(beside) {
            let is_held = self.finest.stencil.centre[other][beside] == 0.0;
            for t in 0..layout.columns {
                let at = layout.in_column(t, first);
                if is_held {
                    self.room.held[t] += weight * self.potentials.get(other, at);
                } else {
                    let residual = f64::from(self.finest.b[other][at]);
                    self.set_residual(t, [other, first], residual + weight * self.room.changes[t]);
                }
            }
        }
        self.change_energies(1.0 / inverse);
    }

    /// -Σ x r over free rows, of a node that changed: what is held is no part of it.
    fn change_energies(&mut self, diagonal: f64) {
        let Room { residuals, changes, held, .. } = &*self.room;
        for t in 0..changes.len() {
            for s in 0..=t {
                self.of_free[s * changes.len() + t] +=
                    changes[t] * (diagonal * changes[s] - residuals[s] + held[s]) - changes[s] * residuals[t];
            }
        }
    }

    fn set_residual(&mut self, t: usize, [colour, first]: [usize; 2], residual: f64) {
        let layout = self.finest.layout;
        let at = layout.in_column(t, first);
        let before = std::mem::replace(&mut self.finest.b[colour][at], residual as f32);
        let [before, now] = [before, residual as f32].map(f64::from);
        self.state.residual[t] += now * now - before * before;
        if self.increment.is_known {
            let charge = f64::from(self.finest.charges[colour][at]);
            let d = |s| f64::from(self.increment.fields[colour][layout.in_column(s, first)]);
            self.increment.sums.change_residual(t, d, [now, before], charge);
        }
    }
}
