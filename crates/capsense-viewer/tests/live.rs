//! A board on a pseudo-terminal: read, drawn, calibrated and recorded beside the simulation.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense_hw::PseudoPort;
use capsense_hw::profile::DeviceProfile;
use capsense_hw::stream::{Encoder, Sample, Value};
use capsense_viewer::history::TimeAxis;
use capsense_viewer::live::Connection;
use capsense_viewer::measured::Measured;
use capsense_viewer::panels::measurements::Measurements;
use capsense_viewer::session::Session;
use common::{PATIENCE, SCENE, start};
use std::time::{Duration, Instant};

/// What the board makes of a capacitance: its gain and offset are not known.
fn as_measured(farads: f64) -> f64 {
    2.0 * farads + 3e-12
}

#[test]
fn a_board_is_plotted_calibrated_and_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("board.mcap");
    let mut port = PseudoPort::open().unwrap();
    let profile = DeviceProfile::find("generic").unwrap();
    let encoder = Encoder::new(&profile.stream).unwrap();
    let start = start(SCENE);
    let mut session = Session::new(start.document, start.path, || {}).unwrap();
    let begun = Instant::now();
    while !(session.is_settled() && session.last.is_some()) {
        assert!(begun.elapsed() < PATIENCE);
        session.update(Duration::ZERO);
    }
    let mut measurements = Measurements::default();
    let connection = Connection {
        port: port.path().to_owned(),
        baud: 115_200,
        profile: profile.clone(),
        record: Some(recording.clone()),
    };
    measurements.connect(connection, &session, || {}).unwrap();
    // The bar moves; the board measures what is simulated.
    let mut sent = 0;
    for frame in 0..session.transport.frames() {
        session.transport.seek(frame);
        let before = session.history.session().len();
        while session.history.session().len() == before && frame > 0 {
            session.update(Duration::ZERO);
            std::thread::sleep(Duration::from_millis(1));
        }
        let farads = session.history.last().unwrap().farads.clone();
        let values: Vec<Value> =
            farads.iter().enumerate().map(|(c, farads)| profile.raw(c, as_measured(*farads))).collect();
        let sample = Sample { values: &values, sequence: Some(sent), ..Sample::default() };
        let mut bytes = Vec::new();
        encoder.encode(&sample, &mut bytes);
        assert!(port.send(&bytes).unwrap());
        sent += 1;
        std::thread::sleep(Duration::from_millis(15));
    }
    while measurements.live_channels().first().is_none_or(|channel| channel.times.len() < sent as usize) {
        assert!(begun.elapsed() < PATIENCE, "samples are missing");
        measurements.update(&session);
    }
    assert_eq!(measurements.overlays(TimeAxis::Session).len(), 3);
    let samples = session.history.samples(TimeAxis::Session);
    let curve = capsense::series::Curve::new(
        samples.iter().map(|sample| sample.time_s).collect(),
        samples.iter().map(|sample| sample.farads[0]).collect(),
    )
    .unwrap();
    let channel = &mut measurements.live_channels()[0];
    assert_eq!(channel.entry, 0);
    let r = channel.pearson(&curve, 0.0).unwrap();
    assert!(r > 0.97, "{r}");
    assert!(channel.calibrate(&curve, 0.0));
    assert!((channel.gain - 0.5).abs() < 0.05, "{}", channel.gain);
    measurements.disconnect();
    let recorded = Measured::load(&recording, session.history.electrodes()).unwrap();
    assert_eq!(recorded.channels.len(), 3);
    assert_eq!(recorded.channels[0].values.len(), sent as usize);
}

#[test]
fn a_port_that_is_not_there_is_an_error() {
    let start = start(SCENE);
    let session = Session::new(start.document, start.path, || {}).unwrap();
    let profile = DeviceProfile::find("generic").unwrap();
    let connection = Connection { port: "/no/such/port".to_owned(), baud: 9600, profile, record: None };
    let error = Measurements::default().connect(connection, &session, || {}).unwrap_err();
    assert!(error.contains("/no/such/port"), "{error}");
}
