//! What capacitances are compared with: changes of C by the bar, converged on lattices made for each of its poses.
//!
//! Lattice planes lie in the bar's lower and upper face, and in its sides where it is straight; where it is turned, spacing around it
//! is small. Spacings are halved twice, and the three changes extrapolated with the order that they show. By how much the last lattice is off
//! the limit is the error bar. Computed once: it takes minutes.

use super::EvidenceError;
use super::published::{SPECTRAL, SPECTRAL_ENTRIES};
use super::stage::Stage;
use capsense_core::estimate::halved_lattice;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::mesh::{Lattice, graded_axis};
use capsense_core::sensor::{Sensor, SensorDesign};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::SolverOptions;
use capsense_core::workspace::{Change, ChangeError};
use serde::{Deserialize, Serialize};

/// The order of convergence that is assumed where lattices do not tell: that of the field's singularity at a right edge of a
/// conductor.
const EDGE_ORDER: f64 = 4.0 / 3.0;

/// The program whose references can be trusted to be this program's.
const PROGRAM: &str = concat!("capsense ", env!("CARGO_PKG_VERSION"));

/// The reference that comes with the program.
pub const BUILT_IN: &str = include_str!("../../assets/references/steel_bar.json");

/// How lattices are made and how exactly they are solved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceMethod {
    /// Spacing of the coarsest lattice at electrodes and at faces of the bar that lie in lattice planes, metres.
    pub finest_spacing_m: f64,
    /// Its spacing where sides of the bar cut it, metres.
    pub spacing_around_bar_m: f64,
    /// By which factor spacing grows from cell to cell.
    pub growth: f64,
    /// How often spacings are halved; at least once.
    pub halvings: u32,
    /// The relative error of C that is left to the solver.
    pub solver_tolerance: f64,
}

impl ReferenceMethod {
    /// Three lattices for each pose, the finest of about six million tetrahedra.
    pub const STANDARD: Self = Self {
        finest_spacing_m: 0.008,
        spacing_around_bar_m: 0.014,
        growth: 1.3,
        halvings: 2,
        solver_tolerance: 1e-8,
    };
}

/// Where a reference is from. One of another origin is not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name and version of the program.
    pub program: String,
    /// Domain and electrodes.
    pub sensor: String,
    /// The bar.
    pub bar: String,
    /// How lattices are made.
    pub method: ReferenceMethod,
}

impl Provenance {
    /// That of what this program would compute.
    pub fn of(stage: &Stage, method: ReferenceMethod) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            sensor: format!("{:?}", stage.design),
            bar: format!("{:?}, {:?}", stage.shape(), stage.material()),
            method,
        }
    }
}

/// What the bar changes of C in one pose: upper triangle row by row, in farads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceValue {
    /// The bar's centre and its turn about the sensor's axis: metres, radians.
    pub place: [f64; 4],
    /// Tetrahedra of the finest lattice.
    pub tets: usize,
    /// The extrapolated change.
    pub change_farads: Vec<f64>,
    /// By how much it may be off: the finest lattice's distance from it.
    pub error_farads: Vec<f64>,
}

/// Changes of C in all poses of a stage that are compared, and after them in those that others have published.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Where it is from.
    pub provenance: Provenance,
    /// As far as they have been computed.
    pub values: Vec<ReferenceValue>,
}

/// Why a reference that was kept cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// It is not what this program writes.
    #[error("{0}; delete the file to have it computed again")]
    Format(#[from] serde_json::Error),
    /// Values that are none.
    #[error("values[{0}] is no change of C with an error bar; delete the file to have it computed again")]
    Value(usize),
}

impl Reference {
    /// One without values.
    pub fn begin(stage: &Stage, method: ReferenceMethod) -> Self {
        Self { provenance: Provenance::of(stage, method), values: Vec::new() }
    }

    /// Takes over what was kept as JSON, if its origin is the one wanted and the poses are those of the stage.
    ///
    /// # Errors
    /// When it is broken.
    pub fn read(text: &str, stage: &Stage, wanted: &Provenance) -> Result<Option<Self>, ReferenceError> {
        let kept: Self = serde_json::from_str(text)?;
        let entries = entries_of(stage);
        if let Some(bad) = kept.values.iter().position(|value| !value.is_valid(entries)) {
            return Err(ReferenceError::Value(bad));
        }
        let places: Vec<[f64; 4]> = poses(stage).iter().map(place_of).collect();
        let of_stage = places.len() >= kept.values.len()
            && kept.values.iter().zip(&places).all(|(value, place)| is_same_place(&value.place, place));
        Ok((kept.provenance == *wanted && of_stage).then_some(kept))
    }

    /// As it is kept.
    ///
    /// # Errors
    /// None that can happen.
    pub fn to_json(&self) -> Result<String, ReferenceError> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// How many poses there will be.
    pub fn wanted(stage: &Stage) -> usize {
        poses(stage).len()
    }

    /// Computes the next pose of the stage that is missing; false where none is.
    ///
    /// # Errors
    /// When a lattice cannot be made or solved.
    pub fn add_next(&mut self, stage: &Stage) -> Result<bool, EvidenceError> {
        let Some(pose) = poses(stage).get(self.values.len()).copied() else { return Ok(false) };
        self.values.push(converged(stage, &pose, &self.provenance.method)?);
        Ok(true)
    }

    /// By how much a change in a compared pose is off, and by how much the reference itself may be.
    ///
    /// # Errors
    /// When that pose has no reference.
    pub fn error(&self, pose: usize, change: &Change) -> Result<[ChangeError; 2], EvidenceError> {
        let missing = || EvidenceError::NoReference(pose);
        let value = self.values.get(pose).ok_or_else(missing)?;
        let size = electrodes_of(value.change_farads.len());
        let change_of = |farads: Vec<f64>| Change::from_farads(size, farads).ok_or_else(missing);
        let reference = change_of(value.change_farads.clone())?;
        let shifted = value.change_farads.iter().zip(&value.error_farads).map(|(value, bar)| value + bar);
        let bar = change_of(shifted.collect())?;
        let error = |change: &Change| change.error(&reference).ok_or_else(missing);
        Ok([error(change)?, error(&bar)?])
    }

    /// Beside what others have published, for each such pose and entry: published and own change in farads.
    pub fn beside_published(&self, stage: &Stage) -> Vec<[f64; 2]> {
        let first = stage.compared().len();
        let own = self.values.iter().skip(first).zip(&SPECTRAL);
        own.flat_map(|(value, published)| {
            let entries = SPECTRAL_ENTRIES.iter().zip(published.farads);
            entries.map(|(entry, farads)| [farads, value.change_farads[*entry]]).collect::<Vec<_>>()
        })
        .collect()
    }
}

impl ReferenceValue {
    fn is_valid(&self, entries: usize) -> bool {
        let all = [&self.change_farads, &self.error_farads];
        all.iter().all(|farads| farads.len() == entries && farads.iter().all(|value| value.is_finite()))
            && self.error_farads.iter().all(|bar| *bar >= 0.0)
    }
}

/// Entries of the upper triangle.
fn entries_of(stage: &Stage) -> usize {
    let electrodes = stage.design.electrodes.len();
    electrodes * (electrodes + 1) / 2
}

/// The number of electrodes whose upper triangle has so many entries.
fn electrodes_of(entries: usize) -> usize {
    (0..).find(|n| n * (n + 1) / 2 >= entries).unwrap_or(0)
}

fn poses(stage: &Stage) -> Vec<Pose> {
    stage.compared().into_iter().chain(stage.published()).collect()
}

fn place_of(pose: &Pose) -> [f64; 4] {
    let [x, y, z] = pose.translation.to_array();
    [x, y, z, 2.0 * pose.rotation.z.atan2(pose.rotation.w)]
}

/// But for what is lost where a number is written and read.
fn is_same_place(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
}

fn converged(stage: &Stage, pose: &Pose, method: &ReferenceMethod) -> Result<ReferenceValue, EvidenceError> {
    let mut lattice = fitted(&stage.design, stage.shape(), pose, method)?;
    let mut changes = vec![change_on(stage, &lattice, pose, method)?];
    for _ in 0..method.halvings {
        lattice = halved_lattice(&lattice)?;
        changes.push(change_on(stage, &lattice, pose, method)?);
    }
    let limits = (0..entries_of(stage)).map(|entry| {
        let on_lattices: Vec<f64> = changes.iter().map(|change| change.farads()[entry]).collect();
        extrapolated(&on_lattices)
    });
    let (change_farads, error_farads) = limits.unzip();
    Ok(ReferenceValue { place: place_of(pose), tets: lattice.tet_count(), change_farads, error_farads })
}

fn change_on(
    stage: &Stage,
    lattice: &Lattice,
    pose: &Pose,
    method: &ReferenceMethod,
) -> Result<Change, EvidenceError> {
    let options = SolverOptions { tolerance: method.solver_tolerance, ..SolverOptions::default() };
    let sensor = Sensor::on_lattice(&stage.design, lattice)?;
    let mut simulator = Simulator::new(sensor, vec![stage.material()], options)?;
    let mut solids = Solids::new(std::slice::from_ref(stage.shape()))?;
    solids.place(&[*pose])?;
    let _ = simulator.step(&solids)?;
    Ok(Change::between(simulator.base(), simulator.capacitance()))
}

/// The coarsest lattice for one pose.
fn fitted(
    design: &SensorDesign,
    shape: &Shape,
    pose: &Pose,
    method: &ReferenceMethod,
) -> Result<Lattice, EvidenceError> {
    let bar = bounds(shape, pose)?;
    let is_straight = pose.rotation == DQuat::IDENTITY;
    let mut axes = [const { Vec::new() }; 3];
    for (axis, coordinates) in axes.iter_mut().enumerate() {
        let planes = design.electrodes.iter().flat_map(|electrode| match axis {
            2 => vec![electrode.z],
            _ => electrode.outline.axis_planes(axis),
        });
        let mut planes: Vec<f64> = planes.collect();
        let faces = [bar.min[axis], bar.max[axis]];
        let follows = is_straight || axis == 2;
        if follows {
            planes.extend(faces);
        }
        let (low, high) = (design.domain.min[axis], design.domain.max[axis]);
        *coordinates = graded_axis(low, high, &planes, &[], method.finest_spacing_m, method.growth);
        if !follows {
            *coordinates = refined(coordinates, faces, method);
        }
    }
    Ok(Lattice::new(axes)?)
}

/// The box around the bar.
fn bounds(shape: &Shape, pose: &Pose) -> Result<Aabb, EvidenceError> {
    let Shape::Box { size } = shape else { return Err(EvidenceError::Stage) };
    let sides = [-0.5, 0.5];
    let corners = sides.map(|x| sides.map(|y| sides.map(|z| DVec3::new(x, y, z) * *size)));
    Ok(Aabb::around(corners.into_iter().flatten().flatten().map(|corner| pose.sensor_from_object(corner))))
}

/// Splits the intervals of an axis that are too long near the bar.
fn refined(axis: &[f64], [low, high]: [f64; 2], method: &ReferenceMethod) -> Vec<f64> {
    let mut finer = axis[..1].to_vec();
    for pair in axis.windows(2) {
        let (start, length) = (pair[0], pair[1] - pair[0]);
        let middle = start + 0.5 * length;
        let distance = (low - middle).max(middle - high).max(0.0);
        let wanted = method.spacing_around_bar_m + (method.growth - 1.0) * distance;
        let count = (length / wanted).ceil().max(1.0);
        finer.extend((1..=count as usize).map(|part| start + length * part as f64 / count));
    }
    finer
}

/// The limit of values on lattices that halve their spacing, and by how much the last is off it; there are at least two.
fn extrapolated(values: &[f64]) -> (f64, f64) {
    let last = values.len() - 1;
    let step = |level: usize| values[level] - values[level - 1];
    let order = match last {
        1 => EDGE_ORDER,
        _ => observed_order(step(last - 1) / step(last)),
    };
    let left = step(last) / (order.exp2() - 1.0);
    (values[last] + left, left.abs())
}

/// From the ratio of two steps; between one and two, where theory has it.
fn observed_order(ratio: f64) -> f64 {
    if ratio > 0.0 { ratio.log2().clamp(1.0, 2.0) } else { EDGE_ORDER }
}
