//! `capsense compare`: how alike simulated and measured curves are, and what the numbers are worth.

use super::BadInput;
use super::output::print_out;
use super::text::table;
use capsense::curve_table::{Clock, CurveTable};
use capsense::series::{Comparison, Curve, SeriesError};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Compare simulated with measured curves
///
/// Prints for each column Pearson's r, the correlation that the CapSense paper reports (Eq. 12, no means removed, curves scaled
/// to 0 to 1), the lag at which r is best, and below what a constant and a triangle score. Tables are CSV, or
/// separated by semicolons, tabs or blanks, with or without a header and a column of time.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  capsense compare results/capacitance.csv measured.csv\n  capsense compare results/capacitance.csv counts.txt --columns C_E1_E1_F=2,-C_E1_E2_F=5 --rate 30"
)]
pub(super) struct CompareArguments {
    /// The simulated curves, such as capacitance.csv of `capsense run`
    simulated: PathBuf,
    /// The measured curves
    measured: PathBuf,
    /// Columns to compare, each a name that is in both or SIMULATED=MEASURED; without a header the first column is 1.
    /// Left out: all names that are in both, or the only curve of each. A minus before a name turns a curve over: a mutual
    /// capacitance is minus an entry of the Maxwell matrix
    #[arg(long, value_delimiter = ',', value_name = "A,B", allow_hyphen_values = true)]
    columns: Vec<String>,
    /// Samples per second of a table that only counts them
    #[arg(long, value_name = "HZ", conflicts_with = "stretch")]
    rate: Option<f64>,
    /// Let both run from their first to their last sample in the same time
    #[arg(long)]
    stretch: bool,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// What time is counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Axis {
    Seconds,
    Samples,
    /// Parts of the whole, as both run from 0 to 1.
    Whole,
}

impl Axis {
    fn unit(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::Samples => "samples",
            Self::Whole => "of the whole",
        }
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Compared {
    simulated: String,
    measured: String,
    time: Axis,
    columns: Vec<Column>,
}

#[derive(Serialize)]
struct Column {
    simulated: String,
    measured: String,
    samples: usize,
    /// `null` where a curve does not move, as all below.
    pearson: Option<f64>,
    paper_eq12: Option<f64>,
    best_lag: Option<BestLag>,
    constant: Scores,
    triangle: Scores,
}

#[derive(Serialize)]
struct BestLag {
    time: f64,
    pearson: f64,
}

/// What a curve that knows nothing scores.
#[derive(Default, Serialize)]
struct Scores {
    pearson: Option<f64>,
    paper_eq12: Option<f64>,
}

pub(super) fn compare(arguments: &CompareArguments) -> anyhow::Result<()> {
    let simulated = CurveTable::load(&arguments.simulated)?;
    let measured = CurveTable::load(&arguments.measured)?;
    let axis = axis(arguments, &simulated, &measured)?;
    let columns = pairs(arguments, &simulated, &measured)?
        .into_iter()
        .map(|(one, other)| {
            let curve = |table: &CurveTable, name: &str| curve(table, name, axis, arguments.rate);
            let compared = Comparison::new(&curve(&simulated, &one)?, &curve(&measured, &other)?);
            let compared = compared.map_err(|error| {
                let files = format!("{} and {}", simulated.file(), measured.file());
                BadInput(format!("{files}: columns `{one}` and `{other}`: {error}"))
            })?;
            Ok(Column::new(one, other, &compared))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let names = [&simulated, &measured].map(|table| table.file().to_owned());
    let [simulated, measured] = names;
    let compared = Compared { simulated, measured, time: axis, columns };
    if arguments.json {
        print_out(&(serde_json::to_string(&compared)? + "\n"))
    } else {
        print_out(&compared.readable())
    }
}

/// Seconds where both have them, else numbers of samples where both have these.
fn axis(
    arguments: &CompareArguments,
    simulated: &CurveTable,
    measured: &CurveTable,
) -> Result<Axis, BadInput> {
    if arguments.rate.is_some_and(|rate| !(rate.is_finite() && rate > 0.0)) {
        return Err(BadInput("--rate: must be finite and greater than zero".to_owned()));
    }
    let seconds = |table: &CurveTable| table.has_seconds() || arguments.rate.is_some();
    if arguments.stretch {
        Ok(Axis::Whole)
    } else if seconds(simulated) && seconds(measured) {
        Ok(Axis::Seconds)
    } else if simulated.has_counts() && measured.has_counts() {
        Ok(Axis::Samples)
    } else {
        let (timed, counted) =
            if simulated.has_seconds() { (simulated, measured) } else { (measured, simulated) };
        Err(BadInput(format!(
            "{}: counts samples, while {} is in seconds: give --rate HZ or --stretch",
            counted.file(),
            timed.file()
        )))
    }
}

fn curve(table: &CurveTable, name: &str, axis: Axis, rate: Option<f64>) -> anyhow::Result<Curve> {
    let clock = if axis == Axis::Samples { Clock::Counts } else { Clock::Seconds };
    let told = |error: SeriesError| BadInput(format!("{}: column `{name}`: {error}", table.file()));
    let curve = match name.strip_prefix('-').filter(|_| !table.has_column(name)) {
        None => table.curve(name, clock)?,
        Some(name) => {
            let upright = table.curve(name, clock)?;
            let values = upright.values().iter().map(|value| -value).collect();
            Curve::new(upright.times().to_vec(), values).map_err(told)?
        }
    };
    let start = curve.span().0;
    match (axis, rate) {
        (Axis::Whole, _) => Ok(curve.retimed(1.0 / (curve.span().1 - start), 0.0).map_err(told)?),
        (Axis::Seconds, Some(rate)) if !table.has_seconds() => {
            Ok(curve.retimed(1.0 / rate, start / rate).map_err(told)?)
        }
        _ => Ok(curve),
    }
}

/// Which columns belong together.
fn pairs(
    arguments: &CompareArguments,
    simulated: &CurveTable,
    measured: &CurveTable,
) -> Result<Vec<(String, String)>, BadInput> {
    let own = |(one, other): (&str, &str)| (one.to_owned(), other.to_owned());
    if !arguments.columns.is_empty() {
        let pair = |text: &String| own(text.split_once('=').unwrap_or((text, text)));
        return Ok(arguments.columns.iter().map(pair).collect());
    }
    let (ones, others) = (simulated.curve_names(), measured.curve_names());
    let shared: Vec<_> =
        ones.iter().filter(|name| others.contains(name)).map(|name| own((name, name))).collect();
    match (&ones[..], &others[..]) {
        _ if !shared.is_empty() => Ok(shared),
        ([one], [other]) => Ok(vec![own((one, other))]),
        _ => Err(BadInput(format!(
            "{} has the curves {}, {} has {}: say with --columns SIMULATED=MEASURED which belong together",
            simulated.file(),
            listed(&ones),
            measured.file(),
            listed(&others)
        ))),
    }
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "(none)".to_owned() } else { names.join(", ") }
}

impl Column {
    fn new(simulated: String, measured: String, compared: &Comparison) -> Self {
        let baselines = compared.baselines;
        Self {
            simulated,
            measured,
            samples: compared.samples,
            pearson: compared.pearson,
            paper_eq12: compared.paper,
            best_lag: compared.lag.map(|lag| BestLag { time: lag.time, pearson: lag.pearson }),
            constant: Scores { pearson: None, paper_eq12: baselines.map(|known| known.constant_paper) },
            triangle: Scores {
                pearson: baselines.and_then(|known| known.triangle_pearson),
                paper_eq12: baselines.map(|known| known.triangle_paper),
            },
        }
    }

    fn rows(&self) -> [Vec<String>; 3] {
        let name = if self.simulated == self.measured {
            self.simulated.clone()
        } else {
            format!("{} = {}", self.simulated, self.measured)
        };
        let number = |r: Option<f64>| r.map_or("-".to_owned(), |r| format!("{r:.4}"));
        let lag = self.best_lag.as_ref();
        let time = lag.map_or("-".to_owned(), |lag| format!("{:+.4}", lag.time));
        let best = number(lag.map(|lag| lag.pearson));
        let known = [number(self.pearson), number(self.paper_eq12), time, best, self.samples.to_string()];
        let nothing = |name: &str, scores: &Scores| {
            vec![format!("  {name}"), number(scores.pearson), number(scores.paper_eq12)]
        };
        [
            std::iter::once(name).chain(known).collect(),
            nothing("a constant", &self.constant),
            nothing("a triangle", &self.triangle),
        ]
    }
}

impl Compared {
    fn readable(&self) -> String {
        let unit = self.time.unit();
        let header = ["", "Pearson's r", "Eq. 12", &format!("best lag [{unit}]"), "r there", "samples"];
        let mut rows = vec![header.map(str::to_owned).to_vec()];
        rows.extend(self.columns.iter().flat_map(Column::rows));
        let mut text = format!("{} against {}\n\n{}", self.simulated, self.measured, table(&rows));
        text += "\nA positive lag: the measurement runs behind. Eq. 12 removes no means, so what knows nothing scores highly, too:\n\
                 r above that of a triangle is what a simulation has found.\n";
        text
    }
}
