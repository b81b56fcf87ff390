//! Wavefront files. All objects and groups become one surface; polygons are cut into fans.

use super::{Surface, point};
use std::collections::HashMap;

pub(super) fn load(bytes: &[u8]) -> Result<Surface, String> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // Materials do not matter here, so their files may be missing.
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), HashMap::new()));
    let (models, _) =
        tobj::load_obj_buf(&mut &*bytes, &options, no_materials).map_err(|error| error.to_string())?;
    let mut surface = Surface::default();
    for model in models {
        let base = surface.vertices.len() as u32;
        surface.vertices.extend(model.mesh.positions.as_chunks::<3>().0.iter().map(|&p| point(p)));
        surface.triangles.extend(model.mesh.indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| v + base)));
    }
    Ok(surface)
}
