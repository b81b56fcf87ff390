//! Time of a frame over the number of tetrahedra, as in the paper's Fig. 8: the simulator on lattices and on plain tetrahedra,
//! the paper's method on the same lattices, and the times that the paper tells.
//!
//! Writes `timing.csv`, whose columns are those of `chart.csv`, and `timing.svg` to `target/criterion`, or to the folder after
//! `--out`; about 2 minutes. With `--test` the smallest meshes are run for a few frames, and nothing is written.

#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../src/quiet_graphics.rs"]
mod quiet_graphics;

use capsense::evidence::measure::measure;
use capsense::evidence::reference::{BUILT_IN, Provenance, Reference, ReferenceMethod};
use capsense::evidence::stage::{SEGMENTS, Stage};
use capsense::evidence::table::{Row, to_csv};
use capsense::evidence::timing;
use std::path::PathBuf;

/// The folder after `--out`; relative ones are in the package, where cargo runs benches.
fn out() -> PathBuf {
    let mut arguments = std::env::args().skip_while(|argument| argument != "--out").skip(1);
    arguments.next().map_or_else(|| PathBuf::from("target/criterion"), PathBuf::from)
}

fn main() {
    quiet_graphics::keep_the_graphics_stack_quiet();
    let is_test = std::env::args().any(|argument| argument == "--test");
    let stage = Stage::new(&SEGMENTS).unwrap();
    let wanted = Provenance::of(&stage, ReferenceMethod::STANDARD);
    let reference =
        Reference::read(BUILT_IN, &stage, &wanted).unwrap().expect("the reference is of this program");
    let settings = if is_test { timing::smallest() } else { timing::settings() };
    println!("method   storage      tets  frames   10%     50%     90%  [ms]  error of ΔC [%]");
    let rows: Vec<Row> = settings
        .iter()
        .map(|setting| {
            let row = measure(&stage, setting, &reference, &|| false).unwrap().unwrap();
            let [low, median, high, error] =
                [row.p10_ms, row.median_ms, row.p90_ms, row.rms_error_percent].map(|value| value.unwrap());
            println!(
                "{:<8} {:<7} {:>9} {:>7} {low:>7.3} {median:>7.3} {high:>7.3} {error:>12.2}",
                row.method,
                row.storage,
                row.tets.unwrap(),
                row.frames
            );
            row
        })
        .collect();
    let drawing = timing::draw(&rows).unwrap();
    if !is_test {
        let out = out();
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join("timing.csv"), to_csv(&rows).unwrap()).unwrap();
        std::fs::write(out.join("timing.svg"), drawing).unwrap();
        println!("Written to {}: timing.csv, timing.svg", out.display());
    }
}
