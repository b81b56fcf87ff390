//! Two patches on the lower wall of a grounded cube of side 1 m, under a layer across the whole cube: against a Fourier
//! series. The patches' potentials fall from 1 V to 0 V along linear flanks, as a jump between a patch and the wall
//! would make capacitances infinite. Errors are printed for the table of `docs/validation.md`:
//! `cargo test -p capsense-core --test suite layered_box:: -- --nocapture`.

use crate::common::walled::{Body, Held, Rule, WalledBox};
use crate::common::{conductor, dielectric, to};
use approx::assert_relative_eq;
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material};
use capsense_core::mesh::{Lattice, TetMesh, graded_axis};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::units::VACUUM_PERMITTIVITY;
use std::f64::consts::PI;

/// Width of the flanks; the patches are 1 V on 0.1875 m x 0.5 m each.
const RAMP: f64 = 0.0625;
const CENTRES: [[f64; 2]; 2] = [[0.34375, 0.5], [0.65625, 0.5]];
/// Where the potential is above a half.
const SIZE: [f64; 2] = [0.25, 0.5625];

/// A layer across the whole box.
#[derive(Clone, Copy, Debug)]
struct Layer {
    bottom: f64,
    top: f64,
    material: Material,
}

/// The potential on the walls with one patch at 1 V.
fn patch(which: usize, p: DVec3) -> f64 {
    let along = |axis: usize| {
        let within = 0.5 * SIZE[axis] - (p[axis] - CENTRES[which][axis]).abs();
        (0.5 + within / RAMP).clamp(0.0, 1.0)
    };
    if p.z == 0.0 { along(0) * along(1) } else { 0.0 }
}

/// 2 ∫ f(x) sin(m π x) dx along one axis.
fn coefficient(m: usize, centre: f64, size: f64) -> f64 {
    let a = m as f64 * PI;
    let ramp = 0.5 * a * RAMP;
    4.0 / a * (a * centre).sin() * (0.5 * a * size).sin() * ramp.sin() / ramp
}

/// The displacement at the lower wall per volt there in a mode that varies as sinh and cosh of k z: from the top down, each
/// layer is a piece of a transmission line.
fn admittance(k: f64, layer: Option<Layer>) -> f64 {
    let through = |above: f64, permittivity: f64, thickness: f64| {
        let (own, t) = (permittivity * k, (k * thickness).tanh());
        if above.is_infinite() { own / t } else { own * (above + own * t) / (own + above * t) }
    };
    match layer {
        None => through(f64::INFINITY, 1.0, 1.0),
        Some(Layer { bottom, top, material: Material::Dielectric(permittivity) }) => {
            let above = through(f64::INFINITY, 1.0, 1.0 - top);
            through(through(above, permittivity.value(), top - bottom), 1.0, bottom)
        }
        Some(Layer { bottom, .. }) => through(f64::INFINITY, 1.0, bottom),
    }
}

/// C11 and C12 from modes up to a number along each axis.
fn partial(layer: Option<Layer>, terms: usize) -> [f64; 2] {
    let of = |axis: usize, which: usize| -> Vec<f64> {
        (1..=terms).map(|m| coefficient(m, CENTRES[which][axis], SIZE[axis])).collect()
    };
    let (x, other, y) = (of(0, 0), of(0, 1), of(1, 0));
    let mut c = [0.0; 2];
    for (m, (x, other)) in x.iter().zip(&other).enumerate() {
        for (n, y) in y.iter().enumerate() {
            let k = PI * ((m + 1) as f64).hypot((n + 1) as f64);
            let weight = 0.25 * VACUUM_PERMITTIVITY * admittance(k, layer) * y * y * x;
            c[0] += weight * x;
            c[1] += weight * other;
        }
    }
    c
}

/// What a layer adds; high modes do not reach it.
fn added_by(layer: Option<Layer>) -> [f64; 2] {
    let [air, filled] = [None, layer].map(|layer| partial(layer, 64));
    [0, 1].map(|i| filled[i] - air[i])
}

/// C11 and C12. What is still to come falls with the square of the number of modes, once a period of all sines is over.
fn series(layer: Option<Layer>) -> [f64; 2] {
    let [few, many] = [256, 512].map(|terms| partial(None, terms));
    let added = added_by(layer);
    [0, 1].map(|i| (4.0 * many[i] - few[i]) / 3.0 + added[i])
}

fn body(layer: Layer) -> Body {
    let size = DVec3::new(2.0, 2.0, layer.top - layer.bottom);
    let centre = DVec3::new(0.5, 0.5, 0.5 * (layer.top + layer.bottom));
    Body { shape: Shape::Box { size }, pose: Pose::at(centre), material: layer.material }
}

fn slab(permittivity: f64, bottom: f64, top: f64) -> Option<Layer> {
    Some(Layer { bottom, top, material: dielectric(permittivity) })
}

/// All above a height is a grounded conductor.
fn plane(bottom: f64) -> Option<Layer> {
    Some(Layer { bottom, top: 1.5, material: conductor(Connection::Grounded) })
}

/// A lattice with its smallest spacing at the flanks of the patches and at their wall.
fn lattice(finest: f64) -> Lattice {
    let [x, y] = [0, 1].map(|axis| {
        let sides = CENTRES.iter().flat_map(|c| [c[axis] - 0.5 * SIZE[axis], c[axis] + 0.5 * SIZE[axis]]);
        let flanks: Vec<[f64; 2]> = sides.map(|side| [side - 0.5 * RAMP, side + 0.5 * RAMP]).collect();
        let planes: Vec<f64> = flanks.iter().flat_map(|[a, b]| [*a, 0.5 * (a + b), *b]).collect();
        graded_axis(0.0, 1.0, &planes, &flanks, finest, 1.3)
    });
    Lattice::new([x, y, graded_axis(0.0, 1.0, &[0.0], &[], finest, 1.1)]).unwrap()
}

/// The capacitances of the patches, in farads.
fn on_lattice(lattice: &Lattice, layer: Option<Layer>) -> [f64; 2] {
    let bodies: Vec<Body> = layer.into_iter().map(body).collect();
    let none = vec![0.0; bodies.len()];
    let space = WalledBox::new(lattice, &bodies, Rule::AsSolids);
    let solved = space.solve(&[
        Held { wall: &|p| patch(0, p), bodies: &none },
        Held { wall: &|p| patch(1, p), bodies: &none },
    ]);
    [0, 1].map(|which| VACUUM_PERMITTIVITY * solved.energy(0, which))
}

/// Nodes of one patch that have the same potential.
struct Level {
    patch: usize,
    volts: f64,
    nodes: Vec<u32>,
}

/// The levels of both patches, and the nodes of all other walls.
fn levels(mesh: &TetMesh) -> (Vec<Level>, Vec<u32>) {
    let (mut levels, mut ground): (Vec<Level>, _) = (Vec::new(), Vec::new());
    for (&p, node) in mesh.nodes().iter().zip(0..) {
        let on_patch = (0..2).map(|which| (which, patch(which, p))).find(|(_, volts)| *volts > 0.0);
        if let Some((patch, volts)) = on_patch {
            let is_same = |level: &&mut Level| level.patch == patch && (level.volts - volts).abs() < 1e-9;
            match levels.iter_mut().find(is_same) {
                Some(level) => level.nodes.push(node),
                None => levels.push(Level { patch, volts, nodes: vec![node] }),
            }
        } else if p.min(1.0 - p).min_element() == 0.0 {
            ground.push(node);
        }
    }
    (levels, ground)
}

/// The same through `Simulator`, off the lattice: each level is an electrode, and what a patch has is the sum over its
/// levels, weighted with their potentials.
fn by_simulator(lattice: &Lattice, layer: Option<Layer>) -> [f64; 2] {
    let mesh = lattice.to_tet_mesh().unwrap();
    let (levels, ground) = levels(&mesh);
    let nodes = levels.iter().map(|level| ElectrodeNodes::Nodes(level.nodes.clone()));
    let electrodes = nodes.enumerate().map(|(k, nodes)| (k.to_string(), nodes)).collect();
    let sensor = Sensor::on_mesh(mesh, &ground, electrodes).unwrap().with_rims_held();
    let materials: Vec<Material> = layer.iter().map(|layer| layer.material).collect();
    let mut simulator = Simulator::new(sensor, materials, to(1e-9)).unwrap();
    if let Some(body) = layer.map(body) {
        let mut solids = Solids::new(&[body.shape]).unwrap();
        solids.place(&[body.pose]).unwrap();
        let _ = simulator.step(&solids).unwrap();
    }
    let c = simulator.capacitance();
    let of = |patch: usize| levels.iter().enumerate().filter(move |(_, level)| level.patch == patch);
    let pairs = |other: usize| of(0).flat_map(move |one| of(other).map(move |two| (one, two)));
    [0, 1].map(|other| pairs(other).map(|((i, a), (j, b))| a.volts * b.volts * c.get(i, j)).sum())
}

/// Relative errors of C11 and C12, then of what the layer adds to both.
fn errors(found: [f64; 2], air: [f64; 2], layer: Option<Layer>) -> [f64; 4] {
    let (exact, of_air) = (series(layer), series(None));
    let of = |i: usize| found[i] / exact[i] - 1.0;
    let added = |i: usize| (found[i] - air[i]) / (exact[i] - of_air[i]) - 1.0;
    [of(0), of(1), added(0), added(1)]
}

/// Computes all layers and returns the errors of the empty box.
fn check(name: &str, compute: impl Fn(Option<Layer>) -> [f64; 2], allowed: [[f64; 2]; 6]) -> [f64; 2] {
    let layers = [
        slab(80.0, 0.25, 0.5),
        slab(80.0, 0.27, 0.41),
        slab(4.0, 0.25, 0.5),
        slab(4.0, 0.27, 0.41),
        plane(0.3125),
    ];
    let air = compute(None);
    let [own, mutual, ..] = errors(air, [0.0; 2], None);
    println!("{name}, air: C11 {:+.2} %, C12 {:+.2} %", 100.0 * own, 100.0 * mutual);
    assert!(own.abs() < allowed[0][0] && mutual.abs() < allowed[0][1], "{own} {mutual}");
    for (layer, allowed) in layers.into_iter().zip(&allowed[1..]) {
        let errors = errors(compute(layer), air, layer);
        let percent = errors.map(|error| format!("{:+.2}", 100.0 * error));
        println!("{name}, {layer:?}: C and change in % {percent:?}");
        assert!(errors[2].abs() < allowed[0] && errors[3].abs() < allowed[1], "{layer:?}: {errors:?}");
    }
    [own, mutual]
}

#[test]
fn series_have_the_digits_that_were_computed_elsewhere() {
    let known = [
        (None, [11.350778, -1.1900702]),
        (slab(80.0, 0.25, 0.5), [11.896782, -0.9084861]),
        (slab(4.0, 0.27, 0.41), [11.564289, -1.0852195]),
        (plane(0.3125), [11.636948, -1.0114242]),
    ];
    // Those sums ended at 1500 modes along each axis, 5e-6 before their limit.
    let air = partial(None, 1500);
    for (layer, digits) in known {
        let ended = added_by(layer);
        for (i, digits) in digits.into_iter().enumerate() {
            assert_relative_eq!(1e12 * (air[i] + ended[i]), digits, max_relative = 1e-7);
            assert_relative_eq!(1e12 * series(layer)[i], digits, max_relative = 1.5e-5);
        }
    }
}

#[test]
fn layers_over_patches_on_a_lattice() {
    let coarse = lattice(1.0 / 64.0);
    let allowed = [[0.07, 0.065], [5e-3, 9e-3], [2e-3, 6e-3], [4e-3, 6e-3], [2e-3, 6e-3], [2e-3, 6e-3]];
    let coarse = check("30k nodes", |layer| on_lattice(&coarse, layer), allowed);
    let fine = lattice(1.0 / 128.0);
    let allowed = [[0.025, 0.022], [1e-3, 4e-3], [0.01, 0.013], [2e-3, 5e-3], [7e-3, 5e-3], [3e-3, 6e-3]];
    let fine = check("97k nodes", |layer| on_lattice(&fine, layer), allowed);
    for (coarse, fine) in coarse.into_iter().zip(fine) {
        let order = (coarse / fine).log2();
        assert!(order > 1.3, "order {order} from {coarse} and {fine}");
    }
}

#[test]
fn layers_over_patches_by_the_simulator_on_any_mesh() {
    let mesh = lattice(1.0 / 64.0);
    let allowed = [[0.07, 0.065], [5e-3, 9e-3], [2e-3, 6e-3], [0.06, 0.04], [7e-3, 3e-3], [2e-3, 6e-3]];
    let _ = check("no lattice, 30k nodes", |layer| by_simulator(&mesh, layer), allowed);
}
