//! Quality of a tetrahedral mesh: dihedral angles, radius ratios, edge lengths.
//!
//! The dihedral angle at an edge is the angle between the parts of its two faces' vectors normal to it; the
//! circumradius of a tetrahedron with edge vectors a, b, c from one corner is
//! |a² b×c + b² c×a + c² a×b| / 12V, its inradius 3V over the surface (Shewchuk, "What is a good linear finite
//! element?", 2002).

use super::{TetMesh, signed_volume};
use glam::DVec3;

/// How well shaped the elements of a mesh are.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshQuality {
    /// Smallest dihedral angle of all elements, degrees.
    pub min_dihedral_degrees: f64,
    /// Largest dihedral angle of all elements, degrees.
    pub max_dihedral_degrees: f64,
    /// Number of elements whose smallest dihedral angle is in [0°, 10°), [10°, 20°), … [80°, 90°). The best element
    /// has 70.53°.
    pub min_dihedral_histogram: [usize; 9],
    /// Smallest radius ratio: three times the inradius over the circumradius, 1 for the regular tetrahedron.
    pub min_radius_ratio: f64,
    /// Mean radius ratio.
    pub mean_radius_ratio: f64,
    /// Shortest edge, metres.
    pub shortest_edge: f64,
    /// Longest edge, metres.
    pub longest_edge: f64,
    /// Sum of the volumes of all elements, cubic metres.
    pub volume: f64,
}

impl MeshQuality {
    /// Measures a mesh.
    pub fn of(mesh: &TetMesh) -> Self {
        let mut quality = Self {
            min_dihedral_degrees: f64::INFINITY,
            max_dihedral_degrees: 0.0,
            min_dihedral_histogram: [0; 9],
            min_radius_ratio: f64::INFINITY,
            mean_radius_ratio: 0.0,
            shortest_edge: f64::INFINITY,
            longest_edge: 0.0,
            volume: 0.0,
        };
        for element in 0..mesh.tets().len() {
            quality.add(mesh.corners(element));
        }
        quality.mean_radius_ratio /= mesh.tets().len() as f64;
        quality
    }

    fn add(&mut self, corners: [DVec3; 4]) {
        let mut smallest = f64::INFINITY;
        for [i, j, k, l] in EDGES {
            let length = corners[i].distance(corners[j]);
            self.shortest_edge = self.shortest_edge.min(length);
            self.longest_edge = self.longest_edge.max(length);
            let angle = dihedral_degrees([corners[i], corners[j], corners[k], corners[l]]);
            smallest = smallest.min(angle);
            self.max_dihedral_degrees = self.max_dihedral_degrees.max(angle);
        }
        self.min_dihedral_degrees = self.min_dihedral_degrees.min(smallest);
        let bin = (smallest / 10.0) as usize;
        self.min_dihedral_histogram[bin.min(8)] += 1;
        let ratio = radius_ratio(corners);
        self.min_radius_ratio = self.min_radius_ratio.min(ratio);
        self.mean_radius_ratio += ratio;
        self.volume += signed_volume(corners);
    }
}

/// The six edges, each followed by the two corners opposite to it.
const EDGES: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];

/// Angle at the edge a–b between the faces with c and with d.
fn dihedral_degrees([a, b, c, d]: [DVec3; 4]) -> f64 {
    let (first, second) = ((b - a).cross(c - a), (b - a).cross(d - a));
    // Exact near 0° and 180° too, where the arc cosine loses half the digits.
    first.cross(second).length().atan2(first.dot(second)).to_degrees()
}

/// Three times the inradius over the circumradius.
fn radius_ratio([o, a, b, c]: [DVec3; 4]) -> f64 {
    let (a, b, c) = (a - o, b - o, c - o);
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    let six_volumes = a.dot(bc).abs();
    let surface = 0.5 * (bc.length() + ca.length() + ab.length() + (b - a).cross(c - a).length());
    let inradius = 0.5 * six_volumes / surface;
    let circumradius = (a.length_squared() * bc + b.length_squared() * ca + c.length_squared() * ab).length()
        / (2.0 * six_volumes);
    3.0 * inradius / circumradius
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn single(corners: [[f64; 3]; 4]) -> MeshQuality {
        let mesh = TetMesh::new(corners.map(DVec3::from).to_vec(), vec![[0, 1, 2, 3]]).unwrap();
        MeshQuality::of(&mesh)
    }

    #[test]
    fn regular_tetrahedron_is_the_best() {
        let quality = single([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]]);
        let angle = (1.0f64 / 3.0).acos().to_degrees();
        assert_relative_eq!(quality.min_dihedral_degrees, angle, max_relative = 1e-12);
        assert_relative_eq!(quality.max_dihedral_degrees, angle, max_relative = 1e-12);
        assert_eq!(quality.min_dihedral_histogram, [0, 0, 0, 0, 0, 0, 0, 1, 0]);
        assert_relative_eq!(quality.min_radius_ratio, 1.0, max_relative = 1e-12);
        assert_relative_eq!(quality.mean_radius_ratio, 1.0, max_relative = 1e-12);
        assert_relative_eq!(quality.shortest_edge, 8f64.sqrt(), max_relative = 1e-12);
        assert_relative_eq!(quality.longest_edge, 8f64.sqrt(), max_relative = 1e-12);
        assert_relative_eq!(quality.volume, 8.0 / 3.0, max_relative = 1e-12);
    }

    #[test]
    fn kuhn_tetrahedron_has_angles_of_45_to_90_degrees() {
        let quality = single([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]]);
        assert_relative_eq!(quality.min_dihedral_degrees, 45.0, max_relative = 1e-12);
        assert_relative_eq!(quality.max_dihedral_degrees, 90.0, max_relative = 1e-12);
        assert_eq!(quality.min_dihedral_histogram, [0, 0, 0, 0, 1, 0, 0, 0, 0]);
        // Inradius 1 / 2(1 + √2), circumradius √3/2.
        let ratio = 3.0 / (2.0 * (1.0 + 2f64.sqrt())) / (3f64.sqrt() / 2.0);
        assert_relative_eq!(quality.min_radius_ratio, ratio, max_relative = 1e-12);
        assert_relative_eq!(quality.shortest_edge, 1.0, max_relative = 1e-12);
        assert_relative_eq!(quality.longest_edge, 3f64.sqrt(), max_relative = 1e-12);
        assert_relative_eq!(quality.volume, 1.0 / 6.0, max_relative = 1e-12);
    }

    #[test]
    fn the_worst_element_sets_the_extremes_and_all_the_mean() {
        // The Kuhn tetrahedron and a flatter one on its face x = 1.
        let nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.1, 0.5, 0.5]];
        let both = TetMesh::new(nodes.map(DVec3::from).to_vec(), vec![[0, 1, 2, 3], [1, 2, 3, 4]]).unwrap();
        let both = MeshQuality::of(&both);
        let kuhn = single([nodes[0], nodes[1], nodes[2], nodes[3]]);
        let flat = single([nodes[1], nodes[2], nodes[3], nodes[4]]);
        assert!(flat.min_dihedral_degrees < kuhn.min_dihedral_degrees);
        assert_eq!(both.min_dihedral_degrees, flat.min_dihedral_degrees);
        assert_eq!(both.max_dihedral_degrees, flat.max_dihedral_degrees);
        assert_eq!(both.min_radius_ratio, flat.min_radius_ratio);
        let mean = 0.5 * (kuhn.min_radius_ratio + flat.min_radius_ratio);
        assert_relative_eq!(both.mean_radius_ratio, mean, max_relative = 1e-12);
        assert_eq!(both.min_dihedral_histogram.iter().sum::<usize>(), 2);
    }
}
