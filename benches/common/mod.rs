//! The scene that the benches measure: three electrodes of 100 mm x 20 mm, 10 mm apart, in a domain of 0.5 m, and a
//! bar that moves 1 mm a frame.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec2, DVec3};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::solver::SolverOptions;
use capsense_render::{Backend, DepthRenderer};

pub const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };
pub const VIEW: OrthographicView = OrthographicView { domain: DOMAIN, width: 64, height: 64 };
pub const BAR: Shape = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };

/// As wide as a thumb and as high.
pub const BLOCK: Shape = Shape::Box { size: DVec3::new(0.04, 0.04, 0.02) };

/// The bar's turn about the sensor's axis, in radians. Parallel to the pixels it would be seen in another place in every
/// eighth frame only, as a pixel is 8 mm wide.
const YAW: f64 = 0.35;

/// Set to 1 to measure the meshes of [`LARGE_MESHES`] too.
const LARGE: &str = "CAPSENSE_BENCH_LARGE";

const MESHES: [usize; 4] = [10_000, 30_000, 100_000, 300_000];
const LARGE_MESHES: [usize; 2] = [1_000_000, 3_000_000];

/// With `--test` each bench runs once, to see that it does; the smallest meshes show that.
const TESTED_MESHES: [usize; 2] = [10_000, 30_000];

/// Whether everything is to run once, to see that it does.
pub fn is_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}

/// Whether large meshes are to be measured too.
pub fn is_large() -> bool {
    std::env::var(LARGE).is_ok_and(|value| value == "1")
}

/// Largest numbers of tetrahedra to be measured in this run.
pub fn mesh_sizes() -> Vec<usize> {
    if is_test() {
        return TESTED_MESHES.to_vec();
    }
    if !is_large() {
        eprintln!("meshes of {LARGE_MESHES:?} elements are skipped; {LARGE}=1 measures them too");
    }
    MESHES.into_iter().chain(LARGE_MESHES.into_iter().filter(|_| is_large())).collect()
}

/// What the simulator is measured with, on so many threads or all there are.
pub fn solver_options(threads: Option<usize>) -> SolverOptions {
    SolverOptions { tolerance: 1e-4, threads, ..SolverOptions::default() }
}

pub fn design() -> SensorDesign {
    let electrode = |y| {
        let outline = Outline::Rectangle { center: DVec2::new(0.0, y), size: DVec2::new(0.1, 0.02) };
        Electrode { name: format!("E{y}"), outline, z: 0.0 }
    };
    SensorDesign {
        domain: DOMAIN,
        electrodes: [-0.03, 0.0, 0.03].map(electrode).to_vec(),
        substrate: None,
        wall: Wall::Grounded,
    }
}

/// Four by eight electrodes, 42 mm x 21 mm, 60 mm and 30 mm apart.
pub fn array() -> SensorDesign {
    let electrode = |k: u32| {
        let center = DVec2::new(0.06 * (f64::from(k % 4) - 1.5), 0.03 * (f64::from(k / 4) - 3.5));
        let outline = Outline::Rectangle { center, size: DVec2::new(0.042, 0.021) };
        Electrode { name: format!("E{k}"), outline, z: 0.0 }
    };
    SensorDesign {
        domain: DOMAIN,
        electrodes: (0..32).map(electrode).collect(),
        substrate: None,
        wall: Wall::Grounded,
    }
}

pub fn on_lattice(lattice: &Lattice) -> Sensor {
    Sensor::on_lattice(&design(), lattice).unwrap()
}

/// The same mesh and terminals, but nothing is known of a lattice.
pub fn on_tetrahedra(lattice: &Lattice) -> Sensor {
    on_lattice(lattice).off_lattice()
}

/// The bar's poses and depth images on a way there and back, 1 mm a frame, without end.
pub struct Motion {
    pub name: &'static str,
    poses: Vec<Pose>,
    images: Vec<DepthLayers>,
    next: usize,
}

impl Motion {
    /// Across the electrodes, 50 mm above them, and down onto them as far as 10 mm.
    pub fn all() -> [Self; 2] {
        Self::all_of(&BAR)
    }

    /// The same of another body.
    pub fn all_of(shape: &Shape) -> [Self; 2] {
        [
            Self::new("sideways", shape, |metres| DVec3::new(0.0, metres - 0.05, 0.06)),
            Self::new("towards", shape, |metres| DVec3::new(0.0, 0.0, 0.12 - metres)),
        ]
    }

    /// The way of 100 mm whose point after so many metres is `centre`.
    fn new(name: &'static str, shape: &Shape, centre: impl Fn(f64) -> DVec3) -> Self {
        let mut renderer = DepthRenderer::new(Backend::Cpu, VIEW, std::slice::from_ref(shape)).unwrap();
        let pose = |millimetres| Pose {
            rotation: DQuat::from_rotation_z(YAW),
            ..Pose::at(centre(1e-3 * f64::from(millimetres)))
        };
        let poses: Vec<Pose> = (0..=100).chain((1..100).rev()).map(pose).collect();
        let images = poses.iter().map(|pose| {
            let mut depth = DepthLayers::empty(VIEW, 1);
            renderer.render(std::slice::from_ref(pose), &mut depth).unwrap();
            depth
        });
        Self { name, images: images.collect(), poses, next: 0 }
    }

    /// Frames on the whole way there and back.
    pub fn len(&self) -> usize {
        self.images.len()
    }

    pub fn next(&mut self) -> &DepthLayers {
        self.next = (self.next + 1) % self.images.len();
        &self.images[self.next]
    }

    /// The pose in the image told last.
    pub fn pose(&self) -> Pose {
        self.poses[self.next]
    }
}
