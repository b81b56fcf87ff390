//! The smallest mesh whose estimated error of ΔC is below a tolerance.
//!
//! Lattices that grow tell how many tetrahedra it may take. Sizes from an eighth of that number up are then tried one after the
//! other, a fifth more each time, lattices of most sizes with links at rims that weigh what suits them best: as edges of electrodes must be in
//! lattice planes, some sizes are much better than others. Between the first that is exact enough and the one before, smaller ones
//! are looked for by halves, then lattices of other gradings that are smaller still. Where there are many tetrahedra, some with lower
//! layers stand beside the usual one of each size.
//! Cost is counted in tetrahedra, so the choice is the same on every machine.

use super::balance::Balance;
use super::comparison::Comparison;
use super::most_accurate::{COMPARED, SMALLER};
use super::{Change, Probes};
use crate::geometry::Shape;
use crate::mesh::Lattice;
use crate::sensor::{MeshKind, Sensor, SensorDesign, SensorError};
use crate::simulator::SimulatorError;
use crate::solids::SolidError;
use glam::DVec3;

/// Tetrahedra of the first lattice.
const FIRST: usize = 4_000;

/// How many times as many tetrahedra the lattice has at least that others are compared with.
pub(super) const FINER: f64 = 4.0;

/// How many times as many it should have, as long as that is not above so many: what it is off by itself, links take over. A lattice that
/// has nearly so many will do.
const FAR_FINER: f64 = 32.0;
const COMFORTABLE: f64 = 4e6;
const NEARLY: f64 = 0.8;

/// Tetrahedra of the finest lattice that others are compared with: it needs about 2 GB.
const FINEST: usize = 8_000_000;

/// Where it seems to take so many, none of the lattices that may follow will do.
const HOPELESS: f64 = 1e9;

/// By which factors that lattice may grow from one to the next.
const STEPS: [f64; 2] = [2.0, 8.0];

/// Errors are N to this power.
const ORDER: f64 = -2.0 / 3.0;

/// The size first tried in parts of the one foreseen, and by which factor sizes follow each other.
const TRIED_FIRST: f64 = 0.125;
const TRIED_NEXT: f64 = 1.189_207_115_002_721;

/// The smallest size, as a power of the latter from the first lattice: a quarter of it.
const LEAST_STEP: f64 = -8.0;

/// How often what is between the size found and the one before is halved.
const HALVINGS: usize = 3;

/// Bodies by their index: the plate, and a ball, its radius in parts of the plate's sides, as what suits plates need not suit bodies that
/// are no wider than some cells.
const PLATE: usize = 0;
const BALL: usize = 1;
const RADIUS: f64 = 0.2;

/// By how many times the tolerance each of them may be off.
const TOLERANCES: [f64; 2] = [1.0, 2.5];

/// What is weighed for some places and chosen for them is less exact elsewhere, by about a sixth; but for lattices of more tetrahedra than are
/// [`COMPARED`]: of five of a size none is the best of many by chance.
const MARGIN: f64 = 0.85;

/// A mesh is given up as soon as the mean error, that of C without bodies among them, is so many times the tolerance at least: then one of
/// its bodies will be off by more than it may.
const GIVEN_UP: f64 = 2.5;

/// Why no mesh can be chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorkspaceError {
    /// A tolerance that is not between zero and one.
    #[error("tolerance {0} is not between 0 and 1")]
    Tolerance(f64),
    /// There is no place for the plate.
    #[error("there is no place at which to estimate errors")]
    NoPlace,
    /// The plate covers an electrode or a part of it.
    #[error("a plate of which the centre is at {} mm touches an electrode", in_millimetres(.0))]
    Touches(DVec3),
    /// No electrode feels the plate.
    #[error("no electrode feels a plate of which the centre is at {} mm", in_millimetres(.0))]
    NotFelt(DVec3),
    /// Not even the finest mesh whose error can be estimated is exact enough.
    #[error(
        "no mesh of up to {tets} tetrahedra, as far as errors can be estimated, has an error of ΔC below {tolerance}: \
         the finest is expected to reach {reached:.1e}"
    )]
    OutOfReach {
        /// What was asked for.
        tolerance: f64,
        /// About the error of the finest mesh of which it can be estimated: as errors fall from coarser ones, or what was
        /// found of it at least, if that is more.
        reached: f64,
        /// How many tetrahedra that has.
        tets: usize,
    },
    /// The sensor cannot be meshed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The plate is no solid.
    #[error(transparent)]
    Plate(#[from] SolidError),
    /// The plate cannot be computed.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
}

/// A place without digits that tell nothing.
fn in_millimetres(place: &DVec3) -> String {
    // Adding zero takes the sign from one.
    let [x, y, z] = (1e3 * *place).to_array().map(|value| (value * 1e3).round() / 1e3 + 0.0);
    format!("({x}, {y}, {z})")
}

/// What a mesh is wanted for.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshRequest {
    /// The largest relative error of ΔC over the workspace, as in [`ChangeError::of_all`](super::ChangeError): of a grounded plate, and 0.4
    /// of that of a ball.
    pub tolerance: f64,
    /// What the mesh is made of.
    pub kind: MeshKind,
    /// Where errors are estimated.
    pub probes: Probes,
    /// Threads for the estimates, all cores where there is no number. The choice does not depend on it.
    pub threads: Option<usize>,
}

/// A mesh that meets a tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshChoice {
    /// The sensor on that mesh.
    pub sensor: Sensor,
    /// How many tetrahedra were allowed.
    pub allowed: usize,
    /// The estimated error of ΔC, the largest of all places: that of the plate, or two fifths of that of the ball.
    pub error: f64,
    /// Tetrahedra of the lattice that it was compared with.
    pub compared_with: usize,
}

impl MeshRequest {
    /// The smallest mesh that is exact enough, of a tolerance and a kind: for the plate around the sensor, on all cores.
    pub fn new(design: &SensorDesign, tolerance: f64, kind: MeshKind) -> Self {
        Self { tolerance, kind, probes: Probes::around(design), threads: None }
    }

    /// Looks for the smallest mesh whose estimated error is below the tolerance.
    ///
    /// # Errors
    /// When the request or the design is invalid, the plate touches an electrode or is felt by none, or no mesh whose error
    /// can be estimated is exact enough.
    pub fn choose(&self, design: &SensorDesign) -> Result<MeshChoice, WorkspaceError> {
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return Err(WorkspaceError::Tolerance(self.tolerance));
        }
        if self.probes.places.is_empty() {
            return Err(WorkspaceError::NoPlace);
        }
        let mut search = Search { request: self, design, step: None, last: 0.0 };
        let mut coarser = search.first()?;
        let mut reference = search.finer_than(&coarser, STEPS[1])?;
        loop {
            let foreseen = search.foreseen(&coarser.of, &reference.of)?;
            let is_finest = reference.allowed == FINEST;
            let wanted = (FAR_FINER * foreseen).min(COMFORTABLE).max(FINER * foreseen);
            let tets = reference.of.tets as f64;
            if (tets > NEARLY * wanted || is_finest)
                && let Some(choice) = search.smallest(foreseen.min(tets / FINER), &reference)?
            {
                return Ok(choice);
            }
            if is_finest || foreseen > HOPELESS {
                return Err(search.out_of_reach(foreseen));
            }
            let finer = search.finer_than(&reference, (wanted / tets).clamp(STEPS[0], STEPS[1]))?;
            let before = std::mem::replace(&mut reference, finer);
            // Of lattices nearly as fine, little can be told of how errors fall.
            if reference.of.tets as f64 > FINER * before.of.tets as f64 {
                coarser = before;
            }
        }
    }
}

/// The error of a finer mesh in parts of that of a coarser one, as [`ORDER`] has it; none if it is not finer.
pub(super) fn expected_ratio(tets: usize, of_finer: usize) -> Option<f64> {
    (of_finer > tets).then(|| (of_finer as f64 / tets as f64).powf(ORDER))
}

/// What bodies change on one lattice of at most so many tetrahedra.
struct Rung {
    allowed: usize,
    of: Comparison,
}

struct Search<'a> {
    request: &'a MeshRequest,
    design: &'a SensorDesign,
    /// The first size of the wanted mesh that has not been tried, as a power of [`TRIED_NEXT`].
    step: Option<i32>,
    /// The error of the last mesh that was tried, as far as it was looked at, and the least where there are several of a size: too large.
    last: f64,
}

impl Search<'_> {
    fn rung(&self, allowed: usize) -> Result<Rung, WorkspaceError> {
        let MeshRequest { tolerance, probes, threads, .. } = self.request;
        let sensor = Sensor::generated(self.design, MeshKind::Lattice, allowed)?;
        let radius = RADIUS * probes.plate.x;
        let bodies = vec![Shape::Box { size: probes.plate }, Shape::Sphere { radius }];
        let (places, known) = places(self.design, probes, radius);
        let of = Comparison::new(sensor, bodies, places, known, *tolerance, *threads)?;
        Ok(Rung { allowed, of })
    }

    /// The first lattice: the smallest that resolves the electrodes, where that is larger than usual.
    fn first(&self) -> Result<Rung, WorkspaceError> {
        let mut allowed = FIRST;
        loop {
            allowed = match self.rung(allowed) {
                Err(WorkspaceError::Sensor(SensorError::TooFewElements { needed, .. }))
                    if (allowed + 1..=FINEST).contains(&needed) =>
                {
                    needed
                }
                Err(WorkspaceError::Sensor(SensorError::OwnsNoNode(_))) if 2 * allowed <= FINEST => {
                    2 * allowed
                }
                rung => return rung,
            };
        }
    }

    /// A lattice of so many times as many tetrahedra.
    fn finer_than(&self, rung: &Rung, times: f64) -> Result<Rung, WorkspaceError> {
        self.rung(FINEST.min((rung.allowed as f64 * times) as usize))
    }

    /// The estimated error of a mesh of so many tetrahedra with a body at one of the places, in parts of what is allowed for that body.
    fn error(
        &self,
        tets: usize,
        change: &Change,
        reference: &Comparison,
        at: usize,
    ) -> Result<f64, WorkspaceError> {
        let ([exact, _], (body, place)) = (&reference.changes[at], reference.places[at]);
        let error = match change.error(exact) {
            Some(error) => error.of_all / TOLERANCES[body],
            // What is as small as a ball may be between the edges of the lattice.
            None if body == BALL => 0.0,
            None => return Err(WorkspaceError::NotFelt(place)),
        };
        Ok(expected_ratio(tets, reference.tets).map_or(f64::INFINITY, |left| error / (1.0 - left)))
    }

    /// How many tetrahedra it takes if errors of the plate fall as they should from those of a lattice.
    fn foreseen(&self, rung: &Comparison, reference: &Comparison) -> Result<f64, WorkspaceError> {
        let mut largest = 0.0f64;
        for (at, [change, _]) in rung.changes.iter().enumerate() {
            if rung.places[at].0 == PLATE {
                largest = largest.max(self.error(rung.tets, change, reference, at)?);
            }
        }
        Ok(rung.tets as f64 * (largest / self.request.tolerance).powf(-1.0 / ORDER))
    }

    /// Tells what the finest mesh would reach, from how many tetrahedra it takes. Meshes of the finest size that were tried
    /// tell it of other kinds than lattices.
    fn out_of_reach(&self, foreseen: f64) -> WorkspaceError {
        let tolerance = self.request.tolerance;
        let tets = (FINEST as f64 / FINER) as usize;
        let reached = (tolerance * (tets as f64 / foreseen).powf(ORDER)).max(self.last);
        WorkspaceError::OutOfReach { tolerance, reached, tets }
    }

    /// The smallest mesh that is exact enough, of those from which the reference is far enough. What was not before, with
    /// a coarser reference, is not tried again.
    fn smallest(&mut self, foreseen: f64, reference: &Rung) -> Result<Option<MeshChoice>, WorkspaceError> {
        let most = reference.of.tets as f64 / FINER;
        let first = (TRIED_FIRST * foreseen / FIRST as f64).log(TRIED_NEXT).floor().max(LEAST_STEP) as i32;
        for step in self.step.unwrap_or(first).. {
            let allowed = (FIRST as f64 * TRIED_NEXT.powi(step)) as usize;
            self.step = Some(step);
            if allowed as f64 > most {
                break;
            }
            if let Some(choice) = self.of_size(allowed, reference)? {
                let before = allowed as f64 / TRIED_NEXT;
                let smallest = self.smallest_from(before as usize, choice, reference)?;
                return self.smallest_varied(smallest, reference).map(Some);
            }
        }
        Ok(None)
    }

    /// A smaller mesh than the one that was found, if there is one between it and a size that is too small.
    fn smallest_from(
        &mut self,
        mut too_small: usize,
        mut found: MeshChoice,
        reference: &Rung,
    ) -> Result<MeshChoice, WorkspaceError> {
        for _ in 0..HALVINGS {
            let middle = usize::midpoint(too_small, found.allowed);
            // The same mesh may be what a smaller number allows.
            let most = found.sensor.mesh().tets().len();
            match self.of_size(middle.min(most - 1), reference)? {
                Some(smaller) => found = smaller,
                None => too_small = middle.min(most - 1),
            }
        }
        Ok(found)
    }

    /// A smaller lattice of another grading than the usual one, if there is one that is exact enough: sizes are tried downwards until no
    /// lattice of one is.
    fn smallest_varied(
        &mut self,
        mut found: MeshChoice,
        reference: &Rung,
    ) -> Result<MeshChoice, WorkspaceError> {
        if self.request.kind == MeshKind::Bisection {
            return Ok(found);
        }
        loop {
            let allowed = (SMALLER * found.sensor.mesh().tets().len() as f64) as usize;
            if allowed < *COMPARED.start() {
                return Ok(found);
            }
            let lattices = if allowed <= *COMPARED.end() {
                self.design.varied_lattices(allowed)?
            } else {
                self.design.lattices_of_lower_layers(allowed)?
            };
            match self.first_exact_enough(&lattices, allowed, reference) {
                Some(smaller) => found = smaller,
                None => return Ok(found),
            }
        }
    }

    /// A mesh of at most so many tetrahedra that is exact enough, if there is one: the usual one, or where there may be more than are
    /// [`COMPARED`], a lattice with lower layers.
    fn of_size(&mut self, allowed: usize, reference: &Rung) -> Result<Option<MeshChoice>, WorkspaceError> {
        let kind = self.request.kind;
        let usual = match Sensor::generated(self.design, kind, allowed) {
            // Too few for the electrodes.
            Err(SensorError::TooFewElements { .. } | SensorError::OwnsNoNode(_)) => return Ok(None),
            sensor => sensor?,
        };
        let usual_lattice = usual.lattice().cloned();
        let choice = self.exact_enough(usual, allowed, reference)?;
        if choice.is_some() || kind == MeshKind::Bisection || allowed <= *COMPARED.end() {
            return Ok(choice);
        }
        let mut lower = self.design.lattices_of_lower_layers(allowed)?;
        lower.retain(|lattice| Some(lattice) != usual_lattice.as_ref());
        Ok(self.first_exact_enough(&lower, allowed, reference))
    }

    /// The first of some lattices that is exact enough; what cannot be compared is not taken.
    fn first_exact_enough(
        &mut self,
        lattices: &[Lattice],
        allowed: usize,
        reference: &Rung,
    ) -> Option<MeshChoice> {
        let mut least = self.last;
        for lattice in lattices {
            let Ok(sensor) = Sensor::on_lattice(self.design, lattice) else { continue };
            if let Ok(Some(choice)) = self.exact_enough(sensor, allowed, reference) {
                return Some(choice);
            }
            least = least.min(self.last);
        }
        self.last = least;
        None
    }

    /// A mesh, lattices of some sizes with links that weigh what suits them best, if it is exact enough then; places are looked at until it is not.
    fn exact_enough(
        &mut self,
        sensor: Sensor,
        allowed: usize,
        reference: &Rung,
    ) -> Result<Option<MeshChoice>, WorkspaceError> {
        let tolerance = self.request.tolerance;
        let tets = sensor.mesh().tets().len();
        let is_weighed = self.request.kind == MeshKind::Lattice && tets >= *COMPARED.start();
        let (sensor, most) = if is_weighed {
            let margin = if tets > *COMPARED.end() { 1.0 } else { MARGIN };
            let bound = (GIVEN_UP * tolerance).powi(2);
            let is_below = |balance: &Balance| balance.mean_square_left() < bound;
            let Some(balance) = reference.of.balance(&sensor, is_below)? else {
                self.last = GIVEN_UP * tolerance;
                return Ok(None);
            };
            (sensor.with_rims_weighed(&balance.factors()), margin * tolerance)
        } else {
            (sensor, tolerance)
        };
        let mut probed = reference.of.probed(sensor.clone())?;
        let mut largest = 0.0f64;
        for (at, &(body, place)) in reference.of.places.iter().enumerate() {
            let [change, _] = probed.changes(body, place)?;
            largest = largest.max(self.error(tets, &change, &reference.of, at)?);
            if largest >= most {
                self.last = largest;
                return Ok(None);
            }
        }
        Ok(Some(MeshChoice { sensor, allowed, error: largest, compared_with: reference.of.tets }))
    }
}

/// Where bodies are put, and of how many of these places, the first, links are to know: the plate at all probes and the ball at every
/// second, as far above the electrodes. Then the plate half way between each probe and the next, where it is only seen how exact a
/// mesh is: what suits the places that it is chosen for may suit no others.
fn places(design: &SensorDesign, probes: &Probes, radius: f64) -> (Vec<(usize, DVec3)>, usize) {
    // Beside or below electrodes there may be no room for others than the probes.
    let lowest = Probes::lowest(design);
    let is_above = |place: &DVec3| place.z >= lowest;
    let higher = (radius - 0.5 * probes.plate.z) * DVec3::Z;
    let mut places = Vec::new();
    for (at, &place) in probes.places.iter().enumerate() {
        places.push((PLATE, place));
        if at % 2 == 0 && is_above(&place) {
            places.push((BALL, place + higher));
        }
    }
    let known = places.len();
    let between = probes.places.windows(2).filter(|pair| pair.iter().all(is_above));
    places.extend(between.map(|pair| (PLATE, 0.5 * (pair[0] + pair[1]))));
    (places, known)
}
