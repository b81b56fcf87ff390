//! Bodies that a mesh is too coarse for: those of which it sees little or nothing, so that no comparison with a mesh half as
//! coarse can tell how wrong it is.
//!
//! What a cut edge knows of a dielectric is how much of the edge lies in it. A sheet that edges pass through as a whole has no
//! edge along it, so what it does to fields along it, (ε - 1) times its thickness, is not there; one that happens to hold a
//! plane of nodes counts as a cell thick. Interface models that fill elements lose thin bodies altogether. Conductors that cut
//! edges are links, however thin; but what is between two of them on one edge links no node, so that it is lost where gaps are not
//! looked for ([`super::gaps`]), and what is between two ends that conductors hold always is.

use super::parallel::WEAK;
use super::{EdgeGeometry, Interface, Span, Surfaces};
use crate::capacitance::own_potential;
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::Edges;
use glam::DVec3;

/// Volumes of a body that edges along different axes see differ by less.
const ALIKE: f64 = 0.5;

/// What edges say of one body.
#[derive(Default)]
struct Seen {
    /// Whether any edge meets it.
    is_met: bool,
    /// What edges that pass through it as a whole stand for, and those that leave it: w d². Diagonals of Kuhn tetrahedra
    /// carry nothing, and stand for nothing.
    through: f64,
    leaving: f64,
    /// The body's volume, as the parts of edges along each axis tell: an edge of weight w and extent d stands for w d².
    volumes: DVec3,
    /// Whether another conductor, at another potential perhaps, is so close that nothing but a gap is between both on an edge; and the
    /// same on an edge whose ends conductors hold.
    is_close: bool,
    is_between: bool,
}

impl Seen {
    /// Whether most edges that meet the body have no room in it, or see it thicker or thinner across than along it.
    fn is_thin(&self) -> bool {
        self.through > self.leaving || self.volumes.min_element() < ALIKE * self.volumes.max_element()
    }
}

/// The objects that the mesh is too coarse for, in increasing order. `gaps_are_lost` where nobody looks for those between
/// conductors.
pub(crate) fn unresolved(
    mesh: EdgeGeometry<'_>,
    weights: &[f64],
    (interface, gaps_are_lost): (Interface, bool),
    materials: &[Material],
    surfaces: &impl Surfaces,
) -> Vec<usize> {
    let domain = Aabb::around(mesh.nodes.iter().copied());
    let is_lattice = matches!(mesh.edges, Edges::Lattice(_));
    let is_unresolved = |object: usize| {
        let bounds = surfaces.bounds(object);
        if !bounds.intersects(&domain) {
            return false;
        }
        let seen = look_at(mesh, weights, materials, surfaces, object);
        let is_inside = domain.contains(bounds.min) && domain.contains(bounds.max);
        match (interface, materials[object]) {
            // Lines beside edges see these. A thin sheet of a strong one carries so much that it matters which lines.
            (Interface::EdgeCut, Material::Dielectric(permittivity))
                if is_lattice && permittivity.value() < WEAK =>
            {
                false
            }
            (Interface::EdgeCut, Material::Conductor(_)) => {
                is_inside && !seen.is_met || gaps_are_lost && seen.is_close || seen.is_between
            }
            _ => is_inside && !seen.is_met || seen.is_thin(),
        }
    };
    (0..surfaces.objects()).filter(|&object| is_unresolved(object)).collect()
}

fn look_at(
    mesh: EdgeGeometry<'_>,
    weights: &[f64],
    materials: &[Material],
    surfaces: &impl Surfaces,
    object: usize,
) -> Seen {
    // Off lattices long edges are visited more often than short ones, which would make bodies look thin along short ones.
    let mut near = Vec::new();
    mesh.edges.for_edges_near(mesh.nodes, &surfaces.bounds(object), |edge, ends| near.push((edge, ends)));
    near.sort_unstable();
    near.dedup();
    let mut seen = Seen::default();
    for (edge, ends) in near {
        let [a, b] = ends.map(|node| mesh.nodes[node as usize]);
        let Some(span) = surfaces.span(object, a, b) else { continue };
        let weight = weights[edge].max(0.0).min(most_between(mesh, ends));
        seen.is_met = true;
        if weight > 0.0 && has_gap(materials, surfaces, object, span, [a, b]) {
            seen.is_close = true;
            seen.is_between |= [a, b].into_iter().all(|end| is_in_conductor(materials, surfaces, end));
        }
        match [a, b].map(|end| surfaces.contains(object, end)) {
            [false, false] => seen.through += weight * a.distance_squared(b),
            [true, true] => {}
            _ => seen.leaving += weight * a.distance_squared(b),
        }
        seen.volumes += weight * (span.exit - span.enter) * (b - a) * (b - a);
    }
    seen
}

fn is_in_conductor(materials: &[Material], surfaces: &impl Surfaces, point: DVec3) -> bool {
    let mut conductors =
        (0..materials.len()).filter(|object| matches!(materials[*object], Material::Conductor(_)));
    conductors.any(|object| surfaces.contains(object, point))
}

/// Whether a segment leads from one conductor to another, of which one finds its own potential, with an end that neither holds: then what
/// couples both there is not in the network.
fn has_gap(
    materials: &[Material],
    surfaces: &impl Surfaces,
    object: usize,
    span: Span,
    [a, b]: [DVec3; 2],
) -> bool {
    let is_conductor = |object: usize| matches!(materials[object], Material::Conductor(_));
    let floats = |object: usize| own_potential(&materials[object]).is_some();
    is_conductor(object)
        && (0..materials.len()).any(|other| {
            other != object
                && is_conductor(other)
                && (floats(object) || floats(other))
                && surfaces.span(other, a, b).is_some_and(|beside| {
                    let are_apart = span.exit < beside.enter || beside.exit < span.enter;
                    let are_held = span.enter.min(beside.enter) <= 0.0 && span.exit.max(beside.exit) >= 1.0;
                    are_apart && !are_held
                })
        })
}

/// The most that an edge between two nodes weighs in elements of any reasonable shape: its dual face is no larger than the square of
/// the longest edge there. Flat elements have pairs of edges, one of them negative, that weigh more by any factor.
fn most_between(mesh: EdgeGeometry<'_>, ends: [u32; 2]) -> f64 {
    let squared = |[a, b]: [u32; 2]| mesh.nodes[a as usize].distance_squared(mesh.nodes[b as usize]);
    if matches!(mesh.edges, Edges::Lattice(_)) {
        return f64::INFINITY;
    }
    let mut longest = 0.0_f64;
    for node in ends {
        mesh.edges.for_edges_at(node as usize, |edge, _| {
            longest = mesh.edges.ends(edge).map_or(longest, |ends| longest.max(squared(ends)));
        });
    }
    longest / squared(ends).sqrt()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, Shape};
    use crate::material::Connection;
    use crate::mesh::{Background, Lattice};
    use crate::sensor::FREE;
    use crate::solids::Solids;
    use crate::stiffness::EdgeNetwork;

    /// Where both conductors are at 0 V, or a node is in the gap, there is nothing to lose; where gaps are looked for, only what is
    /// between two conductors that hold both ends is.
    #[test]
    fn conductors_too_close_to_each_other_are_told_if_one_floats_and_nobody_looks_for_gaps() {
        let axis: Vec<f64> = (0..=10).map(|k| 0.02 * f64::from(k)).collect();
        let lattice = Lattice::new([axis.clone(), axis.clone(), axis]).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap();
        let network = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
        let size = DVec3::new(0.1, 0.1, 2e-3);
        let mut solids = Solids::new(&[Shape::Box { size }, Shape::Box { size }]).unwrap();
        let geometry = EdgeGeometry {
            nodes: mesh.nodes(),
            terminals: &vec![FREE; mesh.nodes().len()],
            edges: network.edges(),
            permittivity: &Background::vacuum(network.edges().len()),
        };
        let [floating, grounded] = [Connection::Floating, Connection::Grounded].map(Material::Conductor);
        for (gap, are_told, gaps_are_lost, upper) in [
            (2e-3, true, true, floating),
            (2e-3, false, true, grounded),
            (2e-3, false, false, floating),
            (0.05, false, true, floating),
        ] {
            let lower = DVec3::new(0.1, 0.1, 0.107);
            let poses = [lower, lower + (size.z + gap) * DVec3::Z].map(Pose::at);
            solids.place(&poses).unwrap();
            let how = (Interface::EdgeCut, gaps_are_lost);
            let told = unresolved(geometry, network.weights(), how, &[grounded, upper], &solids);
            assert_eq!(!told.is_empty(), are_told, "{gap} {gaps_are_lost} {upper:?}: {told:?}");
        }
        // A foil between two plates that hold the planes of nodes below and above it.
        let shapes = [0.02, 5e-4, 0.02].map(|height| Shape::Box { size: DVec3::new(0.1, 0.1, height) });
        let mut solids = Solids::new(&shapes).unwrap();
        let poses = [0.105, 0.11725, 0.1295].map(|z| Pose::at(DVec3::new(0.1, 0.1, z)));
        solids.place(&poses).unwrap();
        let how = (Interface::EdgeCut, false);
        let told = unresolved(geometry, network.weights(), how, &[floating, grounded, floating], &solids);
        assert_eq!(told, [0, 1, 2]);
    }
}
