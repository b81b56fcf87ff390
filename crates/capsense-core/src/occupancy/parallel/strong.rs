//! What lines tell too much of, the stronger a dielectric is.
//!
//! **Beside a body.** An edge that a body passes by, but which has a part of the body in its box, has lines in the body. These would tie its
//! ends to each other as if they were in the body, which so would reach up to half a cell further than it does. What lines
//! in the body carry has to get there from the ends of the edge first, across the gap between, and that is in series with it. The next edge
//! in that direction mostly is in the body and carries the same. If the body is thinner than the way from one to the other, nobody else
//! does, and there is no such gap for the edge that is nearer: its ends then stand for the body. Spheres and capsules have no walls along
//! edges, so that the edge alone tells of them, the more the stronger they are.
//!
//! **On a body.** Where an edge ends in a strong body, all lines end at about one potential, and the field before a face that slants is as
//! strong everywhere: the edge alone tells, as for conductors, as far as its box meets the body. Where a face ends at a wall, a part of it
//! does not, and is as without the body ([`Scene::past_walls`]).
//!
//! How strong a body is, is 1 - (10/ε)², ε over the background's: nothing up to ten, where lines alone are best, and one for conductors. So nothing
//! jumps as a permittivity changes. Measured, beside what the edge rule and lines alone make of the same bodies: `docs/interface.md`.

use super::lines::{LINES, Lines};
use super::{Fill, Scene, Span, WEAK, either, smaller};
use crate::material::Material;

/// A gap counts as a whole if it is longer by this part of the way to the next edge than what is between that and the body, which is as
/// thick at least.
const LONGER: f64 = 0.25;

/// What an edge makes of a line in a body that it passes by.
#[derive(Clone, Copy)]
pub(super) struct PassedBy {
    /// The gap up to the body, as far as it counts, in parts of the edge.
    gap: f64,
    /// How much lines count.
    part: f64,
}

impl PassedBy {
    /// Lines are all that counts.
    pub(super) const LINES_ALONE: Self = Self { gap: 0.0, part: 1.0 };

    /// The same of a line of which so long a part is in the body.
    #[inline(always)]
    pub(super) fn of_length(self, length: f64) -> Self {
        Self { gap: length * self.gap, ..self }
    }

    /// Whether nothing but lines counts.
    #[inline(always)]
    pub(super) fn are_lines_alone(self) -> bool {
        self.gap == 0.0 && self.part == 1.0
    }

    /// Of two bodies on one line, what counts most of either.
    pub(super) fn and(self, other: Self) -> Self {
        Self { gap: self.gap.max(other.gap), part: self.part.min(other.part) }
    }

    /// What multiplies the weight of a line that would have `through` by itself: no less than without bodies that raise it.
    #[inline(always)]
    pub(super) fn through(self, through: f64) -> f64 {
        if self.are_lines_alone() {
            return through;
        }
        self.through_any(through)
    }

    /// The same where lines are not all that counts.
    #[inline(always)]
    pub(super) fn through_any(self, through: f64) -> f64 {
        let behind = 1.0 / smaller(1.0 / through + self.gap, 1.0);
        1.0 + self.part * (either(through > 1.0, behind, through) - 1.0)
    }
}

impl Scene<'_> {
    /// How strong a dielectric is: from nothing to one. Conductors have a rule of their own.
    fn strength(&self, object: usize, background: f64) -> f64 {
        match self.materials[object] {
            Material::Dielectric(permittivity) => {
                let weakness = WEAK * background / permittivity.value();
                (1.0 - weakness * weakness).max(0.0)
            }
            Material::Conductor(_) => 0.0,
        }
    }

    /// Which of the dielectrics on an edge is the strongest, and how strong that is; `None` where all are weak.
    pub(in super::super) fn strongest(
        &self,
        on_edge: &[(u16, Span)],
        background: f64,
    ) -> Option<(usize, f64)> {
        let strengths = on_edge.iter().map(|(object, _)| self.strength(usize::from(*object), background));
        let strongest =
            strengths.enumerate().reduce(|best, other| if other.1 > best.1 { other } else { best });
        strongest.filter(|(_, strength)| *strength > 0.0)
    }

    /// What an edge makes of a body in a quarter of its box: nothing but lines where the body is weak or on the edge itself. `fill` is what of
    /// the lines is in the body.
    #[inline(always)]
    pub(super) fn passed_by(
        &self,
        lines: &Lines<'_>,
        fill: &Fill,
        on_edge: &[(u16, Span)],
        background: f64,
    ) -> PassedBy {
        match self.strength_beside(lines.object(), on_edge, background) {
            Some(strength) => self.passed_by_strong(strength, lines, fill),
            None => PassedBy::LINES_ALONE,
        }
    }

    /// How strong a body is that is beside an edge alone; `None` if it is weak or on the edge itself, where nothing but lines counts.
    #[inline(always)]
    pub(super) fn strength_beside(
        &self,
        object: usize,
        on_edge: &[(u16, Span)],
        background: f64,
    ) -> Option<f64> {
        if on_edge.iter().any(|(other, _)| usize::from(*other) == object) {
            return None;
        }
        let strength = self.strength(object, background);
        (strength > 0.0).then_some(strength)
    }

    /// What an edge makes of a body so strong that is beside it alone.
    pub(super) fn passed_by_strong(&self, strength: f64, lines: &Lines<'_>, fill: &Fill) -> PassedBy {
        if self.fields[lines.object()].of_box().is_none() && self.surfaces.roundness(lines.object()).is_some()
        {
            return PassedBy { gap: 0.0, part: 1.0 - strength };
        }
        let (mut all, mut sum) = (0.0, 0.0);
        for line in 0..LINES {
            let [enter, exit] = [fill.enter[line], fill.exit[line]];
            let volume = fill.part[line] * (exit - enter);
            (all, sum) = (all + volume, sum + 0.5 * volume * (enter + exit));
        }
        if all == 0.0 {
            return PassedBy::LINES_ALONE;
        }
        let gap = lines.span_to_next(sum / all).map_or(0.0, |(body, way)| {
            let [before, behind] = [body.enter, 1.0 - body.exit];
            let counts = |more: f64| (more / LONGER).clamp(0.0, 1.0);
            strength * counts(before - behind) * counts(body.exit - body.enter) * before * way
        });
        PassedBy { gap, part: 1.0 }
    }
}
