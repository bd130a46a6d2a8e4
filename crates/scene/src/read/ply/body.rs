//! Numbers of a PLY body in any of the three encodings. Counts are checked against the remaining bytes before allocating.

use super::header::{Element, Encoding, Kind, Scalar};
use crate::read::text;

/// The unread part of the body.
pub(super) struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

const ENDS_EARLY: &str = "unexpected end of file";

impl<'a> Body<'a> {
    pub(super) fn new(encoding: Encoding, bytes: &'a [u8]) -> Self {
        Self { encoding, rest: bytes }
    }

    /// Whether nothing is left, apart from white space in ASCII.
    pub(super) fn is_at_end(&self) -> bool {
        match self.encoding {
            Encoding::Ascii => self.rest.trim_ascii_start().is_empty(),
            _ => self.rest.is_empty(),
        }
    }

    /// Number of rows of an element, checked against the remaining bytes.
    pub(super) fn rows(&self, element: &Element) -> Result<usize, String> {
        if element.properties.is_empty() {
            return Ok(0);
        }
        let row_bytes = element.properties.iter().map(|property| match property.kind {
            Kind::Scalar(scalar) | Kind::List { count: scalar, .. } => self.min_size(scalar),
        });
        let max = (self.rest.len() + self.slack()) / row_bytes.sum::<usize>();
        usize::try_from(element.count)
            .ok()
            .filter(|&count| count <= max)
            .ok_or_else(|| format!("{} rows declared, but the remaining data holds at most {max}", element.count))
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

    /// The length of a list, checked against the remaining bytes.
    pub(super) fn length(&mut self, count: Scalar, item: Scalar) -> Result<usize, String> {
        let length = self.integer(count)?;
        let max = (self.rest.len() + self.slack()) / self.min_size(item);
        usize::try_from(length)
            .ok()
            .filter(|&n| n <= max)
            .ok_or_else(|| format!("list of {length} values, but the remaining data holds at most {max}"))
    }

    /// A number as `f32`, rounded once; infinite if out of range.
    pub(super) fn float(&mut self, scalar: Scalar) -> Result<f32, String> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return text::float(word).ok_or_else(|| format!("expected a number, found {}", text::quoted(word)));
        }
        #[expect(clippy::cast_possible_truncation, reason = "coordinates are f32")]
        match scalar {
            Scalar::F32 => self.bytes().map(f32::from_le_bytes),
            Scalar::F64 => self.bytes().map(|bytes| f64::from_le_bytes(bytes) as f32),
            _ => self.integer(scalar).map(|integer| integer as f32),
        }
    }

    /// An integer; `scalar` must be an integer type.
    pub(super) fn integer(&mut self, scalar: Scalar) -> Result<i64, String> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return text::integer(word).ok_or_else(|| format!("expected an integer, found {}", text::quoted(word)));
        }
        match scalar {
            Scalar::I8 => self.bytes().map(i8::from_le_bytes).map(i64::from),
            Scalar::U8 => self.bytes().map(u8::from_le_bytes).map(i64::from),
            Scalar::I16 => self.bytes().map(i16::from_le_bytes).map(i64::from),
            Scalar::U16 => self.bytes().map(u16::from_le_bytes).map(i64::from),
            Scalar::I32 => self.bytes().map(i32::from_le_bytes).map(i64::from),
            Scalar::U32 => self.bytes().map(u32::from_le_bytes).map(i64::from),
            Scalar::F32 | Scalar::F64 => Err("expected an integer type".into()),
        }
    }

    fn skip_scalars(&mut self, scalar: Scalar, n: usize) -> Result<(), String> {
        if self.encoding == Encoding::Ascii {
            return (0..n).try_for_each(|_| self.word().map(drop));
        }
        // No overflow: `n` was checked against the remaining bytes.
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

    /// The next bytes of a binary body in little-endian order.
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or(ENDS_EARLY)?;
        self.rest = rest;
        let mut bytes: [u8; N] = *bytes;
        if self.encoding == Encoding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// Smallest size of a number in bytes: in ASCII a digit and a separator.
    fn min_size(&self, scalar: Scalar) -> usize {
        if self.encoding == Encoding::Ascii { 2 } else { scalar.size() }
    }

    /// Excess of [`Self::min_size`] at the end: the last ASCII number needs no separator.
    fn slack(&self) -> usize {
        usize::from(self.encoding == Encoding::Ascii)
    }
}
