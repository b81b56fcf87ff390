//! Runs all methods under one stress.

use super::cell::{Cell, Measured, Outcome};
use super::ladder::Stress;
use super::meshes;
use super::method::{Method, Solver};
use super::scenario::Scenario;
use capsense_core::baseline::{BaselineError, CgOptions, PaperMethod, Precision};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::estimate::halved_lattice;
use capsense_core::occupancy::{DepthLayers, Interface, OrthographicView};
use capsense_core::sensor::{Sensor, SensorError};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solids::SolidError;
use capsense_core::solver::{Preconditioner, SolveReport, SolverOptions};
use capsense_core::units::VACUUM_PERMITTIVITY;

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Sensor(#[from] SensorError),
    #[error(transparent)]
    Solid(#[from] SolidError),
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    #[error(transparent)]
    Paper(#[from] BaselineError),
    #[error("a conductor touches an electrode: a short circuit")]
    Contact,
    #[error("the mesh is too coarse for an object")]
    Unresolved,
}

/// What a method says of a scenario.
struct Run {
    /// Without objects.
    base: CapacitanceMatrix,
    /// In the frames that are solved.
    frames: Vec<CapacitanceMatrix>,
    iterations: usize,
}

impl Run {
    fn last(&self) -> &CapacitanceMatrix {
        self.frames.last().unwrap_or(&self.base)
    }

    fn change(&self) -> Vec<f64> {
        change(&self.base, self.last())
    }
}

/// The equations of several methods: what their results are compared with.
struct Reference {
    run: Result<Run, Refusal>,
    model_error: Option<f64>,
    error_bar: Option<f64>,
}

/// What a factorisation is asked for.
const EXACT: SolverOptions = SolverOptions {
    tolerance: 1e-11,
    change_tolerance: None,
    preconditioner: Preconditioner::Cholesky,
    max_iterations: 20_000,
    threads: Some(1),
};

/// What meshes are asked for that others are compared with.
const FINE: SolverOptions =
    SolverOptions { tolerance: 1e-7, preconditioner: Preconditioner::Multigrid, ..EXACT };

/// The residual at which the paper's method is exact.
const EXACT_RESIDUAL: CgOptions = CgOptions { relative_residual: 1e-12, max_iterations: 20_000 };

/// Of an electrode, square metres.
const AREA: f64 = 0.1 * 0.02;

/// Iterations after which a column of the paper's method is given up.
const MOST_OF_PAPER: usize = 5_000;

/// All cells of a column, in the order of [`Method::all`], or as many as come before `keep_going` says no.
pub(super) fn column(stress: Stress, keep_going: impl Fn() -> bool) -> Vec<Cell> {
    let scenario = Scenario::of(stress);
    let changes = Changes::of(&scenario);
    let sensors = [true, false].map(|is_lattice| scenario.sensor(is_lattice));
    let mut known: Vec<(Interface, bool, bool, Reference)> = Vec::new();
    let mut cells = Vec::new();
    for method in Method::all() {
        if !keep_going() {
            break;
        }
        let outcome = outcome(&scenario, &sensors, method, |sensor| {
            let key = (method.interface, sensor.lattice().is_some(), method.is_paper());
            let place = known.iter().position(|&(i, l, p, _)| (i, l, p) == key).unwrap_or_else(|| {
                let reference = reference(&scenario, method, sensor, changes.as_ref());
                known.push((key.0, key.1, key.2, reference));
                known.len() - 1
            });
            compare(&known[place].3, run(&scenario, method, sensor), method.tolerance(stress))
        });
        cells.push(Cell { method, stress, outcome });
    }
    cells
}

/// What changes by objects are compared with in a scenario.
struct Changes {
    truth: Vec<f64>,
    /// The scenario on a mesh with all spacings halved, as error bars are told by: known to be a lattice, and not.
    halved: [Option<Simulator>; 2],
}

impl Changes {
    /// `None` where it is not the interface model that is stressed.
    fn of(scenario: &Scenario) -> Option<Self> {
        let fine = scenario.fine().and_then(|sensor| last_frame(scenario, sensor.ok()?));
        let truth = fine.map(|fine| change(fine.base(), fine.capacitance()));
        let truth = truth.or_else(|| plates(scenario.stress))?;
        let halved = [true, false].map(|is_lattice| last_frame(scenario, halved(is_lattice)?));
        Some(Self { truth, halved })
    }

    /// Of a simulator in its last frame.
    fn error_bar(&self, simulator: &Simulator, report: &SolveReport) -> Option<f64> {
        let [on_lattice, off_lattice] = &self.halved;
        let halved = if simulator.sensor().lattice().is_some() { on_lattice } else { off_lattice };
        let bars = simulator.error_bars(None, halved.as_ref()?, report);
        let bars: Vec<f64> = bars.change.rows().flatten().copied().collect();
        Some(largest_of(&bars) / largest_of(&self.truth))
    }
}

/// The lattice of the scenarios whose truth is known with all spacings halved, known to be one or not.
fn halved(is_lattice: bool) -> Option<Sensor> {
    let lattice = halved_lattice(meshes::on_lattice().ok()?.lattice()?).ok()?;
    let sensor = Sensor::on_lattice(&meshes::stripes(), &lattice).ok()?;
    Some(if is_lattice { sensor } else { sensor.off_lattice() })
}

/// The last frame where surfaces cut edges of another mesh; `None` where a conductor touches an electrode there.
fn last_frame(scenario: &Scenario, sensor: Sensor) -> Option<Simulator> {
    let mut simulator = Simulator::new(sensor, scenario.materials.clone(), FINE).ok()?;
    let mut solids = scenario.solids().ok()?;
    scenario.place(&mut solids, scenario.frames() - 1).ok()?;
    let _ = simulator.step(&solids).ok()?;
    simulator.contacts().is_empty().then_some(simulator)
}

/// What objects do to all entries.
fn change(base: &CapacitanceMatrix, with_objects: &CapacitanceMatrix) -> Vec<f64> {
    with_objects.minus(base).rows().flatten().copied().collect()
}

/// Electrodes so close to a bar that they are plates, their edges within a hundredth: C = ε₀A/d.
fn plates(stress: Stress) -> Option<Vec<f64>> {
    let Stress::Gap(gap) = stress else { return None };
    let own = VACUUM_PERMITTIVITY * AREA / gap;
    Some(vec![own, 0.0, 0.0, own])
}

fn outcome(
    scenario: &Scenario,
    [on_lattice, off_lattice]: &[Option<Result<Sensor, SensorError>>; 2],
    method: Method,
    measure: impl FnOnce(&Sensor) -> Result<Measured, Refusal>,
) -> Outcome {
    let is_asked = match scenario.stress {
        Stress::Tolerance(tolerance) => method.takes_tolerance(tolerance),
        _ => true,
    };
    if !is_asked || method.is_paper() && scenario.as_in_paper().is_none() {
        return Outcome::NotOffered;
    }
    // Where there is a lattice, methods that need none have it in rows.
    let sensor = match (method.solver, on_lattice) {
        (Solver::Aggregation, _) => off_lattice,
        (_, None) if !method.needs_lattice() => off_lattice,
        (_, sensor) => sensor,
    };
    match sensor {
        None => Outcome::NotOffered,
        Some(Err(error)) => Outcome::Refused(error.to_string()),
        Some(Ok(sensor)) => match measure(sensor) {
            Ok(measured) => Outcome::Measured(measured),
            Err(refusal) => Outcome::Refused(refusal.to_string()),
        },
    }
}

impl Method {
    fn tolerance(self, stress: Stress) -> f64 {
        if let Stress::Tolerance(tolerance) = stress { tolerance } else { self.usual_tolerance() }
    }
}

fn compare(reference: &Reference, run: Result<Run, Refusal>, tolerance: f64) -> Result<Measured, Refusal> {
    let run = run?;
    let solver_error = match &reference.run {
        Ok(exact) => {
            let frames = run.frames.iter().zip(&exact.frames);
            let all = frames.chain([(&run.base, &exact.base)]);
            all.map(|(c, exact)| difference(c, exact)).fold(0.0, largest)
        }
        // Where the equations have no solution, none is right.
        Err(_) => f64::INFINITY,
    };
    let Reference { model_error, error_bar, .. } = *reference;
    Ok(Measured { iterations: run.iterations, tolerance, solver_error, model_error, error_bar })
}

fn reference(scenario: &Scenario, method: Method, sensor: &Sensor, changes: Option<&Changes>) -> Reference {
    let truth = changes.map(|changes| &changes.truth[..]);
    let first = scenario.first_solved();
    if method.is_paper() {
        let run = paper::<f64>(scenario, sensor, EXACT_RESIDUAL, first);
        let model_error = error_of_change(run.as_ref().ok(), truth);
        return Reference { run, model_error, error_bar: None };
    }
    let options = SolverOptions { tolerance: scenario.finest_tolerance(), ..EXACT };
    let mut exact = match Simulating::new(scenario, sensor, method.interface, &options) {
        Ok(exact) => exact,
        Err(refusal) => return Reference { run: Err(refusal), model_error: None, error_bar: None },
    };
    let run = exact.run_from(first);
    let model_error = error_of_change(run.as_ref().ok(), truth);
    let error_bar = changes
        .zip(exact.report.as_ref())
        .and_then(|(changes, report)| changes.error_bar(&exact.simulator, report));
    Reference { run, model_error, error_bar }
}

fn error_of_change(run: Option<&Run>, truth: Option<&[f64]>) -> Option<f64> {
    let (run, truth) = (run?, truth?);
    let off = run.change().iter().zip(truth).map(|(change, truth)| change - truth).collect::<Vec<_>>();
    Some(largest_of(&off) / largest_of(truth))
}

fn run(scenario: &Scenario, method: Method, sensor: &Sensor) -> Result<Run, Refusal> {
    let tolerance = method.tolerance(scenario.stress);
    let options = CgOptions { relative_residual: tolerance, max_iterations: MOST_OF_PAPER };
    match method.solver {
        Solver::PaperSingle => paper::<f32>(scenario, sensor, options, 0),
        Solver::PaperDouble => paper::<f64>(scenario, sensor, options, 0),
        _ => Simulating::new(scenario, sensor, method.interface, &method.options(tolerance))?.run_from(0),
    }
}

/// A simulator in a scenario.
struct Simulating<'a> {
    scenario: &'a Scenario,
    simulator: Simulator,
    /// Of the last frame.
    report: Option<SolveReport>,
}

impl<'a> Simulating<'a> {
    fn new(
        scenario: &'a Scenario,
        sensor: &Sensor,
        interface: Interface,
        options: &SolverOptions,
    ) -> Result<Self, Refusal> {
        let materials = scenario.materials.clone();
        let simulator = Simulator::with_interface(sensor.clone(), materials, *options, interface)?;
        Ok(Self { scenario, simulator, report: None })
    }

    /// Takes all frames from the given one on, and solves those that are to be solved.
    fn run_from(&mut self, first: u32) -> Result<Run, Refusal> {
        let scenario = self.scenario;
        let mut solids = scenario.solids()?;
        let (mut frames, mut iterations) = (Vec::new(), 0);
        for frame in first..scenario.frames() {
            scenario.place(&mut solids, frame)?;
            self.simulator.update(&solids)?;
            if frame >= scenario.first_solved() {
                let report = self.simulator.solve()?;
                if !self.simulator.contacts().is_empty() {
                    return Err(Refusal::Contact);
                }
                if !self.simulator.unresolved(&solids).is_empty() {
                    return Err(Refusal::Unresolved);
                }
                iterations = iterations.max(report.iterations);
                frames.push(self.simulator.capacitance().clone());
                self.report = Some(report);
            }
        }
        Ok(Run { base: self.simulator.base().clone(), frames, iterations })
    }
}

/// The same by the paper's method.
fn paper<T: Precision>(
    scenario: &Scenario,
    sensor: &Sensor,
    options: CgOptions,
    first: u32,
) -> Result<Run, Refusal> {
    let (permittivities, back_fill) = scenario.as_in_paper().unwrap_or_default();
    let mut method = PaperMethod::<T>::new(sensor, &permittivities, options);
    let view = OrthographicView { domain: meshes::DOMAIN, width: 1, height: 1 };
    let _ = method.step(&DepthLayers::empty(view, permittivities.len()))?;
    let base = method.capacitance().clone();
    let (mut frames, mut iterations) = (Vec::new(), 0);
    for frame in first..scenario.frames() {
        method.update(&scenario.depth(frame, back_fill))?;
        // It starts from zero in every frame, so one tells as much as many.
        if frame + 1 == scenario.frames() {
            iterations = method.solve()?;
            frames.push(method.capacitance().clone());
        }
    }
    Ok(Run { base, frames, iterations })
}

/// The largest difference of an entry, in parts of √(C_ss C_tt); what has no capacitance counts as a trillionth of what has.
fn difference(c: &CapacitanceMatrix, exact: &CapacitanceMatrix) -> f64 {
    let size = exact.size();
    let most = (0..size).map(|s| exact.get(s, s)).fold(0.0, f64::max);
    let own = |s: usize| exact.get(s, s).max(1e-12 * most);
    let entries = (0..size).flat_map(|s| (0..size).map(move |t| (s, t)));
    entries.map(|(s, t)| (c.get(s, t) - exact.get(s, t)).abs() / (own(s) * own(t)).sqrt()).fold(0.0, largest)
}

fn largest_of(entries: &[f64]) -> f64 {
    entries.iter().map(|entry| entry.abs()).fold(0.0, largest)
}

/// The larger one; NaN where there is one.
fn largest(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}
