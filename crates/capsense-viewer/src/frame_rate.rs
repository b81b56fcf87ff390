//! How many frames a second the window holds while a scene plays, and where their time goes.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Frames that are not counted: pipelines are compiled, layout settles.
const WARM_UP: usize = 30;

/// What is to be measured.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// For how long frames are counted.
    pub length: Duration,
    /// Width and height of the window in points.
    pub size: [u32; 2],
    /// When the program was started.
    pub started: Instant,
}

/// What was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// What draws the window.
    pub adapter: String,
    /// Width and height of the window in pixels.
    pub size: [u32; 2],
    /// Elements of the scene's mesh.
    pub tets: usize,
    /// Seconds from the start of the program to the first frame that shows the scene.
    pub first_s: f64,
    /// Frames that were counted, and the seconds from the first to the last.
    pub frames: usize,
    /// See `frames`.
    pub seconds: f64,
    /// Milliseconds from one frame to the next, in rising order.
    pub intervals: Vec<f64>,
    /// Milliseconds of a frame in which panels and the 3D view's shapes were made, median.
    pub shapes: f64,
    /// Milliseconds of a frame in which shapes were cut into triangles and sent to the driver, median.
    pub painting: f64,
    /// Processor time of all threads in a frame, the driver's and the simulation's too, mean, in milliseconds; where the
    /// system tells it.
    pub processor: Option<f64>,
    /// Frames of the scene that were computed meanwhile, and milliseconds of each, median.
    pub computed: usize,
    /// See `computed`.
    pub computing: f64,
}

impl Report {
    /// Frames of the window in a second.
    pub fn frames_per_second(&self) -> f64 {
        if self.seconds > 0.0 { self.frames as f64 / self.seconds } else { 0.0 }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        let at = |part: f64| quantile(&self.intervals, part);
        writeln!(out, "{width} x {height} pixels, {} tets, drawn by {}", self.tets, self.adapter)?;
        writeln!(
            out,
            "{:.1} frames/s; from one to the next {:.1} ms in the median, {:.1} ms at most in 95 of 100",
            self.frames_per_second(),
            at(0.5),
            at(0.95)
        )?;
        let waiting = (at(0.5) - self.shapes - self.painting).max(0.0);
        write!(
            out,
            "of these: {:.1} ms shapes, {:.1} ms triangles, {waiting:.1} ms driver and display",
            self.shapes, self.painting
        )?;
        match self.processor {
            Some(processor) => writeln!(out, "; processor time {processor:.1} ms")?,
            None => writeln!(out)?,
        }
        writeln!(
            out,
            "computed meanwhile: {:.1} frames/s of the scene, {:.1} ms each",
            self.computed as f64 / self.seconds.max(1e-9),
            self.computing
        )?;
        write!(out, "the scene was there {:.2} s after the start", self.first_s)
    }
}

/// The value that a part of all values, which are in rising order, do not exceed; 0 when there are none.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    let place = (sorted.len().saturating_sub(1)) as f64 * part;
    sorted.get(place.round() as usize).copied().unwrap_or(0.0)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}

/// Processor time of all threads of this program so far, in seconds, to 10 ms; where the system tells it (Linux).
pub fn processor_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // User and system time, in hundredths of a second, are the 12th and 13th field after the program's name.
    let mut fields = stat.rsplit(')').next()?.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some(0.01 * (ticks()? + ticks()?))
}

/// Where a report is left for who opened the window.
pub type ReportSlot = Arc<Mutex<Option<Report>>>;

/// One frame of the window.
#[derive(Clone, Copy, Debug)]
pub struct WindowFrame {
    /// When it began.
    pub began: Instant,
    /// How long its shapes took.
    pub shapes: Duration,
    /// How long the frame before took in all without waiting for the driver, seconds, if that is known.
    pub before_s: Option<f32>,
}

/// Counts frames.
#[derive(Debug)]
pub struct FrameRate {
    request: Request,
    /// When the first frame began.
    first: Option<Instant>,
    processor_before: Option<f64>,
    skipped: usize,
    /// Frames that were computed before the first that is counted.
    computed_before: usize,
    frames: Vec<WindowFrame>,
    slot: ReportSlot,
}

impl FrameRate {
    /// Begins once frames are noted, and leaves its report in `slot`.
    pub fn new(request: Request, slot: ReportSlot) -> Self {
        Self {
            request,
            first: None,
            processor_before: None,
            skipped: 0,
            computed_before: 0,
            frames: Vec::new(),
            slot,
        }
    }

    /// Takes a frame, and how many of the scene were computed so far. Returns whether that is all.
    pub fn note(&mut self, frame: WindowFrame, computed: usize) -> bool {
        self.first.get_or_insert(frame.began);
        if self.skipped < WARM_UP {
            self.skipped += 1;
            self.computed_before = computed;
            self.processor_before = processor_s();
            return false;
        }
        self.frames.push(frame);
        frame.began - self.frames[0].began >= self.request.length
    }

    /// How many of `computed` frames are of the time that is measured.
    pub fn computed_since(&self, computed: usize) -> usize {
        computed - self.computed_before.min(computed)
    }

    /// Leaves the report; of `report` what is known without frames is kept.
    pub fn finish(&self, report: Report) {
        let pairs = || self.frames.windows(2).map(|pair| (pair[0], pair[1]));
        let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
        let mut intervals: Vec<f64> = pairs().map(|(from, to)| milliseconds(to.began - from.began)).collect();
        intervals.sort_by(f64::total_cmp);
        let painting = pairs().filter_map(|(frame, next)| {
            Some((f64::from(next.before_s?) * 1e3 - milliseconds(frame.shapes)).max(0.0))
        });
        let processor = self.processor_before.zip(processor_s());
        let report = Report {
            first_s: self.first.map_or(0.0, |first| (first - self.request.started).as_secs_f64()),
            processor: processor.map(|(before, now)| (now - before) * 1e3 / intervals.len().max(1) as f64),
            frames: intervals.len(),
            seconds: intervals.iter().sum::<f64>() * 1e-3,
            shapes: median(self.frames.iter().map(|frame| milliseconds(frame.shapes)).collect()),
            painting: median(painting.collect()),
            intervals,
            ..report
        };
        *self.slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(report);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_counted_after_some_and_until_the_time_is_over() {
        let slot = ReportSlot::default();
        let begun = Instant::now();
        let started = begun - Duration::from_millis(750);
        let request = Request { length: Duration::from_secs(2), size: [800, 600], started };
        let mut rate = FrameRate::new(request, slot.clone());
        let mut noted = 0;
        loop {
            let frame = WindowFrame {
                began: begun + Duration::from_millis(20 * noted),
                shapes: Duration::from_millis(3),
                before_s: Some(5e-3),
            };
            noted += 1;
            if rate.note(frame, 2 * noted as usize) {
                break;
            }
        }
        assert_eq!(noted, 30 + 101, "both ends of two seconds count");
        assert_eq!(rate.computed_since(2 * noted as usize), 2 * 101);
        rate.finish(Report { tets: 7, computed: 202, ..Report::default() });
        let report = slot.lock().unwrap().take().unwrap();
        assert_eq!((report.frames, report.tets), (100, 7));
        assert!((report.frames_per_second() - 50.0).abs() < 1e-9, "{report:?}");
        assert!((report.shapes - 3.0).abs() < 1e-6 && (report.painting - 2.0).abs() < 1e-3, "{report:?}");
        let text = report.to_string();
        assert!(text.contains("50.0 frames/s; from one to the next 20.0 ms"), "{text}");
        assert!(text.contains("3.0 ms shapes, 2.0 ms triangles, 15.0 ms driver"), "{text}");
        assert!(text.contains("101.0 frames/s of the scene"), "{text}");
        assert!(text.ends_with("0.75 s after the start"), "{text}");
    }

    #[test]
    fn processor_time_is_that_of_all_threads() {
        // Systems other than Linux tell none.
        let Some(before) = processor_s() else { return };
        let work = || {
            let begun = Instant::now();
            let mut sum = 0u64;
            while begun.elapsed() < Duration::from_millis(120) {
                sum = std::hint::black_box(sum.wrapping_mul(31) + 7);
            }
        };
        std::thread::scope(|scope| drop([scope.spawn(work), scope.spawn(work)]));
        assert!(processor_s().unwrap() > before);
    }

    #[test]
    fn a_window_that_was_closed_at_once_has_no_rate() {
        let slot = ReportSlot::default();
        let request = Request { length: Duration::ZERO, size: [1, 1], started: Instant::now() };
        let rate = FrameRate::new(request, slot.clone());
        rate.finish(Report::default());
        let report = slot.lock().unwrap().take().unwrap();
        assert_eq!(report.frames_per_second(), 0.0);
        assert!(!report.to_string().contains("NaN"), "{report}");
    }
}
