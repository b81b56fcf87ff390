//! Any bytes into the decoder of any built-in profile. First byte: which; second: pieces and start.

#![no_main]

#[path = "../../crates/capsense-hw/tests/support/mod.rs"]
mod support;

use capsense_hw::profile::{DeviceProfile, built_in, built_in_names};
use capsense_hw::stream::Start;
use std::sync::LazyLock;

static PROFILES: LazyLock<Vec<DeviceProfile>> = LazyLock::new(|| {
    built_in_names().into_iter().map(|name| built_in(name).expect("a built-in profile")).collect()
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let [which, cut, bytes @ ..] = data else { return };
    let profile = &PROFILES[usize::from(*which) % PROFILES.len()];
    let start = if cut & 1 == 0 { Start::Anywhere } else { Start::Boundary };
    support::check(&profile.stream, start, bytes, &[1 + usize::from(cut >> 1), 1]);
});
