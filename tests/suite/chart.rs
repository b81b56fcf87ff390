//! Speed against accuracy: what is measured, what it is compared with, what is written and drawn; never how fast it is.

use crate::common::capsense;
use capsense::evidence::chart::{draw, mark_front};
use capsense::evidence::ladder::{PAPER, USUAL};
use capsense::evidence::measure::measure;
use capsense::evidence::pareto::front;
use capsense::evidence::reference::{BUILT_IN, Provenance, Reference, ReferenceMethod, ReferenceValue};
use capsense::evidence::setting::{MeshPlan, Setting, Storage};
use capsense::evidence::stage::{COMPARED, Patience, SEGMENTS, Stage};
use capsense::evidence::table::{Row, from_csv, to_csv};
use capsense::evidence::timing;
use capsense::scene::GeometrySource;
use capsense_core::occupancy::Interface;

fn stage() -> Stage {
    Stage::new(&SEGMENTS).unwrap()
}

/// The reference that comes with the program.
fn built_in(stage: &Stage) -> Reference {
    let wanted = Provenance::of(stage, ReferenceMethod::STANDARD);
    let reference = Reference::read(BUILT_IN, stage, &wanted).unwrap();
    reference.expect(
        "assets/references/steel_bar.json is of another program: run `capsense chart` and copy its file",
    )
}

/// Two lattices that are solved in no time.
const COARSE: ReferenceMethod = ReferenceMethod {
    finest_spacing_m: 0.02,
    spacing_around_bar_m: 0.03,
    growth: 1.6,
    halvings: 1,
    solver_tolerance: 1e-6,
};

/// Settings that are measured in no time: the usual one, plain tetrahedra, a camera, elements filled whole, the paper's.
fn tiny_ladder() -> Vec<Setting> {
    let mesh = MeshPlan::Adapted(10_000);
    let usual = Setting { mesh, patience: Patience::Some, ..USUAL };
    vec![
        usual,
        Setting { storage: Storage::Csr, ..usual },
        Setting { geometry: GeometrySource::Camera, ..usual },
        Setting { interface: Interface::Centroid, ..usual },
        Setting { mesh: MeshPlan::Uniform(3_000), ..usual },
        Setting { mesh: MeshPlan::Adapted(7_000), patience: Patience::Little, ..PAPER },
    ]
}

fn measured(stage: &Stage, reference: &Reference) -> Vec<Row> {
    let rows = tiny_ladder().into_iter().map(|setting| measure(stage, &setting, reference, &|| false));
    rows.map(|row| row.unwrap().unwrap()).collect()
}

#[test]
fn a_tiny_ladder_is_measured_compared_written_and_drawn() {
    let stage = stage();
    let mut rows = measured(&stage, &built_in(&stage));
    mark_front(&mut rows);
    let [usual, csr, camera, centroid, failed, paper] = rows.as_slice() else {
        panic!("{} rows", rows.len())
    };

    for row in [usual, csr, camera, centroid, paper] {
        let [low, median, high] = [row.p10_ms, row.median_ms, row.p90_ms].map(Option::unwrap);
        assert!(0.0 < low && low <= median && median <= high, "{row:?}");
        assert!(row.wall_median_ms.unwrap() > 0.0 && row.mean_ms.unwrap() > 0.0, "{row:?}");
        assert_eq!(row.clock, if cfg!(target_os = "linux") { "thread" } else { &row.clock });
        assert!(row.failure.is_none() && row.threads == 1, "{row:?}");
        let [error, worst] = [row.rms_error_percent, row.max_error_percent].map(Option::unwrap);
        assert!(0.0 < error && error < worst, "{row:?}");
        let [own, own_worst] = [row.reference_rms_percent, row.reference_max_percent].map(Option::unwrap);
        assert!(0.0 < own && own < own_worst && own_worst < 1.0, "{row:?}");
        assert_eq!(row.poses, SEGMENTS.len(), "one pose of each segment is compared");
    }
    // Seven frames of each segment, of which the bar jumps to the first; and two.
    assert_eq!([usual.frames, paper.frames], [6 * SEGMENTS.len(), SEGMENTS.len()]);
    assert!((5_000..=10_000).contains(&usual.tets.unwrap()) && paper.tets.unwrap() <= 7_000);

    // What the mesh leaves, measured: 5.9 % rms; the storage of K is nothing to it but for aggregation and rims off the lattice.
    let error = |row: &Row| row.rms_error_percent.unwrap();
    assert!(error(usual) < 9.0 && error(csr) < 10.0 && error(camera) < 10.0, "{usual:?} {csr:?} {camera:?}");
    assert!(
        error(centroid) > 5.0 * error(usual) && error(paper) > 10.0 * error(usual),
        "{centroid:?} {paper:?}"
    );

    // Spacing of 60 mm leaves no node to an electrode of 20 mm: told, not hidden.
    assert!(
        failed.point().is_none() && failed.failure.as_ref().unwrap().contains("owns no node"),
        "{failed:?}"
    );
    assert!(!failed.on_front && rows.iter().any(|row| row.on_front));

    let csv = to_csv(&rows).unwrap();
    assert_eq!(from_csv(&csv).unwrap(), rows);
    let drawing = draw(&rows).unwrap();
    for text in [
        "time of a frame [ms]",
        "error of ΔC [%]",
        "Pareto front",
        "s method, measured here",
        "published",
        "100 Hz",
        "10k",
    ] {
        assert!(drawing.contains(text), "{text} is missing");
    }
    assert!(drawing.contains("error bar of the reference") && drawing.contains("One thread."));
}

#[test]
fn errors_are_the_same_in_every_run() {
    let stage = stage();
    let reference = built_in(&stage);
    let setting = Setting { patience: Patience::Little, ..tiny_ladder()[2] };
    let errors = || {
        let row = measure(&stage, &setting, &reference, &|| false).unwrap().unwrap();
        (row.rms_error_percent, row.max_error_percent, row.tets, row.frames, row.poses)
    };
    assert_eq!(errors(), errors());
}

#[test]
fn the_table_has_all_settings_and_results_as_columns() {
    let text = String::from_utf8(to_csv(&[Row::of(&USUAL)]).unwrap()).unwrap();
    assert_eq!(
        text.lines().next().unwrap(),
        "version,method,mesh,asked,storage,interface,geometry,preconditioner,tolerance,threads,tets,frames,clock,\
         median_ms,p10_ms,p90_ms,mean_ms,wall_median_ms,poses,rms_error_percent,max_error_percent,\
         reference_rms_percent,reference_max_percent,on_front,failure"
    );
    let row = Row::of(&USUAL);
    assert!(row.is_of(&USUAL) && row.is_like(&Setting { mesh: MeshPlan::Adapted(7), ..USUAL }));
    for other in [
        Setting { mesh: MeshPlan::Uniform(3_000), ..USUAL },
        Setting { mesh: MeshPlan::Adapted(7), ..USUAL },
        Setting { tolerance: 1e-3, ..USUAL },
        Setting { threads: 2, ..USUAL },
        Setting { interface: Interface::Centroid, ..USUAL },
        PAPER,
    ] {
        assert!(!row.is_of(&other), "{other:?}");
    }
    assert!(!Row { version: "0.0.1".to_owned(), ..row }.is_of(&USUAL));
}

#[test]
fn a_chart_of_nothing_can_be_drawn() {
    assert!(draw(&[]).unwrap().contains("time of a frame"));
    assert!(timing::draw(&[]).unwrap().contains("tetrahedra"));
}

/// Rows with made-up times and errors, on the series of the usual setting.
fn made_up(points: &[(f64, f64)]) -> Vec<Row> {
    let row = |&(time, error): &(f64, f64)| Row {
        median_ms: Some(time),
        rms_error_percent: Some(error),
        ..Row::of(&USUAL)
    };
    points.iter().map(row).collect()
}

#[test]
fn rows_on_the_front_are_marked() {
    let points = [(1.0, 50.0), (2.0, 10.0), (3.0, 20.0), (4.0, 1.0)];
    let mut rows = made_up(&points);
    rows.push(Row { failure: Some("no".to_owned()), ..Row::of(&USUAL) });
    mark_front(&mut rows);
    let marked: Vec<usize> = (0..rows.len()).filter(|&index| rows[index].on_front).collect();
    assert_eq!(marked, [0, 1, 3]);
    assert_eq!(marked, front(&points));
}

#[test]
fn errors_beyond_the_chart_are_told_beside_their_point() {
    let mut rows = made_up(&[(1.0, 1370.0), (2.0, 3.0)]);
    mark_front(&mut rows);
    let drawing = draw(&rows).unwrap();
    assert!(drawing.contains("1370 %"));
}

#[test]
fn ctrl_c_leaves_a_setting_unmeasured() {
    let stage = stage();
    assert_eq!(measure(&stage, &tiny_ladder()[0], &built_in(&stage), &|| true).unwrap(), None);
}

#[test]
fn the_committed_reference_is_complete_and_agrees_with_another_program() {
    let stage = stage();
    let reference = built_in(&stage);
    assert_eq!(reference.values.len(), SEGMENTS.len() * COMPARED.len() + 2);
    assert!(reference.to_json().unwrap() == BUILT_IN, "the file is not as the program writes it");
    for ReferenceValue { tets, change_farads, error_farads, place } in &reference.values {
        assert!(*tets > 5_000_000, "{tets}");
        for (change, error) in change_farads.iter().zip(error_farads) {
            assert!(error / change < 0.007, "{place:?}: {error:e} of {change:e}");
        }
    }
    let beside = reference.beside_published(&stage);
    assert_eq!(beside.len(), 8);
    for [published, own] in beside {
        // That program is good to 0.1 to 0.25 %.
        assert!((own / published - 1.0).abs() < 2.5e-3, "{published:e} {own:e}");
    }
}

#[test]
fn a_reference_converges_pose_by_pose() {
    let stage = Stage::new(&SEGMENTS[..1]).unwrap();
    let mut own = Reference::begin(&stage, COARSE);
    assert_eq!(Reference::wanted(&stage), COMPARED.len() + 2);
    assert!(own.add_next(&stage).unwrap() && own.add_next(&stage).unwrap());
    // What there is of it is taken over, and the rest is computed.
    let wanted = Provenance::of(&stage, COARSE);
    let mut taken = Reference::read(&own.to_json().unwrap(), &stage, &wanted).unwrap().unwrap();
    assert_eq!(taken, own);
    while taken.add_next(&stage).unwrap() {}
    assert_eq!(taken.values.len(), Reference::wanted(&stage));
    // Its lattices are coarse, and it knows: the limit is off the committed one by less than its bar.
    let fine = built_in(&self::stage());
    for (coarse, fine) in taken.values.iter().zip(&fine.values[..COMPARED.len()]) {
        for entry in 0..6 {
            let off = (coarse.change_farads[entry] - fine.change_farads[entry]).abs();
            assert!(off < coarse.error_farads[entry], "{entry}: {off:e} of {coarse:?}");
        }
    }
}

#[test]
fn a_reference_of_another_origin_is_not_used() {
    let stage = stage();
    let reference = built_in(&stage);
    let wanted = || Provenance::of(&stage, ReferenceMethod::STANDARD);
    for other in [
        Provenance { program: "capsense 0.0.1".to_owned(), ..wanted() },
        Provenance { sensor: "another".to_owned(), ..wanted() },
        Provenance { bar: "another".to_owned(), ..wanted() },
        Provenance { method: COARSE, ..wanted() },
    ] {
        assert_eq!(Reference::read(BUILT_IN, &stage, &other).unwrap(), None, "{other:?}");
    }
    // Other poses, in another order, or more of them.
    let mut reversed = SEGMENTS;
    reversed.reverse();
    for segments in [reversed.as_slice(), &SEGMENTS[..3]] {
        let other = Stage::new(segments).unwrap();
        assert_eq!(Reference::read(BUILT_IN, &other, &wanted()).unwrap(), None);
    }
    assert_eq!(Reference::read(BUILT_IN, &stage, &wanted()).unwrap(), Some(reference));
}

#[test]
fn a_broken_reference_is_refused() {
    let stage = stage();
    let wanted = Provenance::of(&stage, ReferenceMethod::STANDARD);
    let refusal = |text: &str| Reference::read(text, &stage, &wanted).unwrap_err().to_string();
    for text in ["", "{", &BUILT_IN[..2000], &BUILT_IN.replace("tets", "elements")] {
        assert!(
            refusal(text).contains("line ") && refusal(text).contains("delete the file"),
            "{}",
            refusal(text)
        );
    }
    let mut short = built_in(&stage);
    short.values[3].error_farads.pop();
    assert!(refusal(&short.to_json().unwrap()).starts_with("values[3] is no change of C"));
    let mut negative = built_in(&stage);
    negative.values[5].error_farads[0] = -1e-18;
    assert!(refusal(&negative.to_json().unwrap()).starts_with("values[5]"));
}

#[test]
fn the_command_refuses_broken_files_and_tells_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let references = folder.path().join("results/references");
    std::fs::create_dir_all(&references).unwrap();
    std::fs::write(references.join("steel_bar.json"), "{ \"provenance\": 3 }").unwrap();
    let outcome = capsense(folder.path(), &["chart", "--quick", "--out", "results"]);
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    let message = &outcome.stderr;
    assert!(message.contains("steel_bar.json: invalid type") && message.contains("line 1"), "{message}");

    std::fs::write(folder.path().join("results/chart.csv"), "version,method\n0.1.0,capsense\n").unwrap();
    let outcome = capsense(folder.path(), &["chart", "--resume", "--out", "results"]);
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains("chart.csv: ") && outcome.stderr.contains("--resume"),
        "{}",
        outcome.stderr
    );

    let outcome = capsense(folder.path(), &["chart", "--help"]);
    assert_eq!(outcome.code, Some(0));
    assert!(outcome.stdout.contains("Examples:\n  capsense chart --quick"), "{}", outcome.stdout);
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_complete_files_that_a_run_goes_on_from() {
    let folder = tempfile::tempdir().unwrap();
    let start = |resume: bool| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_capsense"));
        command.args(["chart", "--out", "results"]).args(resume.then_some("--resume"));
        command.current_dir(folder.path()).stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    let interrupted = |child: std::process::Child| {
        // The program listens for Ctrl-C before it makes the folder.
        while !folder.path().join("results").exists() {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        std::thread::sleep(std::time::Duration::from_millis(1500));
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("interrupted after") && message.contains("--resume"), "{message}");
        let rows = from_csv(&std::fs::read(folder.path().join("results/chart.csv")).unwrap()).unwrap();
        let drawing = std::fs::read_to_string(folder.path().join("results/chart.svg")).unwrap();
        assert!(drawing.trim_end().ends_with("</svg>"));
        rows
    };
    let before = interrupted(start(false));
    let after = interrupted(start(true));
    assert!(after.len() >= before.len());
    for (kept, row) in after.iter().zip(&before) {
        assert_eq!(Row { on_front: row.on_front, ..kept.clone() }, *row, "measured again");
    }
}

#[test]
fn methods_of_the_timing_bench_can_be_run() {
    let stage = stage();
    let reference = built_in(&stage);
    let rows: Vec<Row> = timing::smallest()
        .iter()
        .map(|setting| measure(&stage, setting, &reference, &|| false).unwrap().unwrap())
        .collect();
    assert!(rows.iter().all(|row| row.failure.is_none()), "{rows:?}");
    let drawing = timing::draw(&rows).unwrap();
    for text in ["tetrahedra", "time of a frame [ms]", "published", "lattice", "csr"] {
        assert!(drawing.contains(text), "{text} is missing");
    }
}
