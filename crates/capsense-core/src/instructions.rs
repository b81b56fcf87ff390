//! Which instructions of a processor loops over many numbers are compiled for: for several sets, one of which is chosen at run time.
//!
//! Not one of them fuses or reorders operations, so results are the same on every machine.

use pulp::WithSimd;

/// Does work that the compiler can vectorise with the widest instructions of this machine, 512 bits where it has them. The work must be an
/// `#[inline(always)]` closure.
#[inline(always)]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    widest().dispatch(work)
}

/// The instructions that run on this machine, in words, for those who tell times.
#[must_use]
pub fn instruction_set() -> String {
    struct Bits;
    impl WithSimd for Bits {
        type Output = usize;

        fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
            32 * S::F32_LANES
        }
    }
    let name = std::env::consts::ARCH;
    match (widest().dispatch(Bits), EightLanes::new().dispatch(Bits)) {
        (32, _) => format!("{name}, what all such processors have"),
        (bits, of_blocks) => {
            format!("{name}, vectors of {bits} bits, {of_blocks} on blocks of eight numbers")
        }
    }
}

/// The widest instructions of this machine.
pub(crate) fn widest() -> pulp::Arch {
    pulp::Arch::new()
}

/// The same with instructions on no more than eight numbers in single precision, four in double: where so many columns are side by
/// side, wider ones gain nothing.
#[inline(always)]
pub(crate) fn vectorised_by_eight<R>(work: impl FnOnce() -> R) -> R {
    EightLanes::new().dispatch(work)
}

/// The widest instructions of this machine that work on eight numbers in single precision or fewer: for kernels on blocks of eight,
/// which wider ones would have to leave in part to a second loop.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightLanes(Option<pulp::x86::V3>);

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl EightLanes {
    pub(crate) fn new() -> Self {
        Self(pulp::x86::V3::try_new())
    }

    #[inline(always)]
    pub(crate) fn dispatch<W: WithSimd>(self, work: W) -> W::Output {
        match self.0 {
            Some(simd) => pulp::Simd::vectorize(simd, work),
            None => work.with_simd(pulp::Scalar),
        }
    }
}

/// The instructions of this machine, of which none work on more than eight numbers in single precision.
#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightLanes(pulp::Arch);

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
impl EightLanes {
    pub(crate) fn new() -> Self {
        Self(pulp::Arch::new())
    }

    #[inline(always)]
    pub(crate) fn dispatch<W: WithSimd>(self, work: W) -> W::Output {
        self.0.dispatch(work)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_runs_is_told() {
        assert!(instruction_set().starts_with(std::env::consts::ARCH));
        #[cfg(target_arch = "x86_64")]
        if EightLanes::new().0.is_some() {
            assert!(instruction_set().contains("256 on blocks"), "{}", instruction_set());
        }
    }
}
