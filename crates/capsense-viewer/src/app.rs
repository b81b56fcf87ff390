//! The window: menu, panels around the 3D view, shortcuts, files that are dropped.

use crate::export::WindowPictures;
use crate::frame_rate::{FrameRate, Report, WindowFrame};
use crate::history::TimeAxis;
use crate::panels::curves::CurvesPanel;
use crate::panels::dialogs::{self, Dialog, Outcome, Purpose};
use crate::panels::measurements::Measurements;
use crate::panels::performance::{Performance, median};
use crate::panels::{matrix, objects, simulation, transport};
use crate::preferences::{CurvePreferences, Preferences, Theme};
use crate::scene3d::{BodyPose, Scene3d};
use crate::session::{Bars, Message, Session};
use crate::start::Start;
use crate::style::{self, panel_frame, section};
use crate::{plain_painter, shortcuts, status};
use egui::{CentralPanel, Panel, ScrollArea, Ui};
use egui_wgpu::RenderState;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Under which preferences are kept.
const PREFERENCES: &str = "preferences";

/// A window of less points is narrow.
const NARROW: f32 = 1000.0;

/// How long nothing must have moved before error bars are told.
const REST: Duration = Duration::from_millis(500);

/// The state of the window.
pub struct ViewerApp {
    /// What it is about.
    pub session: Session,
    /// What is remembered.
    pub preferences: Preferences,
    pub(crate) curves: CurvesPanel,
    pub(crate) dialog: Option<Dialog>,
    /// Recordings, and a board that is connected.
    pub measurements: Measurements,
    /// A recording to be opened once its scene is there.
    waiting_recording: Option<PathBuf>,
    /// What is to be told once a scene is there, which takes messages about others away.
    waiting_message: Option<String>,
    scene3d: Scene3d,
    performance: Performance,
    shown_theme: Option<Theme>,
    frame_began: Option<Instant>,
    moves: u64,
    computed_frames: (usize, Instant),
    /// Counts frames while the scene plays, and closes the window then.
    frame_rate: Option<FrameRate>,
    adapter: String,
    pictures: WindowPictures,
}

impl ViewerApp {
    /// Begins with a scene. `render_state` draws the 3D view.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn new(
        ctx: &egui::Context,
        render_state: Option<&RenderState>,
        start: Start,
        preferences: Preferences,
    ) -> std::io::Result<Self> {
        if let Some(state) = render_state {
            plain_painter::install(ctx, state);
        }
        let wake = ctx.clone();
        let mut session = Session::new(start.document, start.path, move || wake.request_repaint())?;
        session.message = start.message.as_ref().map(Message::error);
        Ok(Self {
            session,
            preferences,
            curves: CurvesPanel::default(),
            dialog: None,
            measurements: Measurements::default(),
            waiting_recording: start.recording,
            waiting_message: start.message,
            scene3d: Scene3d::new(render_state),
            performance: Performance::default(),
            shown_theme: None,
            frame_began: None,
            moves: 0,
            computed_frames: (0, Instant::now()),
            frame_rate: None,
            adapter: render_state.map_or_else(String::new, |state| state.adapter.get_info().name),
            pictures: WindowPictures::default(),
        })
    }

    /// Plays the scene as soon as it is there, measures frames of the window, and closes it. Nothing is remembered then.
    pub fn measure(&mut self, frame_rate: FrameRate) {
        self.frame_rate = Some(frame_rate);
    }

    /// What was remembered of the last start.
    pub fn remembered(storage: Option<&dyn eframe::Storage>) -> Preferences {
        storage.and_then(|storage| eframe::get_value(storage, PREFERENCES)).unwrap_or_default()
    }

    /// Draws the window and takes what happens in it.
    pub fn show(&mut self, ui: &mut Ui) {
        let began = Instant::now();
        let between = self.frame_began.map_or(Duration::ZERO, |before| began - before);
        self.frame_began = Some(began);
        if self.shown_theme != Some(self.preferences.theme) {
            style::apply(ui.ctx(), self.preferences.theme);
            self.shown_theme = Some(self.preferences.theme);
        }
        self.session.update(between);
        self.measurements.update(&self.session);
        self.take_up_what_waits();
        self.told_of_pictures();
        self.dropped_files(ui.ctx());
        if self.dialog.is_none() {
            shortcuts::apply(ui.ctx(), self);
        }
        self.panels(ui);
        self.dialogs(ui.ctx());
        self.follow_hand();
        self.keep_going(ui.ctx());
        self.performance.note(began, began.elapsed());
    }

    fn panels(&mut self, ui: &mut Ui) {
        let frame = panel_frame(ui);
        Panel::top("menu")
            .frame(frame.inner_margin(egui::Margin::symmetric(8, 3)))
            .show(ui, |ui| self.menu(ui));
        Panel::bottom("status")
            .frame(frame.inner_margin(egui::Margin::symmetric(10, 4)))
            .show(ui, |ui| status::ui(ui, &mut self.session));
        // In a narrow window curves and transport need all of its width.
        let is_narrow = ui.available_width() < NARROW;
        if is_narrow {
            self.time_panels(ui);
            self.side_panel(ui);
        } else {
            self.side_panels(ui);
            self.time_panels(ui);
        }
        CentralPanel::default().frame(frame.inner_margin(0)).show(ui, |ui| self.view(ui));
    }

    fn side_panels(&mut self, ui: &mut Ui) {
        let frame = panel_frame(ui);
        let panels = self.preferences.panels.clone();
        if panels.scene {
            Panel::left("scene").frame(frame).default_size(292.0).size_range(250.0..=420.0).show(ui, |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.scene_panel(ui));
            });
        }
        if panels.data {
            Panel::right("data").frame(frame).default_size(292.0).size_range(240.0..=480.0).show(ui, |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.data_panel(ui));
            });
        }
    }

    /// Both side panels in one, for windows that have no room for two.
    fn side_panel(&mut self, ui: &mut Ui) {
        let panels = self.preferences.panels.clone();
        if !panels.scene && !panels.data {
            return;
        }
        Panel::left("sides").frame(panel_frame(ui)).default_size(270.0).size_range(240.0..=420.0).show(
            ui,
            |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    if panels.data {
                        self.data_panel(ui);
                    }
                    if panels.scene {
                        self.scene_panel(ui);
                    }
                });
            },
        );
    }

    /// The curves and, above them, the transport.
    fn time_panels(&mut self, ui: &mut Ui) {
        let frame = panel_frame(ui);
        // In a low window the 3D view keeps its share.
        let tallest = (0.45 * ui.available_height()).max(120.0);
        if self.preferences.panels.curves {
            Panel::bottom("curves")
                .frame(frame)
                .resizable(true)
                .default_size(290.0)
                .size_range(120.0..=tallest)
                .show(ui, |ui| {
                    let CurvePreferences { axis, as_read, .. } = self.preferences.curves;
                    let mut overlays = self.measurements.overlays(axis);
                    if as_read {
                        overlays.extend(self.session.history.readings(axis));
                    }
                    self.curves.ui(ui, &self.session, &mut self.preferences.curves, &overlays);
                });
        }
        Panel::bottom("transport").frame(frame.inner_margin(egui::Margin::symmetric(10, 5))).show(ui, |ui| {
            transport::ui(ui, &mut self.session);
        });
    }

    fn scene_panel(&mut self, ui: &mut Ui) {
        section(ui, "Objects", |ui| objects::ui(ui, &mut self.session));
        section(ui, "Simulation", |ui| simulation::ui(ui, &mut self.session));
        section(ui, "3D view", |ui| self.scene3d.options_ui(ui));
    }

    fn data_panel(&mut self, ui: &mut Ui) {
        section(ui, "Matrix", |ui| {
            let Preferences { curves, bars_at_rest, .. } = &mut self.preferences;
            matrix::ui(ui, &mut self.session, curves, bars_at_rest);
        });
        section(ui, "Performance", |ui| self.performance.ui(ui, &self.session));
        section(ui, "Recordings", |ui| {
            if self.measurements.recordings_ui(ui, &self.session) {
                self.ask_for_path(Purpose::OpenRecording);
            }
        });
        section(ui, "Hardware", |ui| self.measurements.hardware_ui(ui, &self.session));
    }

    fn view(&mut self, ui: &mut Ui) {
        let session = &mut self.session;
        let (Some(open), Some(view)) = (&session.open, session.view.clone()) else {
            ui.centered_and_justified(|ui| ui.weak(status::doing(session.activity())));
            return;
        };
        let names = open.scene.objects.iter().map(|object| object.name.clone());
        let poses = session.poses();
        let mut bodies: Vec<BodyPose> =
            names.zip(&poses).map(|(name, pose)| BodyPose::new(name, pose)).collect();
        let response = self.scene3d.show(ui, &view, &mut bodies, &mut session.selected);
        if response.moved {
            let moved = bodies.iter().map(BodyPose::pose).zip(poses).enumerate();
            for (index, (now, _)) in moved.filter(|(_, (now, before))| now != before) {
                session.hold(index, now);
            }
        }
    }

    fn menu(&mut self, ui: &mut Ui) {
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| self.file_menu(ui));
            ui.menu_button("View", |ui| self.view_menu(ui));
            if ui.button("Shortcuts").on_hover_text("?").clicked() {
                self.dialog = Some(Dialog::Help);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let mark = if self.session.is_changed { " *" } else { "" };
                ui.weak(format!("{}{mark}", self.session.title()));
            });
        });
    }

    fn file_menu(&mut self, ui: &mut Ui) {
        for (text, keys, purpose) in [
            ("Open…", "Ctrl+O", Purpose::Open),
            ("Save scene…", "Ctrl+S", Purpose::SaveScene),
            ("Add mesh file…", "", Purpose::AddMesh),
            ("Export curves as CSV…", "Ctrl+E", Purpose::ExportCsv),
            ("Export window as PNG…", "Ctrl+P", Purpose::ExportPng),
        ] {
            if ui.add(egui::Button::new(text).shortcut_text(keys)).clicked() {
                self.ask_for_path(purpose);
            }
        }
        ui.separator();
        let can_undo = self.session.can_undo();
        if ui.add_enabled(can_undo, egui::Button::new("Undo").shortcut_text("Ctrl+Z")).clicked() {
            self.session.undo();
        }
        if ui.button("Quit").clicked() {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn view_menu(&mut self, ui: &mut Ui) {
        let panels = &mut self.preferences.panels;
        for (open, text) in [
            (&mut panels.scene, "Scene  (1)"),
            (&mut panels.curves, "Curves  (2)"),
            (&mut panels.data, "Data  (3)"),
        ] {
            ui.checkbox(open, text);
        }
        ui.separator();
        for (theme, text) in
            [(Theme::System, "As the desktop"), (Theme::Dark, "Dark"), (Theme::Light, "Light")]
        {
            ui.radio_value(&mut self.preferences.theme, theme, text);
        }
    }

    /// Whether an object is dragged in the 3D view.
    pub(crate) fn is_dragging(&self) -> bool {
        self.scene3d.is_dragging()
    }

    /// Opens the dialog that asks for a path, beginning with a likely one.
    pub(crate) fn ask_for_path(&mut self, purpose: Purpose) {
        let scene = self.session.path.clone();
        let folder = scene.as_deref().and_then(Path::parent).unwrap_or(Path::new("")).to_owned();
        let stem =
            scene.as_deref().and_then(Path::file_stem).map_or("capsense".into(), |s| s.to_string_lossy());
        let start = match purpose {
            Purpose::SaveScene => scene.clone().unwrap_or_else(|| PathBuf::from("scene.toml")),
            Purpose::ExportCsv => folder.join(format!("{stem}.csv")),
            Purpose::ExportPng => folder.join(format!("{stem}.png")),
            Purpose::Open | Purpose::AddMesh | Purpose::OpenRecording => folder.join(""),
        };
        self.dialog = Some(Dialog::path(purpose, &start));
    }

    fn dialogs(&mut self, ctx: &egui::Context) {
        let Some(mut dialog) = self.dialog.take() else { return };
        // A dialog that closes still takes the pointer for one frame.
        ctx.request_repaint();
        match dialogs::ui(ctx, &mut dialog) {
            Outcome::Open => self.dialog = Some(dialog),
            Outcome::Closed => {}
            Outcome::Given(purpose, path) => {
                if let Err(message) = self.with_path(ctx, purpose, &path) {
                    let text = path.display().to_string();
                    self.dialog = Some(Dialog::Path { purpose, text, error: Some(message) });
                }
            }
        }
    }

    fn with_path(&mut self, ctx: &egui::Context, purpose: Purpose, path: &Path) -> Result<(), String> {
        match purpose {
            Purpose::Open => return self.open(path),
            Purpose::OpenRecording => return self.measurements.open(path, &self.session),
            Purpose::AddMesh => {
                if !path.is_file() {
                    return Err(format!("{}: there is no such file", path.display()));
                }
                objects::add_file(&mut self.session, path);
                return Ok(());
            }
            Purpose::SaveScene => self.session.save(path).map_err(|error| error.to_string())?,
            Purpose::ExportCsv => {
                let table = self.session.history.to_csv(self.preferences.curves.axis);
                let table = table.map_err(|error| error.to_string())?;
                std::fs::write(path, table).map_err(|error| format!("{}: {error}", path.display()))?;
            }
            // What became of it comes with a later frame.
            Purpose::ExportPng => {
                self.pictures.ask(ctx, path.to_owned());
                return Ok(());
            }
        }
        self.session.message = Some(Message::note(format!("written to {}", path.display())));
        Ok(())
    }

    /// Opens whatever a path is.
    pub(crate) fn open(&mut self, path: &Path) -> Result<(), String> {
        let start = Start::from_path(path)?;
        self.session.open_document(start.document, start.path);
        self.waiting_recording = start.recording;
        Ok(())
    }

    /// The curves of a run are compared with its own scene, which must be there first; and what was wrong with another
    /// scene is told beside the one that is shown in its place.
    fn take_up_what_waits(&mut self) {
        if !self.session.is_open() {
            return;
        }
        if let Some(message) = self.waiting_message.take() {
            self.session.message = Some(Message::error(message));
        }
        if let Some(path) = self.waiting_recording.take()
            && let Err(message) = self.measurements.open(&path, &self.session)
        {
            self.session.message = Some(Message::error(message));
        }
    }

    /// Pictures of the window are written after the frame in which they were asked for.
    fn told_of_pictures(&mut self) {
        while let Some(written) = self.pictures.news() {
            self.session.message = Some(match written {
                Ok(path) => Message::note(format!("written to {}", path.display())),
                Err(error) => Message::error(error),
            });
        }
    }

    fn dropped_files(&mut self, ctx: &egui::Context) {
        let paths: Vec<PathBuf> =
            ctx.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect());
        for path in paths {
            let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
            let opened = match extension.as_deref() {
                Some("glb" | "gltf" | "obj" | "stl") => {
                    objects::add_file(&mut self.session, &path);
                    Ok(())
                }
                Some("csv" | "mcap") => self.measurements.open(&path, &self.session),
                _ => self.open(&path),
            };
            if let Err(message) = opened {
                self.session.message = Some(Message::error(message));
            }
        }
    }

    /// What is moved by hand has no place on the time of the trajectories.
    fn follow_hand(&mut self) {
        if self.moves != self.session.moves {
            self.moves = self.session.moves;
            self.preferences.curves.axis = TimeAxis::Session;
        }
    }

    /// Notes this frame if frames are counted. `before_s` is what the one before took without waiting, seconds.
    fn measure_frame(&mut self, ctx: &egui::Context, before_s: Option<f32>) {
        let (Some(rate), Some(began)) = (&mut self.frame_rate, self.frame_began) else { return };
        let (Some(open), true) = (&self.session.open, self.session.last.is_some()) else { return };
        self.session.transport.is_playing = self.session.transport.frames() > 1;
        ctx.request_repaint();
        let samples = self.session.history.session();
        let shapes = self.performance.drawing();
        if rate.note(WindowFrame { began, shapes, before_s }, samples.len()) {
            let computed = rate.computed_since(samples.len());
            rate.finish(Report {
                adapter: self.adapter.clone(),
                size: [ctx.viewport_rect().width(), ctx.viewport_rect().height()]
                    .map(|side| (side * ctx.pixels_per_point()).round() as u32),
                tets: open.mesh.tets,
                computed,
                computing: median(samples[samples.len() - computed..].iter().map(|s| s.milliseconds.total)),
                ..Report::default()
            });
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    /// Asks for the next frame of the window where there is something to come.
    fn keep_going(&mut self, ctx: &egui::Context) {
        let computed = self.session.history.session().len();
        if computed != self.computed_frames.0 {
            self.computed_frames = (computed, Instant::now());
        }
        if self.session.transport.is_playing {
            ctx.request_repaint();
        }
        let is_wanted = self.preferences.bars_at_rest && matches!(self.session.bars, Bars::Unknown);
        if is_wanted && computed > 0 && self.session.is_settled() {
            let rest = self.computed_frames.1.elapsed();
            match REST.checked_sub(rest) {
                Some(left) if !left.is_zero() => ctx.request_repaint_after(left),
                _ => self.session.tell_bars(),
            }
        }
    }
}

impl eframe::App for ViewerApp {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        self.show(ui);
        self.measure_frame(ui.ctx(), frame.info().cpu_usage);
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        if self.frame_rate.is_none() {
            eframe::set_value(storage, PREFERENCES, &self.preferences);
        }
    }
}
