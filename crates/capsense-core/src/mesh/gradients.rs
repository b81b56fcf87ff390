//! What linear elements weigh along their edges.
//!
//! An element of permittivity ε and volume V adds -ε V ∇λ_i·∇λ_j to the weight of the edge between its corners i and j,
//! λ the barycentric coordinates.

use super::signed_volume;
use glam::DVec3;

/// Weights below this part of the factors that made them are rounding errors of zero.
pub(crate) const CANCELLED: f64 = 1e-12;

/// What an element in vacuum adds to the weight of one of its edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeShare {
    /// Which of its corners the edge joins.
    pub(crate) corners: [usize; 2],
    /// In metres.
    pub(crate) weight: f64,
    /// Size of the factors that made the weight.
    pub(crate) magnitude: f64,
}

impl EdgeShare {
    /// The corners that the edges of an element join.
    pub(crate) const CORNERS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    /// Those of all six edges, in the order of [`Self::CORNERS`].
    pub(crate) fn of_element(corners: [DVec3; 4]) -> impl Iterator<Item = Self> + Clone {
        let volume = signed_volume(corners);
        let gradients = barycentric_gradients(corners);
        Self::CORNERS.into_iter().map(move |[i, j]| Self {
            corners: [i, j],
            weight: -volume * gradients[i].dot(gradients[j]),
            magnitude: volume * gradients[i].length() * gradients[j].length(),
        })
    }

    /// Whether the weight is more than a rounding error, as it is not along the diagonals of Kuhn tetrahedra.
    pub(crate) fn counts(&self) -> bool {
        self.weight.abs() > CANCELLED * self.magnitude
    }
}

/// Gradients of the four barycentric coordinates of a tetrahedron, 1/m.
pub fn barycentric_gradients([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    let (u, v, w) = (b - a, c - a, d - a);
    let determinant = u.cross(v).dot(w);
    let of_b = v.cross(w) / determinant;
    let of_c = w.cross(u) / determinant;
    let of_d = u.cross(v) / determinant;
    [-(of_b + of_c + of_d), of_b, of_c, of_d]
}
