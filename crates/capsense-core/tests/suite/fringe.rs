//! The field around a right-angled edge of a conductor, r^(2/3) sin(2θ/3), on cells that know nothing of where the edge is.
//!
//! A box tells where its edges are, so that this field is solved for near them; of a triangle mesh rays tell how far it
//! reaches. In a plane, the potential of the exact field is given on the walls of a box, and the energy of what the lattice
//! makes of it compared with that of the exact field. The difference is what the edge seems to be too large or too small.

use crate::common::shapes::box_mesh;
use crate::common::walled::{Body, Held, Rule, WalledBox};
use crate::common::{conductor, mean_and_deviation};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::Connection;
use capsense_core::mesh::Lattice;
use std::f64::consts::PI;

/// Half the number of cells across the box.
const HALF: i32 = 12;

/// What the wedge is made of.
#[derive(Clone, Copy)]
enum Model {
    Box,
    Triangles,
    /// As who looks along z sees it.
    Layers,
    EdgesAlone,
}

/// The conductor fills x < vertex.x, z > vertex.y.
struct Wedge {
    vertex: DVec2,
    cell: DVec2,
}

impl Wedge {
    /// Distance from the vertex, and angle from the face below to that at the side.
    fn polar(&self, p: DVec2) -> [f64; 2] {
        let from = p - self.vertex;
        let angle = (-from.y).atan2(-from.x);
        [from.length(), if angle < -1e-12 { angle + 2.0 * PI } else { angle }]
    }

    fn contains(&self, p: DVec2) -> bool {
        p.x < self.vertex.x && p.y > self.vertex.y
    }

    fn potential(&self, p: DVec2) -> f64 {
        let [r, angle] = self.polar(p);
        if self.contains(p) { 0.0 } else { r.powf(2.0 / 3.0) * (2.0 / 3.0 * angle).sin() }
    }

    /// Of which the differences are fluxes.
    fn stream(&self, p: DVec2) -> f64 {
        let [r, angle] = self.polar(p);
        r.powf(2.0 / 3.0) * (2.0 / 3.0 * angle).cos()
    }

    /// ∮ u ∂u/∂n along the box, u taken at nodes and the flux of what is outside the conductor between half-way points.
    fn energy(&self) -> f64 {
        let mut sum = 0.0;
        let last = f64::from(HALF);
        for side in 0..4 {
            let along = side % 2;
            let at = |t: f64| {
                let fixed = if side < 2 { -last } else { last };
                self.cell * if along == 0 { DVec2::new(t, fixed) } else { DVec2::new(fixed, t) }
            };
            let outward = at(0.0).normalize();
            for node in -HALF..=HALF {
                let node = f64::from(node);
                let mut ends = [(node - 0.5).max(-last), (node + 0.5).min(last)].map(at);
                if ends.iter().all(|&end| self.contains(end)) {
                    continue;
                }
                for end in &mut ends {
                    if self.contains(*end) {
                        end[along] = self.vertex[along];
                    }
                }
                let middle = 0.5 * (ends[0] + ends[1]);
                let slope = self.potential(middle + 1e-4 * outward) - self.potential(middle - 1e-4 * outward);
                let flux = (self.stream(ends[0]) - self.stream(ends[1])).abs().copysign(slope);
                sum += self.potential(at(node)) * flux;
            }
        }
        sum
    }

    fn energy_on_lattice(&self, model: Model) -> f64 {
        let axis = |cell: f64| (-HALF..=HALF).map(|k| f64::from(k) * cell).collect::<Vec<_>>();
        let lattice = Lattice::new([axis(self.cell.x), vec![0.0, 1.0], axis(self.cell.y)]).unwrap();
        let size = 1e3;
        let centre = DVec3::new(self.vertex.x - 0.5 * size, 0.5, self.vertex.y + 0.5 * size);
        let size = DVec3::splat(size);
        let (shape, rule) = match model {
            Model::Box => (Shape::Box { size }, Rule::AsSolids),
            Model::Triangles => (box_mesh(size), Rule::AsSolids),
            Model::Layers => (Shape::Box { size }, Rule::AsLayers),
            Model::EdgesAlone => (Shape::Box { size }, Rule::EdgesAlone),
        };
        let body = Body { shape, pose: Pose::at(centre), material: conductor(Connection::Grounded) };
        let walled = WalledBox::with_walls_across([true, false, true], &lattice, &[body], rule);
        let wall = |p: DVec3| self.potential(DVec2::new(p.x, p.z));
        walled.solve(&[Held { wall: &wall, bodies: &[0.0] }]).energy(0, 0)
    }
}

/// Mean and standard deviation, over places of the vertex in a cell, of how much too large the energy is.
fn excess(cell: DVec2, model: Model) -> [f64; 2] {
    let parts = [0.1, 0.3, 0.5, 0.7, 0.9];
    let places = parts.iter().flat_map(|&x| parts.map(|y| DVec2::new(x, y)));
    let excesses: Vec<f64> = places
        .map(|place| {
            let wedge = Wedge { vertex: place * cell, cell };
            // Energies of the field grow with the 4/3rd power of lengths.
            (wedge.energy_on_lattice(model) - wedge.energy()) / (cell.x * cell.y).powf(2.0 / 3.0)
        })
        .collect();
    mean_and_deviation(&excesses)
}

#[test]
fn edges_of_boxes_are_where_they_are() {
    let bounds =
        [(DVec2::ONE, 0.01, 0.004), (DVec2::new(2.0, 1.0), 0.01, 0.02), (DVec2::new(1.0, 3.0), 0.03, 0.05)];
    for (cell, of_mean, of_spread) in bounds {
        let [mean, spread] = excess(cell, Model::Box);
        println!("{cell}: {mean:.4} ± {spread:.4}");
        assert!(mean.abs() < of_mean && spread < of_spread, "{cell}: {mean} {spread}");
    }
}

#[test]
fn edges_of_triangle_meshes_are_in_the_mean_where_they_are() {
    for (cell, bound) in [(DVec2::ONE, 0.015), (DVec2::new(2.0, 1.0), 0.03), (DVec2::new(1.0, 3.0), 0.05)] {
        let [mean, spread] = excess(cell, Model::Triangles);
        let [mean_alone, spread_alone] = excess(cell, Model::EdgesAlone);
        println!("{cell}: {mean:.3} ± {spread:.3}, edges alone {mean_alone:.3} ± {spread_alone:.3}");
        assert!(mean.abs() < bound, "{cell}: {mean}");
        assert!(mean_alone < -0.15 && spread < 0.65 * spread_alone, "{cell}: {spread} {spread_alone}");
    }
}

/// A camera knows how far walls reach along its rays, not how far faces do across them.
#[test]
fn edges_that_a_camera_sees_are_closer_to_where_they_are() {
    for (cell, bound) in [(DVec2::ONE, 0.09), (DVec2::new(2.0, 1.0), 0.06), (DVec2::new(1.0, 3.0), 0.17)] {
        let [mean, spread] = excess(cell, Model::Layers);
        let [mean_alone, spread_alone] = excess(cell, Model::EdgesAlone);
        println!("{cell}: {mean:.3} ± {spread:.3}, edges alone {mean_alone:.3} ± {spread_alone:.3}");
        assert!(mean.abs() < bound && bound < mean_alone.abs(), "{cell}: {mean} {mean_alone}");
        assert!(spread < 0.75 * spread_alone, "{cell}: {spread} {spread_alone}");
    }
}
