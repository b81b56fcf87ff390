//! `mesh.generate`: a mesh made for the sensor, of so many tetrahedra or as exact as was asked for.

use super::check::Checker;
use super::design::locate;
use super::raw::{MeshKind as RawKind, RawGenerate, Tuple};
use super::source::{SceneError, Source};
use capsense_core::glam::DVec3;
use capsense_core::sensor::{MeshKind, Sensor, SensorDesign, SensorError};
use capsense_core::workspace::{MeshRequest, Probes, WorkspaceError, most_accurate};

/// Tetrahedra of the mesh when the scene does not say.
const DEFAULT_ELEMENTS: usize = 100_000;

/// More tetrahedra than this do not fit into the memory of the machines this is made for.
const MOST_ELEMENTS: usize = 20_000_000;

/// Numbers of tetrahedra that are tried where too few were asked for: by which factor they follow each other, and how far.
const NEXT_TRIED: f64 = 1.2;
const LAST_TRIED: usize = 200_000;

/// A mesh to be made for the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneratedMesh {
    /// What it is made of.
    pub kind: MeshKind,
    /// How large it is.
    pub size: MeshSize,
}

/// How large a mesh is.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSize {
    /// It is the most accurate that was found of at most so many tetrahedra.
    Elements(usize),
    /// It is the smallest whose estimated relative error of ΔC, of a plate at all places and between them, is below the tolerance.
    Tolerance {
        /// The tolerance, between 0 and 1.
        tolerance: f64,
        /// The plate and its places.
        probes: Probes,
    },
}

/// Checks what the scene says of the mesh; of a design that was found valid.
pub(super) fn mesh(
    check: Checker<'_>,
    raw: Option<&RawGenerate>,
    design: &SensorDesign,
) -> Result<GeneratedMesh, SceneError> {
    let Some(raw) = raw else {
        return Ok(GeneratedMesh { kind: MeshKind::default(), size: MeshSize::Elements(DEFAULT_ELEMENTS) });
    };
    let kind = match raw.kind {
        None | Some(RawKind::Lattice) => MeshKind::Lattice,
        Some(RawKind::Bisection) => MeshKind::Bisection,
    };
    if raw.probes.is_some() && raw.tolerance.is_none() {
        return check.error("mesh.generate.probes", "goes with `tolerance`");
    }
    let size = match (raw.elements, raw.tolerance) {
        (Some(elements), None) => {
            MeshSize::Elements(check.count("mesh.generate.elements", elements, 6, MOST_ELEMENTS)?)
        }
        (None, Some(tolerance)) => MeshSize::Tolerance {
            tolerance: check.fraction("mesh.generate.tolerance", tolerance)?,
            probes: match &raw.probes {
                None => Probes::around(design),
                Some(places) => probes(check, places, design)?,
            },
        },
        (None, None) => return check.error("mesh.generate", "needs `elements` or `tolerance`"),
        (Some(_), Some(_)) => {
            return check.error("mesh.generate", "has both `elements` and `tolerance`; give one of them");
        }
    };
    Ok(GeneratedMesh { kind, size })
}

fn probes(check: Checker<'_>, raw: &[Tuple<f64, 3>], design: &SensorDesign) -> Result<Probes, SceneError> {
    if raw.is_empty() {
        return check.error("mesh.generate.probes", "must have at least one place");
    }
    let lowest = Probes::lowest(design);
    let place = |(index, raw): (usize, &Tuple<f64, 3>)| {
        let key = format!("mesh.generate.probes[{index}]");
        let place: DVec3 = check.finite3(&key, **raw)?;
        if !design.domain.contains(place) {
            return check.error(&key, "lies outside the domain");
        }
        if place.z <= lowest {
            let message = format!(
                "must be higher than z = {lowest} m, where the plate around it touches electrodes, but is {}",
                place.z
            );
            return check.error(&key, message);
        }
        Ok(place)
    };
    Ok(Probes::at(design, raw.iter().enumerate().map(place).collect::<Result<_, _>>()?))
}

impl GeneratedMesh {
    /// Makes the sensor with its mesh. Neither depends on the number of threads; 0 is all cores.
    pub(super) fn build(
        &self,
        source: &Source,
        names: &[String],
        design: &SensorDesign,
        threads: usize,
    ) -> Result<Sensor, SceneError> {
        let threads = (threads > 0).then_some(threads);
        match &self.size {
            MeshSize::Elements(elements) => {
                most_accurate(design, self.kind, *elements, threads).map_err(|error| {
                    self.too_few(source, design, *elements, &error)
                        .unwrap_or_else(|| locate(source, names, &error))
                })
            }
            MeshSize::Tolerance { tolerance, probes } => {
                let request =
                    MeshRequest { tolerance: *tolerance, kind: self.kind, probes: probes.clone(), threads };
                let choice =
                    request.choose(design).map_err(|error| refused(source, names, probes, &error))?;
                Ok(choice.sensor)
            }
        }
    }

    /// What to say where a mesh cannot be made of so few tetrahedra, if more of them will do.
    fn too_few(
        &self,
        source: &Source,
        design: &SensorDesign,
        elements: usize,
        error: &SensorError,
    ) -> Option<SceneError> {
        let least = match error {
            SensorError::TooFewElements { needed, .. } => *needed,
            SensorError::OwnsNoNode(_) => elements,
            _ => return None,
        };
        let enough = enough(design, self.kind, least)?;
        let message = format!("{elements} tetrahedra are too few for the electrodes; {enough} will do");
        Some(source.error("mesh.generate.elements", message))
    }
}

/// How many tetrahedra will do, where each electrode needs a node of its own; none if that is far more than so many.
fn enough(design: &SensorDesign, kind: MeshKind, too_few: usize) -> Option<usize> {
    let next = |tried: &usize| Some((NEXT_TRIED * *tried as f64).ceil() as usize);
    std::iter::successors(Some(too_few), next)
        .take_while(|tried| *tried <= LAST_TRIED)
        .find(|tried| Sensor::generated(design, kind, *tried).is_ok())
}

/// Says which key of the scene a complaint about the choice of a mesh is about.
fn refused(source: &Source, names: &[String], probes: &Probes, error: &WorkspaceError) -> SceneError {
    let probe = |place: &DVec3| match probes.places.iter().position(|other| other == place) {
        Some(index) if source.names("mesh.generate.probes") => format!("mesh.generate.probes[{index}]"),
        _ => "mesh.generate.tolerance".to_owned(),
    };
    let key = match error {
        WorkspaceError::Sensor(error) => return locate(source, names, error),
        WorkspaceError::Touches(place) | WorkspaceError::NotFelt(place) => probe(place),
        WorkspaceError::Tolerance(_)
        | WorkspaceError::NoPlace
        | WorkspaceError::OutOfReach { .. }
        | WorkspaceError::Plate(_)
        | WorkspaceError::Simulator(_) => "mesh.generate.tolerance".to_owned(),
    };
    source.error(&key, error.to_string())
}
