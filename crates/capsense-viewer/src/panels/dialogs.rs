//! Dialogs: a path to open or to write, and the list of shortcuts.

use crate::style::{error_colour, faint, named};
use egui::{Id, Key, Modal, RichText, TextEdit, Ui};
use std::path::{Path, PathBuf};

/// What a path is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Open a scene or the folder of a run.
    Open,
    /// Add a mesh file as an object.
    AddMesh,
    /// Open a recording beside the curves.
    OpenRecording,
    /// Save the scene.
    SaveScene,
    /// Write the curves as a table.
    ExportCsv,
    /// Write a picture of the window.
    ExportPng,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a scene, or the folder of a run",
            Self::AddMesh => "Add a mesh file (.glb, .gltf, .obj, .stl)",
            Self::OpenRecording => "Open a recording (.csv, .mcap)",
            Self::SaveScene => "Save the scene",
            Self::ExportCsv => "Export the curves as CSV",
            Self::ExportPng => "Export the window as PNG",
        }
    }

    fn button(self) -> &'static str {
        match self {
            Self::Open | Self::OpenRecording => "Open",
            Self::AddMesh => "Add",
            Self::SaveScene => "Save",
            Self::ExportCsv | Self::ExportPng => "Export",
        }
    }

    /// Whether a file that is there would be lost.
    fn writes(self) -> bool {
        matches!(self, Self::SaveScene | Self::ExportCsv | Self::ExportPng)
    }
}

/// The dialog that is open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dialog {
    /// Asks for a path.
    Path {
        /// What for.
        purpose: Purpose,
        /// What is written in it.
        text: String,
        /// What was wrong with it.
        error: Option<String>,
    },
    /// Lists the shortcuts.
    Help,
}

impl Dialog {
    /// Asks for a path, beginning with one.
    pub fn path(purpose: Purpose, start: &Path) -> Self {
        Self::Path { purpose, text: start.display().to_string(), error: None }
    }
}

/// What became of the dialog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It stays.
    Open,
    /// It is gone.
    Closed,
    /// This path was given.
    Given(Purpose, PathBuf),
}

/// Shortcuts and what they do.
pub const SHORTCUTS: [(&str, &[(&str, &str)]); 4] = [
    (
        "Trajectory",
        &[
            ("Space", "play, pause"),
            ("left, right", "one frame back, on"),
            ("Home", "to the beginning"),
            ("R", "compute all frames"),
        ],
    ),
    (
        "Selected object",
        &[
            ("Alt + arrows", "move by 1 mm along x and y"),
            ("Alt + PgUp, PgDn", "move by 1 mm along z"),
            ("Shift as well", "ten times as far"),
            ("Delete", "remove it"),
            ("Esc", "select nothing"),
        ],
    ),
    (
        "File",
        &[
            ("Ctrl + O", "open a scene"),
            ("Ctrl + S", "save the scene"),
            ("Ctrl + Z", "take the last change back"),
            ("Ctrl + E", "export the curves as CSV"),
            ("Ctrl + P", "export the window as PNG"),
        ],
    ),
    (
        "Window",
        &[
            ("1, 2, 3", "panels: scene, curves, data"),
            ("F", "show all of the 3D view's scene"),
            ("A", "show all of the curves"),
            ("P", "hold the live time axis"),
            ("T", "dark, light"),
            ("?", "this list"),
        ],
    ),
];

/// Shows the dialog.
pub fn ui(ctx: &egui::Context, dialog: &mut Dialog) -> Outcome {
    match dialog {
        Dialog::Help => {
            let modal = Modal::new(Id::unique("help")).show(ctx, help);
            if modal.should_close() || modal.inner { Outcome::Closed } else { Outcome::Open }
        }
        Dialog::Path { purpose, text, error } => {
            let modal =
                Modal::new(Id::unique("path")).show(ctx, |ui| path(ui, *purpose, text, error.as_deref()));
            match modal.inner {
                Some(true) => Outcome::Given(*purpose, PathBuf::from(text.trim())),
                Some(false) => Outcome::Closed,
                None if modal.should_close() => Outcome::Closed,
                None => Outcome::Open,
            }
        }
    }
}

fn path(ui: &mut Ui, purpose: Purpose, text: &mut String, error: Option<&str>) -> Option<bool> {
    ui.set_width(520.0);
    ui.heading(purpose.title());
    ui.add_space(6.0);
    let edit = TextEdit::singleline(text).desired_width(f32::INFINITY).hint_text("path");
    let response = named(ui.add(edit), "path");
    if !response.has_focus() && !response.lost_focus() {
        response.request_focus();
    }
    let entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    if let Some(error) = error {
        ui.label(RichText::new(error).color(error_colour(ui)));
    } else if purpose.writes() && Path::new(text.trim()).is_file() {
        ui.label(RichText::new("This file is there and would be replaced.").color(faint(ui)));
    } else {
        ui.label(RichText::new("Files can also be dropped on the window.").color(faint(ui)));
    }
    ui.add_space(6.0);
    let mut answer = None;
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        let is_given = !text.trim().is_empty();
        if ui.add_enabled(is_given, egui::Button::new(purpose.button())).clicked() || (entered && is_given) {
            answer = Some(true);
        }
        if ui.button("Cancel").clicked() {
            answer = Some(false);
        }
    });
    answer
}

fn help(ui: &mut Ui) -> bool {
    ui.set_width(560.0);
    ui.heading("Keyboard shortcuts");
    ui.add_space(8.0);
    ui.columns(2, |columns| {
        for (index, (title, keys)) in SHORTCUTS.iter().enumerate() {
            let ui = &mut columns[index % 2];
            ui.strong(*title);
            egui::Grid::new(title).num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for (key, what) in *keys {
                    ui.monospace(*key);
                    ui.label(*what);
                    ui.end_row();
                }
            });
            ui.add_space(10.0);
        }
    });
    ui.label(
        RichText::new(
            "3D view: drag turns, right drag moves, scroll zooms; drag the selected object's gizmo.",
        )
        .color(faint(ui)),
    );
    ui.add_space(8.0);
    ui.vertical_centered(|ui| ui.button("Close").clicked()).inner
}
