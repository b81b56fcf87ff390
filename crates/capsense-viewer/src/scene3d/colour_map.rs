//! Numbers as colours: a map whose lightness grows evenly, and round numbers for its scale.

use egui::Color32;

/// Number of colours between which is interpolated.
pub(super) const STOPS: usize = 16;

/// The map "viridis" by Smith and van der Walt (CC0), at evenly spaced places: lightness grows evenly along it, also for
/// eyes that do not tell red from green, and in print without colours.
pub(super) const VIRIDIS: [[u8; 3]; STOPS] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x1a, 0x6c],
    [0x47, 0x2f, 0x7d],
    [0x41, 0x44, 0x87],
    [0x39, 0x56, 0x8c],
    [0x31, 0x68, 0x8e],
    [0x2a, 0x78, 0x8e],
    [0x23, 0x88, 0x8e],
    [0x1f, 0x98, 0x8b],
    [0x22, 0xa8, 0x84],
    [0x35, 0xb7, 0x79],
    [0x54, 0xc5, 0x68],
    [0x7a, 0xd1, 0x51],
    [0xa5, 0xdb, 0x36],
    [0xd2, 0xe2, 0x1b],
    [0xfd, 0xe7, 0x25],
];

/// The colour of a part of the scale; what lies beyond an end has the colour of that end, what is no number that of the
/// lower one.
pub fn colour(part: f64) -> Color32 {
    let part = if part > 0.0 { part.min(1.0) } else { 0.0 };
    let place = part * (STOPS - 1) as f64;
    let below = (place as usize).min(STOPS - 2);
    let share = place - below as f64;
    let channel = |k: usize| {
        let [from, to] = [VIRIDIS[below][k], VIRIDIS[below + 1][k]].map(f64::from);
        (from + share * (to - from)).round() as u8
    };
    Color32::from_rgb(channel(0), channel(1), channel(2))
}

/// The smallest of 1, 2 and 5 times powers of ten that is not below a positive number; 1 for what is none.
pub(super) fn round_up(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|digit| digit * power)
        .into_iter()
        .find(|&round| round >= value * (1.0 - 1e-9))
        .unwrap_or(value)
}

/// The largest of these numbers that is not above a positive number; 1 for what is none.
pub(super) fn round_down(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    [10.0, 5.0, 2.0, 1.0]
        .map(|digit| digit * power)
        .into_iter()
        .find(|&round| round <= value * (1.0 + 1e-9))
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE L* of a colour.
    fn lightness(colour: Color32) -> f64 {
        let linear = |byte: u8| {
            let part = f64::from(byte) / 255.0;
            if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
        };
        let y = 0.2126 * linear(colour.r()) + 0.7152 * linear(colour.g()) + 0.0722 * linear(colour.b());
        116.0 * y.cbrt() - 16.0
    }

    #[test]
    fn lightness_grows_evenly() {
        let steps: Vec<f64> = (0..=30).map(|k| lightness(colour(f64::from(k) / 30.0))).collect();
        let whole = steps[30] - steps[0];
        assert!(whole > 70.0, "{whole}");
        for pair in steps.windows(2) {
            let part = (pair[1] - pair[0]) / (whole / 30.0);
            assert!(part > 0.6 && part < 1.5, "{part}");
        }
    }

    #[test]
    fn beyond_its_ends_the_map_stands_still() {
        assert_eq!(colour(-3.0), colour(0.0));
        assert_eq!(colour(f64::NAN), colour(0.0));
        assert_eq!(colour(7.0), Color32::from_rgb(0xfd, 0xe7, 0x25));
    }

    #[test]
    fn round_numbers_are_one_two_and_five() {
        for (value, up, down) in [(0.3, 0.5, 0.2), (1.0, 1.0, 1.0), (51.0, 100.0, 50.0), (1.9e-3, 2e-3, 1e-3)]
        {
            assert!((round_up(value) / up - 1.0).abs() < 1e-12, "{value}: {}", round_up(value));
            assert!((round_down(value) / down - 1.0).abs() < 1e-12, "{value}: {}", round_down(value));
        }
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!((round_up(bad), round_down(bad)), (1.0, 1.0));
        }
    }
}
