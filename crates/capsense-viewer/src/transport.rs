//! Playing a scene's trajectories: which frame is to be shown at which moment.

use std::time::Duration;

/// The longest step of time that is followed; a window that stood still for longer goes on where it was.
const LONGEST_STEP_S: f64 = 0.25;

/// Where playing is, and how fast.
#[derive(Clone, Debug, PartialEq)]
pub struct Transport {
    /// Whether time goes on.
    pub is_playing: bool,
    /// Scene seconds per second.
    pub speed: f64,
    /// Whether it begins again at the end.
    pub repeats: bool,
    frames: usize,
    frame_rate: f64,
    /// In frames, not rounded.
    position: f64,
}

impl Default for Transport {
    fn default() -> Self {
        Self { is_playing: false, speed: 1.0, repeats: true, frames: 1, frame_rate: 100.0, position: 0.0 }
    }
}

impl Transport {
    /// Takes over how long a scene is; the position stays where it still is in the scene.
    pub fn set_length(&mut self, frames: usize, frame_rate: f64) {
        (self.frames, self.frame_rate) = (frames.max(1), frame_rate);
        if self.frame() >= self.frames {
            self.position = 0.0;
        }
        self.is_playing &= self.frames > 1;
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// The frame that is to be shown.
    pub fn frame(&self) -> usize {
        self.position as usize
    }

    /// Time of that frame in seconds.
    pub fn time_s(&self) -> f64 {
        self.frame() as f64 / self.frame_rate
    }

    /// Time of the last frame in seconds.
    pub fn end_s(&self) -> f64 {
        (self.frames - 1) as f64 / self.frame_rate
    }

    /// Goes to a frame, or the last.
    pub fn seek(&mut self, frame: usize) {
        self.position = frame.min(self.frames - 1) as f64;
    }

    /// Goes on by some frames, or back, and stops playing.
    pub fn step(&mut self, frames: isize) {
        self.is_playing = false;
        self.seek(self.frame().saturating_add_signed(frames));
    }

    /// Plays, from the beginning if it is at the end, or pauses.
    pub fn toggle(&mut self) {
        self.is_playing = !self.is_playing && self.frames > 1;
        if self.is_playing && self.frame() + 1 >= self.frames {
            self.position = 0.0;
        }
    }

    /// Lets time go on.
    pub fn advance(&mut self, by: Duration) {
        if !self.is_playing {
            return;
        }
        let last = (self.frames - 1) as f64;
        self.position += by.as_secs_f64().min(LONGEST_STEP_S) * self.speed * self.frame_rate;
        if self.position >= last + 1.0 {
            if self.repeats {
                self.position = 0.0;
            } else {
                self.position = last;
                self.is_playing = false;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transport() -> Transport {
        let mut transport = Transport::default();
        transport.set_length(11, 100.0);
        transport
    }

    #[test]
    fn time_goes_on_at_the_speed_and_ends_or_begins_again() {
        let mut transport = transport();
        transport.repeats = false;
        transport.toggle();
        transport.advance(Duration::from_millis(50));
        assert_eq!(transport.frame(), 5);
        transport.speed = 0.5;
        transport.advance(Duration::from_millis(40));
        assert_eq!((transport.frame(), transport.time_s()), (7, 0.07));
        transport.advance(Duration::from_millis(200));
        assert_eq!((transport.frame(), transport.is_playing), (10, false));
        transport.repeats = true;
        transport.toggle();
        assert_eq!(transport.frame(), 0, "it begins again from the end");
        transport.advance(Duration::from_millis(250));
        assert_eq!((transport.frame(), transport.is_playing), (0, true));
    }

    #[test]
    fn a_window_that_stood_still_does_not_leap() {
        let mut transport = transport();
        transport.set_length(1000, 100.0);
        transport.toggle();
        transport.advance(Duration::from_secs(60));
        assert_eq!(transport.frame(), 25);
    }

    #[test]
    fn steps_stay_in_the_scene() {
        let mut transport = transport();
        transport.step(-1);
        assert_eq!(transport.frame(), 0);
        transport.step(100);
        assert_eq!((transport.frame(), transport.end_s()), (10, 0.1));
        transport.set_length(5, 100.0);
        assert_eq!(transport.frame(), 0);
        transport.set_length(1, 100.0);
        transport.toggle();
        assert!(!transport.is_playing, "one frame cannot be played");
    }
}
