//! Whether a solve that takes a step is to take another.
//!
//! One step leaves what the preconditioner knows worse. Where that gathers from frame to frame, less can be foreseen of it, so
//! that every frame takes a step; two at once clear it, and fields stand still for some frames. Where scenes change so much that
//! they need a step in every frame anyway, another is for nothing. Which it is shows in how long fields stood still.

/// What solves are to leave after their first step, in relation to what is allowed, while they are thorough.
const PART: f64 = 0.1;

/// Fields that stood still for fewer frames than this between two steps did so briefly.
const BRIEFLY: usize = 2;

/// After so many brief times in a row the other way is tried.
const IN_A_ROW: usize = 2;

/// So many solves are thorough until it is seen again whether they must be, and so many are not after some were for nothing.
const THOROUGH: usize = 16;
const AFTER_IN_VAIN: usize = 4;

/// How thorough the next solve is.
#[derive(Clone, Debug, Default)]
pub(super) struct Thorough {
    is_thorough: bool,
    /// Solves without a step since the last that took one.
    still: usize,
    /// Brief times in a row.
    brief: usize,
    /// Solves with a step until it ends to be thorough, or, while it is not, until it may be.
    left: usize,
}

impl Thorough {
    /// The part of the allowed error that a solve goes on to after so many steps.
    pub(super) fn part(&self, steps: usize) -> f64 {
        if self.is_thorough && steps == 1 { PART } else { 1.0 }
    }

    /// Ends a solve of so many steps.
    pub(super) fn finish(&mut self, steps: usize) {
        if steps == 0 {
            self.still += 1;
            return;
        }
        let was_brief = std::mem::take(&mut self.still) < BRIEFLY;
        self.brief = if was_brief { self.brief + 1 } else { 0 };
        self.left = self.left.saturating_sub(1);
        let is_always_brief = self.brief >= IN_A_ROW;
        match self.is_thorough {
            true if is_always_brief => *self = Self { left: AFTER_IN_VAIN, ..Self::default() },
            true if self.left == 0 => *self = Self::default(),
            false if is_always_brief && self.left == 0 => {
                *self = Self { is_thorough: true, left: THOROUGH, ..Self::default() };
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which solves that take steps are thorough, of so many; between them fields stand still as `still` tells.
    fn thorough(solves: usize, still: impl Fn(bool) -> usize) -> Vec<bool> {
        let mut thorough = Thorough::default();
        (0..solves)
            .map(|_| {
                let is_thorough = thorough.part(1) < 1.0;
                thorough.finish(if is_thorough { 2 } else { 1 });
                (0..still(is_thorough)).for_each(|_| thorough.finish(0));
                is_thorough
            })
            .collect()
    }

    #[test]
    fn fields_that_stand_still_ask_for_no_second_step() {
        assert!(!thorough(50, |_| BRIEFLY).contains(&true));
    }

    #[test]
    fn second_steps_go_on_while_fields_stand_still_for_them() {
        let seen = thorough(100, |is_thorough| if is_thorough { 3 } else { 0 });
        assert!(seen.iter().filter(|thorough| **thorough).count() > 80, "{seen:?}");
        // Now and then it is seen whether they still are of use.
        assert!(seen[20..].contains(&false), "{seen:?}");
        assert_eq!(Thorough { is_thorough: true, ..Thorough::default() }.part(2), 1.0);
    }

    #[test]
    fn second_steps_that_help_nothing_are_rare() {
        let seen = thorough(100, |_| 0);
        let count = seen.iter().filter(|thorough| **thorough).count();
        assert!((10..40).contains(&count), "{count} {seen:?}");
    }
}
