//! Triangles for every shape.
//!
//! Curved shapes are drawn with flat facets, so either their corners stick out or their middles fall short. Here the
//! radius of the corners is chosen such that the **volume is that of the exact shape**: the mean error of the surface
//! is then zero, and what remains are ripples of at most [`CHORD_ERROR`] of the radius: corners stick out by up to
//! 0.20 %, facets of a cylinder by 0.08 %. (Facets inscribed in a ball would make it too small everywhere, which a
//! capacitance would show to first order.)
//!
//! Balls are octahedral spheres: ring k of a hemisphere has 4k corners. They have no seam, and their extents along all
//! three axes are equal.

use capsense_core::geometry::{Shape, TriangleMesh, TriangleMeshError};
use glam::DVec3;
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};

/// How far a facet of a curved shape lies from the exact surface at most, as a part of the radius.
pub const CHORD_ERROR: f64 = 0.0021;

/// Rings from a pole of a ball to its equator; a ball has 8 n² = 2048 triangles.
const RINGS: usize = 16;

/// Sides of a cylinder; it has 4 n = 256 triangles.
const SIDES: usize = 64;

/// Why a shape has no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TessellateError {
    /// A length is zero, negative or not finite.
    #[error("the {what} of a {shape} must be positive and finite, not {value} m")]
    InvalidLength {
        /// Kind of shape.
        shape: &'static str,
        /// Which of its lengths.
        what: &'static str,
        /// The length in metres.
        value: f64,
    },
    /// The triangles do not make a mesh.
    #[error(transparent)]
    Mesh(#[from] TriangleMeshError),
}

/// The surface of a shape in the object's frame, with normals (by the right-hand rule) pointing out of it.
/// A mesh is passed through as it is.
///
/// # Errors
/// When a length is zero, negative or not finite. A capsule's length may be zero: it is a ball then.
pub fn tessellate(shape: &Shape) -> Result<Cow<'_, TriangleMesh>, TessellateError> {
    match shape {
        Shape::Box { size } => {
            for value in size.to_array() {
                check("box", "size", value)?;
            }
            cuboid(*size).map(Cow::Owned)
        }
        Shape::Sphere { radius } => {
            check("sphere", "radius", *radius)?;
            capsule(*radius, 0.0).map(Cow::Owned)
        }
        Shape::Capsule { radius, length } => {
            check("capsule", "radius", *radius)?;
            if *length != 0.0 {
                check("capsule", "length", *length)?;
            }
            capsule(*radius, *length).map(Cow::Owned)
        }
        Shape::Cylinder { radius, length } => {
            check("cylinder", "radius", *radius)?;
            check("cylinder", "length", *length)?;
            cylinder(*radius, *length).map(Cow::Owned)
        }
        Shape::Mesh(mesh) => Ok(Cow::Borrowed(mesh)),
    }
}

fn check(shape: &'static str, what: &'static str, value: f64) -> Result<(), TessellateError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(TessellateError::InvalidLength { shape, what, value })
    }
}

fn cuboid(size: DVec3) -> Result<TriangleMesh, TessellateError> {
    // Bit 0 of a corner's index is its side in x, bit 1 in y, bit 2 in z.
    let side = |corner: u32, bit: u32| if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
    let corners = (0..8).map(|c| size * DVec3::new(side(c, 0), side(c, 1), side(c, 2))).collect();
    let quads: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Ok(TriangleMesh::new(corners, triangles)?)
}

fn cylinder(radius: f64, length: f64) -> Result<TriangleMesh, TessellateError> {
    let angle = 2.0 * PI / SIDES as f64;
    // The polygon n/2 R² sin(2π/n) has the area of the circle π r².
    let corner_radius = radius * (angle / angle.sin()).sqrt();
    let mut vertices = vec![DVec3::new(0.0, 0.0, -0.5 * length), DVec3::new(0.0, 0.0, 0.5 * length)];
    for k in 0..SIDES {
        let (sin, cos) = (k as f64 * angle).sin_cos();
        for z in [-0.5 * length, 0.5 * length] {
            vertices.push(DVec3::new(corner_radius * cos, corner_radius * sin, z));
        }
    }
    let mut triangles = Vec::with_capacity(4 * SIDES);
    for k in 0..SIDES as u32 {
        let (low, next) = (2 + 2 * k, 2 + 2 * ((k + 1) % SIDES as u32));
        let (high, next_high) = (low + 1, next + 1);
        triangles.extend([[0, next, low], [1, high, next_high]]);
        triangles.extend([[low, next, next_high], [low, next_high, high]]);
    }
    Ok(TriangleMesh::new(vertices, triangles)?)
}

/// A ball (length 0) or two half balls with a prism between them.
fn capsule(radius: f64, length: f64) -> Result<TriangleMesh, TessellateError> {
    let sphere_volume = unit_sphere_volume();
    let sides = 4 * RINGS;
    let polygon_area = 0.5 * sides as f64 * (2.0 * PI / sides as f64).sin();
    // a R³ + b L R² = exact volume, by Newton's method from R = r. Both terms are convex and R is near r.
    let exact = (4.0 / 3.0 * PI * radius + PI * length) * radius * radius;
    let mut corner_radius = radius;
    for _ in 0..8 {
        let volume = (sphere_volume * corner_radius + polygon_area * length) * corner_radius * corner_radius;
        let slope = (3.0 * sphere_volume * corner_radius + 2.0 * polygon_area * length) * corner_radius;
        corner_radius -= (volume - exact) / slope;
    }
    let (vertices, triangles) = unit_capsule(length / corner_radius);
    let vertices = vertices.into_iter().map(|v| v * corner_radius).collect();
    Ok(TriangleMesh::new(vertices, triangles)?)
}

/// Volume of the facetted ball whose corners are at distance 1.
fn unit_sphere_volume() -> f64 {
    let (vertices, triangles) = unit_capsule(0.0);
    let volume = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| vertices[v as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    triangles.iter().map(volume).sum()
}

/// Facetted capsule of corner radius 1.
fn unit_capsule(length: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for up in [1.0, -1.0] {
        add_hemisphere(&mut vertices, &mut triangles, up, 0.5 * length);
    }
    // The equators: the last ring of either hemisphere. Of a ball they coincide and need no sides.
    if length > 0.0 {
        let sides = 4 * RINGS as u32;
        let (top, bottom) = (vertices.len() as u32 / 2 - sides, vertices.len() as u32 - sides);
        for k in 0..sides {
            let next = (k + 1) % sides;
            triangles.push([bottom + k, bottom + next, top + next]);
            triangles.push([bottom + k, top + next, top + k]);
        }
    }
    (vertices, triangles)
}

/// Half a ball of radius 1 above (`up` = 1) or below (`up` = -1) the plane z = up `offset`.
fn add_hemisphere(vertices: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, up: f64, offset: f64) {
    let base = vertices.len() as u32;
    // Ring k starts after the pole and the 4 + 8 + ... + 4 (k-1) corners of the rings before it.
    let corner = |ring: u32, index: u32| match ring {
        0 => base,
        _ => base + 1 + 2 * ring * (ring - 1) + index % (4 * ring),
    };
    vertices.push(DVec3::new(0.0, 0.0, up * (1.0 + offset)));
    for ring in 1..=RINGS {
        let (sin, cos) = (FRAC_PI_2 * ring as f64 / RINGS as f64).sin_cos();
        let z = if ring == RINGS { offset } else { cos + offset };
        for index in 0..4 * ring {
            let (y, x) = (FRAC_PI_2 * index as f64 / ring as f64).sin_cos();
            vertices.push(DVec3::new(sin * x, sin * y, up * z));
        }
    }
    let mut add = |a, b, c| triangles.push(if up > 0.0 { [a, b, c] } else { [a, c, b] });
    for ring in 1..=RINGS as u32 {
        for quadrant in 0..4 {
            let (inner, outer) = (quadrant * (ring - 1), quadrant * ring);
            for k in 0..ring {
                add(corner(ring - 1, inner + k), corner(ring, outer + k), corner(ring, outer + k + 1));
                if k + 1 < ring {
                    add(
                        corner(ring - 1, inner + k),
                        corner(ring, outer + k + 1),
                        corner(ring - 1, inner + k + 1),
                    );
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn volume(mesh: &TriangleMesh) -> f64 {
        let six = |&[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|v| mesh.vertices()[v as usize]);
            a.dot(b.cross(c))
        };
        mesh.triangles().iter().map(six).sum::<f64>() / 6.0
    }

    /// Every directed edge has its opposite exactly once; vertices are compared by place.
    fn is_closed(mesh: &TriangleMesh) -> bool {
        let key = |v: u32| mesh.vertices()[v as usize].to_array().map(|x| (x * 1e9).round() as i64);
        let mut edges = HashMap::new();
        for &[a, b, c] in mesh.triangles() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((key(from), key(to))).or_insert(0) += 1;
            }
        }
        edges.iter().all(|(&(from, to), &count)| count == 1 && edges.get(&(to, from)) == Some(&1))
    }

    #[test]
    fn surfaces_are_closed_and_have_the_exact_volume() {
        let (radius, length) = (0.03_f64, 0.11);
        let ball = 4.0 / 3.0 * PI * radius.powi(3);
        let tube = PI * radius * radius * length;
        let size = DVec3::new(0.15, 0.1, 0.02);
        for (shape, exact) in [
            (Shape::Box { size }, size.element_product()),
            (Shape::Sphere { radius }, ball),
            (Shape::Capsule { radius, length }, ball + tube),
            (Shape::Capsule { radius, length: 0.0 }, ball),
            (Shape::Cylinder { radius, length }, tube),
        ] {
            let mesh = tessellate(&shape).unwrap();
            assert!(is_closed(&mesh), "{shape:?} has an open edge");
            approx::assert_relative_eq!(volume(&mesh), exact, max_relative = 1e-12);
            assert!(mesh.triangles().len() <= 2200, "{shape:?}: {} triangles", mesh.triangles().len());
        }
    }

    #[test]
    fn facets_stay_within_the_chord_error() {
        let (radius, length) = (0.04, 0.05);
        let capsule = |p: DVec3| (p - DVec3::Z * p.z.clamp(-0.5 * length, 0.5 * length)).length() - radius;
        let cylinder = |p: DVec3| (p.truncate().length() - radius).max(p.z.abs() - 0.5 * length);
        type Distance<'a> = &'a dyn Fn(DVec3) -> f64;
        for (shape, distance) in [
            (Shape::Sphere { radius }, &(|p: DVec3| p.length() - radius) as Distance<'_>),
            (Shape::Capsule { radius, length }, &capsule as Distance<'_>),
            (Shape::Cylinder { radius, length }, &cylinder as Distance<'_>),
        ] {
            let mesh = tessellate(&shape).unwrap();
            let mut worst = 0.0_f64;
            for corners in mesh.triangles() {
                let [a, b, c] = corners.map(|v| mesh.vertices()[v as usize]);
                for (u, v) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i as f64 / 8.0, j as f64 / 8.0)))
                {
                    worst = worst.max(distance(a + (b - a) * u + (c - a) * v).abs());
                }
            }
            println!("{shape:?}: {:.5} of the radius", worst / radius);
            assert!(worst < CHORD_ERROR * radius, "{shape:?}: {}", worst / radius);
            assert!(worst > 0.2 * CHORD_ERROR * radius, "{shape:?}: the stated error is far too large");
        }
    }

    #[test]
    fn impossible_lengths_are_named() {
        for shape in [
            Shape::Box { size: DVec3::new(1.0, 0.0, 1.0) },
            Shape::Sphere { radius: -1.0 },
            Shape::Sphere { radius: f64::NAN },
            Shape::Capsule { radius: 1.0, length: -0.1 },
            Shape::Capsule { radius: 0.0, length: 0.1 },
            Shape::Cylinder { radius: 1.0, length: 0.0 },
            Shape::Cylinder { radius: f64::INFINITY, length: 1.0 },
        ] {
            let error = tessellate(&shape).unwrap_err();
            assert!(matches!(error, TessellateError::InvalidLength { .. }), "{shape:?}: {error}");
        }
    }
}
