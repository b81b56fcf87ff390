//! Where in a scene file each key stands, so that every complaint names file, line and key.

use super::raw::RawScene;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use toml::de::{DeTable, DeValue};

/// Why a scene file is refused.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file itself cannot be read.
    #[error("{}: cannot read the scene: {error}", path.display())]
    Read {
        /// Path of the scene file.
        path: PathBuf,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// Something in a scene file, or in a file that it names, is wrong.
    #[error("{file}:{line}: {}{message}", key.as_ref().map(|key| format!("{key}: ")).unwrap_or_default())]
    Invalid {
        /// The file as the user named it.
        file: String,
        /// Line in it, counted from one.
        line: usize,
        /// Dotted key, or column of a table.
        key: Option<String>,
        /// What is wrong.
        message: String,
    },
}

/// A scene file's name and the lines of its keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    file: String,
    lines: BTreeMap<String, usize>,
}

impl Source {
    /// Parses a scene file and remembers where its keys are.
    pub(super) fn parse(file: &str, text: &str) -> Result<(Self, RawScene), SceneError> {
        let (table, errors) = DeTable::parse_recoverable(text);
        let mut places = Vec::new();
        collect(table.get_ref(), "", &mut places);
        let lines = LineIndex::new(text);
        let source = Self {
            file: file.to_owned(),
            lines: places.iter().rev().map(|place| (place.key.clone(), lines.of(place.spot.start))).collect(),
        };
        let parsed = match errors.into_iter().next() {
            Some(error) => Err(error),
            None => toml::from_str(text),
        };
        match parsed {
            Ok(raw) => Ok((source, raw)),
            Err(error) => {
                let at = error.span().unwrap_or(0..0);
                let line = lines.of(at.start);
                let key = key_around(&places, &at)
                    .or_else(|| source.first_key_of_line(line))
                    .or_else(|| repeated_key(&places, text, &at));
                Err(SceneError::Invalid { file: source.file, line, key, message: one_line(error.message()) })
            }
        }
    }

    /// The file as the user named it.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The line of a key, or of the nearest table around it.
    pub fn line(&self, key: &str) -> usize {
        let mut key = key;
        loop {
            match (self.lines.get(key), key.rfind(['.', '['])) {
                (Some(&line), _) => return line,
                (None, Some(end)) => key = &key[..end],
                (None, None) => return 1,
            }
        }
    }

    /// Whether the file has a key.
    pub(super) fn names(&self, key: &str) -> bool {
        self.lines.contains_key(key)
    }

    /// A complaint about a key.
    pub fn error(&self, key: &str, message: impl Into<String>) -> SceneError {
        SceneError::Invalid {
            file: self.file.clone(),
            line: self.line(key),
            key: Some(key.to_owned()),
            message: message.into(),
        }
    }

    fn first_key_of_line(&self, line: usize) -> Option<String> {
        let mut keys = self.lines.iter().filter(|(_, at)| **at == line);
        keys.next().map(|(key, _)| key.clone())
    }
}

/// A key, where it is named, and where its value is.
struct Place {
    key: String,
    spot: Range<usize>,
    value: Range<usize>,
}

fn collect(table: &DeTable<'_>, prefix: &str, places: &mut Vec<Place>) {
    for (name, value) in table {
        let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let name_text = name.get_ref();
        let segment = if !name_text.is_empty() && name_text.chars().all(bare) {
            name_text.to_string()
        } else {
            format!("{name_text:?}")
        };
        let key = if prefix.is_empty() { segment } else { format!("{prefix}.{segment}") };
        collect_value(key, name.span(), value.span(), value.get_ref(), places);
    }
}

fn collect_value(
    key: String,
    spot: Range<usize>,
    span: Range<usize>,
    value: &DeValue<'_>,
    places: &mut Vec<Place>,
) {
    match value {
        DeValue::Table(table) => collect(table, &key, places),
        DeValue::Array(elements) => {
            for (index, element) in elements.iter().enumerate() {
                let (key, span) = (format!("{key}[{index}]"), element.span());
                collect_value(key, span.clone(), span, element.get_ref(), places);
            }
        }
        _ => {}
    }
    places.push(Place { key, spot, value: span });
}

/// The innermost key whose name or value holds a span.
fn key_around(places: &[Place], span: &Range<usize>) -> Option<String> {
    let holds = |range: &Range<usize>| range.start <= span.start && span.end <= range.end;
    places
        .iter()
        .flat_map(|place| [(&place.spot, &place.key), (&place.value, &place.key)])
        .filter(|(range, _)| holds(range))
        .min_by_key(|(range, key)| (range.len(), std::cmp::Reverse(key.len())))
        .map(|(_, key)| key.clone())
}

/// A key that is given twice is known by its neighbour before it in the same table.
fn repeated_key(places: &[Place], text: &str, span: &Range<usize>) -> Option<String> {
    let name = text.get(span.clone())?.trim();
    let before = places.iter().filter(|place| place.spot.start < span.start);
    let neighbour = before.max_by_key(|place| place.spot.start)?;
    let table = neighbour.key.rfind('.').map_or("", |end| &neighbour.key[..=end]);
    let key = format!("{table}{name}");
    places.iter().any(|place| place.key == key).then_some(key)
}

/// Byte offsets to lines.
struct LineIndex {
    starts: Vec<usize>,
}

impl LineIndex {
    fn new(text: &str) -> Self {
        let after_breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        Self { starts: std::iter::once(0).chain(after_breaks).collect() }
    }

    fn of(&self, offset: usize) -> usize {
        self.starts.partition_point(|&start| start <= offset).max(1)
    }
}

/// Parser messages come on several lines; ours stand on one.
fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
