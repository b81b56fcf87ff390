//! The real program in a real window on a virtual display: an object is moved with mouse and keyboard, the curves are
//! exported, and the table shows that they changed. Needs `Xvfb` and `xdotool`; `scripts/test.sh` installs them.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense_viewer::measured::Measured;
use common::{SCENE, preferences, settle, start, window};
use egui_kittest::kittest::Queryable;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

const SIZE: [f32; 2] = [1200.0, 800.0];
const PATIENCE: Duration = Duration::from_secs(60);
const SLOW_FRAMES: Duration = Duration::from_millis(700);

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A virtual display of the window's size, and its name. One starts at a time: two at once may take the same number, where a server
/// that was killed had it. It goes on without clients: a server that starts anew when the last one leaves, as `xdotool` does many times
/// while the window opens, refuses connections meanwhile.
fn display() -> (Running, String) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _alone = ONE_AT_A_TIME.lock();
    let mut xvfb = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", &format!("{}x{}x24", SIZE[0], SIZE[1])])
        .args(["-nolisten", "tcp", "-noreset"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("Xvfb can be started; scripts/test.sh installs it");
    let mut number = String::new();
    BufReader::new(xvfb.stdout.take().unwrap()).read_line(&mut number).unwrap();
    (Running(xvfb), format!(":{}", number.trim()))
}

/// The program with a scene that lies in a folder.
fn viewer(folder: &Path, display: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_capsense-viewer"));
    command.arg(folder.join("scene.toml")).current_dir(folder).env("DISPLAY", display);
    command.env_remove("WAYLAND_DISPLAY");
    // What is remembered of other starts, and what this one leaves, stays out of it.
    command.env("HOME", folder).env("XDG_DATA_HOME", folder.join("data"));
    command
}

struct Desktop {
    display: String,
    window: String,
    viewer: Running,
    _xvfb: Running,
}

impl Desktop {
    fn start(folder: &Path) -> Self {
        let (xvfb, display) = display();
        let viewer = viewer(folder, &display).spawn().unwrap();
        let viewer = Running(viewer);
        let mut desktop = Self { display, window: String::new(), viewer, _xvfb: xvfb };
        let begun = Instant::now();
        while desktop.window.is_empty() {
            assert!(begun.elapsed() < PATIENCE, "the window does not open");
            let ended = desktop.viewer.0.try_wait().unwrap();
            assert!(ended.is_none(), "the program ended before its window opened: {ended:?}");
            let found = desktop.xdotool(&["search", "--onlyvisible", "--name", "^CapSense$"]);
            desktop.window = found.lines().next().unwrap_or_default().to_owned();
            std::thread::sleep(Duration::from_millis(50));
        }
        let window = desktop.window.clone();
        let size = SIZE.map(|side| side.to_string());
        desktop.xdotool(&["windowmove", &window, "0", "0"]);
        desktop.xdotool(&["windowsize", "--sync", &window, &size[0], &size[1]]);
        desktop.xdotool(&["windowfocus", &window]);
        desktop
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output();
        let output = output.expect("xdotool can be started; scripts/test.sh installs it");
        std::thread::sleep(Duration::from_millis(40));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn move_to(&self, at: egui::Pos2) {
        let [x, y] = [at.x, at.y].map(|side| (side.round() as i32).to_string());
        self.xdotool(&["mousemove", &x, &y]);
    }

    fn click(&self, at: egui::Pos2) {
        self.move_to(at);
        self.xdotool(&["mousedown", "1"]);
        std::thread::sleep(Duration::from_millis(100));
        self.xdotool(&["mouseup", "1"]);
    }

    fn drag(&self, from: egui::Pos2, by: f32) {
        self.move_to(from);
        self.xdotool(&["mousedown", "1"]);
        for step in 1..=8 {
            self.move_to(from + egui::vec2(by * step as f32 / 8.0, 0.0));
        }
        self.xdotool(&["mouseup", "1"]);
    }

    fn keys(&self, keys: &[&str]) {
        for key in keys {
            self.xdotool(&["key", "--clearmodifiers", key]);
        }
    }

    /// Exports the curves, waits until the table is there, and returns the last self-capacitance of E1.
    fn export(&self, folder: &Path, name: &str) -> f64 {
        let path = folder.join(name);
        self.keys(&["ctrl+e"]);
        std::thread::sleep(SLOW_FRAMES);
        self.keys(&["ctrl+a"]);
        self.xdotool(&["type", "--delay", "15", path.to_str().unwrap()]);
        self.keys(&["Return"]);
        let begun = Instant::now();
        loop {
            let electrodes = ["E1", "E2"].map(str::to_owned);
            if let Ok(table) = Measured::load(&path, &electrodes) {
                return *table.channels[0].values.last().unwrap();
            }
            assert!(begun.elapsed() < PATIENCE, "{} is not written", path.display());
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// Where things are in a window of this size: the same program draws it without a display.
fn places() -> [egui::Pos2; 2] {
    let mut harness = window(start(SCENE), preferences(), SIZE);
    settle(&mut harness);
    let bar = harness.get_by_label("bar").rect().center();
    harness.get_by_label("bar").click();
    harness.run_steps(4);
    // The third number of the position is z.
    let numbers: Vec<egui::Rect> =
        harness.get_all_by_role(egui::accesskit::Role::SpinButton).map(|node| node.rect()).collect();
    // The slice of the 3D view, further down, has a position too.
    let labels = harness.get_all_by_label("position").map(|node| node.rect());
    let label = labels.min_by(|a, b| a.top().total_cmp(&b.top())).unwrap();
    let row = numbers.iter().filter(|rect| (rect.center().y - label.center().y).abs() < 12.0);
    let z = row.max_by(|a, b| a.left().total_cmp(&b.left())).unwrap().center();
    [bar, z]
}

#[test]
fn an_object_moved_with_mouse_and_keyboard_changes_the_exported_curve() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let [bar, z] = places();
    let desktop = Desktop::start(folder.path());
    std::thread::sleep(Duration::from_millis(1500));
    // A curve has two samples at least, over the time of the session that moving by hand shows, too.
    desktop.keys(&["Right", "Left"]);
    let before = desktop.export(folder.path(), "before.csv");
    // A software driver may take a while for a frame, and what is clicked must be there in the one before.
    std::thread::sleep(SLOW_FRAMES);
    desktop.click(bar);
    std::thread::sleep(SLOW_FRAMES);
    // To the left is down: nearer to the electrodes.
    desktop.drag(z, -60.0);
    std::thread::sleep(SLOW_FRAMES);
    let dragged = desktop.export(folder.path(), "dragged.csv");
    assert!(dragged > 1.001 * before, "the mouse: {before:e} F, then {dragged:e} F");
    desktop.keys(&["alt+shift+Right", "alt+shift+Right", "alt+shift+Right", "alt+shift+Right"]);
    std::thread::sleep(SLOW_FRAMES);
    let keyed = desktop.export(folder.path(), "keyed.csv");
    assert!(keyed > 1.001 * dragged, "the keyboard: {dragged:e} F, then {keyed:e} F");
}

#[test]
fn a_window_that_is_measured_tells_its_frames_and_closes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let (_xvfb, display) = display();
    let arguments = ["--measure-fps", "1", "--size", "800", "600"];
    let output = viewer(folder.path(), &display).args(arguments).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("800 x 600 pixels, "), "{text}");
    let rate: f64 = lines[1].split(' ').next().unwrap().parse().unwrap();
    assert!(rate > 0.0 && lines[1].contains("frames/s"), "{text}");
    let rate: f64 = lines[3].split(' ').nth(2).unwrap().parse().unwrap();
    assert!(rate > 0.0, "the scene plays: {text}");
    let remembered = walk(&folder.path().join("data"));
    assert!(!remembered.contains("panels"), "the next start is not as this one: {remembered}");
}

/// All text of files in a folder.
fn walk(folder: &Path) -> String {
    let Ok(entries) = std::fs::read_dir(folder) else { return String::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    let text = |path: std::path::PathBuf| match path.is_dir() {
        true => walk(&path),
        false => std::fs::read_to_string(path).unwrap_or_default(),
    };
    paths.map(text).collect()
}
