//! TOML tables with typed, range-checked keys; errors contain line, key and value.

use std::ops;
use std::path::Path;

use toml_edit::{Array, Item, TableLike, Value};

use super::suggestion;
use crate::{Material, ReadError};

/// The text of a scene file, for error messages.
pub(super) struct Source<'a> {
    path: &'a Path,
    text: &'a str,
    /// Byte offset of each line.
    line_starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        let after = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n').map(|(at, _)| at + 1);
        Self { path, text, line_starts: std::iter::once(0).chain(after).collect() }
    }

    /// An error at a byte offset.
    pub(super) fn error(&self, at: usize, message: impl Into<String>) -> ReadError {
        error_at(self.path, self.line(at), message)
    }

    /// Line number of a byte offset, from 1.
    fn line(&self, at: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= at)
    }

    /// The source text of a span, shortened to one line.
    pub(super) fn quote(&self, span: Option<ops::Range<usize>>) -> String {
        const MAX_CHARS: usize = 60;
        let text = span.and_then(|span| self.text.get(span)).unwrap_or("(unknown)").trim();
        let short: String = text.chars().take_while(|&c| c != '\n').take(MAX_CHARS).collect();
        let more = if short.len() < text.len() { " ..." } else { "" };
        format!("{}{more}", short.trim_end())
    }
}

/// An error in a line of a scene file.
pub(super) fn error_at(path: &Path, line: usize, message: impl Into<String>) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// Range of legal numbers.
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
    /// From 0 to 180, both included.
    ConeAngle,
}

impl Bounds {
    fn contains(self, x: f64) -> bool {
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

    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::NotNegative => "0 or more",
            Self::Positive => "greater than 0",
            Self::Fraction => "from 0 to 1",
            Self::Ior => "from 1 to 1000",
            Self::FieldOfView => "between 0 and 180",
            Self::ConeAngle => "from 0 to 180",
        }
    }
}

/// A table with its location in the source.
#[derive(Clone)]
pub(super) struct Table<'a> {
    source: &'a Source<'a>,
    /// Name used in messages.
    name: String,
    items: &'a dyn TableLike,
    at: usize,
}

impl<'a> Table<'a> {
    /// The root table.
    pub(super) fn root(source: &'a Source<'a>, items: &'a dyn TableLike) -> Self {
        Self { source, name: "the file".to_owned(), items, at: 0 }
    }

    pub(super) fn line(&self) -> usize {
        self.source.line(self.at)
    }

    /// Sets the name used in messages.
    pub(super) fn with_name(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Rejects keys that are not in `known`.
    pub(super) fn check_keys(&self, known: &[&str]) -> Result<(), ReadError> {
        let Some((key, _)) = self.items.iter().find(|(key, _)| !known.contains(key)) else { return Ok(()) };
        let near = suggestion(key, known.iter().copied());
        let near = if near.is_empty() { format!("; the keys are {}", known.join(", ")) } else { near };
        let message = format!("unknown key '{}' in {}{near}", key.escape_debug(), self.name);
        Err(self.source.error(self.key_at(key), message))
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.items.contains_key(key)
    }

    /// The keys in order, with their lines.
    pub(super) fn keys(&self) -> impl Iterator<Item = (&'a str, usize)> + '_ {
        self.items.iter().map(|(key, _)| (key, self.source.line(self.key_at(key))))
    }

    /// Unwraps a required value.
    pub(super) fn required<T>(&self, key: &str, value: Option<T>) -> Result<T, ReadError> {
        value.ok_or_else(|| self.source.error(self.at, format!("missing key '{key}' in {}", self.name)))
    }

    /// An error at a key, or at the table if the key is absent.
    pub(super) fn error(&self, key: &str, message: impl Into<String>) -> ReadError {
        self.source.error(self.key_at(key), message)
    }

    /// The value of a key is missing or is not what is expected.
    pub(super) fn invalid(&self, key: &str, expected: &str) -> ReadError {
        let Some(item) = self.items.get(key) else {
            return self.error(key, format!("missing key '{key}' in {}: expected {expected}", self.name));
        };
        let value = self.source.quote(item.span());
        self.error(key, format!("invalid value {value} for '{key}' in {}: expected {expected}", self.name))
    }

    pub(super) fn number(&self, key: &str, bounds: Bounds) -> Result<Option<f32>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let number = self.to_f32(value).filter(|&x| bounds.contains(x.into()));
        number.map(Some).ok_or_else(|| self.invalid(key, &format!("a number ({})", bounds.description())))
    }

    /// A number in double precision.
    pub(super) fn number_f64(&self, key: &str, bounds: Bounds) -> Result<Option<f64>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let number = to_f64(value).filter(|&x| bounds.contains(x));
        number.map(Some).ok_or_else(|| self.invalid(key, &format!("a number ({})", bounds.description())))
    }

    pub(super) fn numbers<const N: usize>(&self, key: &str, bounds: Bounds) -> Result<Option<[f32; N]>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let numbers = value.as_array().and_then(|array| self.array(array, bounds));
        numbers
            .map(Some)
            .ok_or_else(|| self.invalid(key, &format!("an array of {N} numbers ({})", bounds.description())))
    }

    /// A matrix of `M` rows.
    pub(super) fn rows<const N: usize, const M: usize>(&self, key: &str) -> Result<Option<[[f32; N]; M]>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        let read = || {
            let rows: Option<Vec<[f32; N]>> =
                value.as_array()?.iter().map(|row| self.array(row.as_array()?, Bounds::Finite)).collect();
            <[[f32; N]; M]>::try_from(rows?).ok()
        };
        read().map(Some).ok_or_else(|| self.invalid(key, &format!("{M} rows of {N} finite numbers each")))
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        value.as_str().map(Some).ok_or_else(|| self.invalid(key, "a string"))
    }

    /// A nonempty file name.
    pub(super) fn file(&self, key: &str) -> Result<Option<&'a str>, ReadError> {
        match self.text(key)? {
            Some(name) if name.trim().is_empty() => Err(self.invalid(key, "a file name")),
            name => Ok(name),
        }
    }

    pub(super) fn flag(&self, key: &str) -> Result<Option<bool>, ReadError> {
        let Some(value) = self.value(key)? else { return Ok(None) };
        value.as_bool().map(Some).ok_or_else(|| self.invalid(key, "true or false"))
    }

    /// The index of a string in `words`.
    pub(super) fn choice(&self, key: &str, words: &[&str]) -> Result<Option<usize>, ReadError> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        let found = words.iter().position(|&word| word == text);
        found.map(Some).ok_or_else(|| {
            let near = suggestion(text, words.iter().copied());
            self.invalid(key, &format!("one of {}{near}", words.join(", ")))
        })
    }

    /// A number, a string or an array of them, in the syntax of a command line option.
    pub(super) fn option_value(&self, key: &str) -> Result<String, ReadError> {
        let one = |value: &Value| match value {
            Value::String(text) => Some(text.value().clone()),
            // Normalizes 0x10 and 1_000.
            Value::Integer(number) => Some(number.value().to_string()),
            Value::Float(_) => Some(self.raw(value)),
            _ => None,
        };
        let value = self.value(key)?;
        let word = value.and_then(|value| match value {
            Value::Array(array) => array.iter().map(one).collect::<Option<Vec<_>>>().map(|words| words.join(",")),
            value => one(value),
        });
        word.ok_or_else(|| self.invalid(key, "a number, a string, or an array of them"))
    }

    /// The table at a key.
    pub(super) fn table(&self, key: &str) -> Result<Option<Self>, ReadError> {
        let Some(item) = self.items.get(key) else { return Ok(None) };
        let items = item.as_table_like().ok_or_else(|| self.invalid(key, &format!("a table [{key}]")))?;
        Ok(Some(self.inner(format!("[{key}]"), items, item.span(), key)))
    }

    /// The array of tables at a key; `None` if absent.
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
        tables.map(Some).ok_or_else(|| self.invalid(key, &format!("an array of tables {name}")))
    }

    fn inner(&self, name: String, items: &'a dyn TableLike, span: Option<ops::Range<usize>>, key: &str) -> Self {
        Self { source: self.source, name, items, at: span.map_or_else(|| self.key_at(key), |span| span.start) }
    }

    /// Byte offset of a key, or of the table if the key is absent.
    fn key_at(&self, key: &str) -> usize {
        let span = self.items.get_key_value(key).and_then(|(key, item)| key.span().or_else(|| item.span()));
        span.map_or(self.at, |span| span.start)
    }

    /// The value of a key that is not a table.
    fn value(&self, key: &str) -> Result<Option<&'a Value>, ReadError> {
        let Some(item) = self.items.get(key) else { return Ok(None) };
        item.as_value().map(Some).ok_or_else(|| {
            self.error(key, format!("invalid value for '{key}' in {}: expected a value, found a table", self.name))
        })
    }

    fn array<const N: usize>(&self, array: &Array, bounds: Bounds) -> Option<[f32; N]> {
        let numbers: Option<Vec<f32>> = array.iter().map(|value| self.to_f32(value)).collect();
        let numbers = <[f32; N]>::try_from(numbers?).ok()?;
        numbers.iter().all(|&x| bounds.contains(x.into())).then_some(numbers)
    }

    /// The closest `f32`, rounded once from the digits rather than from an `f64`.
    fn to_f32(&self, value: &Value) -> Option<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "only for syntax that `f32::from_str` rejects")]
        to_f64(value).map(|number| self.raw(value).parse().unwrap_or(number as f32))
    }

    /// The source text of a number without underscores.
    fn raw(&self, value: &Value) -> String {
        let text = value.span().and_then(|span| self.source.text.get(span)).unwrap_or_default();
        text.replace('_', "")
    }
}

#[expect(clippy::cast_precision_loss, reason = "numbers are rounded to f32 in the end")]
fn to_f64(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}
