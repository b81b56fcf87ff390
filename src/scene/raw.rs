//! The scene file as it is written: names and types only, nothing checked. Unknown keys are errors.

use serde::Deserialize;
use serde::de::{Deserializer, Error};
use std::collections::BTreeMap;
use std::ops::Deref;

/// Exactly `N` numbers. Serde's own arrays are filled from the front of longer lists without a word.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tuple<T, const N: usize>([T; N]);

impl<T, const N: usize> Deref for Tuple<T, N> {
    type Target = [T; N];

    fn deref(&self) -> &[T; N] {
        &self.0
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Tuple<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::<T>::deserialize(deserializer)?;
        let expected = format!("an array of length {N}");
        list.try_into()
            .map(Self)
            .map_err(|list: Vec<T>| Error::invalid_length(list.len(), &expected.as_str()))
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    #[serde(default)]
    pub(super) domain: RawDomain,
    #[serde(default)]
    pub(super) mesh: RawMesh,
    #[serde(default)]
    pub(super) sensor: RawSensor,
    #[serde(default)]
    pub(super) camera: RawCamera,
    #[serde(default)]
    pub(super) object: Vec<RawObject>,
    #[serde(default)]
    pub(super) simulation: RawSimulation,
    #[serde(default)]
    pub(super) solver: RawSolver,
    pub(super) measurement: Option<RawMeasurement>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDomain {
    pub(super) min: Option<Tuple<f64, 3>>,
    pub(super) max: Option<Tuple<f64, 3>>,
    #[serde(default)]
    pub(super) wall: RawWall,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawWall {
    #[default]
    Grounded,
    Open,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMesh {
    pub(super) generate: Option<RawGenerate>,
    pub(super) file: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) groups: Option<BTreeMap<String, RawGroup>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGenerate {
    pub(super) elements: Option<i64>,
    pub(super) tolerance: Option<f64>,
    pub(super) kind: Option<MeshKind>,
    pub(super) probes: Option<Vec<Tuple<f64, 3>>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum MeshKind {
    Lattice,
    Bisection,
}

/// A physical group of a mesh file, by name or by number.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum RawGroup {
    Number(i64),
    Name(String),
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSensor {
    pub(super) substrate: Option<RawSubstrate>,
    #[serde(default)]
    pub(super) electrode: Vec<RawElectrode>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSubstrate {
    pub(super) thickness: f64,
    pub(super) relative_permittivity: f64,
    pub(super) size: Tuple<f64, 2>,
    #[serde(default)]
    pub(super) back: RawBack,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawBack {
    #[default]
    Open,
    Grounded,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawElectrode {
    pub(super) name: String,
    pub(super) rectangle: Option<RawRectangle>,
    pub(super) disk: Option<RawDisk>,
    pub(super) polygon: Option<Vec<Tuple<f64, 2>>>,
    pub(super) stl: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) z: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRectangle {
    pub(super) center: Tuple<f64, 2>,
    pub(super) size: Tuple<f64, 2>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDisk {
    pub(super) center: Tuple<f64, 2>,
    pub(super) radius: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCamera {
    pub(super) pixels: Option<Tuple<i64, 2>>,
    pub(super) layers: Option<i64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObject {
    pub(super) name: String,
    #[serde(rename = "box")]
    pub(super) cuboid: Option<RawBox>,
    pub(super) sphere: Option<RawSphere>,
    pub(super) capsule: Option<RawRod>,
    pub(super) cylinder: Option<RawRod>,
    pub(super) file: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) material: RawMaterial,
    pub(super) position: Option<Tuple<f64, 3>>,
    pub(super) rotation: Option<Tuple<f64, 4>>,
    pub(super) trajectory: Option<RawTrajectory>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBox {
    pub(super) size: Tuple<f64, 3>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSphere {
    pub(super) radius: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRod {
    pub(super) radius: f64,
    pub(super) length: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMaterial {
    pub(super) conductor: Option<RawConnection>,
    pub(super) relative_permittivity: Option<f64>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawConnection {
    Grounded,
    Floating,
    Capacitance(f64),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTrajectory {
    pub(super) file: Option<String>,
    pub(super) waypoints: Option<Vec<Tuple<f64, 3>>>,
    pub(super) speed: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSimulation {
    pub(super) frame_rate: Option<f64>,
    pub(super) frames: Option<i64>,
    pub(super) geometry: Option<RawGeometry>,
    pub(super) interface: Option<RawInterface>,
    pub(super) back_fill: Option<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawGeometry {
    Camera,
    Solids,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawInterface {
    EdgeCut,
    Centroid,
    VolumeFraction,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSolver {
    pub(super) tolerance: Option<f64>,
    pub(super) change_tolerance: Option<f64>,
    pub(super) preconditioner: Option<RawPreconditioner>,
    pub(super) threads: Option<i64>,
    pub(super) device: Option<RawDevice>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawDevice {
    Cpu,
    Gpu,
    Auto,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawPreconditioner {
    Multigrid,
    Ic0,
    Jacobi,
    None,
    Direct,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMeasurement {
    pub(super) seed: Option<i64>,
    pub(super) channels: Option<Vec<Tuple<String, 2>>>,
    pub(super) dead: Option<Vec<Tuple<String, 2>>>,
    pub(super) seconds_per_channel: Option<f64>,
    pub(super) gain: Option<RawEach>,
    pub(super) gain_spread: Option<RawEach>,
    pub(super) offset: Option<RawEach>,
    pub(super) offset_spread: Option<RawEach>,
    pub(super) white_noise: Option<RawEach>,
    pub(super) drift: Option<RawEach>,
    pub(super) delay: Option<RawEach>,
    pub(super) jitter: Option<RawEach>,
    pub(super) crosstalk: Option<RawCrosstalk>,
    pub(super) mains: Option<RawMains>,
    pub(super) temperature: Option<RawInfluence>,
    pub(super) humidity: Option<RawInfluence>,
    pub(super) offset_dac: Option<RawOffsetDac>,
    pub(super) converter: Option<RawConverter>,
    pub(super) calibration_scans: Option<i64>,
}

/// A number for all channels, or one for each.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number, or a list with one for each channel")]
pub(super) enum RawEach {
    All(f64),
    One(Vec<f64>),
}

/// What neighbours see of each other, or what each channel (row) sees of each (column).
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number, or a list of lists of numbers")]
pub(super) enum RawCrosstalk {
    Neighbours(f64),
    Matrix(Vec<Vec<f64>>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMains {
    pub(super) amplitude: f64,
    pub(super) frequency: f64,
    #[serde(default)]
    pub(super) integration: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawInfluence {
    pub(super) change: f64,
    #[serde(default)]
    pub(super) seconds: f64,
    #[serde(default)]
    pub(super) gain: f64,
    #[serde(default)]
    pub(super) offset: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOffsetDac {
    pub(super) step: f64,
    pub(super) largest: i64,
    pub(super) setting: Option<RawEach>,
    #[serde(default)]
    pub(super) spread: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawConverter {
    pub(super) step: f64,
    pub(super) bits: i64,
    #[serde(default)]
    pub(super) zero: f64,
}
