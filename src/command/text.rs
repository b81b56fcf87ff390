//! Numbers and tables for people to read.

use std::cmp::Ordering;

/// A decimal multiple of the farad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prefix {
    /// What stands before it, such as `fF`.
    pub(super) symbol: &'static str,
    /// How many farads one is.
    pub(super) farads: f64,
}

impl Prefix {
    /// The multiple in which a magnitude has one to three digits before the point; attofarads for anything smaller.
    pub(super) fn for_magnitude(farads: f64) -> Self {
        let all = [("µF", 1e-6), ("nF", 1e-9), ("pF", 1e-12), ("fF", 1e-15)];
        let fits = all.into_iter().find(|(_, unit)| farads >= *unit);
        let (symbol, farads) = fits.unwrap_or(("aF", 1e-18));
        Self { symbol, farads }
    }

    /// A capacitance in this multiple.
    pub(super) fn of(self, farads: f64) -> f64 {
        farads / self.farads
    }
}

/// Columns padded to their widest cell: the first to the left, all others to the right.
pub(super) fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns)
        .map(|column| {
            rows.iter().filter_map(|row| row.get(column)).map(|c| c.chars().count()).max().unwrap_or(0)
        })
        .collect();
    let mut text = String::new();
    for row in rows {
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let padding = " ".repeat(width - cell.chars().count());
            let gap = if column == 0 { "" } else { "  " };
            text += &if column == 0 { format!("{cell}{padding}") } else { format!("{gap}{padding}{cell}") };
        }
        text.truncate(text.trim_end_matches(' ').len());
        text.push('\n');
    }
    text
}

/// Fraction `part` of the way up the sorted values (nearest rank); zero when there are none.
pub(super) fn percentile<T: Copy + Default + PartialOrd>(values: &[T], part: f64) -> T {
    let mut sorted = values.to_vec();
    sorted.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    let rank = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_keep_digits_before_the_point() {
        for (farads, symbol) in
            [(4.2e-12, "pF"), (0.9e-12, "fF"), (1e-15, "fF"), (3e-16, "aF"), (0.0, "aF"), (2e-5, "µF")]
        {
            assert_eq!(Prefix::for_magnitude(farads).symbol, symbol, "{farads}");
        }
    }

    #[test]
    fn percentiles_are_values_of_the_list() {
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(percentile(&values, 0.5), 3.0);
        assert_eq!(percentile(&values, 0.95), 5.0);
        assert_eq!(percentile(&values, 1.0), 5.0);
        assert_eq!(percentile(&[2, 1, 4, 3], 0.5), 2);
        assert_eq!(percentile::<f64>(&[], 0.5), 0.0);
    }

    #[test]
    fn tables_line_up() {
        let rows = [["", "b"], ["aaa", "µ1"], ["a", "100"]].map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(table(&rows), "       b\naaa   µ1\na    100\n");
    }
}
