//! Words of converters: which bits are the result, how it is coded, which bits are flags, where the rails are.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a converter writes a result into its word.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Word {
    /// Bits of the result, the lowest of the word.
    pub bits: u8,
    /// How the result is coded in them.
    pub coding: Coding,
    /// Results, as the bits of the word, that mean "below" and "above the range".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rails: Option<[u32; 2]>,
    /// Other bits of the word, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub flags: BTreeMap<String, u32>,
}

/// How an integer is coded in a number of bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coding {
    /// From 0 up.
    Unsigned,
    /// 0 is at half of the range.
    OffsetBinary,
    /// Negative numbers fill the upper half of the range.
    TwosComplement,
}

/// A word taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// The result.
    pub result: i64,
    /// Whether it is at the lower or upper rail.
    pub at_rail: [bool; 2],
    /// The bits of the word that are not the result.
    pub flags: u32,
}

impl Word {
    /// Bits of the word that are the result.
    fn mask(&self) -> u32 {
        u32::MAX >> (32 - u32::from(self.bits))
    }

    /// What is wrong with it: a key, and why.
    pub(super) fn check(&self) -> Result<(), (&'static str, String)> {
        if !(1..=32).contains(&self.bits) {
            return Err(("word.bits", "must be from 1 to 32".to_owned()));
        }
        if self.rails.is_some_and(|rails| rails.iter().any(|rail| rail & !self.mask() != 0)) {
            return Err(("word.rails", format!("must fit in {} bits", self.bits)));
        }
        if self.flags.values().any(|flag| *flag == 0 || flag & self.mask() != 0) {
            return Err(("word.flags", format!("must be bits above the lowest {}", self.bits)));
        }
        Ok(())
    }

    /// Least and largest result.
    pub fn range(&self) -> [i64; 2] {
        let top = i64::from(self.mask());
        match self.coding {
            Coding::Unsigned => [0, top],
            Coding::OffsetBinary | Coding::TwosComplement => [-(top / 2) - 1, top / 2],
        }
    }

    /// Takes a word apart that came as a number: unsigned, or negative with its sign carried on. `None` if no such word
    /// exists.
    pub fn decode(&self, number: f64) -> Option<Code> {
        let all_flags = self.flags.values().fold(0, |all, flag| all | flag);
        let word = number as i64;
        let [least, _] = self.range();
        let least = if self.coding == Coding::TwosComplement { least } else { 0 };
        let known = i64::from(self.mask() | all_flags);
        if word as f64 != number || word < least || (word >= 0 && word & !known != 0) {
            return None;
        }
        let field = word as u32 & self.mask();
        let half = 1 << (self.bits - 1);
        let result = match self.coding {
            Coding::Unsigned => i64::from(field),
            Coding::OffsetBinary => i64::from(field) - half,
            Coding::TwosComplement if i64::from(field) >= half => i64::from(field) - 2 * half,
            Coding::TwosComplement => i64::from(field),
        };
        let at_rail = self.rails.map_or([false; 2], |rails| rails.map(|rail| rail == field));
        let flags = if word < 0 { 0 } else { word as u32 & all_flags };
        Some(Code { result, at_rail, flags })
    }

    /// The word of a result, without flags, as a number that [`decode`](Self::decode) takes: negative where the coding
    /// has a sign.
    pub fn encode(&self, result: i64) -> f64 {
        let [least, largest] = self.range();
        let result = result.clamp(least, largest);
        match self.coding {
            Coding::OffsetBinary => (result - least) as f64,
            Coding::Unsigned | Coding::TwosComplement => result as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Coding, Word};

    fn word(bits: u8, coding: Coding) -> Word {
        Word { bits, coding, rails: Some([0, 1]), flags: [("high".to_owned(), 1 << 12)].into() }
    }

    #[test]
    fn every_word_of_ten_bits_comes_back() {
        for coding in [Coding::Unsigned, Coding::OffsetBinary, Coding::TwosComplement] {
            let word = word(10, coding);
            for bits in 0..1024 {
                let code = word.decode(f64::from(bits)).unwrap();
                let back = word.encode(code.result);
                assert_eq!(back as i64 & 0x3FF, i64::from(bits), "{coding:?}");
                assert_eq!(word.decode(back), Some(code));
                let flagged = word.decode(f64::from(bits | 1 << 12)).unwrap();
                assert_eq!((flagged.result, flagged.flags), (code.result, 1 << 12));
            }
        }
    }

    #[test]
    fn codings_put_zero_where_they_say() {
        assert_eq!(word(10, Coding::Unsigned).range(), [0, 1023]);
        assert_eq!(word(10, Coding::OffsetBinary).decode(512.0).unwrap().result, 0);
        assert_eq!(word(10, Coding::TwosComplement).decode(1023.0).unwrap().result, -1);
        assert_eq!(word(32, Coding::TwosComplement).range(), [-(1 << 31), (1 << 31) - 1]);
        assert_eq!(word(10, Coding::Unsigned).decode(1.0).unwrap().at_rail, [false, true]);
    }

    #[test]
    fn what_is_no_word_is_refused() {
        let unsigned = word(10, Coding::Unsigned);
        for number in [0.5, -1.0, 1024.0, 8192.0, 1e300, -1e300, f64::NAN, f64::INFINITY] {
            assert_eq!(unsigned.decode(number), None, "{number}");
        }
        assert_eq!(word(10, Coding::TwosComplement).decode(-513.0), None);
        assert_eq!(word(10, Coding::TwosComplement).decode(-512.0).unwrap().result, -512);
    }
}
