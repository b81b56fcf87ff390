//! How near an iteration is to what memory allows: bytes that it moves, by count, over the bandwidth of one core in as much memory as it goes
//! through, beside the time that it takes.
//!
//! Solves go on to a tolerance of 2e-6, so that most take several iterations; the slope of their times over their iterations is what one
//! takes, and what is left at none is the first look at a frame, which all solves have: half a cycle, and on plain tetrahedra rows that changed are
//! relaxed and coarse levels follow. One thread, the bar of the other benches
//! towards the sensor. `CAPSENSE_BENCH_LARGE=1` adds meshes of 1 and 3 million tetrahedra.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::material::{Connection, Material};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;
use common::{Motion, design, is_test, mesh_sizes, on_lattice, solver_options};
use std::hint::black_box;
use std::time::Instant;

/// Most frames then take several iterations, and potentials on lattices are in single precision still.
const TOLERANCE: f64 = 2e-6;

/// Three electrodes and a grounded bar.
const COLUMNS: f64 = 3.0;

/// Bytes of a number in single and in double precision and of an index.
const SINGLE: f64 = 4.0;
const DOUBLE: f64 = 8.0;
const INDEX: f64 = 4.0;

/// Frames of which solves are timed, after as many that are not.
const FRAMES: usize = 100;

/// Measured for so long at least, in seconds.
const TRIADS: f64 = 0.2;

/// Bytes of memory that an iteration goes through, and those that it moves, as it goes through some of it several times.
#[derive(Clone, Copy)]
struct Bytes {
    kept: f64,
    moved: f64,
}

/// On the finest level of a lattice, in single precision: down, the network, four numbers at each node, and r; up, the network, r and z; for
/// zᵀKz and zᵀKp the network, leaks, z and p; for the step the network, leaks and z, and p, x, the last change and its charges read
/// and written, and r written. Coarser levels together have about as many nodes, and go down and up.
fn bytes_on_lattice(sensor: &Sensor) -> Bytes {
    let nodes = sensor.mesh().nodes().len() as f64;
    let (network, vector) = (4.0 * SINGLE, COLUMNS * SINGLE);
    let down = network + vector;
    let up = network + 2.0 * vector;
    let products = network + SINGLE + 2.0 * vector;
    let step = network + SINGLE + (1.0 + 4.0 * 2.0 + 1.0) * vector;
    let coarser = down + up + vector;
    Bytes {
        kept: nodes * (network + SINGLE + 6.0 * vector + network + 2.0 * vector),
        moved: nodes * (down + up + products + step + coarser),
    }
}

/// On plain tetrahedra, columns four side by side. Down, each entry of a row with its column once, K x in double precision, z written;
/// up, the same with z read and written; for zᵀKz and zᵀKp half of the entries, z and p; for the step all weights in double precision,
/// z, and p, x, the last change and its charges read and written, and K x written. The second level has a tenth of the rows, twelve
/// entries in each, and is gone through three times, twice, with two vectors.
fn bytes_on_tetrahedra(simulator: &Simulator) -> Bytes {
    let matrix = simulator.matrix().to_csr();
    let (rows, entries) = (matrix.nrows() as f64, (matrix.nnz() - matrix.nrows()) as f64);
    let (single, double, entry) = (4.0 * SINGLE, 4.0 * DOUBLE, SINGLE + INDEX);
    let down = entries * entry + rows * (double + single + SINGLE + INDEX);
    let up = entries * entry + rows * (double + 2.0 * single + SINGLE + INDEX);
    let products = 0.5 * entries * entry + rows * (SINGLE + 2.0 * single);
    let step = entries * (DOUBLE + INDEX) + rows * (3.0 * single + (2.0 + 1.0 + 4.0) * double + DOUBLE);
    let second = 0.1 * rows * 2.0 * 3.0 * (12.0 * entry + 2.0 * single);
    let of_second = 0.1 * rows * (12.0 * entry + 4.0 * single);
    Bytes {
        kept: entries * (entry + DOUBLE) + rows * (2.0 * single + 4.0 * double + DOUBLE) + of_second,
        moved: down + up + products + step + second,
    }
}

/// Bytes a second of one core in so much memory: a = b + s c. That a is read before it is written, where caches do that, is not counted.
fn bandwidth(bytes: f64) -> f64 {
    let count = (bytes / (3.0 * SINGLE)) as usize;
    let [mut a, b, c] = [0.0, 1.0, 2.0].map(|value: f32| vec![value; count]);
    let mut moved = 0.0;
    let start = Instant::now();
    while start.elapsed().as_secs_f64() < TRIADS {
        for ((a, b), c) in a.iter_mut().zip(&b).zip(&c) {
            *a = b + 0.5 * c;
        }
        black_box(&mut a);
        moved += bytes;
    }
    moved / start.elapsed().as_secs_f64()
}

/// What a solve takes without an iteration, and what each adds, in seconds: the straight line through the times of many.
fn seconds(simulator: &mut Simulator) -> [f64; 2] {
    let [_, mut motion] = Motion::all();
    let frames = if is_test() { 10 } else { FRAMES };
    let mut solves = Vec::new();
    for frame in 0..2 * frames {
        simulator.update(motion.next()).unwrap();
        let start = Instant::now();
        let iterations = simulator.solve().unwrap().iterations as f64;
        if frame >= frames {
            solves.push([iterations, start.elapsed().as_secs_f64()]);
        }
    }
    let n = solves.len() as f64;
    let [x, y] = [0, 1].map(|of| solves.iter().map(|solve| solve[of]).sum::<f64>() / n);
    let [xx, xy] =
        [0, 1].map(|of| solves.iter().map(|solve| (solve[0] - x) * (solve[of] - [x, y][of])).sum::<f64>());
    let slope = xy / xx;
    [y - slope * x, slope]
}

fn main() {
    println!("{}, one thread, {COLUMNS} columns", capsense_core::instruction_set());
    println!("operator     tets   MB kept   MB moved   GB/s   ms at that   ms an iteration   ms without one");
    let options = SolverOptions { tolerance: TOLERANCE, ..solver_options(Some(1)) };
    for (name, is_lattice) in [("lattice", true), ("csr", false)] {
        for size in mesh_sizes() {
            let sensor = on_lattice(&design().lattice(size).unwrap());
            let sensor = if is_lattice { sensor } else { sensor.off_lattice() };
            let bar = Material::Conductor(Connection::Grounded);
            let mut simulator = Simulator::new(sensor, vec![bar], options).unwrap();
            let bytes = match is_lattice {
                true => bytes_on_lattice(simulator.sensor()),
                false => bytes_on_tetrahedra(&simulator),
            };
            let (speed, [without, iteration]) = (bandwidth(bytes.kept), seconds(&mut simulator));
            println!(
                "{name:<8} {:>8} {:>9.1} {:>10.1} {:>6.1} {:>12.3} {:>17.3} {:>16.3}",
                simulator.sensor().mesh().tets().len(),
                1e-6 * bytes.kept,
                1e-6 * bytes.moved,
                1e-9 * speed,
                1e3 * bytes.moved / speed,
                1e3 * iteration,
                1e3 * without,
            );
        }
    }
}
