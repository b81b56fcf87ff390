//! Rims of electrodes that are sheets of triangles in any mesh.
//!
//! A link weighs l/κ times the permittivity around its node, l being half the length of the rim's sides at the node. κ
//! follows from the elements near the rim. On these the field of a half-plane, u = √r cos θ/2, has the energy
//! ∫ 1/(4r) dV; linear elements that take its values at their nodes, and 0 at the rim, have more by some D. A rim node
//! that is let go takes F²/(K + l/κ) off that, where F is the charge that flows to it and K the weight of its edges to
//! nodes that are not on the rim. κ is the number with which all rim nodes of an electrode together take D off.
//!
//! On lattices of cubes this gives 0.25, where [`half_plane`](super::half_plane) knows that it should be 0.23; elements
//! of a mesh generator resolve less and have values around 0.5.

use super::RimLink;
use super::side::{Frame, Side, corners, nearest, nearest_sides};
use crate::mesh::{TetMesh, barycentric_gradients, signed_volume};
use crate::sensor::{FREE, GROUND, Terminal};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

/// κ where the rim has no straight part from which it could be told: what meshes of common generators have.
const USUAL: f64 = 0.5;

/// Elements with a node fewer edges than this from the rim count as near it.
const RINGS: u8 = 3;

/// κ is looked for between these. Sheets of which the elements say otherwise are hardly wider than an element.
const PLAUSIBLE: [f64; 2] = [0.05, 0.7];

/// How often faces near the rim are divided to integrate 1/r.
const DIVISIONS: usize = 6;

/// Corners of a face that are no farther than this part of it from a plane through the line are in it.
const IN_PLANE: f64 = 1e-12;

/// The links of all sheets of a mesh. An electrode that fills elements has no thin rim.
pub(crate) fn rims_of_sheets(mesh: &TetMesh, owners: &[Terminal]) -> Vec<RimLink> {
    let (sides, mirrored) = sides_of_rims(mesh, owners);
    if sides.is_empty() {
        return Vec::new();
    }
    let mut half_lengths: BTreeMap<(Terminal, u32), f64> = BTreeMap::new();
    for side in &sides {
        for node in side.ends {
            *half_lengths.entry((side.terminal, node)).or_default() += 0.5 * side.length(mesh);
        }
    }
    let balances = balances(mesh, owners, &sides, &mirrored);
    let covered = covered(mesh, &sides);
    let permittivity = permittivity_around(mesh, half_lengths.keys().map(|(_, node)| *node));
    let mut links = Vec::with_capacity(half_lengths.len());
    for of_terminal in half_lengths.into_iter().collect::<Vec<_>>().chunk_by(|a, b| a.0.0 == b.0.0) {
        let kappa = kappa(of_terminal, &balances).unwrap_or(USUAL);
        links.extend(of_terminal.iter().map(|&((terminal, node), length)| {
            let weight = permittivity[&node] * length / kappa;
            RimLink {
                node,
                electrode: terminal - 1,
                weight,
                of_elements: weight,
                inside: true,
                covered: covered.get(&(terminal, node)).copied().unwrap_or_default(),
                rows: f64::INFINITY,
            }
        }));
    }
    links
}

/// The part of the plane around each node at a rim that its sheet covers: the angle between the rim's sides there, the smaller one. Zero where
/// the sheet is not across z, and where several rims meet.
fn covered(mesh: &TetMesh, sides: &[Side]) -> BTreeMap<(Terminal, u32), f64> {
    let mut at: BTreeMap<(Terminal, u32), Vec<DVec3>> = BTreeMap::new();
    for side in sides {
        let point = |node: u32| mesh.nodes()[node as usize];
        let ([a, b], apex) = (side.ends.map(point), point(side.apex));
        if [b - a, apex - a].into_iter().any(|way| way.z.abs() > IN_PLANE * way.length()) {
            continue;
        }
        at.entry((side.terminal, side.ends[0])).or_default().push(b - a);
        at.entry((side.terminal, side.ends[1])).or_default().push(a - b);
    }
    let part = |ways: Vec<DVec3>| match &ways[..] {
        [a, b] => a.angle_between(*b) / TAU,
        _ => 0.0,
    };
    at.into_iter().map(|(node, ways)| (node, part(ways))).collect()
}

/// Sides of triangles between nodes of one electrode that belong to one triangle only, but for those at which the mesh ends,
/// and the nodes of these: there the sheet goes on as in a mirror.
fn sides_of_rims(mesh: &TetMesh, owners: &[Terminal]) -> (Vec<Side>, BTreeSet<u32>) {
    let is_electrode = |terminal: Terminal| terminal != FREE && terminal != GROUND;
    let (mut filled, mut triangles) = (BTreeSet::new(), BTreeMap::new());
    for tet in mesh.tets().iter() {
        let of = tet.map(|node| owners[node as usize]);
        for skipped in 0..4 {
            let [a, b, c] = [1, 2, 3].map(|k| (skipped + k) % 4);
            if is_electrode(of[a]) && of[a] == of[b] && of[b] == of[c] {
                if of[skipped] == of[a] {
                    filled.insert(of[a]);
                }
                let mut nodes = [a, b, c].map(|k| tet[k]);
                nodes.sort_unstable();
                *triangles.entry((of[a], nodes)).or_insert(0) += 1;
            }
        }
    }
    let mut counts: BTreeMap<(Terminal, [u32; 2]), (usize, u32)> = BTreeMap::new();
    for ((terminal, [a, b, c]), elements) in triangles {
        // What an electrode fills, and what the mesh ends at, is no sheet with two sides.
        if filled.contains(&terminal) || elements < 2 {
            continue;
        }
        for (ends, apex) in [([a, b], c), ([b, c], a), ([a, c], b)] {
            counts.entry((terminal, ends)).or_insert((0, apex)).0 += 1;
        }
    }
    let rim = counts.into_iter().filter(|(_, (count, _))| *count == 1);
    let sides: Vec<Side> = rim.map(|((terminal, ends), (_, apex))| Side { terminal, ends, apex }).collect();
    let at_surface = at_surface(mesh, &sides);
    let sides = sides.into_iter().filter(|side| !at_surface.contains(&side.ends)).collect();
    (sides, at_surface.into_iter().flatten().collect())
}

/// Sides at which the mesh ends. There the field has no need to go around the rim.
fn at_surface(mesh: &TetMesh, sides: &[Side]) -> BTreeSet<[u32; 2]> {
    let wanted: BTreeSet<[u32; 2]> = sides.iter().map(|side| side.ends).collect();
    let nodes: BTreeSet<u32> = wanted.iter().flatten().copied().collect();
    let mut faces: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for tet in mesh.tets().iter().filter(|tet| tet.iter().filter(|node| nodes.contains(node)).count() > 1) {
        for skipped in 0..4 {
            let mut face = [1, 2, 3].map(|k| tet[(skipped + k) % 4]);
            face.sort_unstable();
            *faces.entry(face).or_insert(0) += 1;
        }
    }
    let outer = faces.into_iter().filter(|(_, elements)| *elements == 1);
    let edges = outer.flat_map(|([a, b, c], _)| [[a, b], [b, c], [a, c]]);
    edges.filter(|edge| wanted.contains(edge)).collect()
}

/// What the elements around a rim node know of the field of a half-plane.
#[derive(Clone, Copy, Debug, Default)]
struct Balance {
    /// Charge that flows to the node while it is at 0 V.
    charge: f64,
    /// Weight of its edges to nodes that are not on the rim.
    weight: f64,
    /// Its share of what linear elements have too much of energy.
    excess: f64,
}

/// The balance of each rim node, in vacuum. Elements near corners, where the field is another one, are left out.
fn balances(
    mesh: &TetMesh,
    owners: &[Terminal],
    sides: &[Side],
    mirrored: &BTreeSet<u32>,
) -> BTreeMap<u32, Balance> {
    let near = nearest_sides(mesh, sides, RINGS);
    let corners = corners(mesh, sides, mirrored);
    let on_rim: BTreeSet<u32> = sides.iter().flat_map(|side| side.ends).collect();
    let mut balances: BTreeMap<u32, Balance> = BTreeMap::new();
    for (element, tet) in mesh.tets().iter().enumerate() {
        let places = tet.map(|node| near[node as usize]);
        let centroid = mesh.centroid(element);
        let known = places.iter().flatten().map(|(_, side)| *side);
        let nearest = nearest(mesh, sides, centroid, known);
        let Some(side) = nearest.map(|side| &sides[side as usize]) else { continue };
        let Some(frame) = Frame::of(mesh, side) else { continue };
        let all_near =
            places.iter().all(Option::is_some) && places.iter().flatten().any(|(ring, _)| *ring < RINGS);
        if !all_near || side.ends.iter().any(|node| corners.contains(node)) {
            continue;
        }
        let (points, gradients) = (mesh.corners(element), barycentric_gradients(mesh.corners(element)));
        let volume = signed_volume(points);
        let potentials: [f64; 4] = std::array::from_fn(|k| match owners[tet[k] as usize] == side.terminal {
            true => 0.0,
            false => frame.potential(points[k]),
        });
        let field: DVec3 = gradients.iter().zip(potentials).map(|(gradient, u)| *gradient * u).sum();
        let excess = volume * field.length_squared() - exact_energy(&frame, points, DIVISIONS);
        for node in side.ends {
            balances.entry(node).or_default().excess += 0.5 * excess;
        }
        for i in (0..4).filter(|&i| on_rim.contains(&tet[i])) {
            for j in (0..4).filter(|&j| !on_rim.contains(&tet[j])) {
                let weight = -volume * gradients[i].dot(gradients[j]);
                let balance = balances.entry(tet[i]).or_default();
                balance.charge += weight * potentials[j];
                balance.weight += weight;
            }
        }
    }
    balances
}

/// Solves Σ F²/(K + l/κ) = Σ D, whose left side grows with κ, by bisection. None where nothing is known or no plausible
/// number does it.
fn kappa(half_lengths: &[((Terminal, u32), f64)], balances: &BTreeMap<u32, Balance>) -> Option<f64> {
    let known: Vec<(f64, Balance)> = half_lengths
        .iter()
        .filter_map(|((_, node), length)| balances.get(node).map(|balance| (*length, *balance)))
        .filter(|(_, balance)| balance.weight > 0.0)
        .collect();
    let excess: f64 = known.iter().map(|(_, balance)| balance.excess).sum();
    let taken = |kappa: f64| -> f64 {
        known.iter().map(|(length, of)| of.charge * of.charge / (of.weight + length / kappa)).sum()
    };
    let [mut low, mut high] = PLAUSIBLE;
    if !(taken(low) < excess && excess < taken(high)) {
        return None;
    }
    for _ in 0..50 {
        let middle = (low * high).sqrt();
        if taken(middle) < excess { low = middle } else { high = middle }
    }
    Some(low)
}

/// ∫ 1/(4r) over a tetrahedron. As 1/r is the divergence of the unit vector away from the line, it is the flux of that through the
/// faces, which stays finite at the line.
pub(super) fn exact_energy(frame: &Frame, corners: [DVec3; 4], divisions: usize) -> f64 {
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let outward: f64 = faces.map(|face| flux(frame, face.map(|k| corners[k]), divisions)).iter().sum();
    0.25 * signed_volume(corners).signum() * outward
}

/// The flux of the unit vector away from the line through a triangle, which is divided where it is near the line.
fn flux(frame: &Frame, corners: [DVec3; 3], divisions: usize) -> f64 {
    let [a, b, c] = corners;
    let area = 0.5 * (b - a).cross(c - a);
    let centroid = (a + b + c) / 3.0;
    let reach = corners.into_iter().map(|corner| corner.distance(centroid)).fold(0.0, f64::max);
    let through = |point: DVec3| frame.across(point).dot(area);
    // A plane through the line lets nothing through.
    if corners.into_iter().all(|corner| through(corner).abs() <= IN_PLANE * reach * area.length()) {
        return 0.0;
    }
    if divisions > 0 && frame.distance(centroid) < 4.0 * reach {
        let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
        let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
        return parts.into_iter().map(|part| flux(frame, part, divisions - 1)).sum();
    }
    // Three points, exact for quadratic functions.
    let points = corners.map(|corner| 0.5 * (centroid + corner));
    let sum: f64 =
        points.into_iter().map(|point| through(point) / frame.distance(point).max(f64::MIN_POSITIVE)).sum();
    sum / 3.0
}

/// Mean relative permittivity of the elements at some nodes.
fn permittivity_around(mesh: &TetMesh, nodes: impl Iterator<Item = u32>) -> BTreeMap<u32, f64> {
    let mut sums: BTreeMap<u32, (f64, f64)> = nodes.map(|node| (node, (0.0, 0.0))).collect();
    for (element, tet) in mesh.tets().iter().enumerate() {
        for node in tet {
            if let Some((weighted, volume)) = sums.get_mut(&node) {
                let of_element = signed_volume(mesh.corners(element));
                *weighted += of_element * mesh.relative_permittivity().at(element);
                *volume += of_element;
            }
        }
    }
    sums.into_iter().map(|(node, (weighted, volume))| (node, weighted / volume)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by points: the centroids of the parts of a tetrahedron that is halved so often.
    fn middles(frame: &Frame, [a, b, c, d]: [DVec3; 4], times: usize) -> f64 {
        if times == 0 {
            let centroid = (a + b + c + d) / 4.0;
            return 0.25 * signed_volume([a, b, c, d]).abs() / frame.distance(centroid);
        }
        let middle = |p: DVec3, q: DVec3| 0.5 * (p + q);
        let (ab, ac, ad) = (middle(a, b), middle(a, c), middle(a, d));
        let (bc, bd, cd) = (middle(b, c), middle(b, d), middle(c, d));
        let parts = [
            [a, ab, ac, ad],
            [ab, b, bc, bd],
            [ac, bc, c, cd],
            [ad, bd, cd, d],
            [ab, ac, ad, bd],
            [ab, ac, bc, bd],
            [ac, ad, bd, cd],
            [ac, bc, bd, cd],
        ];
        parts.into_iter().map(|part| middles(frame, part, times - 1)).sum()
    }

    /// A prism of which one edge is on the line, cut into three tetrahedra: ∫ 1/r dV is its height times ∫ ρ(θ) dθ, where ρ is the
    /// distance of its far face.
    #[test]
    fn energies_near_the_line_and_on_it_are_exact() {
        let (height, far) = (0.7, 0.4);
        let angle = 1.1f64;
        let frame = Frame::across_line(DVec3::ZERO, DVec3::X);
        let point = |along: f64, x: f64, z: f64| DVec3::new(x, along, z);
        let base = [[0.0, 0.0], [far, 0.0], [far, far * angle.tan()]];
        let at = |k: usize, along: f64| point(along, base[k][0], base[k][1]);
        let (low, high) = ([0, 1, 2].map(|k| at(k, 0.0)), [0, 1, 2].map(|k| at(k, height)));
        let parts = [
            [low[0], low[1], low[2], high[2]],
            [low[0], low[1], high[1], high[2]],
            [low[0], high[0], high[1], high[2]],
        ];
        let sum: f64 = parts.into_iter().map(|part| exact_energy(&frame, part, DIVISIONS)).sum();
        let exact = 0.25 * height * far * (angle.tan() + angle.cos().recip()).ln();
        assert!((sum / exact - 1.0).abs() < 1e-3, "{sum} {exact}");
        // Through the interior of faces, whatever the order of the corners: the middles of many small parts.
        let around =
            [[-0.3, -1.0, -0.2], [0.5, -0.8, -0.3], [0.1, -0.9, 0.6], [0.05, 0.9, 0.02]].map(DVec3::from);
        let [a, b, c, d] = around;
        let sum = middles(&frame, around, 6);
        for corners in [around, [b, a, c, d]] {
            let found = exact_energy(&frame, corners, DIVISIONS);
            assert!((found / sum - 1.0).abs() < 5e-3, "{found} {sum}");
        }
        // Far away 1/r hardly changes within an element.
        let away = parts[0].map(|corner| corner + 100.0 * DVec3::X);
        let volume = signed_volume(away).abs();
        let of_middle = 0.25 * volume / frame.distance(away.into_iter().sum::<DVec3>() / 4.0);
        assert!((exact_energy(&frame, away, DIVISIONS) / of_middle - 1.0).abs() < 1e-4);
    }
}
