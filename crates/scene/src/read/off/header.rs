//! OFF header: the keyword and the counts.

use std::path::Path;

use super::Line;
use crate::read::ReadError;
use crate::read::text::{self, quoted};

/// What each vertex has, and the declared counts.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) has_normals: bool,
    pub(super) has_colors: bool,
    pub(super) has_uvs: bool,
    /// `4OFF` or `nOFF`.
    has_other_dimension: bool,
    pub(super) n_vertices: u64,
    pub(super) n_faces: u64,
}

/// Whether the first word of a file is a keyword of OFF.
pub(in crate::read) fn is_off(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let word = head.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    keyword(word).is_some()
}

/// Splits `[ST][C][N][4][n]OFF`, and a number that some files append to it without a space.
fn keyword(word: &[u8]) -> Option<(Header, &[u8])> {
    let mut header = Header::default();
    let mut rest = word;
    let mut takes = |prefix: &[u8]| {
        let after = rest.strip_prefix(prefix);
        rest = after.unwrap_or(rest);
        after.is_some()
    };
    header.has_uvs = takes(b"ST");
    header.has_colors = takes(b"C");
    header.has_normals = takes(b"N");
    header.has_other_dimension = takes(b"4") | takes(b"n");
    (takes(b"OFF") && rest.iter().all(u8::is_ascii_digit)).then_some((header, rest))
}

/// Reads the keyword, which may be absent, and the counts of vertices, faces and edges.
pub(super) fn read<'a>(path: &Path, lines: &mut impl Iterator<Item = Line<'a>>) -> Result<Header, ReadError> {
    let ends_early = || ReadError::malformed(path, "header", "missing the numbers of vertices and faces");
    let mut line = lines.next().ok_or_else(ends_early)?;
    let (mut header, mut words) = match keyword(line.words[0]) {
        Some((header, b"")) => (header, line.words.split_off(1)),
        Some((header, number)) => (header, [vec![number], line.words.split_off(1)].concat()),
        None => (Header::default(), std::mem::take(&mut line.words)),
    };
    if header.has_other_dimension {
        return Err(ReadError::unsupported(path, "OFF with another number of coordinates than 3"));
    }
    if words.first().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
        return Err(ReadError::unsupported(path, "binary OFF"));
    }
    while words.len() < 2 {
        line = lines.next().ok_or_else(ends_early)?;
        words.extend(&line.words);
    }
    let count = |word: &[u8]| {
        let count = text::integer(word).and_then(|count| u64::try_from(count).ok());
        count.ok_or_else(|| line.malformed(path, format!("invalid number of vertices or faces {}", quoted(word))))
    };
    (header.n_vertices, header.n_faces) = (count(words[0])?, count(words[1])?);
    Ok(header)
}
