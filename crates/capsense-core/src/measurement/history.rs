//! What channels saw in the last scans, for conversions that lag behind.

/// A ring of scans.
#[derive(Clone, Debug)]
pub(super) struct History {
    channels: usize,
    times: Vec<f64>,
    /// Scan by scan.
    values: Vec<f64>,
    /// Number of scans that are kept, and where the newest is.
    kept: usize,
    newest: usize,
}

impl History {
    /// Room for as many scans as conversions lag behind.
    pub(super) fn new(channels: usize, lag_in_scans: f64) -> Self {
        let scans = lag_in_scans.ceil() as usize + 2;
        Self {
            channels,
            times: vec![0.0; scans],
            values: vec![0.0; scans * channels],
            kept: 0,
            newest: scans - 1,
        }
    }

    pub(super) fn push(&mut self, time: f64, values: impl Iterator<Item = f64>) {
        let scans = self.times.len();
        self.newest = (self.newest + 1) % scans;
        self.kept = (self.kept + 1).min(scans);
        self.times[self.newest] = time;
        let place = &mut self.values[self.newest * self.channels..][..self.channels];
        place.iter_mut().zip(values).for_each(|(place, value)| *place = value);
    }

    pub(super) fn clear(&mut self) {
        self.kept = 0;
    }

    /// A channel's value at a time, linear between scans; before the first scan it was as in the first.
    pub(super) fn value(&self, channel: usize, time: f64) -> f64 {
        let mut after = self.newest;
        let at = |scan: usize| self.values[scan * self.channels + channel];
        for _ in 1..self.kept {
            if time >= self.times[after] {
                break;
            }
            let before = (after + self.times.len() - 1) % self.times.len();
            if time >= self.times[before] {
                let part = (time - self.times[before]) / (self.times[after] - self.times[before]);
                return at(before) + part * (at(after) - at(before));
            }
            after = before;
        }
        at(after)
    }
}
