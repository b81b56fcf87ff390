//! The Maxwell matrix of three stripes with a bar above them: what physics demands, and reference values that were
//! computed with another method.

use crate::common::{EXACT, FLOATING, GROUNDED, bar, depth_of_boxes, stripes_sensor};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::Aabb;
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::Contact;
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;
use proptest::prelude::*;

fn simulator(materials: Vec<Material>, options: SolverOptions) -> Simulator {
    Simulator::new(stripes_sensor(20_000), materials, options).unwrap()
}

/// C with a bar 50 mm above, less C without.
fn change(material: Material, tets: usize) -> [[f64; 3]; 3] {
    change_by(bar(0.05, 0.0), material, tets)
}

fn change_by(solid: Aabb, material: Material, tets: usize) -> [[f64; 3]; 3] {
    let mut simulator = Simulator::new(stripes_sensor(tets), vec![material], EXACT).unwrap();
    let _ = simulator.step(&depth_of_boxes([64, 64], &[solid])).unwrap();
    let (with, without) = (simulator.capacitance(), simulator.base());
    std::array::from_fn(|i| std::array::from_fn(|j| with.get(i, j) - without.get(i, j)))
}

fn assert_maxwell(c: &CapacitanceMatrix) {
    for i in 0..c.size() {
        assert!(c.get(i, i) > 0.0, "{c:?}");
        let sum: f64 = (0..c.size()).map(|j| c.get(i, j)).sum();
        assert!(sum >= -1e-9 * c.get(i, i), "row {i} sums to {sum}: {c:?}");
        for j in (0..c.size()).filter(|&j| j != i) {
            assert!(c.get(i, j) <= 0.0 && c.get(i, j) == c.get(j, i), "{c:?}");
        }
    }
}

#[test]
fn rows_sum_to_zero_with_ground() {
    for material in [GROUNDED, FLOATING] {
        let mut simulator = simulator(vec![material], EXACT);
        let _ = simulator.step(&depth_of_boxes([64, 64], &[bar(0.03, 0.02)])).unwrap();
        let c = simulator.capacitance();
        for (i, row) in c.rows().enumerate() {
            let sum = row.iter().sum::<f64>() + simulator.capacitance_to_ground().unwrap()[i];
            // Charges are only as good as the fields, whose error is the root of that of the energies, at best 1e-16.
            assert!(sum.abs() < 1e-8 * c.get(i, i), "row {i} sums to {sum} F, {material:?}");
        }
    }
}

#[test]
fn a_grounded_bar_lowers_every_mutual_capacitance() {
    let change = change(GROUNDED, 20_000);
    assert!(change[0][1] > 0.0 && change[0][2] > 0.0 && change[1][2] > 0.0, "{change:?}");
}

#[test]
fn a_floating_bar_raises_the_mutual_capacitance_of_the_outer_stripes() {
    let change = change(FLOATING, 20_000);
    assert!(change[0][2] < 0.0, "{change:?}");
    assert!(change[0][1] > 0.0, "{change:?}");
}

/// 2912.2 fF and 113.3, 72.2, 55.9 fF with error bars of 0.25 %.
#[test]
fn values_are_near_the_references() {
    let simulator = Simulator::new(stripes_sensor(100_000), vec![], SolverOptions::default()).unwrap();
    let error = simulator.base().get(0, 0) / 2912.2e-15 - 1.0;
    assert!(error.abs() < 0.03, "C11 {error}");
    let change = change(GROUNDED, 100_000);
    for (value, reference) in [(change[0][0], 113.3e-15), (change[0][1], 72.2e-15), (change[0][2], 55.9e-15)]
    {
        let error = value / reference - 1.0;
        assert!(error.abs() < 0.03, "{error}: {change:?}");
    }
}

#[test]
fn a_capacitance_to_ground_lies_between_floating_and_grounded() {
    let at = |farads| change(Material::Conductor(Connection::Capacitance(farads)), 20_000)[0][0];
    let (floating, grounded) = (change(FLOATING, 20_000)[0][0], change(GROUNDED, 20_000)[0][0]);
    assert!((at(0.0) / floating - 1.0).abs() < 1e-9);
    assert!((at(1e-3) / grounded - 1.0).abs() < 1e-6);
    assert!(floating < at(5e-12) && at(5e-12) < grounded);
}

/// A block several cells thick: in a plate thinner than a cell no node is inside that could carry charge sideways.
#[test]
fn a_dielectric_of_high_permittivity_acts_as_a_floating_conductor() {
    let thin = bar(0.05, 0.0);
    let block = Aabb { max: thin.max.with_z(0.15), ..thin };
    let dielectric = Material::Dielectric(RelativePermittivity::new(1e6).unwrap());
    let [dielectric, floating] = [dielectric, FLOATING].map(|material| change_by(block, material, 50_000));
    for (a, b) in dielectric.as_flattened().iter().zip(floating.as_flattened()) {
        assert!((a / b - 1.0).abs() < 1e-4, "{dielectric:?} {floating:?}");
    }
}

#[test]
fn a_dielectric_of_one_changes_nothing() {
    let vacuum = change(Material::Dielectric(RelativePermittivity::VACUUM), 20_000);
    assert!(vacuum.as_flattened().iter().all(|c| c.abs() < 1e-24), "{vacuum:?}");
}

#[test]
fn a_bar_that_leaves_the_scene_leaves_no_trace() {
    let mut simulator = simulator(vec![GROUNDED], EXACT);
    let fresh = simulator.clone();
    for shift in [0.0, 0.1] {
        let _ = simulator.step(&depth_of_boxes([64, 64], &[bar(0.02, shift)])).unwrap();
    }
    let _ = simulator.step(&depth_of_boxes([64, 64], &[bar(2.0, 0.0)])).unwrap();
    assert_eq!(simulator.matrix().to_csr(), fresh.matrix().to_csr());
    let (after, before) = (simulator.capacitance().get(0, 0), simulator.base().get(0, 0));
    assert!((after / before - 1.0).abs() < 1e-12);
}

#[test]
fn a_conductor_on_the_stripes_is_reported_as_a_contact() {
    let insulator = Material::Dielectric(RelativePermittivity::new(3.0).unwrap());
    let mut simulator = simulator(vec![insulator, FLOATING, GROUNDED], SolverOptions::default());
    let mut contacts = |heights: [f64; 3], shift: f64| {
        let boxes = heights.map(|height| bar(height, shift));
        let _ = simulator.update(&depth_of_boxes([64, 64], &boxes)).unwrap();
        simulator.contacts().to_vec()
    };
    let all = |object| [0, 1, 2].map(|electrode| Contact { object, electrode });
    assert_eq!(contacts([-0.005, 0.02, 0.1], 0.0), []);
    assert_eq!(contacts([0.1, 0.02, -0.005], 0.0), all(2));
    assert_eq!(contacts([0.1, 0.02, -0.005], 0.0), all(2), "nothing moved");
    assert_eq!(contacts([0.1, 0.0, 0.02], 0.0), all(1), "a face on the electrodes");
    assert_eq!(contacts([0.1, -0.005, -0.005], 0.0), [all(1), all(2)].concat());
    // From y = 0.025 on; the stripes end at -0.02, 0.01 and 0.04.
    assert_eq!(contacts([0.1, 0.1, -0.005], 0.1), [Contact { object: 2, electrode: 2 }]);
    assert_eq!(contacts([0.1, 0.1, 0.02], 0.0), []);
}

#[test]
fn what_changed_is_told_in_increasing_order() {
    let mut simulator = simulator(vec![GROUNDED, FLOATING], SolverOptions::default());
    for (first, second) in [(0.1, 0.02), (0.05, 0.2), (0.3, 0.03)] {
        let depth = depth_of_boxes([64, 64], &[bar(first, 0.05), bar(second, -0.05)]);
        let _ = simulator.update(&depth).unwrap();
        let occupancy = simulator.occupancy();
        for changed in [occupancy.changed_nodes(), occupancy.changed_edges()] {
            assert!(!changed.is_empty() && changed.is_sorted_by(|a, b| a < b));
        }
    }
}

#[test]
fn a_bar_thinner_than_an_edge_still_screens() {
    let mut simulator = simulator(vec![GROUNDED], EXACT);
    let sheet = |height| {
        let thick = bar(height, 0.0);
        Aabb { max: thick.max.with_z(thick.min.z + 1e-4), ..thick }
    };
    let mut response = |height| {
        let _ = simulator.step(&depth_of_boxes([64, 64], &[sheet(height)])).unwrap();
        simulator.capacitance().get(0, 0) - simulator.base().get(0, 0)
    };
    let heights: Vec<f64> = (0..40).map(|k| 0.04 + 0.001 * f64::from(k)).collect();
    let values: Vec<f64> = heights.into_iter().map(&mut response).collect();
    for pair in values.windows(2) {
        assert!(pair[1] < pair[0] && pair[1] > 0.8 * pair[0], "{values:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Boxes of any material anywhere, frame after frame: the matrix is that of a fresh simulator bit for bit, and C
    /// is a Maxwell matrix.
    #[test]
    fn frames_do_not_accumulate(
        frames in prop::collection::vec((0.0..0.4, -0.3..0.3, 0.0..0.3, 0.0..0.2), 1..6),
        permittivity in 1.0..100.0,
    ) {
        let weak = Material::Dielectric(RelativePermittivity::new(permittivity).unwrap());
        let materials = vec![weak, FLOATING, GROUNDED];
        let mut moving = simulator(materials.clone(), EXACT);
        let mut last = None;
        for (a, b, c, d) in frames {
            let boxes = [bar(a, b), bar(c, d), bar(0.5 * (a + c), -b)];
            let depth = depth_of_boxes([32, 48], &boxes);
            let _ = moving.step(&depth).unwrap();
            last = Some(depth);
        }
        let mut fresh = simulator(materials, EXACT);
        let _ = fresh.step(&last.unwrap()).unwrap();
        prop_assert_eq!(moving.matrix().to_csr(), fresh.matrix().to_csr());
        for i in 0..3 {
            let (a, b) = (moving.capacitance().get(i, i), fresh.capacitance().get(i, i));
            prop_assert!((a / b - 1.0).abs() < 1e-8, "{} {}", a, b);
        }
        assert_maxwell(moving.capacitance());
    }
}
