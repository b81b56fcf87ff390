//! What a scene file may say but this version cannot compute yet. Each line goes when its feature comes.

use super::raw::{MeshKind, RawScene};
use super::source::{SceneError, Source};

/// Refuses a scene that asks for something that is not computed yet, rather than ignoring it.
pub(super) fn refuse(raw: &RawScene, source: &Source) -> Result<(), SceneError> {
    let generate = raw.mesh.generate.as_ref();
    let asked: [(bool, &str, &str); 2] = [
        (generate.is_some_and(|g| g.tolerance.is_some()), "mesh.generate.tolerance", ""),
        (
            generate.is_some_and(|g| g.kind == Some(MeshKind::Bisection)),
            "mesh.generate.kind",
            " = \"bisection\"",
        ),
    ];
    match asked.iter().find(|(asked, ..)| *asked) {
        Some((_, key, value)) => Err(source.unsupported(key, format!("{key}{value}"))),
        None => Ok(()),
    }
}
