//! Surfaces of which no more is told than where edges of a mesh meet them.

use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::occupancy::{Earlier, InvalidDepth, Regions, Span, Surfaces};

/// So a lattice makes of them what any mesh of the same nodes does.
pub struct EdgesAlone<S>(pub S);

impl<S: Surfaces> Surfaces for EdgesAlone<S> {
    fn objects(&self) -> usize {
        self.0.objects()
    }

    fn validate(&self) -> Result<(), InvalidDepth> {
        self.0.validate()
    }

    fn bounds(&self, object: usize) -> Aabb {
        self.0.bounds(object)
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        self.0.contains(object, point)
    }

    fn contains_as_measured(&self, object: usize, point: DVec3) -> bool {
        self.0.contains_as_measured(object, point)
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        self.0.span(object, a, b)
    }

    fn find_changes(&self, before: &mut Earlier, regions: &mut Regions) -> bool {
        self.0.find_changes(before, regions)
    }
}
