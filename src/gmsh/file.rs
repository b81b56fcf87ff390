//! What a Gmsh file holds: nodes, triangles, tetrahedra and physical groups, and what the simulator asks of them.

use super::error::{GmshError, kind};
use super::{Defects, Encoding, faces};
use capsense_core::mesh::{MeshError, TetMesh};
use capsense_core::units::LengthUnit;
use glam::DVec3;
use std::fmt;

/// Version of the file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormatVersion {
    /// 2.2, the legacy format many programs write.
    V2_2,
    /// 4.1, current since Gmsh 4.1.
    V4_1,
}

impl fmt::Display for FormatVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::V2_2 => "2.2",
            Self::V4_1 => "4.1",
        })
    }
}

/// A triangle (N = 3) or a tetrahedron (N = 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element<const N: usize> {
    /// Its number in the file.
    pub tag: u64,
    /// Indices into [`GmshFile::nodes`], in the order of the file; of inverted tetrahedra the last two are swapped.
    pub nodes: [u32; N],
    pub(super) label: u32,
}

/// A named or numbered set of elements of one dimension.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhysicalGroup {
    /// 0 to 3 for points, curves, surfaces, volumes.
    pub dimension: u8,
    /// Its number, unique within the dimension.
    pub tag: i32,
    /// Its name, if `$PhysicalNames` has one.
    pub name: Option<String>,
}

impl fmt::Display for PhysicalGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "physical {} {}", kind(self.dimension), self.tag)?;
        match &self.name {
            Some(name) => write!(f, " \"{name}\""),
            None => Ok(()),
        }
    }
}

/// How a physical group is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GroupKey {
    /// By name; text that is no group's name but a number means that number.
    Name(String),
    /// By number.
    Number(i32),
}

impl From<&str> for GroupKey {
    fn from(name: &str) -> Self {
        Self::Name(name.to_owned())
    }
}

impl From<i32> for GroupKey {
    fn from(number: i32) -> Self {
        Self::Number(number)
    }
}

impl fmt::Display for GroupKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => write!(f, "\"{name}\""),
            Self::Number(number) => write!(f, "{number}"),
        }
    }
}

/// The surface of the tetrahedra against the labelled triangles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SurfaceSummary {
    /// Faces of exactly one tetrahedron.
    pub boundary_faces: usize,
    /// Those of them that are no triangle of a physical group.
    pub unlabelled_boundary_faces: usize,
    /// Those of these whose nodes all are nodes of one physical surface.
    pub enclosed_boundary_faces: usize,
    /// Tags of triangles in a physical group that are no face of any tetrahedron: a defect of the mesh.
    pub detached_triangles: Vec<u64>,
}

/// A Gmsh file, mended where it was defective. Nodes and tetrahedra keep the order of the file, and
/// [`GmshFile::to_tet_mesh`] keeps it too: an index here is an index there, and `node_tags` and [`Element::tag`] lead
/// back to the numbers in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct GmshFile {
    /// Version of the format.
    pub version: FormatVersion,
    /// How the numbers were written.
    pub encoding: Encoding,
    /// Positions in the unit of the file.
    pub nodes: Vec<DVec3>,
    /// The tag of each node.
    pub node_tags: Vec<u64>,
    /// Triangles, in a physical group or not.
    pub triangles: Vec<Element<3>>,
    /// Tetrahedra, in a physical group or not.
    pub tets: Vec<Element<4>>,
    /// Physical groups of every dimension, by dimension and number.
    pub groups: Vec<PhysicalGroup>,
    /// What was mended.
    pub defects: Defects,
    /// The lists of physical tags that [`Element::label`] numbers.
    pub(super) labels: Vec<Vec<i32>>,
}

impl GmshFile {
    /// Numbers of the physical groups an element is in, ascending; none for an unlabelled element.
    pub fn groups_of<const N: usize>(&self, element: &Element<N>) -> &[i32] {
        self.labels.get(element.label as usize).map_or(&[], Vec::as_slice)
    }

    /// Finds a physical group among those of the given dimensions.
    ///
    /// # Errors
    /// When there is none, or one in several of these dimensions.
    pub fn group(&self, key: impl Into<GroupKey>, among: &[u8]) -> Result<&PhysicalGroup, GmshError> {
        let key = key.into();
        let candidates = || self.groups.iter().filter(|group| among.contains(&group.dimension));
        let numbered = |number| candidates().filter(|group| group.tag == number).collect::<Vec<_>>();
        let found = match &key {
            GroupKey::Number(number) => numbered(*number),
            GroupKey::Name(name) => {
                let named: Vec<_> = candidates().filter(|group| group.name.as_ref() == Some(name)).collect();
                match name.parse() {
                    Ok(number) if named.is_empty() => numbered(number),
                    _ => named,
                }
            }
        };
        match found[..] {
            [group] => Ok(group),
            [] => {
                let known = candidates().cloned().collect();
                Err(GmshError::NoSuchGroup { key, among: among.to_vec(), known })
            }
            _ => Err(GmshError::AmbiguousGroup(key)),
        }
    }

    /// Indices of the nodes of a surface or volume, ascending: what an electrode or the ground takes from the mesh.
    ///
    /// # Errors
    /// When no surface or volume has that name or number, both have, or it has no elements.
    pub fn nodes_of(&self, key: impl Into<GroupKey>) -> Result<Vec<u32>, GmshError> {
        self.group_nodes(self.group(key, &[2, 3])?)
    }

    /// Indices of the nodes of a surface or volume, ascending.
    ///
    /// # Errors
    /// When it has no triangles or tetrahedra; points and curves never have any.
    pub fn group_nodes(&self, group: &PhysicalGroup) -> Result<Vec<u32>, GmshError> {
        let mut nodes: Vec<u32> = match group.dimension {
            2 => self.members(&self.triangles, group.tag).flat_map(|(_, triangle)| triangle.nodes).collect(),
            3 => self.members(&self.tets, group.tag).flat_map(|(_, tet)| tet.nodes).collect(),
            _ => Vec::new(),
        };
        if nodes.is_empty() {
            return Err(GmshError::EmptyGroup(group.clone()));
        }
        nodes.sort_unstable();
        nodes.dedup();
        Ok(nodes)
    }

    /// Indices of the triangles of a surface, ascending.
    ///
    /// # Errors
    /// When no surface has that name or number, or it has no triangles.
    pub fn triangles_of(&self, key: impl Into<GroupKey>) -> Result<Vec<u32>, GmshError> {
        self.indices(key, 2, &self.triangles)
    }

    /// Indices of the tetrahedra of a volume, ascending.
    ///
    /// # Errors
    /// When no volume has that name or number, or it has no tetrahedra.
    pub fn tets_of(&self, key: impl Into<GroupKey>) -> Result<Vec<u32>, GmshError> {
        self.indices(key, 3, &self.tets)
    }

    fn indices<const N: usize>(
        &self,
        key: impl Into<GroupKey>,
        dimension: u8,
        elements: &[Element<N>],
    ) -> Result<Vec<u32>, GmshError> {
        let group = self.group(key, &[dimension])?;
        let indices: Vec<u32> = self.members(elements, group.tag).map(|(index, _)| index as u32).collect();
        if indices.is_empty() { Err(GmshError::EmptyGroup(group.clone())) } else { Ok(indices) }
    }

    /// The elements in a physical group of their dimension.
    fn members<'a, const N: usize>(
        &'a self,
        elements: &'a [Element<N>],
        group: i32,
    ) -> impl Iterator<Item = (usize, &'a Element<N>)> {
        let wanted: Vec<bool> = self.labels.iter().map(|list| list.contains(&group)).collect();
        let is_member = move |label: u32| wanted.get(label as usize).copied().unwrap_or(false);
        elements.iter().enumerate().filter(move |(_, element)| is_member(element.label))
    }

    /// Compares the surface of the tetrahedra with the labelled triangles.
    ///
    /// # Errors
    /// When more than two tetrahedra share a face.
    pub fn surface_summary(&self) -> Result<SurfaceSummary, GmshError> {
        let all = self.faces()?;
        let mut labelled: Vec<([u32; 3], u64)> = self
            .triangles
            .iter()
            .filter(|triangle| triangle.label != 0)
            .map(|triangle| (faces::key(triangle.nodes), triangle.tag))
            .collect();
        labelled.sort_unstable();
        let groups = self.surfaces_at_nodes();
        let mut summary = SurfaceSummary::default();
        for same in faces::groups(&all).filter(|same| same.len() == 1) {
            let [a, b, c] = same[0].key.map(|node| &groups[node as usize]);
            summary.boundary_faces += 1;
            if labelled.binary_search_by_key(&same[0].key, |entry| entry.0).is_err() {
                summary.unlabelled_boundary_faces += 1;
                let is_enclosed = a.iter().any(|group| b.contains(group) && c.contains(group));
                summary.enclosed_boundary_faces += usize::from(is_enclosed);
            }
        }
        let detached = labelled
            .iter()
            .filter(|(key, _)| all.binary_search_by_key(key, |face| face.key).is_err())
            .map(|&(_, tag)| tag);
        summary.detached_triangles =
            self.defects.detached_triangles.iter().copied().chain(detached).collect();
        summary.detached_triangles.sort_unstable();
        Ok(summary)
    }

    /// The physical surfaces that each node is on.
    fn surfaces_at_nodes(&self) -> Vec<Vec<i32>> {
        let mut groups = vec![Vec::new(); self.nodes.len()];
        for triangle in &self.triangles {
            for &group in self.groups_of(triangle) {
                for node in triangle.nodes {
                    let of_node: &mut Vec<i32> = &mut groups[node as usize];
                    if !of_node.contains(&group) {
                        of_node.push(group);
                    }
                }
            }
        }
        groups
    }

    /// All faces in order, of which no more than two are the same.
    fn faces(&self) -> Result<Vec<faces::Face>, GmshError> {
        let all = faces::sorted(self.tets.iter().map(|tet| tet.nodes));
        let crowded = faces::groups(&all).find(|same| same.len() > 2);
        if let Some(&[a, b, c, ..]) = crowded {
            return Err(GmshError::SharedFace([a, b, c].map(|face| self.tet_tag(face.tet))));
        }
        Ok(all)
    }

    fn tet_tag(&self, index: usize) -> u64 {
        self.tets.get(index).map_or(0, |tet| tet.tag)
    }

    /// The mesh in metres; node and tetrahedron indices stay what they are here.
    ///
    /// # Errors
    /// When there are no tetrahedra, or more than two share a face.
    pub fn to_tet_mesh(&self, unit: LengthUnit) -> Result<TetMesh, GmshError> {
        let nodes = self.nodes.iter().map(|&node| node * unit.metres()).collect();
        let tets = self.tets.iter().map(|tet| tet.nodes).collect();
        let mesh = TetMesh::new(nodes, tets).map_err(|error| match error {
            MeshError::Empty => GmshError::NoTets,
            other => GmshError::Mesh(other),
        })?;
        self.faces()?;
        Ok(mesh)
    }
}
