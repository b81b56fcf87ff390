//! Meshes of the experiment: two stripes on a lattice that is right for them, on others that are not, and the same nodes as
//! a mesh from a file would have them.

use super::ladder::Parts;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{
    ElectrodeNodes, FREE, GROUND, Sensor, SensorDesign, SensorError, Terminal, Wall,
};

/// The domain of the built-in scene.
pub(super) const DOMAIN: Aabb =
    Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

/// Most tetrahedra of a mesh: about what a frame of a tenth of a millisecond has.
const TETS: usize = 9_000;

/// How far in a second mesh stands from the first.
const BESIDE: DVec3 = DVec3::X;

/// Two stripes 100 mm x 20 mm with a gap of 10 mm.
pub(super) fn stripes() -> SensorDesign {
    let stripe = |name: &str, y: f64| {
        let outline = Outline::Rectangle { center: DVec2::new(0.0, y), size: DVec2::new(0.1, 0.02) };
        Electrode { name: name.to_owned(), outline, z: 0.0 }
    };
    let electrodes = vec![stripe("E1", -0.015), stripe("E2", 0.015)];
    SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded }
}

/// The stripes on the lattice that the command would choose.
pub(super) fn on_lattice() -> Result<Sensor, SensorError> {
    let design = stripes();
    Sensor::on_lattice(&design, &design.lattice(TETS)?)
}

/// The stripes on cells of 10 to 50 mm, with cells a `ratio` smaller on both sides of the electrodes' plane and edges.
pub(super) fn with_jumps(ratio: f64) -> Result<Sensor, SensorError> {
    let xs = vec![-0.25, -0.2, -0.15, -0.1, -0.05, -0.025, 0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.25];
    let ys = [-0.25, -0.2, -0.15, -0.1, -0.06, -0.025, -0.015, -0.005];
    let ys: Vec<f64> = ys.iter().copied().chain([0.0]).chain(ys.iter().rev().map(|y| -y)).collect();
    let zs = vec![-0.05, -0.025, 0.0, 0.02, 0.04, 0.06, 0.08, 0.11, 0.15, 0.2, 0.26, 0.33, 0.45];
    let axes = [
        with_thin_cells(xs, &[-0.05, 0.05], 0.025 / ratio),
        with_thin_cells(ys, &[-0.025, -0.005, 0.005, 0.025], 0.005 / ratio),
        with_thin_cells(zs, &[0.0], 0.02 / ratio),
    ];
    Sensor::on_lattice(&stripes(), &Lattice::new(axes)?)
}

/// An axis with a plane so far from each of some planes, on either side.
fn with_thin_cells(mut axis: Vec<f64>, planes: &[f64], size: f64) -> Vec<f64> {
    axis.extend(planes.iter().flat_map(|plane| [plane - size, plane + size]));
    axis.sort_by(f64::total_cmp);
    axis.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    axis
}

/// What is true of bodies with faces at some heights, the closest of which are `smallest` apart: a lattice with planes in these
/// faces, from which spacing grows by doubling.
pub(super) fn fine(heights: &[f64], smallest: f64, tets: usize) -> Result<Sensor, SensorError> {
    let design = stripes();
    let lattice = design.lattice(tets)?;
    let [x, y, z] = lattice.axes();
    let mut planes: Vec<f64> = z.clone();
    for &height in heights {
        planes.push(height);
        let mut away = 0.5 * smallest;
        while away < 0.01 {
            planes.extend([height - away, height + away]);
            away *= 2.0;
        }
    }
    planes.retain(|plane| (DOMAIN.min.z..=DOMAIN.max.z).contains(plane));
    planes.sort_by(f64::total_cmp);
    // Faces and the electrodes' plane stay; of others none is much nearer than the closest faces.
    let is_kept = |plane: f64| plane == 0.0 || heights.contains(&plane);
    let mut spaced: Vec<f64> = Vec::with_capacity(planes.len());
    for plane in planes {
        match spaced.last().copied() {
            Some(last) if plane - last < 0.4 * smallest => {
                if is_kept(plane) && !is_kept(last) && spaced.len() > 1 {
                    spaced.pop();
                    spaced.push(plane);
                } else if is_kept(plane) && plane > last {
                    spaced.push(plane);
                }
            }
            _ => spaced.push(plane),
        }
    }
    Sensor::on_lattice(&design, &Lattice::new([x.clone(), y.clone(), spaced])?)
}

/// The nodes of a terminal, rims included.
fn nodes_of(sensor: &Sensor, terminal: Terminal) -> Vec<u32> {
    let owners = (0..).zip(sensor.owners()).filter(|(_, owner)| **owner == terminal);
    owners.map(|(node, _)| node).collect()
}

/// The sensor's terminals on other nodes, as a mesh from a file.
fn on_nodes(sensor: &Sensor, nodes: Vec<DVec3>) -> Result<Sensor, SensorError> {
    let mesh = TetMesh::new(nodes, sensor.mesh().tets().to_vec())?;
    let names = sensor.electrode_names().iter().cloned().zip(1..);
    let electrodes = names.map(|(name, t)| (name, ElectrodeNodes::Nodes(nodes_of(sensor, t)))).collect();
    Sensor::on_mesh(mesh, &nodes_of(sensor, GROUND), electrodes)
}

/// The stripes on a mesh in which every seventh element that allows for it is flattened to about so many degrees.
pub(super) fn with_slivers(degrees: f64) -> Result<Sensor, SensorError> {
    let sensor = on_lattice()?;
    let mesh = sensor.mesh();
    let (mut nodes, tets) = (mesh.nodes().to_vec(), mesh.tets());
    let mut around = vec![Vec::new(); nodes.len()];
    for (element, tet) in tets.iter().enumerate() {
        tet.iter().for_each(|&node| around[node as usize].push(element));
    }
    let mut is_touched = vec![false; nodes.len()];
    for [node, face @ ..] in tets.iter().step_by(7) {
        let at = node as usize;
        let near = || around[at].iter().flat_map(|&element| tets.at(element));
        if sensor.owners()[at] != FREE || near().any(|node| is_touched[node as usize]) {
            continue;
        }
        let corners = face.map(|node| nodes[node as usize]);
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let height = (nodes[at] - middle).dot(normal);
        // The angles at a face's edges are those of a point so high over its middle.
        let edge = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| corners[a].distance(corners[b]));
        let inradius = normal.dot((corners[1] - corners[0]).cross(corners[2] - corners[0])).abs()
            / edge.iter().sum::<f64>();
        let before = nodes[at];
        nodes[at] = middle + normal * height.signum() * inradius * degrees.to_radians().tan();
        // Others beside it may lie in the same plane; none may be inverted by more than rounding.
        let least = 0.1 * (nodes[at] - middle).dot(normal).abs() - 1e-12 * inradius;
        let is_good =
            |element: &usize| smallest_height(tets.at(*element).map(|node| nodes[node as usize])) > least;
        if around[at].iter().all(is_good) {
            near().for_each(|node| is_touched[node as usize] = true);
        } else {
            nodes[at] = before;
        }
    }
    on_nodes(&sensor, nodes)
}

/// Height of a tetrahedron over its largest face; negative for an inverted one.
fn smallest_height(corners: [DVec3; 4]) -> f64 {
    let [a, b, c, d] = corners;
    let six_volumes = (b - a).cross(c - a).dot(d - a);
    let faces = [(a, b, c), (a, b, d), (a, c, d), (b, c, d)];
    let largest = faces.map(|(a, b, c)| (b - a).cross(c - a).length()).into_iter().fold(0.0, f64::max);
    six_volumes / largest
}

/// Two boxes side by side, or one, with what is told of ground.
pub(super) fn in_parts(parts: Parts) -> Result<Sensor, SensorError> {
    let one = on_lattice()?;
    if parts == Parts::NoGround {
        let electrodes = [("E1", 1), ("E2", 2)]
            .map(|(name, t)| (name.to_owned(), ElectrodeNodes::Nodes(nodes_of(&one, t))));
        return Sensor::on_mesh(one.mesh().clone(), &[], electrodes.to_vec());
    }
    let count = one.mesh().nodes().len() as u32;
    let nodes = one.mesh().nodes().iter().copied().chain(one.mesh().nodes().iter().map(|node| node + BESIDE));
    let tets = one.mesh().tets().iter();
    let tets = tets.clone().chain(tets.map(|tet| tet.map(|node| node + count)));
    let in_second = |nodes: Vec<u32>| nodes.into_iter().map(|node| node + count).collect::<Vec<_>>();
    let mut ground = nodes_of(&one, GROUND);
    if parts == Parts::Grounded {
        ground.extend(in_second(nodes_of(&one, GROUND)));
    }
    let second = nodes_of(&one, 2);
    let second = if parts == Parts::Nothing { second } else { in_second(second) };
    let electrodes = [("E1", nodes_of(&one, 1)), ("E2", second)];
    let electrodes = electrodes.map(|(name, nodes)| (name.to_owned(), ElectrodeNodes::Nodes(nodes)));
    Sensor::on_mesh(TetMesh::new(nodes.collect(), tets.collect())?, &ground, electrodes.to_vec())
}
