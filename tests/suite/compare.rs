//! `capsense compare` as a user runs it.

use crate::common::{SCENE, capsense};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// A bump that passes at a time, on a slope.
fn bump(time: f64, at: f64) -> f64 {
    (-((time - at) / 0.15).powi(2)).exp() + 0.05 * time
}

fn write(folder: &Path, name: &str, header: &str, rows: impl Iterator<Item = String>) {
    let mut text = header.to_owned();
    for row in rows {
        writeln!(text, "{row}").unwrap();
    }
    std::fs::write(folder.join(name), text).unwrap();
}

/// One second in both: the measurement is sampled at 50 per second, in counts, and 60 ms late.
fn write_tables(folder: &Path) {
    write(
        folder,
        "simulated.csv",
        "frame,time_s,C_E1_E1_F,C_E1_E2_F,changed_edges\n",
        (0..=200).map(|k| {
            let time = f64::from(k) * 0.005;
            format!("{k},{time},{:e},{:e},7", 3e-12 + 2e-14 * bump(time, 0.4), -1e-13 * time)
        }),
    );
    let count = |k: i32| 650.0 + 30.0 * bump(f64::from(k) * 0.02, 0.46);
    write(folder, "counts.txt", "", (0..=50).map(|k| format!("{}\t{}", 51 - k, count(k))));
    write(folder, "timed.csv", "time_ms;C_E1_E1_F\n", (0..=50).map(|k| format!("{};{}", 20 * k, count(k))));
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let outcome = capsense(folder, &[&["compare"], arguments, &["--json"]].concat());
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    serde_json::from_str(&outcome.stdout).unwrap()
}

#[test]
fn curves_are_compared_at_the_same_time_and_at_the_best_lag() {
    let folder = tempfile::tempdir().unwrap();
    write_tables(folder.path());
    for arguments in [
        &["simulated.csv", "timed.csv"][..],
        &["simulated.csv", "counts.txt", "--columns", "C_E1_E1_F=2", "--rate", "50"],
    ] {
        let compared = json(folder.path(), arguments);
        assert_eq!(compared["time"], "seconds");
        assert_eq!(compared["columns"].as_array().unwrap().len(), 1, "{compared}");
        let column = &compared["columns"][0];
        assert_eq!(column["samples"], 51, "as coarse as the measurement");
        let number = |pointer: &str| column.pointer(pointer).unwrap().as_f64().unwrap();
        assert!((number("/best_lag/time") - 0.06).abs() < 1e-9, "{column}");
        assert!(number("/best_lag/pearson") > 0.999, "{column}");
        let r = number("/pearson");
        assert!(0.8 < r && r < 0.95, "{column}");
        assert!(number("/paper_eq12") > r, "means are not removed: {column}");
        assert!(number("/constant/paper_eq12") > 0.5, "{column}");
        assert!(number("/triangle/pearson") < r, "{column}");
        assert!(column["constant"]["pearson"].is_null());
    }
}

#[test]
fn tables_without_seconds_are_compared_by_count_or_stretched() {
    let folder = tempfile::tempdir().unwrap();
    write_tables(folder.path());
    let column = ["simulated.csv", "counts.txt", "--columns", "C_E1_E2_F=1"];
    let counted = json(folder.path(), &column);
    assert_eq!(counted["time"], "samples");
    assert_eq!(counted["columns"][0]["samples"], 51, "frames 0 to 50");
    let turned = json(folder.path(), &["simulated.csv", "counts.txt", "--columns", "-C_E1_E2_F=-1"]);
    assert_eq!(turned["columns"][0]["pearson"], counted["columns"][0]["pearson"], "both turned over");
    let turned = json(folder.path(), &["simulated.csv", "counts.txt", "--columns", "-C_E1_E2_F=1"]);
    let [one, other] = [&turned, &counted].map(|all| all["columns"][0]["pearson"].as_f64().unwrap());
    assert!((one + other).abs() < 1e-12 && other > 0.9, "{one} {other}");
    let stretched = json(folder.path(), &[&column[..], &["--stretch"]].concat());
    assert_eq!(stretched["time"], "whole");
    // Both fall evenly, over all of their samples.
    assert!((stretched["columns"][0]["pearson"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{stretched}");
}

#[test]
fn a_run_agrees_with_itself() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    assert_eq!(capsense(folder.path(), &["run", "scene.toml", "--out", "out"]).code, Some(0));
    let table = "out/capacitance.csv";
    let outcome = capsense(folder.path(), &["compare", table, table]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    for text in ["Pearson's r", "Eq. 12", "best lag [s]", "C_E1_E2_F", "a constant", "a triangle"] {
        assert!(outcome.stdout.contains(text), "{text} is missing:\n{}", outcome.stdout);
    }
    let compared = json(folder.path(), &[table, table]);
    let columns = compared["columns"].as_array().unwrap();
    assert_eq!(columns.len(), 3);
    for column in columns {
        assert!((column["pearson"].as_f64().unwrap() - 1.0).abs() < 1e-12, "{column}");
        assert_eq!(column["best_lag"]["time"], 0.0);
    }
}

#[test]
fn what_cannot_be_compared_is_bad_input_with_file_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    write_tables(folder.path());
    std::fs::write(folder.path().join("bad.csv"), "time_s,C_E1_E1_F\n0,1\n0.1,2\n0.2,high\n").unwrap();
    std::fs::write(folder.path().join("late.csv"), "time_s,C_E1_E1_F\n10,1\n11,2\n").unwrap();
    std::fs::write(folder.path().join("seconds.csv"), "time_s,a\n0,1\n1,2\n").unwrap();
    for (arguments, message) in [
        (&["simulated.csv", "none.csv"][..], "none.csv"),
        (&["simulated.csv", "bad.csv"], "bad.csv:4: column `C_E1_E1_F`: `high` is not a number"),
        (&["simulated.csv", "late.csv"], "too little in common"),
        (&["simulated.csv", "counts.txt"], "--columns"),
        (
            &["simulated.csv", "timed.csv", "--columns", "C_E9_E9_F"],
            "simulated.csv: has no column `C_E9_E9_F`",
        ),
        (&["seconds.csv", "counts.txt", "--columns", "a=1"], "--rate HZ or --stretch"),
        (&["simulated.csv", "timed.csv", "--rate", "0"], "--rate"),
    ] {
        let outcome = capsense(folder.path(), &[&["compare"], arguments].concat());
        assert_eq!(outcome.code, Some(2), "{arguments:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(message), "{arguments:?}: {}", outcome.stderr);
    }
}

#[test]
fn a_curve_that_does_not_move_has_no_correlation() {
    let folder = tempfile::tempdir().unwrap();
    write_tables(folder.path());
    std::fs::write(folder.path().join("still.csv"), "time_s,C_E1_E1_F\n0,5\n0.5,5\n1,5\n").unwrap();
    let compared = json(folder.path(), &["simulated.csv", "still.csv"]);
    let column = &compared["columns"][0];
    for key in ["pearson", "paper_eq12", "best_lag"] {
        assert!(column[key].is_null(), "{column}");
    }
}
