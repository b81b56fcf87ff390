//! Whether fields are worth leading on along their last change, and how far.

/// A change that lowers no energy by more than this part of it is not worth its product.
const LEAST_GAIN: f64 = 1e-7;

/// The fields must not be led further than this times their last change.
const FURTHEST: f64 = 8.0;

/// Going ahead must have gained this part of what there was to gain, lately, for another change to be followed; or so many
/// have not been. What the last frame showed has this weight. Where bodies are seen to move by jumps from pixel to pixel it
/// gains a twentieth, and a step that is followed costs a quarter more.
const WORTHWHILE: f64 = 0.2;
const LOOK_AFTER: u32 = 6;
const FADING: f64 = 0.3;

/// How far fields should go along a change d in all, `gone` of it already: rᵀd / dᵀKd more, or not at all if that gains next to
/// nothing of their energy or is too far.
pub(super) fn length(slope: f64, curvature: f64, energy: f64, gone: f64) -> f64 {
    let length = slope / curvature;
    let is_worth_it = curvature > 0.0 && length * slope > LEAST_GAIN * energy;
    if is_worth_it && (gone + length).abs() <= FURTHEST { length } else { 0.0 }
}

/// What going ahead has gained lately, as a part of what there was to gain, and how many solves before were not followed.
#[derive(Clone, Debug)]
pub(super) struct Worth {
    gained: f64,
    without: u32,
}

impl Default for Worth {
    fn default() -> Self {
        Self { gained: 1.0, without: 0 }
    }
}

impl Worth {
    /// Learns from what going ahead has gained and what it has left to gain.
    pub(super) fn learn(&mut self, ahead: f64, left: f64) {
        if ahead + left > 0.0 && left.is_finite() {
            self.gained += FADING * (ahead / (ahead + left) - self.gained);
        }
    }

    /// Whether the step that comes is to be followed: where it was of no use, only now and then.
    pub(super) fn is_to_follow(&mut self) -> bool {
        let follows = self.gained >= WORTHWHILE || self.without >= LOOK_AFTER;
        self.without = if follows { 0 } else { self.without + 1 };
        follows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_gains_nothing_is_followed_now_and_then() {
        let mut worth = Worth::default();
        assert!(worth.is_to_follow());
        (0..20).for_each(|_| worth.learn(0.0, 1.0));
        let followed: Vec<bool> = (0..14).map(|_| worth.is_to_follow()).collect();
        assert_eq!(followed.iter().filter(|follows| **follows).count(), 2, "{followed:?}");
        worth.learn(f64::INFINITY, f64::INFINITY);
        (0..3).for_each(|_| worth.learn(1.0, 0.0));
        assert!((0..14).all(|_| worth.is_to_follow()));
    }

    #[test]
    fn lengths_are_of_least_energy_and_not_without_end() {
        assert_eq!(length(3.0, 2.0, 1.0, 0.0), 1.5);
        assert_eq!(length(3.0, 2.0, 1.0, 6.6), 0.0);
        assert_eq!(length(1e-4, 1.0, 1.0, 0.0), 0.0);
        assert_eq!(length(1.0, 0.0, 1.0, 0.0), 0.0);
        assert_eq!(length(1.0, -1.0, 1.0, 0.0), 0.0);
        assert_eq!(length(f64::NAN, 1.0, 1.0, 0.0), 0.0);
    }
}
