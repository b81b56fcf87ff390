//! What a scene file may say but this version cannot compute yet. Each line goes when its feature comes.

use super::raw::{MeshKind, RawInterface, RawScene};
use super::source::{SceneError, Source};

/// Refuses a scene that asks for something that is not computed yet, rather than ignoring it.
pub(super) fn refuse(raw: &RawScene, source: &Source) -> Result<(), SceneError> {
    let generate = raw.mesh.generate.as_ref();
    let stl = raw.sensor.electrode.iter().position(|electrode| electrode.stl.is_some());
    let stl_key = format!("sensor.electrode[{}].stl", stl.unwrap_or_default());
    let simulation = &raw.simulation;
    let asked: [(bool, &str, &str); 5] = [
        (generate.is_some_and(|g| g.tolerance.is_some()), "mesh.generate.tolerance", ""),
        (
            generate.is_some_and(|g| g.kind == Some(MeshKind::Bisection)),
            "mesh.generate.kind",
            " = \"bisection\"",
        ),
        (stl.is_some(), &stl_key, ""),
        (simulation.interface == Some(RawInterface::Centroid), "simulation.interface", " = \"centroid\""),
        (
            simulation.interface == Some(RawInterface::VolumeFraction),
            "simulation.interface",
            " = \"volume-fraction\"",
        ),
    ];
    match asked.iter().find(|(asked, ..)| *asked) {
        Some((_, key, value)) => Err(source.unsupported(key, format!("{key}{value}"))),
        None => Ok(()),
    }
}
