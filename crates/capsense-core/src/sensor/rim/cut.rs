//! Rims of thin electrodes whose outlines cut the edges of any mesh.
//!
//! On lattices, [`half_plane`](super::half_plane) knows the link of a node exactly. With equal sides, cells a times as
//! high as the rows of nodes are apart, and R = √(1 + a²), a node that lies x rows outside of the rim has the share
//! γ = 1 - R/4 - x, and a link that weighs (1 + R) γ/(1 - γ) for each unit of length and permittivity. Any other mesh is
//! taken for the lattice of the R with which the field of a half-plane has the right energy on its elements
//! ([`tube`](super::tube)), one R for each electrode. Rows and lengths are those around each node
//! ([`plane`](super::plane)): on a lattice they are the lattice's.

use super::place::Places;
use super::plane::{Plane, PlaneNode};
use super::tube::Tube;
use super::{CONVEX_CORNER, LARGEST_SHARE, Link, Linked, Rim};
use crate::electrode::Electrode;
use crate::mesh::TetMesh;

/// R where the outline is hardly more than corners: about what meshes of common generators have.
const USUAL: f64 = 2.3;

/// The rim of an electrode in a plane that the mesh has triangles in. None in any other, and where edges of the mesh
/// follow the outline all along.
pub(crate) fn rim_of_cut(mesh: &TetMesh, electrode: &Electrode, flat: f64) -> Option<Rim> {
    let places = Places::of(&electrode.outline);
    let plane = Plane::of(mesh, electrode, &places, flat)?;
    let root = Tube::around(mesh, electrode, &plane, &places).map_or(USUAL, |tube| tube.root());
    let mut rim = Rim { held: plane.held, ..Rim::default() };
    for (node, of) in plane.near {
        match link_of(&of, root) {
            Link::Held => rim.held.push(node),
            Link::Weight(weight) => {
                let weight = weight * of.dielectric_area;
                let (inside, covered) = (of.place.distance <= 0.0, covered(&of));
                rim.linked.push(Linked { node, weight, of_elements: weight, inside, covered, rows: of.rows });
            }
            Link::None => {}
        }
    }
    Some(rim)
}

/// The part of a node's cell that the electrode covers: on a straight rim a half, on a convex corner a quarter.
fn covered(node: &PlaneNode) -> f64 {
    let behind_side = 0.5 - node.place.distance / node.rows;
    ((1.0 - 0.5 * node.corner) * behind_side).clamp(0.0, LARGEST_SHARE)
}

/// What a node of the plane is; weights are for each unit of its area and permittivity.
pub(super) fn link_of(node: &PlaneNode, root: f64) -> Link {
    let part = 1.0 - (1.0 - CONVEX_CORNER) * node.corner;
    let share = part * (1.0 - 0.25 * root - node.place.distance / node.rows);
    Link::of_share(share, (1.0 + root) / node.rows)
}
