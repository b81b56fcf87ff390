//! The thread that owns the pipeline: the window asks, never waits, and the latest request wins.
//!
//! There is one slot for each kind of request; a newer one takes the place of one that has not begun. Results wait in a
//! list of bounded length. A scene that fails leaves the one before in force. Dropping the [`Worker`] does not wait for what
//! is being computed: the thread ends after it.

use crate::scene3d::{Frame3d, Frame3dBuilder};
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::estimate::ErrorBars;
use capsense::core::geometry::Pose;
use capsense::core::measurement::{Measurement, Reading};
use capsense::core::occupancy::Contact;
use capsense::core::sensor::Sensor;
use capsense::run_folder::MeshSize;
use capsense::scene::SceneSensor;
use capsense::{ErrorEstimator, Frame, Pipeline, PipelineError, Scene};
use std::collections::VecDeque;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Results that nobody takes are forgotten beyond so many, the oldest first.
const MOST_NEWS: usize = 20_000;

/// A scene as a file would have it.
#[derive(Clone, Debug)]
pub struct SceneText {
    /// What messages call it.
    pub name: String,
    /// The TOML.
    pub text: String,
    /// What paths in it are relative to.
    pub folder: PathBuf,
}

/// Frames to be computed.
#[derive(Clone, Debug)]
pub struct FrameRequest {
    /// Number of the scene that is meant, as given to [`Worker::load`]; others are not computed.
    pub scene: u64,
    /// Numbers of the frames, in this order.
    pub frames: Range<usize>,
    /// Poses of objects that do not follow their motion.
    pub held: Vec<Option<Pose>>,
}

/// What became of a scene.
#[derive(Debug)]
pub struct LoadedScene {
    /// The number under which it was sent.
    pub number: u64,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Capacitances without objects.
    pub base: CapacitanceMatrix,
    /// Size of its mesh.
    pub mesh: MeshSize,
    /// What draws its objects.
    pub renderer: String,
    /// What computes the fields: `CPU`, or the name of a graphics adapter.
    pub device: String,
}

/// A frame and what it was asked for.
#[derive(Clone, Debug)]
pub struct Computed {
    /// Number of its scene.
    pub scene: u64,
    /// Capacitances and costs.
    pub frame: Frame,
    /// Where the objects stood.
    pub poses: Vec<Pose>,
    /// Conductors that touch electrodes.
    pub contacts: Vec<Contact>,
    /// What the scene's converters read, channel by channel, if it has any.
    pub readings: Vec<Reading>,
}

/// What the worker has to say.
#[derive(Debug)]
pub enum News {
    /// A scene is ready.
    Loaded(Box<LoadedScene>),
    /// A frame is there.
    Frame(Box<Computed>),
    /// Error bars of the frame before; `None` where the mesh is too large for them.
    Bars(Box<Option<ErrorBars>>),
    /// A scene of this number, or a frame of it, failed. What was there before stays.
    Failed {
        /// Number of the scene.
        scene: u64,
        /// Why.
        message: String,
    },
}

/// What the worker does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Activity {
    /// It waits.
    Idle = 0,
    /// It reads a scene and makes its mesh.
    Loading = 1,
    /// It computes frames.
    Solving = 2,
    /// It tells error bars.
    Bars = 3,
}

#[derive(Default)]
struct Inbox {
    scene: Option<(u64, SceneText)>,
    frames: Option<FrameRequest>,
    bars: bool,
    quit: bool,
}

#[derive(Default)]
struct Outbox {
    news: VecDeque<News>,
    view: Option<Frame3d>,
}

#[derive(Default)]
struct Shared {
    inbox: Mutex<Inbox>,
    bell: Condvar,
    outbox: Mutex<Outbox>,
    activity: AtomicU8,
    superseded: AtomicU64,
}

/// Never poisoned for long: nothing that can panic happens while one is held.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The window's end.
pub struct Worker {
    shared: Arc<Shared>,
}

impl Worker {
    /// Starts the thread; `wake` is called whenever there is something new.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::<Shared>::default();
        let desk = Desk {
            shared: shared.clone(),
            wake: Box::new(wake),
            open: None,
            sensor: None,
            last: None,
            estimator: None,
        };
        std::thread::Builder::new().name("simulator".to_owned()).spawn(move || desk.work())?;
        Ok(Self { shared })
    }

    /// Asks for a scene. What was asked of an earlier one is forgotten.
    pub fn load(&self, number: u64, scene: SceneText) {
        self.ask(|inbox| {
            inbox.frames = None;
            inbox.bars = false;
            inbox.scene.replace((number, scene)).is_some()
        });
    }

    /// Asks for frames, in place of those that were asked for and not yet computed.
    pub fn compute(&self, request: FrameRequest) {
        self.ask(|inbox| {
            inbox.bars = false;
            inbox.frames.replace(request).is_some()
        });
    }

    /// Asks for error bars of the last frame; a request for frames takes precedence.
    pub fn tell_bars(&self) {
        self.ask(|inbox| std::mem::replace(&mut inbox.bars, true));
    }

    fn ask(&self, put: impl FnOnce(&mut Inbox) -> bool) {
        if put(&mut lock(&self.shared.inbox)) {
            self.shared.superseded.fetch_add(1, Ordering::Relaxed);
        }
        self.shared.bell.notify_one();
    }

    /// Takes all that is new.
    pub fn news(&self) -> VecDeque<News> {
        std::mem::take(&mut lock(&self.shared.outbox).news)
    }

    /// Takes the latest picture of the scene, if there is a new one.
    pub fn view(&self) -> Option<Frame3d> {
        lock(&self.shared.outbox).view.take()
    }

    /// What it does now. Between a request and its beginning it counts as doing it.
    pub fn activity(&self) -> Activity {
        let inbox = lock(&self.shared.inbox);
        match self.shared.activity.load(Ordering::Relaxed) {
            1 => Activity::Loading,
            _ if inbox.scene.is_some() => Activity::Loading,
            2 => Activity::Solving,
            _ if inbox.frames.is_some() => Activity::Solving,
            3 => Activity::Bars,
            _ if inbox.bars => Activity::Bars,
            _ => Activity::Idle,
        }
    }

    /// Requests that newer ones took the place of.
    pub fn superseded(&self) -> u64 {
        self.shared.superseded.load(Ordering::Relaxed)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        lock(&self.shared.inbox).quit = true;
        self.shared.bell.notify_one();
    }
}

/// What there is to do next.
enum Work {
    Load(u64, SceneText),
    Frames(FrameRequest),
    Bars,
}

/// A scene that is ready to run.
struct Open {
    number: u64,
    scene: Arc<Scene>,
    pipeline: Pipeline,
    pictures: Frame3dBuilder,
    /// The scene's converters. Each computed frame is one scan, in whichever order frames are asked for.
    measurement: Option<Measurement>,
    scans: u64,
}

impl Open {
    fn read(&mut self, capacitance: &CapacitanceMatrix) -> Vec<Reading> {
        let time_s = self.scans as f64 / self.scene.frame_rate;
        self.scans += 1;
        let measurement = self.measurement.as_mut();
        measurement.map_or_else(Vec::new, |measurement| measurement.measure(time_s, capacitance).to_vec())
    }
}

/// The thread's end.
struct Desk {
    shared: Arc<Shared>,
    wake: Box<dyn Fn() + Send>,
    open: Option<Open>,
    /// The last sensor that was meshed, and what for: to choose a mesh may take a minute, and most changes keep it.
    sensor: Option<(String, Sensor)>,
    last: Option<Frame>,
    estimator: Option<Option<ErrorEstimator>>,
}

impl Desk {
    fn work(mut self) {
        while let Some((work, activity)) = self.next() {
            let scene = match &work {
                Work::Load(number, _) => *number,
                Work::Frames(_) | Work::Bars => self.open.as_ref().map_or(0, |open| open.number),
            };
            let done = catch_unwind(AssertUnwindSafe(|| match work {
                Work::Load(number, text) => self.load(number, &text),
                Work::Frames(request) => self.compute(&request),
                Work::Bars => self.tell_bars(),
            }));
            match done {
                Ok(Ok(())) => {}
                Ok(Err(error)) => self.tell(News::Failed { scene, message: error.to_string() }),
                Err(_) => {
                    // What a broken computation left behind is not to be trusted; a scene that broke while it was read
                    // has not yet replaced the one before.
                    if activity != Activity::Loading {
                        self.open = None;
                    }
                    self.estimator = None;
                    let message = "the computation broke off; open the scene again".to_owned();
                    self.tell(News::Failed { scene, message });
                }
            }
            self.shared.activity.store(Activity::Idle as u8, Ordering::Relaxed);
            (self.wake)();
        }
    }

    /// Waits for something to do; `None` when the window is gone.
    fn next(&self) -> Option<(Work, Activity)> {
        let mut inbox = lock(&self.shared.inbox);
        loop {
            if inbox.quit {
                return None;
            }
            let (work, activity) = if let Some((number, scene)) = inbox.scene.take() {
                (Work::Load(number, scene), Activity::Loading)
            } else if let Some(request) = inbox.frames.take() {
                (Work::Frames(request), Activity::Solving)
            } else if std::mem::take(&mut inbox.bars) {
                (Work::Bars, Activity::Bars)
            } else {
                inbox = self.shared.bell.wait(inbox).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            self.shared.activity.store(activity as u8, Ordering::Relaxed);
            return Some((work, activity));
        }
    }

    fn is_interrupted(&self) -> bool {
        let inbox = lock(&self.shared.inbox);
        inbox.quit || inbox.scene.is_some() || inbox.frames.is_some()
    }

    fn tell(&self, news: News) {
        let mut outbox = lock(&self.shared.outbox);
        if outbox.news.len() >= MOST_NEWS {
            outbox.news.pop_front();
        }
        outbox.news.push_back(news);
    }

    fn load(&mut self, number: u64, text: &SceneText) -> Result<(), PipelineError> {
        let scene = Scene::parse(&text.name, &text.text, &text.folder)?;
        let sensor = self.sensor(&scene)?;
        let pipeline = Pipeline::with_sensor(&scene, sensor)?;
        let measurement = scene.measurement(pipeline.simulator().base())?;
        let scene = Arc::new(scene);
        self.estimator = None;
        self.last = None;
        self.tell(News::Loaded(Box::new(LoadedScene {
            number,
            scene: scene.clone(),
            base: pipeline.simulator().base().clone(),
            mesh: MeshSize::of(pipeline.simulator().sensor().mesh()),
            renderer: pipeline.renderer().to_owned(),
            device: pipeline.device(),
        })));
        let pictures = Frame3dBuilder::new(&scene, &pipeline);
        self.open = Some(Open { number, scene, pipeline, pictures, measurement, scans: 0 });
        Ok(())
    }

    fn sensor(&mut self, scene: &Scene) -> Result<Sensor, PipelineError> {
        let SceneSensor::Generated { design, mesh } = &scene.sensor else { return Ok(scene.build_sensor()?) };
        let wanted = format!("{design:?} {mesh:?}");
        if let Some((of, sensor)) = &self.sensor
            && *of == wanted
        {
            return Ok(sensor.clone());
        }
        let sensor = scene.build_sensor()?;
        self.sensor = Some((wanted, sensor.clone()));
        Ok(sensor)
    }

    fn compute(&mut self, request: &FrameRequest) -> Result<(), PipelineError> {
        let mut result = Ok(());
        let mut is_drawn = true;
        for index in request.frames.clone() {
            let Some(open) = self.open.as_mut().filter(|open| open.number == request.scene) else { break };
            match open.pipeline.frame_holding(index, &request.held) {
                Ok(frame) => is_drawn = self.publish(frame),
                Err(error) => {
                    result = Err(error);
                    break;
                }
            }
            if self.is_interrupted() {
                break;
            }
        }
        // The last frame is surely shown.
        if !is_drawn {
            self.publish_view();
        }
        result
    }

    /// Tells of a frame, and makes a picture of it if the window has taken the one before. Returns whether it did.
    fn publish(&mut self, frame: Frame) -> bool {
        let Some(open) = &mut self.open else { return false };
        let readings = open.read(&frame.capacitance);
        self.last = Some(frame.clone());
        let computed = Computed {
            scene: open.number,
            frame,
            poses: open.pipeline.poses().to_vec(),
            contacts: open.pipeline.simulator().contacts().to_vec(),
            readings,
        };
        self.tell(News::Frame(Box::new(computed)));
        let is_taken = lock(&self.shared.outbox).view.is_none();
        if is_taken {
            self.publish_view();
        }
        (self.wake)();
        is_taken
    }

    fn publish_view(&mut self) {
        let Some(open) = &mut self.open else { return };
        // What cannot be drawn is told by the next frame.
        let _ = open.pipeline.look();
        let view = open.pictures.snapshot(&open.pipeline);
        lock(&self.shared.outbox).view = Some(view);
    }

    fn tell_bars(&mut self) -> Result<(), PipelineError> {
        let (Some(open), Some(last)) = (&mut self.open, &self.last) else { return Ok(()) };
        if self.estimator.is_none() {
            self.estimator = Some(ErrorEstimator::new(&open.scene, &open.pipeline)?);
        }
        let bars = match &mut self.estimator {
            Some(Some(estimator)) => Some(estimator.estimate(&mut open.pipeline, last)?),
            _ => None,
        };
        self.tell(News::Bars(Box::new(bars)));
        Ok(())
    }
}
