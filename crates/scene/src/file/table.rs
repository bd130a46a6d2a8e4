//! Tables of a scene file: keys with types and ranges, and errors that name line, key and value.

use std::ops;
use std::path::Path;

use toml_edit::{Array, Item, TableLike, Value};

use super::closest_match;
use crate::{Material, ReadError};

/// The text of a scene file, for messages.
pub(super) struct Source<'a> {
    path: &'a Path,
    text: &'a str,
    /// Byte at which each line begins.
    line_starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        let after = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n').map(|(at, _)| at + 1);
        Self { path, text, line_starts: std::iter::once(0).chain(after).collect() }
    }

    /// A breach of the rules at a byte.
    pub(super) fn error(&self, at: usize, message: impl Into<String>) -> ReadError {
        error_at(self.path, self.line(at), message)
    }

    /// Number of the line of a byte, from 1.
    fn line(&self, at: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= at)
    }

    /// What stands there, shortened to one line.
    pub(super) fn quote(&self, span: Option<ops::Range<usize>>) -> String {
        const MAX_CHARS: usize = 60;
        let text = span.and_then(|span| self.text.get(span)).unwrap_or("something else").trim();
        let short: String = text.chars().take_while(|&c| c != '\n').take(MAX_CHARS).collect();
        let more = if short.len() < text.len() { " ..." } else { "" };
        format!("{}{more}", short.trim_end())
    }
}

/// A breach of the rules in a line of a scene file.
pub(super) fn error_at(path: &Path, line: usize, message: impl Into<String>) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// Which numbers are legal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bounds {
    Finite,
    NotNegative,
    Positive,
    Fraction,
    /// From 1 to [`Material::MAX_IOR`].
    Ior,
    /// Between 0 and 180, both excluded.
    FieldOfView,
    /// Between axis and side of a cone.
    ConeAngle,
}

impl Bounds {
    fn holds(self, x: f64) -> bool {
        x.is_finite()
            && match self {
                Self::Finite => true,
                Self::NotNegative => x >= 0.0,
                Self::Positive => x > 0.0,
                Self::Fraction => (0.0..=1.0).contains(&x),
                Self::Ior => (1.0..=f64::from(Material::MAX_IOR)).contains(&x),
                Self::FieldOfView => x > 0.0 && x < 180.0,
                Self::ConeAngle => (0.0..=180.0).contains(&x),
            }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::NotNegative => "0 or more",
            Self::Positive => "above 0",
            Self::Fraction => "from 0 to 1",
            Self::Ior => "from 1 to 1000",
            Self::FieldOfView => "an angle between 0 and 180",
            Self::ConeAngle => "an angle from 0 to 180",
        }
    }
}

/// A table that knows where it stands.
#[derive(Clone)]
pub(super) struct Table<'a> {
    source: &'a Source<'a>,
    /// What it is called in messages.
    name: String,
    items: &'a dyn TableLike,
    at: usize,
}

impl<'a> Table<'a> {
    /// The table of everything.
    pub(super) fn root(source: &'a Source<'a>, items: &'a dyn TableLike) -> Self {
        Self { source, name: "the file".to_owned(), items, at: 0 }
    }

    pub(super) fn line(&self) -> usize {
        self.source.line(self.at)
    }

    /// Another name for messages.
    pub(super) fn called(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Refuses keys that are none of `known`.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), ReadError> {
        let Some((key, _)) = self.items.iter().find(|(key, _)| !known.contains(key)) else { return Ok(()) };
        let near = closest_match(key, known.iter().copied()).unwrap_or_default();
        let message = format!("{} has no key `{}`; the nearest is `{near}`", self.name, key.escape_debug());
        Err(self.source.error(self.key_at(key), message))
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.items.contains_key(key)
    }

    /// The keys in their order, each with its line.
    pub(super) fn keys(&self) -> impl Iterator<Item = (&'a str, usize)> + '_ {
        self.items.iter().map(|(key, _)| (key, self.source.line(self.key_at(key))))
    }

    /// A value that must be there.
    pub(super) fn required<T>(&self, key: &str, value: Option<T>) -> Result<T, ReadError> {
        value.ok_or_else(|| self.source.error(self.at, format!("{} lacks `{key}`", self.name)))
    }

    /// Something is wrong about a key, or about the whole where the key is not there.
    pub(super) fn error(&self, key: &str, message: impl Into<String>) -> ReadError {
        self.source.error(self.key_at(key), message)
    }

    /// The value of a key is not what it should be.
    pub(super) fn refuse(&self, key: &str, wanted: &str) -> ReadError {
        let Some(item) = self.items.get(key) else {
            return self.error(key, format!("{} needs `{key}`, {wanted}", self.name));
        };
        self.error(key, format!("`{key}` of {} is {}, not {wanted}", self.name, self.source.quote(item.span())))
    }

    pub(super) fn number(&self, key: &str, bounds: Bounds) -> Result<Option<f32>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let number = self.to_f32(value).filter(|&x| bounds.holds(x.into()));
        number.map(Some).ok_or_else(|| self.refuse(key, &format!("a number, {}", bounds.words())))
    }

    /// A number that is computed with before it is rounded.
    pub(super) fn number_f64(&self, key: &str, bounds: Bounds) -> Result<Option<f64>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let number = to_f64(value).filter(|&x| bounds.holds(x));
        number.map(Some).ok_or_else(|| self.refuse(key, &format!("a number, {}", bounds.words())))
    }

    pub(super) fn numbers<const N: usize>(&self, key: &str, bounds: Bounds) -> Result<Option<[f32; N]>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let numbers = value.as_array().and_then(|array| self.array(array, bounds));
        numbers.map(Some).ok_or_else(|| self.refuse(key, &format!("{N} numbers in brackets, {}", bounds.words())))
    }

    /// Rows of numbers.
    pub(super) fn rows<const N: usize, const M: usize>(&self, key: &str) -> Result<Option<[[f32; N]; M]>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let read = || {
            let rows: Option<Vec<[f32; N]>> =
                value.as_array()?.iter().map(|row| self.array(row.as_array()?, Bounds::Finite)).collect();
            <[[f32; N]; M]>::try_from(rows?).ok()
        };
        read().map(Some).ok_or_else(|| self.refuse(key, &format!("{M} rows of {N} finite numbers each")))
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        value.as_str().map(Some).ok_or_else(|| self.refuse(key, "a text in quotes"))
    }

    /// The name of a file.
    pub(super) fn file(&self, key: &str) -> Result<Option<&'a str>, ReadError> {
        match self.text(key)? {
            Some(name) if name.trim().is_empty() => Err(self.refuse(key, "the name of a file")),
            name => Ok(name),
        }
    }

    pub(super) fn flag(&self, key: &str) -> Result<Option<bool>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        value.as_bool().map(Some).ok_or_else(|| self.refuse(key, "true or false"))
    }

    /// One of several words, by its position among them.
    pub(super) fn choice(&self, key: &str, words: &[&str]) -> Result<Option<usize>, ReadError> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        let found = words.iter().position(|&word| word == text);
        found.map(Some).ok_or_else(|| {
            let near = closest_match(text, words.iter().copied()).unwrap_or_default();
            self.refuse(key, &format!("one of {}; the nearest is {near}", words.join(", ")))
        })
    }

    /// A number, a text or a list of them as an option of the command line would say it.
    pub(super) fn word(&self, key: &str) -> Result<String, ReadError> {
        let one = |value: &Value| match value {
            Value::String(text) => Some(text.value().clone()),
            // However it is written: 0x10 and 1_000 are whole numbers too.
            Value::Integer(number) => Some(number.value().to_string()),
            Value::Float(_) => Some(self.raw(value)),
            _ => None,
        };
        let value = self.value(key)?;
        let word = value.and_then(|value| match value {
            Value::Array(array) => array.iter().map(one).collect::<Option<Vec<_>>>().map(|words| words.join(",")),
            value => one(value),
        });
        word.ok_or_else(|| self.refuse(key, "a number, a text, or a list of them"))
    }

    /// The table behind a key.
    pub(super) fn table(&self, key: &str) -> Result<Option<Self>, ReadError> {
        let Some(item) = self.items.get(key) else { return Ok(None) };
        let items = item.as_table_like().ok_or_else(|| self.refuse(key, &format!("a table, [{key}]")))?;
        Ok(Some(self.inner(format!("[{key}]"), items, item.span(), key)))
    }

    /// The tables of a list; `None` where the key is not there.
    pub(super) fn tables(&self, key: &str) -> Result<Option<Vec<Self>>, ReadError> {
        let Some(item) = self.items.get(key) else { return Ok(None) };
        let name = format!("[[{key}]]");
        let tables: Option<Vec<Self>> = match item {
            Item::ArrayOfTables(tables) => {
                Some(tables.iter().map(|table| self.inner(name.clone(), table, table.span(), key)).collect())
            }
            Item::Value(Value::Array(array)) => array
                .iter()
                .map(|value| Some(self.inner(name.clone(), value.as_inline_table()?, value.span(), key)))
                .collect(),
            _ => None,
        };
        tables.map(Some).ok_or_else(|| self.refuse(key, &format!("a list of tables, {name}")))
    }

    fn inner(&self, name: String, items: &'a dyn TableLike, span: Option<ops::Range<usize>>, key: &str) -> Self {
        Self { source: self.source, name, items, at: span.map_or_else(|| self.key_at(key), |span| span.start) }
    }

    /// Where a key stands, else where the table begins.
    fn key_at(&self, key: &str) -> usize {
        let span = self.items.get_key_value(key).and_then(|(key, item)| key.span().or_else(|| item.span()));
        span.map_or(self.at, |span| span.start)
    }

    /// The plain value of a key.
    fn value(&self, key: &str) -> Result<Option<&'a Value>, ReadError> {
        let Some(item) = self.items.get(key) else { return Ok(None) };
        item.as_value()
            .map(Some)
            .ok_or_else(|| self.error(key, format!("`{key}` of {} is a table, not a value", self.name)))
    }

    fn array<const N: usize>(&self, array: &Array, bounds: Bounds) -> Option<[f32; N]> {
        let numbers: Option<Vec<f32>> = array.iter().map(|value| self.to_f32(value)).collect();
        let numbers = <[f32; N]>::try_from(numbers?).ok()?;
        numbers.iter().all(|&x| bounds.holds(x.into())).then_some(numbers)
    }

    /// The nearest `f32`, rounded once: from the digits, not from an `f64`.
    fn to_f32(&self, value: &Value) -> Option<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "only of forms that the plain parser does not know")]
        to_f64(value).map(|number| self.raw(value).parse().unwrap_or(number as f32))
    }

    /// The digits of a number.
    fn raw(&self, value: &Value) -> String {
        let text = value.span().and_then(|span| self.source.text.get(span)).unwrap_or_default();
        text.replace('_', "")
    }
}

#[expect(clippy::cast_precision_loss, reason = "numbers are rounded to f32 in the end")]
fn to_f64(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}
