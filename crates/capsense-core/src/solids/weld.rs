//! Makes a closed surface of a list of triangles, or says what keeps it open.
//!
//! Files often give each triangle corners of its own, in single precision. Corners that are the same but for rounding
//! become one; triangles that this leaves without three corners are dropped. What remains encloses a volume if each
//! edge belongs to exactly two triangles. Which way round triangles are listed does not matter.

use crate::geometry::{Aabb, TriangleMesh};
use glam::DVec3;
use std::collections::HashMap;
use std::fmt;

/// Corners nearer to each other than this part of the surface's size are one: sixteen times the rounding of single
/// precision.
const SAME_PLACE: f64 = 1e-6;

/// Edges that do not belong to exactly two triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BadEdges {
    /// Edges of one triangle only: the rims of holes.
    pub open: usize,
    /// Edges of three or more triangles.
    pub crowded: usize,
    /// Edges of two triangles that are listed the opposite way round. These alone are no reason to refuse a surface.
    pub reversed: usize,
}

impl fmt::Display for BadEdges {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self { open: 0, crowded: 0, .. } => write!(out, "no triangle has an area"),
            Self { open, crowded: 0, .. } => write!(out, "{open} open edges"),
            Self { open, crowded, .. } => {
                write!(out, "{open} open edges, {crowded} edges of more than two triangles")
            }
        }
    }
}

/// The corners of each triangle of a closed surface.
pub(super) fn closed_surface(mesh: &TriangleMesh) -> Result<Vec<[DVec3; 3]>, BadEdges> {
    let places = welded(mesh.vertices());
    let triangles: Vec<[u32; 3]> = mesh
        .triangles()
        .iter()
        .map(|corners| corners.map(|corner| places[corner as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let edges = bad_edges(&triangles);
    if edges.open > 0 || edges.crowded > 0 || triangles.is_empty() {
        return Err(edges);
    }
    Ok(triangles.iter().map(|corners| corners.map(|corner| mesh.vertices()[corner as usize])).collect())
}

/// For each vertex the first one at the same place.
fn welded(vertices: &[DVec3]) -> Vec<u32> {
    let reach = SAME_PLACE * Aabb::around(vertices.iter().copied()).size().max_element();
    // Cells so large that most vertices are far from the borders of theirs.
    let cell_size = 16.0 * reach;
    let cell_of = |point: DVec3| (point / cell_size).floor().to_array().map(|index| index as i64);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(vertices.len());
    let mut places = Vec::with_capacity(vertices.len());
    for (index, &vertex) in vertices.iter().enumerate() {
        let (low, high) = (cell_of(vertex - reach), cell_of(vertex + reach));
        let mut first = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let others = cells.get(&[x, y, z]).into_iter().flatten();
                    let near = |other: &&u32| vertices[**other as usize].distance(vertex) <= reach;
                    first = first.into_iter().chain(others.filter(near).copied()).min();
                }
            }
        }
        if first.is_none() {
            cells.entry(cell_of(vertex)).or_default().push(index as u32);
        }
        places.push(first.unwrap_or(index as u32));
    }
    places
}

fn bad_edges(triangles: &[[u32; 3]]) -> BadEdges {
    let mut edges: Vec<([u32; 2], bool)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[from, to]| ([from.min(to), from.max(to)], from < to))
        .collect();
    edges.sort_unstable();
    let mut bad = BadEdges::default();
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [_] => bad.open += 1,
            [a, b] => bad.reversed += usize::from(a.1 == b.1),
            _ => bad.crowded += 1,
        }
    }
    bad
}
