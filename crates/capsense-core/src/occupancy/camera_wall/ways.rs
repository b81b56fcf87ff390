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
    pair: u32,
    object: u16,
    end: u16,
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
        let (object, end, number) = (object as u16, end as u16, pair as u32);
        let mut place = places[pair] as usize;
        if known.get(place).is_none_or(|known| known.pair != number) {
            place = known.len();
            places[pair] = place as u32;
            known.push(Known { pair: number, object, end, way: find() });
        } else if (known[place].object, known[place].end) != (object, end) {
            // Of several objects or steps along the same rays, each is before or behind the others.
            known[place] = Known { pair: number, object, end, way: find() };
        }
        known[place].way.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::occupancy::{DepthLayers, OrthographicView, Surfaces};
    use glam::DVec3;

    /// Between points of an image with slopes, steps and gaps, a way finds at every depth the wall that is found there alone.
    #[test]
    fn a_way_tells_of_walls_at_every_depth() {
        const PIXELS: usize = 16;
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::splat(1.0) };
        let mut image = DepthLayers::empty(OrthographicView { domain, width: PIXELS, height: PIXELS }, 1);
        let (front, back) = image.layer_mut(0);
        for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
            let (column, row) = (pixel % PIXELS, pixel / PIXELS);
            if (3..12).contains(&column) && (row + column) % 7 != 0 {
                *front = 0.2 + 0.01 * column as f32 + if row > 9 { 0.3 } else { 0.0 };
                *back = *front + 0.02 * (row + 2) as f32;
            }
        }
        let (mut walls, mut misses) = (0, 0);
        for step in 0..400 {
            let at = |number: usize| (step * number % 101) as f64 / 100.0;
            let (from, to) = ([at(7), at(11)], [at(13), at(17)]);
            let to = if step % 2 == 0 { [from[0], to[1]] } else { [to[0], from[1]] };
            for z in (0..40).map(|k| 0.025 * f64::from(k)) {
                let [a, b] = [from, to].map(|[x, y]| DVec3::new(x, y, z));
                let depths = [z - 0.1, z + 0.07];
                let alone = image.wall_between(0, a, b, depths);
                let way = image.way_between(0, a.with_z(0.0), b.with_z(0.0));
                match way.and_then(|way| Some(way.wall_before(way.span_at(z)?, depths))) {
                    Some(told) => assert_eq!(told, alone, "{a} {b}"),
                    None => misses += usize::from(alone.is_none()),
                }
                walls += usize::from(alone.is_some());
            }
        }
        assert!(walls > 100 && misses > 100, "{walls} {misses}");
    }

    /// What was found between two columns is kept until another object, or the other end, is asked for.
    #[test]
    fn what_is_between_columns_is_found_once() {
        let layer = |object, end| Layer { object, end, faces: [0.0; 2] };
        let way = |spacing| {
            Some(LayerWay { part: [0.0, 1.0], faces: [[0.0; 2]; 2], seen: [0.0; 2], behind: None, spacing })
        };
        let mut ways = Ways::default();
        for _ in 0..2 {
            ways.start(5);
            assert_eq!(ways.of(3, &layer(0, 1), || way(1.0)), way(1.0).as_ref());
            assert_eq!(ways.of(8, &layer(0, 1), || None), None);
            assert_eq!(ways.of(3, &layer(0, 1), || way(2.0)), way(1.0).as_ref());
            assert_eq!(ways.of(3, &layer(0, 0), || way(3.0)), way(3.0).as_ref());
            assert_eq!(ways.of(8, &layer(2, 1), || way(4.0)), way(4.0).as_ref());
        }
    }
}
