//! What README.md and docs/*.md say is so: commands, scenes and keys.

use crate::common::capsense;
use capsense::Scene;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A fenced block of a document.
struct Block {
    document: String,
    language: String,
    lines: Vec<String>,
}

fn documents() -> Vec<PathBuf> {
    let docs = std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut all: Vec<PathBuf> = docs.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    all.push(root().join("README.md"));
    all
}

fn text_of(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn blocks() -> Vec<Block> {
    let mut blocks = Vec::new();
    for path in documents() {
        let mut open = None::<Block>;
        for line in text_of(&path).lines() {
            match (line.strip_prefix("```"), &mut open) {
                (Some(language), None) => {
                    assert!(!language.is_empty(), "{}: a block without a language", path.display());
                    open = Some(Block {
                        document: path.display().to_string(),
                        language: language.to_owned(),
                        lines: Vec::new(),
                    });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (None, Some(block)) => block.lines.push(line.to_owned()),
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: a block that does not end", path.display());
    }
    blocks
}

/// The words of every command in a shell block.
fn commands() -> Vec<(String, Vec<String>)> {
    let mut commands = Vec::new();
    for block in blocks().into_iter().filter(|block| block.language == "sh") {
        for line in &block.lines {
            let command = line.split(" #").next().unwrap_or_default().trim();
            let plain = |c: char| c.is_ascii_alphanumeric() || " ./_-".contains(c);
            assert!(command.chars().all(plain), "{}: `{command}` needs a shell", block.document);
            let words: Vec<String> = command.split_whitespace().map(str::to_owned).collect();
            if !words.is_empty() {
                commands.push((block.document.clone(), words));
            }
        }
    }
    commands
}

/// Copies a folder with all that is in it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn every_command_of_the_documents_works() {
    let folder = tempfile::tempdir().unwrap();
    copy(&root().join("assets"), &folder.path().join("assets"));
    let mut run = 0;
    for (document, words) in commands() {
        let arguments: Vec<&str> = words[1..].iter().map(String::as_str).collect();
        match (words[0].as_str(), arguments.as_slice()) {
            ("capsense", arguments) => {
                let outcome = capsense(folder.path(), arguments);
                let line = words.join(" ");
                assert_eq!(outcome.code, Some(0), "{document}: `{line}`: {}", outcome.stderr);
                run += 1;
            }
            // Tried in that crate's own tests.
            ("capsense-viewer", _) => {}
            ("cargo", ["install", "--locked", "--path", package]) => {
                assert!(root().join(package).join("src/main.rs").is_file(), "{document}: {package}");
            }
            (script, []) if script.starts_with("scripts/") => check_script(&root().join(script)),
            _ => panic!("{document}: nobody checks `{}`", words.join(" ")),
        }
    }
    assert!(run >= 5, "only {run} commands were found");
    for file in ["capsense-out/report.json", "capsense-out/ball/capacitance.svg", "capsense-out/sensor.msh"] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}

fn check_script(script: &Path) {
    let text = text_of(script);
    let shell = if text.starts_with("#!/bin/sh\n") { "sh" } else { "bash" };
    assert!(text.starts_with("#!"), "{}", script.display());
    let checked = Command::new(shell).arg("-n").arg(script).output().unwrap();
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(script).unwrap().permissions().mode();
        assert_eq!(mode & 0o111, 0o111, "{} is not executable", script.display());
    }
}

#[test]
fn every_command_that_is_mentioned_exists() {
    let folder = tempfile::tempdir().unwrap();
    let mut known = BTreeMap::new();
    for path in documents() {
        let text = text_of(&path);
        for span in text.split('`').skip(1).step_by(2) {
            let Some(command) = span.strip_prefix("capsense ") else { continue };
            let Some(name) = command.split_whitespace().next() else { continue };
            let code = *known
                .entry(name.to_owned())
                .or_insert_with(|| capsense(folder.path(), &[name, "--help"]).code);
            assert_eq!(code, Some(0), "{}: `{span}`", path.display());
        }
    }
    for name in ["run", "solve", "mesh", "ports", "chart"] {
        assert!(known.contains_key(name), "no document mentions {name}");
    }
}

#[test]
fn every_link_leads_to_a_file_and_a_heading_in_it() {
    for path in documents() {
        for link in text_of(&path).split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.starts_with("https://") {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link}", path.display());
            let leads_there =
                heading.is_empty() || anchors(&text_of(&target)).any(|anchor| anchor == heading);
            assert!(leads_there, "{}: {link}", path.display());
        }
    }
}

/// What links call the headings of a document: words in small letters with hyphens between them. Code between fences has
/// comments that look like headings.
fn anchors(text: &str) -> impl Iterator<Item = String> {
    let lines = text.split("```").step_by(2).flat_map(str::lines);
    lines.filter(|line| line.starts_with('#')).map(|line| {
        let heading = line.trim_start_matches('#').trim();
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
    })
}

#[test]
fn the_first_frame_of_every_scene_computes() {
    let folder = tempfile::tempdir().unwrap();
    copy(&root().join("assets"), &folder.path().join("assets"));
    let scenes = folder.path().join("assets/scenes");
    let shown = blocks().into_iter().filter(|b| b.language == "toml");
    for (index, block) in shown.enumerate() {
        std::fs::write(scenes.join(format!("document_{index}.toml")), block.lines.join("\n")).unwrap();
    }
    let mut solved = 0;
    let files = std::fs::read_dir(&scenes).unwrap().map(|entry| entry.unwrap().path());
    // Those in folders are run by the test `assets`.
    for scene in files.filter(|path| path.is_file()) {
        let outcome = capsense(folder.path(), &["solve", scene.to_str().unwrap(), "--json"]);
        assert_eq!(outcome.code, Some(0), "{}: {}", scene.display(), outcome.stderr);
        solved += 1;
    }
    assert!(solved >= 5, "only {solved} scenes were found");
}

/// What a refused text says.
fn refusal(text: &str) -> String {
    match Scene::parse("scene.toml", text, Path::new("")) {
        Ok(_) => panic!("this is a scene:\n{text}"),
        Err(error) => error.to_string(),
    }
}

/// The names in backquotes after "expected", in the parser's answer to the name `zzz`.
fn expected_names(text: &str) -> Vec<String> {
    let message = refusal(text);
    let (_, list) = message.split_once("`zzz`, expected").unwrap_or_else(|| panic!("{text}\n{message}"));
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Tables of the scene file, each with text that puts `zzz = 1` into it.
const TABLES: [(&str, &str); 12] = [
    ("domain", "domain = { zzz = 1 }"),
    ("mesh", "mesh = { zzz = 1 }"),
    ("mesh.generate", "mesh.generate = { zzz = 1 }"),
    ("sensor", "sensor = { zzz = 1 }"),
    ("sensor.substrate", "sensor.substrate = { zzz = 1 }"),
    ("sensor.electrode", "sensor.electrode = [{ zzz = 1 }]"),
    ("camera", "camera = { zzz = 1 }"),
    ("object", "object = [{ zzz = 1 }]"),
    ("object.material", "object = [{ material = { zzz = 1 } }]"),
    ("object.trajectory", "object = [{ trajectory = { zzz = 1 } }]"),
    ("simulation", "simulation = { zzz = 1 }"),
    ("measurement", "measurement = { zzz = 1 }"),
];

/// Tables that one row explains.
const SMALL_TABLES: [(&str, &str); 11] = [
    ("sensor.electrode.rectangle", "sensor.electrode = [{ rectangle = { zzz = 1 } }]"),
    ("sensor.electrode.disk", "sensor.electrode = [{ disk = { zzz = 1 } }]"),
    ("object.box", "object = [{ box = { zzz = 1 } }]"),
    ("object.sphere", "object = [{ sphere = { zzz = 1 } }]"),
    ("object.capsule", "object = [{ capsule = { zzz = 1 } }]"),
    ("object.cylinder", "object = [{ cylinder = { zzz = 1 } }]"),
    ("measurement.mains", "measurement.mains = { zzz = 1 }"),
    ("measurement.temperature", "measurement.temperature = { zzz = 1 }"),
    ("measurement.humidity", "measurement.humidity = { zzz = 1 }"),
    ("measurement.offset_dac", "measurement.offset_dac = { zzz = 1 }"),
    ("measurement.converter", "measurement.converter = { zzz = 1 }"),
];

/// Keys whose value is one of some words, each with text in which that word is `zzz`.
const WORDS: [(&str, &str); 7] = [
    ("domain.wall", "domain.wall = 'zzz'"),
    ("mesh.generate.kind", "mesh.generate = { kind = 'zzz' }"),
    (
        "sensor.substrate.back",
        "sensor.substrate = { thickness = 1, relative_permittivity = 1, size = [1, 1], back = 'zzz' }",
    ),
    ("object.material.conductor", "object = [{ material = { conductor = 'zzz' } }]"),
    ("simulation.geometry", "simulation.geometry = 'zzz'"),
    ("simulation.interface", "simulation.interface = 'zzz'"),
    ("solver.preconditioner", "solver.preconditioner = 'zzz'"),
];

/// The rows of the tables in docs/scene.md by their keys.
fn rows() -> BTreeMap<String, String> {
    let text = text_of(&root().join("docs/scene.md"));
    let row = |line: &str| {
        let key = line.strip_prefix("| `")?.split('`').next()?;
        Some((key.to_owned(), line.to_owned()))
    };
    text.lines().filter_map(row).collect()
}

#[test]
fn every_key_of_the_scene_file_is_documented_and_no_other() {
    let rows = rows();
    let mut keys = BTreeSet::new();
    for (table, text) in TABLES.into_iter().chain([("solver", "solver = { zzz = 1 }")]) {
        keys.extend(expected_names(text).iter().map(|key| format!("{table}.{key}")));
    }
    assert_eq!(rows.keys().cloned().collect::<BTreeSet<_>>(), keys);
    for (key, text) in SMALL_TABLES.into_iter().chain(WORDS) {
        for name in expected_names(text) {
            assert!(rows[key].contains(&name), "{key}: {name} is missing");
        }
    }
    let document = text_of(&root().join("docs/scene.md"));
    for table in expected_names("zzz = 1") {
        let heading = document.lines().any(|line| line.starts_with("## `[") && line.contains(&table));
        assert!(heading, "{table} has no heading");
    }
}

/// A scene with one more setting.
fn scene_with(setting: &str) -> String {
    match setting.strip_prefix("sensor.electrode.") {
        Some(of_electrode) => format!("sensor.electrode = [{{ name = 'E1', {of_electrode} }}]"),
        None => format!(
            "{setting}\nsensor.electrode = [{{ name = 'E1', rectangle = {{ center = [0, 0], size = [0.1, 0.1] }} }}]"
        ),
    }
}

#[test]
fn every_word_of_the_scene_file_is_accepted() {
    for (key, text) in WORDS {
        for word in expected_names(text) {
            let setting = format!("{key} = \"{word}\"");
            if text.starts_with(key) {
                let parsed = Scene::parse("scene.toml", &scene_with(&setting), Path::new(""));
                assert!(parsed.is_ok(), "{setting}: {:?}", parsed.err());
            }
        }
    }
}
