//! The encoding of PLY: the header (encoding, elements and properties), and the numbers of the body in any of the three encodings.
//! Counts are checked against the remaining bytes before allocating.

use std::path::Path;

use crate::read::error::ReadError;
use crate::read::text::{self, quoted};

/// Number encoding of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Property<'_> {
    /// The type of a number; `None` for a list.
    pub(super) fn scalar(&self) -> Option<Scalar> {
        match self.kind {
            Kind::Scalar(scalar) => Some(scalar),
            Kind::List { .. } => None,
        }
    }

    /// Whether it has one of these names, in any case.
    pub(super) fn is_one_of(&self, names: &[&[u8]]) -> bool {
        names.iter().any(|name| name.eq_ignore_ascii_case(self.name))
    }
}

impl Scalar {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            // Not in the specification, but written.
            b"long" | b"int64" => Self::I64,
            b"ulong" | b"uint64" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// A number, or a length-prefixed list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property<'a> {
    pub(super) name: &'a [u8],
    pub(super) kind: Kind,
}

/// A table of rows.
#[derive(Debug)]
pub(super) struct Element<'a> {
    pub(super) name: &'a [u8],
    pub(super) count: u64,
    pub(super) properties: Vec<Property<'a>>,
}

#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element<'a>>,
    /// Textures from MeshLab's comments `TextureFile`.
    pub(super) textures: Vec<&'a [u8]>,
    /// Lines that were ignored.
    pub(super) warnings: Vec<String>,
}

/// Header lines that may be ignored; with more, the file is something else.
const MAX_IGNORED: usize = 16;

/// Splits a file into header and body. Lines end with LF, CRLF or CR.
pub(super) fn header<'a>(path: &Path, bytes: &'a [u8]) -> Result<(Header<'a>, &'a [u8]), ReadError> {
    let mut rest = text::after_mark(bytes);
    let mut encoding = None;
    let mut header =
        Header { encoding: Encoding::Ascii, elements: Vec::new(), textures: Vec::new(), warnings: Vec::new() };
    // Where lines end with CR, an LF after the last one is the first byte of the body.
    let is_cr = rest[..text::line_length(rest)].ends_with(b"\r");
    for number in 1.. {
        let length = if is_cr { rest.iter().position(|&byte| byte == b'\r').map(|at| at + 1) } else { None };
        let length = length.unwrap_or_else(|| text::line_length(rest));
        let (line, after) = rest.split_at(length);
        if !line.ends_with(b"\n") && !line.ends_with(b"\r") {
            break;
        }
        rest = after;
        let line = line.trim_ascii();
        let malformed = |message: String| ReadError::malformed(path, format!("header line {number}"), message);
        if number == 1 {
            if line != b"ply" {
                return Err(malformed(format!("expected 'ply', found {}", quoted(line))));
            }
            continue;
        }
        let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
        match words[..] {
            [b"comment" | b"obj_info", name, _, ..] if is_texture_file(name) => {
                header.textures.push(text::split_word(text::split_word(line).1).1.trim_ascii());
            }
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, b"1.0", ..] => encoding = Some(encoding_named(name).map_err(malformed)?),
            [b"element", name, count, ..] => header.elements.push(element(&header, name, count).map_err(malformed)?),
            [b"property", ref words @ ..] => {
                let property = property(words).map_err(malformed)?;
                let element = header
                    .elements
                    .last_mut()
                    .ok_or_else(|| malformed("'property' before the first 'element'".into()))?;
                element.properties.push(property);
            }
            [b"end_header"] => {
                header.encoding = encoding.ok_or_else(|| malformed("missing 'format' line".into()))?;
                return Ok((header, rest));
            }
            // Some programs write comments without their keyword.
            [word, ..] if ![&b"format"[..], b"element"].contains(&word) && header.warnings.len() < MAX_IGNORED => {
                header.warnings.push(format!("ignoring header line {number}: {}", quoted(line)));
            }
            _ => return Err(malformed(format!("invalid statement {}", quoted(line)))),
        }
    }
    Err(ReadError::malformed(path, "header", "missing 'end_header'"))
}

/// Whether a comment that begins with this word names a texture.
fn is_texture_file(word: &[u8]) -> bool {
    word.strip_suffix(b":").unwrap_or(word).eq_ignore_ascii_case(b"TextureFile")
}

fn encoding_named(name: &[u8]) -> Result<Encoding, String> {
    match name {
        b"ascii" => Ok(Encoding::Ascii),
        b"binary_little_endian" => Ok(Encoding::LittleEndian),
        b"binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(format!("unknown format {}", quoted(name))),
    }
}

fn element<'a>(header: &Header, name: &'a [u8], count: &[u8]) -> Result<Element<'a>, String> {
    if header.elements.iter().any(|element| element.name == name) {
        return Err(format!("duplicate element {}", quoted(name)));
    }
    let count = std::str::from_utf8(count)
        .ok()
        .and_then(|count| count.parse().ok())
        .ok_or_else(|| format!("invalid element count {}", quoted(count)))?;
    Ok(Element { name, count, properties: Vec::new() })
}

fn property<'a>(words: &[&'a [u8]]) -> Result<Property<'a>, String> {
    let scalar = |name: &[u8]| Scalar::named(name).ok_or_else(|| format!("unknown property type {}", quoted(name)));
    match *words {
        [b"list", count, item, name, ..] => {
            Ok(Property { name, kind: Kind::List { count: scalar(count)?, item: scalar(item)? } })
        }
        [kind, name, ..] => Ok(Property { name, kind: Kind::Scalar(scalar(kind)?) }),
        _ => Err("expected a property type and a name".into()),
    }
}

/// The unread part of the body.
pub(super) struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

const ENDS_EARLY: &str = "unexpected end of file";

/// A number without fraction as an integer.
fn whole(real: f64) -> Option<i64> {
    // 2^53: all integers up to here are exact.
    let is_whole = real.fract() == 0.0 && real.abs() <= 9_007_199_254_740_992.0;
    is_whole.then_some(real as i64)
}

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
        match scalar {
            Scalar::F32 => self.bytes().map(f32::from_le_bytes),
            Scalar::F64 => self.bytes().map(|bytes| f64::from_le_bytes(bytes) as f32),
            _ => self.integer(scalar).map(|integer| integer as f32),
        }
    }

    /// An integer, which may be stored as a number of another type.
    pub(super) fn integer(&mut self, scalar: Scalar) -> Result<i64, String> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            let real = || std::str::from_utf8(word).ok()?.parse().ok().and_then(whole);
            let number = text::integer(word).or_else(real);
            return number.ok_or_else(|| format!("expected an integer, found {}", text::quoted(word)));
        }
        let of_real = |real: f64| whole(real).ok_or_else(|| format!("expected an integer, found '{real}'"));
        match scalar {
            Scalar::I8 => self.bytes().map(i8::from_le_bytes).map(i64::from),
            Scalar::U8 => self.bytes().map(u8::from_le_bytes).map(i64::from),
            Scalar::I16 => self.bytes().map(i16::from_le_bytes).map(i64::from),
            Scalar::U16 => self.bytes().map(u16::from_le_bytes).map(i64::from),
            Scalar::I32 => self.bytes().map(i32::from_le_bytes).map(i64::from),
            Scalar::U32 => self.bytes().map(u32::from_le_bytes).map(i64::from),
            Scalar::I64 => self.bytes().map(i64::from_le_bytes),
            Scalar::U64 => {
                let number = self.bytes().map(u64::from_le_bytes)?;
                i64::try_from(number).map_err(|_| format!("integer {number} exceeds 63 bits"))
            }
            Scalar::F32 => self.bytes().map(f32::from_le_bytes).map(f64::from).and_then(of_real),
            Scalar::F64 => self.bytes().map(f64::from_le_bytes).and_then(of_real),
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
        let (word, rest) = text::split_word(self.rest);
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
