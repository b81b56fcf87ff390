//! The tolerance against the oracle, a sparse factorisation: over the run of the built-in scene and over scenes thrown
//! by dice.

use crate::common::{
    Dice, FLOATING, GROUNDED, any_material, bar, both, depth_of_boxes, dielectric, oracle, relative_error,
    stripes_sensor, three_stripes, to,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::Material;
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;

const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];

/// True errors in units of the tolerance, for each of [`TOLERANCES`].
#[derive(Default)]
struct Errors([Vec<f64>; TOLERANCES.len()]);

impl Errors {
    /// Runs frames with all tolerances and with the oracle.
    fn of_run(&mut self, sensor: &Sensor, materials: &[Material], frames: &[DepthLayers]) {
        let mut truth = oracle(sensor, materials);
        let mut tested = TOLERANCES
            .map(|tolerance| Simulator::new(sensor.clone(), materials.to_vec(), to(tolerance)).unwrap());
        for depth in frames {
            let _ = truth.step(depth).unwrap();
            for ((simulator, errors), tolerance) in tested.iter_mut().zip(&mut self.0).zip(TOLERANCES) {
                let report = simulator.step(depth).unwrap();
                assert!(report.solve.relative_error <= tolerance);
                errors.push(relative_error(simulator.capacitance(), truth.capacitance()) / tolerance);
            }
        }
    }

    /// At most one frame in a hundred above the tolerance, none above three times it.
    fn assert_tolerances_hold(&self) {
        for (errors, tolerance) in self.0.iter().zip(TOLERANCES) {
            let above = errors.iter().filter(|error| error.is_nan() || **error > 1.0).count();
            let worst = errors.iter().copied().fold(0.0, f64::max);
            assert!(
                100 * above <= errors.len() && worst <= 3.0,
                "{tolerance:e}: {above} of {} frames above it, worst {worst} times",
                errors.len()
            );
        }
    }
}

/// The bar's way in the built-in scene, all of its frames, on a lattice that is graded as the product grades them.
#[test]
fn the_tolerance_holds_over_the_run_of_the_steel_bar() {
    let frames: Vec<_> = (0..276)
        .map(|frame| depth_of_boxes([64, 64], &[bar(0.05, 0.00116 * f64::from(frame) - 0.16)]))
        .collect();
    let design = three_stripes();
    let sized = |tets| both(Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap());
    for sensor in [8_000, 25_000].into_iter().flat_map(sized) {
        let mut errors = Errors::default();
        errors.of_run(&sensor, &[GROUNDED], &frames);
        errors.assert_tolerances_hold();
    }
}

/// A box above the electrodes, at least a cell thick.
fn solid(dice: &mut Dice) -> Aabb {
    let size = DVec3::new(dice.between(0.03, 0.2), dice.between(0.03, 0.2), dice.between(0.01, 0.1));
    let low = DVec3::new(dice.between(-0.25, 0.1), dice.between(-0.25, 0.1), dice.between(0.01, 0.25));
    Aabb { min: low, max: low + size }
}

/// Boxes that drift; one in eight jumps.
fn frames(dice: &mut Dice, objects: usize, count: usize) -> Vec<DepthLayers> {
    let mut boxes: Vec<Aabb> = (0..objects).map(|_| solid(dice)).collect();
    let mut drawn = Vec::new();
    for _ in 0..count {
        drawn.push(depth_of_boxes([48, 48], &boxes));
        for of_object in &mut boxes {
            let step = DVec3::new(dice.between(-4e-3, 4e-3), dice.between(-4e-3, 4e-3), 0.0);
            *of_object = Aabb { min: of_object.min + step, max: of_object.max + step };
            if dice.below(8) == 0 {
                *of_object = solid(dice);
            }
        }
    }
    drawn
}

#[test]
fn the_tolerance_holds_in_scenes_thrown_by_dice() {
    let sensors = both(stripes_sensor(6_000));
    let (mut errors, mut dice) = ([Errors::default(), Errors::default()], Dice(5));
    for scene in 0..48 {
        let materials: Vec<Material> = (0..1 + dice.below(4)).map(|_| any_material(&mut dice)).collect();
        errors[scene % 2].of_run(&sensors[scene % 2], &materials, &frames(&mut dice, materials.len(), 10));
    }
    errors.iter().for_each(Errors::assert_tolerances_hold);
}

/// A floating conductor in a body of a permittivity of 440,000, which weak ones reach into. In single precision differences of
/// potentials in it are rounded to more than a tolerance of 1e-6, now and then to more than one of 1e-4.
#[test]
fn strong_dielectrics_are_not_rounded_away() {
    let materials = [dielectric(438_733.0), FLOATING, dielectric(0.012_763), dielectric(0.001_53)];
    let solids: [[f64; 9]; 4] = [
        [-0.1217, 0.0361, 0.0475, 0.0729, 0.1364, 0.1299, -0.000_986, -0.001_933, 0.001_213],
        [-0.0977, 0.0716, 0.0686, -0.0298, 0.1137, 0.1234, 0.000_737, -0.001_061, 0.001_341],
        [-0.2645, -0.1427, 0.0791, -0.0978, -0.0321, 0.1764, -0.001_28, -0.000_276, 0.001_818],
        [-0.0682, -0.0266, 0.0975, 0.1166, 0.0578, 0.1684, 0.000_548, -0.000_252, 0.001_572],
    ];
    let frames: Vec<_> = (0..30)
        .map(|frame| {
            let boxes = solids.map(|numbers| {
                let [min, max, speed] = [0, 3, 6].map(|at| DVec3::from_slice(&numbers[at..]));
                let way = f64::from(frame) * speed;
                Aabb { min: min + way, max: max + way }
            });
            depth_of_boxes([48, 48], &boxes)
        })
        .collect();
    let mut errors = Errors::default();
    errors.of_run(&stripes_sensor(14_980), &materials, &frames);
    errors.assert_tolerances_hold();
}
