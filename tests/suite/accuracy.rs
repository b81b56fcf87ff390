//! What `examples/accuracy` measures is as exact and as continuous as it should be, on small lattices.

use crate::cases::{Body, CONNECTIONS, ENTRIES, Entries, bodies, few_bodies, stripes};
use crate::continuity::{CENTROID, SOLID, WAYS, curve};
use crate::measure::measure;
use crate::references::References;
use crate::statistics::Statistics;
use crate::{fitted, plot, rims};
use capsense::core::sensor::Sensor;

#[test]
fn every_body_has_its_references() {
    let references = References::load().unwrap();
    let empty = references.empty().unwrap();
    for body in bodies() {
        for (connection, _) in CONNECTIONS {
            let change = references.change(body.name, connection).unwrap();
            assert!(change[..2].iter().zip(empty).all(|(change, empty)| *change > 0.0 && *change < empty));
        }
        // What floats takes less field from the electrodes than what is held.
        let [grounded, floating] =
            CONNECTIONS.map(|(connection, _)| references.change(body.name, connection).unwrap());
        assert!(floating[0] < grounded[0] && floating[1] < grounded[1], "{}", body.name);
    }
}

#[test]
fn small_lattices_are_exact_to_a_few_percent() {
    let design = stripes();
    let sensor = Sensor::on_lattice(&design, &design.lattice(30_000).unwrap()).unwrap();
    let bodies: Vec<Body> = few_bodies().into_iter().filter(|body| body.name.starts_with("bar")).collect();
    let references = References::load().unwrap();
    let errors = measure(&sensor, &bodies).unwrap().errors(&bodies, &references).unwrap();
    for ((entry, ..), error) in ENTRIES.into_iter().zip(errors.empty) {
        assert!(error.abs() < 5.0, "{entry}: {error} %");
    }
    for (body, changes) in bodies.iter().zip(errors.changes) {
        for ((connection, _), change) in CONNECTIONS.into_iter().zip(changes) {
            // Through a floating body the changes of C12 and C13 are small differences.
            let (compared, allowed) = if connection == "grounded" { (ENTRIES.len(), 7.0) } else { (2, 9.0) };
            for ((entry, ..), error) in ENTRIES.into_iter().zip(change).take(compared) {
                assert!(error.abs() < allowed, "{entry}, {connection} {}: {error} %", body.name);
            }
        }
    }
}

/// What is left of errors is the mesh's own: boxes with all faces in its planes have them too.
#[test]
fn boxes_between_planes_are_as_exact_as_those_that_fit() {
    let lattice = stripes().lattice(30_000).unwrap();
    for height in fitted::HEIGHTS {
        let bodies = fitted::bodies(&lattice, height).unwrap();
        let on = |parts| fitted::measure_on(&lattice, [parts; 3], &bodies).unwrap().1;
        let errors = fitted::errors(&on(1), &on(3));
        let largest = |of: &[Entries; CONNECTIONS.len()]| {
            of.iter().flat_map(fitted::told).fold(0.0, |most: f64, error| most.max(error.abs()))
        };
        let (fits, others) = errors.split_first().unwrap();
        for (body, errors) in bodies[1..].iter().zip(others) {
            let (own, of_fitted) = (largest(errors), largest(fits));
            assert!(own < 1.15 * of_fitted, "{height} m, {}: {own} and {of_fitted} %", body.name);
        }
    }
}

#[test]
fn edge_cut_feels_steps_and_centroids_move_in_leaps() {
    for way in WAYS {
        let [cut, centroid] = [SOLID, CENTROID].map(|model| Statistics::of(&curve(model, way).unwrap()));
        assert_eq!(cut.wrong, 0, "{}", way.name);
        assert!(centroid.wrong > cut.steps / 2, "{}: {}", way.name, centroid.wrong);
        assert!(centroid.largest > 5.0 * cut.largest, "{}: {} {}", way.name, centroid.largest, cut.largest);
    }
}

#[test]
fn curves_are_drawn() {
    let curves = WAYS.map(|way| curve(SOLID, way).unwrap());
    let drawing = plot::plot(&curves).unwrap();
    assert!(drawing.starts_with("<svg") && drawing.trim_end().ends_with("</svg>"));
    assert_eq!(drawing.matches("[mm]").count(), 2 * WAYS.len(), "two charts for each way");
}

/// Cells four times as high as the plate's eighth are too high for what is said of rims.
#[test]
fn plates_of_eight_cells_are_exact_to_a_percent() {
    for case in rims::in_air().into_iter().chain(rims::on_board()) {
        let allowed = if case.name == "cells 4 times as high" { 1.5 } else { 0.6 };
        for error in case.errors(8, false, case.reference(8)).unwrap() {
            assert!(error.abs() < allowed, "{}: {error} %", case.name);
        }
    }
}

/// By symmetry, where the board fills the half of the box below the plate.
#[test]
fn references_of_plates_are_exact() {
    let half_filled = rims::on_board().into_iter().find(|case| case.name == "down to the wall").unwrap();
    let ratio = half_filled.reference(8) / rims::in_air()[0].reference(8);
    assert!((ratio / 2.7 - 1.0).abs() < 1e-12, "{ratio}");
}
