//! Random streams, one for each purpose of each channel. The generator is ChaCha with 8 rounds; its 2^64 streams of one key do
//! not overlap.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// What a channel's stream is for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    /// Errors that a channel has from its making.
    Part = 1,
    White,
    Drift,
    Jitter,
}

/// A stream of row, column and purpose; `None` for what all channels share.
pub(super) fn stream(seed: u64, of: Option<(usize, usize, Purpose)>) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    if let Some((row, column, purpose)) = of {
        random.set_stream(((row as u64) << 34) | ((column as u64) << 4) | purpose as u64);
    }
    random
}
