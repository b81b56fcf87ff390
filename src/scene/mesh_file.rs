//! Sensors on meshes from Gmsh files: which groups are ground, electrodes and board, and whether the unit fits.

use super::SceneSensor;
use super::check::Checker;
use super::design;
use super::raw::{RawGroup, RawScene};
use super::source::SceneError;
use crate::gmsh::{self, GmshError, GmshFile, GroupKey};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::mesh::{TetMesh, places};
use capsense_core::sensor::{ElectrodeNodes, SensorDesign, Wall};
use std::collections::HashSet;

/// A mesh whose largest extent is outside of these metres was read in the wrong unit.
const PLAUSIBLE_EXTENT: std::ops::RangeInclusive<f64> = 5e-3..=50.0;

/// A mesh may differ from the stated domain by this part of its extent.
const DOMAIN_SLACK: f64 = 0.01;

/// Nodes closer to a plane than this part of the extent lie in it.
const IN_PLANE: f64 = 1e-6;

/// Reads the mesh file that a scene names.
pub(super) fn sensor(
    check: Checker<'_>,
    raw: &RawScene,
    file: &str,
    names: &[String],
    warnings: &mut Vec<String>,
) -> Result<(Aabb, SceneSensor), SceneError> {
    let refused = |error: GmshError| check.source.error("mesh.file", format!("`{file}`: {error}"));
    let unit = check.unit("mesh.unit", raw.mesh.unit.as_deref())?;
    let gmsh = gmsh::parse(&check.read("mesh.file", file)?).map_err(refused)?;
    let mesh = gmsh.to_tet_mesh(unit).map_err(refused)?;
    let domain = domain(check, raw, &mesh, &unit.to_string())?;
    let groups = Groups { check, raw, gmsh: &gmsh };
    groups.check_keys(names)?;
    let mut ground = groups.nodes("ground", &GroupKey::from("ground"))?;
    let electrodes = groups.electrodes(names, domain, file, warnings)?;
    let mesh = groups.with_board(mesh, &mut ground)?;
    groups.warn(file, &ground, &electrodes, warnings).map_err(refused)?;
    Ok((domain, sorted_in_space(&mesh, &ground, electrodes)))
}

/// The numbers of the file served to find groups; from here on frames get the order in which they are fastest.
fn sorted_in_space(mesh: &TetMesh, ground: &[u32], electrodes: Vec<(String, ElectrodeNodes)>) -> SceneSensor {
    let order = mesh.order_in_space();
    let place = places(&order);
    let moved = |nodes: &[u32]| -> Vec<u32> {
        let mut nodes: Vec<u32> = nodes.iter().map(|&node| place[node as usize]).collect();
        nodes.sort_unstable();
        nodes
    };
    let electrode = |(name, nodes)| match nodes {
        ElectrodeNodes::Nodes(nodes) => (name, ElectrodeNodes::Nodes(moved(&nodes))),
        shape @ ElectrodeNodes::Shape(_) => (name, shape),
    };
    SceneSensor::Meshed {
        mesh: mesh.renumbered(&order),
        ground: moved(ground),
        electrodes: electrodes.into_iter().map(electrode).collect(),
    }
}

fn domain(check: Checker<'_>, raw: &RawScene, mesh: &TetMesh, unit: &str) -> Result<Aabb, SceneError> {
    let bounds = mesh.bounds();
    let extent = bounds.size().max_element();
    if !PLAUSIBLE_EXTENT.contains(&extent) {
        let message = format!("the mesh is {extent:.6} m large when its unit is `{unit}`: check mesh.unit");
        return check.error("mesh.unit", message);
    }
    let Some(stated) = design::domain(check, &raw.domain)? else {
        return Ok(bounds);
    };
    let apart = |a: DVec3, b: DVec3| (a - b).abs().max_element();
    if apart(stated.min, bounds.min).max(apart(stated.max, bounds.max)) > DOMAIN_SLACK * extent {
        let message = format!(
            "the mesh reaches from {:?} to {:?} m when its unit is `{unit}`, which is not this domain: check mesh.unit",
            bounds.min.to_array(),
            bounds.max.to_array()
        );
        return check.error("domain", message);
    }
    Ok(bounds)
}

/// The physical groups of a mesh file, under the names the scene gives them.
struct Groups<'a> {
    check: Checker<'a>,
    raw: &'a RawScene,
    gmsh: &'a GmshFile,
}

impl Groups<'_> {
    /// Every name in `mesh.groups` must be known.
    fn check_keys(&self, electrodes: &[String]) -> Result<(), SceneError> {
        let known = |name: &String| name == "ground" || name == "substrate" || electrodes.contains(name);
        match self.raw.mesh.groups.iter().flatten().find(|(name, _)| !known(name)) {
            Some((name, _)) => self.check.error(
                &format!("mesh.groups.{name}"),
                format!("no electrode is named `{name}` (and it is neither `ground` nor `substrate`)"),
            ),
            None => Ok(()),
        }
    }

    /// The group that the scene maps a name to, if it does.
    fn mapped(&self, name: &str) -> Result<Option<GroupKey>, SceneError> {
        match self.raw.mesh.groups.as_ref().and_then(|groups| groups.get(name)) {
            None => Ok(None),
            Some(RawGroup::Name(group)) => Ok(Some(GroupKey::Name(group.clone()))),
            Some(RawGroup::Number(number)) => match i32::try_from(*number) {
                Ok(number) => Ok(Some(GroupKey::Number(number))),
                Err(_) => {
                    self.check.error(&format!("mesh.groups.{name}"), format!("{number} is no group's number"))
                }
            },
        }
    }

    /// Nodes of the group that a name is mapped to, or of the `default` one.
    fn nodes(&self, name: &str, default: &GroupKey) -> Result<Vec<u32>, SceneError> {
        let group = self.mapped(name)?.unwrap_or_else(|| default.clone());
        self.gmsh
            .nodes_of(group)
            .or_else(|error| self.check.error(&format!("mesh.groups.{name}"), error.to_string()))
    }

    fn electrodes(
        &self,
        names: &[String],
        domain: Aabb,
        file: &str,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(String, ElectrodeNodes)>, SceneError> {
        let mut electrodes = Vec::with_capacity(names.len());
        for (index, (name, raw)) in names.iter().zip(&self.raw.sensor.electrode).enumerate() {
            let key = format!("sensor.electrode[{index}]");
            let shape = design::electrode(self.check, &key, raw)?;
            let is_group = |group: &gmsh::PhysicalGroup| {
                group.dimension >= 2 && group.name.as_deref() == Some(name.as_str())
            };
            let nodes = if self.mapped(name)?.is_some() || self.gmsh.groups.iter().any(is_group) {
                if shape.is_some() {
                    let message = "is a group of the mesh; its shape in the scene is ignored";
                    warnings.push(format!("{}: electrode `{name}` {message}", self.check.source.file()));
                }
                ElectrodeNodes::Nodes(self.nodes(name, &GroupKey::Name(name.clone()))?)
            } else if let Some(shape) = shape {
                // What the core checks of an electrode in a domain, it checks here too.
                let design = SensorDesign {
                    domain,
                    electrodes: vec![shape.clone()],
                    substrate: None,
                    wall: Wall::Grounded,
                };
                design.validate().map_err(|error| design::locate(self.check.source, names, &error))?;
                ElectrodeNodes::Shape(shape)
            } else {
                let groups: Vec<String> = self.gmsh.groups.iter().map(ToString::to_string).collect();
                let message =
                    format!("has no shape, and `{file}` no group `{name}`; there are {}", groups.join(", "));
                return self.check.error(&key, message);
            };
            electrodes.push((name.clone(), nodes));
        }
        self.check_apart(&electrodes)?;
        Ok(electrodes)
    }

    /// Electrodes that are groups must not share nodes.
    fn check_apart(&self, electrodes: &[(String, ElectrodeNodes)]) -> Result<(), SceneError> {
        const NONE: usize = usize::MAX;
        let mut owner = vec![NONE; self.gmsh.nodes.len()];
        for (index, (name, nodes)) in electrodes.iter().enumerate() {
            let ElectrodeNodes::Nodes(nodes) = nodes else { continue };
            let is_shared = |&&node: &&u32| owner[node as usize] != NONE;
            if let Some(&node) = nodes.iter().find(is_shared) {
                let (other, _) = &electrodes[owner[node as usize]];
                let count = nodes.iter().filter(is_shared).count();
                let tag = self.gmsh.node_tags[node as usize];
                return self.check.error(
                    &format!("sensor.electrode[{index}]"),
                    format!(
                        "the groups of `{other}` and `{name}` share mesh nodes: {count}, such as {tag} (Gmsh node tag)"
                    ),
                );
            }
            nodes.iter().for_each(|&node| owner[node as usize] = index);
        }
        Ok(())
    }

    /// Gives the board its permittivity, and grounds its back if it is a shield.
    fn with_board(&self, mesh: TetMesh, ground: &mut Vec<u32>) -> Result<TetMesh, SceneError> {
        let group = self.mapped("substrate")?;
        let Some(raw) = &self.raw.sensor.substrate else {
            return match group {
                Some(_) => self.check.error("mesh.groups.substrate", "needs `sensor.substrate`"),
                None => Ok(mesh),
            };
        };
        let board = design::substrate(self.check, raw)?;
        let bounds = board.bounds();
        let elements = mesh.tets().len();
        let inside: Vec<bool> = match group {
            Some(group) => {
                let members = self
                    .gmsh
                    .tets_of(group)
                    .or_else(|error| self.check.error("mesh.groups.substrate", error.to_string()))?;
                let members: HashSet<usize> = members.into_iter().map(|element| element as usize).collect();
                (0..elements).map(|element| members.contains(&element)).collect()
            }
            None => (0..elements).map(|element| bounds.contains(mesh.centroid(element))).collect(),
        };
        if !inside.contains(&true) {
            return self.check.error("sensor.substrate", "no element of the mesh lies in it");
        }
        if board.grounded_back {
            let slack = IN_PLANE * mesh.bounds().size().max_element();
            let nodes = mesh.nodes().iter().zip(0u32..);
            let back = nodes.filter(|(node, _)| board.is_on_back(**node, slack));
            let before = ground.len();
            ground.extend(back.map(|(_, index)| index));
            if ground.len() == before {
                let message = "no node of the mesh lies on the back of the board";
                return self.check.error("sensor.substrate.back", message);
            }
        }
        let permittivity = board.relative_permittivity.value();
        mesh.with_permittivity(|element| if inside[element] { permittivity } else { 1.0 })
            .or_else(|error| self.check.error("sensor.substrate", error.to_string()))
    }

    /// What is odd about the mesh but no error.
    fn warn(
        &self,
        file: &str,
        ground: &[u32],
        electrodes: &[(String, ElectrodeNodes)],
        warnings: &mut Vec<String>,
    ) -> Result<(), GmshError> {
        warnings.extend(mesh_warnings(self.gmsh)?.into_iter().map(|warning| format!("{file}: {warning}")));
        let ground: HashSet<u32> = ground.iter().copied().collect();
        for (name, nodes) in electrodes {
            let ElectrodeNodes::Nodes(nodes) = nodes else { continue };
            let shared = nodes.iter().filter(|node| ground.contains(node)).count();
            if shared > 0 {
                let message = "in the groups of ground and of electrode";
                warnings
                    .push(format!("{file}: {shared} nodes are {message} `{name}`; they are the electrode's"));
            }
        }
        Ok(())
    }
}

/// What is odd about a mesh and the labels of its surface, but no error.
///
/// # Errors
/// When more than two tetrahedra share a face.
pub fn mesh_warnings(gmsh: &GmshFile) -> Result<Vec<String>, GmshError> {
    let summary = gmsh.surface_summary()?;
    let mut warnings = gmsh.defects.messages();
    let is_in_group = !gmsh.triangles.iter().all(|triangle| gmsh.groups_of(triangle).is_empty());
    if !is_in_group && !gmsh.triangles.is_empty() {
        warnings.push(
            "no triangle is in a physical group; in format 2.2, Gmsh's Mesh.SaveAll drops all groups"
                .to_owned(),
        );
    }
    let (unlabelled, enclosed) = (summary.unlabelled_boundary_faces, summary.enclosed_boundary_faces);
    if unlabelled > 0 {
        let mut warning =
            format!("{unlabelled} of {} boundary faces are in no group; ", summary.boundary_faces);
        if enclosed > 0 {
            warning += &format!("{enclosed} of them count as part of the group that has all their nodes; ");
        }
        warning += match unlabelled - enclosed {
            0 => "none is left open",
            _ if enclosed > 0 => "no field passes through the others (natural condition)",
            _ => "no field passes through them (natural condition)",
        };
        warnings.push(warning);
    }
    if let Some(first) = summary.detached_triangles.first() {
        warnings.push(format!(
            "{} labelled triangles, such as {first}, are no face of any tetrahedron",
            summary.detached_triangles.len()
        ));
    }
    Ok(warnings)
}
