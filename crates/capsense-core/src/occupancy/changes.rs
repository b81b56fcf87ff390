//! Where the answers of surfaces may differ from those of the frame before.

use super::comparison::Comparison;
use super::near_field::{self, KnownField, PlateEnds};
use super::{DepthLayers, EdgeGeometry, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Edges, Planes};
use glam::DAffine3;
use std::sync::Arc;

/// What an earlier frame left to compare the next one with.
#[derive(Clone, Debug, Default)]
pub struct Earlier {
    image: Option<DepthLayers>,
    comparison: Comparison,
    /// Which solids stood at the poses below.
    solids: Option<Arc<()>>,
    poses: Vec<DAffine3>,
}

impl Earlier {
    /// Takes a frame of which nothing can be remembered.
    pub(super) fn forget(&mut self) {
        (self.image, self.solids) = (None, None);
    }

    /// The earlier depth image, if it shows as many objects by the same camera as another, and what compares them.
    pub(super) fn image_like(&mut self, image: &DepthLayers) -> Option<(&mut DepthLayers, &mut Comparison)> {
        let earlier = self.image.as_mut().filter(|earlier| image.is_comparable_to(earlier))?;
        Some((earlier, &mut self.comparison))
    }

    pub(super) fn remember_image(&mut self, image: &DepthLayers) {
        self.forget();
        self.image = Some(image.clone());
    }

    /// The earlier poses of the same solids.
    pub(crate) fn poses_of(&mut self, solids: &Arc<()>) -> Option<&mut [DAffine3]> {
        let are_same = self.solids.as_ref().is_some_and(|earlier| Arc::ptr_eq(earlier, solids));
        are_same.then_some(self.poses.as_mut_slice())
    }

    pub(crate) fn remember_poses(&mut self, solids: &Arc<()>, poses: impl Iterator<Item = DAffine3>) {
        self.forget();
        self.solids = Some(solids.clone());
        self.poses.clear();
        self.poses.extend(poses);
    }
}

/// Boxes outside of which no answer differs from that of an earlier frame.
#[derive(Clone, Debug, Default)]
pub struct Regions {
    boxes: Vec<Aabb>,
    /// Where edges and round surfaces of objects that differ were or are, and where two objects are near each other.
    around_edges: Vec<Aabb>,
    /// Objects that differ.
    objects: Vec<usize>,
    spacing: f64,
}

impl Regions {
    /// No boxes yet; they need not be smaller than for a mesh of this mean spacing in metres.
    pub fn for_spacing(spacing: f64) -> Self {
        Self { spacing, ..Self::default() }
    }

    /// The boxes found. They may overlap.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// Boxes around edges, where surfaces turn abruptly, of what differs.
    pub(crate) fn around_edges(&mut self) -> &mut Vec<Aabb> {
        &mut self.around_edges
    }

    /// Has nodes around all boxes from a number on look at conductors again, as around edges.
    pub(crate) fn are_around_edges(&mut self, first: usize) {
        self.around_edges.extend_from_slice(&self.boxes[first..]);
    }

    /// Takes note that an object differs; returns the mean distance between nodes of the mesh, below which smaller boxes
    /// hardly save anything, and where to append boxes. They may overlap.
    pub(crate) fn of_object(&mut self, object: usize) -> (f64, &mut Vec<Aabb>) {
        self.objects.push(object);
        (self.spacing, &mut self.boxes)
    }
}

/// What was seen in the frame before, and what is different now.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    /// Where each object is.
    bounds: Vec<Aabb>,
    /// What is known of the field around each.
    fields: Vec<KnownField>,
    /// Of each that is a plate, what its ends change.
    ends: Vec<PlateEnds>,
    materials: Vec<Material>,
    earlier: Earlier,
    regions: Regions,
    /// For each box, the planes that touch it, if the mesh is a lattice.
    planes: Vec<Planes>,
}

impl Changes {
    /// Compares the surfaces of a new frame with those of the frame before.
    pub(super) fn find(&mut self, mesh: &EdgeGeometry<'_>, materials: &[Material], surfaces: &dyn Surfaces) {
        let regions = &mut self.regions;
        if regions.spacing == 0.0 {
            regions.spacing = mean_spacing(mesh);
        }
        regions.boxes.clear();
        regions.around_edges.clear();
        regions.objects.clear();
        let are_told = surfaces.find_changes(&mut self.earlier, regions);
        if are_told && self.materials == materials {
            for &object in &regions.objects {
                let before = std::mem::replace(&mut self.bounds[object], surfaces.bounds(object));
                // Cameras know of no edges.
                for moved in [before, self.bounds[object]].into_iter().filter(|_| surfaces.are_exact()) {
                    let others = self.bounds.iter().enumerate().filter(|(other, _)| *other != object);
                    let common = others.filter_map(|(_, other)| near_both(mesh, &moved, other));
                    regions.around_edges.extend(common);
                }
            }
        } else {
            regions.boxes.clear();
            regions.boxes.extend(&self.bounds);
            self.bounds.clear();
            self.bounds.extend((0..materials.len()).map(|object| surfaces.bounds(object)));
            regions.boxes.extend(&self.bounds);
            regions.boxes.retain(|region| region.min.cmple(region.max).all());
            regions.around_edges.clone_from(&regions.boxes);
            self.materials.clear();
            self.materials.extend(materials);
        }
        self.fields.clear();
        self.fields.extend((0..materials.len()).map(|object| KnownField::around(surfaces, object)));
        self.ends.resize_with(materials.len(), PlateEnds::default);
        for (object, ends) in self.ends.iter_mut().enumerate() {
            ends.take(object, mesh.edges, &materials[object], &self.fields[object]);
        }
        // From below, so that what is met on the way mostly is met in order.
        regions.boxes.sort_unstable_by(|a, b| a.min.z.total_cmp(&b.min.z));
        self.planes.clear();
        if let Edges::Lattice(lattice) = mesh.edges {
            self.planes.extend(regions.boxes.iter().map(|region| lattice.planes_within(region)));
        }
    }

    /// Where each object is.
    pub(super) fn bounds(&self) -> &[Aabb] {
        &self.bounds
    }

    /// What is known of the field around each object.
    pub(super) fn fields(&self) -> &[KnownField] {
        &self.fields
    }

    /// What the ends of each object change, if it is a plate.
    pub(super) fn ends(&self) -> &[PlateEnds] {
        &self.ends
    }

    /// Boxes outside of which no answer differs from that of the frame before. They may overlap.
    pub(super) fn regions(&self) -> &[Aabb] {
        &self.regions.boxes
    }

    /// For each of them, the planes that touch it, if the mesh is a lattice.
    pub(super) fn planes(&self) -> &[Planes] {
        &self.planes
    }

    /// Visits the nodes in them, some several times.
    pub(super) fn for_nodes_near(&self, mesh: &EdgeGeometry<'_>, mut visit: impl FnMut(usize)) {
        match mesh.edges {
            Edges::Lattice(lattice) => {
                let planes = self.planes.iter();
                planes.for_each(|planes| lattice.for_rows_of(planes, |row| row.for_each(&mut visit)));
            }
            edges @ Edges::List(_) => {
                let regions = self.regions().iter();
                regions.for_each(|region| edges.for_nodes_near(mesh.nodes, region, &mut visit));
            }
        }
    }

    /// Boxes outside of which no edge of an object was or is, of what differs, nor are two objects near each other.
    pub(super) fn around_edges(&self) -> &[Aabb] {
        &self.regions.around_edges
    }
}

/// What is near to two objects. What a node makes of an edge of one object depends on where the other is.
fn near_both(mesh: &EdgeGeometry<'_>, a: &Aabb, b: &Aabb) -> Option<Aabb> {
    let [a, b] = [a, b].map(|near| near_field::grown_more(mesh.edges, near, near_field::MORE_PLANES));
    a.intersects(&b).then(|| Aabb { min: a.min.max(b.min), max: a.max.min(b.max) })
}

/// The edge of a cube that is as large as what a node has around it on average.
fn mean_spacing(mesh: &EdgeGeometry<'_>) -> f64 {
    let size = Aabb::around(mesh.nodes.iter().copied()).size();
    (size.element_product() / mesh.nodes.len() as f64).cbrt()
}
