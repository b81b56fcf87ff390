//! What cannot be simulated, and why.

use crate::material::{Connection, Material};
use crate::occupancy::InvalidDepth;
use crate::sensor::{FREE, Sensor};
use crate::solver::{Preconditioner, SolveError, SolverOptions};

/// Why a frame cannot be computed.
#[must_use]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulatorError {
    /// The objects seen are not those that were announced.
    #[error("{seen} objects are seen, but the simulator knows the materials of {known}")]
    ObjectCount {
        /// Number of objects seen.
        seen: usize,
        /// Number of materials.
        known: usize,
    },
    /// More objects and electrodes than terminals can be numbered.
    #[error("{0} objects are more than can be numbered")]
    TooManyObjects(usize),
    /// A capacitance to ground that is negative or not finite.
    #[error("object {object} has a capacitance to ground of {farads} F; it must be finite and not negative")]
    CapacitanceToGround {
        /// Index of the object.
        object: usize,
        /// The value given.
        farads: f64,
    },
    /// A dielectric of which double precision does not tell what is asked for.
    #[error(
        "object {object} has a relative permittivity of {permittivity:e}: rounding alone leaves a relative error of \
         {rounding:e}, asked for is {tolerance:e}; a floating conductor is what it nearly is"
    )]
    Permittivity {
        /// Index of the object.
        object: usize,
        /// The value given.
        permittivity: f64,
        /// What rounding makes of self-capacitances.
        rounding: f64,
        /// The error asked for.
        tolerance: f64,
    },
    /// A dielectric with which the error of an iteration without preconditioner cannot be told.
    #[error(
        "object {object} has a relative permittivity of {permittivity:e}; without a preconditioner errors can be told from \
         0.1 to 1000 only"
    )]
    Unpreconditioned {
        /// Index of the object.
        object: usize,
        /// The value given.
        permittivity: f64,
    },
    /// What a device does not compute, and why.
    #[error("a graphics device cannot compute this: {0}")]
    NotForDevice(&'static str),
    /// A dielectric that a device cannot solve for in single precision.
    #[error(
        "object {object} has a relative permittivity of {permittivity:e}; in single precision a device solves for up to \
         {ON_DEVICE:e}"
    )]
    PermittivityForDevice {
        /// Index of the object.
        object: usize,
        /// The value given.
        permittivity: f64,
    },
    /// A tolerance that is not between zero and one.
    #[error("tolerance {0} is not between 0 and 1")]
    Tolerance(f64),
    /// The depth image is no picture of surfaces.
    #[error(transparent)]
    Depth(#[from] InvalidDepth),
    /// The field could not be solved for.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// What rounding makes of a self-capacitance for each unit of a body's permittivity: differences of potentials within the
/// body are known to 1e-16 of a volt, and multiplied by it. Measured with permittivities of 1e8 to 1e12, all solvers,
/// against floating conductors and each other: 1e-18 to 4e-17.
const ROUNDING: f64 = 5e-17;

/// Permittivities with which an iteration without preconditioner does not stand still for long. Measured: with 1e-6, 1e-3, 1e5
/// and 1e6 errors were 3, 20, 50 and 2000 times what they were told to be.
const WITHOUT_PRECONDITIONER: std::ops::RangeInclusive<f64> = 0.1..=1e3;

/// The largest permittivity for a device, which solves no direction of a body as a whole on its own. With 80, C of
/// scenes thrown by dice is within its tolerance (`random_scenes_have_the_capacitances_of_the_processors_solver` in
/// capsense-render); with 1000 it was not always.
const ON_DEVICE: f64 = 100.0;

/// Why a device does not take a tolerance.
const TOO_FINE: &str = "single precision allows tolerances of C from 1e-7, with strong dielectrics from 1e-6, and none of its change";

/// The finest tolerance for a device; written out in [`TOO_FINE`].
const FINEST_ON_DEVICE: f64 = 0.99e-7;

/// Results may be off by so many tolerances.
const ALLOWED: f64 = 3.0;

/// Smaller tolerances ask for as much as rounding leaves.
const FINEST_TOLERANCE: f64 = 2e-11;

/// Refuses options and materials with which results would not be what was asked for.
pub(super) fn check(
    sensor: &Sensor,
    materials: &[Material],
    options: &SolverOptions,
) -> Result<(), SimulatorError> {
    if !(options.tolerance > 0.0 && options.tolerance < 1.0) {
        return Err(SimulatorError::Tolerance(options.tolerance));
    }
    if sensor.electrode_names().len() + materials.len() >= usize::from(FREE) - 1 {
        return Err(SimulatorError::TooManyObjects(materials.len()));
    }
    for (object, material) in materials.iter().enumerate() {
        if let Material::Conductor(Connection::Capacitance(farads)) = *material
            && !(farads.is_finite() && farads >= 0.0)
        {
            return Err(SimulatorError::CapacitanceToGround { object, farads });
        }
        if let Material::Dielectric(permittivity) = *material {
            let (permittivity, tolerance) = (permittivity.value(), options.tolerance);
            let rounding = ROUNDING * permittivity;
            if options.preconditioner == Preconditioner::None
                && !WITHOUT_PRECONDITIONER.contains(&permittivity)
            {
                return Err(SimulatorError::Unpreconditioned { object, permittivity });
            }
            if rounding > ALLOWED * tolerance.max(FINEST_TOLERANCE) {
                return Err(SimulatorError::Permittivity { object, permittivity, rounding, tolerance });
            }
        }
    }
    Ok(())
}

/// Refuses what a device cannot solve for.
pub(super) fn check_remote(materials: &[Material], options: &SolverOptions) -> Result<(), SimulatorError> {
    if options.preconditioner != Preconditioner::Multigrid {
        return Err(SimulatorError::NotForDevice("the preconditioner is not multigrid"));
    }
    if options.tolerance < FINEST_ON_DEVICE || options.change_tolerance.is_some() {
        return Err(SimulatorError::NotForDevice(TOO_FINE));
    }
    for (object, material) in materials.iter().enumerate() {
        if let Material::Dielectric(permittivity) = *material
            && permittivity.value() > ON_DEVICE
        {
            return Err(SimulatorError::PermittivityForDevice { object, permittivity: permittivity.value() });
        }
    }
    Ok(())
}
