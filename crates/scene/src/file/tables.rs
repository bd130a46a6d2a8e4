//! Tables of a scene file as types: serde over the values that `toml` parses with their spans.
//!
//! Errors contain line, table, key and value. A `f32` is rounded once, from its digits.

use std::{marker::PhantomData, ops, path::Path};

use canted_obb::vector::{dot, normalized, to_f32, to_f64};
use serde::{
    Deserialize, Deserializer,
    de::{self, IntoDeserializer, SeqAccess, Unexpected, Visitor, value::StrDeserializer},
    forward_to_deserialize_any,
};
use serde_spanned::{
    Spanned,
    de::{SpannedDeserializer, is_spanned},
};
use toml::de::{DeInteger, DeString, DeTable, DeValue};

use crate::{Material, ReadError};

/// The candidate with the smallest edit distance to `word`, the first one on ties, if the distance is at most a third of
/// the longer of the two words: more is another word, and no misspelling.
///
/// ```
/// use canted_scene::closest_match;
///
/// assert_eq!(closest_match("raduis", ["axis", "radius"]), Some("radius"));
/// assert_eq!(closest_match("diameter", ["axis", "radius"]), None);
/// ```
pub fn closest_match<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let n = |text: &str| text.chars().count();
    candidates
        .into_iter()
        .map(|candidate| (strsim::levenshtein(word, candidate), candidate))
        .min_by_key(|&(distance, _)| distance)
        .filter(|&(distance, candidate)| 3 * distance <= n(word).max(n(candidate)))
        .map(|(_, candidate)| candidate)
}

/// The end of a message about an unknown word: `; did you mean 'radius'?`, or nothing.
///
/// ```
/// use canted_scene::suggestion;
///
/// assert_eq!(suggestion("raduis", ["axis", "radius"]), "; did you mean 'radius'?");
/// assert_eq!(suggestion("diameter", ["axis", "radius"]), "");
/// ```
pub fn suggestion<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    closest_match(word, candidates).map(|near| format!("; did you mean '{near}'?")).unwrap_or_default()
}

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

    /// The content of the file as `T`.
    pub(super) fn read<T: de::DeserializeOwned>(&self) -> Result<T, ReadError> {
        let document = DeTable::parse(self.text).map_err(|error| {
            let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
            let key =
                error.span().filter(|_| message == "duplicate key").map(|span| format!(" '{}'", self.quote(span)));
            self.error(error.span().map_or(0, |span| span.start), message + &key.unwrap_or_default())
        })?;
        let root = Table {
            source: self,
            items: document.get_ref(),
            start: 0,
            path: String::new(),
            name: "the file".to_owned(),
        };
        root.read(|rows| T::deserialize(de::value::MapAccessDeserializer::new(rows))).map_err(|problem| match problem {
            Problem::At(at, message) => self.error(at, message),
            other => self.error(0, other.to_string()),
        })
    }

    /// An error at a byte offset.
    pub(super) fn error(&self, at: usize, message: impl Into<String>) -> ReadError {
        error_at(self.path, self.line(at), message)
    }

    /// The error of a value that contradicts other keys of its table.
    pub(super) fn invalid<T>(&self, value: &Spanned<T>, key: &str, table: &str, expected: &str) -> ReadError {
        self.error(value.span().start, self.message(value.span(), key, table, expected))
    }

    fn message(&self, span: ops::Range<usize>, key: &str, table: &str, expected: &str) -> String {
        format!("invalid value {} for '{key}' in {table}: expected {expected}", self.quote(span))
    }

    /// Line number of a byte offset, from 1.
    pub(super) fn line(&self, at: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= at)
    }

    /// The source text of a span, shortened to one line.
    fn quote(&self, span: ops::Range<usize>) -> String {
        const MAX_CHARS: usize = 60;
        let text = self.text.get(span).unwrap_or("(unknown)").trim();
        let short: String = text.chars().take_while(|&c| c != '\n').take(MAX_CHARS).collect();
        let more = if short.len() < text.len() { " ..." } else { "" };
        format!("{}{more}", short.trim_end())
    }
}

/// An error in a line of a scene file.
pub(super) fn error_at(path: &Path, line: usize, message: impl Into<String>) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// What is wrong with a value. Tables add key, name and place.
#[derive(Debug)]
pub(super) enum Problem {
    /// What a value must be.
    Expected(String),
    /// A key that its table does not have, and those that it has.
    UnknownKey(String, Vec<&'static str>),
    MissingKey(String),
    /// A byte offset and the whole message.
    At(usize, String),
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (Self::Expected(text) | Self::UnknownKey(text, _) | Self::MissingKey(text) | Self::At(_, text)) = self;
        f.write_str(text)
    }
}

impl std::error::Error for Problem {}

fn expected(what: &str) -> Problem {
    Problem::Expected(what.to_owned())
}

impl de::Error for Problem {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self::Expected(message.to_string())
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::Expected(expected.to_string())
    }

    fn invalid_value(_: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::Expected(expected.to_string())
    }

    fn invalid_length(_: usize, expected: &dyn de::Expected) -> Self {
        Self::Expected(expected.to_string())
    }

    fn unknown_variant(variant: &str, known: &'static [&'static str]) -> Self {
        Self::Expected(format!("one of {}{}", known.join(", "), suggestion(variant, known.iter().copied())))
    }

    fn unknown_field(field: &str, known: &'static [&'static str]) -> Self {
        Self::UnknownKey(field.to_owned(), known.to_vec())
    }

    fn missing_field(field: &'static str) -> Self {
        Self::MissingKey(field.to_owned())
    }
}

/// A table with its place in the source.
struct Table<'a> {
    source: &'a Source<'a>,
    items: &'a DeTable<'a>,
    start: usize,
    /// Its keys, separated by dots; empty for the root.
    path: String,
    /// Name in messages.
    name: String,
}

impl<'a> Table<'a> {
    /// Reads the table with a function, and gives its errors a place. What does not depend on `T` is apart, so that it is compiled
    /// once.
    fn read<T>(&self, read: impl FnOnce(Rows<'_, 'a>) -> Result<T, Problem>) -> Result<T, Problem> {
        read(self.rows()).map_err(|problem| self.placed(problem))
    }

    /// The keys in the order of the file.
    fn rows(&self) -> Rows<'_, 'a> {
        let mut rows: Vec<_> = self.items.iter().collect();
        rows.sort_by_key(|(key, _)| key.span().start);
        Rows { table: self, rows: rows.into_iter(), value: None }
    }

    /// An error with its place.
    fn placed(&self, problem: Problem) -> Problem {
        let Self { source, items, start, name, .. } = self;
        match problem {
            Problem::UnknownKey(key, known) => {
                let near = suggestion(&key, known.iter().copied());
                let near = if near.is_empty() { format!("; the keys are {}", known.join(", ")) } else { near };
                let at = items.get_key_value(&key[..]).map_or(*start, |(key, _)| key.span().start);
                Problem::At(at, format!("unknown key '{}' in {name}{near}", key.escape_debug()))
            }
            Problem::MissingKey(key) => Problem::At(*start, format!("missing key '{key}' in {name}")),
            Problem::Expected(message) => Problem::At(*start, format!("{name}: {message}")),
            Problem::At(at, message) => {
                debug_assert!(source.text.len() >= at, "{message}");
                Problem::At(at, message)
            }
        }
    }

    /// The value of a key, read by `read`; an error states the key.
    fn value<T>(&self, row: Row<'a>, read: impl FnOnce(Value<'a>) -> Result<T, Problem>) -> Result<T, Problem> {
        read(self.value_of(row)).map_err(|problem| self.keyed(row, problem))
    }

    fn value_of(&self, (key, value): Row<'a>) -> Value<'a> {
        let name = key.get_ref();
        let path = if self.path.is_empty() { name.to_string() } else { format!("{}.{name}", self.path) };
        Value { source: self.source, value, path, is_element: false }
    }

    /// An error with its key.
    fn keyed(&self, (key, value): Row<'a>, problem: Problem) -> Problem {
        match problem {
            Problem::Expected(expected) => {
                Problem::At(key.span().start, self.source.message(value.span(), key.get_ref(), &self.name, &expected))
            }
            other => other,
        }
    }
}

/// A key and its value.
type Row<'a> = (&'a Spanned<DeString<'a>>, &'a Spanned<DeValue<'a>>);

/// The keys of a table that are still to be read, with their values.
struct Rows<'t, 'a> {
    table: &'t Table<'a>,
    rows: std::vec::IntoIter<Row<'a>>,
    value: Option<Row<'a>>,
}

impl<'de> de::MapAccess<'de> for Rows<'_, '_> {
    type Error = Problem;

    fn next_key_seed<S: de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Problem> {
        self.value = self.rows.next();
        let key = self.value.map(|(key, _)| StrDeserializer::new(key.get_ref()));
        key.map(|key| seed.deserialize(key)).transpose()
    }

    fn next_value_seed<S: de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Problem> {
        let row = self.value.take().ok_or_else(|| expected("a key before its value"))?;
        self.table.value(row, |value| seed.deserialize(value))
    }
}

/// A value with its place in the source.
struct Value<'a> {
    source: &'a Source<'a>,
    value: &'a Spanned<DeValue<'a>>,
    /// Its keys, separated by dots.
    path: String,
    /// Whether it is in an array.
    is_element: bool,
}

impl<'a> Value<'a> {
    /// The name of a table in messages.
    fn name(&self) -> String {
        if self.is_element { format!("[[{}]]", self.path) } else { format!("[{}]", self.path) }
    }

    fn table(&self) -> Result<Table<'a>, Problem> {
        let Some(items) = self.value.get_ref().as_table() else {
            let what = if self.is_element { "an array of tables" } else { "a table" };
            return Err(Problem::Expected(format!("{what} {}", self.name())));
        };
        let (source, start, path, name) = (self.source, self.value.span().start, self.path.clone(), self.name());
        Ok(Table { source, items, start, path, name })
    }

    /// A number in double precision.
    fn number(&self) -> Option<f64> {
        match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => self.integer(integer).map(|n| n as f64),
            _ => None,
        }
    }

    fn integer(&self, integer: &DeInteger<'_>) -> Option<i64> {
        i64::from_str_radix(integer.as_str(), integer.radix()).ok()
    }

    /// The closest `f32`, rounded once from the digits rather than from an `f64`.
    fn number_f32(&self) -> Option<f32> {
        let digits = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str(),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
            _ => "",
        };
        self.number().map(|wide| digits.parse().unwrap_or(wide as f32))
    }

    /// A number, a string or an array of them, in the syntax of an option of the command line.
    fn option_text(&self) -> Option<String> {
        match self.value.get_ref() {
            DeValue::String(text) => Some(text.to_string()),
            DeValue::Float(float) => Some(float.as_str().to_owned()),
            // Normalizes 0x10.
            DeValue::Integer(integer) => self.integer(integer).map(|n| n.to_string()),
            DeValue::Array(array) if !self.is_element => {
                let words: Option<Vec<String>> = array.iter().map(|value| self.element(value).option_text()).collect();
                Some(words?.join(","))
            }
            _ => None,
        }
    }

    fn element(&self, value: &'a Spanned<DeValue<'a>>) -> Self {
        Self { source: self.source, value, path: self.path.clone(), is_element: true }
    }
}

/// A value in the syntax of an option of the command line.
#[derive(Deserialize)]
pub(super) struct OptionText(pub(super) String);

impl<'de> Deserializer<'de> for Value<'_> {
    type Error = Problem;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match self.value.get_ref() {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Boolean(flag) => visitor.visit_bool(*flag),
            DeValue::Array(_) => self.deserialize_seq(visitor),
            DeValue::Table(_) => self.deserialize_map(visitor),
            DeValue::Integer(_) | DeValue::Float(_) => self.deserialize_f64(visitor),
            DeValue::Datetime(_) => Err(de::Error::invalid_type(Unexpected::Other("a date"), &visitor)),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_bool(self.value.get_ref().as_bool().ok_or_else(|| expected("true or false"))?)
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_f32(self.number_f32().ok_or_else(|| expected("a number"))?)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_f64(self.number().ok_or_else(|| expected("a number"))?)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Problem> {
        if name != "OptionText" {
            return visitor.visit_newtype_struct(self);
        }
        let text = self.option_text().ok_or_else(|| expected("a number, a string, or an array of them"))?;
        visitor.visit_newtype_struct(text.into_deserializer())
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match self.value.get_ref() {
            DeValue::Array(array) => visitor.visit_seq(Elements { of: &self, rest: array.iter() }),
            _ => Err(Problem::Expected(format!("an array of tables [[{}]]", self.path))),
        }
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        self.table()?.read(|rows| visitor.visit_map(rows))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Problem> {
        if is_spanned(name) {
            let span = self.value.span();
            return visitor.visit_map(SpannedDeserializer::new(self, span));
        }
        self.deserialize_map(visitor)
    }

    /// A string that is a variant, or a table whose `type` is one.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Problem> {
        if let Some(text) = self.value.get_ref().as_str() {
            return visitor.visit_enum(text.into_deserializer());
        }
        let table = self.table()?;
        visitor.visit_enum(Tagged { table, name })
    }

    forward_to_deserialize_any! {
        i8 i16 i32 i64 u8 u16 u32 u64 char str string bytes byte_buf unit unit_struct tuple tuple_struct identifier ignored_any
    }
}

impl<'de> IntoDeserializer<'de, Problem> for Value<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

/// The elements of an array.
struct Elements<'v, 'a> {
    of: &'v Value<'a>,
    rest: std::slice::Iter<'a, Spanned<DeValue<'a>>>,
}

impl<'de> SeqAccess<'de> for Elements<'_, '_> {
    type Error = Problem;

    fn next_element_seed<S: de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Problem> {
        self.rest.next().map(|value| seed.deserialize(self.of.element(value))).transpose()
    }
}

/// A table that is a variant of an enum by its key `type`.
struct Tagged<'a> {
    table: Table<'a>,
    /// The name of the enum.
    name: &'static str,
}

const TYPE: &str = "type";

impl<'de> de::EnumAccess<'de> for Tagged<'_> {
    type Error = Problem;
    type Variant = Self;

    fn variant_seed<S: de::DeserializeSeed<'de>>(mut self, seed: S) -> Result<(S::Value, Self), Problem> {
        let variant = self.table.read(|rows| {
            let row = rows.rows.as_slice().iter().find(|(key, _)| key.get_ref() == TYPE);
            let row = *row.ok_or_else(|| Problem::MissingKey(TYPE.to_owned()))?;
            rows.table.value(row, |value| seed.deserialize(value))
        })?;
        let kind = self.table.items.get(TYPE).and_then(|value| value.get_ref().as_str()).unwrap_or_default();
        self.table.name = format!("a {} of type {kind}", self.name);
        Ok((variant, self))
    }
}

impl<'de> de::VariantAccess<'de> for Tagged<'_> {
    type Error = Problem;

    fn unit_variant(self) -> Result<(), Problem> {
        Ok(())
    }

    fn newtype_variant_seed<S: de::DeserializeSeed<'de>>(self, _: S) -> Result<S::Value, Problem> {
        Err(expected("a table"))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Problem> {
        Err(de::Error::invalid_type(Unexpected::TupleVariant, &visitor))
    }

    fn struct_variant<V: Visitor<'de>>(self, _: &'static [&'static str], visitor: V) -> Result<V::Value, Problem> {
        self.table.read(|mut rows| {
            let others: Vec<_> = rows.rows.filter(|(key, _)| key.get_ref() != TYPE).collect();
            rows.rows = others.into_iter();
            visitor.visit_map(rows)
        })
    }
}

/// A range of legal numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bounds {
    Finite,
    NotZero,
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
    /// Whether a finite number is legal, and what is legal.
    fn check(self, x: f64) -> (bool, &'static str) {
        match self {
            Self::Finite => (true, "finite"),
            Self::NotZero => (x != 0.0, "not 0"),
            Self::NotNegative => (x >= 0.0, "0 or more"),
            Self::Positive => (x > 0.0, "greater than 0"),
            Self::Fraction => ((0.0..=1.0).contains(&x), "from 0 to 1"),
            Self::Ior => ((1.0..=f64::from(Material::MAX_IOR)).contains(&x), "from 1 to 1000"),
            Self::FieldOfView => (x > 0.0 && x < 180.0, "between 0 and 180"),
            Self::ConeAngle => ((0.0..=180.0).contains(&x), "from 0 to 180"),
        }
    }
}

/// A number, or an array of numbers.
pub(super) trait Number: Sized {
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error>;
    fn is_in(&self, bounds: Bounds) -> bool;
    fn what() -> String;
}

macro_rules! numbers {
    ($($number:ident)*) => {
        $(impl Number for $number {
            fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Self::deserialize(deserializer)
            }

            fn is_in(&self, bounds: Bounds) -> bool {
                self.is_finite() && bounds.check((*self).into()).0
            }

            fn what() -> String {
                "a number".to_owned()
            }
        })*
    };
}

numbers! { f32 f64 }

impl<const N: usize> Number for [f32; N] {
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let numbers = Vec::<f32>::deserialize(deserializer)?;
        numbers.try_into().map_err(|_| de::Error::custom(""))
    }

    fn is_in(&self, bounds: Bounds) -> bool {
        self.iter().all(|x| x.is_in(bounds))
    }

    fn what() -> String {
        format!("an array of {N} numbers")
    }
}

/// Reads numbers in a range.
impl Bounds {
    pub(super) fn read<'de, T: Number, D: Deserializer<'de>>(self, deserializer: D) -> Result<T, D::Error> {
        let number = T::read(deserializer).ok().filter(|number| number.is_in(self));
        number.ok_or_else(|| de::Error::custom(format!("{} ({})", T::what(), self.check(0.0).1)))
    }
}

/// Numbers whose range is part of their type.
pub(super) struct In<T, R>(pub(super) T, PhantomData<R>);

/// A range as a type.
pub(super) trait Range {
    const BOUNDS: Bounds;
}

macro_rules! ranges {
    ($($name:ident)*) => {
        $(pub(super) struct $name;
        impl Range for $name {
            const BOUNDS: Bounds = Bounds::$name;
        })*
    };
}

ranges! { Finite NotZero NotNegative Positive Fraction FieldOfView ConeAngle }

impl<'de, T: Number, R: Range> Deserialize<'de> for In<T, R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        R::BOUNDS.read(deserializer).map(|number| Self(number, PhantomData))
    }
}

/// A point or vector.
pub(super) type Point = In<[f32; 3], Finite>;

/// A color that is not negative.
pub(super) type Color = In<[f32; 3], NotNegative>;

/// A direction of length 1. A vector that is already of unit length keeps its bits.
pub(super) struct Direction(pub(super) [f32; 3]);

impl<'de> Deserialize<'de> for Direction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let direction = unit(Bounds::Finite.read(deserializer)?);
        direction.map(Self).ok_or_else(|| de::Error::custom("a direction of nonzero length"))
    }
}

/// The name of a file.
pub(super) struct FileName(pub(super) String);

impl<'de> Deserialize<'de> for FileName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match String::deserialize(deserializer)? {
            name if name.trim().is_empty() => Err(de::Error::custom("a file name")),
            name => Ok(Self(name)),
        }
    }
}

/// Folders: a path, or a list of paths.
#[derive(Default)]
pub(super) struct Folders(pub(super) Vec<String>);

impl<'de> Deserialize<'de> for Folders {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FoldersVisitor)
    }
}

struct FoldersVisitor;

impl<'de> Visitor<'de> for FoldersVisitor {
    type Value = Folders;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a folder or a list of folders")
    }

    fn visit_str<E: de::Error>(self, path: &str) -> Result<Folders, E> {
        Ok(Folders(vec![path.to_owned()]))
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut paths: A) -> Result<Folders, A::Error> {
        let mut all = Vec::new();
        while let Some(path) = paths.next_element::<String>()? {
            all.push(path);
        }
        Ok(Folders(all))
    }
}

/// Largest deviation from 1 of the squared length of a unit vector rounded to `f32`.
///
/// Each coordinate has a relative error of at most u, half of `f32::EPSILON`, so the square has at most (1 + u)² - 1.
const UNIT_ERROR: f64 = HALF_EPSILON * (2.0 + HALF_EPSILON);
const HALF_EPSILON: f64 = 0.5 * f32::EPSILON as f64;

/// The vector scaled to length 1; `None` for zero.
fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let wide = to_f64(v);
    if (dot(wide, wide) - 1.0).abs() <= UNIT_ERROR { Some(v) } else { normalized(wide).map(to_f32) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn normalizing_twice_changes_nothing(v in prop::array::uniform3(-1e30_f32..1e30)) {
            let once = unit(v).unwrap();
            prop_assert_eq!(unit(once), Some(once));
        }
    }

    #[test]
    fn normalizes_vectors_of_any_length() {
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([0.0, -3e-45, 0.0]), Some([0.0, -1.0, 0.0]));
        assert_eq!(unit([3e38, 0.0, 0.0]), Some([1.0, 0.0, 0.0]));
        assert_eq!(unit([1.001, 0.0, 0.0]), Some([1.0, 0.0, 0.0]), "nearly unit length is normalized");
    }

    #[test]
    fn ties_return_the_first_candidate() {
        assert_eq!(closest_match("box", ["table", "bow", "fox"]), Some("bow"));
        assert_eq!(closest_match("x", []), None);
    }

    #[test]
    fn other_words_are_no_candidates() {
        assert_eq!(closest_match("sun", ["son"]), Some("son"));
        assert_eq!(closest_match("sun", ["fan"]), None);
        assert_eq!(closest_match("x", ["y"]), None);
    }
}
