//! Handles that move and turn a body: arrows along the axes, squares in the planes between them, rings around them, and
//! the body itself, which moves across the line of sight.

use super::camera::{Camera, Ray};
use super::frame::BodyPose;
use super::theme::Theme;
use capsense_core::geometry::Pose;
use egui::{Color32, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use glam::{DQuat, DVec3};

/// Length of the arrows in points of the screen; the other lengths are parts of it.
const LENGTH: f64 = 84.0;
const RING: f64 = 0.78;
const SQUARE: [f64; 2] = [0.24, 0.44];
const GAP: f64 = 0.12;
/// Segments of a ring.
const SEGMENTS: usize = 64;
/// A handle is grabbed within so many points.
const REACH: f32 = 7.0;
/// Arrows that point at the viewer and planes seen from the side are not shown: cosines with the line of sight.
const POINTS_AT_VIEWER: f64 = 0.96;
const SEEN_FROM_SIDE: f64 = 0.18;

/// Colours of x, y and z.
pub(super) const AXIS_COLOURS: [Color32; 3] = [
    Color32::from_rgb(0xe0, 0x62, 0x5c),
    Color32::from_rgb(0x6f, 0xb0, 0x52),
    Color32::from_rgb(0x55, 0x93, 0xe6),
];

/// What is grabbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// The arrow along an axis.
    Along(usize),
    /// The square across an axis.
    Across(usize),
    /// The ring around an axis.
    Around(usize),
    /// The body itself.
    Body,
}

/// How the scene is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub(super) camera: Camera,
    pub(super) rect: Rect,
}

impl Sight {
    pub(super) fn project(&self, point: DVec3) -> Option<Pos2> {
        self.camera.project(point, self.rect)
    }

    pub(super) fn ray(&self, at: Pos2) -> Ray {
        self.camera.ray(at, self.rect)
    }

    /// From a point to the viewer.
    fn towards_eye(&self, point: DVec3) -> DVec3 {
        match self.camera.is_orthographic {
            true => -self.camera.axes()[2],
            false => (self.camera.eye() - point).normalize_or(-self.camera.axes()[2]),
        }
    }

    /// Length that a point of the screen covers where something is.
    fn metres_per_point_at(&self, place: DVec3) -> f64 {
        let depth = (place - self.camera.eye()).dot(self.camera.axes()[2]).max(0.0);
        let part = if self.camera.is_orthographic { 1.0 } else { depth / self.camera.distance };
        part * self.camera.metres_per_point(self.rect)
    }
}

fn axis(index: usize) -> DVec3 {
    DVec3::AXES[index]
}

/// The handles at a body's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gizmo {
    sight: Sight,
    origin: DVec3,
    /// Of the arrows, metres.
    length: f64,
}

impl Gizmo {
    pub(super) fn new(sight: Sight, origin: DVec3) -> Self {
        Self { sight, origin, length: LENGTH * sight.metres_per_point_at(origin) }
    }

    /// The handle at a place of the screen. Arrows come before squares, squares before rings.
    pub(super) fn handle_at(&self, at: Pos2) -> Option<Handle> {
        let squares = (0..3).filter(|&k| self.square(k).is_some_and(|corners| is_within(at, &corners)));
        let near = |points: &[Pos2]| distance_to_line(at, points) < REACH;
        let arrows = (0..3).filter(|&k| self.arrow(k).is_some_and(|ends| near(&ends)));
        let rings = (0..3).filter(|&k| near(&self.ring(k, true)));
        let arrows = arrows.map(Handle::Along);
        arrows.chain(squares.map(Handle::Across)).chain(rings.map(Handle::Around)).next()
    }

    fn cosine(&self, of_axis: usize) -> f64 {
        axis(of_axis).dot(self.sight.towards_eye(self.origin)).abs()
    }

    fn arrow(&self, of_axis: usize) -> Option<[Pos2; 2]> {
        let at = |part: f64| self.sight.project(self.origin + axis(of_axis) * part * self.length);
        let is_shown = self.cosine(of_axis) < POINTS_AT_VIEWER;
        is_shown.then(|| Some([at(GAP)?, at(1.0)?])).flatten()
    }

    fn square(&self, of_axis: usize) -> Option<[Pos2; 4]> {
        let (u, v) = (axis((of_axis + 1) % 3), axis((of_axis + 2) % 3));
        let [near, far] = SQUARE;
        let at = |a: f64, b: f64| self.sight.project(self.origin + self.length * (u * a + v * b));
        let is_shown = self.cosine(of_axis) > SEEN_FROM_SIDE;
        is_shown.then(|| Some([at(near, near)?, at(far, near)?, at(far, far)?, at(near, far)?])).flatten()
    }

    /// The half of a ring that is nearer to the viewer, or the other.
    fn ring(&self, of_axis: usize, is_near: bool) -> Vec<Pos2> {
        let normal = axis(of_axis);
        let towards = self.sight.towards_eye(self.origin);
        let in_plane = (towards - normal * towards.dot(normal)).normalize_or(axis((of_axis + 1) % 3));
        let beside = normal.cross(in_plane) * if is_near { 1.0 } else { -1.0 };
        let middle = in_plane * if is_near { 1.0 } else { -1.0 };
        let at = |k: usize| {
            let angle = std::f64::consts::PI * (k as f64 / SEGMENTS as f64 - 0.5);
            self.origin + RING * self.length * (middle * angle.cos() + beside * angle.sin())
        };
        (0..=SEGMENTS).filter_map(|k| self.sight.project(at(k))).collect()
    }

    /// Draws all handles, one of them as the one under the pointer.
    pub(super) fn draw(&self, painter: &Painter, theme: &Theme, active: Option<Handle>) {
        let colour = |handle: Handle, of_axis: usize| match active {
            Some(active) if active == handle => theme.selected,
            Some(_) => AXIS_COLOURS[of_axis].gamma_multiply(0.65),
            None => AXIS_COLOURS[of_axis],
        };
        for k in 0..3 {
            let ring = colour(Handle::Around(k), k);
            painter.add(Shape::line(self.ring(k, false), Stroke::new(1.0, ring.gamma_multiply(0.28))));
            painter.add(Shape::line(self.ring(k, true), Stroke::new(1.8, ring)));
        }
        for k in 0..3 {
            if let Some(corners) = self.square(k) {
                let colour = colour(Handle::Across(k), k);
                let fill = colour.gamma_multiply(0.35);
                painter.add(Shape::convex_polygon(corners.to_vec(), fill, Stroke::new(1.0, colour)));
            }
            if let Some(ends) = self.arrow(k) {
                let colour = colour(Handle::Along(k), k);
                painter.line_segment(ends, Stroke::new(2.2, colour));
                painter.add(Shape::convex_polygon(arrow_head(ends), colour, Stroke::NONE));
            }
        }
        if let Some(middle) = self.sight.project(self.origin) {
            painter.circle(middle, 3.0, theme.background, Stroke::new(1.5, theme.text));
        }
    }
}

/// The tip of an arrow, beyond its end.
fn arrow_head([from, to]: [Pos2; 2]) -> Vec<Pos2> {
    let along = (to - from).normalized();
    let side = along.rot90() * 4.5;
    vec![to + along * 11.0, to + side, to - side]
}

/// From a place to the nearest point of a line of segments, in points.
fn distance_to_line(at: Pos2, points: &[Pos2]) -> f32 {
    let to_segment = |pair: &[Pos2]| {
        let (along, off) = (pair[1] - pair[0], at - pair[0]);
        let part = (off.dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
        (off - along * part).length()
    };
    points.windows(2).map(to_segment).fold(f32::INFINITY, f32::min)
}

/// Whether a place lies in a convex polygon.
fn is_within(at: Pos2, corners: &[Pos2]) -> bool {
    let next = corners.iter().cycle().skip(1);
    let turns = corners.iter().zip(next).map(|(a, b)| (*b - *a).rot90().dot(at - *a));
    turns.clone().all(|turn| turn >= 0.0) || turns.clone().all(|turn| turn <= 0.0)
}

/// A body on its way.
#[derive(Clone, Debug)]
pub(super) struct Drag {
    pub(super) body: usize,
    pub(super) handle: Handle,
    /// Where it was grabbed, and how it stood then.
    pointer: Pos2,
    grabbed: DVec3,
    start: Pose,
}

impl Drag {
    /// Grabs a handle of a body. `grabbed` is the point of the body under the pointer; it matters for the body itself alone.
    pub(super) fn new(body: usize, handle: Handle, pointer: Pos2, grabbed: DVec3, pose: &BodyPose) -> Self {
        Self { body, handle, pointer, grabbed, start: pose.pose() }
    }

    /// How the body stood.
    pub(super) fn start(&self) -> &Pose {
        &self.start
    }

    /// How the body stands with the pointer elsewhere; `None` where that cannot be told.
    pub(super) fn pose(&self, sight: &Sight, pointer: Pos2) -> Option<Pose> {
        let origin = self.start.translation;
        let rays = [self.pointer, pointer].map(|at| sight.ray(at));
        let moved = |by: DVec3| Pose { translation: origin + by, ..self.start };
        match self.handle {
            Handle::Along(k) => {
                let [from, to] = rays.map(|ray| ray.nearest_on_line(origin, axis(k)));
                Some(moved(axis(k) * (to? - from?)))
            }
            Handle::Across(k) => {
                let [from, to] = rays.map(|ray| ray.meets_plane(origin, axis(k)));
                Some(moved(to? - from?))
            }
            Handle::Body => {
                let [from, to] = rays.map(|ray| ray.meets_plane(self.grabbed, sight.camera.axes()[2]));
                Some(moved(to? - from?))
            }
            Handle::Around(k) => {
                let turn = DQuat::from_axis_angle(axis(k), self.angle(sight, k, rays, pointer)?);
                Some(Pose { rotation: (turn * self.start.rotation).normalize(), ..self.start })
            }
        }
    }

    /// By which angle the pointer turned around an axis: in the ring's plane, or, where that is seen from the side, by the
    /// way along the ring.
    fn angle(&self, sight: &Sight, of_axis: usize, rays: [Ray; 2], pointer: Pos2) -> Option<f64> {
        let (origin, normal) = (self.start.translation, axis(of_axis));
        let towards = sight.towards_eye(origin);
        if towards.dot(normal).abs() > SEEN_FROM_SIDE {
            let [from, to] = rays.map(|ray| ray.meets_plane(origin, normal).map(|place| place - origin));
            let (from, to) = (from?, to?);
            return Some(normal.dot(from.cross(to)).atan2(from.dot(to)));
        }
        let radius = RING * LENGTH * sight.metres_per_point_at(origin);
        let tangent = normal.cross(towards).normalize_or_zero();
        let [a, b] =
            [DVec3::ZERO, tangent * radius].map(|off| sight.project(origin + towards * radius + off));
        let along: Vec2 = b? - a?;
        let way = (pointer - self.pointer).dot(along) / along.length_sq().max(1.0);
        Some(f64::from(way))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(is_orthographic: bool) -> Sight {
        let rect = Rect::from_min_size(Pos2::new(5.0, 7.0), Vec2::new(800.0, 600.0));
        Sight { camera: Camera { is_orthographic, ..Camera::default() }, rect }
    }

    fn body() -> BodyPose {
        BodyPose::new("bar", &Pose::at(DVec3::new(0.05, -0.03, 0.04)))
    }

    /// Grabs a handle, drags it by `by` and returns where the pointer is then, and how the body stands.
    fn drag(sight: &Sight, handle: Handle, by: Vec2) -> (Pos2, Pose) {
        let body = body();
        let gizmo = Gizmo::new(*sight, body.position);
        let at = match handle {
            Handle::Along(k) => gizmo.arrow(k).map(|[a, b]| a + (b - a) * 0.9),
            Handle::Across(k) => gizmo.square(k).map(|[a, _, c, _]| a + (c - a) * 0.5),
            // Where no arrow and no other ring is in front.
            Handle::Around(k) => {
                gizmo.ring(k, true).into_iter().find(|&at| gizmo.handle_at(at) == Some(handle))
            }
            Handle::Body => sight.project(body.position),
        };
        let at = at.unwrap();
        if handle != Handle::Body {
            assert_eq!(gizmo.handle_at(at), Some(handle));
        }
        let drag = Drag::new(0, handle, at, body.position, &body);
        (at + by, drag.pose(sight, at + by).unwrap())
    }

    #[test]
    fn a_body_moves_by_what_the_pointer_asks_for() {
        for sight in [sight(false), sight(true)] {
            for (handle, free) in [
                (Handle::Along(0), DVec3::X),
                (Handle::Along(1), DVec3::Y),
                (Handle::Along(2), DVec3::Z),
                (Handle::Across(2), DVec3::new(1.0, 1.0, 0.0)),
                (Handle::Across(0), DVec3::new(0.0, 1.0, 1.0)),
                (Handle::Body, DVec3::ONE),
            ] {
                let by = match handle {
                    Handle::Along(k) => {
                        let [from, to] = Gizmo::new(sight, body().position).arrow(k).unwrap();
                        0.5 * (to - from)
                    }
                    _ => Vec2::new(40.0, -25.0),
                };
                let (to, pose) = drag(&sight, handle, by);
                let moved = pose.translation - body().position;
                assert!(moved.length() > 0.01, "{handle:?} {moved}");
                assert!((moved * (1.0 - free)).length() < 1e-9, "{handle:?} {moved}");
                assert_eq!(pose.rotation, body().rotation);
                // What was asked for: the point that was grabbed is under the pointer.
                let ray = sight.ray(to - by);
                let grabbed = match handle {
                    Handle::Along(k) => {
                        body().position + axis(k) * ray.nearest_on_line(body().position, axis(k)).unwrap()
                    }
                    Handle::Across(k) => ray.meets_plane(body().position, axis(k)).unwrap(),
                    _ => body().position,
                };
                let seen = sight.project(grabbed + moved).unwrap();
                assert!(seen.distance(to) < 0.5, "{handle:?}: {seen:?} {to:?}");
            }
        }
    }

    #[test]
    fn a_ring_turns_its_body_with_the_pointer() {
        for sight in [sight(false), sight(true)] {
            for k in 0..3 {
                let (_, pose) = drag(&sight, Handle::Around(k), Vec2::new(12.0, 9.0));
                assert_eq!(pose.translation, body().position);
                let (turned_about, angle) = pose.rotation.to_axis_angle();
                assert!(turned_about.dot(axis(k)).abs() > 1.0 - 1e-9, "{k} {turned_about}");
                assert!(angle > 0.02 && angle < 1.0, "{k} {angle}");
            }
            // A quarter of a turn seen from above.
            let above = Sight { camera: Camera { pitch: 1.5, yaw: 0.0, ..sight.camera }, ..sight };
            let middle = above.project(body().position).unwrap();
            let drag = Drag::new(0, Handle::Around(2), middle + Vec2::X * 60.0, body().position, &body());
            let pose = drag.pose(&above, middle - Vec2::Y * 60.0).unwrap();
            let quarter = pose.rotation.angle_between(DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2));
            assert!(quarter < 0.02, "{quarter}");
        }
    }

    #[test]
    fn a_ring_seen_from_the_side_turns_too() {
        let side = Sight { camera: Camera { pitch: 0.05, yaw: 0.0, ..Camera::default() }, ..sight(false) };
        let middle = side.project(body().position).unwrap();
        let drag = Drag::new(0, Handle::Around(2), middle, body().position, &body());
        let pose = drag.pose(&side, middle + Vec2::X * 30.0).unwrap();
        let (about, angle) = pose.rotation.to_axis_angle();
        // What is in front goes to the right: counter-clockwise seen from above.
        assert!(about.z > 0.99 && (angle - 30.0 / (RING * LENGTH)).abs() < 0.05, "{about} {angle}");
    }

    #[test]
    fn nothing_is_grabbed_beside_the_handles() {
        let sight = sight(false);
        let gizmo = Gizmo::new(sight, body().position);
        let middle = sight.project(body().position).unwrap();
        assert_eq!(gizmo.handle_at(middle + Vec2::new(300.0, 0.0)), None);
        assert_eq!(gizmo.handle_at(sight.rect.left_top()), None);
    }
}
