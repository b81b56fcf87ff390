//! The camera: where it stands, how it follows the pointer, and how points and pixels belong together.

use capsense_core::geometry::Aabb;
use egui::{Pos2, Rect, Vec2};
use glam::{DMat4, DVec2, DVec3, DVec4};

/// Half the height of the picture at a distance of one: the tangent of 14 degrees. Narrow, so that sizes compare well.
const HALF_HEIGHT: f64 = 0.25;
/// What [`Camera::fit`] leaves free around a box, in parts of the picture.
const MARGIN: f64 = 1.08;
/// Nearest and farthest distance from the point looked at, metres.
const DISTANCES: [f64; 2] = [1e-3, 1e3];
/// What is drawn reaches from here to there, in parts of that distance. Depth is kept in single precision.
const NEAR: f64 = 0.02;
const FAR: f64 = 60.0;

/// Turns around a point. z is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The point looked at, metres.
    pub target: DVec3,
    /// Angle around z in radians; 0 looks along +y.
    pub yaw: f64,
    /// Height above the horizon in radians.
    pub pitch: f64,
    /// Distance from the point looked at, metres.
    pub distance: f64,
    /// Whether lines that are parallel stay so in the picture.
    pub is_orthographic: bool,
}

impl Default for Camera {
    fn default() -> Self {
        Self { target: DVec3::ZERO, yaw: 0.5, pitch: 0.42, distance: 1.0, is_orthographic: false }
    }
}

impl Camera {
    /// Unit vectors to the right, upwards, and from the camera into the picture.
    pub fn axes(&self) -> [DVec3; 3] {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        let right = DVec3::new(cos_yaw, sin_yaw, 0.0);
        let forward = DVec3::new(-sin_yaw * cos_pitch, cos_yaw * cos_pitch, -sin_pitch);
        [right, right.cross(forward), forward]
    }

    /// Where the camera stands, metres.
    pub fn eye(&self) -> DVec3 {
        self.target - self.distance * self.axes()[2]
    }

    /// Turns by a distance that the pointer was dragged, in points of the screen.
    pub fn turn(&mut self, points: Vec2) {
        self.yaw -= f64::from(points.x) * 0.008;
        let limit = std::f64::consts::FRAC_PI_2;
        self.pitch = (self.pitch + f64::from(points.y) * 0.008).clamp(-limit, limit);
    }

    /// Moves the point looked at so that it follows the pointer, in points of a picture of this size.
    pub fn pan(&mut self, points: Vec2, rect: Rect) {
        let [right, up, _] = self.axes();
        let metres = self.metres_per_point(rect);
        self.target += (up * f64::from(points.y) - right * f64::from(points.x)) * metres;
    }

    /// Moves nearer (above 1) or farther (below 1); what is under the pointer, at the depth of the point looked at, stays
    /// there.
    pub fn zoom(&mut self, factor: f64, pointer: Pos2, rect: Rect) {
        if !(factor.is_finite() && factor > 0.0) {
            return;
        }
        let [right, up, _] = self.axes();
        let before = self.metres_per_point(rect);
        self.distance = (self.distance / factor).clamp(DISTANCES[0], DISTANCES[1]);
        let off = (pointer - rect.center()) * (before - self.metres_per_point(rect)) as f32;
        self.target += right * f64::from(off.x) - up * f64::from(off.y);
    }

    /// Looks at the middle of a box from where all of it is seen, in the same direction. Boxes that are empty or not finite
    /// change nothing.
    pub fn fit(&mut self, bounds: &Aabb, rect: Rect) {
        let reach = bounds.size().length();
        if !(reach.is_finite() && reach > 0.0 && rect.is_positive()) {
            return;
        }
        let middle = 0.5 * (bounds.min + bounds.max);
        let [right, up, forward] = self.axes();
        let half = HALF_HEIGHT * DVec2::new(f64::from(rect.aspect_ratio()), 1.0) / MARGIN;
        let needed = |corner: DVec3| {
            let from_middle = corner - middle;
            let seen = DVec2::new(from_middle.dot(right), from_middle.dot(up)).abs() / half;
            let nearer = if self.is_orthographic { 0.0 } else { from_middle.dot(forward) };
            seen.max_element() - nearer
        };
        let distance = corners(bounds).map(needed).fold(0.0, f64::max);
        self.target = middle;
        self.distance = distance.clamp(DISTANCES[0], DISTANCES[1]);
    }

    /// Length that a point of the screen covers at the depth of the point looked at, metres.
    pub fn metres_per_point(&self, rect: Rect) -> f64 {
        2.0 * HALF_HEIGHT * self.distance / f64::from(rect.height().max(1.0))
    }

    /// From the sensor frame to clip coordinates of a picture of this shape; depth from 0 to 1.
    pub fn clip_from_sensor(&self, aspect: f64) -> DMat4 {
        let [right, up, forward] = self.axes();
        let [near, far] = [NEAR, FAR].map(|part| part * self.distance);
        let eye = self.eye();
        let row = |axis: DVec3| axis.extend(-axis.dot(eye));
        let (x, y, z) = (row(right) / (HALF_HEIGHT * aspect), row(up) / HALF_HEIGHT, row(forward));
        let rows = if self.is_orthographic {
            // As much is drawn behind the camera as before it: it may stand within what it shows.
            let depth = (z + DVec4::W * far) / (2.0 * far);
            [x / self.distance, y / self.distance, depth, DVec4::W]
        } else {
            [x, y, (z * far - DVec4::W * far * near) / (far - near), z]
        };
        DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
    }

    /// Where a point is seen; `None` behind the camera.
    pub fn project(&self, point: DVec3, rect: Rect) -> Option<Pos2> {
        let clip = self.clip_from_sensor(f64::from(rect.aspect_ratio())) * point.extend(1.0);
        (clip.w > NEAR * self.distance || self.is_orthographic).then(|| {
            let half = 0.5 * rect.size();
            rect.center() + Vec2::new((clip.x / clip.w) as f32 * half.x, -(clip.y / clip.w) as f32 * half.y)
        })
    }

    /// The line of sight through a place of the picture.
    pub fn ray(&self, at: Pos2, rect: Rect) -> Ray {
        let [right, up, forward] = self.axes();
        let off = at - rect.center();
        let metres = self.metres_per_point(rect);
        let across = (right * f64::from(off.x) - up * f64::from(off.y)) * metres;
        if self.is_orthographic {
            let origin = self.target + across - forward * FAR * self.distance;
            Ray { origin, direction: forward }
        } else {
            Ray { origin: self.eye(), direction: (forward * self.distance + across).normalize() }
        }
    }
}

/// A half-line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, metres.
    pub origin: DVec3,
    /// Where it leads, of unit length.
    pub direction: DVec3,
}

impl Ray {
    /// A point on it.
    pub fn at(&self, distance: f64) -> DVec3 {
        self.origin + distance * self.direction
    }

    /// Where it meets a plane; `None` where it nearly runs along it or would have to run backwards.
    pub fn meets_plane(&self, through: DVec3, normal: DVec3) -> Option<DVec3> {
        let slope = self.direction.dot(normal);
        let distance = (through - self.origin).dot(normal) / slope;
        (slope.abs() > 1e-3 && distance > 0.0).then(|| self.at(distance))
    }

    /// The place along a line, in units of its direction from `through`, that is nearest to the ray; `None` where both are
    /// nearly parallel.
    pub fn nearest_on_line(&self, through: DVec3, direction: DVec3) -> Option<f64> {
        let cosine = self.direction.dot(direction);
        let sine_squared = 1.0 - cosine * cosine;
        let off = self.origin - through;
        (sine_squared > 1e-4).then(|| (off.dot(direction) - cosine * off.dot(self.direction)) / sine_squared)
    }
}

/// The eight corners of a box.
pub(super) fn corners(bounds: &Aabb) -> impl Iterator<Item = DVec3> {
    let Aabb { min, max } = *bounds;
    (0..8).map(move |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { max[axis] } else { min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Rect {
        Rect::from_min_size(Pos2::new(30.0, 10.0), Vec2::new(800.0, 600.0))
    }

    fn cameras() -> [Camera; 2] {
        let camera = Camera { target: DVec3::new(0.1, -0.2, 0.3), ..Camera::default() };
        [camera, Camera { is_orthographic: true, ..camera }]
    }

    #[test]
    fn orbiting_and_zooming_at_the_middle_keep_the_target_where_it_is() {
        for mut camera in cameras() {
            let target = camera.target;
            camera.turn(Vec2::new(123.0, -45.0));
            camera.zoom(1.7, picture().center(), picture());
            assert_eq!(camera.target, target);
            assert!((camera.eye().distance(target) - camera.distance).abs() < 1e-12);
            let seen = camera.project(target, picture()).unwrap();
            assert!(seen.distance(picture().center()) < 1e-3);
            camera.turn(Vec2::new(0.0, 1e6));
            assert_eq!(camera.pitch, std::f64::consts::FRAC_PI_2);
        }
    }

    #[test]
    fn a_fit_shows_all_of_a_box_and_hardly_more() {
        let bounds = Aabb { min: DVec3::new(-0.25, -0.1, -0.05), max: DVec3::new(0.4, 0.25, 0.45) };
        for mut camera in cameras() {
            for turn in [0.0, 90.0, 200.0, 333.0] {
                camera.turn(Vec2::new(turn, 0.3 * turn - 40.0));
                camera.fit(&bounds, picture());
                let seen: Vec<Pos2> =
                    corners(&bounds).map(|corner| camera.project(corner, picture()).unwrap()).collect();
                assert!(seen.iter().all(|at| picture().contains(*at)), "{seen:?}");
                let used = Rect::from_points(&seen).size() / picture().size();
                assert!(used.max_elem() > 0.7, "{used:?}");
            }
            let before = camera;
            camera.fit(&Aabb::EMPTY, picture());
            assert_eq!(camera, before);
        }
    }

    #[test]
    fn rays_and_projections_are_inverse() {
        for camera in cameras() {
            for at in [Pos2::new(40.0, 20.0), Pos2::new(400.0, 333.0), Pos2::new(820.0, 600.0)] {
                let ray = camera.ray(at, picture());
                for distance in [0.8, 1.3] {
                    let from_eye = if camera.is_orthographic { FAR * camera.distance } else { 0.0 };
                    let seen = camera.project(ray.at(from_eye + distance), picture()).unwrap();
                    assert!(seen.distance(at) < 1e-2, "{seen:?} {at:?}");
                }
            }
        }
    }

    #[test]
    fn zooming_keeps_what_is_under_the_pointer() {
        let pointer = Pos2::new(600.0, 100.0);
        for mut camera in cameras() {
            let [_, _, forward] = camera.axes();
            let under = camera.ray(pointer, picture()).meets_plane(camera.target, forward).unwrap();
            camera.zoom(2.5, pointer, picture());
            assert!(camera.project(under, picture()).unwrap().distance(pointer) < 1e-2);
            let before = camera;
            camera.zoom(f64::NAN, pointer, picture());
            assert_eq!(camera, before);
        }
    }

    #[test]
    fn panning_follows_the_pointer() {
        for mut camera in cameras() {
            let target = camera.target;
            let moved = Vec2::new(50.0, -30.0);
            camera.pan(moved, picture());
            let seen = camera.project(target, picture()).unwrap();
            assert!(seen.distance(picture().center() + moved) < 1e-2);
        }
    }

    #[test]
    fn the_picture_is_the_right_way_round_and_near_points_are_before_far_ones() {
        for camera in cameras().map(|camera| Camera { yaw: 0.0, pitch: 0.0, ..camera }) {
            let seen = |off: DVec3| camera.project(camera.target + off, picture()).unwrap();
            assert!(seen(DVec3::X * 0.1).x > seen(DVec3::ZERO).x);
            assert!(seen(DVec3::Z * 0.1).y < seen(DVec3::ZERO).y);
            let depth = |off: DVec3| {
                let clip = camera.clip_from_sensor(1.0) * (camera.target + off).extend(1.0);
                clip.z / clip.w
            };
            assert!(depth(DVec3::NEG_Y * 0.5) < depth(DVec3::Y * 0.5));
            assert!(depth(DVec3::Y * 10.0) < 1.0 && depth(DVec3::NEG_Y * 0.9) > 0.0);
        }
    }

    #[test]
    fn the_nearest_place_on_a_line_is_at_right_angles_to_both() {
        let ray =
            Ray { origin: DVec3::new(1.0, 2.0, 3.0), direction: DVec3::new(1.0, -2.0, 0.5).normalize() };
        let (through, along) = (DVec3::new(0.5, 0.0, -1.0), DVec3::Z);
        let place = through + along * ray.nearest_on_line(through, along).unwrap();
        let on_ray = ray.at((place - ray.origin).dot(ray.direction));
        assert!((place - on_ray).dot(along).abs() < 1e-12);
        assert_eq!(ray.nearest_on_line(through, ray.direction), None);
    }
}
