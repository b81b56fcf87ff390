//! Which dielectric an edge passes through, and where.

use super::{NO_OBJECT, Span};
use crate::material::Material;

/// The part of an edge that the first listed dielectric on it fills.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filled {
    /// The dielectric, or [`NO_OBJECT`].
    pub(super) object: u16,
    pub(super) span: Span,
}

impl Filled {
    pub(super) const NOTHING: Self = Self { object: NO_OBJECT, span: Span { enter: 0.0, exit: 0.0 } };

    /// From all objects that the edge passes through, in the order in which they are listed.
    pub(super) fn first_of(spans: &[(u16, Span)], materials: &[Material]) -> Self {
        let is_dielectric =
            |(object, _): &&(u16, Span)| matches!(materials[usize::from(*object)], Material::Dielectric(_));
        spans.iter().find(is_dielectric).map_or(Self::NOTHING, |&(object, span)| Self { object, span })
    }

    /// The same seen from the other end.
    pub(super) fn turned(self) -> Self {
        let Span { enter, exit } = self.span;
        let is_something = self.object != NO_OBJECT;
        if is_something { Self { span: Span { enter: 1.0 - exit, exit: 1.0 - enter }, ..self } } else { self }
    }

    /// How long it is, in parts of the edge.
    pub(super) fn part(&self) -> f64 {
        self.span.exit - self.span.enter
    }

    /// Whether both are the same bit for bit.
    pub(super) fn is(&self, other: &Self) -> bool {
        let bits = |of: &Self| (of.object, of.span.enter.to_bits(), of.span.exit.to_bits());
        bits(self) == bits(other)
    }
}
