//! Fields of a line: what lies between delimiters.

use super::number::plain_prefix;

/// What a byte does in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// Belongs to a field.
    Content,
    /// Separates fields; any number of them together count as one.
    Space,
    /// Separates fields; between two of them lies an empty field.
    Separator,
}

/// Which bytes separate fields.
#[derive(Clone, Debug)]
pub(super) struct Delimiters {
    roles: [Role; 256],
}

impl Delimiters {
    /// Spaces among the delimiters merge; others only if `merge` says so.
    pub(super) fn new(delimiters: &str, merge: bool) -> Self {
        let mut roles = [Role::Content; 256];
        for byte in delimiters.bytes() {
            roles[usize::from(byte)] = if merge || byte == b' ' { Role::Space } else { Role::Separator };
        }
        Self { roles }
    }

    pub(super) fn fields<'a>(&'a self, line: &'a [u8]) -> Fields<'a> {
        Fields { delimiters: self, rest: line, expects_one: false }
    }

    fn role(&self, byte: u8) -> Role {
        self.roles[usize::from(byte)]
    }
}

/// The fields of a line, without blanks around them.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    delimiters: &'a Delimiters,
    rest: &'a [u8],
    /// After a separator comes a field, even if nothing is left.
    expects_one: bool,
}

impl<'a> Fields<'a> {
    fn skip_spaces(&mut self) {
        let content = |byte: &u8| self.delimiters.role(*byte) != Role::Space;
        let spaces = self.rest.iter().position(content).unwrap_or(self.rest.len());
        self.rest = &self.rest[spaces..];
    }

    /// Goes on behind a field that ends at so many bytes.
    fn pass(&mut self, end: usize) {
        self.rest = &self.rest[end..];
        self.skip_spaces();
        self.expects_one = false;
        if let Some((&byte, rest)) = self.rest.split_first()
            && self.delimiters.role(byte) == Role::Separator
        {
            self.rest = rest;
            self.expects_one = true;
        }
    }

    /// The next field, if it is a plain number; in one walk, as nearly all fields are one. If not, it is still to come.
    pub(super) fn next_plain(&mut self) -> Option<f64> {
        self.skip_spaces();
        let (number, length) = plain_prefix(self.rest)?;
        let ends = self.rest.get(length).is_none_or(|byte| self.delimiters.role(*byte) != Role::Content);
        ends.then(|| {
            self.pass(length);
            number
        })
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_spaces();
        if self.rest.is_empty() && !std::mem::take(&mut self.expects_one) {
            return None;
        }
        let delimiter = |byte: &u8| self.delimiters.role(*byte) != Role::Content;
        let end = self.rest.iter().position(delimiter).unwrap_or(self.rest.len());
        let field = &self.rest[..end];
        self.pass(end);
        Some(field.trim_ascii())
    }
}

#[cfg(test)]
mod tests {
    use super::Delimiters;

    fn fields(delimiters: &str, merge: bool, line: &str) -> Vec<String> {
        let delimiters = Delimiters::new(delimiters, merge);
        delimiters.fields(line.as_bytes()).map(|field| String::from_utf8_lossy(field).into_owned()).collect()
    }

    /// Field by field, read as a number where it is one, or else as it stands.
    #[test]
    fn plain_numbers_are_fields_like_others() {
        for line in ["12, 3.5,,x, 4 5", "7", " 1 ,", "1e5,-2", "1.2.3 4", ",1"] {
            for delimiters in [",", ", ", ",\t ", ";"] {
                let delimiters = Delimiters::new(delimiters, false);
                let mut by_number = delimiters.fields(line.as_bytes());
                for field in delimiters.fields(line.as_bytes()) {
                    match by_number.next_plain() {
                        Some(number) => {
                            let text = std::str::from_utf8(field).unwrap();
                            assert_eq!(text.parse::<f64>().unwrap(), number, "{line}");
                        }
                        None => assert_eq!(by_number.next(), Some(field), "{line}"),
                    }
                }
                assert_eq!((by_number.next_plain(), by_number.next()), (None, None), "{line}");
            }
        }
    }

    #[test]
    fn separators_keep_empty_fields_and_spaces_merge() {
        assert_eq!(fields(",", false, "12,,,40"), ["12", "", "", "40"]);
        assert_eq!(fields(",", false, ",12,"), ["", "12", ""]);
        assert_eq!(fields(",", false, "cap A, 12345 , 11.1383"), ["cap A", "12345", "11.1383"]);
        assert_eq!(fields(" ", false, "  1   2 "), ["1", "2"]);
        assert_eq!(fields(", ", false, "1 2, 3 ,,4"), ["1", "2", "3", "", "4"]);
        assert_eq!(fields(", ", false, "550,498,  "), ["550", "498", ""]);
        assert_eq!(fields("\t", false, "1\t\t 2\t"), ["1", "", "2", ""]);
        assert_eq!(fields(", \t", true, "1, \t2,,3,"), ["1", "2", "3"]);
        assert!(fields(",", false, "").is_empty());
    }
}
