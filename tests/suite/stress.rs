//! The map of where methods fail: no field may be worse than in `docs/stress.csv`, and the table and the drawing are as told.

use crate::common::{SCENE, capsense};
use capsense::core::occupancy::Interface;
use capsense::evidence::stress::{Cell, Map, Measured, Method, Outcome, Status, Stress};
use std::sync::LazyLock;

const COMMITTED: &[u8] = include_bytes!("../../docs/stress.csv");

/// The whole map, as it is now.
static MAP: LazyLock<Map> = LazyLock::new(|| Map::measure(2, |_| true));

#[test]
fn no_method_is_worse_than_it_was() {
    assert_eq!(MAP.cells.len(), Stress::all().len() * Method::all().len());
    let worse = MAP.worse_than(COMMITTED).unwrap();
    assert!(worse.is_empty(), "{worse:#?}");
}

/// What solves the equations of our own methods solves them, or says that it does not.
#[test]
fn none_of_our_solvers_is_wrong_without_notice() {
    let mut fields = 0;
    for record in csv::Reader::from_reader(&MAP.to_csv().unwrap()[..]).records() {
        let record = record.unwrap();
        if &record[2] == "paper" || &record[5] == "refused" {
            continue;
        }
        let [tolerance, error]: [f64; 2] = [7, 8].map(|index| record[index].parse().unwrap());
        assert!(error <= 3.0 * tolerance, "{record:?}");
        assert_ne!(&record[5], "wrong", "{record:?}");
        fields += 1;
    }
    assert!(fields > 500, "{fields}");
}

/// Bars tell of all errors of our own methods, and are not told so large that they would tell nothing.
#[test]
fn error_bars_of_all_interface_models_are_as_large_as_errors() {
    for interface in [Interface::EdgeCut, Interface::VolumeFraction, Interface::Centroid] {
        let (mut errors, mut bars, mut held) = (Vec::new(), Vec::new(), 0);
        for record in csv::Reader::from_reader(&MAP.to_csv().unwrap()[..]).records() {
            let record = record.unwrap();
            // Solvers differ by next to nothing, so one tells as much as all on a lattice, and one off it.
            let is_one = ["direct", "multigrid, any mesh"].contains(&&record[3]);
            if &record[2] == interface.name() && is_one && !record[10].is_empty() {
                let [error, bar]: [f64; 2] = [9, 10].map(|index| record[index].parse().unwrap());
                held += usize::from(error <= bar);
                errors.push(error);
                bars.push(bar);
            }
        }
        let rms = |of: &[f64]| (of.iter().map(|part| part * part).sum::<f64>() / of.len() as f64).sqrt();
        let (ratio, held) = (rms(&bars) / rms(&errors), held as f64 / errors.len() as f64);
        println!("{}: {ratio:.2} times, {held:.2} of {} held", interface.name(), errors.len());
        assert!((1.0..3.0).contains(&ratio), "{}: {ratio}", interface.name());
        assert!(held > 0.8 && errors.len() > 20, "{}: {held} of {}", interface.name(), errors.len());
    }
}

fn cell(outcome: Outcome) -> Cell {
    Cell { method: Method::all()[0], stress: Stress::Gap(1e-3), outcome }
}

fn measured(iterations: usize, solver_error: f64, model_error: Option<f64>) -> Cell {
    barred(iterations, solver_error, model_error, None)
}

fn barred(iterations: usize, solver_error: f64, model_error: Option<f64>, error_bar: Option<f64>) -> Cell {
    let tolerance = 1e-5;
    cell(Outcome::Measured(Measured { iterations, tolerance, solver_error, model_error, error_bar }))
}

#[test]
fn fields_are_judged_by_what_is_wrong_with_them() {
    for (cell, status, words) in [
        (measured(7, 2.9e-5, Some(0.24)), Some(Status::Ok), "7"),
        (measured(101, 2.9e-5, None), Some(Status::Slow), "101"),
        (measured(7, 4.2e-5, None), Some(Status::Wrong), "4t"),
        (barred(7, 4.2e-5, Some(0.5), Some(0.6)), Some(Status::Wrong), "4t"),
        (measured(7, f64::NAN, None), Some(Status::Wrong), "NaNt"),
        (measured(7, f64::INFINITY, None), Some(Status::Wrong), "∞"),
        (measured(101, 0.0, Some(0.5)), Some(Status::Wrong), "50%"),
        (barred(7, 0.0, Some(0.5), Some(0.49)), Some(Status::Wrong), "50%"),
        (barred(101, 0.0, Some(0.5), Some(0.51)), Some(Status::Inaccurate), "50%"),
        (barred(7, 0.0, Some(0.24), Some(0.1)), Some(Status::Ok), "7"),
        (barred(7, 0.0, Some(f64::NAN), Some(0.1)), Some(Status::Wrong), "7"),
        (cell(Outcome::Refused("no".to_owned())), Some(Status::Refused), "×"),
        (cell(Outcome::NotOffered), None, "–"),
    ] {
        assert_eq!(cell.status(), status, "{cell:?}");
        assert_eq!(cell.to_string(), words);
    }
}

#[test]
fn a_field_that_is_worse_or_missing_is_found() {
    let map = |cell| Map { cells: vec![cell] };
    let good = map(measured(7, 0.0, None));
    let table = good.to_csv().unwrap();
    assert_eq!(good.worse_than(&table).unwrap(), []);
    let slow = map(measured(700, 0.0, None));
    let worse = slow.worse_than(&table).unwrap();
    assert_eq!((worse.len(), worse[0].was, worse[0].is), (1, Status::Ok, Status::Slow));
    assert_eq!(worse[0].field[..2], ["gap to electrode", "1 mm"]);
    // Better ones are no fault.
    assert_eq!(good.worse_than(&slow.to_csv().unwrap()).unwrap(), []);
    let nothing = Map { cells: vec![] };
    assert_eq!(nothing.worse_than(&table).unwrap()[0].is, Status::Wrong);
    assert!(good.worse_than(b"stress,level,interface,solver,precision,status\na,b,c,d,e,f\n").is_err());
}

#[test]
fn the_drawing_has_every_family_and_every_method() {
    let cells = Stress::all().into_iter().flat_map(|stress| {
        Method::all().into_iter().map(move |method| Cell { method, stress, ..measured(7, 0.0, None) })
    });
    let svg = Map { cells: cells.collect() }.to_svg().unwrap();
    for stress in Stress::all() {
        assert!(svg.contains(stress.family()) && svg.contains(&stress.to_string()), "{stress}");
    }
    for method in Method::all() {
        assert!(svg.contains(method.interface_name()) && svg.contains(method.solver_name()));
    }
}

#[test]
fn what_is_interrupted_leaves_whole_columns() {
    let map = Map::measure(1, |done| done < 1);
    let rows = Method::all();
    assert_eq!(map.cells.len(), rows.len());
    assert!(map.cells.iter().zip(&rows).all(|(cell, row)| cell.method == *row));
    assert_eq!(map.to_csv().unwrap(), Map::measure(1, |done| done < 1).to_csv().unwrap());
}

#[test]
fn help_has_an_example_and_a_folder_that_cannot_be_made_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let help = capsense(folder.path(), &["stress", "--help"]);
    assert_eq!(help.code, Some(0));
    assert!(help.stdout.contains("capsense stress --out results"), "{}", help.stdout);
    std::fs::write(folder.path().join("file"), "").unwrap();
    let outcome = capsense(folder.path(), &["stress", "--out", "file/results"]);
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stderr.contains("cannot make the folder file/results"), "{}", outcome.stderr);
    assert_eq!(capsense(folder.path(), &["stress", "scene.toml"]).code, Some(2));
}

/// Error bars do not know of them, so the command warns.
#[test]
fn bodies_that_the_mesh_does_not_see_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let with = |name: &str, thickness: &str, material: &str| {
        let scene = SCENE
            .replace("[0.15, 0.15, 0.04]", &format!("[0.15, 0.15, {thickness}]"))
            .replace("{ conductor = \"grounded\" }", material);
        std::fs::write(folder.path().join(name), scene).unwrap();
        capsense(folder.path(), &["solve", name]).stderr
    };
    let told = with("thin.toml", "1e-3", "{ relative_permittivity = 80.0 }");
    assert!(
        told.contains("thin.toml: in frame 0 object `bar` is too thin or too small for the mesh"),
        "{told}"
    );
    for (thickness, material) in
        [("0.08", "{ relative_permittivity = 80.0 }"), ("1e-3", "{ conductor = \"grounded\" }")]
    {
        assert_eq!(with("fine.toml", thickness, material), "", "{thickness} {material}");
    }
}
