//! Reading position in the bytes of a Gmsh file: text tokens, binary numbers, and the place of an error.
//!
//! In format 4.1 a binary section holds the same numbers in the same order as an ASCII one, so the readers ask for
//! an `int`, a `size` or a `real` and the cursor knows how it is written.

use super::error::{At, GmshError};
use glam::DVec3;

/// No length in a mesh is larger in any unit.
const LARGEST: f64 = 1e12;

/// How the numbers of a file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As text.
    Ascii,
    /// As bytes, least significant first.
    LittleEndian,
    /// As bytes, most significant first.
    BigEndian,
}

/// The numbers a record is made of; its smallest size in bytes bounds what a count may claim.
#[derive(Clone, Copy, Default)]
pub(super) struct Record {
    pub(super) ints: usize,
    pub(super) sizes: usize,
    pub(super) reals: usize,
}

pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    position: usize,
    pub(super) encoding: Encoding,
    /// Bytes of a `size` in a binary file: 4 or 8.
    pub(super) size_bytes: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        // Editors put a mark for UTF-8 at the beginning of a text.
        let position = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, position, encoding: Encoding::Ascii, size_bytes: 8 }
    }

    /// Where the next number begins.
    pub(super) fn mark(&mut self) -> usize {
        if self.encoding == Encoding::Ascii { self.text_mark() } else { self.position }
    }

    /// Where the next text begins, in a binary file too.
    pub(super) fn text_mark(&mut self) -> usize {
        self.skip_whitespace();
        self.position
    }

    /// The place of a byte, as a user looks for it. Lines are counted only here, when something is wrong.
    pub(super) fn at(&self, mark: usize) -> At {
        if self.encoding != Encoding::Ascii {
            return At::Byte(mark);
        }
        let before = self.bytes.get(..mark).unwrap_or(self.bytes);
        At::Line(1 + before.iter().filter(|&&byte| byte == b'\n').count())
    }

    pub(super) fn unexpected(&self, mark: usize, expected: &'static str, found: impl ToString) -> GmshError {
        GmshError::Unexpected { at: self.at(mark), expected, found: found.to_string() }
    }

    fn ended(&self, expected: &'static str) -> GmshError {
        GmshError::UnexpectedEnd { at: self.at(self.bytes.len()), expected }
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or_default()
    }

    fn skip_whitespace(&mut self) {
        self.position += self.rest().iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    }

    /// The next text token and where it begins, whatever the encoding; `None` at the end of the file.
    pub(super) fn token(&mut self) -> Option<(usize, &'a [u8])> {
        let mark = self.text_mark();
        let rest = self.rest();
        let length = rest.iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
        self.position += length;
        (length > 0).then(|| (mark, &rest[..length]))
    }

    fn parse_token<T: std::str::FromStr>(&mut self, expected: &'static str) -> Result<T, GmshError> {
        let Some((mark, token)) = self.token() else {
            return Err(self.ended(expected));
        };
        std::str::from_utf8(token)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| self.unexpected(mark, expected, shown(token)))
    }

    /// A non-negative integer that is text in binary files too.
    pub(super) fn text_size(&mut self, expected: &'static str) -> Result<u64, GmshError> {
        self.parse_token(expected)
    }

    /// An integer that is text in binary files too.
    pub(super) fn text_int(&mut self, expected: &'static str) -> Result<i32, GmshError> {
        self.parse_token(expected)
    }

    /// A word.
    pub(super) fn word(&mut self, expected: &'static str) -> Result<(usize, String), GmshError> {
        match self.token() {
            Some((mark, token)) => Ok((mark, shown(token))),
            None => Err(self.ended(expected)),
        }
    }

    /// Text in double quotes that ends on the line on which it begins.
    pub(super) fn quoted(&mut self, expected: &'static str) -> Result<String, GmshError> {
        let mark = self.text_mark();
        let rest = self.rest();
        let line = rest.split(|&byte| byte == b'\n').next().unwrap_or_default();
        if line.is_empty() {
            return Err(self.ended(expected));
        }
        let inner = line.strip_prefix(b"\"").and_then(|text| {
            let length = text.iter().position(|&byte| byte == b'"')?;
            Some(&text[..length])
        });
        let inner = inner.ok_or_else(|| self.unexpected(mark, expected, shown(line)))?;
        self.position += inner.len() + 2;
        Ok(String::from_utf8_lossy(inner).into_owned())
    }

    /// Ends a line of text after which binary data begins; nothing in an ASCII file.
    pub(super) fn start_data(&mut self) -> Result<(), GmshError> {
        if self.encoding == Encoding::Ascii {
            return Ok(());
        }
        self.end_line()
    }

    /// Spaces and one end of line: what follows may be data that looks like whitespace.
    pub(super) fn end_line(&mut self) -> Result<(), GmshError> {
        let rest = self.rest();
        let spaces = rest.iter().take_while(|byte| matches!(byte, b' ' | b'\t' | b'\r')).count();
        match rest.get(spaces) {
            Some(b'\n') => {
                self.position += spaces + 1;
                Ok(())
            }
            Some(_) => Err(self.unexpected(self.position, "an end of line", shown(rest))),
            None => Err(self.ended("an end of line")),
        }
    }

    fn take<const N: usize>(&mut self, expected: &'static str) -> Result<[u8; N], GmshError> {
        let chunk = self.rest().first_chunk::<N>().copied().ok_or_else(|| self.ended(expected))?;
        self.position += N;
        Ok(chunk)
    }

    /// The integer 1 with which a binary file tells its byte order.
    pub(super) fn byte_order(&mut self) -> Result<(), GmshError> {
        let mark = self.position;
        self.encoding = Encoding::LittleEndian;
        match self.take("the byte-order marker")? {
            [1, 0, 0, 0] => {}
            [0, 0, 0, 1] => self.encoding = Encoding::BigEndian,
            _ => return Err(GmshError::ByteOrder { at: self.at(mark) }),
        }
        Ok(())
    }

    /// A signed integer: text, or four bytes.
    pub(super) fn int(&mut self, expected: &'static str) -> Result<i32, GmshError> {
        match self.encoding {
            Encoding::Ascii => self.parse_token(expected),
            Encoding::LittleEndian => self.take(expected).map(i32::from_le_bytes),
            Encoding::BigEndian => self.take(expected).map(i32::from_be_bytes),
        }
    }

    /// An `int` that cannot be negative: the tags and counts of format 2.2.
    pub(super) fn natural(&mut self, expected: &'static str) -> Result<u64, GmshError> {
        if self.encoding == Encoding::Ascii {
            return self.parse_token(expected);
        }
        let mark = self.position;
        let value = self.int(expected)?;
        u64::try_from(value).map_err(|_| self.unexpected(mark, expected, value))
    }

    /// A `size_t`: text, or four or eight bytes.
    pub(super) fn size(&mut self, expected: &'static str) -> Result<u64, GmshError> {
        match (self.encoding, self.size_bytes) {
            (Encoding::Ascii, _) => self.parse_token(expected),
            (Encoding::LittleEndian, 4) => self.take(expected).map(|b| u64::from(u32::from_le_bytes(b))),
            (Encoding::BigEndian, 4) => self.take(expected).map(|b| u64::from(u32::from_be_bytes(b))),
            (Encoding::LittleEndian, _) => self.take(expected).map(u64::from_le_bytes),
            (Encoding::BigEndian, _) => self.take(expected).map(u64::from_be_bytes),
        }
    }

    /// A double: text, or eight bytes.
    pub(super) fn real(&mut self, expected: &'static str) -> Result<f64, GmshError> {
        match self.encoding {
            Encoding::Ascii => self.parse_token(expected),
            Encoding::LittleEndian => self.take(expected).map(f64::from_le_bytes),
            Encoding::BigEndian => self.take(expected).map(f64::from_be_bytes),
        }
    }

    /// Three doubles, finite and of a size that lengths have in any unit.
    pub(super) fn point(&mut self, node: u64) -> Result<DVec3, GmshError> {
        let mark = self.mark();
        let mut point = DVec3::ZERO;
        for axis in 0..3 {
            point[axis] = self.real("a coordinate of a node")?;
        }
        if point.abs().max_element() <= LARGEST && point.is_finite() {
            Ok(point)
        } else {
            Err(GmshError::NonFinite { at: self.at(mark), node })
        }
    }

    /// Checks that so many records fit into the rest of the file, so that memory may be reserved for them.
    pub(super) fn check_count(
        &self,
        claimed: u64,
        what: &'static str,
        mark: usize,
        record: Record,
    ) -> Result<usize, GmshError> {
        let numbers = record.ints + record.sizes + record.reals;
        let bytes = match self.encoding {
            // A digit and a separator for each.
            Encoding::Ascii => 2 * numbers,
            _ => 4 * record.ints + self.size_bytes * record.sizes + 8 * record.reals,
        };
        usize::try_from(claimed)
            .ok()
            .filter(|&count| count <= (self.rest().len() + 1) / bytes.max(1))
            .ok_or_else(|| GmshError::Count { at: self.at(mark), what, claimed })
    }

    /// Reads on to behind the end of a section that is not wanted.
    pub(super) fn skip_section(&mut self, mark: usize, name: &str) -> Result<(), GmshError> {
        let end = format!("$End{name}").into_bytes();
        let rest = self.rest();
        let closes = |start: &usize| {
            let after = rest.get(start + end.len());
            rest[*start..].starts_with(&end) && after.is_none_or(u8::is_ascii_whitespace)
        };
        let dollars = rest.iter().enumerate().filter(|(_, byte)| **byte == b'$').map(|(start, _)| start);
        match dollars.into_iter().find(closes) {
            Some(start) => {
                self.position += start + end.len();
                Ok(())
            }
            None => Err(GmshError::Unterminated { at: self.at(mark), section: name.to_owned() }),
        }
    }
}

/// The beginning of a token, for a message.
fn shown(token: &[u8]) -> String {
    const LONGEST: usize = 40;
    let line = token.split(|&byte| byte == b'\n' || byte == b'\r').next().unwrap_or_default();
    let head = line.get(..LONGEST).unwrap_or(line);
    String::from_utf8_lossy(head).escape_debug().to_string()
}
