//! The worker: the latest request wins, closing never waits, a scene that fails leaves the one before.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use capsense::core::geometry::Pose;
use capsense_viewer::worker::{Activity, FrameRequest, News, SceneText, Worker};
use glam::DVec3;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Nothing here takes as long; a test that waits for ever says so.
const PATIENCE: Duration = Duration::from_secs(120);

const SCENE: &str = r#"
mesh.generate = { elements = 5000 }
sensor.electrode = [
    { name = "E1", rectangle = { center = [-0.05, 0.0], size = [0.05, 0.1] } },
    { name = "E2", rectangle = { center = [0.05, 0.0], size = [0.05, 0.1] } },
]
[[object]]
name = "bar"
box = { size = [0.1, 0.1, 0.02] }
material = { conductor = "grounded" }
trajectory = { waypoints = [[-0.1, 0.0, 0.08], [0.1, 0.0, 0.08]], speed = 0.1 }
"#;

fn text(toml: &str) -> SceneText {
    SceneText { name: "test.toml".to_owned(), text: toml.to_owned(), folder: PathBuf::new() }
}

fn worker() -> Worker {
    Worker::start(|| {}).unwrap()
}

fn frames(scene: u64, frames: std::ops::Range<usize>) -> FrameRequest {
    FrameRequest { scene, frames, held: Vec::new() }
}

/// Waits until the worker has nothing to do, and returns all it said.
fn settle(worker: &Worker) -> Vec<News> {
    let begun = Instant::now();
    let mut all = Vec::new();
    while worker.activity() != Activity::Idle {
        assert!(begun.elapsed() < PATIENCE, "the worker hangs");
        std::thread::sleep(Duration::from_millis(1));
    }
    all.extend(worker.news());
    all
}

fn indices(news: &[News]) -> Vec<usize> {
    let index = |news: &News| match news {
        News::Frame(computed) => Some(computed.frame.index),
        _ => None,
    };
    news.iter().filter_map(index).collect()
}

#[test]
fn the_latest_request_wins_and_the_last_is_always_computed() {
    let worker = worker();
    worker.load(1, text(SCENE));
    // All of these come while the scene is read: only the last is left.
    for frame in 0..50 {
        worker.compute(frames(1, frame..frame + 1));
    }
    let news = settle(&worker);
    assert!(matches!(news[0], News::Loaded(_)), "{news:?}");
    let computed = indices(&news);
    assert_eq!(computed.last(), Some(&49));
    assert!(computed.len() < 50, "{computed:?}");
    assert_eq!(worker.superseded() as usize, 50 - computed.len());
    assert!(worker.view().is_some(), "there is a picture of the last frame");
    assert!(worker.view().is_none(), "a picture is taken once");
}

#[test]
fn a_long_run_gives_way_to_a_newer_request() {
    let worker = worker();
    worker.load(1, text(SCENE));
    let many = 1_000_000;
    worker.compute(frames(1, 0..many));
    let begun = Instant::now();
    let mut seen = Vec::new();
    while indices(&seen).len() < 3 {
        assert!(begun.elapsed() < PATIENCE);
        seen.extend(worker.news());
        std::thread::sleep(Duration::from_millis(1));
    }
    worker.compute(frames(1, 7..8));
    let rest = indices(&settle(&worker));
    assert_eq!(rest.last(), Some(&7));
    assert!(!rest.contains(&(many - 1)), "the long run went on to its end");
}

#[test]
fn closing_while_it_solves_does_not_wait() {
    let worker = worker();
    // A mesh for this tolerance takes many seconds to choose.
    worker.load(1, text(&SCENE.replace("elements = 5000", "tolerance = 0.003")));
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(worker.activity(), Activity::Loading);
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        drop(worker);
        sender.send(()).unwrap();
    });
    receiver.recv_timeout(Duration::from_secs(5)).expect("closing waits for the mesh");
}

#[test]
fn a_scene_that_fails_leaves_the_last_good_one() {
    let worker = worker();
    worker.load(1, text(SCENE));
    worker.compute(frames(1, 0..1));
    settle(&worker);
    worker.load(2, text(&SCENE.replace("[0.1, 0.1, 0.02]", "[0.1, -0.1, 0.02]")));
    let news = settle(&worker);
    let [News::Failed { scene: 2, message }] = &news[..] else { panic!("{news:?}") };
    assert!(message.contains("object[0].box.size[1]"), "{message}");
    worker.compute(frames(2, 0..1));
    assert!(settle(&worker).is_empty(), "frames of a scene that failed are not computed");
    worker.compute(frames(1, 5..6));
    assert_eq!(indices(&settle(&worker)), [5]);
}

#[test]
fn a_frame_that_fails_leaves_the_scene_open() {
    let worker = worker();
    worker.load(1, text(SCENE));
    let nowhere = Pose::at(DVec3::splat(f64::NAN));
    worker.compute(FrameRequest { scene: 1, frames: 0..1, held: vec![Some(nowhere)] });
    let news = settle(&worker);
    assert!(matches!(news.last(), Some(News::Failed { scene: 1, .. })), "{news:?}");
    worker.compute(frames(1, 3..4));
    assert_eq!(indices(&settle(&worker)), [3]);
}

#[test]
fn what_is_held_stands_where_it_is_held() {
    let worker = worker();
    worker.load(1, text(SCENE));
    let place = DVec3::new(0.0, 0.0, 0.05);
    worker.compute(FrameRequest { scene: 1, frames: 0..1, held: vec![Some(Pose::at(place))] });
    let near = settle(&worker);
    let Some(News::Frame(near)) = near.last() else { panic!("{near:?}") };
    assert_eq!(near.poses[0].translation, place);
    worker.compute(frames(1, 0..1));
    let far = settle(&worker);
    let Some(News::Frame(far)) = far.last() else { panic!("{far:?}") };
    assert_eq!(far.poses[0].translation.x, -0.1);
    let [near, far] = [near, far].map(|computed| computed.frame.capacitance.get(0, 0));
    assert!(near > far, "a grounded bar nearer by adds more: {near:e} {far:e}");
}

#[test]
fn bars_are_told_of_the_last_frame() {
    let worker = worker();
    worker.load(1, text(SCENE));
    worker.compute(frames(1, 0..1));
    worker.tell_bars();
    let news = settle(&worker);
    let Some(News::Bars(bars)) = news.last() else { panic!("{news:?}") };
    let bars = bars.as_ref().as_ref().unwrap();
    assert!(bars.capacitance.get(0, 0) > 0.0);
}

/// A converter of 12 bits in steps of 1 fF reads two entries of each computed frame, whichever frame that is.
#[test]
fn converters_read_every_frame() {
    let converters = "[measurement]\nchannels = [[\"E1\", \"E1\"], [\"E2\", \"E1\"]]\n\
                      converter = { step = 1e-15, bits = 12, zero = 2048 }\n\
                      offset_dac = { step = 1e-15, largest = 10000 }\n";
    let worker = worker();
    worker.load(1, text(&format!("{SCENE}{converters}")));
    let mut news = settle(&worker);
    for range in [0..3, 2..3, 0..1] {
        worker.compute(frames(1, range));
        news.extend(settle(&worker));
    }
    let mut read = 0;
    for news in news {
        let computed = match news {
            News::Frame(computed) => computed,
            News::Failed { message, .. } => panic!("{message}"),
            News::Loaded(_) | News::Bars(_) => continue,
        };
        let truth = [(0, 0), (0, 1)].map(|(i, j)| computed.frame.capacitance.get(i, j));
        assert_eq!(computed.readings.len(), truth.len());
        for (reading, truth) in computed.readings.iter().zip(truth) {
            assert!(reading.raw.is_some_and(|code| (1..4095).contains(&code)), "{reading:?}");
            let off = (reading.farads - truth).abs();
            assert!(off <= 0.51e-15, "{reading:?} {truth:e}");
            read += usize::from(off > 0.0);
        }
    }
    assert_eq!(read, 10, "readings are rounded");
}
