//! The edge rule: what objects make of one mesh edge.

use super::{NO_OBJECT, Span};
use crate::material::Material;

/// No edge is shortened to less than this part of its length. A gap that small is a contact; without the bound its
/// weight would drown all others.
pub const SMALLEST_PART: f64 = 1e-3;

/// What is left of an edge: a part that still couples its ends, and links from its ends to the surfaces of conducting
/// objects in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// What multiplies the edge's weight between its ends.
    pub through: f64,
    /// What multiplies it in the link from either end; zero where there is none.
    pub factor: [f64; 2],
    /// The object that the link from either end leads to, or [`NO_OBJECT`].
    pub object: [u16; 2],
}

impl Coupling {
    /// An edge that no object touches.
    pub const PLAIN: Self = Self::only_through(1.0);

    pub(super) const fn only_through(through: f64) -> Self {
        Self { through, factor: [0.0; 2], object: [NO_OBJECT; 2] }
    }

    /// Whether there is a link.
    pub fn is_linked(&self) -> bool {
        self.object != [NO_OBJECT; 2]
    }

    /// For each link, which end it starts at, the object it leads to, and its factor.
    pub fn links(&self) -> impl Iterator<Item = (usize, u16, f64)> {
        let links = (0..2).map(|end| (end, self.object[end], self.factor[end]));
        links.filter(|&(_, object, _)| object != NO_OBJECT)
    }

    /// That of an edge which weighs more or less by a factor.
    pub(super) fn scaled(self, part: f64) -> Self {
        Self { through: part * self.through, factor: self.factor.map(|factor| part * factor), ..self }
    }

    /// Whether the edge, its ends held by `owners`, meets two different conductors.
    pub(super) fn meets_two(&self, owners: [u16; 2]) -> bool {
        let mut met = owners.into_iter().chain(self.object).filter(|&object| object != NO_OBJECT);
        met.next().is_some_and(|first| met.any(|other| other != first))
    }

    /// Whether two couplings are the same bit for bit. Number by number: what was just written in parts is slow to be read
    /// as a whole.
    #[inline]
    pub(super) fn is(&self, other: &Self) -> bool {
        let differs = |a: f64, b: f64| a.to_bits() ^ b.to_bits();
        let [from, to] = [0, 1].map(|end| differs(self.factor[end], other.factor[end]));
        let objects = [0, 1].map(|end| u64::from(self.object[end] ^ other.object[end]));
        differs(self.through, other.through) | from | to | objects[0] | objects[1] == 0
    }
}

/// Whether a conductor that fills this part of an edge is at each of its ends: the gap left is one that
/// [`SMALLEST_PART`] bounds, or none.
pub(super) fn touches(span: Span) -> [bool; 2] {
    [span.enter < SMALLEST_PART, span.exit > 1.0 - SMALLEST_PART]
}

/// ∫ ε_background/ε dt from `a` to `b`, with one dielectric in between.
#[inline]
fn series_past_one(span: Span, ratio: f64, [a, b]: [f64; 2]) -> f64 {
    let (enter, exit) = (span.enter.clamp(a, b), span.exit.clamp(a, b));
    (enter - a) + (exit - enter) / ratio + (b - exit)
}

/// One edge and the objects around it.
pub(super) struct EdgeRule<'a> {
    /// The conductor that holds each end, or [`NO_OBJECT`].
    pub(super) owners: [u16; 2],
    /// Objects that the edge passes through, in the order in which they are listed.
    pub(super) spans: &'a mut Vec<(u16, Span)>,
    pub(super) materials: &'a [Material],
    /// Relative permittivity without objects.
    pub(super) background: f64,
}

impl EdgeRule<'_> {
    /// Applies the rule. `breaks` is working storage.
    #[inline(always)]
    pub(super) fn coupling(self, breaks: &mut Vec<f64>) -> Coupling {
        let [from, to] = self.owners;
        if self.owners == [NO_OBJECT; 2] && self.conductors().next().is_none() {
            return self.only_through(0.0, 1.0, breaks);
        }
        if from == to && (from != NO_OBJECT || self.spans.is_empty()) {
            return Coupling::PLAIN;
        }
        let first = self.contact(from, 0.0, |span| span.enter, |candidate, best| candidate < best);
        let last = self.contact(to, 1.0, |span| span.exit, |candidate, best| candidate > best);
        let (Some((first, enter)), Some((last, exit))) = (first, last) else {
            return self.only_through(0.0, 1.0, breaks);
        };
        match (from != NO_OBJECT, to != NO_OBJECT) {
            (true, true) => self.only_through(self.exit_of(from), self.enter_of(to), breaks),
            (true, false) if last == from => self.only_through(exit, 1.0, breaks),
            (false, true) if first == to => self.only_through(0.0, enter, breaks),
            _ => {
                let mut link = |owner: u16, object: u16, a: f64, b: f64| match owner {
                    NO_OBJECT => (object, 1.0 / self.series(a, b, breaks)),
                    _ => (NO_OBJECT, 0.0),
                };
                // Put together from numbers: arrays that are written one by one are slow to be read as a whole.
                let [(at_from, from), (at_to, to)] =
                    [link(from, first, 0.0, enter), link(to, last, exit, 1.0)];
                Coupling { through: 0.0, factor: [from, to], object: [at_from, at_to] }
            }
        }
    }

    /// What is left of it from one place on it to another.
    #[inline]
    pub(super) fn only_through(&self, a: f64, b: f64, breaks: &mut Vec<f64>) -> Coupling {
        Coupling::only_through(1.0 / self.series(a, b, breaks))
    }

    /// The conductor met first when coming from one end, and where. Of several at one place the first listed counts.
    fn contact(
        &self,
        owner: u16,
        end: f64,
        place: impl Fn(&Span) -> f64,
        nearer: impl Fn(f64, f64) -> bool,
    ) -> Option<(u16, f64)> {
        if owner != NO_OBJECT {
            return Some((owner, end));
        }
        let on_the_way = self.conductors().map(|(object, span)| (object, place(&span)));
        let met =
            on_the_way.reduce(|best, candidate| if nearer(candidate.1, best.1) { candidate } else { best });
        // An end that a conductor holds is a contact even where the surface's own answer misses it by rounding.
        let held = self.owners.into_iter().find(|&owner| owner != NO_OBJECT);
        met.or(held.map(|object| (object, 1.0 - end)))
    }

    pub(super) fn conductors(&self) -> impl Iterator<Item = (u16, Span)> {
        self.spans
            .iter()
            .copied()
            .filter(|&(object, _)| matches!(self.materials[usize::from(object)], Material::Conductor(_)))
    }

    fn exit_of(&self, object: u16) -> f64 {
        self.conductors().find(|&(other, _)| other == object).map_or(0.0, |(_, span)| span.exit)
    }

    fn enter_of(&self, object: u16) -> f64 {
        self.conductors().find(|&(other, _)| other == object).map_or(1.0, |(_, span)| span.enter)
    }

    /// ∫ ε_background/ε dt from `a` to `b`: parts along the edge are capacitors in series. Where dielectrics overlap,
    /// the first listed counts.
    fn series(&self, a: f64, b: f64, breaks: &mut Vec<f64>) -> f64 {
        let b = b.max(a + SMALLEST_PART);
        let mut dielectrics = self.dielectrics();
        match (dielectrics.next(), dielectrics.next()) {
            (None, _) => return b - a,
            (Some((permittivity, span)), None) => {
                return series_past_one(span, permittivity / self.background, [a, b]);
            }
            _ => {}
        }
        breaks.clear();
        breaks.extend([a, b]);
        for (_, span) in self.dielectrics() {
            breaks.extend([span.enter, span.exit].into_iter().filter(|&t| t > a && t < b));
        }
        breaks.sort_unstable_by(f64::total_cmp);
        breaks
            .windows(2)
            .map(|piece| {
                let middle = 0.5 * (piece[0] + piece[1]);
                let filled = self.dielectrics().find(|(_, span)| span.enter <= middle && middle <= span.exit);
                (piece[1] - piece[0]) / filled.map_or(1.0, |(permittivity, _)| permittivity / self.background)
            })
            .sum()
    }

    fn dielectrics(&self) -> impl Iterator<Item = (f64, Span)> {
        self.spans.iter().filter_map(|&(object, span)| match self.materials[usize::from(object)] {
            Material::Dielectric(permittivity) => Some((permittivity.value(), span)),
            Material::Conductor(_) => None,
        })
    }
}
