//! How the surface of an object changes a mesh that knows nothing of it.

/// An interface model.
///
/// Measured against a sphere of exact field, in a mesh of a few cells to its radius: `docs/interface.md`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interface {
    /// Surfaces cut mesh edges. Along an edge the parts in air and in dielectrics are capacitors in series, and a
    /// conductor ends the edge where its surface is (the ghost-fluid idea of Gibou, Fedkiw et al.). Continuous in the
    /// pose, and by far the most exact.
    #[default]
    EdgeCut,
    /// An element belongs as a whole to the object that its centroid lies in: the model of the CapSense paper. With a
    /// depth camera the depth at the centroid's own pixel counts, without interpolation. Capacitances move in steps.
    Centroid,
    /// The permittivity of an element is the mean over its volume, so that for dielectrics capacitances are continuous
    /// in the pose. A conductor cannot be mixed with air: where conductors fill half of an element or more, the element
    /// belongs to the one that fills most of it, and what is less counts as if it were not there.
    VolumeFraction,
}

impl Interface {
    /// The name in scene files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::EdgeCut => "edge-cut",
            Self::Centroid => "centroid",
            Self::VolumeFraction => "volume-fraction",
        }
    }
}
