//! Where the answers of surfaces may differ from those of the frame before.

use super::comparison::Comparison;
use super::{DepthLayers, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;

/// What was seen in the frame before, and what is different now.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    /// Where each object is.
    bounds: Vec<Aabb>,
    materials: Vec<Material>,
    image: Option<DepthLayers>,
    regions: Vec<Aabb>,
    comparison: Comparison,
}

impl Changes {
    /// Compares the surfaces of a new frame with those of the frame before.
    pub(super) fn find(&mut self, materials: &[Material], surfaces: &dyn Surfaces) {
        self.regions.clear();
        let image = surfaces.depth_image();
        let before = self.image.as_ref().filter(|_| self.materials == materials);
        let pair = image.zip(before).filter(|(now, before)| now.is_comparable_to(before));
        if let Some((now, before)) = pair {
            let mut differs = false;
            for (object, bounds) in self.bounds.iter_mut().enumerate() {
                if self.comparison.find(object, [before, now], &mut self.regions) {
                    *bounds = now.bounds(object);
                    differs = true;
                }
            }
            if differs && let Some(before) = &mut self.image {
                before.copy_from(now);
            }
        } else {
            self.regions.extend(&self.bounds);
            self.bounds.clear();
            self.bounds.extend((0..materials.len()).map(|object| surfaces.bounds(object)));
            self.regions.extend(&self.bounds);
            self.regions.retain(|region| region.min.cmple(region.max).all());
            self.materials.clear();
            self.materials.extend(materials);
            self.image = image.cloned();
        }
        // From below, so that what is met on the way mostly is met in order.
        self.regions.sort_unstable_by(|a, b| a.min.z.total_cmp(&b.min.z));
    }

    /// Where each object is.
    pub(super) fn bounds(&self) -> &[Aabb] {
        &self.bounds
    }

    /// Boxes outside of which no answer differs from that of the frame before. They may overlap.
    pub(super) fn regions(&self) -> &[Aabb] {
        &self.regions
    }
}
