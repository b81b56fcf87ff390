//! The order of nodes and elements in memory: what is close in space should be close there, so that what a frame touches
//! lies in few cache lines.

use super::{Background, TetMesh, Tets};
use glam::DVec3;

/// Cells along each side of the cube that is sorted: 2 to the power of this.
const BITS: u32 = 20;

impl TetMesh {
    /// The nodes along a Z-order curve through the smallest cube around them: their cells' coordinates with the bits
    /// interleaved (Morton 1966). Nodes of one cell keep their order.
    pub fn order_in_space(&self) -> Vec<u32> {
        let bounds = self.bounds();
        let cells_per_metre = f64::from((1u32 << BITS) - 1) / bounds.size().max_element();
        let key = |node: DVec3| {
            let cell = ((node - bounds.min) * cells_per_metre).as_uvec3();
            spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
        };
        let mut sorted: Vec<(u64, u32)> = self.nodes.iter().map(|&node| key(node)).zip(0..).collect();
        sorted.sort_unstable();
        sorted.into_iter().map(|(_, node)| node).collect()
    }

    /// The same mesh with its nodes in another order, which names each once. Elements are sorted by the first of their
    /// nodes; their corners keep their order.
    #[must_use]
    pub fn renumbered(&self, order: &[u32]) -> Self {
        let place = places(order);
        let renumbered = |tet: [u32; 4]| tet.map(|node| place[node as usize]);
        let first = |tet: [u32; 4]| renumbered(tet).into_iter().min().unwrap_or(0);
        let mut elements: Vec<(u32, u32)> = self.tets.iter().map(first).zip(0..).collect();
        elements.sort_unstable();
        let elements = || elements.iter().map(|&(_, element)| element as usize);
        Self {
            nodes: order.iter().map(|&node| self.nodes[node as usize]).collect(),
            tets: Tets::listed(elements().map(|element| renumbered(self.tets.at(element))).collect()),
            relative_permittivity: Background::new(
                elements().map(|element| self.relative_permittivity.at(element)).collect(),
            ),
        }
    }
}

/// Where each node stands in an order.
pub fn places(order: &[u32]) -> Vec<u32> {
    let mut place = vec![0; order.len()];
    for (&node, at) in order.iter().zip(0..) {
        place[node as usize] = at;
    }
    place
}

/// Puts two zeros in front of each of the lowest bits.
fn spread(value: u32) -> u64 {
    (0..BITS).fold(0, |spread, bit| spread | (u64::from(value >> bit & 1) << (3 * bit)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::mesh::Lattice;

    fn cube() -> TetMesh {
        let domain = Aabb { min: DVec3::splat(-1.0), max: DVec3::splat(3.0) };
        let mesh = Lattice::uniform(domain, [8, 8, 8]).unwrap().to_tet_mesh().unwrap();
        mesh.with_permittivity(|element| 1.0 + element as f64).unwrap()
    }

    /// Where an element is and what it is made of, whatever its number.
    fn described(mesh: &TetMesh) -> Vec<String> {
        let element = |e| format!("{:?} {}", mesh.corners(e), mesh.relative_permittivity().at(e));
        let mut all: Vec<String> = (0..mesh.tets().len()).map(element).collect();
        all.sort();
        all
    }

    #[test]
    fn another_order_is_the_same_mesh() {
        let mesh = cube();
        let order: Vec<u32> = (0..mesh.nodes().len() as u32).map(|node| (node * 100 + 7) % 729).collect();
        let other = mesh.renumbered(&order);
        assert_ne!(mesh.tets(), other.tets());
        assert_eq!(described(&mesh), described(&other));
        assert_eq!(mesh.renumbered(&(0..729).collect::<Vec<_>>()).nodes(), mesh.nodes());
        for (node, &place) in places(&order).iter().enumerate() {
            assert_eq!(mesh.nodes()[node], other.nodes()[place as usize]);
        }
    }

    #[test]
    fn an_order_in_space_fills_one_eighth_after_the_other_whatever_the_order_before() {
        let mesh = cube();
        let shuffled = mesh.renumbered(&(0..729).map(|node| (node * 100 + 7) % 729).collect::<Vec<u32>>());
        let sorted = mesh.renumbered(&mesh.order_in_space());
        assert_eq!(shuffled.renumbered(&shuffled.order_in_space()).nodes(), sorted.nodes());
        // Planes at -1, -0.5, … 3: of the nine along each side, the middle one is in the lower half.
        let eighth = |node: &DVec3| (0..3).map(|axis| usize::from(node[axis] > 1.0) << axis).sum::<usize>();
        let of_nodes: Vec<usize> = sorted.nodes().iter().map(eighth).collect();
        assert!(of_nodes.is_sorted(), "{of_nodes:?}");
        assert_eq!(of_nodes.iter().filter(|&&eighth| eighth == 0).count(), 125);
    }
}
