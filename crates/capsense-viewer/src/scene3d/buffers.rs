//! Vertices of what is drawn, and what becomes of parts of a scene as such.

use super::frame::{Frame3d, OwnedElement};
use super::static_scene::{BodySurface, FACES, OUTSIDE, StaticScene};
use super::theme::Theme;
use crate::palette::{material_colour, palette};
use bytemuck::{Pod, Zeroable};
use capsense_core::geometry::Aabb;
use capsense_core::occupancy::NO_OBJECT;
use egui::Color32;
use glam::{DVec3, Vec3};

/// A corner of a flat triangle.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FaceVertex {
    position: [f32; 3],
    /// The normal, and how strongly the triangle's sides are drawn; 127 is one.
    normal: [i8; 4],
    colour: [u8; 4],
}

/// A line segment, drawn as a quad.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Line {
    from: [f32; 3],
    /// In points of the screen.
    width: f32,
    to: [f32; 3],
    colour: [u8; 4],
}

/// A corner of a triangle of a slice.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SliceVertex {
    pub(super) position: [f32; 3],
    pub(super) value: f32,
}

/// A corner of a body's triangle, in the body's frame.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BodyVertex {
    position: [f32; 3],
    normal: [f32; 3],
}

/// The strength at which sides of triangles are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sides {
    Hidden,
    Drawn,
}

/// Red, green, blue, not multiplied by alpha.
pub(super) fn straight(colour: Color32) -> [u8; 4] {
    colour.to_srgba_unmultiplied()
}

impl Line {
    pub(super) fn new([from, to]: [DVec3; 2], width: f32, colour: Color32) -> Self {
        Self { from: from.as_vec3().to_array(), width, to: to.as_vec3().to_array(), colour: straight(colour) }
    }
}

/// A flat triangle.
pub(super) fn face([a, b, c]: [DVec3; 3], colour: Color32, sides: Sides) -> [FaceVertex; 3] {
    let normal =
        ((b - a).cross(c - a).normalize_or_zero() * 127.0).as_ivec3().to_array().map(|part| part as i8);
    let sides = if sides == Sides::Drawn { 127 } else { 0 };
    let normal = [normal[0], normal[1], normal[2], sides];
    let colour = straight(colour);
    [a, b, c].map(|position| FaceVertex { position: position.as_vec3().to_array(), normal, colour })
}

/// The twelve edges of a box.
pub(super) fn box_edges(bounds: &Aabb) -> impl Iterator<Item = [DVec3; 2]> {
    let Aabb { min, max } = *bounds;
    let corner = move |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { max[axis] } else { min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    (0..8).flat_map(move |from| {
        let upwards = (0..3).filter(move |axis| from >> axis & 1 == 0);
        upwards.map(move |axis| [corner(from), corner(from | 1 << axis)])
    })
}

/// The twelve triangles of a box, counter-clockwise seen from outside.
fn box_faces(bounds: &Aabb) -> Vec<[DVec3; 3]> {
    let Aabb { min, max } = *bounds;
    (0..3)
        .flat_map(|axis| [min[axis], max[axis]].map(|side| (axis, side)))
        .flat_map(|(axis, side)| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |at_u: f64, at_v: f64| {
                let mut point = DVec3::ZERO;
                (point[axis], point[u], point[v]) = (side, at_u, at_v);
                point
            };
            let mut corners = [
                corner(min[u], min[v]),
                corner(max[u], min[v]),
                corner(max[u], max[v]),
                corner(min[u], max[v]),
            ];
            if side == min[axis] {
                corners.swap(1, 3);
            }
            [[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|k: usize| corners[k]))
        })
        .collect()
}

/// Electrodes as opaque sheets.
pub(super) fn electrodes(scene: &StaticScene) -> Vec<FaceVertex> {
    let sheet = |(index, triangles): (usize, &Vec<[DVec3; 3]>)| {
        triangles
            .iter()
            .flat_map(move |&triangle| face(triangle, palette(index), Sides::Hidden))
            .collect::<Vec<_>>()
    };
    scene.electrodes.iter().map(|electrode| &electrode.triangles).enumerate().flat_map(sheet).collect()
}

/// The board below the electrodes.
pub(super) fn board(scene: &StaticScene, theme: &Theme) -> Vec<FaceVertex> {
    let faces = scene.board.iter().flat_map(box_faces);
    faces.flat_map(|triangle| face(triangle, theme.board, Sides::Hidden)).collect()
}

/// The domain, the board's edges and the electrodes' borders.
pub(super) fn outlines(scene: &StaticScene, theme: &Theme) -> Vec<Line> {
    let mut lines: Vec<Line> =
        box_edges(&scene.domain).map(|ends| Line::new(ends, 1.0, theme.domain)).collect();
    lines.extend(scene.board.iter().flat_map(box_edges).map(|ends| Line::new(ends, 1.0, theme.board_edge)));
    for (index, electrode) in scene.electrodes.iter().enumerate() {
        let colour = palette(index);
        lines.extend(electrode.border.iter().map(|&ends| Line::new(ends, 1.4, colour)));
    }
    lines
}

/// The elements behind a plane, as faces: where the plane cuts the mesh, and the mesh's own surface. It is the middle of the
/// box around an element that counts: the six elements of a lattice's cell have the same, so that lattices are cut flat.
pub(super) fn section(
    scene: &StaticScene,
    is_kept: impl Fn(DVec3) -> bool,
    theme: &Theme,
) -> [Vec<FaceVertex>; 2] {
    let kept: Vec<bool> = (0..scene.tets.len() as u32)
        .map(|element| Aabb::around(scene.corners(element)))
        .map(|around| is_kept(0.5 * (around.min + around.max)))
        .collect();
    let (mut cut, mut walls) = (Vec::new(), Vec::new());
    for element in (0..scene.tets.len()).filter(|&element| kept[element]) {
        let corners = scene.corners(element as u32);
        for (side, &other) in scene.neighbours[element].iter().enumerate() {
            let triangle = FACES[side].map(|corner| corners[corner]);
            if other == OUTSIDE {
                walls.extend(face(triangle, theme.wall, Sides::Drawn));
            } else if !kept[other as usize] {
                let colour = match scene.permittivity.at(element) > 1.0 {
                    true => theme.section_in_board,
                    false => theme.section,
                };
                cut.extend(face(triangle, colour, Sides::Drawn));
            }
        }
    }
    [cut, walls]
}

/// The surface of some elements, each in the colour of what owns it.
pub(super) fn surface_of(
    scene: &StaticScene,
    elements: &[OwnedElement],
    colour: impl Fn(u16) -> Color32,
) -> Vec<FaceVertex> {
    let mut is_one = vec![false; scene.tets.len()];
    elements.iter().for_each(|&(element, _)| is_one[element as usize] = true);
    let mut faces = Vec::new();
    for &(element, owner) in elements {
        let corners = scene.corners(element);
        for (side, &other) in scene.neighbours[element as usize].iter().enumerate() {
            if other == OUTSIDE || !is_one[other as usize] {
                faces.extend(face(FACES[side].map(|corner| corners[corner]), colour(owner), Sides::Drawn));
            }
        }
    }
    faces
}

/// Elements that objects occupy, in the objects' colours.
pub(super) fn occupied(frame: &Frame3d) -> Vec<FaceVertex> {
    let colour = |owner: u16| match frame.scene.bodies.get(usize::from(owner)) {
        Some(body) if owner != NO_OBJECT => material_colour(&body.material),
        _ => Color32::GRAY,
    };
    surface_of(&frame.scene, &frame.computed.occupied, colour)
}

/// Elements that changed in the last frame.
pub(super) fn changed(frame: &Frame3d, theme: &Theme) -> Vec<FaceVertex> {
    surface_of(&frame.scene, &frame.computed.changed, |_| theme.changed)
}

/// Edges that surfaces cut.
pub(super) fn cut_edges(frame: &Frame3d, theme: &Theme) -> Vec<Line> {
    let ends = |nodes: [u32; 2]| nodes.map(|node| frame.scene.nodes[node as usize]);
    frame.computed.cut.iter().map(|&nodes| Line::new(ends(nodes), 1.1, theme.cut)).collect()
}

/// The surface of a body.
pub(super) fn body(surface: &BodySurface) -> Vec<BodyVertex> {
    let vertex = |(position, normal): (&Vec3, &Vec3)| BodyVertex {
        position: position.to_array(),
        normal: normal.to_array(),
    };
    surface.positions.iter().zip(&surface.normals).map(vertex).collect()
}
