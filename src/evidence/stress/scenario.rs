//! What stands where under each stress: boxes in front of two stripes, for a few frames.

use super::ladder::{Afloat, Parts, Stress};
use super::meshes::{self, DOMAIN};
use capsense_core::baseline::STEEL;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{Sensor, SensorError};
use capsense_core::solids::{SolidError, Solids};

/// Frames that are solved, at the end of all.
const SOLVED: usize = 2;

/// Metres by which bodies move from frame to frame.
const STEP: DVec3 = DVec3::new(0.0, 3e-3, 0.0);

/// Pixels of the paper's camera along either side.
const PIXELS: usize = 128;

/// Tetrahedra of the mesh whose changes are taken for true ones.
const FINE_TETS: usize = 100_000;

/// A gap in metres up to which an electrode and a bar are plates, their edges within a hundredth.
const PLATES: f64 = 1e-4;

/// The bar of the built-in scene.
const BAR: DVec3 = DVec3::new(0.15, 0.15, 0.02);

/// Boxes of some sizes and materials on their ways.
pub(super) struct Scenario {
    pub(super) stress: Stress,
    pub(super) materials: Vec<Material>,
    sizes: Vec<DVec3>,
    /// Centres in the first of the frames that are solved.
    centres: Vec<DVec3>,
    /// Frames before those that are solved.
    before: u32,
}

impl Scenario {
    pub(super) fn of(stress: Stress) -> Self {
        let one = |material, size, centre| Self {
            stress,
            materials: vec![material],
            sizes: vec![size],
            centres: vec![centre],
            before: 0,
        };
        // The faces of bodies are in no plane of the lattices.
        let above = DVec3::new(0.0, 0.0, 0.0437);
        let block = (DVec3::new(0.2, 0.2, 0.1), DVec3::new(0.0, 0.0, 0.0737));
        let plate = |thickness: f64| (DVec3::new(0.15, 0.15, thickness), DVec3::new(0.0, 0.0, 0.0337));
        match stress {
            Stress::Permittivity(value) => one(dielectric(value), block.0, block.1),
            Stress::Frames(frames) => Self { before: frames - 1, ..one(dielectric(STEEL), BAR, above) },
            Stress::Gap(gap) => one(GROUNDED, BAR, DVec3::new(0.0, 0.0, gap + 0.5 * BAR.z)),
            Stress::ThinConductor(thickness) => one(GROUNDED, plate(thickness).0, plate(thickness).1),
            Stress::ThinDielectric(thickness) => {
                one(dielectric(80.0), plate(thickness).0, plate(thickness).1)
            }
            Stress::Floating(Afloat::One) => one(conductor(Connection::Floating), BAR, above),
            Stress::Floating(Afloat::Tied(farads)) => {
                one(conductor(Connection::Capacitance(farads)), BAR, above)
            }
            Stress::Floating(Afloat::Eight) => Self::floating(stress, &eight_blocks()),
            Stress::Floating(Afloat::NearlyTouching) => {
                let x = 0.5 * (BLOCK.x + 1e-6);
                Self::floating(stress, &[-x, x].map(|x| DVec3::new(x, 0.0, 0.0437)))
            }
            Stress::Ungrounded(_) => {
                let second =
                    if stress == Stress::Ungrounded(Parts::NoGround) { DVec3::ZERO } else { DVec3::X };
                one(conductor(Connection::Floating), BAR, above + second)
            }
            Stress::Sliver(_) | Stress::Jump(_) | Stress::Tolerance(_) => one(GROUNDED, BAR, above),
        }
    }

    fn floating(stress: Stress, centres: &[DVec3]) -> Self {
        let materials = vec![conductor(Connection::Floating); centres.len()];
        let sizes = vec![BLOCK; centres.len()];
        Self { stress, materials, sizes, centres: centres.to_vec(), before: 0 }
    }

    /// The sensor on a lattice, or on the same mesh that is not known to be one; `None` where there is no lattice.
    pub(super) fn sensor(&self, is_lattice: bool) -> Option<Result<Sensor, SensorError>> {
        match self.stress {
            Stress::Sliver(_) | Stress::Ungrounded(_) if is_lattice => None,
            Stress::Sliver(degrees) => Some(meshes::with_slivers(degrees)),
            Stress::Ungrounded(parts) => Some(meshes::in_parts(parts)),
            Stress::Jump(ratio) => Some(meshes::with_jumps(ratio)),
            _ => Some(meshes::on_lattice()),
        }
        .map(|sensor| sensor.map(|sensor| if is_lattice { sensor } else { sensor.off_lattice() }))
    }

    /// A mesh whose changes are taken for true ones, where it is the interface model that is stressed and the gap is not so narrow that
    /// both sides are plates.
    pub(super) fn fine(&self) -> Option<Result<Sensor, SensorError>> {
        let (size, centre) = (self.sizes[0].z, self.centres[0].z);
        let faces = [centre - 0.5 * size, centre + 0.5 * size];
        let closest = match self.stress {
            Stress::Gap(gap) if gap <= PLATES => return None,
            // Links at rims know of conductors closer than a cell, but not of one a cell away, so no plane may be in the gap.
            Stress::Gap(_) => return Some(meshes::fine(&[], 2e-3, FINE_TETS)),
            Stress::ThinConductor(_) | Stress::ThinDielectric(_) => size,
            Stress::Permittivity(_) | Stress::Floating(_) => 2e-3,
            _ => return None,
        };
        Some(meshes::fine(&faces, closest.min(2e-3), FINE_TETS))
    }

    /// The smallest tolerance that rounding leaves room for.
    pub(super) fn finest_tolerance(&self) -> f64 {
        match self.stress {
            Stress::Permittivity(value) => (2e-17 * value).max(1e-13),
            _ => 1e-13,
        }
    }

    /// Number of frames, those that are solved included.
    pub(super) fn frames(&self) -> u32 {
        self.before + SOLVED as u32
    }

    /// The first frame that is solved.
    pub(super) fn first_solved(&self) -> u32 {
        self.before
    }

    fn centre(&self, object: usize, frame: u32) -> DVec3 {
        let away = match self.stress {
            // On a winding way that ends where the others begin.
            Stress::Frames(_) if frame < self.before => {
                let time = 1e-3 * f64::from(self.before - frame);
                DVec3::new((9.0 * time).sin(), (11.3 * time).sin(), 0.4 - 0.4 * (23.0 * time).cos()) * 0.1
            }
            _ => STEP * f64::from(frame - self.before),
        };
        self.centres[object] + away
    }

    /// Exact surfaces, standing where they are in the first frame that is solved.
    pub(super) fn solids(&self) -> Result<Solids, SolidError> {
        Solids::new(&self.sizes.iter().map(|&size| Shape::Box { size }).collect::<Vec<_>>())
    }

    /// Moves them to a frame.
    pub(super) fn place(&self, solids: &mut Solids, frame: u32) -> Result<(), SolidError> {
        let poses = (0..self.sizes.len()).map(|object| Pose::at(self.centre(object, frame)));
        solids.place(&poses.collect::<Vec<_>>())
    }

    /// What the paper's method makes of the materials, and whether it fills what is behind them; `None` where it has no
    /// such material.
    pub(super) fn as_in_paper(&self) -> Option<(Vec<RelativePermittivity>, bool)> {
        let of = |material: &Material| match *material {
            Material::Dielectric(permittivity) => Some(permittivity),
            Material::Conductor(Connection::Grounded | Connection::Floating) => {
                RelativePermittivity::new(STEEL)
            }
            Material::Conductor(Connection::Capacitance(_)) => None,
        };
        let permittivities = self.materials.iter().map(of).collect::<Option<_>>()?;
        Some((permittivities, self.materials.contains(&GROUNDED)))
    }

    /// What the paper's camera sees in a frame.
    pub(super) fn depth(&self, frame: u32, back_fill: bool) -> DepthLayers {
        let view = OrthographicView { domain: DOMAIN, width: PIXELS, height: PIXELS };
        let mut depth = DepthLayers::empty(view, self.sizes.len());
        for (object, &size) in self.sizes.iter().enumerate() {
            let centre = self.centre(object, frame);
            let solid = Aabb { min: centre - 0.5 * size, max: centre + 0.5 * size };
            let (front, back) = depth.layer_mut(object);
            for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
                if solid.contains(view.pixel_centre(pixel % PIXELS, pixel / PIXELS).extend(centre.z)) {
                    (*front, *back) = (solid.min.z as f32, solid.max.z as f32);
                }
            }
        }
        if back_fill {
            depth.back_fill();
        }
        depth
    }
}

const GROUNDED: Material = Material::Conductor(Connection::Grounded);

/// What floats beside others.
const BLOCK: DVec3 = DVec3::new(0.05, 0.05, 0.04);

fn conductor(connection: Connection) -> Material {
    Material::Conductor(connection)
}

/// A value that is not positive does not occur; it would be vacuum.
fn dielectric(permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(permittivity).unwrap_or(RelativePermittivity::VACUUM))
}

fn eight_blocks() -> Vec<DVec3> {
    let place = |k: u32| {
        let [column, row] = [k % 3, k / 3].map(|index| 0.07 * f64::from(index) - 0.07);
        DVec3::new(column, row, 0.0537)
    };
    (0..8).map(place).collect()
}
