//! The sensor at rest: a mesh, and which of its nodes are held at the potential of ground or of an electrode.

mod design;
mod dual_lengths;
mod error;
mod generated;
mod grading;
mod lattices;
mod rim;
mod wall;

pub use design::{SensorDesign, Substrate};
pub(crate) use dual_lengths::DualLengths;
pub use error::SensorError;
pub use generated::MeshKind;
pub use rim::RimLink;
pub use wall::Wall;
pub(crate) use wall::{OpenWall, WallEdge};

use crate::electrode::Electrode;
use crate::mesh::{Lattice, TetMesh};
use design::check_names;
use glam::DVec3;
use rim::{Ground, Linked, Rim, RimEdge, rim_of_cut, rim_on_lattice, rims_of_sheets};
use std::collections::BTreeMap;
use wall::{WallFace, nodes_of, outer_faces, reaching_out};

/// Everything that is held at one potential: ground is 0, electrodes follow in their order, then objects.
pub type Terminal = u16;

/// The terminal of the grounded wall.
pub const GROUND: Terminal = 0;

/// Marks a node whose potential is unknown.
pub const FREE: Terminal = Terminal::MAX;

/// Nodes closer to a plane than this part of the domain's size lie in it.
const IN_PLANE: f64 = 1e-9;

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
    /// Of a lattice, also once it is no longer known to be one.
    dual_lengths: Option<DualLengths>,
    electrode_names: Vec<String>,
    terminals: Vec<Terminal>,
    /// The same with nodes at rims, which are free but linked to their electrode, counted as the electrode's.
    owners: Vec<Terminal>,
    rim: Vec<RimLink>,
    rim_edges: Vec<RimEdge>,
    /// Thin electrodes by shape: their outlines may cut mesh edges. `None` for electrodes given by nodes.
    shapes: Vec<Option<Electrode>>,
    flat: f64,
    /// `None` where the wall is grounded.
    open_wall: Option<OpenWall>,
}

impl Sensor {
    /// Builds the designed sensor on a lattice. A shield that reaches an open wall stays grounded up to there.
    ///
    /// # Errors
    /// As [`SensorDesign::validate`] and [`Sensor::on_mesh`].
    pub fn on_lattice(design: &SensorDesign, lattice: &Lattice) -> Result<Self, SensorError> {
        design.validate()?;
        let slack = IN_PLANE * design.domain.size().max_element();
        let (mesh, ground) = design.with_ground_and_board(lattice.to_tet_mesh()?)?;
        let mut sensor = Self::without_electrodes(mesh, &ground)?;
        let dual_lengths = DualLengths::matched(lattice, sensor.mesh.relative_permittivity().is_uniform());
        sensor.lattice = Some(lattice.clone());
        for (index, electrode) in design.electrodes.iter().enumerate() {
            let permittivity = sensor.mesh.relative_permittivity();
            let of = |dual_lengths| {
                let ground = Ground { lattice, dual_lengths, permittivity, terminals: &sensor.terminals };
                rim_on_lattice(ground, electrode, slack)
            };
            let rim = of(Some(&dual_lengths)).with_elements_of(&of(None));
            sensor.electrode_names.push(electrode.name.clone());
            sensor.shapes.push(Some(electrode.clone()));
            sensor.claim_with_rim(index, &electrode.name, &rim)?;
        }
        sensor.dual_lengths = Some(dual_lengths);
        if design.wall == Wall::Open {
            let is_on_wall: Vec<bool> =
                sensor.mesh.nodes().iter().map(|&node| design.is_on_wall(node)).collect();
            sensor.open(&outer_faces(&sensor.mesh, &is_on_wall));
        }
        sensor.rim.shrink_to_fit();
        sensor.rim_edges.shrink_to_fit();
        sensor.check_reachable()?;
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
        Self::on_mesh_within(Wall::Grounded, mesh, ground, electrodes)
    }

    /// The same within a wall that may be open: then the mesh's outer faces are not grounded where all their nodes are
    /// given as grounded. What lies within, and the surfaces of holes, stay grounded.
    ///
    /// # Errors
    /// As [`Sensor::on_mesh`], and when there is no such face.
    pub fn on_mesh_within(
        wall: Wall,
        mesh: TetMesh,
        ground: &[u32],
        electrodes: Vec<(String, ElectrodeNodes)>,
    ) -> Result<Self, SensorError> {
        check_names(electrodes.iter().map(|(name, _)| name.as_str()))?;
        let mut sensor = Self::without_electrodes(mesh, ground)?;
        let outer = match wall {
            Wall::Grounded => Vec::new(),
            Wall::Open => sensor.release_wall()?,
        };
        let flat = sensor.flat;
        for (index, (name, nodes)) in electrodes.into_iter().enumerate() {
            sensor.electrode_names.push(name.clone());
            let (nodes, shape, rim) = match nodes {
                ElectrodeNodes::Nodes(nodes) => (nodes, None, None),
                ElectrodeNodes::Shape(shape) => match rim_of_cut(&sensor.mesh, &shape, flat) {
                    Some(rim) => (Vec::new(), None, Some(sensor.with_ground_held(rim))),
                    None => {
                        let nodes = nodes_where(&sensor.mesh, |node| shape.owns(node, flat));
                        (nodes, Some(shape), None)
                    }
                },
            };
            sensor.shapes.push(shape);
            match rim {
                Some(rim) => sensor.claim_with_rim(index, &name, &rim)?,
                None => sensor.claim(index as Terminal + 1, &name, &nodes)?,
            }
        }
        sensor.release_rims();
        if wall == Wall::Open {
            sensor.open(&outer);
        }
        sensor.check_reachable()?;
        Ok(sensor)
    }

    fn without_electrodes(mesh: TetMesh, ground: &[u32]) -> Result<Self, SensorError> {
        let mut sensor = Self {
            terminals: vec![FREE; mesh.nodes().len()],
            owners: vec![FREE; mesh.nodes().len()],
            rim: Vec::new(),
            rim_edges: Vec::new(),
            lattice: None,
            dual_lengths: None,
            electrode_names: Vec::new(),
            shapes: Vec::new(),
            flat: IN_PLANE * mesh.bounds().size().max_element(),
            open_wall: None,
            mesh,
        };
        for &node in ground {
            *sensor.owner_mut("ground", node)? = GROUND;
            sensor.terminals[node as usize] = GROUND;
        }
        Ok(sensor)
    }

    /// Takes the nodes of outer faces that are all grounded from ground, and returns these faces.
    fn release_wall(&mut self) -> Result<Vec<WallFace>, SensorError> {
        let is_grounded: Vec<bool> = self.terminals.iter().map(|&terminal| terminal == GROUND).collect();
        let faces = reaching_out(&self.mesh, outer_faces(&self.mesh, &is_grounded), self.flat);
        if faces.is_empty() {
            return Err(SensorError::NoWall);
        }
        for (node, _) in nodes_of(&faces, self.owners.len()).into_iter().enumerate().filter(|(_, is)| *is) {
            self.owners[node] = FREE;
            self.terminals[node] = FREE;
        }
        Ok(faces)
    }

    /// Opens the wall, its nodes already free.
    fn open(&mut self, faces: &[WallFace]) {
        self.open_wall = Some(OpenWall::new(&self.mesh, &self.owners, faces));
    }

    /// The same sensor with the nodes that lie within an electrode's outline held, those of an open wall grounded, and weights those
    /// of linear elements, as a mesh alone would have it: what links are compared with.
    #[must_use]
    pub fn with_rims_held(mut self) -> Self {
        self.dual_lengths = None;
        self.rim_edges.clear();
        for (node, _) in self.open_wall.take().into_iter().flat_map(|wall| wall.links) {
            let owner = &mut self.owners[node as usize];
            if *owner == FREE {
                *owner = GROUND;
            }
        }
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

    /// The same sensor with the links at the rims of each electrode weighing so many times as much: one factor for each
    /// electrode, positive.
    ///
    /// # Panics
    /// When there are fewer factors than electrodes that have links.
    #[must_use]
    pub(crate) fn with_rims_weighed(mut self, factors: &[f64]) -> Self {
        for link in &mut self.rim {
            let factor = factors[usize::from(link.electrode)];
            link.weight *= factor;
            link.of_elements *= factor;
        }
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
        for &Linked { node, weight, of_elements, inside, covered, rows } in &rim.linked {
            let owner = self.owner_mut(name, node)?;
            if *owner == FREE {
                *owner = terminal;
            }
            let electrode = index as u16;
            self.rim.push(RimLink { node, electrode, weight, of_elements, inside, covered, rows });
        }
        let terminals = &self.terminals;
        self.rim.retain(|link| terminals[link.node as usize] == FREE);
        self.rim_edges.extend(&rim.edges);
        self.rim_edges.retain(|edge| terminals[edge.node as usize] == FREE);
        Ok(())
    }

    /// The rim with its grounded nodes within the outline held: they are the electrode's.
    fn with_ground_held(&self, mut rim: Rim) -> Rim {
        let grounded = |linked: &Linked| self.terminals[linked.node as usize] == GROUND;
        rim.held.extend(
            rim.linked.iter().filter(|linked| linked.inside && grounded(linked)).map(|linked| linked.node),
        );
        rim
    }

    /// Frees the nodes at the rims of sheets and links them. Electrodes that have links keep them.
    fn release_rims(&mut self) {
        let mut linked = vec![false; self.electrode_names.len()];
        self.rim.iter().for_each(|link| linked[usize::from(link.electrode)] = true);
        let has_links = |owner: Terminal| owner != GROUND && owner != FREE && linked[usize::from(owner) - 1];
        let unlinked = self.owners.iter().map(|&owner| if has_links(owner) { FREE } else { owner });
        let links = rims_of_sheets(&self.mesh, &unlinked.collect::<Vec<_>>());
        for link in &links {
            self.terminals[link.node as usize] = FREE;
        }
        self.rim.extend(links);
    }

    /// Each part of the mesh needs a terminal, and, unless that is ground or the wall is open, another one.
    fn check_reachable(&self) -> Result<(), SensorError> {
        for (node, terminal, has_another) in terminals_of_parts(&self.mesh, &self.owners) {
            let Some(terminal) = terminal else {
                let position = self.mesh.nodes()[node as usize].to_array();
                return Err(SensorError::NoGroundReachable { node, position });
            };
            if terminal != GROUND && !has_another && self.open_wall.is_none() {
                let name = self.electrode_names[usize::from(terminal) - 1].clone();
                return Err(SensorError::Alone(name));
            }
        }
        Ok(())
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

    /// What the dual lengths of a lattice's planes across an axis (0, 1, 2 for x, y, z) are multiplied by, as spacing grows: one factor
    /// for each plane, near 1. `None` where edges have the weights of linear elements.
    pub fn dual_lengths(&self, axis: usize) -> Option<&[f64]> {
        self.dual_lengths.as_ref().map(|lengths| lengths.of_axis(axis))
    }

    /// What the weight of an edge between two nodes of a lattice is multiplied by, as spacing grows.
    pub(crate) fn dual_area_of_edge(&self, ends: [u32; 2]) -> f64 {
        self.dual_lengths.as_ref().map_or(1.0, |lengths| lengths.of_edge(ends))
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

    /// What lies beyond the outer wall.
    pub fn wall(&self) -> Wall {
        if self.open_wall.is_some() { Wall::Open } else { Wall::Grounded }
    }

    /// What stands for the space beyond the wall if that is open.
    pub(crate) fn open_wall(&self) -> Option<&OpenWall> {
        self.open_wall.as_ref()
    }

    /// Terminals of the rows that follow those of the nodes, before those of objects: all electrodes, then ground, where links
    /// lead to it.
    pub(crate) fn held_rows(&self) -> impl Iterator<Item = Terminal> + Clone {
        (1..=self.electrode_names.len() as Terminal).chain(self.open_wall.iter().map(|_| GROUND))
    }

    /// Links between nodes at the rims of thin electrodes and their electrode.
    pub fn rim(&self) -> &[RimLink] {
        &self.rim
    }

    /// How many times as much edges weigh that lead out of thin electrodes as elsewhere, each once: between two electrodes it is the
    /// mean of what both make of it.
    pub(crate) fn rim_edges(&self) -> BTreeMap<[u32; 2], f64> {
        let mut edges: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for &RimEdge { node, outside, factor } in &self.rim_edges {
            let ends = [node.min(outside), node.max(outside)];
            edges.entry(ends).and_modify(|other| *other = 0.5 * (*other + factor)).or_insert(factor);
        }
        edges
    }

    /// The part of an edge that lies outside the electrode which one of its ends belongs to, when the edge lies in the
    /// plane of a thin electrode and crosses its outline.
    pub fn outside_part_of_edge(&self, [a, b]: [u32; 2]) -> Option<f64> {
        if self.lattice.is_some() && !self.rim.is_empty() {
            // There, links do it.
            return None;
        }
        // Nodes at a rim that edges follow are free, but lie within the outline.
        let owner = |node: u32| match self.owners[node as usize] {
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

/// A terminal of each part of a mesh, and whether there is another.
fn terminals_of_parts(mesh: &TetMesh, terminals: &[Terminal]) -> Vec<(u32, Option<Terminal>, bool)> {
    let mut parent: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    fn root(parent: &mut [u32], mut node: u32) -> u32 {
        while parent[node as usize] != node {
            parent[node as usize] = parent[parent[node as usize] as usize];
            node = parent[node as usize];
        }
        node
    }
    for tet in mesh.tets().iter() {
        let first = root(&mut parent, tet[0]);
        for &node in &tet[1..] {
            let other = root(&mut parent, node);
            parent[other as usize] = first;
        }
    }
    let mut place_of = vec![usize::MAX; parent.len()];
    let mut parts: Vec<(u32, Option<Terminal>, bool)> = Vec::new();
    for (node, &terminal) in (0..).zip(terminals) {
        let place = &mut place_of[root(&mut parent, node) as usize];
        if *place == usize::MAX {
            *place = parts.len();
            parts.push((node, None, false));
        }
        let (_, first, has_another) = &mut parts[*place];
        match *first {
            _ if terminal == FREE => {}
            None => *first = Some(terminal),
            Some(first) => *has_another |= first != terminal,
        }
    }
    parts
}
