//! What kernels that find objects know of the empty scene: words in one buffer, made once.
//!
//! Planes of the lattice, what holds nodes and what no object can take from them, weights of edges, permittivities of the
//! background around them, and links of rims and of open walls.

use bytemuck::{Pod, Zeroable};
use capsense_core::mesh::{Edges, Lattice};
use capsense_core::occupancy::OrthographicView;
use capsense_core::sensor::Sensor;
use capsense_core::solver::HELD_AT_ZERO;
use capsense_core::stiffness::EdgeNetwork;

/// Nodes have at most so many links of their own.
const MOST_LINKS: usize = 15;

/// Where everything is in the tables, as the kernels have it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct LatticeUniform {
    planes_at: [u32; 3],
    nodes_at: u32,
    weights_at: u32,
    permittivity_at: u32,
    permittivity_stride: u32,
    electrodes: u32,
    links_at: u32,
    pub(super) flags_len: u32,
    /// A bit for each node: whether the background is the same on all its edges.
    alike_at: u32,
    /// The background in each cell, one for all where that is the same everywhere.
    cells_at: u32,
}

/// Tables of a sensor.
#[derive(Clone, Debug)]
pub(super) struct Tables {
    pub(super) words: Vec<u32>,
    pub(super) lattice: LatticeUniform,
}

impl Tables {
    /// `None` where the sensor's mesh is no lattice, or 32 bits or the words for nodes do not suffice. `view` is what a camera sees,
    /// if one sees the objects.
    pub(super) fn new(sensor: &Sensor, view: Option<&OrthographicView>) -> Option<Self> {
        let network = EdgeNetwork::of_sensor(sensor);
        let Edges::Lattice(lattice) = network.edges() else { return None };
        let nodes = sensor.mesh().nodes().len();
        let mut words: Vec<u32> = Vec::new();
        let mut planes_at = [0; 3];
        for (axis, planes) in lattice.axes().iter().enumerate() {
            planes_at[axis] = words.len() as u32;
            for (number, &plane) in planes.iter().enumerate() {
                let [high, low] = in_two(plane);
                let way = planes.get(number + 1).map_or(0.0, |next| (next - plane) as f32);
                let (pixel, within) = view.map_or((0, 0.0), |view| pixel_at(view, axis, plane));
                let dual = sensor.dual_lengths(axis).map_or(1.0, |factors| factors[number] as f32);
                let where_it_is = [high.to_bits(), low.to_bits(), way.to_bits(), pixel as u32];
                words.extend(where_it_is.into_iter().chain([within.to_bits(), dual.to_bits()]));
            }
        }
        let nodes_at = words.len() as u32;
        let mut links = network.rim().to_vec();
        links.sort_by_key(|link| (link.node, link.electrode));
        let mut first = 0;
        for node in 0..nodes {
            let count = links[first..].iter().take_while(|link| link.node as usize == node).count();
            let [terminal, owner] = [sensor.terminals()[node], sensor.owners()[node]].map(u32::from);
            if count > MOST_LINKS || first >= 1 << 28 {
                return None;
            }
            words.extend([terminal | owner << 16, (first * 16 + count) as u32]);
            first += count;
        }
        let links_at = words.len() as u32;
        let electrodes = sensor.electrode_names().len();
        for link in &links {
            // Behind the electrodes comes ground.
            let electrode = usize::from(link.electrode);
            let holder = if electrode < electrodes { electrode as u32 } else { HELD_AT_ZERO };
            let of_nearer = link.covered / (1.0 - link.covered);
            let of_link = [link.weight, of_nearer, 1.0 / link.rows].map(|number| (number as f32).to_bits());
            words.push(holder);
            words.extend(of_link);
        }
        let weights_at = words.len() as u32;
        for axis in 0..3 {
            words.extend((0..nodes).map(|node| (network.weights()[3 * node + axis] as f32).to_bits()));
        }
        let permittivity_at = words.len() as u32;
        let permittivity: Vec<f64> = network.permittivity().iter().collect();
        let is_uniform = permittivity.windows(2).all(|pair| pair[0] == pair[1]);
        if is_uniform {
            words.extend(permittivity.first().map(|&permittivity| (permittivity as f32).to_bits()));
        } else {
            for axis in 0..3 {
                words.extend((0..nodes).map(|node| (permittivity[3 * node + axis] as f32).to_bits()));
            }
        }
        let mut cells_at = permittivity_at;
        if !is_uniform {
            cells_at = words.len() as u32;
            // Six tetrahedra are a cell.
            let cells = sensor.mesh().relative_permittivity().iter().step_by(6);
            words.extend(cells.map(|permittivity| (permittivity as f32).to_bits()));
        }
        let alike_at = words.len() as u32;
        words.extend(alike(lattice, &permittivity));
        let lattice = LatticeUniform {
            planes_at,
            nodes_at,
            weights_at,
            permittivity_at,
            permittivity_stride: u32::from(!is_uniform),
            electrodes: electrodes as u32,
            links_at,
            alike_at,
            cells_at,
            ..LatticeUniform::default()
        };
        (words.len() <= u32::MAX as usize).then_some(Self { words, lattice })
    }
}

/// A bit for each node: whether the permittivity is the same on all its edges, to the last bit, as the processor asks.
fn alike(lattice: &Lattice, permittivity: &[f64]) -> Vec<u32> {
    let (counts, strides) = (lattice.node_counts(), lattice.strides());
    let nodes = counts.iter().product::<usize>();
    let mut bits = vec![0; nodes.div_ceil(32)];
    for node in 0..nodes {
        let place = lattice.node_place(node);
        let edges = (0..3).flat_map(|axis| {
            let below = (place[axis] > 0).then(|| 3 * (node - strides[axis]) + axis);
            let above = (place[axis] + 1 < counts[axis]).then_some(3 * node + axis);
            [below, above].into_iter().flatten()
        });
        let mut around = edges.map(|edge| permittivity[edge]);
        let first = around.next();
        bits[node / 32] |= u32::from(around.all(|other| Some(other) == first)) << (node % 32);
    }
    bits
}

/// A number as the sum of two in single precision.
pub(in super::super) fn in_two(number: f64) -> [f32; 2] {
    let high = number as f32;
    [high, (number - f64::from(high)) as f32]
}

/// The pixel that a plane across x or y is seen in, and where in it: never rounded up to the next.
fn pixel_at(view: &OrthographicView, axis: usize, plane: f64) -> (i32, f32) {
    if axis == 2 {
        return (0, 0.0);
    }
    let place = (plane - view.domain.min[axis]) * (1.0 / view.pixel_size()[axis]);
    let below = place.floor();
    (below as i32, ((place - below) as f32).min(1.0 - 0.5 * f32::EPSILON))
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::geometry::Aabb;
    use capsense_core::glam::DVec3;

    #[test]
    fn planes_stay_in_their_pixels() {
        let domain = Aabb { min: DVec3::splat(-0.3), max: DVec3::splat(0.3) };
        let view = OrthographicView { domain, width: 64, height: 60 };
        assert_eq!(pixel_at(&view, 1, 0.0).0, 30);
        let (pixel, within) = pixel_at(&view, 0, 0.3 * (1.0 - 1e-12));
        assert!(pixel == 63 && within < 1.0 && within > 0.999_999, "{pixel} {within}");
        let [high, low] = in_two(0.1);
        assert!((f64::from(high) + f64::from(low) - 0.1).abs() < 1e-16 && low != 0.0);
    }
}
