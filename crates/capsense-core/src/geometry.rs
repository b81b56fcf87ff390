//! Boxes, poses and the shapes of objects, in metres.
//!
//! Transforms are named `a_from_b`: they take coordinates in frame b to coordinates in frame a.

use glam::{DQuat, DVec3};
use std::sync::Arc;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Corner with the smallest coordinates.
    pub min: DVec3,
    /// Corner with the largest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// The box that contains nothing; the neutral element of [`Aabb::including`].
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around some points ([`Aabb::EMPTY`] when there are none).
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// The smallest box that contains this one and a point.
    #[must_use]
    pub fn including(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Whether a point lies inside or on the surface.
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Whether two boxes have a point in common.
    #[inline(always)]
    pub fn intersects(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}

/// Where an object stands: a rotation about its centre, then a translation (`sensor_from_object`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the object's origin in the sensor frame.
    pub translation: DVec3,
    /// Orientation, of unit length.
    pub rotation: DQuat,
}

impl Pose {
    /// Object frame and sensor frame coincide.
    pub const IDENTITY: Self = Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// An unrotated object at a position.
    pub fn at(translation: DVec3) -> Self {
        Self { translation, rotation: DQuat::IDENTITY }
    }

    /// Whether every component is finite and the rotation is of unit length.
    pub fn is_valid(&self) -> bool {
        self.translation.is_finite() && self.rotation.is_finite() && self.rotation.is_normalized()
    }

    /// Takes a point from the object's frame to the sensor's.
    pub fn sensor_from_object(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// Takes a point from the sensor's frame to the object's.
    pub fn object_from_sensor(&self, point: DVec3) -> DVec3 {
        self.rotation.inverse() * (point - self.translation)
    }
}

/// Why a triangle mesh is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TriangleMeshError {
    /// There is nothing in it.
    #[error("the mesh has no triangles")]
    Empty,
    /// A vertex has a coordinate that is NaN or infinite.
    #[error("vertex {0} is not finite")]
    NonFiniteVertex(usize),
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but there are only {vertices}")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The index it names.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
}

/// A surface of triangles in the object's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Checks and takes a surface.
    ///
    /// # Errors
    /// When there are no triangles, a vertex is not finite, or an index is out of range.
    pub fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, TriangleMeshError> {
        if triangles.is_empty() {
            return Err(TriangleMeshError::Empty);
        }
        if let Some(bad) = vertices.iter().position(|v| !v.is_finite()) {
            return Err(TriangleMeshError::NonFiniteVertex(bad));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(TriangleMeshError::IndexOutOfRange {
                    triangle,
                    vertex,
                    vertices: vertices.len(),
                });
            }
        }
        Ok(Self { vertices, triangles })
    }

    /// Corner points in metres.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Indices of the corners of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}

/// The shape of an object, centred on the origin of its own frame. Lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid.
    Box {
        /// Edge lengths.
        size: DVec3,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder along z with a hemisphere on either end.
    Capsule {
        /// Radius of cylinder and hemispheres.
        radius: f64,
        /// Distance between the centres of the hemispheres.
        length: f64,
    },
    /// A cylinder along z with flat ends.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Distance between the flat ends.
        length: f64,
    },
    /// A triangle surface, in its own coordinates.
    Mesh(Arc<TriangleMesh>),
}

impl Shape {
    /// Radius of the smallest ball around the object's origin that holds the shape.
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Box { size } => 0.5 * size.length(),
            Self::Sphere { radius } => *radius,
            Self::Capsule { radius, length } => radius + 0.5 * length,
            Self::Cylinder { radius, length } => radius.hypot(0.5 * length),
            Self::Mesh(mesh) => mesh.vertices().iter().map(|v| v.length()).fold(0.0, f64::max),
        }
    }

    /// The centre, from the object's origin, and the radius of a ball that holds the shape, around the box of a mesh that may be far from
    /// its origin.
    pub fn bounding_ball(&self) -> (DVec3, f64) {
        let Self::Mesh(mesh) = self else { return (DVec3::ZERO, self.bounding_radius()) };
        let bounds = Aabb::around(mesh.vertices().iter().copied());
        let centre = 0.5 * (bounds.min + bounds.max);
        (centre, mesh.vertices().iter().map(|v| v.distance(centre)).fold(0.0, f64::max))
    }
}
