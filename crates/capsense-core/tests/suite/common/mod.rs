//! Sensors, materials and depth images that several tests use.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

pub mod conforming;
pub mod cubic;
pub mod edges_alone;
pub mod half_spaces;
pub mod shapes;
pub mod updater;
pub mod walled;

use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::{Lattice, TetMesh, signed_volume};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{ElectrodeNodes, FREE, GROUND, Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};

/// The domain of the built-in scene.
pub const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

/// Converged to rounding: the tolerance bounds energy, which is quadratic in the field.
pub const EXACT: SolverOptions = SolverOptions {
    tolerance: 1e-22,
    change_tolerance: None,
    preconditioner: Preconditioner::Multigrid,
    max_iterations: 20_000,
    threads: None,
};

/// The same, from a factorisation.
pub const DIRECT: SolverOptions = SolverOptions { preconditioner: Preconditioner::Cholesky, ..EXACT };

pub const GROUNDED: Material = Material::Conductor(Connection::Grounded);
pub const FLOATING: Material = Material::Conductor(Connection::Floating);

pub fn rectangle(name: &str, center: [f64; 2], size: [f64; 2]) -> Electrode {
    let outline = Outline::Rectangle { center: DVec2::from(center), size: DVec2::from(size) };
    Electrode { name: name.to_owned(), outline, z: 0.0 }
}

/// Three stripes 100 mm x 20 mm with gaps of 10 mm.
pub fn three_stripes() -> SensorDesign {
    let electrodes = (0..3)
        .map(|k| rectangle(&format!("E{}", k + 1), [0.0, 0.03 * (f64::from(k) - 1.0)], [0.1, 0.02]))
        .collect();
    SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded }
}

/// The three stripes on the finest lattice of no more tetrahedra whose spacing grows alike in all directions.
pub fn stripes_sensor(tets: usize) -> Sensor {
    let (design, growth) = (three_stripes(), (6.8 / (tets as f64).powf(0.25)).min(0.6));
    let (mut fits, mut exceeds, mut finest) = (0.5_f64, 5e-6, None::<Lattice>);
    for _ in 0..24 {
        let middle = (fits * exceeds).sqrt();
        let lattice = design.lattice_of_spacing(middle, 1.0 + growth).unwrap();
        if lattice.tet_count() > tets {
            exceeds = middle;
        } else {
            fits = middle;
            if finest.as_ref().is_none_or(|finest| lattice.tet_count() > finest.tet_count()) {
                finest = Some(lattice);
            }
        }
    }
    Sensor::on_lattice(&design, &finest.unwrap()).unwrap()
}

/// What a camera of so many pixels sees of axis-aligned boxes, one object each.
pub fn depth_of_boxes(pixels: [usize; 2], boxes: &[Aabb]) -> DepthLayers {
    let view = OrthographicView { domain: DOMAIN, width: pixels[0], height: pixels[1] };
    let mut depth = DepthLayers::empty(view, boxes.len());
    for (object, solid) in boxes.iter().enumerate() {
        let (front, back) = depth.layer_mut(object);
        for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
            let at = view.pixel_centre(pixel % pixels[0], pixel / pixels[0]).extend(solid.min.z);
            if solid.contains(at) {
                (*front, *back) = (solid.min.z as f32, solid.max.z as f32);
            }
        }
    }
    depth
}

/// The steel bar, 150 mm x 150 mm x 20 mm, its lower face at a height and its centre shifted along y.
pub fn bar(height: f64, shift: f64) -> Aabb {
    let low = DVec3::new(-0.075, shift - 0.075, height);
    Aabb { min: low, max: low + DVec3::new(0.15, 0.15, 0.02) }
}

/// The same sensor on the same mesh, which no longer is known to be a lattice.
pub fn without_lattice(sensor: &Sensor) -> Sensor {
    sensor.clone().off_lattice()
}

/// The same terminals on another mesh with the same nodes, not known to be a lattice.
pub fn on_other_mesh(sensor: &Sensor, mesh: TetMesh) -> Sensor {
    let nodes_of = |terminal: u16| -> Vec<u32> {
        let of_terminal = sensor.owners().iter().zip(0..).filter(|(held, _)| **held == terminal);
        of_terminal.map(|(_, node)| node).collect()
    };
    let names = sensor.electrode_names().iter().cloned();
    let electrodes = names.zip(1..).map(|(name, t)| (name, ElectrodeNodes::Nodes(nodes_of(t)))).collect();
    let other = Sensor::on_mesh(mesh, &nodes_of(GROUND), electrodes).unwrap();
    // Held rims stay held.
    if sensor.rim().is_empty() { other.with_rims_held() } else { other }
}

/// The same sensor on a lattice and on a mesh that is not known to be one.
pub fn both(lattice: Sensor) -> [Sensor; 2] {
    [without_lattice(&lattice), lattice]
}

/// A sensor on a lattice, its rims held: on the same mesh not known to be one, on a mesh with negative weights, and itself.
pub fn on_three_meshes(lattice: &Sensor) -> [Sensor; 3] {
    let held = lattice.clone().with_rims_held();
    [without_lattice(&held), with_slivers(&held), held]
}

pub fn conductor(connection: Connection) -> Material {
    Material::Conductor(connection)
}

pub fn dielectric(relative_permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(relative_permittivity).unwrap())
}

/// A material of any kind.
pub fn any_material(dice: &mut Dice) -> Material {
    match dice.below(4) {
        0 => GROUNDED,
        1 => FLOATING,
        2 => conductor(Connection::Capacitance(10_f64.powf(dice.between(-14.0, -10.0)))),
        _ => dielectric(10_f64.powf(dice.between(-6.0, 6.0))),
    }
}

/// The usual solver with another tolerance.
pub fn to(tolerance: f64) -> SolverOptions {
    SolverOptions { tolerance, ..SolverOptions::default() }
}

/// What a simulator is compared with: a sparse factorisation of the whole matrix.
pub fn oracle(sensor: &Sensor, materials: &[Material]) -> Simulator {
    let options = SolverOptions { preconditioner: Preconditioner::Cholesky, ..to(1e-13) };
    Simulator::new(sensor.clone(), materials.to_vec(), options).unwrap()
}

/// Largest error of an entry relative to √(C_ii C_jj).
pub fn relative_error(c: &CapacitanceMatrix, truth: &CapacitanceMatrix) -> f64 {
    let entries = (0..c.size()).flat_map(|i| (0..c.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (c.get(i, j) - truth.get(i, j)).abs() / (truth.get(i, i) * truth.get(j, j)).sqrt())
        .fold(0.0, |worst, error| if error.is_nan() { f64::NAN } else { error.max(worst) })
}

/// Uniform numbers in a reproducible order.
pub struct Dice(pub u64);

impl Dice {
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    pub fn below(&mut self, count: usize) -> usize {
        ((self.next() * count as f64) as usize).min(count - 1)
    }

    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.between(-0.3, 0.3), self.between(-0.3, 0.3), self.between(-0.05, 0.3))
    }
}

/// The sensor on its mesh with some free nodes moved almost into the opposite face of an element.
pub fn with_slivers(sensor: &Sensor) -> Sensor {
    let mesh = sensor.mesh();
    let (mut nodes, tets) = (mesh.nodes().to_vec(), mesh.tets().to_vec());
    let mut touched = vec![false; nodes.len()];
    let mut moved = 0;
    for tet in tets.iter().step_by(7) {
        let [node, face @ ..] = *tet;
        let node = node as usize;
        let around: Vec<_> = tets.iter().filter(|tet| tet.contains(&(node as u32))).collect();
        if sensor.owners()[node] != FREE || around.iter().any(|tet| tet.iter().any(|&n| touched[n as usize]))
        {
            continue;
        }
        let before = nodes[node];
        let middle = face.iter().map(|&n| nodes[n as usize]).sum::<DVec3>() / 3.0;
        nodes[node] = before + 0.9995 * (middle - before);
        let volume = |tet: &[u32; 4]| signed_volume(tet.map(|n| nodes[n as usize]));
        if around.iter().any(|tet| volume(tet) < 1e-6 * mesh.volume() / tets.len() as f64) {
            nodes[node] = before;
        } else {
            around.iter().flat_map(|tet| tet.iter()).for_each(|&n| touched[n as usize] = true);
            moved += 1;
        }
    }
    assert!(moved > 5, "{moved} slivers");
    on_other_mesh(sensor, TetMesh::new(nodes, tets).unwrap())
}

/// The sensor, its rims held, on its mesh with free nodes moved by up to a fifth of the way to the next one: a fifth of all
/// edges then weigh less than nothing.
pub fn with_moved_nodes(sensor: &Sensor) -> Sensor {
    let sensor = sensor.clone().with_rims_held();
    let mesh = sensor.mesh();
    let mut narrowest = vec![f64::INFINITY; mesh.nodes().len()];
    for tet in mesh.tets().iter() {
        for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (tet[a] as usize, tet[b] as usize))) {
            if a != b {
                narrowest[a] = narrowest[a].min(mesh.nodes()[a].distance(mesh.nodes()[b]));
            }
        }
    }
    let mut dice = Dice(5);
    let mut moved = |node: usize| {
        let to = DVec3::from_array([(); 3].map(|()| dice.between(-0.2, 0.2)));
        let by = if sensor.owners()[node] == FREE { narrowest[node] } else { 0.0 };
        mesh.nodes()[node] + by * to
    };
    let nodes = (0..narrowest.len()).map(&mut moved).collect();
    on_other_mesh(&sensor, TetMesh::new(nodes, mesh.tets().to_vec()).unwrap())
}

/// Mean and standard deviation.
pub(crate) fn mean_and_deviation(numbers: &[f64]) -> [f64; 2] {
    let count = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / count;
    let variance = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / count;
    [mean, variance.sqrt()]
}
