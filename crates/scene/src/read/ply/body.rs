//! The numbers of a PLY body, in any of the three encodings. Nothing is allocated for more rows than there are bytes.

use super::header::{Element, Encoding, Kind, Scalar};
use crate::read::text;

/// The numbers not yet read.
pub(super) struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

/// What a reader of numbers says when there are none left.
const ENDS_EARLY: &str = "the file ends early";

impl<'a> Body<'a> {
    pub(super) fn new(encoding: Encoding, bytes: &'a [u8]) -> Self {
        Self { encoding, rest: bytes }
    }

    /// Whether only white space is left, and not even that in a binary body.
    pub(super) fn is_at_end(&self) -> bool {
        match self.encoding {
            Encoding::Ascii => self.rest.trim_ascii_start().is_empty(),
            _ => self.rest.is_empty(),
        }
    }

    /// Rows of an element as an array length, if the bytes left can hold so many.
    pub(super) fn rows(&self, element: &Element) -> Result<usize, String> {
        if element.properties.is_empty() {
            return Ok(0);
        }
        let least = element.properties.iter().map(|property| match property.kind {
            Kind::Scalar(scalar) | Kind::List { count: scalar, .. } => self.size_least(scalar),
        });
        let most = (self.rest.len() + self.slack()) / least.sum::<usize>();
        usize::try_from(element.count)
            .ok()
            .filter(|&count| count <= most)
            .ok_or_else(|| format!("{} rows are declared, but the file has bytes for {most} at most", element.count))
    }

    /// Skips a property of any kind.
    pub(super) fn skip(&mut self, kind: Kind) -> Result<(), String> {
        match kind {
            Kind::Scalar(scalar) => self.skip_scalars(scalar, 1),
            Kind::List { count, item } => {
                let n = self.length(count, item)?;
                self.skip_scalars(item, n)
            }
        }
    }

    /// The length of a list; the bytes left can hold as many items.
    pub(super) fn length(&mut self, count: Scalar, item: Scalar) -> Result<usize, String> {
        let stated = self.integer(count)?;
        let most = (self.rest.len() + self.slack()) / self.size_least(item);
        usize::try_from(stated)
            .ok()
            .filter(|&n| n <= most)
            .ok_or_else(|| format!("a list of {stated} values, but the file has bytes for {most} at most"))
    }

    /// A number as `f32`, rounded once; beyond its range infinite.
    pub(super) fn float(&mut self, scalar: Scalar) -> Result<f32, String> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return text::float(word).ok_or_else(|| format!("{} is not a number", text::quoted(word)));
        }
        #[expect(clippy::cast_possible_truncation, reason = "coordinates are f32")]
        match scalar {
            Scalar::F32 => self.bytes().map(f32::from_le_bytes),
            Scalar::F64 => self.bytes().map(|bytes| f64::from_le_bytes(bytes) as f32),
            _ => self.integer(scalar).map(|integer| integer as f32),
        }
    }

    /// An integer; the type must be one.
    pub(super) fn integer(&mut self, scalar: Scalar) -> Result<i64, String> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return text::integer(word).ok_or_else(|| format!("{} is not an integer", text::quoted(word)));
        }
        match scalar {
            Scalar::I8 => self.bytes().map(i8::from_le_bytes).map(i64::from),
            Scalar::U8 => self.bytes().map(u8::from_le_bytes).map(i64::from),
            Scalar::I16 => self.bytes().map(i16::from_le_bytes).map(i64::from),
            Scalar::U16 => self.bytes().map(u16::from_le_bytes).map(i64::from),
            Scalar::I32 => self.bytes().map(i32::from_le_bytes).map(i64::from),
            Scalar::U32 => self.bytes().map(u32::from_le_bytes).map(i64::from),
            Scalar::F32 | Scalar::F64 => Err("a fraction where an integer belongs".into()),
        }
    }

    fn skip_scalars(&mut self, scalar: Scalar, n: usize) -> Result<(), String> {
        if self.encoding == Encoding::Ascii {
            return (0..n).try_for_each(|_| self.word().map(drop));
        }
        // No overflow: lengths are checked against the bytes left, and a single scalar has eight bytes at most.
        self.rest = self.rest.get(n * scalar.size()..).ok_or(ENDS_EARLY)?;
        Ok(())
    }

    /// The next word of an ASCII body.
    fn word(&mut self) -> Result<&'a [u8], String> {
        let start = self.rest.trim_ascii_start();
        let end = start.iter().position(u8::is_ascii_whitespace).unwrap_or(start.len());
        let (word, rest) = start.split_at(end);
        self.rest = rest;
        if word.is_empty() { Err(ENDS_EARLY.into()) } else { Ok(word) }
    }

    /// The next bytes of a binary body, least significant first.
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or(ENDS_EARLY)?;
        self.rest = rest;
        let mut bytes: [u8; N] = *bytes;
        if self.encoding == Encoding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// Fewest bytes of a number: in ASCII a digit and a separator.
    fn size_least(&self, scalar: Scalar) -> usize {
        if self.encoding == Encoding::Ascii { 2 } else { scalar.size() }
    }

    /// Bytes that [`Self::size_least`] counts beyond the end: the last ASCII number needs no separator.
    fn slack(&self) -> usize {
        usize::from(self.encoding == Encoding::Ascii)
    }
}
