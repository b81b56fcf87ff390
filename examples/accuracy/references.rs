//! The reference values, `references.csv`, which says where they are from and how exact.

use crate::cases::{ENTRIES, Entries};
use anyhow::{Context, Result, bail};
use serde::Deserialize;

/// What stands for a body and its connection in the rows of the empty scene.
const NONE: &str = "none";

#[derive(Deserialize)]
struct Row {
    body: String,
    connection: String,
    entry: String,
    #[serde(rename = "value_fF")]
    value: f64,
    from: String,
}

/// What results are compared with.
pub(crate) struct References {
    rows: Vec<Row>,
}

impl References {
    /// Reads the table.
    pub(crate) fn load() -> Result<Self> {
        Self::parse(include_str!("references.csv"))
    }

    fn parse(text: &str) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        let rows: Vec<Row> = reader.deserialize().collect::<Result<_, _>>().context("references.csv")?;
        if let Some(row) = rows.iter().find(|row| !row.value.is_finite() || row.value == 0.0) {
            bail!("references.csv: {} of {} has no value to compare with", row.entry, row.body);
        }
        Ok(Self { rows })
    }

    /// C of the empty scene.
    pub(crate) fn empty(&self) -> Result<Entries> {
        self.change(NONE, NONE)
    }

    /// The change of C by a body.
    pub(crate) fn change(&self, body: &str, connection: &str) -> Result<Entries> {
        let mut entries = Entries::default();
        for (value, (entry, ..)) in entries.iter_mut().zip(ENTRIES) {
            *value = self.row(body, connection, entry)?.value;
        }
        Ok(entries)
    }

    /// Where the change of C by a body is from.
    pub(crate) fn origin(&self, body: &str, connection: &str) -> Result<&str> {
        Ok(&self.row(body, connection, ENTRIES[0].0)?.from)
    }

    fn row(&self, body: &str, connection: &str, entry: &str) -> Result<&Row> {
        let wanted = |row: &&Row| row.body == body && row.connection == connection && row.entry == entry;
        let row = self.rows.iter().find(wanted);
        row.with_context(|| format!("references.csv has no {entry} of a {connection} {body}"))
    }
}
