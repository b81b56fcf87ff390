//! One frame of the steel-bar scene in its parts, beside the methods that it is compared with, on the same meshes.
//!
//! Benches are named part/method/motion/elements, for a filter such as `step/.*/sideways/30000`. Parts: `update` (depth
//! image to stiffness matrix and preconditioner), `solve` (to the capacitance matrix), `step` (both). Methods:
//! - `lattice`, `csr`: the simulator on the lattice, and on the same mesh as plain tetrahedra; C to 1e-4, one thread;
//!   `lattice-all` and `csr-all` on all threads; `lattice-80` and `csr-80` with a dielectric of that relative permittivity for a bar;
//! - `lattice-32`, `csr-32`, `direct-32`: 32 electrodes in rows, on meshes that are small enough for the Green's function of
//!   the empty scene; `lattice-32-block` and so on with a body of 40 mm x 40 mm x 20 mm for a bar;
//! - `ic0`: the same matrix, IC(0) conjugate gradients to a relative residual of 1e-6, and `ic0-coarse` to 1e-3;
//! - `paper-80`, `paper-1e5`: the paper's method to a relative residual of 1e-5, the bar of that relative permittivity.
//!   Its camera's red channel of 8 bits holds the first; the second stands for steel.
//!
//! Throughput is in tetrahedra. Which vector instructions run is told first. `CAPSENSE_BENCH_LARGE=1` adds meshes of 1 and 3 million.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::baseline::{CgOptions, Ic0Method, PaperMethod, STEEL};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};
use common::{BAR, BLOCK, Motion, array, design, mesh_sizes, on_lattice, on_tetrahedra, solver_options};
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use std::time::{Duration, Instant};

const GROUNDED: Material = Material::Conductor(Connection::Grounded);

/// Number of elements above which a method is not measured. Beyond these a frame of the first two takes seconds; that
/// of the last is not converged after 20,000 iterations.
const LARGEST_OF_IC0: usize = 1_000_000;
const LARGEST_OF_PAPER: usize = 300_000;
const LARGEST_OF_PAPER_WITH_STEEL: usize = 30_000;

/// Sizes of meshes under many electrodes.
const MESHES_OF_ARRAY: [usize; 2] = [10_000, 25_000];

/// What all methods have in common.
trait Method {
    fn update(&mut self, depth: &DepthLayers);
    fn solve(&mut self);
}

impl Method for Simulator {
    fn update(&mut self, depth: &DepthLayers) {
        Simulator::update(self, depth).unwrap();
    }

    fn solve(&mut self) {
        let _ = Simulator::solve(self).unwrap();
    }
}

impl Method for Ic0Method {
    fn update(&mut self, depth: &DepthLayers) {
        Ic0Method::update(self, depth).unwrap();
    }

    fn solve(&mut self) {
        Ic0Method::solve(self).unwrap();
    }
}

impl Method for PaperMethod<f64> {
    fn update(&mut self, depth: &DepthLayers) {
        PaperMethod::update(self, depth).unwrap();
    }

    fn solve(&mut self) {
        PaperMethod::solve(self).unwrap();
    }
}

/// A part of a frame: brings the method to the next image and returns how long that part took.
type Part = fn(&mut dyn Method, &DepthLayers) -> Duration;

const UPDATE: (&str, Part) = ("update", |method, depth| timed(|| method.update(depth)));
const SOLVE: (&str, Part) = ("solve", |method, depth| {
    method.update(depth);
    timed(|| method.solve())
});
const STEP: (&str, Part) = ("step", |method, depth| {
    timed(|| {
        method.update(depth);
        method.solve();
    })
});

fn timed(work: impl FnOnce()) -> Duration {
    let start = Instant::now();
    work();
    start.elapsed()
}

/// One method on one mesh, and how patiently it is measured.
struct Subject<'a> {
    name: &'static str,
    lattice: &'a Lattice,
    size: usize,
    parts: &'a [(&'static str, Part)],
    samples: usize,
    seconds: u64,
}

impl Subject<'_> {
    /// Measures all parts for all motions. The method is built only when the command line asks for one of them.
    fn measure<M: Method>(&self, criterion: &mut Criterion, build: impl Fn(&Lattice) -> M) {
        self.measure_with(criterion, Motion::all(), build);
    }

    fn measure_with<M: Method>(
        &self,
        criterion: &mut Criterion,
        motions: [Motion; 2],
        build: impl Fn(&Lattice) -> M,
    ) {
        let mut method = None;
        for mut motion in motions {
            for (part, run) in self.parts {
                let mut group = criterion.benchmark_group(*part);
                group.sample_size(self.samples).sampling_mode(SamplingMode::Flat);
                group.warm_up_time(Duration::from_millis(300));
                group.measurement_time(Duration::from_secs(self.seconds));
                group.throughput(Throughput::Elements(self.lattice.tet_count() as u64));
                let id = BenchmarkId::new(format!("{}/{}", self.name, motion.name), self.size);
                group.bench_function(id, |b| {
                    let method = method.get_or_insert_with(|| build(self.lattice));
                    b.iter_custom(|frames| (0..frames).map(|_| run(method, motion.next())).sum());
                });
                group.finish();
            }
        }
    }
}

fn simulators(criterion: &mut Criterion, lattice: &Lattice, size: usize) {
    let simulator =
        |sensor, material, threads| Simulator::new(sensor, vec![material], solver_options(threads)).unwrap();
    let glass = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
    let subject = |name, parts| Subject { name, lattice, size, parts, samples: 20, seconds: 2 };
    let all = [UPDATE, SOLVE, STEP];
    for (build, [one, of_all, of_glass]) in [
        (on_lattice as fn(&Lattice) -> Sensor, ["lattice", "lattice-all", "lattice-80"]),
        (on_tetrahedra, ["csr", "csr-all", "csr-80"]),
    ] {
        for (name, material, threads, parts) in [
            (one, GROUNDED, Some(1), all.as_slice()),
            (of_all, GROUNDED, None, &all),
            (of_glass, glass, Some(1), &[STEP]),
        ] {
            let build = |lattice: &Lattice| simulator(build(lattice), material, threads);
            subject(name, parts).measure(criterion, build);
        }
    }
}

/// Many electrodes on small meshes.
fn arrays(criterion: &mut Criterion) {
    for size in MESHES_OF_ARRAY {
        let lattice = array().lattice(size).unwrap();
        let sensor = Sensor::on_lattice(&array(), &lattice).unwrap();
        for (name, of_block, sensor, preconditioner) in [
            ("lattice-32", "lattice-32-block", sensor.clone(), Preconditioner::Multigrid),
            ("csr-32", "csr-32-block", sensor.clone().off_lattice(), Preconditioner::Multigrid),
            ("direct-32", "direct-32-block", sensor, Preconditioner::Direct),
        ] {
            for (name, shape) in [(name, BAR), (of_block, BLOCK)] {
                let build = |_: &Lattice| {
                    let options = SolverOptions { preconditioner, ..solver_options(Some(1)) };
                    Simulator::new(sensor.clone(), vec![GROUNDED], options).unwrap()
                };
                let subject =
                    Subject { name, lattice: &lattice, size, parts: &[STEP], samples: 20, seconds: 2 };
                subject.measure_with(criterion, Motion::all_of(&shape), build);
            }
        }
    }
}

fn baselines(criterion: &mut Criterion, lattice: &Lattice, size: usize) {
    let subject = |name, largest| {
        if size > largest {
            eprintln!("{name} is skipped at {size} elements");
        }
        let subject = Subject { name, lattice, size, parts: &[STEP], samples: 10, seconds: 1 };
        (size <= largest).then_some(subject)
    };
    let coarse = CgOptions { relative_residual: 1e-3, ..CgOptions::USUAL };
    for (name, options) in [("ic0", CgOptions::USUAL), ("ic0-coarse", coarse)] {
        let build =
            |lattice: &Lattice| Ic0Method::new(on_tetrahedra(lattice), vec![GROUNDED], options).unwrap();
        if let Some(subject) = subject(name, LARGEST_OF_IC0) {
            subject.measure(criterion, build);
        }
    }
    for (name, permittivity, largest) in
        [("paper-80", 80.0, LARGEST_OF_PAPER), ("paper-1e5", STEEL, LARGEST_OF_PAPER_WITH_STEEL)]
    {
        let bar = [RelativePermittivity::new(permittivity).unwrap()];
        // Steel on stretched cells takes more iterations than the paper's method otherwise ever needs.
        let options = CgOptions { max_iterations: 200_000, ..CgOptions::PAPER };
        let build = |lattice: &Lattice| PaperMethod::<f64>::new(&on_tetrahedra(lattice), &bar, options);
        if let Some(subject) = subject(name, largest) {
            subject.measure(criterion, build);
        }
    }
}

fn frame(criterion: &mut Criterion) {
    println!("vector instructions: {}", capsense_core::instruction_set());
    arrays(criterion);
    for size in mesh_sizes() {
        let lattice = design().lattice(size).unwrap();
        simulators(criterion, &lattice, size);
        baselines(criterion, &lattice, size);
    }
}

criterion_group!(benches, frame);
criterion_main!(benches);
