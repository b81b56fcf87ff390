//! What the worker computed last, as far as it is drawn: snapshots of a pipeline that are cheap to clone.

use super::static_scene::{NO_EDGE, StaticScene};
use capsense::{Pipeline, Scene};
use capsense_core::geometry::Pose;
use capsense_core::material::Material;
use capsense_core::occupancy::{Coupling, DepthLayers, NO_OBJECT, Occupancy};
use capsense_core::simulator::Simulator;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Where a body is asked to stand.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyPose {
    /// What it is called.
    pub name: String,
    /// Its origin in the sensor frame, metres.
    pub position: DVec3,
    /// Its orientation, of unit length.
    pub rotation: DQuat,
}

impl BodyPose {
    /// A body at a pose.
    pub fn new(name: impl Into<String>, pose: &Pose) -> Self {
        Self { name: name.into(), position: pose.translation, rotation: pose.rotation }
    }

    /// Its pose.
    pub fn pose(&self) -> Pose {
        Pose { translation: self.position, rotation: self.rotation }
    }
}

/// What is drawn of one computed frame.
#[derive(Clone, Debug)]
pub struct Frame3d {
    pub(super) scene: Arc<StaticScene>,
    pub(super) computed: Arc<Computed>,
}

impl Frame3d {
    /// Elements that objects occupy.
    pub fn occupied_elements(&self) -> impl ExactSizeIterator<Item = usize> {
        self.computed.occupied.iter().map(|&(element, _)| element as usize)
    }

    /// Elements of which an edge or a corner is another than in the frame before.
    pub fn changed_elements(&self) -> impl ExactSizeIterator<Item = usize> {
        self.computed.changed.iter().map(|&(element, _)| element as usize)
    }

    /// The nodes at either end of the edges that surfaces of objects cut.
    pub fn cut_edges(&self) -> &[[u32; 2]] {
        &self.computed.cut
    }

    /// The potential of each node in volts with one electrode at 1 V; empty if there is no such electrode.
    pub fn potentials(&self, electrode: usize) -> &[f32] {
        self.computed.potentials.get(electrode).map_or(&[], Vec::as_slice)
    }
}

/// An element and the object it belongs to, or [`NO_OBJECT`].
pub(super) type OwnedElement = (u32, u16);

/// What differs from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Computed {
    /// Of each node, as [`Occupancy::conductors`].
    pub(super) holders: Vec<u16>,
    pub(super) occupied: Vec<OwnedElement>,
    pub(super) changed: Vec<OwnedElement>,
    pub(super) cut: Vec<[u32; 2]>,
    /// Of each node, for each electrode.
    pub(super) potentials: Vec<Vec<f32>>,
    pub(super) depth: Option<DepthLayers>,
}

/// Makes snapshots of a pipeline; what never changes is taken from it once.
#[derive(Debug)]
pub struct Frame3dBuilder {
    scene: Arc<StaticScene>,
    materials: Vec<Material>,
    /// Working storage, by edge: the part of it that lies in objects.
    inside: Vec<f32>,
    changed: Vec<bool>,
    potentials: Vec<f64>,
}

impl Frame3dBuilder {
    /// Takes what never changes in a scene: mesh, sensor and the surfaces of bodies.
    pub fn new(scene: &Scene, pipeline: &Pipeline) -> Self {
        let simulator = pipeline.simulator();
        let edges = simulator.matrix().network().edges().len();
        Self {
            scene: Arc::new(StaticScene::new(scene, simulator)),
            materials: scene.objects.iter().map(|object| object.material).collect(),
            inside: vec![0.0; edges],
            changed: vec![false; edges],
            potentials: Vec::new(),
        }
    }

    /// What the pipeline computed last. It costs a walk over the elements.
    pub fn snapshot(&mut self, pipeline: &Pipeline) -> Frame3d {
        let simulator = pipeline.simulator();
        let occupancy = simulator.occupancy();
        let mut computed = Computed {
            holders: occupancy.conductors().to_vec(),
            depth: pipeline.layers().cloned(),
            potentials: self.potentials(simulator),
            ..Computed::default()
        };
        self.look_at_edges(simulator, &mut computed.cut);
        self.look_at_elements(occupancy, &mut computed);
        Frame3d { scene: self.scene.clone(), computed: Arc::new(computed) }
    }

    fn potentials(&mut self, simulator: &Simulator) -> Vec<Vec<f32>> {
        (0..simulator.capacitance().size())
            .map(|electrode| {
                // Of a device that failed there are none, which the next frame tells.
                match simulator.potentials(electrode, &mut self.potentials) {
                    Ok(()) => self.potentials.iter().map(|&volts| volts as f32).collect(),
                    Err(_) => Vec::new(),
                }
            })
            .collect()
    }

    /// Finds what part of each edge lies in objects, and the edges that surfaces cut.
    fn look_at_edges(&mut self, simulator: &Simulator, cut: &mut Vec<[u32; 2]>) {
        let (occupancy, network) = (simulator.occupancy(), simulator.matrix().network());
        let holders = occupancy.conductors();
        self.changed.fill(false);
        occupancy.changed_edges().iter().for_each(|&edge| self.changed[edge as usize] = true);
        for (edge, coupling) in occupancy.couplings().enumerate() {
            let ends = self.scene.edge_ends[edge];
            if ends == NO_EDGE {
                continue;
            }
            let [from, to] = ends.map(|node| holders[node as usize]);
            let is_plain = *coupling == Coupling::PLAIN;
            let background = network.permittivity().at(edge);
            self.inside[edge] = match (from == to, from != NO_OBJECT || to != NO_OBJECT) {
                (true, true) => 1.0,
                _ if coupling.is_linked() => 1.0 - outside_parts(coupling.links().map(|(.., factor)| factor)),
                (false, _) => 1.0 - outside_parts([coupling.through]),
                _ if is_plain => 0.0,
                _ => self.part_in_dielectric(coupling, background),
            };
            let is_within = self.inside[edge] > 1.0 - 1e-6;
            if from != to || coupling.is_linked() || (!is_plain && !is_within) {
                cut.push(ends);
            }
        }
    }

    /// The part of an edge that lies in the dielectric of which least of it would do: parts are capacitors in series,
    /// 1/f = 1 - x + x ε_background/ε.
    fn part_in_dielectric(&self, coupling: &Coupling, background: f64) -> f32 {
        let part = |material: &Material| match material {
            Material::Dielectric(permittivity) => {
                let part = (1.0 - 1.0 / coupling.through) / (1.0 - background / permittivity.value());
                (part.is_finite() && part > 0.0).then_some(part.min(1.0) as f32)
            }
            Material::Conductor(_) => None,
        };
        self.materials.iter().filter_map(part).reduce(f32::min).unwrap_or(0.0)
    }

    /// Whether objects fill more than half of some elements, as far as their edges tell. The six elements of a lattice's cell
    /// are asked together: each reaches from one corner of the cell to the opposite one.
    fn is_filled(&self, elements: &[[u32; 6]]) -> bool {
        let edges = elements.iter().flatten().filter(|&&edge| edge != u32::MAX);
        let (sum, count) =
            edges.fold((0.0, 0), |(sum, count), &edge| (sum + self.inside[edge as usize], count + 1));
        2.0 * sum > count as f32
    }

    /// Finds the elements that are occupied and those that changed.
    fn look_at_elements(&self, occupancy: &Occupancy, computed: &mut Computed) {
        let mut has_moved = vec![false; computed.holders.len()];
        occupancy.changed_nodes().iter().for_each(|&node| has_moved[node as usize] = true);
        let filled = occupancy.elements();
        let is_cell_filled: Vec<bool> = match filled {
            Some(_) => Vec::new(),
            None => self
                .scene
                .tet_edges
                .chunks(self.scene.elements_in_cell)
                .map(|cell| self.is_filled(cell))
                .collect(),
        };
        let dielectric =
            self.materials.iter().position(|material| matches!(material, Material::Dielectric(_)));
        for (element, (corners, edges)) in self.scene.tets.iter().zip(&self.scene.tet_edges).enumerate() {
            let edges = || edges.iter().filter(|&&edge| edge != u32::MAX).map(|&edge| edge as usize);
            let is_occupied = match filled {
                Some((permittivity, conductors)) => {
                    conductors[element] != NO_OBJECT
                        || permittivity[element] != self.scene.permittivity.at(element)
                }
                None => is_cell_filled[element / self.scene.elements_in_cell],
            };
            let is_changed = edges().any(|edge| self.changed[edge])
                || corners.iter().any(|&node| has_moved[node as usize]);
            if is_occupied || is_changed {
                let held = corners.iter().map(|&node| computed.holders[node as usize]);
                let holder = held.min().filter(|&holder| holder != NO_OBJECT);
                let owner = holder.or(dielectric.map(|object| object as u16)).unwrap_or(NO_OBJECT);
                if is_occupied {
                    computed.occupied.push((element as u32, owner));
                }
                if is_changed {
                    computed.changed.push((element as u32, owner));
                }
            }
        }
    }
}

/// The parts of an edge outside of conductors, from what these parts alone weigh in relation to the edge.
fn outside_parts(factors: impl IntoIterator<Item = f64>) -> f32 {
    let parts: f64 = factors.into_iter().map(|factor| 1.0 / factor.max(1.0)).sum();
    parts.min(1.0) as f32
}
