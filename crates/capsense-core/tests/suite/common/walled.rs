//! A box whose walls are held at potentials that differ from node to node, with solids inside: for closed forms in a space
//! without end, whose potentials the walls then take. `Simulator` has terminals of one potential each, so the same parts
//! are put together here: occupancy, stiffness matrix, and plain conjugate gradients instead of the solver.

#![allow(unreachable_pub, clippy::unwrap_used)]

use super::edges_alone::EdgesAlone;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::Material;
use capsense_core::mesh::{Background, Lattice, TetMesh};
use capsense_core::occupancy::{EdgeGeometry, LayerWall, NO_OBJECT, Occupancy, Span, Surfaces};
use capsense_core::sensor::{FREE, GROUND};
use capsense_core::solids::Solids;
use capsense_core::stiffness::{EdgeNetwork, LANES, Lane, StiffnessMatrix};

/// A solid of some material.
pub struct Body {
    pub shape: Shape,
    pub pose: Pose,
    pub material: Material,
}

/// Potentials of the walls and of conductors; those of dielectrics are of no meaning.
pub struct Held<'a> {
    pub wall: &'a dyn Fn(DVec3) -> f64,
    pub bodies: &'a [f64],
}

/// What cuts edges of the lattice.
#[derive(Clone, Copy, PartialEq)]
pub enum Rule {
    /// As on any other mesh.
    EdgesAlone,
    /// As seen by a depth camera of any number of pixels: where solids are along z counts, too.
    AsLayers,
    /// All that solids tell counts: where their edges are, how they are rounded, what they cover beside edges of the lattice.
    AsSolids,
}

/// Solids as a camera along z sees them whose pixels are as small as can be.
struct AsLayers(EdgesAlone<Solids>);

/// Further along z than any domain.
const FAR: f64 = 1e4;

impl Surfaces for AsLayers {
    fn objects(&self) -> usize {
        self.0.objects()
    }

    fn bounds(&self, object: usize) -> Aabb {
        self.0.bounds(object)
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        self.0.contains(object, point)
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        self.0.span(object, a, b)
    }

    fn has_layers(&self) -> bool {
        true
    }

    fn layer_at(&self, object: usize, point: DVec3) -> Option<[f64; 2]> {
        let [from, to] = [-FAR, FAR].map(|z| DVec3 { z, ..point });
        let span = self.0.span(object, from, to)?;
        Some([span.enter, span.exit].map(|part| -FAR + 2.0 * FAR * part))
    }

    /// All sides of bodies that are seen so are along z.
    fn wall_between(&self, object: usize, a: DVec3, b: DVec3, _depths: [f64; 2]) -> Option<LayerWall> {
        self.span(object, a, b).map(|span| LayerWall { enter: span.enter, slope: 0.0 })
    }
}

/// The box with its bodies.
pub struct WalledBox {
    nodes: Vec<DVec3>,
    on_wall: Vec<bool>,
    occupancy: Occupancy,
    matrix: StiffnessMatrix,
}

/// Potentials and charges per ε₀ at each row, a lane for each problem.
pub struct Solved<'a> {
    of: &'a WalledBox,
    potentials: Vec<Lane>,
    charges: Vec<Lane>,
}

/// A lattice of cubes of about the given size.
pub fn cubes(domain: Aabb, size: f64) -> Lattice {
    let cells = domain.size().to_array().map(|length| (length / size).round() as usize);
    Lattice::uniform(domain, cells).unwrap()
}

impl WalledBox {
    pub fn new(lattice: &Lattice, bodies: &[Body], rule: Rule) -> Self {
        Self::with_walls_across([true; 3], lattice, bodies, rule)
    }

    /// The same with walls across some axes only; the other sides are insulated.
    pub fn with_walls_across(axes: [bool; 3], lattice: &Lattice, bodies: &[Body], rule: Rule) -> Self {
        let mesh = lattice.to_tet_mesh().unwrap();
        let network = EdgeNetwork::assemble_lattice(lattice, &Background::vacuum(lattice.tet_count()));
        let occupancy = Occupancy::empty(mesh.nodes().len(), network.edges().len());
        Self::of(axes, &mesh, network, occupancy, bodies, rule)
    }

    /// Any mesh of a box.
    pub fn on_mesh(mesh: &TetMesh, bodies: &[Body], rule: Rule) -> Self {
        let network = EdgeNetwork::assemble(mesh);
        let occupancy = Occupancy::empty(mesh.nodes().len(), network.edges().len());
        let occupancy = match rule {
            Rule::EdgesAlone | Rule::AsLayers => occupancy,
            // As in a simulator.
            Rule::AsSolids if bodies.iter().any(|body| matches!(body.material, Material::Dielectric(_))) => {
                let occupancy = occupancy.with_weights(mesh, network.edges(), network.weights(), true);
                occupancy.with_immersed_elements(mesh, network.edges())
            }
            Rule::AsSolids => occupancy.with_weights(mesh, network.edges(), network.weights(), false),
        };
        Self::of([true; 3], mesh, network, occupancy, bodies, rule)
    }

    fn of(
        axes: [bool; 3],
        mesh: &TetMesh,
        network: EdgeNetwork,
        mut occupancy: Occupancy,
        bodies: &[Body],
        rule: Rule,
    ) -> Self {
        let nodes = mesh.nodes().to_vec();
        let domain = Aabb::around(nodes.iter().copied());
        let at_side = |p: &DVec3, axis: usize| p[axis] == domain.min[axis] || p[axis] == domain.max[axis];
        let is_wall = |p: &DVec3| (0..3).any(|axis| axes[axis] && at_side(p, axis));
        let on_wall: Vec<bool> = nodes.iter().map(is_wall).collect();
        let terminals: Vec<_> = on_wall.iter().map(|&wall| if wall { GROUND } else { FREE }).collect();
        let mut matrix = StiffnessMatrix::new(network.clone(), nodes.len());
        if !bodies.is_empty() {
            let shapes: Vec<Shape> = bodies.iter().map(|body| body.shape.clone()).collect();
            let poses: Vec<Pose> = bodies.iter().map(|body| body.pose).collect();
            let materials: Vec<Material> = bodies.iter().map(|body| body.material).collect();
            let mut solids = Solids::new(&shapes).unwrap();
            solids.place(&poses).unwrap();
            let mesh = EdgeGeometry {
                nodes: &nodes,
                terminals: &terminals,
                edges: network.edges(),
                permittivity: network.permittivity(),
            };
            match rule {
                Rule::EdgesAlone => occupancy.update(mesh, &materials, &EdgesAlone(solids)),
                Rule::AsLayers => occupancy.update(mesh, &materials, &AsLayers(EdgesAlone(solids))),
                Rule::AsSolids => occupancy.update(mesh, &materials, &solids),
            }
            matrix.update(&occupancy);
        }
        Self { nodes, on_wall, occupancy, matrix }
    }

    /// Nodes whose potential is solved for, and where they are.
    pub fn free_nodes(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let free = (0..self.nodes.len()).filter(|&row| self.holder(row).is_none() && !self.on_wall[row]);
        free.map(|row| (row, self.nodes[row]))
    }

    /// The object that holds a row, if one does. After the nodes' rows come those of objects.
    fn holder(&self, row: usize) -> Option<usize> {
        match row.checked_sub(self.nodes.len()) {
            Some(object) => Some(object),
            None => Some(self.occupancy.conductors()[row]).filter(|&o| o != NO_OBJECT).map(usize::from),
        }
    }

    pub fn solve(&self, problems: &[Held<'_>]) -> Solved<'_> {
        assert!(problems.len() <= LANES);
        let objects = problems[0].bodies.len();
        let rows = self.nodes.len() + objects;
        let mut x = vec![[0.0; LANES]; rows];
        let mut inverse = vec![0.0; rows];
        for row in 0..rows {
            match self.holder(row) {
                Some(object) => (0..problems.len()).for_each(|l| x[row][l] = problems[l].bodies[object]),
                None if self.on_wall[row] => {
                    (0..problems.len()).for_each(|l| x[row][l] = (problems[l].wall)(self.nodes[row]));
                }
                None => inverse[row] = 1.0 / self.matrix.diagonal(row),
            }
        }
        let charges = conjugate_gradients(&self.matrix, &inverse, &mut x);
        Solved { of: self, potentials: x, charges }
    }
}

impl Solved<'_> {
    /// The root mean square of how far potentials of free nodes are from those of a field.
    pub fn deviation(&self, problem: usize, field: impl Fn(DVec3) -> f64) -> f64 {
        let squares = self.of.free_nodes().map(|(row, p)| (self.potentials[row][problem] - field(p)).powi(2));
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        f64::sqrt(sum / count)
    }

    /// The charge of a conductor per ε₀.
    pub fn charge(&self, problem: usize, object: usize) -> f64 {
        let rows = (0..self.charges.len()).filter(|&row| self.of.holder(row) == Some(object));
        rows.map(|row| self.charges[row][problem]).sum()
    }

    /// φᵀKφ of two problems: a capacitance per ε₀ where all potentials held are 0 V and 1 V.
    pub fn energy(&self, one: usize, other: usize) -> f64 {
        self.potentials.iter().zip(&self.charges).map(|(x, y)| x[one] * y[other]).sum()
    }
}

/// Solves for the rows whose inverse diagonal is not zero, and returns Kx.
fn conjugate_gradients(matrix: &StiffnessMatrix, inverse: &[f64], x: &mut [Lane]) -> Vec<Lane> {
    let dot = |a: &[Lane], b: &[Lane]| {
        let mut sum = [0.0; LANES];
        a.iter().zip(b).for_each(|(a, b)| (0..LANES).for_each(|l| sum[l] += a[l] * b[l]));
        sum
    };
    let ratio = |a: Lane, b: Lane| std::array::from_fn(|l| if b[l] == 0.0 { 0.0 } else { a[l] / b[l] });
    let mut q = vec![[0.0; LANES]; x.len()];
    let _ = matrix.apply(x, &mut q);
    let free = |row: usize, lane: Lane| if inverse[row] == 0.0 { [0.0; LANES] } else { lane };
    let mut r: Vec<Lane> = q.iter().enumerate().map(|(row, q)| free(row, q.map(|q| -q))).collect();
    let mut p = vec![[0.0; LANES]; x.len()];
    let (mut before, mut first) = ([0.0; LANES], None);
    for _ in 0..2000 {
        let z: Vec<Lane> = r.iter().zip(inverse).map(|(r, i)| r.map(|r| r * i)).collect();
        let now = dot(&r, &z);
        let first = *first.get_or_insert(now);
        if (0..LANES).all(|l| now[l] <= 1e-18 * first[l]) {
            let _ = matrix.apply(x, &mut q);
            return q;
        }
        let beta: Lane = ratio(now, before);
        p.iter_mut().zip(&z).for_each(|(p, z)| (0..LANES).for_each(|l| p[l] = z[l] + beta[l] * p[l]));
        let _ = matrix.apply(&p, &mut q);
        q.iter_mut().enumerate().for_each(|(row, q)| *q = free(row, *q));
        let step: Lane = ratio(now, dot(&p, &q));
        for (row, x) in x.iter_mut().enumerate() {
            (0..LANES).for_each(|l| x[l] += step[l] * p[row][l]);
            (0..LANES).for_each(|l| r[row][l] -= step[l] * q[row][l]);
        }
        before = now;
    }
    unreachable!("not converged");
}
