//! Residuals of the nodes whose rows changed, and the state with them.

use super::charges::{NodeCharges, Place};
use super::layout::Layout;
use super::level::Level;
use super::links::ObjectLinks;
use super::potentials::Potentials;
use crate::solver::operator::State;

/// What changed rows change.
pub(super) struct Refreshed<'a> {
    pub(super) of_nodes: Layout,
    pub(super) potentials: &'a Potentials,
    pub(super) links: &'a ObjectLinks,
    pub(super) finest: &'a mut Level,
    pub(super) of_free: &'a mut [f64],
    pub(super) state: &'a mut State,
    /// Room for one node.
    pub(super) node: &'a mut NodeCharges,
}

impl Refreshed<'_> {
    /// Recomputes the residual of one node, and what depends on it.
    pub(super) fn refresh(&mut self, node: usize, is_fixed: bool) {
        let layout = self.finest.layout;
        let place = Place::of(node, &self.of_nodes, &layout);
        let is_zero =
            |column: usize| self.finest.b[place.colour][layout.in_column(column, place.first)] == 0.0;
        if is_fixed && (0..layout.columns).all(is_zero) {
            return;
        }
        self.node.look(self.potentials, self.finest, self.links, place);
        let columns = layout.columns;
        let NodeCharges { potentials, charges } = &*self.node;
        let b = &mut self.finest.b[place.colour];
        for (t, charge) in charges.iter().enumerate() {
            let residual = if is_fixed { 0.0 } else { -*charge as f32 };
            let before = std::mem::replace(&mut b[layout.in_column(t, place.first)], residual);
            let (before, now) = (f64::from(before), f64::from(residual));
            self.state.residual[t] += now * now - before * before;
            for (s, potential) in potentials[..=t].iter().enumerate() {
                self.of_free[s * columns + t] -= potential * (now - before);
            }
        }
    }
}
