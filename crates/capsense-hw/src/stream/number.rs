//! Numbers in text, as firmware prints them.

/// What a field of text is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token {
    /// A finite number.
    Number(f64),
    /// It begins like a number and is none, or none that is finite.
    Malformed,
    /// It does not begin like a number.
    Word,
}

/// Powers of ten that are exact in double precision, as far as they are needed.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Most digits whose integer is exact in double precision.
const EXACT_DIGITS: usize = 15;

/// Reads a field without blanks around it. The number is the nearest in double precision.
pub(super) fn token(field: &[u8]) -> Token {
    if let Some(number) = plain(field) {
        return Token::Number(number);
    }
    let numeric = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.');
    if !field.first().is_some_and(numeric) {
        return Token::Word;
    }
    let parsed = std::str::from_utf8(field).ok().and_then(|text| text.parse::<f64>().ok());
    match parsed {
        Some(number) if number.is_finite() => Token::Number(number),
        _ => Token::Malformed,
    }
}

/// The number that a field is, if it is a plain one.
fn plain(field: &[u8]) -> Option<f64> {
    plain_prefix(field).and_then(|(number, length)| (length == field.len()).then_some(number))
}

/// The plain number that a text begins with, and its length: `-12`, `+1.5`, `.25`, with few enough digits that one division of exact
/// numbers is correctly rounded (Clinger, 1990). What follows is for the caller to look at.
#[inline]
pub(super) fn plain_prefix(text: &[u8]) -> Option<(f64, usize)> {
    let sign = usize::from(matches!(text.first(), Some(b'+' | b'-')));
    let (mut mantissa, mut count) = digits(0, &text[sign..]);
    let mut length = sign + count;
    let mut decimals = 0;
    if text.get(length) == Some(&b'.') && count <= EXACT_DIGITS {
        (mantissa, decimals) = digits(mantissa, &text[length + 1..]);
        count += decimals;
        length += 1 + decimals;
    }
    if count == 0 || count > EXACT_DIGITS {
        return None;
    }
    let number = if decimals == 0 { mantissa as f64 } else { mantissa as f64 / POWERS[decimals] };
    Some((if text[0] == b'-' { -number } else { number }, length))
}

/// Powers of ten by which a mantissa makes room for the digits of a word.
const ROOM: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// Takes the digits at the front of a text into a mantissa, and counts them. Eight bytes are looked at together; with more than
/// [`EXACT_DIGITS`] the mantissa may be any.
#[inline]
fn digits(mut mantissa: u64, text: &[u8]) -> (u64, usize) {
    let mut count = 0;
    while let Some((word, _)) = text[count..].split_first_chunk::<8>() {
        let (value, length) = digits_of_word(u64::from_le_bytes(*word));
        mantissa = mantissa.wrapping_mul(ROOM[length]).wrapping_add(value);
        count += length;
        if length < 8 || count > EXACT_DIGITS {
            return (mantissa, count);
        }
    }
    for byte in text[count..].iter().take_while(|byte| byte.is_ascii_digit()) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(byte - b'0'));
        count += 1;
    }
    (mantissa, count)
}

/// The digits that eight characters, the first in the lowest byte, begin with, and how many they are.
#[inline]
fn digits_of_word(word: u64) -> (u64, usize) {
    const EACH: u64 = u64::MAX / 255;
    let values = word ^ (EACH * u64::from(b'0'));
    // Digits are now 0 to 9; what is more sets the highest bit of its byte. A carry only goes to bytes behind it.
    let others = (values | values.wrapping_add(EACH * (128 - 10))) & (EACH * 128);
    let length = (others.trailing_zeros() / 8) as usize;
    if length == 0 {
        return (0, 0);
    }
    // Zeros in front, then neighbours are joined: to two digits, to four, to eight.
    let values = values << (64 - 8 * length);
    let pairs = (values.wrapping_mul(10).wrapping_add(values >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100).wrapping_add(pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    let eight = (fours.wrapping_mul(10_000).wrapping_add(fours >> 32)) & 0xFFFF_FFFF;
    (eight, length)
}

#[cfg(test)]
mod tests {
    use super::{Token, digits_of_word, plain_prefix, token};
    use proptest::prelude::*;

    #[test]
    fn what_firmware_prints() {
        for (text, expected) in [
            ("43823473", Token::Number(43_823_473.0)),
            ("-9089", Token::Number(-9089.0)),
            ("-1.0000", Token::Number(-1.0)),
            ("4.1234567890", Token::Number(4.123_456_789)),
            (".5", Token::Number(0.5)),
            ("5.", Token::Number(5.0)),
            ("1.25e-12", Token::Number(1.25e-12)),
            ("12345678901234567890", Token::Number(12_345_678_901_234_567_890.0)),
            ("-3.-7", Token::Malformed),
            ("-", Token::Malformed),
            (".", Token::Malformed),
            ("1e999", Token::Malformed),
            ("-inf", Token::Malformed),
            ("+NaN", Token::Malformed),
            ("12ab", Token::Malformed),
            ("inf", Token::Word),
            ("nan", Token::Word),
            ("ERROR", Token::Word),
            ("", Token::Word),
            ("\u{2713}", Token::Word),
        ] {
            assert_eq!(token(text.as_bytes()), expected, "`{text}`");
        }
    }

    /// Every count of digits and every other character at every place of a word.
    #[test]
    fn digits_end_where_another_character_is() {
        for length in 0..8 {
            for other in (0..=255u8).filter(|byte| !byte.is_ascii_digit()) {
                let mut word = *b"98765432";
                word[length] = other;
                let expected = std::str::from_utf8(&b"98765432"[..length]).unwrap().parse().unwrap_or(0);
                assert_eq!(digits_of_word(u64::from_le_bytes(word)), (expected, length), "{word:?}");
            }
        }
        assert_eq!(digits_of_word(u64::from_le_bytes(*b"98765432")), (98_765_432, 8));
        assert_eq!(plain_prefix(b"-12.50, 3"), Some((-12.5, 6)));
        assert_eq!(plain_prefix(b"1234567890123456"), None);
    }

    proptest! {
        #[test]
        fn numbers_are_those_of_the_standard_library(text in r"[-+]?[0-9]{0,12}(\.[0-9]{0,18})?(e[-+]?[0-9]{1,2})?") {
            let standard = text.parse::<f64>().ok();
            match token(text.as_bytes()) {
                Token::Number(number) => prop_assert_eq!(standard.map(f64::to_bits), Some(number.to_bits())),
                Token::Malformed | Token::Word => prop_assert_eq!(standard, None),
            }
        }
    }
}
