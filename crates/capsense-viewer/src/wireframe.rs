//! A tetrahedral mesh as line segments, projected and drawn by hand, with a camera that orbits it.
//!
//! Shown are the edges of the mesh's surface, and the edges between two nodes of one terminal, which draw the
//! electrodes. The picture is a perspective projection with z upwards.

use crate::palette::palette;
use capsense_core::geometry::Aabb;
use capsense_core::mesh::TetMesh;
use egui::{Color32, Pos2, Rect, Response, Role, Sense, Shape, Stroke, Ui, Vec2};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// More edges than this are thinned out, so that a large mesh does not stall the window.
const MOST_EDGES: usize = 60_000;
/// Field of view from top to bottom: the image plane is this far away in units of half its height.
const FOCAL_LENGTH: f64 = 2.4;
/// Nothing nearer than this part of the mesh's radius is drawn.
const NEAR: f64 = 0.05;

/// Lines that cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshViewError {
    /// There is nothing to draw.
    #[error("the mesh has no nodes")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("node {0} has a coordinate that is not finite")]
    NonFiniteNode(usize),
    /// There is not one terminal entry for each node.
    #[error("{terminals} terminal entries for {nodes} nodes")]
    TerminalCount {
        /// Entries given.
        terminals: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// An edge names a node that does not exist.
    #[error("edge {edge} names node {node}, but there are only {nodes}")]
    NodeOutOfRange {
        /// Index of the edge.
        edge: usize,
        /// The node it names.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
}

/// Edges that are shown and hidden together.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeGroup {
    /// The terminal that holds both ends of every edge; `None` for all other edges.
    pub terminal: Option<usize>,
    /// What the list beside the picture calls it.
    pub name: String,
    /// Whether it is drawn.
    pub visible: bool,
    /// What it is drawn in, unless it is background.
    pub colour: Color32,
    edges: Vec<[u32; 2]>,
}

impl EdgeGroup {
    /// Number of edges.
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// Whether this is background, drawn grey and faint: the surface, or the terminal called `ground`.
    pub fn is_background(&self) -> bool {
        self.terminal.is_none() || self.name.eq_ignore_ascii_case("ground")
    }
}

/// The lines of a mesh, in groups.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshView {
    nodes: Vec<DVec3>,
    groups: Vec<EdgeGroup>,
    bounds: Aabb,
}

impl MeshView {
    /// Takes nodes in metres, edges between them, and the terminal of each node (`None`: free).
    ///
    /// An edge belongs to a terminal when both of its ends do. Terminals are called `terminal 0`, `terminal 1`, ...
    /// until [`MeshView::with_terminal_names`] says more.
    ///
    /// # Errors
    /// When there are no nodes, a node is not finite, the lists do not fit, or an edge names a missing node.
    pub fn from_nodes_and_edges(
        nodes: Vec<DVec3>,
        edges: Vec<[u32; 2]>,
        terminal: Vec<Option<usize>>,
    ) -> Result<Self, MeshViewError> {
        if nodes.is_empty() {
            return Err(MeshViewError::Empty);
        }
        if let Some(bad) = nodes.iter().position(|node| !node.is_finite()) {
            return Err(MeshViewError::NonFiniteNode(bad));
        }
        if terminal.len() != nodes.len() {
            return Err(MeshViewError::TerminalCount { terminals: terminal.len(), nodes: nodes.len() });
        }
        let mut groups: BTreeMap<Option<usize>, Vec<[u32; 2]>> = BTreeMap::new();
        for (edge, ends) in edges.into_iter().enumerate() {
            let at = |node: u32| {
                terminal.get(node as usize).copied().ok_or(MeshViewError::NodeOutOfRange {
                    edge,
                    node,
                    nodes: nodes.len(),
                })
            };
            let (first, second) = (at(ends[0])?, at(ends[1])?);
            let common = if first == second { first } else { None };
            groups.entry(common).or_default().push(ends);
        }
        let groups = groups
            .into_iter()
            .map(|(terminal, edges)| EdgeGroup {
                terminal,
                name: terminal.map_or_else(|| "surface".to_owned(), |t| format!("terminal {t}")),
                visible: true,
                colour: palette(terminal.unwrap_or(0)),
                edges,
            })
            .collect();
        let bounds = Aabb::around(nodes.iter().copied());
        Ok(Self { nodes, groups, bounds })
    }

    /// Takes the surface of a mesh, and the edges inside it that lie in a terminal.
    ///
    /// # Errors
    /// When there is not one terminal entry for each node.
    pub fn from_mesh(mesh: &TetMesh, terminal: Vec<Option<usize>>) -> Result<Self, MeshViewError> {
        if terminal.len() != mesh.nodes().len() {
            return Err(MeshViewError::TerminalCount {
                terminals: terminal.len(),
                nodes: mesh.nodes().len(),
            });
        }
        let mut faces: Vec<[u32; 3]> = Vec::with_capacity(4 * mesh.tets().len());
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for &[a, b, c, d] in mesh.tets() {
            for mut face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
                face.sort_unstable();
                faces.push(face);
            }
            for edge in [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]] {
                let [first, second] = edge.map(|node| terminal[node as usize]);
                if first.is_some() && first == second {
                    edges.push([edge[0].min(edge[1]), edge[0].max(edge[1])]);
                }
            }
        }
        // A face on the surface belongs to one tetrahedron only.
        faces.sort_unstable();
        for same in faces.chunk_by(|a, b| a == b) {
            if let &[[a, b, c]] = same {
                edges.extend([[a, b], [a, c], [b, c]]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        Self::from_nodes_and_edges(mesh.nodes().to_vec(), edges, terminal)
    }

    /// Names the terminals by their number; one called `ground` is drawn like the surface.
    #[must_use]
    pub fn with_terminal_names(mut self, names: &[impl AsRef<str>]) -> Self {
        for group in &mut self.groups {
            if let Some(name) = group.terminal.and_then(|terminal| names.get(terminal)) {
                group.name = name.as_ref().to_owned();
            }
        }
        self
    }

    /// The groups: first the edges of no terminal, then the terminals in their order. Groups without edges are left out.
    pub fn groups(&self) -> &[EdgeGroup] {
        &self.groups
    }

    /// The groups, to show and hide them.
    pub fn groups_mut(&mut self) -> &mut [EdgeGroup] {
        &mut self.groups
    }

    /// The smallest box around all nodes.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn radius(&self) -> f64 {
        (0.5 * self.bounds.size().length()).max(f64::MIN_POSITIVE)
    }
}

/// A camera on a sphere around the middle of the mesh. Lengths are in units of the mesh's radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Angle around z in radians; 0 looks along +y.
    pub yaw: f64,
    /// Height above the horizon in radians.
    pub pitch: f64,
    /// Distance from the point looked at.
    pub distance: f64,
    /// The point looked at, from the middle of the mesh.
    pub target: DVec3,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { yaw: -0.6, pitch: 0.45, distance: 2.7, target: DVec3::ZERO }
    }
}

impl Orbit {
    /// Unit vectors to the right, upwards, and from the camera into the picture.
    fn axes(&self) -> [DVec3; 3] {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        let right = DVec3::new(cos_yaw, sin_yaw, 0.0);
        let forward = DVec3::new(-sin_yaw * cos_pitch, cos_yaw * cos_pitch, -sin_pitch);
        [right, right.cross(forward), forward]
    }

    /// Turns by a distance that the pointer was dragged.
    pub fn turn(&mut self, points: Vec2) {
        self.yaw -= f64::from(points.x) * 0.01;
        let limit = std::f64::consts::FRAC_PI_2;
        self.pitch = (self.pitch + f64::from(points.y) * 0.01).clamp(-limit, limit);
    }

    /// Moves the point looked at along the picture, by a part of the picture's height.
    pub fn pan(&mut self, heights: DVec2) {
        let [right, up, _] = self.axes();
        let scale = 2.0 * self.distance / FOCAL_LENGTH;
        self.target += (up * heights.y - right * heights.x) * scale;
        self.target = self.target.clamp_length_max(2.0);
    }

    /// Moves nearer (above 1) or farther (below 1).
    pub fn zoom(&mut self, factor: f64) {
        if factor.is_finite() && factor > 0.0 {
            self.distance = (self.distance / factor).clamp(0.1, 20.0);
        }
    }
}

/// Projects points of one mesh into one rectangle.
struct Projection {
    axes: [DVec3; 3],
    /// Of the mesh.
    centre: DVec3,
    radius: f64,
    target: DVec3,
    distance: f64,
    middle: Pos2,
    half_height: f64,
}

impl Projection {
    fn new(orbit: &Orbit, mesh: &MeshView, rect: Rect) -> Self {
        Self {
            axes: orbit.axes(),
            centre: 0.5 * (mesh.bounds.min + mesh.bounds.max),
            radius: mesh.radius(),
            target: orbit.target,
            distance: orbit.distance,
            middle: rect.center(),
            half_height: 0.5 * f64::from(rect.height().min(rect.width())),
        }
    }

    /// Coordinates to the right, upwards and into the picture, seen from the camera.
    fn camera_from_sensor(&self, point: DVec3) -> DVec3 {
        let from_target = (point - self.centre) / self.radius - self.target;
        let [right, up, forward] = self.axes;
        DVec3::new(from_target.dot(right), from_target.dot(up), from_target.dot(forward) + self.distance)
    }

    fn screen(&self, seen: DVec3) -> Pos2 {
        let scale = self.half_height * FOCAL_LENGTH / seen.z;
        self.middle + Vec2::new((seen.x * scale) as f32, (-seen.y * scale) as f32)
    }

    /// Both ends on the screen and the depth of the middle, or `None` where the segment is behind the camera.
    fn segment(&self, mut a: DVec3, mut b: DVec3) -> Option<([Pos2; 2], f64)> {
        if a.z < b.z {
            std::mem::swap(&mut a, &mut b);
        }
        if a.z <= NEAR {
            return None;
        }
        if b.z < NEAR {
            b = a + (b - a) * ((a.z - NEAR) / (a.z - b.z));
        }
        Some(([self.screen(a), self.screen(b)], 0.5 * (a.z + b.z)))
    }
}

/// The twelve edges of a box.
fn box_edges(bounds: Aabb) -> impl Iterator<Item = [DVec3; 2]> {
    let corner = move |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    (0..8).flat_map(move |from| {
        (0..3)
            .filter(move |axis| from >> axis & 1 == 0)
            .map(move |axis| [corner(from), corner(from | 1 << axis)])
    })
}

/// Draws the mesh into the rest of a panel and lets the pointer move the camera: drag to turn, drag with the other
/// button to move, scroll to zoom, double click to start over.
pub fn show(ui: &mut Ui, mesh: &MeshView, orbit: &mut Orbit) -> Response {
    let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    let edges: usize = mesh.groups.iter().filter(|group| group.visible).map(EdgeGroup::len).sum();
    let info = format!("Mesh picture, {edges} edges");
    response.widget_info(|| egui::WidgetInfo::labeled(Role::Image, true, &info));

    if response.double_clicked() {
        *orbit = Orbit::default();
    }
    if response.dragged_by(egui::PointerButton::Primary) {
        orbit.turn(response.drag_delta());
    } else if response.dragged() {
        let moved = response.drag_delta() / rect.height().min(rect.width()).max(1.0);
        orbit.pan(DVec2::new(f64::from(moved.x), f64::from(moved.y)));
    }
    if response.hovered() {
        let (scrolled, pinched) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        orbit.zoom(f64::from(scrolled * 0.004).exp() * f64::from(pinched));
    }

    let projection = Projection::new(orbit, mesh, rect);
    let painter = ui.painter_at(rect);
    let grey = ui.visuals().weak_text_color();
    painter.extend(box_edges(mesh.bounds).filter_map(|[a, b]| {
        let ends = [projection.camera_from_sensor(a), projection.camera_from_sensor(b)];
        let (points, _) = projection.segment(ends[0], ends[1])?;
        Some(Shape::line_segment(points, Stroke::new(1.5, grey)))
    }));
    let seen: Vec<DVec3> = mesh.nodes.iter().map(|&node| projection.camera_from_sensor(node)).collect();
    let stride = edges.div_ceil(MOST_EDGES).max(1);
    // Background first, so that the electrodes are drawn over it.
    for background in [true, false] {
        for group in mesh.groups.iter().filter(|g| g.visible && g.is_background() == background) {
            let (colour, width) = if background { (grey, 0.6) } else { (group.colour, 1.2) };
            painter.extend(group.edges.iter().step_by(stride).filter_map(|&[a, b]| {
                let (points, depth) = projection.segment(seen[a as usize], seen[b as usize])?;
                // Far lines fade: 1 at the front of the mesh, less at its back.
                let nearness = (0.5 * (orbit.distance + 1.0 - depth)).clamp(0.0, 1.0) as f32;
                let strength = if background { 0.12 + 0.25 * nearness } else { 0.6 + 0.4 * nearness };
                Some(Shape::line_segment(points, Stroke::new(width, colour.gamma_multiply(strength))))
            }));
        }
    }
    if stride > 1 {
        painter.text(
            rect.left_bottom() + Vec2::new(6.0, -6.0),
            egui::Align2::LEFT_BOTTOM,
            format!("showing 1 edge in {stride} of {edges}"),
            egui::FontId::proportional(12.0),
            grey,
        );
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::mesh::Lattice;

    fn cube() -> TetMesh {
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::ONE };
        Lattice::uniform(domain, [2, 2, 2]).unwrap().to_tet_mesh().unwrap()
    }

    #[test]
    fn a_lattice_shows_its_surface_and_its_terminals() {
        let mesh = cube();
        // The middle node and its neighbour on a face as one electrode, everything else free.
        let terminal: Vec<_> = mesh
            .nodes()
            .iter()
            .map(|n| (*n == DVec3::splat(0.5) || *n == DVec3::new(0.5, 0.5, 0.0)).then_some(1))
            .collect();
        let view = MeshView::from_mesh(&mesh, terminal).unwrap().with_terminal_names(&["ground", "E1"]);
        let groups: Vec<_> = view.groups().iter().map(|g| (g.terminal, g.name.as_str(), g.len())).collect();
        // 6 faces of 2 x 2 squares in 2 triangles each: 48 triangles, 72 edges by Euler with 26 nodes.
        assert_eq!(groups, [(None, "surface", 72), (Some(1), "E1", 1)]);
        assert_eq!(view.bounds(), Aabb { min: DVec3::ZERO, max: DVec3::ONE });
    }

    #[test]
    fn lists_that_do_not_fit_are_refused() {
        let nodes = vec![DVec3::ZERO, DVec3::X];
        let make = MeshView::from_nodes_and_edges;
        assert_eq!(make(vec![], vec![], vec![]), Err(MeshViewError::Empty));
        assert_eq!(make(vec![DVec3::NAN], vec![], vec![None]), Err(MeshViewError::NonFiniteNode(0)));
        assert_eq!(
            make(nodes.clone(), vec![], vec![None]),
            Err(MeshViewError::TerminalCount { terminals: 1, nodes: 2 })
        );
        assert_eq!(
            make(nodes, vec![[0, 1], [1, 2]], vec![None, None]),
            Err(MeshViewError::NodeOutOfRange { edge: 1, node: 2, nodes: 2 })
        );
        assert_eq!(
            MeshView::from_mesh(&cube(), vec![]),
            Err(MeshViewError::TerminalCount { terminals: 0, nodes: 27 })
        );
    }

    #[test]
    fn the_picture_is_the_right_way_round() {
        let view = MeshView::from_mesh(&cube(), vec![None; 27]).unwrap();
        let rect = Rect::from_min_size(Pos2::new(10.0, 20.0), Vec2::splat(100.0));
        let orbit = Orbit { yaw: 0.0, pitch: 0.0, ..Orbit::default() };
        let projection = Projection::new(&orbit, &view, rect);
        let screen = |p: DVec3| projection.screen(projection.camera_from_sensor(p));
        let middle = DVec3::splat(0.5);
        assert_eq!(screen(middle), rect.center());
        assert!(screen(middle + DVec3::X * 0.2).x > rect.center().x + 1.0);
        assert!(screen(middle + DVec3::Z * 0.2).y < rect.center().y - 1.0);
        // Perspective: the far end of an edge along the line of sight is nearer to the middle.
        let near = screen(DVec3::new(1.0, 0.0, 0.5)).x - rect.center().x;
        let far = screen(DVec3::new(1.0, 1.0, 0.5)).x - rect.center().x;
        assert!(near > far && far > 0.0, "{near} {far}");
        let [right, up, forward] = Orbit::default().axes();
        assert!((right.cross(up) + forward).length() < 1e-12, "right, up and backward are right-handed");
    }

    #[test]
    fn segments_are_cut_at_the_camera() {
        let view = MeshView::from_mesh(&cube(), vec![None; 27]).unwrap();
        let rect = Rect::from_min_size(Pos2::ZERO, Vec2::splat(100.0));
        let projection = Projection::new(&Orbit::default(), &view, rect);
        let (front, back) = (DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.0, 0.0, -1.0));
        assert!(projection.segment(back, back * 2.0).is_none());
        let (_, whole) = projection.segment(front, front * 2.0).unwrap();
        assert_eq!(whole, 1.5);
        let (points, cut) = projection.segment(back, front).unwrap();
        assert!((cut - 0.5 * (1.0 + NEAR)).abs() < 1e-12);
        assert!(points.iter().all(|p| p.is_finite()));
    }

    #[test]
    fn the_camera_stays_within_its_limits() {
        let mut orbit = Orbit::default();
        orbit.turn(Vec2::new(0.0, 1e6));
        assert_eq!(orbit.pitch, std::f64::consts::FRAC_PI_2);
        orbit.zoom(1e9);
        assert_eq!(orbit.distance, 0.1);
        orbit.zoom(0.0);
        orbit.zoom(f64::NAN);
        assert_eq!(orbit.distance, 0.1);
        orbit.pan(DVec2::splat(1e9));
        assert!(orbit.target.length() <= 2.0 + 1e-9);
    }
}
