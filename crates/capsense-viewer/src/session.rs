//! What the window is about: the scene as it is edited, where its objects are held, what was computed of it.
//!
//! Nothing here draws. A change goes into a copy of the document; the copy takes its place once the worker has read it
//! without complaint, and else the message is all that is left of it.

use crate::history::History;
use crate::scene3d::Frame3d;
use crate::transport::Transport;
use crate::worker::{Activity, Computed, FrameRequest, LoadedScene, News, SceneText, Worker};
use capsense::Scene;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::estimate::ErrorBars;
use capsense::core::geometry::Pose;
use capsense::run_folder::MeshSize;
use capsense::scene::write::SceneDocument;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Changes that can be taken back.
const MOST_UNDO: usize = 100;

/// A scene that is ready.
pub struct OpenScene {
    number: u64,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Capacitances without objects.
    pub base: CapacitanceMatrix,
    /// Size of its mesh.
    pub mesh: MeshSize,
    /// What draws its objects.
    pub renderer: String,
    /// What computes the fields.
    pub device: String,
}

/// A document that was sent to the worker and has not come back.
struct Pending {
    number: u64,
    document: SceneDocument,
    /// Whether it is a change that can be taken back.
    can_undo: bool,
    /// Objects that are in the scene before and not in this one, in the order in which they were left out.
    removed: Vec<usize>,
}

/// How bad a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// All is well.
    Note,
    /// Something is odd.
    Warning,
    /// A frame failed; the next that does not takes the message away.
    FrameError,
    /// Something that was asked for was not done.
    Error,
}

impl Severity {
    /// Whether something was not done.
    pub fn is_failure(self) -> bool {
        matches!(self, Self::FrameError | Self::Error)
    }
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// What happened.
    pub text: String,
    /// How bad it is.
    pub severity: Severity,
}

impl Message {
    /// Something that was asked for was not done.
    pub fn error(text: impl ToString) -> Self {
        Self { text: text.to_string(), severity: Severity::Error }
    }

    /// Something was done.
    pub fn note(text: impl ToString) -> Self {
        Self { text: text.to_string(), severity: Severity::Note }
    }
}

/// Error bars, and where they are known.
#[derive(Debug, Default)]
pub enum Bars {
    /// Nobody asked.
    #[default]
    Unknown,
    /// They are of the last frame.
    Known(ErrorBars),
    /// The mesh is too large to be halved.
    TooLarge,
}

/// The state behind the window.
pub struct Session {
    worker: Worker,
    begun: Instant,
    document: SceneDocument,
    pending: Option<Pending>,
    undo: Vec<SceneDocument>,
    next_number: u64,
    /// Where the document was saved or read from, if it was.
    pub path: Option<PathBuf>,
    /// Whether there is something to save.
    pub is_changed: bool,
    /// The scene that is shown.
    pub open: Option<OpenScene>,
    /// Playing.
    pub transport: Transport,
    /// Poses of objects that are held by hand.
    pub held: Vec<Option<Pose>>,
    /// How often objects were moved by hand.
    pub moves: u64,
    /// The object that is selected.
    pub selected: Option<usize>,
    /// Curves.
    pub history: History,
    /// What was computed last.
    pub last: Option<Box<Computed>>,
    /// Error bars of it.
    pub bars: Bars,
    /// Picture of it.
    pub view: Option<Frame3d>,
    /// What is to be told.
    pub message: Option<Message>,
    asked: Option<(u64, usize, Vec<Option<Pose>>)>,
}

impl Session {
    /// Begins with a document; `wake` is called whenever there is something new.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn new(
        document: SceneDocument,
        path: Option<PathBuf>,
        wake: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let mut session = Self {
            worker: Worker::start(wake)?,
            begun: Instant::now(),
            document: document.clone(),
            pending: None,
            undo: Vec::new(),
            next_number: 1,
            path: path.clone(),
            is_changed: false,
            open: None,
            transport: Transport::default(),
            held: Vec::new(),
            moves: 0,
            selected: None,
            history: History::default(),
            last: None,
            bars: Bars::default(),
            view: None,
            message: None,
            asked: None,
        };
        session.open_document(document, path);
        Ok(session)
    }

    /// Time since the session began, in seconds.
    pub fn now_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Opens another scene in place of this one, once the worker has read it without complaint.
    pub fn open_document(&mut self, document: SceneDocument, path: Option<PathBuf>) {
        self.path = path;
        self.undo.clear();
        self.held.clear();
        self.selected = None;
        self.is_changed = false;
        self.transport.is_playing = false;
        self.transport.seek(0);
        self.send(document, false, Vec::new());
    }

    fn send(&mut self, document: SceneDocument, can_undo: bool, removed: Vec<usize>) {
        let number = self.next_number;
        self.next_number += 1;
        let text = SceneText {
            name: document.name().to_owned(),
            text: document.text(),
            folder: document.folder().to_owned(),
        };
        self.worker.load(number, text);
        self.pending = Some(Pending { number, document, can_undo, removed });
        self.asked = None;
    }

    /// Changes the scene.
    pub fn edit(&mut self, change: impl FnOnce(&mut SceneDocument)) {
        let (mut document, removed) = match &self.pending {
            Some(pending) => (pending.document.clone(), pending.removed.clone()),
            None => (self.document.clone(), Vec::new()),
        };
        change(&mut document);
        self.send(document, true, removed);
    }

    /// Leaves an object out of the scene.
    pub fn remove_object(&mut self, object: usize) {
        self.edit(|document| document.remove_object(object));
        if let Some(pending) = &mut self.pending {
            pending.removed.push(object);
        }
    }

    /// Takes the last change back.
    pub fn undo(&mut self) {
        if let Some(document) = self.undo.pop() {
            self.is_changed = true;
            self.held.clear();
            self.send(document, false, Vec::new());
        }
    }

    /// Whether there is a change to take back.
    pub fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    /// The scene file as it would be saved: objects that are held rest where they are.
    pub fn document_to_save(&self) -> SceneDocument {
        let mut document = self.document.clone();
        for (object, held) in self.held.iter().enumerate() {
            if let Some(pose) = held {
                document.place(object, *pose);
            }
        }
        document
    }

    /// Saves the scene.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&mut self, path: &Path) -> Result<(), capsense::scene::write::WriteError> {
        let mut document = self.document_to_save();
        document.save(path)?;
        self.path = Some(path.to_owned());
        self.is_changed = false;
        // Held objects rest where they are from now on.
        self.held.clear();
        self.send(document, false, Vec::new());
        Ok(())
    }

    /// Holds an object at a pose.
    pub fn hold(&mut self, object: usize, pose: Pose) {
        if !pose.is_valid() {
            return;
        }
        if self.held.len() <= object {
            self.held.resize(object + 1, None);
        }
        if self.held[object] != Some(pose) {
            self.held[object] = Some(pose);
            self.is_changed = true;
            self.moves += 1;
            self.history.clear_scene();
        }
    }

    /// Lets an object follow its motion again.
    pub fn release(&mut self, object: usize) {
        if let Some(held) = self.held.get_mut(object) {
            *held = None;
            self.history.clear_scene();
        }
    }

    /// Whether an object is held by hand.
    pub fn is_held(&self, object: usize) -> bool {
        self.held.get(object).is_some_and(Option::is_some)
    }

    /// Where the objects are to stand now, which may be ahead of what was computed.
    pub fn poses(&self) -> Vec<Pose> {
        let Some(open) = &self.open else { return Vec::new() };
        let time_s = self.transport.time_s();
        let objects = open.scene.objects.iter().enumerate();
        objects
            .map(|(index, object)| {
                self.held.get(index).copied().flatten().unwrap_or_else(|| object.motion.pose_at(time_s))
            })
            .collect()
    }

    /// Lets time go on, takes what the worker has, and asks for what is missing.
    pub fn update(&mut self, by: Duration) {
        for news in self.worker.news() {
            match news {
                News::Loaded(loaded) => self.loaded(*loaded),
                News::Frame(computed) => self.computed(computed),
                News::Bars(bars) => self.bars = bars.map_or(Bars::TooLarge, Bars::Known),
                News::Failed { scene, message } => self.failed(scene, message),
            }
        }
        if let Some(view) = self.worker.view() {
            self.view = Some(view);
        }
        self.transport.advance(by);
        self.ask();
    }

    fn loaded(&mut self, loaded: LoadedScene) {
        let LoadedScene { number, scene, base, mesh, renderer, device } = loaded;
        // A newer change is on its way: what comes back is of no use any more.
        let Some(pending) = self.pending.take_if(|pending| pending.number == number) else { return };
        let Pending { document, can_undo, removed, .. } = pending;
        for object in removed {
            if object < self.held.len() {
                self.held.remove(object);
            }
            self.selected = None;
        }
        if can_undo {
            self.undo.push(std::mem::replace(&mut self.document, document));
            self.is_changed = true;
            if self.undo.len() > MOST_UNDO {
                self.undo.remove(0);
            }
        } else {
            self.document = document;
        }
        let warning = |text: &String| Message { text: text.clone(), severity: Severity::Warning };
        self.message = scene.warnings.first().map(warning);
        self.history.begin(&scene.electrodes, &base, scene.measurement.as_ref());
        self.transport.set_length(scene.frames, scene.frame_rate);
        self.held.resize(scene.objects.len(), None);
        self.selected = self.selected.filter(|&object| object < scene.objects.len());
        self.bars = Bars::Unknown;
        self.open = Some(OpenScene { number, scene, base, mesh, renderer, device });
    }

    fn computed(&mut self, computed: Box<Computed>) {
        if self.open.as_ref().is_none_or(|open| open.number != computed.scene) {
            return;
        }
        self.message.take_if(|message| message.severity == Severity::FrameError);
        self.bars = Bars::Unknown;
        self.history.push(&computed, self.begun.elapsed().as_secs_f64());
        self.last = Some(computed);
    }

    fn failed(&mut self, scene: u64, text: String) {
        let is_scene = self.pending.take_if(|pending| pending.number == scene).is_some();
        if is_scene {
            // What was there before is still open; its frames can be asked for again.
            self.asked = None;
        }
        let severity = if is_scene { Severity::Error } else { Severity::FrameError };
        self.message = Some(Message { text, severity });
    }

    fn ask(&mut self) {
        let Some(open) = &self.open else { return };
        if self.pending.is_some() {
            return;
        }
        let wanted = (open.number, self.transport.frame(), self.held.clone());
        if self.asked.as_ref() != Some(&wanted) {
            let (scene, frame, held) = wanted.clone();
            self.worker.compute(FrameRequest { scene, frames: frame..frame + 1, held });
            self.asked = Some(wanted);
        }
    }

    /// Computes frames up to one that is excluded, all of them, and shows the last.
    pub fn run(&mut self, frames: std::ops::Range<usize>) {
        let Some(open) = &self.open else { return };
        if frames.is_empty() {
            return;
        }
        self.transport.is_playing = false;
        self.transport.seek(frames.end - 1);
        self.asked = Some((open.number, self.transport.frame(), self.held.clone()));
        self.worker.compute(FrameRequest { scene: open.number, frames, held: self.held.clone() });
    }

    /// Asks for error bars of what was computed last.
    pub fn tell_bars(&self) {
        self.worker.tell_bars();
    }

    /// What the worker does.
    pub fn activity(&self) -> Activity {
        self.worker.activity()
    }

    /// Whether the scene that was sent last is open.
    pub fn is_open(&self) -> bool {
        self.pending.is_none() && self.open.is_some()
    }

    /// Whether all that was asked for is there.
    pub fn is_settled(&self) -> bool {
        self.pending.is_none() && self.worker.activity() == Activity::Idle && self.open.is_some()
    }

    /// Requests that newer ones took the place of.
    pub fn superseded(&self) -> u64 {
        self.worker.superseded()
    }

    /// The name of the scene, short.
    pub fn title(&self) -> String {
        match &self.path {
            Some(path) => {
                path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
            }
            None => "built-in scene".to_owned(),
        }
    }
}
