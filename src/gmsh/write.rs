//! Writing a mesh with its groups as Gmsh format 4.1 ASCII (Gmsh reference manual, "MSH file format").
//!
//! Elements carry no physical tags in this format, entities do. So elements with the same set of groups become one
//! discrete entity, and a triangle or tetrahedron may be in several groups.

use capsense_core::geometry::Aabb;
use capsense_core::mesh::TetMesh;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};

/// Triangles under one name, such as an electrode or the ground.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceGroup<'a> {
    /// Name of the physical group.
    pub name: &'a str,
    /// Node indices of each triangle; they should be faces of tetrahedra.
    pub triangles: &'a [[u32; 3]],
}

/// Tetrahedra under one name, such as the substrate.
#[derive(Clone, Copy, Debug)]
pub struct VolumeGroup<'a> {
    /// Name of the physical group.
    pub name: &'a str,
    /// Indices of the tetrahedra.
    pub tets: &'a [u32],
}

/// Why groups cannot be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// A name that the format cannot hold.
    #[error("group name {0:?} must be 1 to 127 bytes without double quotes and control characters")]
    Name(String),
    /// A name that two groups have.
    #[error("two groups are named \"{0}\"")]
    DuplicateName(String),
    /// A group names a node that does not exist.
    #[error("group \"{group}\" names node {node}, but the mesh has {nodes}")]
    NodeOutOfRange {
        /// Name of the group.
        group: String,
        /// The node.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A group names a tetrahedron that does not exist.
    #[error("group \"{group}\" names tetrahedron {tet}, but the mesh has {tets}")]
    TetOutOfRange {
        /// Name of the group.
        group: String,
        /// The tetrahedron.
        tet: u32,
        /// Number of tetrahedra.
        tets: usize,
    },
}

/// Gmsh reads names into a buffer of 128 bytes.
const LONGEST_NAME: usize = 127;

/// The text of a Gmsh 4.1 ASCII file with lengths in metres. Surface groups are numbered from 1 in the order given,
/// volume groups after them, nodes from 1 in the order of the mesh; triangles come before tetrahedra.
///
/// # Errors
/// When a name is empty, too long, not printable or given twice, or a group names a node or tetrahedron that does
/// not exist.
pub fn write(
    mesh: &TetMesh,
    surfaces: &[SurfaceGroup<'_>],
    volumes: &[VolumeGroup<'_>],
) -> Result<String, WriteError> {
    check(mesh, surfaces, volumes)?;
    let surface_entities = surface_entities(surfaces);
    let volume_entities = volume_entities(mesh, volumes, surfaces.len());
    let mut text = String::new();
    // Writing into a `String` cannot fail.
    let _ = sections(&mut text, mesh, surfaces, volumes, &surface_entities, &volume_entities);
    Ok(text)
}

fn check(
    mesh: &TetMesh,
    surfaces: &[SurfaceGroup<'_>],
    volumes: &[VolumeGroup<'_>],
) -> Result<(), WriteError> {
    let mut names = BTreeSet::new();
    for name in surfaces.iter().map(|group| group.name).chain(volumes.iter().map(|group| group.name)) {
        let is_printable = !name.contains(|c: char| c == '"' || c.is_control());
        if name.is_empty() || name.len() > LONGEST_NAME || !is_printable {
            return Err(WriteError::Name(name.to_owned()));
        }
        if !names.insert(name) {
            return Err(WriteError::DuplicateName(name.to_owned()));
        }
    }
    let (nodes, tets) = (mesh.nodes().len(), mesh.tets().len());
    for group in surfaces {
        if let Some(&node) = group.triangles.iter().flatten().find(|&&node| node as usize >= nodes) {
            return Err(WriteError::NodeOutOfRange { group: group.name.to_owned(), node, nodes });
        }
    }
    for group in volumes {
        if let Some(&tet) = group.tets.iter().find(|&&tet| tet as usize >= tets) {
            return Err(WriteError::TetOutOfRange { group: group.name.to_owned(), tet, tets });
        }
    }
    Ok(())
}

/// Elements that are in the same groups.
struct Entity<const N: usize> {
    groups: Vec<usize>,
    elements: Vec<[u32; N]>,
}

fn surface_entities(surfaces: &[SurfaceGroup<'_>]) -> Vec<Entity<3>> {
    // By sorted nodes, so that a triangle of two groups is one triangle whatever its orientation.
    let mut groups_of: BTreeMap<[u32; 3], ([u32; 3], Vec<usize>)> = BTreeMap::new();
    for (group, surface) in surfaces.iter().enumerate() {
        for &triangle in surface.triangles {
            let (_, groups) =
                groups_of.entry(super::faces::key(triangle)).or_insert_with(|| (triangle, Vec::new()));
            if groups.last() != Some(&(group + 1)) {
                groups.push(group + 1);
            }
        }
    }
    by_groups(groups_of.into_values())
}

fn volume_entities(mesh: &TetMesh, volumes: &[VolumeGroup<'_>], offset: usize) -> Vec<Entity<4>> {
    let mut groups_of = vec![Vec::new(); mesh.tets().len()];
    for (group, volume) in volumes.iter().enumerate() {
        let tag = offset + group + 1;
        for &tet in volume.tets {
            let groups = &mut groups_of[tet as usize];
            if groups.last() != Some(&tag) {
                groups.push(tag);
            }
        }
    }
    by_groups(mesh.tets().iter().zip(groups_of))
}

fn by_groups<const N: usize>(elements: impl Iterator<Item = ([u32; N], Vec<usize>)>) -> Vec<Entity<N>> {
    let mut entities: BTreeMap<Vec<usize>, Vec<[u32; N]>> = BTreeMap::new();
    for (element, groups) in elements {
        entities.entry(groups).or_default().push(element);
    }
    entities.into_iter().map(|(groups, elements)| Entity { groups, elements }).collect()
}

fn sections(
    out: &mut String,
    mesh: &TetMesh,
    surfaces: &[SurfaceGroup<'_>],
    volumes: &[VolumeGroup<'_>],
    surface_entities: &[Entity<3>],
    volume_entities: &[Entity<4>],
) -> fmt::Result {
    out.push_str("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n");
    writeln!(out, "{}", surfaces.len() + volumes.len())?;
    let names = surfaces.iter().map(|group| (2, group.name));
    let names = names.chain(volumes.iter().map(|group| (3, group.name)));
    for (tag, (dimension, name)) in (1..).zip(names) {
        writeln!(out, "{dimension} {tag} \"{name}\"")?;
    }
    out.push_str("$EndPhysicalNames\n$Entities\n");
    writeln!(out, "0 0 {} {}", surface_entities.len(), volume_entities.len())?;
    entities(out, mesh, surface_entities)?;
    entities(out, mesh, volume_entities)?;
    out.push_str("$EndEntities\n$Nodes\n");
    nodes(out, mesh, surface_entities, volume_entities)?;
    out.push_str("$EndNodes\n$Elements\n");
    let blocks = surface_entities.len() + volume_entities.len();
    let triangles: usize = surface_entities.iter().map(|entity| entity.elements.len()).sum();
    let total = triangles + mesh.tets().len();
    writeln!(out, "{blocks} {total} 1 {total}")?;
    elements(out, surface_entities, 2, 2, 1)?;
    elements(out, volume_entities, 3, 4, 1 + triangles)?;
    out.push_str("$EndElements\n");
    Ok(())
}

/// tag, bounding box, physical tags, no bounding entities.
fn entities<const N: usize>(out: &mut String, mesh: &TetMesh, entities: &[Entity<N>]) -> fmt::Result {
    for (tag, entity) in (1..).zip(entities) {
        let corners = entity.elements.iter().flatten().map(|&node| mesh.nodes()[node as usize]);
        let Aabb { min, max } = Aabb::around(corners);
        write!(out, "{tag} {:?} {:?} {:?} {:?} {:?} {:?}", min.x, min.y, min.z, max.x, max.y, max.z)?;
        write!(out, " {}", entity.groups.len())?;
        for group in &entity.groups {
            write!(out, " {group}")?;
        }
        out.push_str(" 0\n");
    }
    Ok(())
}

/// A block of nodes for each entity. Every node stands once: with the first surface that uses it, or else with the
/// first volume. Within a block tags ascend.
fn nodes(
    out: &mut String,
    mesh: &TetMesh,
    surface_entities: &[Entity<3>],
    volume_entities: &[Entity<4>],
) -> fmt::Result {
    let mut is_placed = vec![false; mesh.nodes().len()];
    let mut blocks = Vec::new();
    for (tag, entity) in (1..).zip(surface_entities) {
        blocks.push((2, tag, unplaced(&entity.elements, &mut is_placed)));
    }
    for (tag, entity) in (1..).zip(volume_entities) {
        blocks.push((3, tag, unplaced(&entity.elements, &mut is_placed)));
    }
    let count = mesh.nodes().len();
    writeln!(out, "{} {count} 1 {count}", blocks.len())?;
    for (dimension, tag, nodes) in blocks {
        writeln!(out, "{dimension} {tag} 0 {}", nodes.len())?;
        for node in &nodes {
            writeln!(out, "{}", node + 1)?;
        }
        for &node in &nodes {
            let position = mesh.nodes()[node as usize];
            writeln!(out, "{:?} {:?} {:?}", position.x, position.y, position.z)?;
        }
    }
    Ok(())
}

fn unplaced<const N: usize>(elements: &[[u32; N]], is_placed: &mut [bool]) -> Vec<u32> {
    let mut nodes = Vec::new();
    for &node in elements.iter().flatten() {
        if !std::mem::replace(&mut is_placed[node as usize], true) {
            nodes.push(node);
        }
    }
    nodes.sort_unstable();
    nodes
}

fn elements<const N: usize>(
    out: &mut String,
    entities: &[Entity<N>],
    dimension: usize,
    element_type: usize,
    first: usize,
) -> fmt::Result {
    let mut element_tag = first;
    for (tag, entity) in (1..).zip(entities) {
        writeln!(out, "{dimension} {tag} {element_type} {}", entity.elements.len())?;
        for element in &entity.elements {
            write!(out, "{element_tag}")?;
            for node in element {
                write!(out, " {}", node + 1)?;
            }
            out.push('\n');
            element_tag += 1;
        }
    }
    Ok(())
}
