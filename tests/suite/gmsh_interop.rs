//! Meshes exchanged with Gmsh and meshio, where a Python that has both can be found: `CAPSENSE_PYTHON`, or `python3`.

//! Elsewhere the test says that it was skipped.

use std::path::Path;
use std::process::Command;

/// What the script ends with where a module is missing.
const SKIPPED: i32 = 77;

#[test]
fn gmsh_and_meshio_read_our_meshes_and_we_theirs() {
    let python = std::env::var("CAPSENSE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/mesh_interop.py");
    let run = Command::new(&python).arg(script).arg(env!("CARGO_BIN_EXE_capsense")).output();
    let Ok(outcome) = run else {
        println!("skipped: there is no `{python}`");
        return;
    };
    let text = String::from_utf8_lossy(&outcome.stdout);
    print!("{text}");
    if outcome.status.code() != Some(SKIPPED) {
        let errors = String::from_utf8_lossy(&outcome.stderr);
        assert!(outcome.status.success() && text.contains("\n0 failures\n"), "{text}{errors}");
    }
}
