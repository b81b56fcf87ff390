//! `chart.csv`: one row for each setting measured.

use super::setting::Setting;
use serde::{Deserialize, Serialize};

/// One setting and what it is worth. Settings are as in [`Setting`]; columns without a value are empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Version of the program.
    pub version: String,
    /// What computed the frames.
    pub method: String,
    /// The kind of mesh.
    pub mesh: String,
    /// Tetrahedra or relative error of ΔC that were asked for.
    pub asked: f64,
    /// How K is stored.
    pub storage: String,
    /// What surfaces do to the mesh.
    pub interface: String,
    /// Where surfaces come from.
    pub geometry: String,
    /// What conjugate gradients are preconditioned with.
    pub preconditioner: String,
    /// When the iteration stops: the relative error of C, and for the paper's method the relative residual.
    pub tolerance: f64,
    /// Threads of the solver.
    pub threads: usize,
    /// Tetrahedra of the mesh.
    pub tets: Option<usize>,
    /// Frames that were timed; those to which the bar jumped are not among them.
    pub frames: usize,
    /// What times are of: `thread`, the processor time of the thread that computes alone; `wall`, of several threads, or where the
    /// system does not tell.
    pub clock: String,
    /// Time of a frame, from the bar's pose to C, in milliseconds: median.
    pub median_ms: Option<f64>,
    /// Its 10th percentile.
    pub p10_ms: Option<f64>,
    /// Its 90th percentile.
    pub p90_ms: Option<f64>,
    /// Its mean.
    pub mean_ms: Option<f64>,
    /// The median of wall-clock time, which is longer where other programs take the core.
    pub wall_median_ms: Option<f64>,
    /// Poses in which ΔC was compared.
    pub poses: usize,
    /// Error of ΔC in percent of √(ΔC_ii ΔC_jj): root mean square over entries and poses.
    pub rms_error_percent: Option<f64>,
    /// That of the worst entry.
    pub max_error_percent: Option<f64>,
    /// By how much the reference itself may be off in the same poses, as [`Row::rms_error_percent`].
    pub reference_rms_percent: Option<f64>,
    /// As [`Row::max_error_percent`].
    pub reference_max_percent: Option<f64>,
    /// Whether no other row is both faster and more exact.
    pub on_front: bool,
    /// Why there are no results.
    pub failure: Option<String>,
}

/// The version that rows are of.
const VERSION: &str = env!("CARGO_PKG_VERSION");

impl Row {
    /// A row without results.
    pub fn of(setting: &Setting) -> Self {
        let (mesh, asked) = setting.mesh.name();
        Self {
            version: VERSION.to_owned(),
            method: setting.method_name().to_owned(),
            mesh: mesh.to_owned(),
            asked,
            storage: setting.storage.name().to_owned(),
            interface: setting.interface.name().to_owned(),
            geometry: setting.geometry.name().to_owned(),
            preconditioner: setting.preconditioner.name().to_owned(),
            tolerance: setting.tolerance,
            threads: setting.threads,
            ..Self::default()
        }
    }

    /// Whether it is of this setting and this version of the program.
    pub fn is_of(&self, setting: &Setting) -> bool {
        let model = Self::of(setting);
        self.asked == model.asked && self.agrees_with(&model)
    }

    /// The same, whatever the size of the mesh.
    pub fn is_like(&self, setting: &Setting) -> bool {
        self.agrees_with(&Self::of(setting))
    }

    fn agrees_with(&self, model: &Self) -> bool {
        let words = |row: &Self| {
            [
                &row.version,
                &row.method,
                &row.mesh,
                &row.storage,
                &row.interface,
                &row.geometry,
                &row.preconditioner,
            ]
            .map(String::clone)
        };
        words(self) == words(model) && self.tolerance == model.tolerance && self.threads == model.threads
    }

    /// Median time in milliseconds and error in percent, where both are known.
    pub fn point(&self) -> Option<(f64, f64)> {
        let point = self.median_ms.zip(self.rms_error_percent)?;
        (point.0 > 0.0 && point.1 > 0.0).then_some(point)
    }
}

/// The table as CSV.
///
/// # Errors
/// None that can happen.
pub fn to_csv(rows: &[Row]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row)?;
    }
    Ok(writer.into_inner().map_err(|error| error.into_error())?)
}

/// Reads what [`to_csv`] wrote.
///
/// # Errors
/// When it is no such table.
pub fn from_csv(text: &[u8]) -> Result<Vec<Row>, csv::Error> {
    csv::Reader::from_reader(text).deserialize().collect()
}
