//! The paper's interface model: an element belongs to the object that the depth image shows before its centroid.

use crate::mesh::TetMesh;
use crate::occupancy::{DepthLayers, OrthographicView};
use glam::DVec3;

/// The relative permittivity of every element, all of the object's or all of the background's.
///
/// An element is occupied when its centroid lies behind the front surface at the centroid's pixel, however far: what
/// the camera cannot see counts as the object that hides it. There is no interpolation between pixels, and back
/// surfaces are not looked at.
#[derive(Clone, Debug)]
pub struct CentroidOccupancy {
    centroids: Vec<DVec3>,
    background: Vec<f64>,
    permittivity: Vec<f64>,
    changed: Vec<u32>,
    /// The pixel of each centroid in the last image's view.
    view: Option<OrthographicView>,
    pixels: Vec<u32>,
}

impl CentroidOccupancy {
    /// Nothing is occupied.
    pub fn new(mesh: &TetMesh) -> Self {
        let centroids: Vec<_> = (0..mesh.tets().len()).map(|element| mesh.centroid(element)).collect();
        Self {
            pixels: vec![0; centroids.len()],
            centroids,
            background: mesh.relative_permittivity().iter().collect(),
            permittivity: mesh.relative_permittivity().iter().collect(),
            changed: Vec::new(),
            view: None,
        }
    }

    /// Moves to the next frame. `of_objects` are the objects' relative permittivities, one for each in the image.
    ///
    /// # Panics
    /// When there are fewer permittivities than objects in the image.
    pub fn update(&mut self, depth: &DepthLayers, of_objects: &[f64]) {
        if self.view != Some(*depth.view()) {
            let pixel = |centroid: &DVec3| depth.view().pixel_of(*centroid) as u32;
            self.pixels = self.centroids.iter().map(pixel).collect();
            self.view = Some(*depth.view());
        }
        let visible: Vec<Option<(f64, f64)>> = depth
            .visible_objects()
            .into_iter()
            .enumerate()
            .map(|(pixel, object)| object.map(|o| (f64::from(depth.front(o)[pixel]), of_objects[o])))
            .collect();
        self.changed.clear();
        for (element, centroid) in self.centroids.iter().enumerate() {
            let permittivity = match visible[self.pixels[element] as usize] {
                Some((front, of_object)) if centroid.z > front => of_object,
                _ => self.background[element],
            };
            if permittivity != self.permittivity[element] {
                self.permittivity[element] = permittivity;
                self.changed.push(element as u32);
            }
        }
    }

    /// Relative permittivity of each element.
    pub fn permittivity(&self) -> &[f64] {
        &self.permittivity
    }

    /// Elements that have another permittivity than in the frame before, in increasing order.
    pub fn changed(&self) -> &[u32] {
        &self.changed
    }
}
