//! What is drawn of a scene and never changes while bodies move: mesh, electrodes, board, and the surfaces of bodies.

use super::outlines::{border, triangles};
use capsense::Scene;
use capsense::render::tessellate;
use capsense::scene::SceneSensor;
use capsense_core::electrode::Electrode;
use capsense_core::geometry::{Aabb, Shape};
use capsense_core::material::Material;
use capsense_core::mesh::{Background, Edges};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Stands for the ends of an edge that does not exist.
pub(super) const NO_EDGE: [u32; 2] = [u32::MAX; 2];

/// Stands for the element beyond a face of the mesh's surface.
pub(super) const OUTSIDE: u32 = u32::MAX;

/// Surfaces that turn by less than this between two triangles are drawn as smooth: the cosine of 35 degrees.
const SMOOTH: f32 = 0.82;

/// The corners of the face opposite of each corner of an element, counter-clockwise seen from outside.
pub(super) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The pairs of corners that are an element's edges.
const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// What never changes.
#[derive(Debug)]
pub(super) struct StaticScene {
    pub(super) domain: Aabb,
    pub(super) board: Option<Aabb>,
    pub(super) electrodes: Vec<ElectrodeSurface>,
    pub(super) bodies: Vec<BodySurface>,
    /// Node positions in metres, and once more as they are drawn.
    pub(super) nodes: Vec<DVec3>,
    pub(super) tets: Vec<[u32; 4]>,
    /// The element beyond the face opposite of each corner, or [`OUTSIDE`].
    pub(super) neighbours: Vec<[u32; 4]>,
    /// The edges of each element along which it weighs anything; `u32::MAX` for the others.
    pub(super) tet_edges: Vec<[u32; 6]>,
    /// Of each edge of the network, or [`NO_EDGE`].
    pub(super) edge_ends: Vec<[u32; 2]>,
    pub(super) permittivity: Background,
    /// How many elements stand together in a cell.
    pub(super) elements_in_cell: usize,
}

/// An electrode as it is drawn.
#[derive(Debug)]
pub(super) struct ElectrodeSurface {
    pub(super) name: String,
    pub(super) triangles: Vec<[DVec3; 3]>,
    pub(super) border: Vec<[DVec3; 2]>,
}

/// The surface of a body in its own frame: three vertices for each triangle.
#[derive(Debug)]
pub(super) struct BodySurface {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) bounds: Aabb,
    pub(super) material: Material,
}

impl StaticScene {
    pub(super) fn new(scene: &Scene, simulator: &Simulator) -> Self {
        let (sensor, network) = (simulator.sensor(), simulator.matrix().network());
        let mesh = sensor.mesh();
        let (tets, edges) = (mesh.tets().to_vec(), network.edges());
        let shapes = designed_shapes(scene);
        let names = sensor.electrode_names().iter().enumerate();
        let electrodes = names.map(|(index, name)| match shapes.iter().find(|shape| shape.name == *name) {
            Some(shape) => ElectrodeSurface::of_shape(shape),
            None => ElectrodeSurface::of_nodes(name, sensor, index),
        });
        Self {
            domain: mesh.bounds(),
            board: match &scene.sensor {
                SceneSensor::Generated { design, .. } => design.substrate.map(|board| board.bounds()),
                SceneSensor::Meshed { .. } => None,
            },
            electrodes: electrodes.collect(),
            bodies: scene
                .objects
                .iter()
                .map(|object| BodySurface::new(&object.shape, object.material))
                .collect(),
            nodes: mesh.nodes().to_vec(),
            neighbours: neighbours(&tets),
            tet_edges: edges_of_elements(&tets, edges),
            tets,
            edge_ends: (0..edges.len()).map(|edge| edges.ends(edge).unwrap_or(NO_EDGE)).collect(),
            permittivity: mesh.relative_permittivity().clone(),
            elements_in_cell: if matches!(edges, Edges::Lattice(_)) { 6 } else { 1 },
        }
    }

    /// Corner positions of one element.
    pub(super) fn corners(&self, element: u32) -> [DVec3; 4] {
        self.tets[element as usize].map(|node| self.nodes[node as usize])
    }
}

/// Electrodes that were given by their shapes.
fn designed_shapes(scene: &Scene) -> Vec<&Electrode> {
    match &scene.sensor {
        SceneSensor::Generated { design, .. } => design.electrodes.iter().collect(),
        SceneSensor::Meshed { electrodes, .. } => {
            let shapes = electrodes.iter().filter_map(|(_, nodes)| match nodes {
                ElectrodeNodes::Shape(shape) => Some(shape),
                ElectrodeNodes::Nodes(_) => None,
            });
            shapes.collect()
        }
    }
}

impl ElectrodeSurface {
    fn of_shape(shape: &Electrode) -> Self {
        let at = |point: glam::DVec2| point.extend(shape.z);
        Self {
            name: shape.name.clone(),
            triangles: triangles(&shape.outline).into_iter().map(|corners| corners.map(at)).collect(),
            border: border(&shape.outline).into_iter().map(|ends| ends.map(at)).collect(),
        }
    }

    /// The faces of elements of which the electrode owns all corners, each once.
    fn of_nodes(name: &str, sensor: &Sensor, index: usize) -> Self {
        let mesh = sensor.mesh();
        let is_own = |node: u32| usize::from(sensor.owners()[node as usize]) == index + 1;
        let mut faces: Vec<[u32; 3]> = Vec::new();
        for tet in mesh.tets().iter() {
            for face in FACES.map(|face| face.map(|corner| tet[corner])) {
                if face.into_iter().all(is_own) {
                    let mut face = face;
                    face.sort_unstable();
                    faces.push(face);
                }
            }
        }
        faces.sort_unstable();
        faces.dedup();
        let mut edges: Vec<[u32; 2]> = faces.iter().flat_map(|&[a, b, c]| [[a, b], [a, c], [b, c]]).collect();
        edges.sort_unstable();
        let border: Vec<[u32; 2]> =
            edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]).collect();
        let at = |node: u32| mesh.nodes()[node as usize];
        Self {
            name: name.to_owned(),
            triangles: faces.into_iter().map(|face| face.map(at)).collect(),
            border: border.into_iter().map(|ends| ends.map(at)).collect(),
        }
    }
}

impl BodySurface {
    /// A shape that cannot be drawn has no surface: the pipeline has refused it before.
    pub(super) fn new(shape: &Shape, material: Material) -> Self {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        if let Ok(mesh) = tessellate(shape) {
            positions.extend(mesh.vertices().iter().map(|vertex| vertex.as_vec3()));
            triangles.extend_from_slice(mesh.triangles());
        }
        let corners: Vec<[Vec3; 3]> =
            triangles.iter().map(|triangle| triangle.map(|vertex| positions[vertex as usize])).collect();
        let normals = smooth_normals(&triangles, &corners, positions.len());
        Self {
            bounds: Aabb::around(positions.iter().map(|position| position.as_dvec3())),
            positions: corners.into_flattened(),
            normals,
            material,
        }
    }
}

/// A normal for each corner of each triangle: the mean over the triangles at its vertex that face about the same way,
/// weighted by area.
fn smooth_normals(triangles: &[[u32; 3]], corners: &[[Vec3; 3]], vertices: usize) -> Vec<Vec3> {
    let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    let mut at_vertex: Vec<Vec<u32>> = vec![Vec::new(); vertices];
    for (triangle, corners) in triangles.iter().enumerate() {
        corners.iter().for_each(|&vertex| at_vertex[vertex as usize].push(triangle as u32));
    }
    let areas: Vec<Vec3> = corners.iter().map(|&corners| area(corners)).collect();
    let normal = |triangle: usize, vertex: u32| {
        let own = areas[triangle].normalize_or_zero();
        let around = at_vertex[vertex as usize].iter().map(|&other| areas[other as usize]);
        let alike = around.filter(|other| other.normalize_or_zero().dot(own) >= SMOOTH);
        alike.sum::<Vec3>().normalize_or(own)
    };
    let each = triangles.iter().enumerate();
    each.flat_map(|(triangle, corners)| corners.map(|vertex| normal(triangle, vertex))).collect()
}

/// The element beyond each face.
fn neighbours(tets: &[[u32; 4]]) -> Vec<[u32; 4]> {
    let mut neighbours = vec![[OUTSIDE; 4]; tets.len()];
    let mut open: HashMap<[u32; 3], (u32, usize)> = HashMap::with_capacity(2 * tets.len());
    for (element, tet) in tets.iter().enumerate() {
        for (corner, face) in FACES.iter().enumerate() {
            let mut face = face.map(|corner| tet[corner]);
            face.sort_unstable();
            match open.remove(&face) {
                None => {
                    open.insert(face, (element as u32, corner));
                }
                Some((other, its_corner)) => {
                    neighbours[element][corner] = other;
                    neighbours[other as usize][its_corner] = element as u32;
                }
            }
        }
    }
    neighbours
}

/// The numbers of each element's edges.
fn edges_of_elements(tets: &[[u32; 4]], edges: &Edges) -> Vec<[u32; 6]> {
    let pairs = |tet: &[u32; 4]| PAIRS.map(|[a, b]| [tet[a].min(tet[b]), tet[a].max(tet[b])]);
    match edges {
        Edges::Lattice(lattice) => {
            let strides = lattice.strides();
            let edge = |[a, b]: [u32; 2]| {
                let axis = strides.iter().position(|&stride| stride == (b - a) as usize);
                axis.map_or(u32::MAX, |axis| 3 * a + axis as u32)
            };
            tets.iter().map(|tet| pairs(tet).map(edge)).collect()
        }
        Edges::List(_) => {
            let ends = (0..edges.len() as u32).map(|edge| (edges.ends_of_existing(edge as usize), edge));
            let numbers: HashMap<[u32; 2], u32> =
                ends.map(|([a, b], edge)| ([a.min(b), a.max(b)], edge)).collect();
            let number = |pair| numbers.get(&pair).copied().unwrap_or(u32::MAX);
            tets.iter().map(|tet| pairs(tet).map(number)).collect()
        }
    }
}
