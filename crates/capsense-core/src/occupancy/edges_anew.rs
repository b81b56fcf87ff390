//! Edges that are coupled anew: what becomes of each follows from the scene alone, so threads share them.

use super::camera_wall::{CameraWalls, Cut, OnEdge};
use super::coupling::{Coupling, EdgeRule};
use super::index_set::IndexSet;
use super::near_field::{Row, Wedges};
use super::parallel::ByLines;
use super::replaced::{KnownEdges, Replaced};
use super::scene::Scene;
use super::unstructured::{HeldEdge, Unstructured};
use super::{Contact, Filled, NO_OBJECT, Span};
use crate::instructions::vectorised;
use crate::workers::Workers;

/// So many edges keep a thread busy for some times as long as it takes to hand them over.
const EDGES_OF_A_TASK: usize = 64;

/// So many tasks for each thread, as some take longer and some threads come later.
const TASKS_OF_A_THREAD: usize = 4;

/// Some edges, what becomes of them, and room for each task.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgesAnew {
    /// Edges yet to be looked at, and those that have been, to be told next.
    asked: Batch,
    known: Batch,
    rooms: Vec<Room>,
}

/// Some edges and what becomes of each.
#[derive(Clone, Debug, Default)]
struct Batch {
    edges: Vec<Asked>,
    found: Vec<Found>,
}

impl Batch {
    /// All, each told once.
    fn told(&mut self) -> impl Iterator<Item = (Asked, Found)> {
        self.edges.drain(..).zip(self.found.iter().copied())
    }
}

/// An edge, whether surfaces may cut it another way than before, and whether it is to be found out how they do; otherwise only what is
/// around it is another.
#[derive(Clone, Copy, Debug)]
struct Asked {
    edge: u32,
    is_marked: bool,
    is_cut_anew: bool,
}

/// What becomes of an edge.
#[derive(Clone, Copy, Debug)]
struct Found {
    ends: [u32; 2],
    coupling: Coupling,
    /// Which dielectric is on the edge, if it is cut anew.
    filled: Filled,
    /// Whether an object meets the edge, or more than what is on it tells what it is without what is around it.
    is_met: bool,
}

impl Found {
    const NOTHING: Self =
        Self { ends: [0; 2], coupling: Coupling::PLAIN, filled: Filled::NOTHING, is_met: false };
}

/// What it follows from.
#[derive(Clone, Copy)]
pub(super) struct Sight<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) wedges: &'a Wedges,
    pub(super) walls: &'a CameraWalls,
    /// The conductor that holds each node.
    pub(super) conductor: &'a [u16],
}

/// Storage for one task.
#[derive(Clone, Debug, Default)]
struct Room {
    replaced: Replaced,
    /// Objects that the edge at hand passes through.
    spans: Vec<(u16, Span)>,
    /// The same for lines parallel to it.
    beside: Vec<(u16, Span)>,
    breaks: Vec<f64>,
    row: Row,
    /// Conductors that touch electrodes, with the edges on which they do.
    contacts: Vec<(u32, Contact)>,
    /// How surfaces cut edges of which that is kept.
    cuts: Vec<Cut>,
}

impl EdgesAnew {
    /// None yet, for so many threads. `before` is empty and lends its room to what will be replaced.
    pub(super) fn start(&mut self, workers: &Workers, before: &mut Replaced) {
        let tasks = workers.tasks(TASKS_OF_A_THREAD);
        self.rooms.resize_with(tasks, Room::default);
        if let Some(first) = self.replaced().next() {
            std::mem::swap(first, before);
        }
    }

    /// Has threads find out what becomes of the edges of a lattice in two sets, which are left empty, and take that over. Those
    /// only in the second may be cut as before.
    pub(super) fn take_all(
        &mut self,
        workers: &Workers,
        sight: Sight<'_>,
        sets: [&mut IndexSet; 2],
        known: KnownEdges<'_>,
    ) {
        match sight.wedges.has_any() {
            true => self.take::<true>(workers, sight, sets, known),
            false => self.take::<false>(workers, sight, sets, known),
        }
    }

    /// The same, where nodes are beside edges of conductors or where none are: then what the edge rule makes of an edge is handed over in
    /// registers, as it is slow to be read as a whole from memory where it was just written in parts.
    fn take<const HAS_WEDGES: bool>(
        &mut self,
        workers: &Workers,
        sight: Sight<'_>,
        sets: [&mut IndexSet; 2],
        mut known: KnownEdges<'_>,
    ) {
        // Room for no more cuts than may be kept, where one thread finds them all.
        let cuts = sight.walls.most_cuts().div_ceil(self.rooms.len().max(1));
        self.rooms.iter_mut().for_each(|room| room.cuts.reserve_exact(cuts));
        let parts = IndexSet::cut(sets, self.rooms.len());
        let tasks =
            parts.zip(&mut self.rooms).map(move |(part, room)| (known.split_to(part.end()), part, room));
        workers.for_each(tasks, |(mut known, part, room)| {
            let mut replaced = std::mem::take(&mut room.replaced);
            part.drain(|edge, is_marked| {
                let is_cut_anew = is_marked || sight.cuts_anew(&known, edge);
                if !is_cut_anew && let Some((ends, coupling)) = sight.link_alone(edge) {
                    return known.couple(edge, ends, coupling, &mut replaced);
                }
                let Found { ends, coupling, is_met, .. } = room
                    .look_inline::<HAS_WEDGES>(sight, Asked { edge: edge as u32, is_marked, is_cut_anew });
                if is_cut_anew {
                    known.see(edge, is_met);
                }
                known.couple(edge, ends, coupling, &mut replaced);
            });
            room.replaced = replaced;
        });
    }

    /// The same of a mesh where more than an edge tells what becomes of it, which is told what the edge rule makes of each.
    pub(super) fn tell_all(
        &mut self,
        workers: &Workers,
        sight: Sight<'_>,
        [marked, around]: [&mut IndexSet; 2],
        mut known: KnownEdges<'_>,
        unstructured: &mut Unstructured,
    ) {
        let mut tell = |known: &mut KnownEdges<'_>, (asked, found): (Asked, Found)| {
            let (edge, Found { ends, coupling, filled, is_met }) = (asked.edge as usize, found);
            if asked.is_cut_anew {
                known.see(edge, is_met);
                unstructured.fill(edge, filled);
            }
            let held = HeldEdge::of(edge, ends, sight.conductor);
            unstructured.take(held, ends, known.is_moved(ends), coupling);
        };
        marked.drain_with(around, |edge, is_marked| {
            let is_cut_anew = is_marked || sight.cuts_anew(&known, edge);
            let asked = Asked { edge: edge as u32, is_marked, is_cut_anew };
            // A single thread takes each edge over as it comes.
            if let [room] = &mut self.rooms[..] {
                return tell(&mut known, (asked, room.look(sight, asked)));
            }
            self.asked.edges.push(asked);
            if self.asked.edges.len() >= EDGES_OF_A_TASK * self.rooms.len() {
                self.look_and_tell(workers, sight, |told| tell(&mut known, told));
            }
        });
        self.look_and_tell(workers, sight, |told| tell(&mut known, told));
        self.known.told().for_each(|told| tell(&mut known, told));
    }

    /// What was replaced of edges that were taken over, to be emptied, in their order.
    pub(super) fn replaced(&mut self) -> impl Iterator<Item = &mut Replaced> {
        self.rooms.iter_mut().map(|room| &mut room.replaced)
    }

    /// Tells what becomes of the edges looked at last, each once, while helpers look at those asked for, which are told next time.
    fn look_and_tell(&mut self, workers: &Workers, sight: Sight<'_>, tell: impl FnMut((Asked, Found))) {
        let Self { asked: Batch { edges, found }, known, rooms } = self;
        found.resize(edges.len(), Found::NOTHING);
        let tasks = edges.chunks(EDGES_OF_A_TASK).zip(found.chunks_mut(EDGES_OF_A_TASK)).zip(rooms);
        workers.beside(
            || known.told().for_each(tell),
            tasks,
            |((asked, found), room)| {
                asked.iter().zip(found).for_each(|(asked, found)| *found = room.look(sight, *asked));
            },
        );
        std::mem::swap(&mut self.asked, &mut self.known);
    }

    /// How surfaces cut edges of which that is to be kept, each told once.
    pub(super) fn cuts(&mut self) -> impl Iterator<Item = Cut> {
        self.rooms.iter_mut().flat_map(|room| room.cuts.drain(..))
    }

    /// Conductors that touch electrodes on these edges, each told once.
    pub(super) fn contacts(&mut self) -> impl Iterator<Item = (u32, Contact)> {
        self.rooms.iter_mut().flat_map(|room| room.contacts.drain(..))
    }
}

impl Sight<'_> {
    /// Whether surfaces may cut an edge another way than before though only what is around it differs.
    #[inline]
    fn cuts_anew(&self, known: &KnownEdges<'_>, edge: usize) -> bool {
        self.scene.has_lines || self.scene.has_camera_walls || known.is_met(edge)
    }

    /// The ends of an edge that no object is on, and what is left of it if that is nothing but the link that it carries and what ends of plates make of it.
    #[inline]
    fn link_alone(&self, edge: usize) -> Option<([u32; 2], Coupling)> {
        let ends = self.scene.mesh.edges.ends_of_existing(edge);
        let mut coupling = self.wedges.link_alone(edge, ends)?;
        if self.scene.has_ends && self.wedges.between(ends).is_some() {
            coupling.through *= self.scene.end_factor(edge);
        }
        Some((ends, coupling))
    }
}

impl Room {
    /// Applies the edge rule to an edge.
    fn look(&mut self, sight: Sight<'_>, asked: Asked) -> Found {
        self.look_inline::<true>(sight, asked)
    }

    /// The same without a call, which would hand over in memory what it found.
    #[inline(always)]
    fn look_inline<const HAS_WEDGES: bool>(
        &mut self,
        sight: Sight<'_>,
        Asked { edge, is_marked, is_cut_anew }: Asked,
    ) -> Found {
        let Sight { scene, conductor, .. } = sight;
        let edge = edge as usize;
        let ends = scene.mesh.edges.ends_of_existing(edge);
        let Self { spans, beside, breaks, contacts, cuts, .. } = self;
        if !is_cut_anew {
            spans.clear();
            let coupling =
                self.look_around::<HAS_WEDGES>(sight, (edge, ends), [NO_OBJECT; 2], Coupling::PLAIN);
            return Found { ends, coupling, filled: Filled::NOTHING, is_met: false };
        }
        let owners = ends.map(|node| conductor[node as usize]);
        let is_free = owners == [NO_OBJECT; 2];
        if owners[0] == owners[1] && !is_free {
            // Nothing on an edge within a conductor matters, and what a camera sees to hold both ends has no wall beside it.
            let coupling = self.look_around::<HAS_WEDGES>(sight, (edge, ends), owners, Coupling::PLAIN);
            return Found { ends, coupling, filled: Filled::NOTHING, is_met: true };
        }
        if let Some(before) = sight.walls.cut_before(scene, edge).filter(|_| !is_marked) {
            // Only the wall beside it is another.
            let cut = sight.walls.past_wall(scene, (edge, ends), before.on_edge, before.coupling);
            let is_met = before.on_edge != OnEdge::Nothing || !is_free || cut != Coupling::PLAIN;
            let coupling = self.look_around::<HAS_WEDGES>(sight, (edge, ends), owners, cut);
            return Found { ends, coupling, filled: Filled::NOTHING, is_met };
        }
        sight.walls.find_spans(scene, (edge, ends), spans);
        if !spans.is_empty() && scene.is_at_electrode(ends) {
            note_contacts(scene, (edge, ends), spans, contacts);
        }
        let lines = scene.has_lines.then(|| scene.along_lines((edge, ends), owners, spans, beside, breaks));
        if let Some(lines) = lines.flatten() {
            let coupling = Coupling::only_through(self.on_strong(sight, (edge, ends), lines));
            return Found { ends, coupling, filled: Filled::NOTHING, is_met: true };
        }
        let filled = Filled::first_of(spans, scene.materials);
        let mut is_met = !spans.is_empty() || !is_free;
        let background = scene.mesh.permittivity.at(edge);
        let rule = EdgeRule { owners, spans, materials: scene.materials, background };
        let is_plain = is_free && rule.spans.is_empty();
        let mut cut = if is_plain { Coupling::PLAIN } else { rule.coupling(breaks) };
        if scene.has_camera_walls {
            let kept = sight.walls.cut_to_keep(scene, (edge, ends), spans, cut);
            cuts.extend(kept);
            cut = sight.walls.correct(scene, (edge, ends), conductor, spans, cut);
            is_met |= cut != Coupling::PLAIN;
        }
        Found {
            ends,
            coupling: self.look_around::<HAS_WEDGES>(sight, (edge, ends), owners, cut),
            filled,
            is_met,
        }
    }

    /// What an edge on which dielectrics are is, its spans being those found last, of which lines tell the more the weaker they are.
    #[inline]
    fn on_strong(
        &mut self,
        Sight { scene, wedges, .. }: Sight<'_>,
        (edge, ends): (usize, [u32; 2]),
        ByLines { through: lines, is_far_from_edges }: ByLines,
    ) -> f64 {
        let Self { spans, beside, breaks, row, .. } = self;
        let background = scene.mesh.permittivity.at(edge);
        let Some((number, strength)) = scene.strongest(spans, background) else {
            return lines;
        };
        if is_far_from_edges {
            // Nor are there walls.
            let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: scene.materials, background };
            return lines + strength * (rule.coupling(breaks).through - lines);
        }
        let star = wedges.star(ends[0] as usize, row);
        let past_walls = vectorised(
            #[inline(always)]
            || scene.past_walls((edge, &star), spans, number, beside, breaks),
        );
        lines + strength * (past_walls - lines)
    }

    /// What the edge rule makes of an edge, its spans being those found last, and what is around it.
    #[inline(always)]
    fn look_around<const HAS_WEDGES: bool>(
        &mut self,
        sight: Sight<'_>,
        edge: (usize, [u32; 2]),
        owners: [u16; 2],
        cut: Coupling,
    ) -> Coupling {
        match HAS_WEDGES && sight.wedges.has_any() {
            true => self.look_at_wedges(sight, edge, owners, cut),
            false => cut,
        }
    }

    /// The same where nodes are beside edges of conductors.
    fn look_at_wedges(
        &mut self,
        Sight { scene, wedges, .. }: Sight<'_>,
        (edge, ends): (usize, [u32; 2]),
        owners: [u16; 2],
        cut: Coupling,
    ) -> Coupling {
        let covered = if wedges.may_be_beside(ends, owners) {
            let Self { spans, beside, breaks, row, .. } = self;
            let star = wedges.star(ends[0] as usize, row);
            vectorised(
                #[inline(always)]
                || scene.at_silhouette((edge, &star), owners, spans, beside, breaks, cut),
            )
        } else {
            cut
        };
        match wedges.between(ends) {
            Some(at) => scene.between_wedges(wedges.stars(), (edge, ends), at, owners, cut, covered),
            None => covered,
        }
    }
}

/// Notes the conductors that touch electrodes at the ends of an edge. Few edges lead there.
#[cold]
fn note_contacts(
    scene: &Scene<'_>,
    (edge, ends): (usize, [u32; 2]),
    spans: &[(u16, Span)],
    contacts: &mut Vec<(u32, Contact)>,
) {
    contacts.extend(scene.contacts(ends, spans).map(|contact| (edge as u32, contact)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Aabb, Pose, Shape};
    use crate::material::{Connection, Material, RelativePermittivity};
    use crate::mesh::{Lattice, TetMesh};
    use crate::occupancy::{EdgeGeometry, Occupancy};
    use crate::sensor::{FREE, Terminal};
    use crate::solids::Solids;
    use crate::stiffness::EdgeNetwork;
    use glam::DVec3;

    /// More edges than are asked for at once, some of which a conductor, a strong and a weak dielectric meet; the first covers
    /// electrodes.
    #[test]
    fn threads_share_edges_without_a_trace() {
        let domain = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
        let lattice = Lattice::uniform(domain, [24, 24, 24]).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap();
        let of_lattice = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
        share_without_a_trace(&mesh, &of_lattice);
        share_without_a_trace(&mesh, &EdgeNetwork::assemble(&mesh));
        // Weak dielectrics cut elements.
        let moved =
            |(k, p): (usize, &DVec3)| *p + 3e-3 * DVec3::new((k % 3) as f64, (k % 5) as f64, (k % 2) as f64);
        let nodes: Vec<DVec3> = mesh.nodes().iter().enumerate().map(moved).collect();
        let mesh = TetMesh::new(nodes, mesh.tets().to_vec()).unwrap();
        share_without_a_trace(&mesh, &EdgeNetwork::assemble(&mesh));
    }

    fn share_without_a_trace(mesh: &TetMesh, network: &EdgeNetwork) {
        let electrode = |node: &DVec3| match node.z.abs() < 0.01 && node.x.abs() < 0.1 {
            true => 1 + (24.0 * (node.y + 0.5)).round() as Terminal,
            false => FREE,
        };
        let terminals: Vec<Terminal> = mesh.nodes().iter().map(electrode).collect();
        let edges = network.edges();
        let geometry = EdgeGeometry {
            nodes: mesh.nodes(),
            terminals: &terminals,
            edges,
            permittivity: network.permittivity(),
        };
        let dielectric = |value| Material::Dielectric(RelativePermittivity::new(value).unwrap());
        let materials = [Material::Conductor(Connection::Grounded), dielectric(80.0), dielectric(1.5)];
        let shapes = [0.4, 0.3, 0.5].map(|edge| Shape::Box { size: DVec3::new(edge, 0.7, 0.2) });
        let mut solids = Solids::new(&shapes).unwrap();
        let team = Workers::new(3, 1_000_000);
        let _awake = team.wake_all();
        let fresh = || {
            Occupancy::empty(mesh.nodes().len(), edges.len())
                .with_weights(mesh, edges, network.weights(), true)
                .with_immersed_elements(mesh, edges)
        };
        let (mut alone, mut shared) = (fresh(), fresh());
        for frame in 0..4 {
            let at = 0.017 * f64::from(frame);
            let poses =
                [DVec3::new(at, 0.01, 0.09), DVec3::new(-0.3, at, 0.2), DVec3::new(0.1, 0.0, -0.3 - at)];
            solids.place(&poses.map(Pose::at)).unwrap();
            alone.update(geometry, &materials, &solids);
            shared.update_with(&team, geometry, &materials, &solids);
            assert!(alone.changed_edges().len() > 2 * EDGES_OF_A_TASK, "{}", alone.changed_edges().len());
            assert!(alone.contacts().len() > 10, "{:?}", alone.contacts());
            assert_eq!(alone.contacts(), shared.contacts());
            assert_eq!(alone.replaced_couplings(), shared.replaced_couplings());
            assert!(alone.couplings().eq(shared.couplings()));
            assert_eq!(alone.linked_edges(), shared.linked_edges());
            assert_eq!(alone.conductors(), shared.conductors());
        }
    }
}
