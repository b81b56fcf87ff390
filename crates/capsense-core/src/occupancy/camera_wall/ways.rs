//! What is the same of walls between two rays at all depths, found once for all planes of nodes.

use super::RAYS;
use super::layers::Layer;
use crate::occupancy::LayerWay;

/// An edge across the rays, and the columns of nodes that it leads between.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeAcross {
    pub(super) number: usize,
    pub(super) columns: [usize; 2],
}

impl EdgeAcross {
    /// The number of that pair of columns.
    #[inline]
    pub(super) fn pair(self) -> usize {
        RAYS * self.columns[0] + self.number % 3
    }
}

/// The ways from one ray to the next along which walls were looked for in a frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Ways {
    /// For each pair of columns, where its way is among those known, if that one is of this pair.
    places: Vec<u32>,
    known: Vec<Known>,
}

/// The way between a pair of columns to an object along the ray at one end.
#[derive(Clone, Copy, Debug)]
struct Known {
    pair: usize,
    object: usize,
    end: usize,
    way: Option<LayerWay>,
}

impl Ways {
    /// Forgets all, of so many columns.
    pub(super) fn start(&mut self, columns: usize) {
        self.known.clear();
        self.places.resize(RAYS * columns, 0);
    }

    /// The way between a pair of columns to what is along one ray alone, which is found if it is not known.
    #[inline]
    pub(super) fn of(
        &mut self,
        pair: usize,
        &Layer { object, end, .. }: &Layer,
        find: impl FnOnce() -> Option<LayerWay>,
    ) -> Option<&LayerWay> {
        let Self { places, known } = self;
        let mut place = places[pair] as usize;
        if known.get(place).is_none_or(|known| known.pair != pair) {
            place = known.len();
            places[pair] = place as u32;
            known.push(Known { pair, object, end, way: find() });
        } else if (known[place].object, known[place].end) != (object, end) {
            // Of several objects or steps along the same rays, each is before or behind the others.
            known[place] = Known { pair, object, end, way: find() };
        }
        known[place].way.as_ref()
    }
}
