//! What single frames of the steel-bar scene take, update and solve: most need no step of an iteration and some need several,
//! which a mean, as the bench `frame` tells it, does not show.
//!
//! Prints the 10th, 50th and 90th percentile and the mean in milliseconds, of whole ways of the bar there and back, C to 1e-4: of
//! one thread, of all, and then how many times as fast all are. Ways of one thread and of all alternate, so that both have the same
//! hour of a machine. Bars are seen by a depth camera, those of rows named `-solid` are exact solids; those of rows named `-80` are
//! dielectrics of that permittivity. Rows named `lattice` are of graded lattices, `csr` of the same meshes as
//! plain tetrahedra, and `bisected` of tetrahedra that were bisected, whose edges have no order and of which each node has twice as
//! many. What two threads gain depends on how far apart their cores are, so it is told before each size how long a word takes from one to the other. Which instructions run is told first.
//! `CAPSENSE_BENCH_LARGE=1` adds meshes of more than 300,000 tetrahedra; arguments are names of rows to be measured alone.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::sensor::{MeshKind, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use common::{BAR, Motion, design, is_large, is_test, on_lattice, on_tetrahedra, solver_options};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

const GROUNDED: Material = Material::Conductor(Connection::Grounded);

/// Numbers of tetrahedra on lattices and of plain tetrahedra, up to the first that only large runs measure.
const LATTICES: [usize; 6] = [25_000, 30_000, 200_000, 300_000, 1_500_000, 3_000_000];
const MESHES: [usize; 4] = [30_000, 300_000, 1_000_000, 3_000_000];
const LARGEST_OF_ALL_RUNS: usize = 300_000;

/// Ways there and back that count; one before does not.
const WAYS: usize = 2;

/// How sensors are made that have no more than so many tetrahedra.
type Build = fn(usize) -> Sensor;

/// Words from one thread to another and back.
const WORDS: u32 = 100_000;

/// What is measured.
#[derive(Clone, Copy)]
struct Row {
    name: &'static str,
    build: Build,
    material: Material,
    is_exact: bool,
}

/// A simulator and where its bar is.
struct Run {
    simulator: Simulator,
    motion: Motion,
    solids: Solids,
    /// Milliseconds of each frame that counts.
    took: Vec<f64>,
}

impl Run {
    fn new(sensor: &Sensor, row: Row, motion: Motion, threads: Option<usize>) -> Self {
        let simulator = Simulator::new(sensor.clone(), vec![row.material], solver_options(threads)).unwrap();
        Self { simulator, motion, solids: Solids::new(&[BAR]).unwrap(), took: Vec::new() }
    }

    /// One way there and back.
    fn go(&mut self, is_exact: bool, counts: bool) {
        for _ in 0..self.motion.len() {
            let depth = self.motion.next();
            let start = Instant::now();
            let _ = if is_exact {
                self.solids.place(&[self.motion.pose()]).unwrap();
                self.simulator.step(&self.solids).unwrap()
            } else {
                self.simulator.step(depth).unwrap()
            };
            if counts {
                self.took.push(1e3 * start.elapsed().as_secs_f64());
            }
        }
    }

    /// The 10th, 50th and 90th percentile and the mean.
    fn summary(&mut self) -> [f64; 4] {
        self.took.sort_unstable_by(f64::total_cmp);
        let at = |part: f64| self.took[(part * (self.took.len() - 1) as f64).round() as usize];
        [at(0.1), at(0.5), at(0.9), self.took.iter().sum::<f64>() / self.took.len() as f64]
    }
}

/// Nanoseconds that a word takes from one thread to another.
fn nanoseconds_between_threads() -> f64 {
    let word = AtomicU32::new(0);
    let pass_on = |mine: u32| {
        for round in 0..WORDS {
            while word.load(Ordering::Acquire) != 2 * round + mine {
                std::hint::spin_loop();
            }
            word.store(2 * round + mine + 1, Ordering::Release);
        }
    };
    let start = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(|| pass_on(1));
        pass_on(0);
    });
    1e9 * start.elapsed().as_secs_f64() / f64::from(2 * WORDS)
}

fn lattice(size: usize) -> Sensor {
    on_lattice(&design().lattice(size).unwrap())
}

fn tetrahedra(size: usize) -> Sensor {
    on_tetrahedra(&design().lattice(size).unwrap())
}

fn bisected(size: usize) -> Sensor {
    Sensor::generated(&design(), MeshKind::Bisection, size).unwrap()
}

fn measure(row: Row, size: usize, wanted: &[String]) {
    let Row { name, build, is_exact, .. } = row;
    if !wanted.is_empty() && !wanted.iter().any(|wanted| wanted == name) {
        return;
    }
    println!("a word between threads: {:.0} ns", nanoseconds_between_threads());
    let sensor = build(size);
    let tets = sensor.mesh().tets().len();
    for (one, all) in Motion::all().into_iter().zip(Motion::all()) {
        let motion = one.name;
        let mut runs = [Run::new(&sensor, row, one, Some(1)), Run::new(&sensor, row, all, None)];
        for way in 0..=if is_test() { 1 } else { WAYS } {
            for run in &mut runs {
                run.go(is_exact, way > 0);
            }
        }
        let [one, all] = runs.each_mut().map(Run::summary);
        let times_as_fast: [f64; 4] = std::array::from_fn(|column| one[column] / all[column]);
        for (threads, columns) in [("1", one), ("all", all), ("1 / all", times_as_fast)] {
            print!("{name:<16} {tets:>8} {threads:>7} {motion:<9}");
            columns.iter().for_each(|column| print!(" {column:>7.3}"));
            println!();
        }
    }
}

fn main() {
    let wanted: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let largest = match (is_test(), is_large()) {
        (true, _) => LATTICES[0],
        (false, true) => usize::MAX,
        (false, false) => LARGEST_OF_ALL_RUNS,
    };
    let glass = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
    println!("{}", capsense_core::instruction_set());
    println!("method               tets threads motion        10%     50%     90%    mean");
    let rows = |sizes: &[usize], build: Build, [seen, exact, glassy, exact_and_glassy]: [&'static str; 4]| {
        for &size in sizes.iter().filter(|size| **size <= largest) {
            let row = Row { name: seen, build, material: GROUNDED, is_exact: false };
            measure(row, size, &wanted);
            measure(Row { name: exact, is_exact: true, ..row }, size, &wanted);
            measure(Row { name: glassy, material: glass, ..row }, size, &wanted);
            measure(Row { name: exact_and_glassy, material: glass, is_exact: true, ..row }, size, &wanted);
        }
    };
    rows(&LATTICES, lattice, ["lattice", "lattice-solid", "lattice-80", "lattice-solid-80"]);
    rows(&MESHES, tetrahedra, ["csr", "csr-solid", "csr-80", "csr-solid-80"]);
    rows(&MESHES, bisected, ["bisected", "bisected-solid", "bisected-80", "bisected-solid-80"]);
}
