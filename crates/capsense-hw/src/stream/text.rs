//! Lines of text, as most firmware prints its samples: tables, labelled values, plotter formats.
//!
//! A line that has not the form of a sample is told as text, never as numbers.

use super::decoder::Start;
use super::line::{Delimiters, Fields};
use super::number::{Token, token};
use super::{FormatError, Header, MOST_CHANNELS, Sample, Step, Value, after_start, before_end};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Longest line that can be asked for, in bytes.
const MOST_LINE: usize = 16 * 1024;

/// Lines of text with a sample, or a channel of one, each.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct TextFormat {
    /// Bytes that separate fields. Between two of them lies an empty field, which means a missing value; only spaces
    /// merge.
    pub delimiters: String,
    /// Any run of delimiters counts as one.
    pub merge_delimiters: bool,
    /// What lines with samples begin with; others are text.
    pub prefix: String,
    /// What lines with samples end with.
    pub suffix: String,
    /// Where the values are.
    pub layout: LineLayout,
    /// Labels of the channels in their order, for layouts with labels.
    pub labels: Vec<String>,
    /// Numbers that stand for a missing value.
    pub missing: Vec<f64>,
    /// Words that stand for a value that could not be had, in any case of letters.
    pub invalid: Vec<String>,
    /// Longest line with its end, in bytes; what is longer is passed over.
    pub longest_line: usize,
    /// How many values a line has; `None` for any number.
    #[serde(skip)]
    pub channels: Option<usize>,
}

/// Where a line has its values.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineLayout {
    /// Columns of these kinds.
    Table(Vec<Column>),
    /// Fields `name:value`, as plotters read them; without labels, in the order of the channels.
    Named,
    /// One `name:value` or `name:milliseconds:value` a line, with `§unit` and `|flags` after it: Teleplot.
    Teleplot,
}

/// What a column of a table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Column {
    /// The board's clock in seconds.
    Seconds,
    /// The board's clock in milliseconds.
    Milliseconds,
    /// The board's clock in microseconds.
    Microseconds,
    /// The board's count of samples.
    Sequence,
    /// Of no interest.
    Ignored,
    /// A part of the label that names the line's channel; several are joined by a comma.
    Label,
    /// The value of the line's channel.
    Value,
    /// The values of all channels, a field each.
    Values,
    /// The rest of the line, which may be empty.
    Note,
}

impl Default for TextFormat {
    fn default() -> Self {
        Self {
            delimiters: ", \t".to_owned(),
            merge_delimiters: false,
            prefix: String::new(),
            suffix: String::new(),
            layout: LineLayout::Table(vec![Column::Values]),
            labels: Vec::new(),
            missing: Vec::new(),
            invalid: ["nan", "inf", "ovf", "error"].map(str::to_owned).to_vec(),
            longest_line: 4096,
            channels: None,
        }
    }
}

impl TextFormat {
    pub(super) fn check(&self) -> Result<(), FormatError> {
        if !self.delimiters.is_ascii() || self.delimiters.contains(['\n', '\r']) {
            return Err(FormatError::new("delimiters", "must be ASCII characters other than line ends"));
        }
        if !(2..=MOST_LINE).contains(&self.longest_line) {
            return Err(FormatError::new("longest_line", format!("must be from 2 to {MOST_LINE}")));
        }
        if self.missing.iter().any(|number| !number.is_finite()) {
            return Err(FormatError::new("missing", "must be finite numbers"));
        }
        let labelled = self.layout.one_channel_a_line();
        if (labelled || !self.labels.is_empty()) && self.channels != Some(self.labels.len()) {
            return Err(FormatError::new("labels", "there must be as many as channels"));
        }
        if let LineLayout::Table(columns) = &self.layout {
            let count = |wanted| columns.iter().filter(|column| **column == wanted).count();
            let values = columns.iter().position(|column| *column == Column::Values);
            let last = columns.len() - count(Column::Note);
            if count(Column::Value) + count(Column::Values) != 1 || labelled != (count(Column::Label) > 0) {
                return Err(FormatError::new("layout", "needs either `values`, or `value` and a `label`"));
            }
            if values.is_some_and(|at| at + 1 != last) || columns[last..].iter().any(|c| *c != Column::Note) {
                return Err(FormatError::new(
                    "layout",
                    "only `note` may come after `values`, and nothing after `note`",
                ));
            }
        }
        Ok(())
    }

    /// Appends the lines of a sample.
    pub(super) fn encode(&self, sample: &Sample<'_>, bytes: &mut Vec<u8>) {
        let separator = if self.delimiters.contains(',') || self.delimiters.is_empty() {
            ","
        } else {
            &self.delimiters[..1]
        };
        if !self.layout.one_channel_a_line() {
            bytes.extend_from_slice(self.prefix.as_bytes());
            self.encode_fields(sample, None, separator, bytes);
            bytes.extend_from_slice(self.suffix.as_bytes());
            bytes.push(b'\n');
            return;
        }
        for (channel, value) in sample.values.iter().enumerate().take(self.labels.len()) {
            if *value != Value::Missing {
                bytes.extend_from_slice(self.prefix.as_bytes());
                self.encode_fields(sample, Some(channel), separator, bytes);
                bytes.extend_from_slice(self.suffix.as_bytes());
                bytes.push(b'\n');
            }
        }
    }

    fn encode_fields(
        &self,
        sample: &Sample<'_>,
        channel: Option<usize>,
        separator: &str,
        bytes: &mut Vec<u8>,
    ) {
        let clock = sample.device_time.unwrap_or_default();
        let label = channel.map_or("", |channel| self.labels[channel].as_str());
        let mut parts = label.split(',');
        let fields: Vec<String> = match &self.layout {
            LineLayout::Table(columns) => columns
                .iter()
                .flat_map(|column| match column {
                    Column::Seconds => vec![clock.as_secs_f64().to_string()],
                    Column::Milliseconds => vec![clock.as_millis().to_string()],
                    Column::Microseconds => vec![clock.as_micros().to_string()],
                    Column::Sequence => vec![sample.sequence.unwrap_or(0).to_string()],
                    Column::Ignored => vec!["0".to_owned()],
                    Column::Label => vec![parts.next().unwrap_or_default().to_owned()],
                    Column::Value => vec![self.printed(channel.map_or(Value::Missing, |c| sample.values[c]))],
                    Column::Values => sample.values.iter().map(|value| self.printed(*value)).collect(),
                    Column::Note => Vec::new(),
                })
                .collect(),
            LineLayout::Named => {
                let names = (0..).map(|at: usize| self.labels.get(at).cloned().unwrap_or(format!("C{at}")));
                names
                    .zip(sample.values)
                    .map(|(name, value)| format!("{name}:{}", self.printed(*value)))
                    .collect()
            }
            LineLayout::Teleplot => {
                let value = self.printed(channel.map_or(Value::Missing, |c| sample.values[c]));
                vec![format!("{label}:{}:{value}", clock.as_millis())]
            }
        };
        bytes.extend_from_slice(fields.join(separator).as_bytes());
    }

    /// A value as a field.
    fn printed(&self, value: Value) -> String {
        match value {
            Value::Number(number) => number.to_string(),
            Value::Missing => self.missing.first().map(f64::to_string).unwrap_or_default(),
            Value::Invalid => self.invalid.first().cloned().unwrap_or_else(|| "-".to_owned()),
        }
    }
}

impl LineLayout {
    /// Whether a line holds the value of a single, labelled channel.
    fn one_channel_a_line(&self) -> bool {
        match self {
            Self::Table(columns) => columns.contains(&Column::Value),
            Self::Named => false,
            Self::Teleplot => true,
        }
    }
}

/// Cuts a stream into lines and reads them.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    format: TextFormat,
    delimiters: Delimiters,
    label: Vec<u8>,
    /// Within a line that is too long, or cut: nothing is looked for before its end.
    skipping: bool,
}

impl Lines {
    pub(super) fn new(format: &TextFormat, start: Start) -> Self {
        let mut format = format.clone();
        format.longest_line = format.longest_line.min(MOST_LINE);
        Self {
            delimiters: Delimiters::new(&format.delimiters, format.merge_delimiters),
            label: Vec::with_capacity(format.longest_line),
            format,
            skipping: start == Start::Anywhere,
        }
    }

    pub(super) fn next(&mut self, bytes: &[u8], scanned: usize, values: &mut Vec<Value>) -> Step {
        let limit = if self.skipping { bytes.len() } else { bytes.len().min(self.format.longest_line) };
        let from = scanned.min(limit);
        match memchr::memchr(b'\n', &bytes[from..limit]).map(|at| at + from) {
            Some(at) if std::mem::take(&mut self.skipping) => Step::Discard(at + 1),
            Some(at) => {
                let line = &bytes[..at];
                let line = line.strip_suffix(b"\r").unwrap_or(line);
                match self.sample(line, values) {
                    Some(header) => Step::Sample { length: at + 1, header },
                    None => Step::Text { length: at + 1, shown: line.len() },
                }
            }
            None if self.skipping || limit == self.format.longest_line => {
                self.skipping = true;
                Step::Discard(limit)
            }
            None => Step::Incomplete,
        }
    }

    /// Reads a line; `None` if it has not the form of a sample.
    fn sample(&mut self, line: &[u8], values: &mut Vec<Value>) -> Option<Header> {
        let line = after_start(line.trim_ascii(), self.format.prefix.as_bytes())?;
        let line = before_end(line, self.format.suffix.as_bytes())?;
        values.clear();
        match &self.format.layout {
            LineLayout::Table(columns) => {
                let mut row = Row { format: &self.format, label: &mut self.label, values };
                row.read(columns, self.delimiters.fields(line))
            }
            LineLayout::Named => self.format.named(self.delimiters.fields(line), values),
            LineLayout::Teleplot => self.format.teleplot(line, values),
        }
    }
}

/// A line of a table that is being read.
struct Row<'a> {
    format: &'a TextFormat,
    label: &'a mut Vec<u8>,
    values: &'a mut Vec<Value>,
}

impl Row<'_> {
    fn read(&mut self, columns: &[Column], mut fields: Fields<'_>) -> Option<Header> {
        self.label.clear();
        let mut header = Header::default();
        let mut own = None;
        for column in columns {
            match column {
                Column::Seconds => header.device_time = Some(next_clock(&mut fields, 1.0)?),
                Column::Milliseconds => header.device_time = Some(next_clock(&mut fields, 1e-3)?),
                Column::Microseconds => header.device_time = Some(next_clock(&mut fields, 1e-6)?),
                Column::Sequence => header.sequence = Some(count(fields.next()?)?),
                Column::Ignored if fields.next_plain().is_some() => {}
                Column::Ignored => drop(fields.next()?),
                Column::Label => {
                    if !self.label.is_empty() {
                        self.label.push(b',');
                    }
                    self.label.extend_from_slice(fields.next()?);
                }
                Column::Value => own = Some(self.format.next_value(&mut fields)?),
                Column::Values => self.values(&mut fields)?,
                Column::Note => return self.finish(own, header),
            }
        }
        // A delimiter at the end of a line leaves one empty field too many.
        if fields.next().is_some_and(|spare| !spare.is_empty() || fields.next().is_some()) {
            return None;
        }
        self.finish(own, header)
    }

    fn values(&mut self, fields: &mut Fields<'_>) -> Option<()> {
        let most = self.format.channels.unwrap_or(MOST_CHANNELS);
        while self.values.len() < most {
            match fields.next_plain() {
                Some(number) => self.values.push(self.format.number(number)),
                None => match fields.next() {
                    Some(field) => self.values.push(self.format.value(field)?),
                    None => break,
                },
            }
        }
        let full = self.format.channels.is_none_or(|channels| channels == self.values.len());
        (full && !self.values.is_empty()).then_some(())
    }

    fn finish(&mut self, own: Option<Value>, header: Header) -> Option<Header> {
        if let Some(value) = own {
            self.format.set_labelled(self.label, value, self.values)?;
        }
        Some(header)
    }
}

impl TextFormat {
    /// What a field says; `None` if it is a word of unknown meaning.
    fn value(&self, field: &[u8]) -> Option<Value> {
        if field.is_empty() {
            return Some(Value::Missing);
        }
        match token(field) {
            Token::Number(number) => Some(self.number(number)),
            Token::Malformed => Some(Value::Invalid),
            Token::Word => {
                let known = self.invalid.iter().any(|word| word.as_bytes().eq_ignore_ascii_case(field));
                known.then_some(Value::Invalid)
            }
        }
    }

    /// What the next field says; `None` also where there is none.
    fn next_value(&self, fields: &mut Fields<'_>) -> Option<Value> {
        match fields.next_plain() {
            Some(number) => Some(self.number(number)),
            None => self.value(fields.next()?),
        }
    }

    fn number(&self, number: f64) -> Value {
        if self.missing.contains(&number) { Value::Missing } else { Value::Number(number) }
    }

    /// Sets the value of the channel with a label and leaves the others missing; `None` for an unknown label.
    fn set_labelled(&self, label: &[u8], value: Value, values: &mut Vec<Value>) -> Option<()> {
        let channel = self.labels.iter().position(|known| known.as_bytes() == label)?;
        values.resize(self.labels.len().min(MOST_CHANNELS), Value::Missing);
        *values.get_mut(channel)? = value;
        Some(())
    }

    /// Fields `name:value`, or bare values.
    fn named(&self, fields: Fields<'_>, values: &mut Vec<Value>) -> Option<Header> {
        for field in fields {
            let colon = memchr::memrchr(b':', field);
            let value = self.value(field[colon.map_or(0, |at| at + 1)..].trim_ascii())?;
            match colon {
                Some(at) if !self.labels.is_empty() => {
                    self.set_labelled(field[..at].trim_ascii(), value, values)?
                }
                _ if values.len() < MOST_CHANNELS => values.push(value),
                _ => return None,
            }
        }
        let full = self.channels.is_none_or(|channels| channels == values.len());
        (full && !values.is_empty()).then(Header::default)
    }

    /// `name:value` or `name:milliseconds:value`, then `§unit` and `|flags`; a `>` may come before.
    fn teleplot(&self, line: &[u8], values: &mut Vec<Value>) -> Option<Header> {
        let line = line.strip_prefix(b">").unwrap_or(line);
        let end = memchr::memchr2(b'|', "§".as_bytes()[0], line).unwrap_or(line.len());
        let (name, rest) = split_at_colon(&line[..end])?;
        let (time, value) = match split_at_colon(rest) {
            Some((time, value)) => (Some(clock(time.trim_ascii(), 1e-3)?), value),
            None => (None, rest),
        };
        let value = self.value(value.trim_ascii())?;
        self.set_labelled(name.trim_ascii(), value, values)?;
        Some(Header { device_time: time, ..Header::default() })
    }
}

fn split_at_colon(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let at = memchr::memchr(b':', text)?;
    Some((&text[..at], &text[at + 1..]))
}

/// The clock that the next field shows.
fn next_clock(fields: &mut Fields<'_>, unit: f64) -> Option<Duration> {
    match fields.next_plain() {
        Some(number) => Duration::try_from_secs_f64(number * unit).ok(),
        None => clock(fields.next()?, unit),
    }
}

fn clock(field: &[u8], unit: f64) -> Option<Duration> {
    match token(field) {
        Token::Number(number) => Duration::try_from_secs_f64(number * unit).ok(),
        Token::Malformed | Token::Word => None,
    }
}

fn count(field: &[u8]) -> Option<u32> {
    std::str::from_utf8(field).ok()?.parse().ok()
}
