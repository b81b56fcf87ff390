//! The sensor at rest: a mesh, and which of its nodes are held at the potential of ground or of an electrode.

mod rim;

pub use rim::RimLink;

use crate::electrode::Electrode;
use crate::geometry::Aabb;
use crate::material::RelativePermittivity;
use crate::mesh::{InvalidAxis, Lattice, MeshError, TetMesh, graded_axis};
use glam::{DVec2, DVec3};
use rim::{Ground, Linked, Rim, rim_on_lattice, rims_of_sheets};

/// Everything that is held at one potential: ground is 0, electrodes follow in their order, then objects.
pub type Terminal = u16;

/// The terminal of the grounded wall.
pub const GROUND: Terminal = 0;

/// Marks a node whose potential is unknown.
pub const FREE: Terminal = Terminal::MAX;

/// Nodes closer to a plane than this part of the domain's size lie in it.
const IN_PLANE: f64 = 1e-9;

/// Growth of the lattice spacing per cell away from electrodes.
const LATTICE_GROWTH: f64 = 1.3;

/// Bisections of the lattice spacing: to 1e-6 of it. The count jumps there, and closer to the jump rounding would give
/// mirrored intervals different numbers of cells.
const SPACING_STEPS: usize = 24;

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
    /// A part of the mesh is connected to neither ground nor an electrode.
    #[error("the part of the mesh around node {node} reaches neither ground nor an electrode")]
    NoGroundReachable {
        /// A node of that part.
        node: u32,
    },
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

/// The board below the electrodes: its top is the plane z = 0, its centre the sensor's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substrate {
    /// Thickness in metres.
    pub thickness: f64,
    /// Relative permittivity of the board.
    pub relative_permittivity: RelativePermittivity,
    /// Extent along x and y in metres.
    pub size: DVec2,
    /// Whether its far side is a grounded shield plane.
    pub grounded_back: bool,
}

impl Substrate {
    /// The space the board takes.
    pub fn bounds(&self) -> Aabb {
        let half = 0.5 * self.size;
        Aabb { min: (-half).extend(-self.thickness), max: half.extend(0.0) }
    }

    /// Whether a point lies on the far side, give or take `slack` metres.
    pub fn is_on_back(&self, point: DVec3, slack: f64) -> bool {
        (point.z + self.thickness).abs() <= slack
            && (point.truncate().abs() - 0.5 * self.size).max_element() <= slack
    }
}

/// What a sensor is meant to be, before it has a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorDesign {
    /// The simulated space; its outer wall is grounded.
    pub domain: Aabb,
    /// Electrodes in the order of the capacitance matrix.
    pub electrodes: Vec<Electrode>,
    /// The board below them.
    pub substrate: Option<Substrate>,
}

impl SensorDesign {
    /// Checks what can be checked without a mesh.
    ///
    /// # Errors
    /// For an empty domain, no electrodes, names that repeat, unusable outlines, electrodes that touch the wall or
    /// lie outside, and a board that does not fit.
    pub fn validate(&self) -> Result<(), SensorError> {
        let Aabb { min, max } = self.domain;
        if !(min.is_finite() && max.is_finite() && min.cmplt(max).all()) {
            return Err(SensorError::Domain);
        }
        check_names(self.electrodes.iter().map(|electrode| electrode.name.as_str()))?;
        for electrode in &self.electrodes {
            self.check_place(electrode)?;
        }
        if let Some(board) = &self.substrate {
            let bounds = board.bounds();
            if !(board.thickness > 0.0 && board.size.min_element() > 0.0 && bounds.min.is_finite()) {
                return Err(SensorError::Substrate("must have a positive thickness and size"));
            }
            if !(self.domain.contains(bounds.min) && self.domain.contains(bounds.max)) {
                return Err(SensorError::Substrate("reaches out of the domain"));
            }
        }
        Ok(())
    }

    fn check_place(&self, electrode: &Electrode) -> Result<(), SensorError> {
        let name = || electrode.name.clone();
        if let Some(defect) = electrode.outline.defect() {
            return Err(SensorError::Outline { name: name(), defect });
        }
        if !electrode.z.is_finite() {
            return Err(SensorError::Outline { name: name(), defect: "is not finite" });
        }
        let [low, high] = electrode.outline.bounds().map(|corner| corner.extend(electrode.z));
        if !(self.domain.contains(low) && self.domain.contains(high)) {
            return Err(SensorError::OutsideDomain(name()));
        }
        let slack = IN_PLANE * self.domain.size().max_element();
        if (low - self.domain.min).min_element() <= slack || (self.domain.max - high).min_element() <= slack {
            return Err(SensorError::TouchesWall(name()));
        }
        Ok(())
    }

    /// The finest graded lattice of at most so many tetrahedra: electrode edges, electrode planes and the board lie
    /// in lattice planes, spacing is smallest there and grows away from them.
    ///
    /// # Errors
    /// When the design is invalid or even the coarsest lattice has more tetrahedra.
    pub fn lattice(&self, max_tets: usize) -> Result<Lattice, SensorError> {
        self.validate()?;
        let extent = self.domain.size().max_element();
        let build = |finest: f64| self.lattice_of_spacing(finest);
        let coarsest = build(extent)?;
        if coarsest.tet_count() > max_tets {
            return Err(SensorError::TooFewElements { allowed: max_tets, needed: coarsest.tet_count() });
        }
        // The count falls with the spacing (but for rounding): bisect on the logarithm of the spacing.
        let (mut fits, mut exceeds, mut best) = (extent, 1e-5 * extent, coarsest);
        for _ in 0..SPACING_STEPS {
            let middle = (fits * exceeds).sqrt();
            let lattice = build(middle)?;
            if lattice.tet_count() <= max_tets {
                fits = middle;
                if lattice.tet_count() > best.tet_count() {
                    best = lattice;
                }
            } else {
                exceeds = middle;
            }
        }
        Ok(best)
    }

    /// The graded lattice whose spacing at the electrodes is `finest` metres.
    ///
    /// # Errors
    /// When the coordinates are no lattice, as for a spacing that is not positive.
    pub fn lattice_of_spacing(&self, finest: f64) -> Result<Lattice, SensorError> {
        if finest.is_nan() || finest <= 0.0 {
            return Err(InvalidAxis { axis: 0 }.into());
        }
        let board = self.substrate.map(|board| board.bounds());
        let mut axes = [const { Vec::new() }; 3];
        for (axis, coordinates) in axes.iter_mut().enumerate() {
            let mut planes: Vec<f64> = board.iter().flat_map(|b| [b.min[axis], b.max[axis]]).collect();
            let mut fine = Vec::new();
            for electrode in &self.electrodes {
                if axis == 2 {
                    planes.push(electrode.z);
                } else {
                    planes.extend(electrode.outline.axis_planes(axis));
                    fine.extend(electrode.outline.fine_intervals(axis));
                }
            }
            let (low, high) = (self.domain.min[axis], self.domain.max[axis]);
            *coordinates = graded_axis(low, high, &planes, &fine, finest, LATTICE_GROWTH);
        }
        Ok(Lattice::new(axes)?)
    }
}

/// The nodes of one electrode of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum ElectrodeNodes {
    /// These nodes, as given by the mesh.
    Nodes(Vec<u32>),
    /// All nodes in the plane and outline of a thin electrode.
    Shape(Electrode),
}

/// A mesh and the terminals of its nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    mesh: TetMesh,
    lattice: Option<Lattice>,
    electrode_names: Vec<String>,
    terminals: Vec<Terminal>,
    /// The same with nodes at rims, which are free but linked to their electrode, counted as the electrode's.
    owners: Vec<Terminal>,
    rim: Vec<RimLink>,
    /// Thin electrodes by shape: their outlines may cut mesh edges. `None` for electrodes given by nodes.
    shapes: Vec<Option<Electrode>>,
    flat: f64,
}

impl Sensor {
    /// Builds the designed sensor on a lattice.
    ///
    /// # Errors
    /// As [`SensorDesign::validate`] and [`Sensor::on_mesh`].
    pub fn on_lattice(design: &SensorDesign, lattice: &Lattice) -> Result<Self, SensorError> {
        design.validate()?;
        let mut mesh = lattice.to_tet_mesh()?;
        let slack = IN_PLANE * design.domain.size().max_element();
        let on_wall = |node: DVec3| {
            (node - design.domain.min).min_element() <= slack
                || (design.domain.max - node).min_element() <= slack
        };
        let mut ground = nodes_where(&mesh, on_wall);
        if let Some(board) = &design.substrate {
            let bounds = board.bounds();
            let centroids: Vec<_> = (0..mesh.tets().len()).map(|element| mesh.centroid(element)).collect();
            let inside = board.relative_permittivity.value();
            mesh = mesh.with_permittivity(|e| if bounds.contains(centroids[e]) { inside } else { 1.0 })?;
            if board.grounded_back {
                ground.extend(nodes_where(&mesh, |node| board.is_on_back(node, slack)));
            }
        }
        let mut sensor = Self::without_electrodes(mesh, &ground)?;
        sensor.lattice = Some(lattice.clone());
        for (index, electrode) in design.electrodes.iter().enumerate() {
            let permittivity = sensor.mesh.relative_permittivity();
            let ground = Ground { lattice, permittivity, terminals: &sensor.terminals };
            let rim = rim_on_lattice(ground, electrode, slack);
            sensor.electrode_names.push(electrode.name.clone());
            sensor.shapes.push(Some(electrode.clone()));
            sensor.claim_with_rim(index, &electrode.name, &rim)?;
        }
        check_reachable(&sensor.mesh, &sensor.owners)?;
        Ok(sensor)
    }

    /// Takes a mesh, its grounded nodes, and its electrodes. A node that is grounded and on an electrode is the
    /// electrode's.
    ///
    /// # Errors
    /// When there are no electrodes, names repeat, an electrode owns no node or shares one with another, a node does
    /// not exist, or a part of the mesh reaches no terminal.
    pub fn on_mesh(
        mesh: TetMesh,
        ground: &[u32],
        electrodes: Vec<(String, ElectrodeNodes)>,
    ) -> Result<Self, SensorError> {
        check_names(electrodes.iter().map(|(name, _)| name.as_str()))?;
        let mut sensor = Self::without_electrodes(mesh, ground)?;
        let flat = sensor.flat;
        for (index, (name, nodes)) in electrodes.into_iter().enumerate() {
            let (nodes, shape) = match nodes {
                ElectrodeNodes::Nodes(nodes) => (nodes, None),
                ElectrodeNodes::Shape(shape) => {
                    (nodes_where(&sensor.mesh, |node| shape.owns(node, flat)), Some(shape))
                }
            };
            sensor.electrode_names.push(name.clone());
            sensor.shapes.push(shape);
            sensor.claim(index as Terminal + 1, &name, &nodes)?;
        }
        sensor.release_rims();
        check_reachable(&sensor.mesh, &sensor.owners)?;
        Ok(sensor)
    }

    fn without_electrodes(mesh: TetMesh, ground: &[u32]) -> Result<Self, SensorError> {
        let mut sensor = Self {
            terminals: vec![FREE; mesh.nodes().len()],
            owners: vec![FREE; mesh.nodes().len()],
            rim: Vec::new(),
            lattice: None,
            electrode_names: Vec::new(),
            shapes: Vec::new(),
            flat: IN_PLANE * mesh.bounds().size().max_element(),
            mesh,
        };
        for &node in ground {
            *sensor.owner_mut("ground", node)? = GROUND;
            sensor.terminals[node as usize] = GROUND;
        }
        Ok(sensor)
    }

    /// The same sensor with the nodes that lie within an electrode's outline held, as a mesh alone would have it: what
    /// links are compared with.
    #[must_use]
    pub fn with_rims_held(mut self) -> Self {
        let links = std::mem::take(&mut self.rim);
        for link in &links {
            self.owners[link.node as usize] = FREE;
        }
        for link in links.into_iter().filter(|link| link.inside) {
            self.owners[link.node as usize] = link.electrode + 1;
        }
        self.terminals.clone_from(&self.owners);
        self
    }

    /// The same sensor, of which it no longer is known that its mesh is a lattice: what operators are compared with.
    #[must_use]
    pub fn off_lattice(mut self) -> Self {
        self.lattice = None;
        self.shapes.fill(None);
        self
    }

    /// Gives an electrode the nodes that it holds and those at its rim. Where another electrode holds a node, there is no
    /// link.
    fn claim_with_rim(&mut self, index: usize, name: &str, rim: &Rim) -> Result<(), SensorError> {
        let terminal = index as Terminal + 1;
        // Within a narrow outline all nodes may be at the rim.
        if rim.held.is_empty() && !rim.linked.iter().any(|linked| linked.inside) {
            return Err(SensorError::OwnsNoNode(name.to_owned()));
        }
        if !rim.held.is_empty() {
            self.claim(terminal, name, &rim.held)?;
        }
        for &Linked { node, weight, inside } in &rim.linked {
            let owner = self.owner_mut(name, node)?;
            if *owner == FREE {
                *owner = terminal;
            }
            self.rim.push(RimLink { node, electrode: index as u16, weight, inside });
        }
        let terminals = &self.terminals;
        self.rim.retain(|link| terminals[link.node as usize] == FREE);
        Ok(())
    }

    /// Frees the nodes at the rims of sheets and links them.
    fn release_rims(&mut self) {
        self.rim = rims_of_sheets(&self.mesh, &self.owners);
        for link in &self.rim {
            self.terminals[link.node as usize] = FREE;
        }
    }

    fn claim(&mut self, terminal: Terminal, name: &str, nodes: &[u32]) -> Result<(), SensorError> {
        if nodes.is_empty() {
            return Err(SensorError::OwnsNoNode(name.to_owned()));
        }
        for &node in nodes {
            let held = self.terminals.get(node as usize).copied();
            let owner = self.owner_mut(name, node)?;
            match *owner {
                other if other == terminal => {}
                // At the rim of another electrode.
                other if other != GROUND && held == Some(FREE) => *owner = terminal,
                FREE | GROUND => *owner = terminal,
                other => {
                    return Err(SensorError::SharedNode {
                        first: self.electrode_names[usize::from(other) - 1].clone(),
                        second: name.to_owned(),
                        node,
                    });
                }
            }
            self.terminals[node as usize] = terminal;
        }
        Ok(())
    }

    fn owner_mut(&mut self, name: &str, node: u32) -> Result<&mut Terminal, SensorError> {
        let nodes = self.owners.len();
        self.owners.get_mut(node as usize).ok_or_else(|| SensorError::NodeOutOfRange {
            name: name.to_owned(),
            node,
            nodes,
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// The lattice that the mesh was made from, if it was: its nodes are the mesh's, in the same order.
    pub fn lattice(&self) -> Option<&Lattice> {
        self.lattice.as_ref()
    }

    /// Names of the electrodes in the order of the capacitance matrix.
    pub fn electrode_names(&self) -> &[String] {
        &self.electrode_names
    }

    /// What holds the potential of each node: [`GROUND`], 1 and up for electrodes, or [`FREE`]. Nodes at the rims of thin
    /// electrodes are free.
    pub fn terminals(&self) -> &[Terminal] {
        &self.terminals
    }

    /// The same with nodes at the rims of thin electrodes counted as the electrode's, which no object can take.
    pub fn owners(&self) -> &[Terminal] {
        &self.owners
    }

    /// Links between nodes at the rims of thin electrodes and their electrode.
    pub fn rim(&self) -> &[RimLink] {
        &self.rim
    }

    /// The part of an edge that lies outside the electrode which one of its ends belongs to, when the edge lies in the
    /// plane of a thin electrode and crosses its outline.
    pub fn outside_part_of_edge(&self, [a, b]: [u32; 2]) -> Option<f64> {
        if self.lattice.is_some() && !self.rim.is_empty() {
            // There, links do it.
            return None;
        }
        let owner = |node: u32| match self.terminals[node as usize] {
            GROUND | FREE => None,
            electrode => Some(usize::from(electrode) - 1),
        };
        let (electrode, outside, inside) = match (owner(a), owner(b)) {
            (None, Some(electrode)) => (electrode, a, b),
            (Some(electrode), None) => (electrode, b, a),
            _ => return None,
        };
        let shape = self.shapes[electrode].as_ref()?;
        let outside = self.mesh.nodes()[outside as usize];
        let inside = self.mesh.nodes()[inside as usize];
        ((outside.z - shape.z).abs() <= self.flat)
            .then(|| shape.outline.outside_part(outside.truncate(), inside.truncate()))
    }
}

fn nodes_where(mesh: &TetMesh, holds: impl Fn(DVec3) -> bool) -> Vec<u32> {
    mesh.nodes().iter().zip(0..).filter(|(node, _)| holds(**node)).map(|(_, index)| index).collect()
}

fn check_names<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), SensorError> {
    let mut sorted: Vec<&str> = names.collect();
    sorted.sort_unstable();
    if sorted.is_empty() {
        return Err(SensorError::NoElectrodes);
    }
    if sorted.len() > usize::from(FREE) / 2 {
        return Err(SensorError::TooManyElectrodes(sorted.len()));
    }
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(SensorError::DuplicateName(pair[0].to_owned())),
        None => Ok(()),
    }
}

/// Spreads from all nodes that have an owner along elements and looks for nodes that were not reached.
fn check_reachable(mesh: &TetMesh, terminals: &[Terminal]) -> Result<(), SensorError> {
    let mut parent: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    fn root(parent: &mut [u32], mut node: u32) -> u32 {
        while parent[node as usize] != node {
            parent[node as usize] = parent[parent[node as usize] as usize];
            node = parent[node as usize];
        }
        node
    }
    for tet in mesh.tets() {
        let first = root(&mut parent, tet[0]);
        for &node in &tet[1..] {
            let other = root(&mut parent, node);
            parent[other as usize] = first;
        }
    }
    let mut grounded = vec![false; parent.len()];
    for (node, &terminal) in terminals.iter().enumerate() {
        if terminal != FREE {
            let root = root(&mut parent, node as u32);
            grounded[root as usize] = true;
        }
    }
    let lost = (0..parent.len() as u32).find(|&node| !grounded[root(&mut parent, node) as usize]);
    lost.map_or(Ok(()), |node| Err(SensorError::NoGroundReachable { node }))
}
