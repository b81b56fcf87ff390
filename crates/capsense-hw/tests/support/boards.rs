//! What boards send, whole and damaged, and what no board would.

use capsense_hw::profile::built_in;
use capsense_hw::stream::{Encoder, Sample, Value};

/// About so many bytes of a built-in board's samples, of damaged samples, and of what never ends.
pub(crate) fn streams(name: &str, bytes: usize) -> Vec<Vec<u8>> {
    let format = built_in(name).unwrap().stream;
    let encoder = Encoder::new(&format).unwrap();
    let mut sound = Vec::new();
    for sequence in 0u32.. {
        if sound.len() >= bytes {
            break;
        }
        let value = |channel: u32| Value::Number(f64::from(sequence.wrapping_mul(37 + channel) % 4096));
        let values: Vec<Value> = (0..format.channels().unwrap_or(4) as u32).map(value).collect();
        encoder
            .encode(&Sample { values: &values, sequence: Some(sequence), ..Sample::default() }, &mut sound);
    }
    let mut damaged = sound.clone();
    damaged.iter_mut().step_by(97).for_each(|byte| *byte ^= 0x55);
    let endless = |byte: u8| vec![byte; bytes];
    vec![sound, damaged, endless(b'7'), endless(0), endless(0x4C), endless(b','), endless(b'\n')]
}
