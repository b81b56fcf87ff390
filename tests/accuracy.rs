//! What `examples/accuracy` measures is as exact and as continuous as it should be, on small lattices.
#![allow(clippy::unwrap_used, missing_docs, dead_code)]

#[path = "../examples/accuracy/cases.rs"]
mod cases;
#[path = "../examples/accuracy/continuity.rs"]
mod continuity;
#[path = "../examples/accuracy/measure.rs"]
mod measure;
#[path = "../examples/accuracy/plot.rs"]
mod plot;
#[path = "../examples/accuracy/references.rs"]
mod references;
#[path = "../examples/accuracy/statistics.rs"]
mod statistics;

use capsense::core::sensor::Sensor;
use cases::{Body, CONNECTIONS, ENTRIES, bodies, few_bodies, stripes};
use continuity::{CENTROID, SOLID, UPWARDS, WAYS, curve};
use measure::measure;
use references::References;
use statistics::Statistics;

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
            let compared = if connection == "grounded" { ENTRIES.len() } else { 2 };
            for ((entry, ..), error) in ENTRIES.into_iter().zip(change).take(compared) {
                assert!(error.abs() < 6.0, "{entry}, {connection} {}: {error} %", body.name);
            }
        }
    }
}

#[test]
fn edge_cut_feels_steps_and_centroids_move_in_leaps() {
    for way in WAYS {
        let [cut, centroid] = [SOLID, CENTROID].map(|model| Statistics::of(&curve(model, way).unwrap()));
        let forgiven = if way.name == UPWARDS.name { 0 } else { cut.steps / 10 };
        assert!(cut.wrong <= forgiven, "{}: {}", way.name, cut.wrong);
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
