//! Where an object is at a time: samples of its pose, linear in position and on the shortest arc in rotation.

use capsense_core::geometry::Pose;
use capsense_core::glam::{DQuat, DVec3};

/// Why samples are no motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// There is no pose at all.
    #[error("there is no pose in it")]
    Empty,
    /// Time stands still or runs backwards.
    #[error("time {time} s of sample {index} is not later than the one before")]
    NotLater {
        /// Index of the sample.
        index: usize,
        /// Its time in seconds.
        time: f64,
    },
    /// A time or pose is not finite, or a rotation is not of unit length.
    #[error("sample {0} is not a finite time and pose")]
    Invalid(usize),
    /// A speed that never arrives.
    #[error("a speed of {0} m/s is not finite and greater than zero")]
    Speed(f64),
}

/// The pose of one object over time; before the first and after the last sample it rests.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    samples: Vec<(f64, Pose)>,
}

impl Motion {
    /// An object that does not move.
    pub fn still(pose: Pose) -> Self {
        Self { samples: vec![(0.0, pose)] }
    }

    /// Takes poses at strictly increasing times in seconds.
    ///
    /// # Errors
    /// When there are none, time does not increase, or a number is not finite.
    pub fn sampled(samples: Vec<(f64, Pose)>) -> Result<Self, MotionError> {
        if samples.is_empty() {
            return Err(MotionError::Empty);
        }
        if let Some(bad) = samples.iter().position(|(time, pose)| !(time.is_finite() && pose.is_valid())) {
            return Err(MotionError::Invalid(bad));
        }
        match samples.windows(2).position(|pair| pair[0].0 >= pair[1].0) {
            Some(before) => Err(MotionError::NotLater { index: before + 1, time: samples[before + 1].0 }),
            None => Ok(Self { samples }),
        }
    }

    /// Walks along a polyline at constant speed in metres per second, starting at time zero, without turning.
    ///
    /// # Errors
    /// When there is no waypoint, one is not finite, or the speed is not finite and positive.
    pub fn along(waypoints: &[DVec3], speed: f64, rotation: DQuat) -> Result<Self, MotionError> {
        if !(speed.is_finite() && speed > 0.0) {
            return Err(MotionError::Speed(speed));
        }
        let mut samples: Vec<(f64, Pose)> = Vec::with_capacity(waypoints.len());
        for &translation in waypoints {
            let (arrived, last) =
                samples.last().map_or((0.0, translation), |(t, pose)| (*t, pose.translation));
            let time = arrived + last.distance(translation) / speed;
            // A waypoint given twice costs no time.
            if samples.is_empty() || time > arrived || time.is_nan() {
                samples.push((time, Pose { translation, rotation }));
            }
        }
        Self::sampled(samples)
    }

    /// Time of the last sample in seconds.
    pub fn end(&self) -> f64 {
        self.samples[self.samples.len() - 1].0
    }

    /// The pose at a time in seconds.
    pub fn pose_at(&self, time: f64) -> Pose {
        let next = self.samples.partition_point(|(t, _)| *t <= time);
        if next == 0 {
            return self.samples[0].1;
        }
        let (before, from) = self.samples[next - 1];
        match self.samples.get(next) {
            None => from,
            Some(&(after, to)) => {
                let part = (time - before) / (after - before);
                Pose {
                    translation: from.translation.lerp(to.translation, part),
                    rotation: from.rotation.slerp(to.rotation, part).normalize(),
                }
            }
        }
    }
}

/// How many frames it takes until the last of some motions has ended, that frame included.
pub fn frames_until_end<'a>(motions: impl IntoIterator<Item = &'a Motion>, frame_rate: f64) -> f64 {
    let end = motions.into_iter().map(Motion::end).fold(0.0, f64::max);
    // An end that falls on a frame but for rounding needs no frame after it.
    (end * frame_rate * (1.0 - 1e-12) - 1e-9).ceil().max(0.0) + 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn corner() -> Motion {
        let points = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 3.0, 0.0)];
        Motion::along(&points, 0.5, DQuat::IDENTITY).unwrap()
    }

    #[test]
    fn waypoints_are_passed_at_constant_speed() {
        let motion = corner();
        assert_relative_eq!(motion.end(), 8.0);
        let step = 0.01;
        for k in 0..800 {
            let time = f64::from(k) * step;
            let gone = motion.pose_at(time).translation.distance(motion.pose_at(time + step).translation);
            assert_relative_eq!(gone, 0.5 * step, max_relative = 1e-9);
        }
        assert_relative_eq!(motion.pose_at(4.0).translation.y, 1.0);
    }

    #[test]
    fn outside_its_samples_an_object_rests() {
        let motion = corner();
        assert_eq!(motion.pose_at(-1.0).translation, DVec3::ZERO);
        assert_eq!(motion.pose_at(1e9).translation, DVec3::new(1.0, 3.0, 0.0));
    }

    #[test]
    fn rotation_takes_the_shortest_arc() {
        let quarter = DQuat::from_rotation_z(FRAC_PI_2);
        for end in [quarter, -quarter] {
            let poses = [DQuat::IDENTITY, end].map(|rotation| Pose { translation: DVec3::ZERO, rotation });
            let motion = Motion::sampled(vec![(1.0, poses[0]), (3.0, poses[1])]).unwrap();
            let half = motion.pose_at(2.0).rotation;
            assert_relative_eq!(half.angle_between(DQuat::from_rotation_z(FRAC_PI_4)), 0.0, epsilon = 1e-7);
            assert!(half.is_normalized());
        }
    }

    #[test]
    fn repeated_waypoints_take_no_time() {
        let motion = Motion::along(&[DVec3::ZERO, DVec3::ZERO, DVec3::X], 1.0, DQuat::IDENTITY).unwrap();
        assert_relative_eq!(motion.end(), 1.0);
    }

    #[test]
    fn what_is_no_motion_is_refused() {
        let pose = Pose::IDENTITY;
        assert_eq!(Motion::sampled(vec![]), Err(MotionError::Empty));
        assert_eq!(
            Motion::sampled(vec![(0.0, pose), (0.0, pose)]),
            Err(MotionError::NotLater { index: 1, time: 0.0 })
        );
        assert_eq!(Motion::sampled(vec![(0.0, Pose::at(DVec3::NAN))]), Err(MotionError::Invalid(0)));
        assert_eq!(Motion::sampled(vec![(f64::INFINITY, pose)]), Err(MotionError::Invalid(0)));
        assert_eq!(Motion::along(&[], 1.0, DQuat::IDENTITY), Err(MotionError::Empty));
        assert_eq!(Motion::along(&[DVec3::X], 0.0, DQuat::IDENTITY), Err(MotionError::Speed(0.0)));
        assert!(Motion::along(&[DVec3::ZERO, DVec3::NAN], 1.0, DQuat::IDENTITY).is_err());
    }

    #[test]
    fn frames_run_until_the_last_motion_has_ended() {
        let long = corner();
        let still = Motion::still(Pose::IDENTITY);
        assert_eq!(frames_until_end([&still], 100.0), 1.0);
        assert_eq!(frames_until_end([&still, &long], 100.0), 801.0);
        assert_eq!(frames_until_end([&long], 0.3), 4.0, "2.4 frames after the first: the fourth is clamped");
    }
}
