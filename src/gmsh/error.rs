//! Why a Gmsh file is refused, and where in the file.

use super::{GroupKey, PhysicalGroup};
use capsense_core::mesh::MeshError;
use glam::DVec3;
use std::fmt;

/// A place in a file: a line of a text file, a byte of a binary one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// Line of an ASCII file, counted from 1.
    Line(usize),
    /// Byte of a binary file, counted from 0.
    Byte(usize),
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Why a Gmsh file is refused. Nodes and elements are named by the tags they have in the file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GmshError {
    /// The first section is not `$MeshFormat`: another kind of file, or the format 1 of before 2005.
    #[error("not a Gmsh file of format 2.2 or 4.1: it does not begin with $MeshFormat")]
    NotGmsh,
    /// A version of the format other than 2.2 and 4.1.
    #[error("{at}: Gmsh format {version} is not supported; save the mesh in format 2.2 or 4.1")]
    Version {
        /// Where it stands.
        at: At,
        /// The version as written.
        version: String,
    },
    /// Numbers of a size this version of the format does not have.
    #[error("{at}: data size {size} is not supported (8 in format 2.2, 4 or 8 in format 4.1)")]
    DataSize {
        /// Where it stands.
        at: At,
        /// Bytes per number, as written.
        size: u64,
    },
    /// The integer 1 at the head of a binary file is 1 in neither byte order.
    #[error("{at}: the byte-order marker of the binary file is not 1")]
    ByteOrder {
        /// Where it stands.
        at: At,
    },
    /// The file stops inside a section.
    #[error("{at}: the file ends where {expected} should be: it is cut off")]
    UnexpectedEnd {
        /// Its end.
        at: At,
        /// What is missing.
        expected: &'static str,
    },
    /// A section is never closed.
    #[error("{at}: section ${section} has no $End{section}")]
    Unterminated {
        /// Where it begins.
        at: At,
        /// Its name without `$`.
        section: String,
    },
    /// Something other than what the format asks for.
    #[error("{at}: expected {expected}, found `{found}`")]
    Unexpected {
        /// Where it stands.
        at: At,
        /// What the format asks for.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A count larger than the rest of the file can hold.
    #[error("{at}: {claimed} {what} are announced, more than the rest of the file can hold")]
    Count {
        /// Where the count stands.
        at: At,
        /// What is counted.
        what: &'static str,
        /// The count.
        claimed: u64,
    },
    /// The blocks of a section do not add up to the total in its head.
    #[error("{at}: {claimed} {what} are announced, but the blocks hold {found}")]
    Total {
        /// Where the total stands.
        at: At,
        /// What is counted.
        what: &'static str,
        /// The total.
        claimed: u64,
        /// Sum over the blocks, as far as they were read.
        found: u64,
    },
    /// A section without which there is no mesh.
    #[error("the file has no section ${0}; is it cut off?")]
    MissingSection(&'static str),
    /// A section that must come earlier.
    #[error("{at}: section ${section} must stand {rule}")]
    Order {
        /// Where the section begins.
        at: At,
        /// The section that came too early or too late.
        section: &'static str,
        /// Where it belongs.
        rule: &'static str,
    },
    /// Two names for one physical group.
    #[error("{at}: physical group {tag} of dimension {dimension} is named twice")]
    NamedTwice {
        /// Where the second name stands.
        at: At,
        /// 0 to 3 for points, curves, surfaces, volumes.
        dimension: u8,
        /// Number of the group.
        tag: i32,
    },
    /// A coordinate that is NaN, infinite, or absurdly large.
    #[error("{at}: node {node} has a coordinate that is not finite or larger than 1e12")]
    NonFinite {
        /// Where its coordinates begin.
        at: At,
        /// Tag of the node.
        node: u64,
    },
    /// Two nodes with one tag.
    #[error("{at}: node {node} is defined twice, in different places")]
    DuplicateNode {
        /// Where the second one stands.
        at: At,
        /// Tag of both.
        node: u64,
    },
    /// An element with a node that is not in `$Nodes`.
    #[error("{at}: element {element} names node {node}, which is not in the file")]
    UnknownNode {
        /// Where the element stands.
        at: At,
        /// Tag of the element.
        element: u64,
        /// Tag of the missing node.
        node: u64,
    },
    /// An element that is no point, line, triangle or tetrahedron.
    #[error(
        "{at}: element {element} is a {name} (Gmsh element type {number}); \
         only triangles and tetrahedra are supported: mesh without recombination and extruded layers"
    )]
    ElementType {
        /// Where the element stands.
        at: At,
        /// Tag of the element.
        element: u64,
        /// Number of the element type.
        number: i64,
        /// What that type is.
        name: &'static str,
    },
    /// Three tetrahedra that meet in one face.
    #[error(
        "tetrahedra {}, {} and {} (Gmsh element tags) share one face, so two of them overlap; \
         make one volume of those that overlap (in Gmsh: Coherence or BooleanFragments)",
        .0[0], .0[1], .0[2]
    )]
    SharedFace([u64; 3]),
    /// There is nothing to solve on.
    #[error(
        "the file has no tetrahedra; mesh the volume, and if there are physical groups, put it into one: \
         Gmsh saves nothing else"
    )]
    NoTets,
    /// The four nodes of an element lie in one plane.
    #[error(
        "{at}: tetrahedron {element} has no volume; remesh around {:?} (in the unit of the file), \
         in Gmsh with Mesh.Optimize", .centre.to_array()
    )]
    Flat {
        /// Where it stands.
        at: At,
        /// Tag of the element.
        element: u64,
        /// Its centre in the unit of the file.
        centre: DVec3,
    },
    /// Any other defect of the mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// No physical group of that name or number.
    #[error("there is no physical group {key} among the {}; there are {}", kinds(.among), list(.known))]
    NoSuchGroup {
        /// What was asked for.
        key: GroupKey,
        /// Dimensions that were searched.
        among: Vec<u8>,
        /// All groups of these dimensions.
        known: Vec<PhysicalGroup>,
    },
    /// A name or number that several of the groups have.
    #[error("physical group {0} is ambiguous: several surfaces or volumes have that name or number")]
    AmbiguousGroup(GroupKey),
    /// A physical group without triangles or tetrahedra.
    #[error("{0} has no elements with nodes in tetrahedra; is it part of the mesh of the volume?")]
    EmptyGroup(PhysicalGroup),
}

fn kinds(among: &[u8]) -> String {
    let names: Vec<_> = among.iter().map(|&dimension| kind(dimension)).collect();
    names.join("s and ") + "s"
}

fn list(groups: &[PhysicalGroup]) -> String {
    if groups.is_empty() {
        return "none".to_owned();
    }
    let names: Vec<_> = groups.iter().map(ToString::to_string).collect();
    names.join(", ")
}

/// What a physical group of that dimension is made of.
pub(super) fn kind(dimension: u8) -> &'static str {
    match dimension {
        0 => "point",
        1 => "curve",
        2 => "surface",
        _ => "volume",
    }
}
