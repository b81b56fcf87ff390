//! Residuals of the nodes whose rows changed, and the state with them.

use super::charges::{NodeCharges, Place};
use super::increment::Increment;
use super::layout::Layout;
use super::level::Level;
use super::links::ObjectLinks;
use super::potentials::Potentials;
use super::relaxation::Room;
use crate::solver::operator::State;

/// What changed rows change.
pub(super) struct Refreshed<'a> {
    pub(super) of_nodes: Layout,
    pub(super) potentials: &'a mut Potentials,
    pub(super) links: &'a ObjectLinks,
    pub(super) finest: &'a mut Level,
    pub(super) increment: &'a mut Increment,
    pub(super) of_free: &'a mut [f64],
    pub(super) state: &'a mut State,
    /// Room for one node.
    pub(super) node: &'a mut NodeCharges,
    pub(super) room: &'a mut Room,
}

impl Refreshed<'_> {
    /// Recomputes the residual of one node, and what depends on it.
    pub(super) fn refresh(&mut self, node: usize, is_fixed: bool) {
        let layout = self.finest.layout;
        let place = Place::of(node, &self.of_nodes, &layout);
        let finest = &*self.finest;
        let is_zero = |column: usize| {
            let at = layout.in_column(column, place.first);
            [&finest.b, &finest.charges].into_iter().all(|of| of[place.colour][at] == 0.0)
        };
        if is_fixed && (0..layout.columns).all(is_zero) {
            return;
        }
        self.node.look(self.potentials, finest, self.links, place);
        let follows = self.increment.is_known;
        if follows {
            self.increment.look(self.potentials.leak(), finest, place);
        }
        let columns = layout.columns;
        let NodeCharges { potentials, charges } = &*self.node;
        let NodeCharges { potentials: d, charges: of_increment } = &self.increment.node;
        let Level { b, charges: q, .. } = &mut *self.finest;
        for (t, charge) in charges.iter().enumerate() {
            let at = layout.in_column(t, place.first);
            let residual = if is_fixed { 0.0 } else { -*charge as f32 };
            let before = std::mem::replace(&mut b[place.colour][at], residual);
            let (before, now) = (f64::from(before), f64::from(residual));
            self.state.residual[t] += now * now - before * before;
            for (s, potential) in potentials[..=t].iter().enumerate() {
                self.of_free[s * columns + t] -= potential * (now - before);
            }
            if follows {
                let charge = if is_fixed { 0.0 } else { of_increment[t] as f32 };
                let charge_before = std::mem::replace(&mut q[place.colour][at], charge);
                let [charge, charge_before] = [charge, charge_before].map(f64::from);
                self.increment.sums.change(t, d, [now, charge], [before, charge_before]);
            }
        }
    }
}
