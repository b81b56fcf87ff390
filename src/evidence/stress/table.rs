//! The map as a table: one row for each field that can be judged.

use super::cell::{Cell, Outcome, Status};
use super::{Map, Method, Stress};
use std::collections::HashMap;

const HEADER: [&str; 12] = [
    "stress",
    "level",
    "interface",
    "solver",
    "precision",
    "status",
    "iterations",
    "tolerance",
    "solver_error",
    "model_error",
    "error_bar",
    "message",
];

/// A table that is not one of these.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// No comma separated values, or other columns.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A word that is no status.
    #[error("`{0}` is no status")]
    Status(String),
}

/// A field that is worse than it was.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Worse {
    /// Stress, level, interface and solver.
    pub field: [String; 4],
    /// What it was.
    pub was: Status,
    /// What it is.
    pub is: Status,
}

impl Map {
    /// The table. Errors are rounded to two digits, so that the same method writes the same bytes everywhere.
    ///
    /// # Errors
    /// When it cannot be put together, for which nothing but a lack of memory would be a reason.
    pub fn to_csv(&self) -> Result<Vec<u8>, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(HEADER)?;
        for cell in &self.cells {
            if let Some(status) = cell.status() {
                writer.write_record(record(cell, status))?;
            }
        }
        Ok(writer.into_inner().map_err(|error| error.into_error())?)
    }

    /// The fields that are worse than in a table written earlier, and those that it has and this map has not.
    ///
    /// # Errors
    /// When the table is none.
    pub fn worse_than(&self, table: &[u8]) -> Result<Vec<Worse>, TableError> {
        let now: HashMap<[String; 4], Status> =
            self.cells.iter().filter_map(|cell| Some((field(cell), cell.status()?))).collect();
        let mut worse = Vec::new();
        for record in csv::Reader::from_reader(table).records() {
            let record = record?;
            let word = |index: usize| record.get(index).unwrap_or_default().to_owned();
            let field = [0, 1, 2, 3].map(word);
            let was = Status::ALL.into_iter().find(|status| status.name() == word(5));
            let was = was.ok_or_else(|| TableError::Status(word(5)))?;
            let is = now.get(&field).copied().unwrap_or(Status::Wrong);
            if is.rank() > was.rank() {
                worse.push(Worse { field, was, is });
            }
        }
        Ok(worse)
    }
}

fn column(stress: Stress) -> [String; 2] {
    [stress.family().to_owned(), stress.to_string()]
}

fn field(cell: &Cell) -> [String; 4] {
    let Method { .. } = cell.method;
    let [family, level] = column(cell.stress);
    [family, level, cell.method.interface_name().to_owned(), cell.method.solver_name().to_owned()]
}

fn record(cell: &Cell, status: Status) -> Vec<String> {
    let mut record = field(cell).to_vec();
    record.extend([cell.method.precision().to_owned(), status.name().to_owned()]);
    let digits = |value: f64| format!("{value:.1e}");
    let maybe = |value: Option<f64>| value.map_or(String::new(), digits);
    match &cell.outcome {
        Outcome::Measured(m) => record.extend([
            m.iterations.to_string(),
            format!("{:e}", m.tolerance),
            digits(m.solver_error),
            maybe(m.model_error),
            maybe(m.error_bar),
            String::new(),
        ]),
        Outcome::Refused(message) => {
            record.extend([const { String::new() }; 5]);
            record.push(message.clone());
        }
        Outcome::NotOffered => {}
    }
    record
}
