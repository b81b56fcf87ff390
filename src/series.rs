//! Curves over time and how alike two of them are: on a common time axis, as Pearson's r, as the correlation that the CapSense paper
//! reports (Eq. 12), at the best lag, and beside what curves score that know nothing.
//!
//! Everything here is a pure function of numbers. A correlation that is not defined, because a curve does not move, is `None`,
//! never NaN.

use std::cmp::Ordering;

/// Lags are searched on at most so many samples: the search costs a quarter of their square.
const LAG_SAMPLES: usize = 2000;

/// Lags up to this part of the common span are tried, so that at least three quarters of it are compared.
const LONGEST_LAG: f64 = 0.25;

/// Why samples are no curve, or two curves cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SeriesError {
    /// Not as many times as values.
    #[error("{times} times for {values} values")]
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of values.
        values: usize,
    },
    /// Fewer than two samples.
    #[error("{0} samples are no curve; at least 2 are needed")]
    TooShort(usize),
    /// A time or value is not finite.
    #[error("sample {0} is not finite")]
    NotFinite(usize),
    /// Time stands still or runs backwards.
    #[error("time {time} of sample {index} is not later than the one before")]
    NotLater {
        /// Index of the sample.
        index: usize,
        /// Its time.
        time: f64,
    },
    /// There is no time at which both curves are known.
    #[error("one is known from {} to {}, the other from {} to {}: at no time both are", one.0, one.1, other.0, other.1)]
    Apart {
        /// First and last time of one curve.
        one: (f64, f64),
        /// Those of the other.
        other: (f64, f64),
    },
}

/// Values over strictly increasing time, linear in between. Units are the caller's: seconds or sample numbers, farads or counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Curve {
    /// Takes samples.
    ///
    /// # Errors
    /// When there are fewer than two, their numbers differ, one is not finite, or time does not increase.
    pub fn new(times: Vec<f64>, values: Vec<f64>) -> Result<Self, SeriesError> {
        if times.len() != values.len() {
            return Err(SeriesError::Lengths { times: times.len(), values: values.len() });
        }
        if times.len() < 2 {
            return Err(SeriesError::TooShort(times.len()));
        }
        let finite = |(time, value): (&f64, &f64)| time.is_finite() && value.is_finite();
        if let Some(index) = times.iter().zip(&values).position(|sample| !finite(sample)) {
            return Err(SeriesError::NotFinite(index));
        }
        match times.windows(2).position(|pair| pair[0] >= pair[1]) {
            Some(before) => Err(SeriesError::NotLater { index: before + 1, time: times[before + 1] }),
            None => Ok(Self { times, values }),
        }
    }

    /// Takes values at the times 0, 1, 2 and so on.
    ///
    /// # Errors
    /// When there are fewer than two, or one is not finite.
    pub fn counted(values: Vec<f64>) -> Result<Self, SeriesError> {
        Self::new((0..values.len()).map(|index| index as f64).collect(), values)
    }

    /// Times of the samples.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Values of the samples.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// First and last time.
    pub fn span(&self) -> (f64, f64) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// The same curve over another time: `scale` times as long, from `start` on.
    ///
    /// # Errors
    /// When `start` is not finite, or `scale` is not, or not above zero, or so extreme that times fall together.
    pub fn retimed(&self, scale: f64, start: f64) -> Result<Self, SeriesError> {
        let first = self.times[0];
        let times = self.times.iter().map(|time| start + scale * (time - first)).collect();
        Self::new(times, self.values.clone())
    }

    /// The value at a time, linear between samples; the first value before the first sample, the last after the last.
    pub fn at(&self, time: f64) -> f64 {
        let next = self.times.partition_point(|t| *t <= time);
        match (next, self.times.get(next)) {
            (0, _) => self.values[0],
            (_, None) => self.values[next - 1],
            (_, Some(after)) => {
                let before = self.times[next - 1];
                let part = (time - before) / (after - before);
                self.values[next - 1] + part * (self.values[next] - self.values[next - 1])
            }
        }
    }

    /// The values at times.
    pub fn resampled(&self, times: &[f64]) -> Vec<f64> {
        times.iter().map(|time| self.at(*time)).collect()
    }

    /// The median of the times between samples.
    pub fn step(&self) -> f64 {
        let mut steps: Vec<f64> = self.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps[steps.len() / 2]
    }
}

/// Equally spaced times over all of the span in which both curves are known, nearly as far apart as the samples of the
/// curve that has fewer: what is between the samples of one is not compared with noise of the other.
///
/// # Errors
/// When there is no such span.
pub fn common_axis(one: &Curve, other: &Curve) -> Result<Vec<f64>, SeriesError> {
    axis(one, other, usize::MAX)
}

fn axis(one: &Curve, other: &Curve, most: usize) -> Result<Vec<f64>, SeriesError> {
    let (a, b) = (one.span(), other.span());
    let (start, end) = (a.0.max(b.0), a.1.min(b.1));
    if start >= end {
        return Err(SeriesError::Apart { one: a, other: b });
    }
    let step = one.step().max(other.step()).min(end - start);
    // Not more samples than both curves have together, should most of a curve's samples lie close to each other.
    let most = most.min(one.times.len() + other.times.len());
    let intervals = (((end - start) / step).round() as usize).clamp(1, most.max(2) - 1);
    let time = |index: usize| start + (end - start) * (index as f64 / intervals as f64);
    Ok((0..=intervals).map(time).collect())
}

/// Pearson's correlation coefficient; `None` where one of the two does not move, or their lengths differ.
pub fn pearson(a: &[f64], b: &[f64]) -> Option<f64> {
    cosine(&deviations(a)?, &deviations(b)?)
}

/// Eq. 12 of the CapSense paper, Σ x y / √(Σ x² Σ y²): a correlation without the removal of means, here of curves that are
/// scaled to run from 0 to 1 each. `None` where one of the two does not move, or their lengths differ.
///
/// What is not constant, and not negative, scores highly, whatever its shape ([`Baselines`]).
pub fn paper_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    cosine(&unit_range(a)?, &unit_range(b)?)
}

/// Values scaled to run from 0 to 1; `None` where they are all the same.
pub fn unit_range(values: &[f64]) -> Option<Vec<f64>> {
    let low = values.iter().copied().reduce(f64::min)?;
    let high = values.iter().copied().reduce(f64::max)?;
    let range = high - low;
    (range > 0.0 && range.is_finite()).then(|| values.iter().map(|value| (value - low) / range).collect())
}

/// Σ x y / √(Σ x² Σ y²) of values of order one.
fn cosine(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.len() != b.len() {
        return None;
    }
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let r = sum(a, b) / (sum(a, a) * sum(b, b)).sqrt();
    r.is_finite().then(|| r.clamp(-1.0, 1.0))
}

/// Deviations from the mean, scaled. Taken from the scaled range, so that rounding of a large mean is no movement.
fn deviations(values: &[f64]) -> Option<Vec<f64>> {
    let scaled = unit_range(values)?;
    let mean = scaled.iter().sum::<f64>() / scaled.len() as f64;
    Some(scaled.iter().map(|value| value - mean).collect())
}

/// By how much one curve runs behind another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// In units of time; positive where the second curve does later what the first does.
    pub time: f64,
    /// Pearson's r at this lag.
    pub pearson: f64,
}

/// The lag at which two curves are most alike, up to a quarter of their common span, to one step of the common axis or, on long
/// curves, to a two-thousandth of the span. Curves that mirror each other are shifted until they do so best. Among equals
/// the shortest. `None` where no correlation is defined.
///
/// # Errors
/// When at no time both curves are known.
pub fn best_lag(first: &Curve, second: &Curve) -> Result<Option<Lag>, SeriesError> {
    let times = axis(first, second, LAG_SAMPLES)?;
    let (a, b) = (first.resampled(&times), second.resampled(&times));
    let step = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let sign = pearson(&a, &b).unwrap_or(1.0).signum();
    let most = (LONGEST_LAG * (times.len() - 1) as f64) as usize;
    let shifted = |steps: usize, behind: bool| {
        let rest = times.len() - steps;
        let r = if behind { pearson(&a[..rest], &b[steps..]) } else { pearson(&a[steps..], &b[..rest]) };
        let time = if behind { steps as f64 } else { -(steps as f64) } * step;
        r.map(|pearson| Lag { time, pearson })
    };
    let lags = (0..=most).flat_map(|steps| [true, false].map(|behind| shifted(steps, behind))).flatten();
    // `max_by` keeps the last of equals.
    let alike = |a: &Lag, b: &Lag| (sign * a.pearson).total_cmp(&(sign * b.pearson)).then(Ordering::Greater);
    Ok(lags.max_by(alike).map(|lag| Lag { time: lag.time + 0.0, ..lag }))
}

/// A curve that rises evenly from 0 to 1 and falls back: what is known of a body that comes and goes, and of nothing else.
pub fn triangle(samples: usize) -> Vec<f64> {
    let last = samples.saturating_sub(1).max(1) as f64;
    (0..samples).map(|index| 1.0 - (2.0 * index as f64 / last - 1.0).abs()).collect()
}

/// What curves that know nothing of a measurement score against it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baselines {
    /// Eq. 12 of a constant; Pearson's r of it is not defined.
    pub constant_paper: f64,
    /// Pearson's r of a triangle, or of its mirror image, whichever is positive; `None` where it is not defined.
    pub triangle_pearson: Option<f64>,
    /// The better Eq. 12 of a triangle and its mirror image.
    pub triangle_paper: f64,
}

impl Baselines {
    /// Scores them; `None` where the measurement does not move.
    pub fn of(measured: &[f64]) -> Option<Self> {
        let scaled = unit_range(measured)?;
        let up = triangle(measured.len());
        let down: Vec<f64> = up.iter().map(|value| 1.0 - value).collect();
        let scores = [&up, &down].map(|triangle| cosine(triangle, &scaled).unwrap_or(0.0));
        Some(Self {
            constant_paper: cosine(&vec![1.0; scaled.len()], &scaled)?,
            triangle_pearson: pearson(&up, measured).map(f64::abs),
            triangle_paper: scores[0].max(scores[1]),
        })
    }
}

/// How alike a simulated and a measured curve are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Number of samples on the common axis.
    pub samples: usize,
    /// Pearson's r; `None` where a curve does not move.
    pub pearson: Option<f64>,
    /// Eq. 12 of the paper.
    pub paper: Option<f64>,
    /// By how much the measurement runs behind the simulation.
    pub lag: Option<Lag>,
    /// What the numbers above are worth; `None` where the measurement does not move.
    pub baselines: Option<Baselines>,
}

impl Comparison {
    /// Compares two curves on their common axis.
    ///
    /// # Errors
    /// When at no time both curves are known.
    pub fn new(simulated: &Curve, measured: &Curve) -> Result<Self, SeriesError> {
        let times = common_axis(simulated, measured)?;
        let (a, b) = (simulated.resampled(&times), measured.resampled(&times));
        Ok(Self {
            samples: times.len(),
            pearson: pearson(&a, &b),
            paper: paper_correlation(&a, &b),
            lag: best_lag(simulated, measured)?,
            baselines: Baselines::of(&b),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn wave(count: usize, step: f64, shift: f64) -> Curve {
        let times: Vec<f64> = (0..count).map(|index| index as f64 * step).collect();
        // Two incommensurable periods, so that no other lag fits as well.
        let values =
            times.iter().map(|time| ((time - shift) * 3.0).sin() + 0.6 * ((time - shift) * 7.1).cos());
        Curve::new(times.clone(), values.collect()).unwrap()
    }

    #[test]
    fn pearson_is_that_of_a_worked_example() {
        // Deviations -2, -1, 0, 1, 2 and -3, -1, 1, 0, 3: 13 / √(10 · 20).
        let (a, b) = ([1.0, 2.0, 3.0, 4.0, 5.0], [1.0, 3.0, 5.0, 4.0, 7.0]);
        assert_relative_eq!(pearson(&a, &b).unwrap(), 13.0 / 200.0_f64.sqrt(), max_relative = 1e-14);
    }

    #[test]
    fn gain_and_offset_do_not_matter_even_in_farads() {
        let a = wave(300, 0.01, 0.0);
        let b: Vec<f64> = a.values().iter().map(|value| 3e-12 - 2e-170 * value).collect();
        assert_eq!(pearson(a.values(), &b), None, "far below the rounding of its mean, so no movement");
        let b: Vec<f64> = a.values().iter().map(|value| 2e-190 * value).collect();
        assert_relative_eq!(pearson(a.values(), &b).unwrap(), 1.0, max_relative = 1e-12);
        let b: Vec<f64> = a.values().iter().map(|value| 3e-12 - 4e-15 * value).collect();
        assert_relative_eq!(pearson(a.values(), &b).unwrap(), -1.0, max_relative = 1e-9);
        assert_relative_eq!(paper_correlation(a.values(), a.values()).unwrap(), 1.0, max_relative = 1e-12);
    }

    #[test]
    fn what_is_not_defined_is_none() {
        let a = [1.0, 2.0, 4.0];
        assert_eq!(pearson(&a, &[0.1; 3]), None);
        assert_eq!(pearson(&[0.1; 3], &[0.1; 3]), None);
        assert_eq!(pearson(&a, &[1.0, 2.0]), None);
        assert_eq!(pearson(&[], &[]), None);
        assert_eq!(paper_correlation(&a, &[5.0; 3]), None);
        assert_eq!(paper_correlation(&a, &[1.0, 2.0]), None);
        assert_eq!(Baselines::of(&[3.0; 5]), None);
    }

    #[test]
    fn the_papers_number_is_high_for_what_knows_nothing() {
        // A body that is far for half of the time: min-max scaled, a constant scores √(1/2).
        let measured: Vec<f64> = (0..100).map(|index| f64::from(index % 2)).collect();
        let baselines = Baselines::of(&measured).unwrap();
        assert_relative_eq!(baselines.constant_paper, 0.5_f64.sqrt(), max_relative = 1e-12);
        assert!(baselines.triangle_pearson.unwrap() < 0.02);
        // A triangle against itself, and against its mirror image, is known to be one.
        let up = triangle(101);
        let down: Vec<f64> = up.iter().map(|value| 5.0 - 2.0 * value).collect();
        for measured in [up, down] {
            let baselines = Baselines::of(&measured).unwrap();
            assert_relative_eq!(baselines.triangle_paper, 1.0, max_relative = 1e-12);
            assert_relative_eq!(baselines.triangle_pearson.unwrap(), 1.0, max_relative = 1e-12);
            // ∫x over √∫x²: √3/2.
            assert_relative_eq!(baselines.constant_paper, 0.75_f64.sqrt(), max_relative = 1e-2);
        }
    }

    #[test]
    fn curves_are_linear_between_their_samples() {
        let curve = Curve::new(vec![1.0, 2.0, 4.0], vec![10.0, 20.0, 0.0]).unwrap();
        assert_eq!(
            curve.resampled(&[0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0]),
            [10.0, 10.0, 15.0, 20.0, 10.0, 0.0, 0.0]
        );
        assert_eq!(curve.step(), 2.0);
        let later = curve.retimed(0.5, 7.0).unwrap();
        assert_eq!(later.times(), [7.0, 7.5, 8.5]);
        assert!(curve.retimed(0.0, 0.0).is_err() && curve.retimed(f64::NAN, 0.0).is_err());
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        assert_eq!(Curve::counted(vec![1.0]), Err(SeriesError::TooShort(1)));
        assert_eq!(Curve::counted(vec![1.0, f64::NAN]), Err(SeriesError::NotFinite(1)));
        let stands = Curve::new(vec![0.0, 1.0, 1.0], vec![0.0; 3]);
        assert_eq!(stands, Err(SeriesError::NotLater { index: 2, time: 1.0 }));
        assert_eq!(Curve::new(vec![0.0], vec![]), Err(SeriesError::Lengths { times: 1, values: 0 }));
    }

    #[test]
    fn the_common_axis_is_where_both_are_known_and_as_coarse_as_the_coarser() {
        let fine = wave(501, 0.01, 0.0);
        let coarse = wave(41, 0.1, 0.0).retimed(1.0, 2.0).unwrap();
        let axis = common_axis(&fine, &coarse).unwrap();
        assert_eq!(axis.len(), 31, "2 s to 5 s by 0.1 s");
        assert_relative_eq!(axis[0], 2.0);
        assert_relative_eq!(axis[30], 5.0);
        let apart = wave(11, 0.1, 0.0).retimed(1.0, 6.0).unwrap();
        assert!(matches!(common_axis(&fine, &apart), Err(SeriesError::Apart { .. })));
    }

    #[test]
    fn lags_are_found_in_either_direction_and_for_mirrored_curves() {
        let first = wave(400, 0.01, 0.0);
        for shift in [-0.31, 0.0, 0.17] {
            let second = wave(400, 0.01, shift);
            let mirrored = Curve::new(second.times().to_vec(), second.values().iter().map(|v| -v).collect());
            for (curve, sign) in [(second, 1.0), (mirrored.unwrap(), -1.0)] {
                let zero = pearson(first.values(), curve.values()).unwrap();
                if zero * sign < 0.0 {
                    continue;
                }
                let lag = best_lag(&first, &curve).unwrap().unwrap();
                assert_relative_eq!(lag.time, shift, epsilon = 1e-9);
                assert_relative_eq!(lag.pearson, sign, epsilon = 1e-9);
            }
        }
    }

    #[test]
    fn a_comparison_does_not_depend_on_how_densely_a_simulation_is_sampled() {
        let measured = wave(300, 0.01, 0.05);
        let sparse = Comparison::new(&wave(300, 0.01, 0.0), &measured).unwrap();
        let dense = Comparison::new(&wave(30_000, 0.0001, 0.0), &measured).unwrap();
        assert_relative_eq!(sparse.pearson.unwrap(), dense.pearson.unwrap(), epsilon = 1e-3);
        assert_relative_eq!(dense.lag.unwrap().time, 0.05, epsilon = 1e-9);
        assert_eq!(dense.samples, 300);
    }
}
