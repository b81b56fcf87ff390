//! Why a frame cannot be drawn.

use crate::tessellate::TessellateError;

/// Why a renderer cannot be made or a frame cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The view has no pixels, or its domain is empty or not finite.
    #[error("cannot draw a view of {width}x{height} pixels over {size:?} m: every extent must be positive")]
    InvalidView {
        /// Pixel columns.
        width: usize,
        /// Pixel rows.
        height: usize,
        /// Edge lengths of the domain in metres.
        size: [f64; 3],
    },
    /// A shape cannot be turned into triangles.
    #[error("object {object}: {source}")]
    Shape {
        /// Index of the object.
        object: usize,
        /// What is wrong with its shape.
        source: TessellateError,
    },
    /// An object is none of those that are found as solids.
    #[error(
        "object {object} is a triangle mesh and no box; a graphics adapter finds boxes, spheres, capsules and cylinders \
         as solids"
    )]
    NotConvex {
        /// Index of the object.
        object: usize,
    },
    /// There are more or fewer poses than objects.
    #[error("{poses} poses for {objects} objects")]
    PoseCount {
        /// Number of poses given.
        poses: usize,
        /// Number of objects in the scene.
        objects: usize,
    },
    /// A pose is not finite or its rotation not of unit length.
    #[error("the pose of object {object} is not a finite translation with a unit quaternion")]
    InvalidPose {
        /// Index of the object.
        object: usize,
    },
    /// There is neither a GPU nor a software implementation of Vulkan.
    #[error("no graphics adapter: {0} (a software one comes with the package mesa-vulkan-drivers)")]
    NoAdapter(String),
    /// The only adapter is a software one, and those were excluded.
    #[error("the only graphics adapter is the software one `{0}`")]
    OnlySoftwareAdapter(String),
    /// The adapter would not open, or cannot do what is needed.
    #[error("the graphics adapter `{adapter}` cannot be used: {reason}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// What the driver said, or what is missing.
        reason: String,
    },
    /// The image or a mesh is larger than the adapter can take.
    #[error("{what} is {needed}, but the graphics adapter allows at most {limit}")]
    LimitExceeded {
        /// What is too large.
        what: &'static str,
        /// How much is needed.
        needed: u64,
        /// How much there may be.
        limit: u64,
    },
    /// The adapter's memory does not suffice.
    #[error("the graphics adapter has no room for {needed} bytes of {what}")]
    OutOfMemory {
        /// What there is no room for.
        what: &'static str,
        /// Bytes that were asked for.
        needed: u64,
    },
    /// The driver refused a command or lost the device. The renderer is of no further use.
    #[error("the graphics driver failed while {doing}: {reason}")]
    Driver {
        /// What was being done.
        doing: &'static str,
        /// What the driver said.
        reason: String,
    },
}

impl RenderError {
    /// The same of an object of this number, where it is about one that was looked at alone.
    pub(crate) fn of_object(self, object: usize) -> Self {
        match self {
            Self::Shape { source, .. } => Self::Shape { object, source },
            other => other,
        }
    }
}
