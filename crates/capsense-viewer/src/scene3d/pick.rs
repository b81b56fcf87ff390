//! Which body a line of sight meets first.

use super::camera::Ray;
use super::frame::BodyPose;
use super::static_scene::BodySurface;
use glam::DVec3;

/// The body that a ray meets first, and where, in metres from its start.
pub(super) fn first_met(ray: &Ray, surfaces: &[BodySurface], poses: &[BodyPose]) -> Option<(usize, f64)> {
    let met = surfaces.iter().zip(poses).enumerate().filter_map(|(index, (surface, body))| {
        let pose = body.pose();
        let from_sensor = pose.rotation.inverse();
        let ray = Ray { origin: pose.object_from_sensor(ray.origin), direction: from_sensor * ray.direction };
        distance_to_surface(&ray, surface).map(|distance| (index, distance))
    });
    met.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn distance_to_surface(ray: &Ray, surface: &BodySurface) -> Option<f64> {
    let triangles = surface.positions.as_chunks::<3>().0.iter();
    triangles
        .filter_map(|corners| distance_to_triangle(ray, corners.map(|corner| corner.as_dvec3())))
        .reduce(f64::min)
}

/// After Möller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997; from either side.
fn distance_to_triangle(ray: &Ray, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (u, v) = (b - a, c - a);
    let across = ray.direction.cross(v);
    let determinant = u.dot(across);
    let from_a = ray.origin - a;
    let at_u = from_a.dot(across) / determinant;
    let normal = from_a.cross(u);
    let at_v = ray.direction.dot(normal) / determinant;
    let distance = v.dot(normal) / determinant;
    // A flat triangle has no number for these, and none of the comparisons holds.
    (at_u >= 0.0 && at_v >= 0.0 && at_u + at_v <= 1.0 && distance > 0.0).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::geometry::{Pose, Shape};
    use capsense_core::material::{Connection, Material};
    use glam::DQuat;
    use std::f64::consts::FRAC_PI_2;

    fn surface(shape: &Shape) -> BodySurface {
        BodySurface::new(shape, Material::Conductor(Connection::Grounded))
    }

    #[test]
    fn the_nearest_body_is_met_where_its_surface_is() {
        let surfaces = [
            surface(&Shape::Sphere { radius: 0.1 }),
            surface(&Shape::Box { size: DVec3::new(0.2, 0.4, 0.6) }),
        ];
        let turned =
            Pose { translation: DVec3::new(0.0, 0.0, -1.0), rotation: DQuat::from_rotation_x(FRAC_PI_2) };
        let poses = [BodyPose::new("ball", &Pose::at(DVec3::ZERO)), BodyPose::new("box", &turned)];
        let down = |x: f64| Ray { origin: DVec3::new(x, 0.01, 2.0), direction: DVec3::NEG_Z };
        let (body, distance) = first_met(&down(0.01), &surfaces, &poses).unwrap();
        assert_eq!(body, 0);
        assert!((distance - 1.9).abs() < 2e-3, "{distance}");
        // Beside the ball, the box: turned about x, it is 0.4 m high.
        let (body, distance) = first_met(&down(0.0998), &surfaces, &poses).unwrap();
        assert_eq!(body, 1);
        assert!((distance - 2.8).abs() < 1e-4, "{distance}");
        assert_eq!(first_met(&down(0.2), &surfaces, &poses), None);
        let up = Ray { direction: DVec3::Z, ..down(0.0) };
        assert_eq!(first_met(&up, &surfaces, &poses), None, "bodies behind are not met");
    }
}
