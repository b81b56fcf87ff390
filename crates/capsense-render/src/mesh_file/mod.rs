//! Object surfaces from files: glTF (`.gltf`, `.glb`), Wavefront (`.obj`) and STL (`.stl`, ASCII and binary).
//!
//! Only positions and triangles are read. Of a glTF file the default scene is taken, every mesh where its node stands;
//! skins and morph targets are not applied, so a rigged model appears as it was modelled.

mod base64;
mod gltf;
mod obj;
mod stl;

use capsense_core::geometry::{TriangleMesh, TriangleMeshError};
use capsense_core::units::LengthUnit;
use glam::DVec3;
use std::io;
use std::path::{Path, PathBuf};

/// Why a file holds no object.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A glTF file refers to a file that cannot be read.
    #[error("{}: its buffer {} cannot be read: {source}", path.display(), buffer.display())]
    ReadBuffer {
        /// The glTF file.
        path: PathBuf,
        /// The file that it refers to.
        buffer: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The file's name ends in none of the known ways.
    #[error("{}: unknown kind of mesh file: expected .glb, .gltf, .obj or .stl", path.display())]
    UnsupportedExtension {
        /// The file.
        path: PathBuf,
    },
    /// The file is not what its name says, or uses something that is not supported.
    #[error("{}: {reason}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// There is nothing to draw in it.
    #[error("{}: there are no triangles in it", path.display())]
    NoTriangles {
        /// The file.
        path: PathBuf,
    },
    /// A coordinate is NaN or infinite.
    #[error("{}: vertex {vertex} is not finite", path.display())]
    NonFiniteVertex {
        /// The file.
        path: PathBuf,
        /// Index of the vertex, counted through the whole file.
        vertex: usize,
    },
}

/// Vertices in the file's unit, and triangles.
#[derive(Debug, Default)]
struct Surface {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// What goes wrong inside a file.
#[derive(Debug)]
enum Failure {
    Parse(String),
    Buffer { buffer: PathBuf, source: io::Error },
}

impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Self::Parse(reason)
    }
}

/// Loads a surface; one unit in the file becomes `unit.metres()`. (glTF files are meant to be in metres.)
///
/// # Errors
/// Every error names the file: it cannot be read, is of an unknown kind, cannot be parsed, has no triangles, or has a
/// coordinate that is not finite.
pub fn load_mesh(path: impl AsRef<Path>, unit: LengthUnit) -> Result<TriangleMesh, MeshFileError> {
    let path = path.as_ref();
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let load: fn(&[u8], &Path) -> Result<Surface, Failure> = match extension.as_deref() {
        Some("glb" | "gltf") => gltf::load,
        Some("obj") => |bytes, _| Ok(obj::load(bytes)?),
        Some("stl") => |bytes, _| Ok(stl::load(bytes)?),
        _ => return Err(MeshFileError::UnsupportedExtension { path: path.to_owned() }),
    };
    let bytes =
        std::fs::read(path).map_err(|source| MeshFileError::Read { path: path.to_owned(), source })?;
    let mut surface = load(&bytes, path).map_err(|failure| match failure {
        Failure::Parse(reason) => MeshFileError::Parse { path: path.to_owned(), reason },
        Failure::Buffer { buffer, source } => {
            MeshFileError::ReadBuffer { path: path.to_owned(), buffer, source }
        }
    })?;
    for vertex in &mut surface.vertices {
        *vertex *= unit.metres();
    }
    TriangleMesh::new(surface.vertices, surface.triangles).map_err(|error| match error {
        TriangleMeshError::Empty => MeshFileError::NoTriangles { path: path.to_owned() },
        TriangleMeshError::NonFiniteVertex(vertex) => {
            MeshFileError::NonFiniteVertex { path: path.to_owned(), vertex }
        }
        other => MeshFileError::Parse { path: path.to_owned(), reason: other.to_string() },
    })
}

/// Three single-precision coordinates as a point. The shortest decimals that stand for them are what was meant: 0.08, not
/// 0.0799999982, so that a face in a plane of the lattice is in it.
fn point(coordinates: [f32; 3]) -> DVec3 {
    DVec3::from_array(
        coordinates.map(|coordinate| coordinate.to_string().parse().unwrap_or(f64::from(coordinate))),
    )
}
