//! The curves of a finished run, read from its `capacitance.csv`.
//!
//! The file starts `frame,time_s`, then has one column `C_A_B_F` for every entry of the upper triangle of the Maxwell
//! matrix over the electrodes, in farads, row by row, then `changed_edges,iterations,geometry_ms,update_ms,solve_ms`.
//! Electrode names may contain underscores: the diagonal columns `C_A_A_F` say what they are. At the end there may be `raw_A_B` and
//! `measured_A_B_F`, what the scene's converters read; they are not shown.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Columns before the capacitances.
const BEFORE: [&str; 2] = ["frame", "time_s"];
/// Columns after the capacitances.
const AFTER: [&str; 5] = ["changed_edges", "iterations", "geometry_ms", "update_ms", "solve_ms"];
/// No line of such a file is longer, so that a file of something else does not fill the memory.
const LONGEST_LINE: u64 = 1 << 20;

/// Why a file of curves is refused. Lines and columns are counted from 1.
#[derive(Debug, thiserror::Error)]
pub enum CurvesError {
    /// The file cannot be opened.
    #[error("{}: {source}", file.display())]
    Open {
        /// The file.
        file: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// The file cannot be read on, or is not text.
    #[error("{}, line {line}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Line that could not be read.
        line: usize,
        /// What the operating system says.
        source: io::Error,
    },
    /// A line is longer than any that a run writes.
    #[error("{}, line {line}: longer than {LONGEST_LINE} bytes", file.display())]
    LineTooLong {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
    },
    /// A column of the header has another name than it must have.
    #[error("{}, line 1, column {column}: expected `{expected}`, found {}", file.display(), shown(found))]
    Header {
        /// The file.
        file: PathBuf,
        /// The column.
        column: usize,
        /// The name that it must have.
        expected: String,
        /// The name that it has; `None` where the line ends before it.
        found: Option<String>,
    },
    /// A line has more or fewer values than the header has columns.
    #[error("{}, line {line}, column {column} (`{name}`): the line has {found} values, the header {expected} columns",
        file.display())]
    ValueCount {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// The first column that is missing, or the last of the header where there are too many values.
        column: usize,
        /// Name of that column.
        name: String,
        /// Values in the line.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// A value is not a number, or is infinite.
    #[error("{}, line {line}, column {column} (`{name}`): `{value}` is not a finite number", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// The column.
        column: usize,
        /// Name of that column.
        name: String,
        /// The text found.
        value: String,
    },
    /// There is a header but nothing below it.
    #[error("{}, line 2, column 1 (`frame`): the file has no frames", file.display())]
    NoFrames {
        /// The file.
        file: PathBuf,
    },
}

fn shown(found: &Option<String>) -> String {
    match found {
        Some(name) => format!("`{}`", excerpt(name)),
        None => "the end of the line".to_owned(),
    }
}

/// The start of a text, short enough for a message.
fn excerpt(text: &str) -> String {
    text.chars().take(40).collect()
}

/// One entry of the Maxwell matrix over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Index of the row's electrode in [`Curves::electrodes`].
    pub row: usize,
    /// Index of the column's electrode, not less than `row`.
    pub column: usize,
    /// Short name, such as `E1–E2`.
    pub label: String,
    /// Value at each frame, in farads.
    pub farads: Vec<f64>,
}

/// What one frame cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Edges of the mesh whose weight changed.
    pub changed_edges: f64,
    /// Iterations of the solver.
    pub iterations: f64,
    /// Drawing the depth layers, in milliseconds.
    pub geometry_ms: f64,
    /// Updating the matrix, in milliseconds.
    pub update_ms: f64,
    /// Solving, in milliseconds.
    pub solve_ms: f64,
}

impl FrameCost {
    /// Sum of the three parts, in milliseconds.
    pub fn total_ms(&self) -> f64 {
        self.geometry_ms + self.update_ms + self.solve_ms
    }
}

/// Everything that `capacitance.csv` says. There is at least one frame and one electrode, and every value is finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    electrodes: Vec<String>,
    entries: Vec<Entry>,
    time_s: Vec<f64>,
    costs: Vec<FrameCost>,
}

impl Curves {
    /// Reads a file.
    ///
    /// # Errors
    /// When the file cannot be read or breaks the format; the message names file, line and column.
    pub fn read(file: &Path) -> Result<Self, CurvesError> {
        let open = File::open(file).map_err(|source| CurvesError::Open { file: file.to_owned(), source })?;
        Self::parse(BufReader::new(open), file)
    }

    /// Reads from anything; `file` is only named in messages. An empty line at the end is no frame.
    ///
    /// # Errors
    /// As [`Curves::read`].
    pub fn parse(source: impl BufRead, file: &Path) -> Result<Self, CurvesError> {
        let mut lines = Lines { source, file, line: 0 };
        let header = lines.next()?.unwrap_or_default();
        let names: Vec<&str> = header.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
        let electrodes = electrodes_of(&names, file)?;
        let mut curves = Self {
            entries: pairs(electrodes.len())
                .map(|(row, column)| Entry {
                    row,
                    column,
                    label: format!("{}–{}", electrodes[row], electrodes[column]),
                    farads: Vec::new(),
                })
                .collect(),
            electrodes,
            time_s: Vec::new(),
            costs: Vec::new(),
        };
        let mut row = Vec::with_capacity(names.len());
        while let Some(text) = lines.next()? {
            if text.trim().is_empty() {
                continue;
            }
            parse_row(&text, &names, file, lines.line, &mut row)?;
            let (before, rest) = row.split_at(BEFORE.len());
            let (farads, cost) = rest.split_at(curves.entries.len());
            curves.time_s.push(before[1]);
            for (entry, &value) in curves.entries.iter_mut().zip(farads) {
                entry.farads.push(value);
            }
            curves.costs.push(FrameCost {
                changed_edges: cost[0],
                iterations: cost[1],
                geometry_ms: cost[2],
                update_ms: cost[3],
                solve_ms: cost[4],
            });
        }
        if curves.time_s.is_empty() {
            return Err(CurvesError::NoFrames { file: file.to_owned() });
        }
        Ok(curves)
    }

    /// Names of the electrodes, in the order of the matrix.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// The upper triangle of the matrix, row by row.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Time of each frame in seconds.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// What each frame cost.
    pub fn costs(&self) -> &[FrameCost] {
        &self.costs
    }

    /// The frame time that half of all frames stay below, in milliseconds.
    pub fn median_frame_ms(&self) -> f64 {
        let mut totals: Vec<f64> = self.costs.iter().map(FrameCost::total_ms).collect();
        totals.sort_by(f64::total_cmp);
        totals.get(totals.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Indices of the upper triangle, row by row.
fn pairs(electrodes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..electrodes).flat_map(move |row| (row..electrodes).map(move |column| (row, column)))
}

/// Lines of bounded length, counted.
struct Lines<'a, R> {
    source: R,
    file: &'a Path,
    /// Number of the line read last.
    line: usize,
}

impl<R: BufRead> Lines<'_, R> {
    fn next(&mut self) -> Result<Option<String>, CurvesError> {
        self.line += 1;
        let mut text = String::new();
        let read = io::Read::take(&mut self.source, LONGEST_LINE)
            .read_line(&mut text)
            .map_err(|source| CurvesError::Read { file: self.file.to_owned(), line: self.line, source })?;
        if read as u64 == LONGEST_LINE {
            return Err(CurvesError::LineTooLong { file: self.file.to_owned(), line: self.line });
        }
        Ok((read > 0).then_some(text))
    }
}

/// Checks the whole header and returns the names of the electrodes.
fn electrodes_of(names: &[&str], file: &Path) -> Result<Vec<String>, CurvesError> {
    let expect = |index: usize, expected: &str| {
        let found = names.get(index).copied().filter(|found| !(found.is_empty() && names.len() == 1));
        if found == Some(expected) {
            return Ok(());
        }
        Err(CurvesError::Header {
            file: file.to_owned(),
            column: index + 1,
            expected: expected.to_owned(),
            found: found.map(str::to_owned),
        })
    };
    for (index, name) in BEFORE.iter().enumerate() {
        expect(index, name)?;
    }
    let start = BEFORE.len();
    let columns = names[start..].iter().take_while(|name| name.starts_with("C_")).count();
    let electrodes: Vec<String> =
        names[start..start + columns].iter().filter_map(|name| diagonal(name)).map(str::to_owned).collect();
    if electrodes.is_empty() {
        expect(start, "C_E1_E1_F")?;
    }
    let mut index = start;
    for (row, column) in pairs(electrodes.len()) {
        expect(index, &format!("C_{}_{}_F", electrodes[row], electrodes[column]))?;
        index += 1;
    }
    for name in AFTER {
        expect(index, name)?;
        index += 1;
    }
    let of_converter = |name: &&str| name.starts_with("raw_") || name.starts_with("measured_");
    match names[index..].iter().position(|name| !of_converter(name)).and_then(|at| names.get(index + at)) {
        None => Ok(electrodes),
        Some(found) => Err(CurvesError::Header {
            file: file.to_owned(),
            column: 1 + names.iter().position(|name| name == found).unwrap_or(index),
            expected: "the end of the line".to_owned(),
            found: Some((*found).to_owned()),
        }),
    }
}

/// `A` for `C_A_A_F`.
fn diagonal(name: &str) -> Option<&str> {
    let middle = name.strip_prefix("C_")?.strip_suffix("_F")?;
    let half = middle.len().checked_sub(1)? / 2;
    let (first, rest) = middle.split_at_checked(half)?;
    (!first.is_empty() && rest.strip_prefix('_') == Some(first)).then_some(first)
}

fn parse_row(
    text: &str,
    names: &[&str],
    file: &Path,
    line: usize,
    row: &mut Vec<f64>,
) -> Result<(), CurvesError> {
    row.clear();
    let found = text.split(',').count();
    if found != names.len() {
        let column = (found + 1).min(names.len());
        return Err(CurvesError::ValueCount {
            file: file.to_owned(),
            line,
            column,
            name: names[column - 1].to_owned(),
            found,
            expected: names.len(),
        });
    }
    for (index, value) in text.split(',').map(str::trim).enumerate() {
        match value.parse::<f64>() {
            Ok(number) if number.is_finite() => row.push(number),
            _ => {
                return Err(CurvesError::NotFinite {
                    file: file.to_owned(),
                    line,
                    column: index + 1,
                    name: names[index].to_owned(),
                    value: excerpt(value),
                });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "frame,time_s,C_E1_E1_F,C_E1_E2_F,C_E2_E2_F,\
                          changed_edges,iterations,geometry_ms,update_ms,solve_ms";

    fn parse(text: &str) -> Result<Curves, CurvesError> {
        Curves::parse(text.as_bytes(), Path::new("run/capacitance.csv"))
    }

    fn message(text: &str) -> String {
        parse(text).unwrap_err().to_string()
    }

    #[test]
    fn a_good_file_is_read_whole() {
        let curves = parse(&format!(
            "{HEADER}\n0,0,1e-12,-2e-13,3e-12,120,7,0.5,0.25,1.25\n1,0.01,1.5e-12,-1e-13,3e-12,8,3,0.5,0.25,0.25\n"
        ))
        .unwrap();
        assert_eq!(curves.electrodes(), ["E1", "E2"]);
        assert_eq!(curves.time_s(), [0.0, 0.01]);
        let entries: Vec<_> =
            curves.entries().iter().map(|e| (e.row, e.column, e.label.as_str(), e.farads.clone())).collect();
        assert_eq!(
            entries,
            [
                (0, 0, "E1–E1", vec![1e-12, 1.5e-12]),
                (0, 1, "E1–E2", vec![-2e-13, -1e-13]),
                (1, 1, "E2–E2", vec![3e-12, 3e-12]),
            ]
        );
        let measured = format!(
            "{HEADER},raw_E1_E1,measured_E1_E1_F\n0,0,1e-12,-2e-13,3e-12,120,7,0.5,0.25,1.25,17,1e-12\n"
        );
        assert_eq!(parse(&measured).unwrap().entries()[0].farads, [1e-12]);
        assert!(
            message(&format!("{HEADER},raw_E1_E1,other\n"))
                .contains("column 12: expected `the end of the line`")
        );
        assert_eq!(curves.costs()[0].changed_edges, 120.0);
        assert_eq!(curves.costs()[1].total_ms(), 1.0);
        assert_eq!(curves.median_frame_ms(), 2.0);
    }

    #[test]
    fn line_ends_of_other_systems_and_names_with_underscores_are_read() {
        let header = "\u{feff}frame,time_s,C_a_b_a_b_F,C_a_b_a_F,C_a_a_F,changed_edges,iterations,geometry_ms,update_ms,solve_ms";
        let curves = parse(&format!("{header}\r\n0,0,1,2,3,0,0,0,0,0\r\n\r\n")).unwrap();
        assert_eq!(curves.electrodes(), ["a_b", "a"]);
        assert_eq!(curves.entries()[1].label, "a_b–a");
    }

    #[test]
    fn a_truncated_line_is_named() {
        assert_eq!(
            message(&format!("{HEADER}\n0,0,1,2,3,0,0,0,0,0\n1,0.01,1.5e-12")),
            "run/capacitance.csv, line 3, column 4 (`C_E1_E2_F`): the line has 3 values, the header 10 columns"
        );
        assert_eq!(
            message(&format!("{HEADER}\n0,0,1,2,3,0,0,0,0,0,7\n")),
            "run/capacitance.csv, line 2, column 10 (`solve_ms`): the line has 11 values, the header 10 columns"
        );
    }

    #[test]
    fn what_is_no_finite_number_is_named() {
        for bad in ["NaN", "inf", "", "1.2.3", "1e999"] {
            assert_eq!(
                message(&format!("{HEADER}\n0,0,1,{bad},3,0,0,0,0,0\n")),
                format!(
                    "run/capacitance.csv, line 2, column 4 (`C_E1_E2_F`): `{bad}` is not a finite number"
                )
            );
        }
    }

    #[test]
    fn missing_and_unknown_columns_are_named() {
        let cases = [
            ("", "column 1: expected `frame`, found the end of the line"),
            ("time_s\n", "column 1: expected `frame`, found `time_s`"),
            ("frame\n", "column 2: expected `time_s`, found the end of the line"),
            ("frame,time_s,changed_edges\n", "column 3: expected `C_E1_E1_F`, found `changed_edges`"),
            (
                "frame,time_s,C_E1_E1_F,C_E2_E2_F,changed_edges\n",
                "column 4: expected `C_E1_E2_F`, found `C_E2_E2_F`",
            ),
            (
                "frame,time_s,C_E1_E1_F,changed_edges,iterations,update_ms\n",
                "column 6: expected `geometry_ms`, found `update_ms`",
            ),
            (
                "frame,time_s,C_E1_E1_F,C_E1_E2_F,changed_edges\n",
                "column 4: expected `changed_edges`, found `C_E1_E2_F`",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(message(text), format!("run/capacitance.csv, line 1, {expected}"));
        }
        assert_eq!(
            message(&format!("{HEADER},more\n")),
            "run/capacitance.csv, line 1, column 11: expected `the end of the line`, found `more`"
        );
    }

    #[test]
    fn a_file_without_frames_of_bytes_or_of_one_endless_line_is_refused() {
        assert!(matches!(parse(HEADER), Err(CurvesError::NoFrames { .. })));
        let bytes = Curves::parse(&b"frame,\xff\xfe\n"[..], Path::new("x.csv")).unwrap_err();
        assert!(matches!(bytes, CurvesError::Read { line: 1, .. }));
        let long = "x".repeat(2 << 20);
        assert!(matches!(parse(&long), Err(CurvesError::LineTooLong { line: 1, .. })));
        let missing = Curves::read(Path::new("no/such.csv")).unwrap_err();
        assert!(missing.to_string().starts_with("no/such.csv: "), "{missing}");
    }
}
