//! The scenes of section V-B: what a rod on known ways must do to the coupling of two electrodes.

use capsense::{Pipeline, Scene};
use std::path::Path;

/// Mutual capacitance of the first two electrodes in every so manieth frame, on a mesh that suffices here.
fn coupling(name: &str, every: usize) -> Vec<(f64, f64)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/section_v_b");
    let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
    let mesh = "elements = 150000";
    assert_eq!(text.matches(mesh).count(), 1);
    let scene = Scene::parse(name, &text.replace(mesh, "elements = 40000"), &folder).unwrap();
    let mut pipeline = Pipeline::new(&scene).unwrap();
    let frames = (0..scene.frames).step_by(every);
    frames.map(|index| (index as f64, -pipeline.frame(index).unwrap().capacitance.get(0, 1))).collect()
}

/// Lowest points of the parts of a curve that lie below a level.
fn dips(curve: &[(f64, f64)], level: f64) -> Vec<(f64, f64)> {
    let below = curve.split(|(_, value)| *value >= level).filter(|part| !part.is_empty());
    below.map(|part| part.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()).collect()
}

/// A level between the lowest and the highest value.
fn level(curve: &[(f64, f64)], part: f64) -> f64 {
    let low = curve.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
    let high = curve.iter().map(|point| point.1).fold(0.0, f64::max);
    low + part * (high - low)
}

/// Ten passes of 200 mm, 17 mm apart: those over the stripes' 100 mm shield them from each other, one as the other.
#[test]
fn a_zigzag_dips_once_a_pass_and_only_over_the_stripes() {
    let curve = coupling("stripe_t4_zigzag_0.116", 1);
    let dips = dips(&curve, level(&curve, 0.6));
    assert_eq!(dips.len(), 6, "{dips:?}");
    for pair in dips.windows(2) {
        assert!((pair[1].0 - pair[0].0 - 48.1).abs() < 2.0, "{dips:?}");
    }
    // Of six passes the middle four are over the stripes with all of the rod.
    for dip in &dips[1..5] {
        assert!((dip.1 / dips[2].1 - 1.0).abs() < 0.02, "{dips:?}");
    }
}

/// Along the stripes the coupling stays low for as long as the rod is over them: 100 mm at 0.116 m/s.
#[test]
fn a_triangle_has_a_plateau_as_long_as_the_stripes() {
    let curve = coupling("stripe_t3_triangular_0.116", 1);
    let half = level(&curve, 0.5);
    let below: Vec<f64> = curve.iter().filter(|point| point.1 < half).map(|point| point.0).collect();
    let first: Vec<f64> = below.iter().copied().filter(|frame| *frame < 150.0).collect();
    let expected = 0.1 / 0.116 * 27.76;
    assert!((first.len() as f64 - expected).abs() < 3.0, "{first:?}");
    let again = below.len() - first.len();
    assert!(first.len().abs_diff(again) <= 1, "the second time as the first: {below:?}");
}

/// A slow rod is measured seven times as often at the same places.
#[test]
fn speed_does_not_matter_to_a_field_without_inertia() {
    let fast = coupling("patch_t2_across_0.116", 1);
    let slow = coupling("patch_t2_across_0.0166", 7);
    let swing = fast[0].1 - level(&fast, 0.0);
    for (fast, slow) in fast.iter().zip(&slow) {
        assert!((fast.1 - slow.1).abs() < 0.05 * swing, "{fast:?} {slow:?}");
    }
}

#[test]
fn a_grounded_rod_shields_every_kind_of_electrode() {
    for electrode in ["stripe", "patch", "meander"] {
        let curve = coupling(&format!("{electrode}_t1_along_0.116"), 3);
        let (first, lowest) = (curve[0].1, level(&curve, 0.0));
        assert!(lowest < 0.99 * first, "{electrode}: {first:e} {lowest:e}");
    }
}
