//! What can be wrong with the design of a sensor, with its lattice, and with a mesh and the terminals of its nodes.

use crate::mesh::{InvalidAxis, MeshError};

/// Why a sensor cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SensorError {
    /// There is nothing to measure.
    #[error("the sensor has no electrodes")]
    NoElectrodes,
    /// More electrodes than terminals can be numbered.
    #[error("{0} electrodes are more than can be numbered")]
    TooManyElectrodes(usize),
    /// Two electrodes have the same name.
    #[error("two electrodes are named `{0}`")]
    DuplicateName(String),
    /// An outline encloses no usable area.
    #[error("the outline of electrode `{name}` {defect}")]
    Outline {
        /// Name of the electrode.
        name: String,
        /// What is wrong with it.
        defect: &'static str,
    },
    /// An electrode reaches out of the domain.
    #[error("electrode `{0}` lies outside the domain")]
    OutsideDomain(String),
    /// An electrode touches the grounded wall; its capacitance would be infinite.
    #[error("electrode `{0}` touches the grounded wall: its capacitance would be infinite")]
    TouchesWall(String),
    /// Two electrodes in one plane that overlap or touch.
    #[error("electrodes `{first}` and `{second}` overlap or touch: their capacitance would be infinite")]
    Meet {
        /// The electrode listed first.
        first: String,
        /// The other one.
        second: String,
    },
    /// No node of the mesh lies on an electrode.
    #[error("electrode `{0}` owns no node of the mesh; is it smaller than the mesh around it?")]
    OwnsNoNode(String),
    /// Two electrodes claim one node.
    #[error("electrodes `{first}` and `{second}` share mesh node {node}")]
    SharedNode {
        /// The electrode listed first.
        first: String,
        /// The other one.
        second: String,
        /// Index of the node.
        node: u32,
    },
    /// A node that does not exist.
    #[error("terminal `{name}` names node {node}, but the mesh has only {nodes}")]
    NodeOutOfRange {
        /// Name of the terminal.
        name: String,
        /// The node it names.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A mesh without a wall that could be open.
    #[error("no outer face of the mesh is grounded, so there is no wall to open")]
    NoWall,
    /// A part of the mesh is connected to neither ground nor an electrode.
    #[error("the part of the mesh around {position:?} m reaches neither ground nor an electrode")]
    NoGroundReachable {
        /// A node of that part.
        node: u32,
        /// Where it is, in metres.
        position: [f64; 3],
    },
    /// An electrode to which a part of the mesh is all its own.
    #[error(
        "electrode `{0}` is alone in its part of the mesh: without ground or another electrode it has no capacitance"
    )]
    Alone(String),
    /// The substrate is not a board inside the domain.
    #[error("the substrate {0}")]
    Substrate(&'static str),
    /// The domain is empty or not finite.
    #[error("the domain must be finite and have a volume")]
    Domain,
    /// A lattice that keeps all electrode edges in its planes needs more elements than allowed.
    #[error("no lattice of at most {allowed} tetrahedra resolves the electrodes: the coarsest has {needed}")]
    TooFewElements {
        /// How many were asked for at most.
        allowed: usize,
        /// How many the coarsest lattice has.
        needed: usize,
    },
    /// The lattice's coordinates are unusable.
    #[error(transparent)]
    Lattice(#[from] InvalidAxis),
    /// The mesh is unusable.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
