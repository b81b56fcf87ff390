//! Edges past the wall of a body that a camera sees: what is left of them goes over from one plane of nodes to the next.

use crate::common::updater::Updater;
use crate::common::{DOMAIN, FLOATING, GROUNDED, dielectric, stripes_sensor};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::Material;
use capsense_core::mesh::{Background, Lattice};
use capsense_core::occupancy::{Coupling, DepthLayers, EdgeGeometry, NO_OBJECT, Occupancy, OrthographicView};
use capsense_core::sensor::{FREE, Terminal};
use capsense_core::stiffness::EdgeNetwork;

/// Cells of a length of one, eight along each axis.
const CELLS: usize = 8;

/// The node behind the wall at 4.75. Its edge along x leads past that.
const NODE: [usize; 3] = [4, 4, 4];

/// Pixels along either side of the image, and columns of them before the wall.
const PIXELS: usize = 32;
const COLUMNS: usize = 19;

/// Layers of objects that fill x < 4.75, by their front and back at the wall, and by how much both rise from column to column behind it, in
/// parts of a column's width.
fn slanting(faces: &[[f64; 2]], slope: f64) -> DepthLayers {
    let domain = Aabb { min: DVec3::ZERO, max: DVec3::splat(CELLS as f64) };
    let view = OrthographicView { domain, width: PIXELS, height: PIXELS };
    let mut layers = DepthLayers::empty(view, faces.len());
    for (object, &[low, high]) in faces.iter().enumerate() {
        let (front, back) = layers.layer_mut(object);
        for pixel in (0..PIXELS * PIXELS).filter(|pixel| pixel % PIXELS < COLUMNS) {
            let rise = slope * (COLUMNS - 1 - pixel % PIXELS) as f64 * view.pixel_size().x;
            (front[pixel], back[pixel]) = ((low + rise) as f32, (high + rise) as f32);
        }
    }
    layers
}

/// What is left of the edges from `NODE` along x and along z, and which conductor holds it.
struct Found {
    past_wall: Coupling,
    along_rays: Coupling,
    /// The edge along z from the node before, away from the wall.
    further_in: Coupling,
    holder: u16,
}

fn find(materials: &[Material], layers: &DepthLayers, terminal: Terminal) -> Found {
    let planes: Vec<f64> = (0..=CELLS).map(|plane| plane as f64).collect();
    let lattice = Lattice::new([planes.clone(), planes.clone(), planes]).unwrap();
    let network = EdgeNetwork::assemble_lattice(&lattice, &Background::vacuum(lattice.tet_count()));
    let nodes = lattice.to_tet_mesh().unwrap().nodes().to_vec();
    let node = lattice.node_index(NODE);
    let mut terminals = vec![FREE; nodes.len()];
    terminals[node] = terminal;
    let mut occupancy = Occupancy::empty(nodes.len(), network.edges().len());
    let mesh = EdgeGeometry {
        nodes: &nodes,
        terminals: &terminals,
        edges: network.edges(),
        permittivity: network.permittivity(),
    };
    occupancy.update(mesh, materials, layers);
    let coupling = |edge: usize| *occupancy.coupling(edge);
    Found {
        past_wall: coupling(3 * node),
        along_rays: coupling(3 * node + 2),
        further_in: coupling(3 * (node - 1) + 2),
        holder: occupancy.conductors()[node],
    }
}

fn past_wall(materials: &[Material], faces: &[[f64; 2]], terminal: Terminal) -> Coupling {
    find(materials, &slanting(faces, 0.0), terminal).past_wall
}

/// What ties the end outside to the conductor by the end behind the wall, and that through the face.
fn tie(front: f64) -> f64 {
    let found = find(&[GROUNDED], &slanting(&[[front, 20.0]], 0.0), FREE);
    assert_eq!(found.holder == NO_OBJECT, front >= 4.0, "{front}");
    assert!(!found.past_wall.is_linked() && !found.along_rays.is_linked());
    if found.holder != NO_OBJECT {
        return found.past_wall.through;
    }
    1.0 / (1.0 / found.past_wall.through + 1.0 / found.along_rays.through)
}

#[test]
fn a_face_that_passes_the_plane_of_an_edge_makes_no_step_in_what_ties_its_end_to_the_body() {
    let mut last = tie(2.0);
    // A quarter of the edge is outside.
    assert!((last - 4.0).abs() < 1e-3, "{last}");
    for step in 1..=298 {
        let now = tie(2.0 + 0.01 * f64::from(step));
        assert!(now <= last + 1e-6 && now > last - 0.08, "{step}: {last} {now}");
        last = now;
    }
    assert_eq!(past_wall(&[GROUNDED], &[[5.0, 20.0]], FREE), Coupling::PLAIN, "a cell away there is nothing");
}

/// As if half-way under the face: where no wall is, the edge through the face ends there.
#[test]
fn edges_through_a_face_are_tapped_beside_walls_alone() {
    let found = find(&[GROUNDED], &slanting(&[[4.25, 20.0]], 0.0), FREE);
    assert!((found.further_in.through - 4.0).abs() < 1e-5, "{:?}", found.further_in);
    assert!(found.along_rays.through > 4.5, "{:?}", found.along_rays);
    // A sheet between two planes of nodes is linked from both sides.
    let sheet = find(&[FLOATING], &slanting(&[[4.25, 4.5]], 0.0), FREE);
    assert_eq!((sheet.along_rays.object, sheet.further_in.object), ([0; 2], [0; 2]));
    for (end, gap) in [0.25, 0.5].into_iter().enumerate() {
        assert!((sheet.further_in.factor[end] * gap - 1.0).abs() < 1e-5, "{:?}", sheet.further_in);
        assert!(sheet.along_rays.factor[end] * gap > 1.05, "{:?}", sheet.along_rays);
    }
}

/// What holds a body does not matter, and strong dielectrics are held by nothing.
#[test]
fn a_dielectric_becomes_a_conductor_as_its_permittivity_grows() {
    for step in 0..=60 {
        let faces = slanting(&[[3.011 + 0.03 * f64::from(step), 20.0]], 0.0);
        let conductor = find(&[FLOATING], &faces, FREE);
        let difference = |permittivity: f64| {
            let found = find(&[dielectric(permittivity)], &faces, FREE);
            assert!(!found.past_wall.is_linked() && !found.along_rays.is_linked());
            let past = (found.past_wall.through / conductor.past_wall.through - 1.0).abs();
            // In a conductor nothing is left of the edge, and nothing is across it.
            let through = (found.along_rays.through / conductor.along_rays.through - 1.0).abs();
            if conductor.holder == NO_OBJECT { past.max(through) } else { past }
        };
        let [weaker, stronger] = [1e4, 1e7].map(difference);
        assert!(stronger < 3e-4 && stronger < 0.01 * weaker + 1e-9, "{step}: {weaker:e} {stronger:e}");
    }
    // And it is nothing as its permittivity becomes that around it, but for what is weak, which has a rule of its own.
    let [strong, less] =
        [1e3, 11.0].map(|permittivity| past_wall(&[dielectric(permittivity)], &[[3.9, 20.0]], FREE).through);
    assert!(1.0 < less && less < strong, "{less} {strong}");
}

/// Where faces rise or fall behind the end of an image, that is where the surface bends away, and no wall.
#[test]
fn bodies_that_slant_have_no_walls() {
    let through = |slope: f64| {
        let found = find(&[GROUNDED], &slanting(&[[3.8, 20.0]], slope), FREE);
        assert_ne!(found.holder, NO_OBJECT);
        found.past_wall.through
    };
    let [flat, hardly, half, slanting] = [0.0, 0.05, 0.11, 0.2].map(through);
    assert!((slanting - 4.0).abs() < 1e-5, "the edge rule: {slanting}");
    assert!(flat < 3.75 && (hardly - flat).abs() < 0.2, "{flat} {hardly}");
    assert!(hardly < half && half < slanting, "{hardly} {half} {slanting}");
}

#[test]
fn nothing_changes_where_others_are() {
    let alone = [[3.9, 20.0]];
    let of_rule = past_wall(&[GROUNDED], &alone, FREE);
    assert!(of_rule.through < 3.6, "{of_rule:?}");
    let with_other = past_wall(&[GROUNDED, FLOATING], &[[3.9, 20.0], [3.0, 3.5]], FREE);
    assert_eq!(with_other.through, 4.0, "two conductors");
    let beside_other = past_wall(&[GROUNDED, FLOATING], &[[3.9, 20.0], [1.0, 2.0]], FREE);
    assert_eq!(beside_other, of_rule, "the other is further away");
    let in_dielectric = past_wall(&[GROUNDED, dielectric(80.0)], &[[3.9, 20.0], [1.0, 20.0]], FREE);
    assert_eq!(in_dielectric.through, 4.0, "a dielectric, as far as the conductor");
    let at_electrode = past_wall(&[GROUNDED], &alone, 1);
    assert_eq!((at_electrode.object, at_electrode.through), ([0, 0], 0.0), "the electrode is touched");
    let weak = past_wall(&[dielectric(4.0)], &alone, FREE);
    assert!(weak.through < 2.5 && !weak.is_linked(), "{weak:?}");
}

/// In images of some sizes, 49 pixels for one, rounding puts nodes on the rim of the domain a bit behind the last pixel. There a body
/// is high up, and low one cell further in.
#[test]
fn walls_at_the_rim_of_an_image_are_those_of_its_last_pixel() {
    let sensor = stripes_sensor(6_000);
    for (axis, pixels) in (0..2).flat_map(|axis| (10..=110).map(move |pixels| (axis, pixels))) {
        let [mut width, mut height] = [30, 30];
        *[&mut width, &mut height][axis] = pixels;
        let view = OrthographicView { domain: DOMAIN, width, height };
        let mut image = DepthLayers::empty(view, 1);
        let (front, back) = image.layer_mut(0);
        for (pixel, faces) in front.iter_mut().zip(back).enumerate() {
            let is_at_rim = view.pixel_centre(pixel % width, pixel / width)[axis] > 0.2;
            (*faces.0, *faces.1) = if is_at_rim { (0.3, 0.32) } else { (0.03, 0.05) };
        }
        let mut updater = Updater::new(&sensor, &[GROUNDED]);
        updater.step_checked(&image);
        assert!(!updater.occupancy.linked_edges().is_empty(), "{axis} {pixels}");
    }
}
