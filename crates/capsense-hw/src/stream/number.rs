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

/// `-12`, `+1.5`, `.25`: few enough digits that one division of exact numbers is correctly rounded (Clinger, 1990).
fn plain(field: &[u8]) -> Option<f64> {
    let (negative, digits) = match field {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.len() > EXACT_DIGITS + 1 {
        return None;
    }
    let mut mantissa = 0u64;
    let mut point = None;
    for (at, byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => mantissa = mantissa * 10 + u64::from(byte - b'0'),
            b'.' if point.is_none() => point = Some(at),
            _ => return None,
        }
    }
    let decimals = point.map_or(0, |at| digits.len() - at - 1);
    let count = digits.len() - usize::from(point.is_some());
    if count == 0 || count > EXACT_DIGITS {
        return None;
    }
    let number = mantissa as f64 / POWERS[decimals];
    Some(if negative { -number } else { number })
}

#[cfg(test)]
mod tests {
    use super::{Token, token};
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
