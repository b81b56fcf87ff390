//! Tables of curves: `capacitance.csv`, what `capsense export` writes, and other people's files, with or without a header
//! and a column for time. Separators are commas, semicolons, tabs or blanks; lines that begin with `#` are comments.
//!
//! Columns are read when they are asked for, so that text in one is no fault of another.

use crate::series::Curve;
use std::cmp::Reverse;
use std::path::{Path, PathBuf};

/// Columns of time, in lower case, and how many seconds one unit is.
const SECONDS: [(&str, f64); 12] = [
    ("time_s", 1.0),
    ("time", 1.0),
    ("t", 1.0),
    ("t_s", 1.0),
    ("seconds", 1.0),
    ("time (s)", 1.0),
    ("time [s]", 1.0),
    ("time_ms", 1e-3),
    ("t_ms", 1e-3),
    ("time (ms)", 1e-3),
    ("time [ms]", 1e-3),
    ("time_us", 1e-6),
];

/// Columns that count samples.
const COUNTS: [&str; 4] = ["sample", "frame", "index", "row"];

/// Columns of our own tables that are no measurements.
const BOOKKEEPING: [&str; 9] = [
    "changed_edges",
    "iterations",
    "geometry_ms",
    "update_ms",
    "solve_ms",
    "device_time_s",
    "sequence",
    "status",
    "flags",
];

/// Cells of samples that are missing, in lower case.
const MISSING: [&str; 4] = ["", "nan", "na", "null"];

/// Why a table cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum CurveTableError {
    /// The file itself cannot be read.
    #[error("{}: cannot read the table: {error}", path.display())]
    Read {
        /// Path of the table.
        path: PathBuf,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{file}:{line}: {}{message}", column.as_ref().map(|name| format!("column `{name}`: ")).unwrap_or_default())]
    Invalid {
        /// The file as the user named it.
        file: String,
        /// Line in it, counted from one.
        line: usize,
        /// Name of the column.
        column: Option<String>,
        /// What is wrong.
        message: String,
    },
    /// There is no such column.
    #[error("{file}: has no column `{name}`; there are {}", columns.join(", "))]
    NoColumn {
        /// The file as the user named it.
        file: String,
        /// What was asked for.
        name: String,
        /// What there is.
        columns: Vec<String>,
    },
}

/// What a curve runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// A column of times, in seconds.
    Seconds,
    /// A column that counts samples or, without one, the number of the row, from zero.
    Counts,
}

/// A table of text cells.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveTable {
    file: String,
    names: Vec<String>,
    /// Lines of rows, counted from one, and their cells, as many as there are names.
    rows: Vec<(usize, Vec<String>)>,
    /// Column of time and how many seconds its unit is.
    seconds: Option<(usize, f64)>,
    counts: Option<usize>,
}

impl CurveTable {
    /// Reads a file.
    ///
    /// # Errors
    /// When it cannot be read, is no text, has no row of numbers, or rows of different lengths.
    pub fn load(path: &Path) -> Result<Self, CurveTableError> {
        let bytes =
            std::fs::read(path).map_err(|error| CurveTableError::Read { path: path.to_owned(), error })?;
        Self::parse(&path.display().to_string(), &bytes)
    }

    /// Takes a table from its bytes; `file` is what messages call it.
    ///
    /// # Errors
    /// As [`CurveTable::load`].
    pub fn parse(file: &str, bytes: &[u8]) -> Result<Self, CurveTableError> {
        let invalid = |line, message: String| CurveTableError::Invalid {
            file: file.to_owned(),
            line,
            column: None,
            message,
        };
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
            invalid(line, "is not UTF-8 text".to_owned())
        })?;
        let mut lines = text
            .trim_start_matches('\u{feff}')
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line))
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
            .peekable();
        let Some(&(_, first)) = lines.peek() else { return Err(invalid(1, "is empty".to_owned())) };
        let separator = [',', ';', '\t']
            .into_iter()
            .filter(|separator| first.contains(*separator))
            .min_by_key(|separator| Reverse(cells(first, Some(*separator)).len()));
        let cells = cells(first, separator);
        let named = cells.iter().any(|cell| cell.parse::<f64>().is_err() && !is_missing(cell));
        let names = if named {
            lines.next();
            cells
        } else {
            (1..=cells.len()).map(|number| number.to_string()).collect()
        };
        let mut table = Self { file: file.to_owned(), names, rows: Vec::new(), seconds: None, counts: None };
        for (line, text) in lines {
            let mut cells = self::cells(text, separator);
            let columns = table.names.len();
            if cells.len() == columns + 1 && cells[columns].is_empty() {
                cells.truncate(columns);
            }
            if cells.len() != columns {
                let message = format!("has {} cells, the first line has {columns}", cells.len());
                return Err(invalid(line, message));
            }
            table.rows.push((line, cells));
        }
        if named {
            table.find_clocks().map_err(|message| invalid(1, message))?;
        }
        Ok(table)
    }

    fn find_clocks(&mut self) -> Result<(), String> {
        for (index, name) in self.names.iter().enumerate() {
            if self.names[..index].contains(name) {
                return Err(format!("has two columns `{name}`"));
            }
            let name = name.to_lowercase();
            if let Some((_, unit)) = SECONDS.iter().find(|(known, _)| *known == name) {
                self.seconds = self.seconds.or(Some((index, *unit)));
            }
            if COUNTS.contains(&name.as_str()) {
                self.counts = self.counts.or(Some(index));
            }
        }
        Ok(())
    }

    /// The file as the user named it.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Whether there is a column of this name.
    pub fn has_column(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    /// Whether there is a column of times in seconds.
    pub fn has_seconds(&self) -> bool {
        self.seconds.is_some()
    }

    /// Whether samples are counted: by a column, or for want of any other time.
    pub fn has_counts(&self) -> bool {
        self.counts.is_some() || self.seconds.is_none()
    }

    /// Names of the columns that hold curves: neither time nor what our own tables note besides, and not empty or text.
    pub fn curve_names(&self) -> Vec<&str> {
        let is_curve = |(index, name): &(usize, &String)| {
            let clock =
                self.seconds.is_some_and(|(seconds, _)| seconds == *index) || self.counts == Some(*index);
            let number = |(_, cells): &(usize, Vec<String>)| cells[*index].parse::<f64>().is_ok();
            !clock && !BOOKKEEPING.contains(&name.as_str()) && self.rows.iter().any(number)
        };
        self.names.iter().enumerate().filter(is_curve).map(|(_, name)| name.as_str()).collect()
    }

    /// One column over time. Without a header, columns are called `1`, `2` and so on. Rows in which the value is missing
    /// are left out.
    ///
    /// # Errors
    /// When there is no such column, a cell is neither a finite number nor missing, time does not increase, or fewer than two
    /// samples are left.
    pub fn curve(&self, name: &str, clock: Clock) -> Result<Curve, CurveTableError> {
        let Some(column) = self.names.iter().position(|known| known == name) else {
            let columns = self.curve_names().into_iter().map(str::to_owned).collect();
            return Err(CurveTableError::NoColumn {
                file: self.file.clone(),
                name: name.to_owned(),
                columns,
            });
        };
        let (mut times, mut values, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (line, cells)) in self.rows.iter().enumerate() {
            if is_missing(&cells[column]) {
                continue;
            }
            let time = match (clock, self.seconds, self.counts) {
                (Clock::Seconds, Some((seconds, unit)), _) => unit * self.number(*line, cells, seconds)?,
                (_, _, Some(counts)) => self.number(*line, cells, counts)?,
                _ => index as f64,
            };
            if times.last().is_some_and(|before| *before >= time) {
                let of_time = self.seconds.filter(|_| clock == Clock::Seconds).map(|(seconds, _)| seconds);
                let column = of_time.or(self.counts).unwrap_or(column);
                return Err(self.invalid(
                    *line,
                    column,
                    format!("{} is not later than the row before", cells[column]),
                ));
            }
            times.push(time);
            values.push(self.number(*line, cells, column)?);
            lines.push(*line);
        }
        let end = self.rows.last().map_or(1, |(line, _)| *line);
        Curve::new(times, values).map_err(|error| self.invalid(end, column, error.to_string()))
    }

    fn number(&self, line: usize, cells: &[String], column: usize) -> Result<f64, CurveTableError> {
        match cells[column].parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(number) => Err(self.invalid(line, column, format!("must be finite, not {number}"))),
            Err(_) => Err(self.invalid(line, column, format!("`{}` is not a number", cells[column]))),
        }
    }

    fn invalid(&self, line: usize, column: usize, message: String) -> CurveTableError {
        let column = Some(self.names[column].clone());
        CurveTableError::Invalid { file: self.file.clone(), line, column, message }
    }
}

fn is_missing(cell: &str) -> bool {
    MISSING.contains(&cell.to_lowercase().as_str())
}

/// The cells of a line, without blanks and quotes around them; separators within quotes do not count.
fn cells(line: &str, separator: Option<char>) -> Vec<String> {
    let Some(separator) = separator else {
        return line.split_whitespace().map(str::to_owned).collect();
    };
    let mut quoted = false;
    let parts = line.split(|letter| {
        quoted ^= letter == '"';
        letter == separator && !quoted
    });
    parts.map(|cell| cell.trim().trim_matches('"').trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> CurveTable {
        CurveTable::parse("table", text.as_bytes()).unwrap()
    }

    fn complaint(text: &str, column: &str) -> String {
        match CurveTable::parse("m.csv", text.as_bytes()) {
            Err(error) => error.to_string(),
            Ok(table) => table.curve(column, Clock::Seconds).unwrap_err().to_string(),
        }
    }

    #[test]
    fn our_own_tables_are_read() {
        let text = "frame,time_s,C_E1_E1_F,changed_edges,iterations\n0,0,1e-12,3,1\n1,0.1,2e-12,3,1\n";
        let table = table(text);
        assert_eq!(table.curve_names(), ["C_E1_E1_F"]);
        let curve = table.curve("C_E1_E1_F", Clock::Seconds).unwrap();
        assert_eq!((curve.times(), curve.values()), (&[0.0, 0.1][..], &[1e-12, 2e-12][..]));
        assert_eq!(table.curve("C_E1_E1_F", Clock::Counts).unwrap().times(), [0.0, 1.0]);
        assert!(table.has_seconds() && table.has_counts());
    }

    #[test]
    fn separators_headers_and_comments_are_what_they_are() {
        for text in [
            "# a remark\ntime_ms;\"a;b\";c\n\n0;1;5\n100;2;6\n200;4;8\n",
            "\u{feff}time_ms\ta;b\tc\n0\t1\t5\n100\t2\t6\r\n200\t4\t8\t\n",
        ] {
            let curve = table(text).curve("a;b", Clock::Seconds).unwrap();
            assert_eq!((curve.times(), curve.values()), (&[0.0, 0.1, 0.2][..], &[1.0, 2.0, 4.0][..]));
        }
        let bare = table("668 657 \n 665\t655\n");
        assert_eq!(bare.curve_names(), ["1", "2"]);
        assert_eq!(bare.curve("2", Clock::Seconds).unwrap().times(), [0.0, 1.0], "for want of seconds");
        assert!(!bare.has_seconds() && bare.has_counts());
    }

    #[test]
    fn missing_samples_are_left_out_and_text_columns_do_not_disturb() {
        let table = table("t,a,flags\n0,1,low word\n1,,\n2,NaN,\n3,5,x\n");
        assert_eq!(table.curve_names(), ["a"]);
        let curve = table.curve("a", Clock::Seconds).unwrap();
        assert_eq!((curve.times(), curve.values()), (&[0.0, 3.0][..], &[1.0, 5.0][..]));
    }

    #[test]
    fn complaints_name_file_line_and_column() {
        for (text, column, message) in [
            ("", "a", "m.csv:1: is empty"),
            ("t,a\n0,1\n1,2,3\n", "a", "m.csv:3: has 3 cells, the first line has 2"),
            ("t,a\n0,1\n1,inf\n", "a", "m.csv:3: column `a`: must be finite, not inf"),
            ("t,a\n0,1\n1,ERROR\n", "a", "m.csv:3: column `a`: `ERROR` is not a number"),
            ("t,a\n0,1\nx,2\n", "a", "m.csv:3: column `t`: `x` is not a number"),
            ("t,a\n0,1\n\n0,2\n", "a", "m.csv:4: column `t`: 0 is not later than the row before"),
            ("t,a\n0,1\n", "a", "m.csv:2: column `a`: 1 samples are no curve; at least 2 are needed"),
            ("t,a,b\n0,1,2\n1,2,3\n", "c", "m.csv: has no column `c`; there are a, b"),
            ("t,a,a\n0,1,2\n", "a", "m.csv:1: has two columns `a`"),
        ] {
            assert_eq!(complaint(text, column), message, "{text:?}");
        }
        let error = CurveTable::parse("m.csv", b"t,a\n0,\xff\n").unwrap_err();
        assert_eq!(error.to_string(), "m.csv:2: is not UTF-8 text");
    }
}
