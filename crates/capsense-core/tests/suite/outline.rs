//! Outlines against slower ways to say the same: membership, where a line enters, and how far away the rim is.

use crate::common::{DOMAIN, EXACT};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::glam::DVec2;
use capsense_core::mesh::Lattice;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// A polygon whose corners stand around a centre at distances from `scale / 2` to `scale`.
fn star(center: DVec2, scale: f64, radii: &[f64]) -> Vec<DVec2> {
    let corner = |(k, r): (usize, &f64)| {
        let angle = TAU * (k as f64 + 0.3) / radii.len() as f64;
        center + scale * (0.5 + 0.5 * r) * DVec2::from_angle(angle)
    };
    radii.iter().enumerate().map(corner).collect()
}

/// A part with a hole in which an island lies, and a part beside it.
fn parts() -> impl Strategy<Value = Vec<Vec<DVec2>>> {
    let radii = || prop::collection::vec(0.0..1.0, 5..12);
    (radii(), radii(), radii(), radii(), [-0.05..0.05, -0.05..0.05]).prop_map(|(a, b, c, d, at)| {
        let center = DVec2::from(at);
        vec![
            star(center, 0.04, &a),
            star(center, 0.014, &b),
            star(center, 0.004, &c),
            star(center + DVec2::new(0.09, 0.01), 0.03, &d),
        ]
    })
}

fn outlines() -> impl Strategy<Value = Outline> {
    let place = || [-0.05..0.05, -0.05..0.05].prop_map(DVec2::from);
    prop_oneof![
        (place(), [0.01..0.1, 0.01..0.1])
            .prop_map(|(center, size)| Outline::Rectangle { center, size: DVec2::from(size) }),
        (place(), 0.01..0.05).prop_map(|(center, radius)| Outline::Disk { center, radius }),
        parts().prop_map(|mut parts| Outline::Polygon(parts.remove(0))),
        parts().prop_map(Outline::Contours),
    ]
}

/// Corners of an outline, those of a disk close together on its rim.
fn contours_of(outline: &Outline) -> Vec<Vec<DVec2>> {
    match outline {
        Outline::Rectangle { center, size } => {
            let corner = |x, y| *center + 0.5 * *size * DVec2::new(x, y);
            vec![vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]]
        }
        Outline::Disk { center, radius } => {
            let corner = |k| *center + *radius * DVec2::from_angle(TAU * f64::from(k) / 4096.0);
            vec![(0..4096).map(corner).collect()]
        }
        Outline::Polygon(corners) => vec![corners.clone()],
        Outline::Contours(contours) => contours.clone(),
    }
}

fn sides_of(outline: &Outline) -> Vec<[DVec2; 2]> {
    let sides = |c: &Vec<DVec2>| (0..c.len()).map(|k| [c[k], c[(k + 1) % c.len()]]).collect::<Vec<_>>();
    contours_of(outline).iter().flat_map(sides).collect()
}

/// How often all contours together wind around a point, by the angles under which it sees their sides; each contour
/// counts once whichever way it runs.
fn windings(outline: &Outline, point: DVec2) -> u32 {
    let around = |contour: &Vec<DVec2>| {
        let seen = |k: usize| {
            let (a, b) = (contour[k] - point, contour[(k + 1) % contour.len()] - point);
            a.perp_dot(b).atan2(a.dot(b))
        };
        ((0..contour.len()).map(seen).sum::<f64>() / TAU).round().abs() as u32
    };
    contours_of(outline).iter().map(around).sum()
}

fn reversed(outline: &Outline) -> Outline {
    let back = |corners: &Vec<DVec2>| corners.iter().rev().copied().collect::<Vec<_>>();
    match outline {
        Outline::Polygon(corners) => Outline::Polygon(back(corners)),
        Outline::Contours(contours) => Outline::Contours(contours.iter().rev().map(back).collect()),
        other => other.clone(),
    }
}

const POINT: [std::ops::Range<f64>; 2] = [-0.2..0.2, -0.15..0.15];

proptest! {
    #[test]
    fn inside_is_what_is_wound_around_an_odd_number_of_times(outline in outlines(), points in prop::collection::vec(POINT, 50)) {
        prop_assert_eq!(outline.defect(), None);
        for point in points.into_iter().map(DVec2::from) {
            // The disk's polygon is a little smaller than the disk.
            if outline.distance_to_rim(point) > 1e-7 {
                let inside = windings(&outline, point) % 2 == 1;
                prop_assert_eq!(outline.contains(point), inside, "{}", point);
                prop_assert_eq!(reversed(&outline).contains(point), inside, "{}", point);
            }
        }
        for [p, q] in sides_of(&outline) {
            let on_chord = matches!(outline, Outline::Disk { .. });
            prop_assert!(on_chord || outline.contains(p.lerp(q, 0.37)), "{} {}", p, q);
        }
    }

    #[test]
    fn a_line_from_outside_is_outside_until_it_meets_the_rim(outline in outlines(), points in prop::collection::vec(POINT, 40)) {
        let points = points.into_iter().map(DVec2::from);
        let (inside, outside): (Vec<DVec2>, Vec<DVec2>) = points.partition(|point| outline.contains(*point));
        for (from, to) in outside.iter().flat_map(|from| inside.iter().map(move |to| (*from, *to))) {
            let part = outline.outside_part(from, to);
            prop_assert!((0.0..=1.0).contains(&part));
            prop_assert!(outline.distance_to_rim(from.lerp(to, part)) < 1e-9, "{part}");
            for k in 0..50 {
                let before = from.lerp(to, part * f64::from(k) / 50.0);
                prop_assert!(!outline.contains(before), "{part} {before}");
            }
            let again = reversed(&outline).outside_part(from, to);
            prop_assert!((part - again).abs() < 1e-9, "{part} {again}");
            if matches!(outline, Outline::Rectangle { .. } | Outline::Disk { .. }) {
                // Convex: inside begins once.
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    *if outline.contains(from.lerp(to, middle)) { &mut high } else { &mut low } = middle;
                }
                prop_assert!((part - high).abs() < 1e-6, "{part} {high}");
            }
        }
    }

    #[test]
    fn the_nearest_point_of_the_rim_is_as_far_away_as_is_said(outline in outlines(), point in POINT) {
        let point = DVec2::from(point);
        let said = outline.distance_to_rim(point);
        let sampled = sides_of(&outline)
            .iter()
            .flat_map(|[p, q]| (0..=200).map(|k| p.lerp(*q, f64::from(k) / 200.0)))
            .map(|on_rim| on_rim.distance(point))
            .fold(f64::INFINITY, f64::min);
        prop_assert!(said <= sampled + 1e-7 && said >= sampled - 1e-3, "{said} {sampled}");
        let step = DVec2::new(0.003, -0.004);
        prop_assert!((outline.distance_to_rim(point + step) - said).abs() <= step.length() + 1e-12);
    }

    /// A lattice needs a plane or a fine interval wherever the rim is not along it.
    #[test]
    fn every_side_has_its_plane_or_lies_in_a_fine_interval(outline in outlines()) {
        for [p, q] in sides_of(&outline) {
            for axis in 0..2 {
                let (low, high) = (p[axis].min(q[axis]), p[axis].max(q[axis]));
                let plane = outline.axis_planes(axis).iter().any(|x| (x - low).abs() < 1e-12);
                let fine = outline.fine_intervals(axis).iter().any(|[a, b]| low >= a - 1e-9 && high <= b + 1e-9);
                prop_assert!(fine || p[1 - axis] == q[1 - axis] || (plane && low == high), "{p} {q} {axis}");
            }
        }
    }
}

fn points<const N: usize>(corners: [[f64; 2]; N]) -> Vec<DVec2> {
    corners.map(DVec2::from).to_vec()
}

/// 40 mm x 20 mm, one corner cut off, with a hole of 10 mm x 10 mm.
fn plate_with_hole() -> Outline {
    let border = points([[0.0, 0.0], [0.04, 0.0], [0.04, 0.015], [0.036, 0.02], [0.0, 0.02]]);
    let hole = points([[0.01, 0.005], [0.02, 0.005], [0.02, 0.015], [0.01, 0.015]]);
    Outline::Contours(vec![border, hole])
}

#[test]
fn sides_along_an_axis_are_planes_and_oblique_ones_fine_intervals() {
    let outline = plate_with_hole();
    assert_eq!(outline.axis_planes(0), [0.0, 0.01, 0.02, 0.04]);
    assert_eq!(outline.axis_planes(1), [0.0, 0.005, 0.015, 0.02]);
    assert_eq!(outline.fine_intervals(0), [[0.036, 0.04]]);
    assert_eq!(outline.fine_intervals(1), [[0.015, 0.02]]);
    let disk = Outline::Disk { center: DVec2::X, radius: 0.5 };
    assert_eq!((disk.axis_planes(0), disk.fine_intervals(0)), (vec![], vec![[0.5, 1.5]]));
    assert_eq!(disk.fine_intervals(1), [[-0.5, 0.5]]);
    // Sides that touch, as those of a polygon in place of a circle, are one interval.
    let round = Outline::Polygon(contours_of(&disk).remove(0));
    assert_eq!(round.fine_intervals(0).len(), 1);
    assert_eq!(round.axis_planes(0), []);
    let lattice = SensorDesign {
        domain: DOMAIN,
        electrodes: vec![Electrode { name: "E".into(), outline, z: 0.0 }],
        substrate: None,
        wall: Wall::Grounded,
    }
    .lattice_of_spacing(0.004, 1.3)
    .unwrap();
    for (axis, plane) in [(0, 0.01), (0, 0.02), (0, 0.036), (1, 0.005), (1, 0.015)] {
        assert!(lattice.axes()[axis].iter().any(|x| (x - plane).abs() < 1e-9), "{axis} {plane}");
    }
    let steps = lattice.axes()[0].windows(2).filter(|pair| pair[0] > 0.0359 && pair[1] < 0.0401);
    assert!(steps.map(|pair| pair[1] - pair[0]).all(|step| step <= 0.0041));
}

#[test]
fn distances_to_the_rim_are_measured_by_hand() {
    let plate = plate_with_hole();
    for (point, distance) in [([0.015, 0.010], 0.005), ([-0.003, -0.004], 0.005), ([0.03, 0.001], 0.001)] {
        let found = plate.distance_to_rim(DVec2::from(point));
        assert!((found - distance).abs() < 1e-12, "{point:?}: {found}");
    }
}

#[test]
fn contours_that_are_no_outline_are_refused() {
    let square = |x: f64, y: f64, a: f64| points([[x, y], [x + a, y], [x + a, y + a], [x, y + a]]);
    let defect = |contours: &[Vec<DVec2>]| Outline::Contours(contours.to_vec()).defect();
    assert_eq!(defect(&[square(0.0, 0.0, 4.0), square(1.0, 1.0, 1.0), square(5.0, 0.0, 1.0)]), None);
    assert_eq!(defect(&[]), Some("has fewer than three corners"));
    assert_eq!(
        defect(&[square(0.0, 0.0, 1.0), points([[5.0, 5.0], [6.0, 6.0]])]),
        Some("has fewer than three corners")
    );
    let line = points([[5.0, 5.0], [6.0, 6.0], [8.0, 8.0]]);
    assert_eq!(defect(&[square(0.0, 0.0, 1.0), line]), Some("has no area"));
    assert_eq!(defect(&[square(0.0, 0.0, 1.0), square(f64::NAN, 0.0, 1.0)]), Some("is not finite"));
    assert_eq!(defect(&[square(0.0, 0.0, 1e200)]), Some("has no area"));
    let crossing = Some("crosses itself");
    assert_eq!(defect(&[square(0.0, 0.0, 2.0), square(1.0, 1.0, 2.0)]), crossing);
    // Side by side, in a corner, twice the same.
    assert_eq!(defect(&[square(0.0, 0.0, 2.0), square(2.0, 0.0, 2.0)]), crossing);
    assert_eq!(defect(&[square(0.0, 0.0, 2.0), square(2.0, 2.0, 2.0)]), crossing);
    assert_eq!(defect(&[square(0.0, 0.0, 2.0), square(0.0, 0.0, 2.0)]), crossing);
}

/// Three ways to give one electrode are one sensor.
#[test]
fn the_same_outline_by_other_means_is_the_same_sensor() {
    let design = |outline: &Outline| {
        let electrodes = vec![Electrode { name: "E".into(), outline: outline.clone(), z: 0.0 }];
        SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded }
    };
    let build = |outline: &Outline, lattice: &Lattice| {
        let sensor = Sensor::on_lattice(&design(outline), lattice).unwrap();
        let terminals = sensor.terminals().to_vec();
        (terminals, Simulator::new(sensor, vec![], EXACT).unwrap().base().get(0, 0))
    };
    let corners = points([[-0.05, -0.02], [0.03, -0.02], [0.03, 0.04], [-0.05, 0.04]]);
    let rectangle = Outline::Rectangle { center: DVec2::new(-0.01, 0.01), size: DVec2::new(0.08, 0.06) };
    let (terminals, capacitance) = build(&rectangle, &design(&rectangle).lattice(20_000).unwrap());
    for outline in [Outline::Polygon(corners.clone()), Outline::Contours(vec![corners.clone()])] {
        let (same, close) = build(&outline, &design(&outline).lattice(20_000).unwrap());
        assert!(same == terminals && (close / capacitance - 1.0).abs() < 1e-9, "{close} {capacitance}");
    }
    // A hole of a quarter of the area is shielded by its frame, but not altogether.
    let hole = points([[-0.03, -0.005], [0.01, -0.005], [0.01, 0.025], [-0.03, 0.025]]);
    let frame = Outline::Contours(vec![corners, hole]);
    let lattice = design(&frame).lattice(60_000).unwrap();
    let ((all, capacitance), (fewer, less)) = (build(&rectangle, &lattice), build(&frame, &lattice));
    let count = |terminals: &[u16]| terminals.iter().filter(|terminal| **terminal == 1).count();
    assert!(count(&fewer) < count(&all), "{} {}", count(&fewer), count(&all));
    assert!(less < 0.999 * capacitance && less > 0.8 * capacitance, "{less} {capacitance}");
}

/// Of all pairs of a rectangle, a disk, a polygon and a ring, apart, touching, crossing, and one in the other.
#[test]
fn outlines_meet_where_they_have_a_point_in_common() {
    let at = |x: f64| DVec2::new(x, 0.0);
    let rectangle = |x: f64| Outline::Rectangle { center: at(x), size: DVec2::new(2.0, 2.0) };
    let disk = |x: f64| Outline::Disk { center: at(x), radius: 1.0 };
    let square = |x: f64, half: f64| -> Vec<DVec2> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| at(x) + half * DVec2::new(a, b))
            .to_vec()
    };
    let polygon = |x: f64| Outline::Polygon(square(x, 1.0));
    let shapes: [&dyn Fn(f64) -> Outline; 3] = [&rectangle, &disk, &polygon];
    for first in shapes {
        for second in shapes {
            for (x, meet) in
                [(2.001, false), (2.0, true), (1.0, true), (0.0, true), (-2.1, false), (-2.0, true)]
            {
                assert_eq!(first(0.0).meets(&second(x)), meet, "{:?} {:?}", first(0.0), second(x));
            }
        }
    }
    // A cross, in which no corner is in the other, and what lies in the hole of a ring.
    let bar = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::new(0.5, 4.0) };
    let other_bar = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::new(4.0, 0.5) };
    assert!(bar.meets(&other_bar));
    let ring = Outline::Contours(vec![square(0.0, 3.0), square(0.0, 2.0)]);
    for within in [disk(0.0), rectangle(0.0), polygon(0.5)] {
        assert!(!ring.meets(&within) && !within.meets(&ring), "{within:?}");
    }
    for over in [disk(1.5), rectangle(1.0), polygon(2.5)] {
        assert!(ring.meets(&over) && over.meets(&ring), "{over:?}");
    }
}

#[test]
fn areas_are_those_of_what_is_inside() {
    let square = |half: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|c| half * DVec2::from(c)).to_vec()
    };
    let backwards = |half: f64| square(half).into_iter().rev().collect();
    let size = DVec2::new(0.2, 0.3);
    let close = |outline: Outline, area: f64| {
        assert!((outline.area() - area).abs() < 1e-12, "{} for {area}", outline.area());
    };
    close(Outline::Rectangle { center: DVec2::ONE, size }, 0.06);
    close(Outline::Disk { center: DVec2::ONE, radius: 0.1 }, 0.01 * std::f64::consts::PI);
    close(Outline::Polygon(backwards(0.5)), 1.0);
    // An island in a hole, whatever the order and the orientations.
    close(Outline::Contours(vec![square(0.1), backwards(0.5), square(0.3)]), 1.0 - 0.36 + 0.04);
}
