//! The corners of tetrahedra.

use super::lattice::{KUHN_PATHS, Lattice};

/// The four nodes of each tetrahedron of a mesh. Those of a lattice follow from where their cell is, so they are not stored.
#[derive(Clone, Debug)]
pub struct Tets(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Listed(Vec<[u32; 4]>),
    OfLattice(Kuhn),
}

/// Six tetrahedra in each cell of a lattice.
#[derive(Clone, Debug)]
struct Kuhn {
    count: usize,
    /// Number of cells along x and y, and of nodes.
    cells: [u32; 2],
    nodes: [u32; 2],
    /// Those of the first cell.
    first: [[u32; 4]; 6],
}

impl Kuhn {
    #[inline]
    fn at(&self, index: usize) -> [u32; 4] {
        assert!(index < self.count, "tetrahedron {index} of {}", self.count);
        let (cell, path) = ((index / 6) as u32, index % 6);
        let ([nx, ny], [row, plane]) = (self.cells, [self.nodes[0], self.nodes[0] * self.nodes[1]]);
        let (line, i) = (cell / nx, cell % nx);
        let node = line / ny * plane + line % ny * row + i;
        self.first[path].map(|corner| node + corner)
    }
}

impl Tets {
    /// Given one by one.
    pub(super) fn listed(mut tets: Vec<[u32; 4]>) -> Self {
        tets.shrink_to_fit();
        Self(Kind::Listed(tets))
    }

    /// Those of a lattice whose nodes have 32-bit numbers, cell by cell.
    pub(super) fn of_lattice(lattice: &Lattice) -> Self {
        let [nx, ny, _] = lattice.node_counts().map(|count| count as u32);
        Self(Kind::OfLattice(Kuhn {
            count: lattice.tet_count(),
            cells: [nx - 1, ny - 1],
            nodes: [nx, ny],
            first: KUHN_PATHS.map(|path| lattice.kuhn_tet([0; 3], path)),
        }))
    }

    /// How many there are.
    #[inline]
    pub fn len(&self) -> usize {
        match &self.0 {
            Kind::Listed(tets) => tets.len(),
            Kind::OfLattice(kuhn) => kuhn.count,
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nodes of one, positively oriented.
    ///
    /// # Panics
    /// When there is no such tetrahedron.
    #[inline]
    pub fn at(&self, index: usize) -> [u32; 4] {
        match &self.0 {
            Kind::Listed(tets) => tets[index],
            Kind::OfLattice(kuhn) => kuhn.at(index),
        }
    }

    /// All in turn.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [u32; 4]> + Clone {
        (0..self.len()).map(|index| self.at(index))
    }

    /// All, one by one.
    pub fn to_vec(&self) -> Vec<[u32; 4]> {
        self.iter().collect()
    }
}

/// Equal if all have the same nodes in the same order.
impl PartialEq for Tets {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::mesh::TetMesh;
    use glam::DVec3;

    /// Against a walk through each cell along the three axes in all orders.
    #[test]
    fn those_of_a_lattice_are_its_cells_paths() {
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 3.0) };
        for cells in [[1, 1, 1], [3, 2, 4], [1, 5, 2]] {
            let lattice = Lattice::uniform(domain, cells).unwrap();
            let walked: Vec<[u32; 4]> = (0..cells.iter().product())
                .flat_map(|cell| KUHN_PATHS.map(|path| lattice.kuhn_tet(lattice.cell_place(cell), path)))
                .collect();
            let mesh = lattice.to_tet_mesh().unwrap();
            assert_eq!(mesh.tets().to_vec(), walked);
            assert_eq!(mesh.tets().len(), lattice.tet_count());
            assert_eq!(mesh, TetMesh::new(mesh.nodes().to_vec(), walked.clone()).unwrap());
            let swapped = Tets::listed(walked.iter().rev().copied().collect());
            assert!(*mesh.tets() != swapped && mesh.tets().at(1) == walked[1]);
        }
    }

    /// Nearly as many nodes as 32 bits can name, of which none is made.
    #[test]
    fn those_of_large_lattices_have_the_right_numbers() {
        let axis = |count: usize| (0..count).map(|k| k as f64).collect::<Vec<_>>();
        let lattice = Lattice::new([axis(2000), axis(1600), axis(1300)]).unwrap();
        let tets = Tets::of_lattice(&lattice);
        assert_eq!(tets.len(), 6 * 1999 * 1599 * 1299);
        let last = tets.at(tets.len() - 1);
        assert_eq!(last.into_iter().max(), Some(2000 * 1600 * 1300 - 1));
        let cell = (700 * 1599 + 900) * 1999 + 1100;
        let corner = lattice.node_index([1100, 900, 700]) as u32;
        assert_eq!(tets.at(6 * cell)[0], corner);
    }
}
