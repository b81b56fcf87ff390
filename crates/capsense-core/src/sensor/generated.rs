//! Meshes made for a designed sensor: graded lattices, or coarse lattices whose tetrahedra are bisected around the rims of
//! electrodes.

use super::grading::Grading;
use super::{IN_PLANE, Sensor, SensorDesign, SensorError, Wall, nodes_where};
use crate::mesh::{Bisection, Lattice, Refinement, TetMesh};
use crate::sensor::ElectrodeNodes;
use glam::DVec3;

/// Which tetrahedra a mesh is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshKind {
    /// Those of the cells of a graded lattice, [`SensorDesign::lattice`].
    #[default]
    Lattice,
    /// Those of a coarse lattice, bisected where they are too large, [`SensorDesign::bisection`].
    Bisection,
}

/// How many parts of the tetrahedra the lattice that is bisected has at most.
const BASE_PART: usize = 5;

/// By which part of its distance from electrodes the spacing of that lattice grows: its cells should be nearly cubes.
const BASE_GROWTH: f64 = 0.2;

/// Growth of bisected cells with the distance from the nearest rim, in metres per metre.
const GROWTH: f64 = 0.25;

/// Elements that stand for all others where their number is foreseen.
const SAMPLES: usize = 20_000;

/// Cells at rims in that coarse picture, in parts of the domain.
const SAMPLED_AT_RIMS: f64 = 0.01;

/// What halving cells until they are small enough makes of their number, on average: 7/ln 8, as what halves is too small by
/// any factor from one to two.
const HALVED: f64 = 3.37;

impl SensorDesign {
    /// A mesh of at most so many tetrahedra, bisected from a coarse lattice: finest at the rims of electrodes, and growing by a
    /// quarter of the distance from them. Electrode edges along the axes, electrode planes and the board lie in planes of the mesh.
    ///
    /// # Errors
    /// When the design is invalid or even the coarsest lattice has more tetrahedra.
    pub fn bisection(&self, max_tets: usize) -> Result<Bisection, SensorError> {
        self.validate()?;
        let even = |spacing| Grading::even(spacing, BASE_GROWTH);
        let (_, lattice) = self.finest_lattice(max_tets / BASE_PART, even)?;
        if lattice.tet_count() > max_tets {
            return Err(SensorError::TooFewElements { allowed: max_tets, needed: lattice.tet_count() });
        }
        let mut bisection = Bisection::new(&lattice)?;
        let at_rims = self.spacing_at_rims(&bisection, max_tets);
        match bisection.refine_to_size(|point| self.longest_edge(at_rims, point), max_tets) {
            Refinement::Complete | Refinement::Full | Refinement::TooFine => Ok(bisection),
        }
    }

    /// The side of the cells at rims with which there are about so many tetrahedra, in metres.
    fn spacing_at_rims(&self, lattice: &Bisection, max_tets: usize) -> f64 {
        let extent = self.domain.size().max_element();
        let mut samples = lattice.clone();
        let size = |point| self.longest_edge(SAMPLED_AT_RIMS * extent, point);
        let _ = samples.refine_to_size(size, max_tets.min(SAMPLES.max(lattice.tet_count())));
        let sizes: Vec<[f64; 2]> = (0..samples.tet_count())
            .map(|element| {
                let corners = samples.corners(element);
                let centroid = corners.iter().sum::<DVec3>() / 4.0;
                // The longest edge of a Kuhn tetrahedron is its cell's diagonal.
                let edges = corners.iter().flat_map(|a| corners.iter().map(|b| a.distance(*b)));
                [edges.fold(0.0, f64::max), self.distance_to_rims(centroid)]
            })
            .collect();
        let foreseen = |at_rims: f64| -> f64 {
            let parts = sizes.iter().map(|[edge, distance]| edge / longest_edge(at_rims, *distance));
            parts.map(|part| if part > 1.0 { HALVED * part.powi(3) } else { 1.0 }).sum()
        };
        let (mut fits, mut exceeds) = (extent, 1e-6 * extent);
        for _ in 0..super::lattices::SPACING_STEPS {
            let middle = (fits * exceeds).sqrt();
            *(if foreseen(middle) <= max_tets as f64 { &mut fits } else { &mut exceeds }) = middle;
        }
        fits
    }

    fn longest_edge(&self, at_rims: f64, point: DVec3) -> f64 {
        longest_edge(at_rims, self.distance_to_rims(point))
    }

    fn distance_to_rims(&self, point: DVec3) -> f64 {
        let distances = self.electrodes.iter().map(|electrode| {
            electrode.outline.distance_to_rim(point.truncate()).hypot(point.z - electrode.z)
        });
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Whether a place is on the wall.
    pub fn is_on_wall(&self, place: DVec3) -> bool {
        let slack = IN_PLANE * self.domain.size().max_element();
        (place - self.domain.min).min_element() <= slack || (self.domain.max - place).min_element() <= slack
    }

    /// The mesh with the board in it, and the nodes that ground holds, those of an open wall not among them. Faces of the
    /// board lie in planes of the mesh.
    pub(super) fn with_ground_and_board(&self, mesh: TetMesh) -> Result<(TetMesh, Vec<u32>), SensorError> {
        let mut ground = match self.wall {
            Wall::Grounded => nodes_where(&mesh, |node| self.is_on_wall(node)),
            Wall::Open => Vec::new(),
        };
        let Some(board) = &self.substrate else { return Ok((mesh, ground)) };
        let bounds = board.bounds();
        let centroids: Vec<_> = (0..mesh.tets().len()).map(|element| mesh.centroid(element)).collect();
        let inside = board.relative_permittivity.value();
        let mesh = mesh.with_permittivity(|e| if bounds.contains(centroids[e]) { inside } else { 1.0 })?;
        if board.grounded_back {
            let slack = IN_PLANE * self.domain.size().max_element();
            ground.extend(nodes_where(&mesh, |node| board.is_on_back(node, slack)));
        }
        Ok((mesh, ground))
    }
}

/// The diagonal of a cubic cell, so far from the nearest rim; all in metres.
fn longest_edge(at_rims: f64, distance: f64) -> f64 {
    3.0f64.sqrt() * (at_rims + GROWTH * distance)
}

impl Sensor {
    /// Builds the designed sensor on a mesh of one kind with at most so many tetrahedra.
    ///
    /// # Errors
    /// As [`SensorDesign::lattice`] or [`SensorDesign::bisection`], [`Sensor::on_lattice`] and [`Sensor::on_mesh`].
    pub fn generated(design: &SensorDesign, kind: MeshKind, max_tets: usize) -> Result<Self, SensorError> {
        match kind {
            MeshKind::Lattice => {
                let lattice: Lattice = design.lattice(max_tets)?;
                Self::on_lattice(design, &lattice)
            }
            MeshKind::Bisection => {
                let mesh = design.bisection(max_tets)?.into_tet_mesh()?;
                let (mesh, mut ground) = design.with_ground_and_board(mesh)?;
                if design.wall == Wall::Open {
                    // All of the wall is given as grounded; then it is opened.
                    ground.extend(nodes_where(&mesh, |node| design.is_on_wall(node)));
                }
                let by_shape =
                    design.electrodes.iter().map(|e| (e.name.clone(), ElectrodeNodes::Shape(e.clone())));
                Self::on_mesh_within(design.wall, mesh, &ground, by_shape.collect())
            }
        }
    }
}
