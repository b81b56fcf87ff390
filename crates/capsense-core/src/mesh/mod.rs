//! Tetrahedral meshes: nodes, elements, and the permittivity of what fills them when no object is there.

mod background;
mod bins;
mod bisection;
mod edges;
mod gradients;
mod lattice;
mod numbering;
mod quality;
mod tets;

pub use background::Background;
pub use bisection::{Bisection, Refinement, largest_first};
pub use edges::{EdgeList, Edges};
pub use gradients::barycentric_gradients;
pub(crate) use lattice::{Along, spaced_axis};
pub use lattice::{InvalidAxis, Lattice, graded_axis};
pub use numbering::places;
pub use quality::MeshQuality;
pub use tets::Tets;

pub(crate) use bins::Bins;
pub(crate) use edges::{Planes, for_lattice_edges};
pub(crate) use gradients::{CANCELLED, EdgeShare};

use crate::geometry::Aabb;
use glam::DVec3;

/// Why a mesh is refused. Elements and nodes are counted from 0, in the order in which they were given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing in it.
    #[error("the mesh has no tetrahedra")]
    Empty,
    /// More nodes than 32-bit indices can name.
    #[error("the mesh has {0} nodes, more than 32-bit indices can name")]
    TooManyNodes(usize),
    /// More tetrahedra than 32-bit indices can name.
    #[error("the mesh has {0} tetrahedra, more than 32-bit indices can name")]
    TooManyElements(usize),
    /// A coordinate is NaN or infinite.
    #[error("node {0} has a coordinate that is not finite")]
    NonFiniteNode(usize),
    /// An element names a node that does not exist.
    #[error("tetrahedron {element} names node {node}, but there are only {nodes} nodes")]
    NodeOutOfRange {
        /// Index of the tetrahedron.
        element: usize,
        /// The node it names.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// The four nodes of an element are in the wrong order.
    #[error("tetrahedron {element} is inverted (signed volume {volume:e} m³)")]
    Inverted {
        /// Index of the tetrahedron.
        element: usize,
        /// Signed volume in cubic metres.
        volume: f64,
    },
    /// The four nodes of an element lie in one plane.
    #[error("tetrahedron {element} has no volume ({volume:e} m³)")]
    ZeroVolume {
        /// Index of the tetrahedron.
        element: usize,
        /// Signed volume in cubic metres.
        volume: f64,
    },
    /// A node belongs to no element.
    #[error("node {0} is an orphan: no tetrahedron uses it")]
    OrphanNode(usize),
    /// There is not one permittivity for each element, or one is not positive.
    #[error("tetrahedron {element} has relative permittivity {value}; it must be finite and positive")]
    Permittivity {
        /// Index of the tetrahedron.
        element: usize,
        /// The value given.
        value: f64,
    },
}

/// Volume below this part of the cube of the longest edge counts as zero.
const FLAT: f64 = 1e-14;

/// A conforming mesh of tetrahedra with positive orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct TetMesh {
    nodes: Vec<DVec3>,
    tets: Tets,
    relative_permittivity: Background,
}

impl TetMesh {
    /// Checks and takes a mesh in which everything is vacuum.
    ///
    /// # Errors
    /// For an empty mesh, nodes that are not finite or in no element, and elements that name missing nodes, are
    /// inverted or have no volume.
    pub fn new(nodes: Vec<DVec3>, tets: Vec<[u32; 4]>) -> Result<Self, MeshError> {
        Self::checked(nodes, Tets::listed(tets))
    }

    fn checked(mut nodes: Vec<DVec3>, tets: Tets) -> Result<Self, MeshError> {
        if tets.is_empty() {
            return Err(MeshError::Empty);
        }
        if u32::try_from(nodes.len()).is_err() {
            return Err(MeshError::TooManyNodes(nodes.len()));
        }
        if let Some(bad) = nodes.iter().position(|node| !node.is_finite()) {
            return Err(MeshError::NonFiniteNode(bad));
        }
        let mut used = vec![false; nodes.len()];
        for (element, tet) in tets.iter().enumerate() {
            for node in tet {
                *used.get_mut(node as usize).ok_or(MeshError::NodeOutOfRange {
                    element,
                    node,
                    nodes: nodes.len(),
                })? = true;
            }
            check_volume(element, tet.map(|node| nodes[node as usize]))?;
        }
        if let Some(orphan) = used.iter().position(|used| !used) {
            return Err(MeshError::OrphanNode(orphan));
        }
        nodes.shrink_to_fit();
        let relative_permittivity = Background::vacuum(tets.len());
        Ok(Self { nodes, tets, relative_permittivity })
    }

    /// Sets the background's relative permittivity of every element, such as the sensor's substrate.
    ///
    /// # Errors
    /// When a value is not finite and positive.
    pub fn with_permittivity(mut self, of: impl Fn(usize) -> f64) -> Result<Self, MeshError> {
        let values: Vec<f64> = (0..self.tets.len()).map(of).collect();
        let is_bad = |value: &f64| !(value.is_finite() && *value > 0.0);
        if let Some(element) = values.iter().position(is_bad) {
            return Err(MeshError::Permittivity { element, value: values[element] });
        }
        self.relative_permittivity = Background::new(values);
        Ok(self)
    }

    /// Node positions in the sensor frame, metres.
    pub fn nodes(&self) -> &[DVec3] {
        &self.nodes
    }

    /// The four nodes of each element.
    pub fn tets(&self) -> &Tets {
        &self.tets
    }

    /// Relative permittivity of each element without objects.
    pub fn relative_permittivity(&self) -> &Background {
        &self.relative_permittivity
    }

    /// Corner positions of one element.
    pub fn corners(&self, element: usize) -> [DVec3; 4] {
        self.tets.at(element).map(|node| self.nodes[node as usize])
    }

    /// Centre of gravity of one element.
    pub fn centroid(&self, element: usize) -> DVec3 {
        self.corners(element).iter().sum::<DVec3>() / 4.0
    }

    /// The smallest box around all nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::around(self.nodes.iter().copied())
    }

    /// Sum of the volumes of all elements, in cubic metres.
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|element| signed_volume(self.corners(element))).sum()
    }
}

/// A sixth of the triple product of the edges from the first corner.
pub fn signed_volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

/// How the corners of a tetrahedron lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// Seen from the last corner, the first three run counter-clockwise: the volume is positive.
    Positive,
    /// The other way round.
    Inverted,
    /// In one plane but for rounding, or where there is no number for the volume.
    Flat,
}

/// How the corners of a tetrahedron lie.
pub fn orientation(corners: [DVec3; 4]) -> Orientation {
    let volume = signed_volume(corners);
    let longest =
        (0..4).flat_map(|i| (0..i).map(move |j| corners[i].distance(corners[j]))).fold(0.0, f64::max);
    match volume.abs() > FLAT * longest.powi(3) {
        false => Orientation::Flat,
        true if volume < 0.0 => Orientation::Inverted,
        true => Orientation::Positive,
    }
}

fn check_volume(element: usize, corners: [DVec3; 4]) -> Result<(), MeshError> {
    let volume = signed_volume(corners);
    match orientation(corners) {
        Orientation::Positive => Ok(()),
        Orientation::Inverted => Err(MeshError::Inverted { element, volume }),
        Orientation::Flat => Err(MeshError::ZeroVolume { element, volume }),
    }
}
