//! ASCII STL: words separated by white space. Keywords are accepted in any case, facets with more than three vertices are
//! triangulated.

use std::path::Path;

use super::{Triangles, too_many};
use crate::read::ReadError;
use crate::read::text::{self, quoted};
use crate::read::warning_groups::WarningGroups;

/// The unread words of a file.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        Some(&rest[start..start + length])
    }

    /// Skips the rest of the line: the name of a solid.
    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
    }

    /// The line of the last word, from 1.
    fn line(&self) -> String {
        format!("line {}", 1 + self.bytes[..self.at].iter().filter(|&&byte| byte == b'\n').count())
    }

    fn malformed(&self, path: &Path, message: impl Into<String>) -> ReadError {
        ReadError::malformed(path, self.line(), message)
    }
}

/// Keywords, the frequent ones first.
#[derive(Clone, Copy, PartialEq)]
enum Keyword {
    Vertex,
    Facet,
    Normal,
    Outer,
    Loop,
    EndLoop,
    EndFacet,
    Solid,
    EndSolid,
}

const KEYWORDS: [(&[u8], Keyword); 9] = [
    (b"vertex", Keyword::Vertex),
    (b"facet", Keyword::Facet),
    (b"normal", Keyword::Normal),
    (b"outer", Keyword::Outer),
    (b"loop", Keyword::Loop),
    (b"endloop", Keyword::EndLoop),
    (b"endfacet", Keyword::EndFacet),
    (b"solid", Keyword::Solid),
    (b"endsolid", Keyword::EndSolid),
];

/// Reads all facets of all solids.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    triangles: &mut Triangles,
    warnings: &mut Vec<String>,
) -> Result<(), ReadError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut words = Words { bytes, at: 0 };
    let (mut polygon, mut cuts, mut grouped) = (Vec::new(), Vec::new(), WarningGroups::default());
    let mut is_in_facet = false;
    let mut last = Keyword::Solid;
    while let Some(word) = words.next() {
        let Some(&(_, keyword)) = KEYWORDS.iter().find(|(name, _)| name.eq_ignore_ascii_case(word)) else {
            if text::float(word).is_none() {
                return Err(words.malformed(path, format!("unknown statement {}", quoted(word))));
            }
            grouped.add_once("ignoring surplus numbers", &words.line());
            continue;
        };
        match keyword {
            Keyword::Vertex => polygon.push(vertex(path, &mut words)?),
            Keyword::Facet | Keyword::Outer => {
                if !polygon.is_empty() {
                    return Err(words.malformed(path, format!("expected 'endloop', found {}", quoted(word))));
                }
                is_in_facet = true;
            }
            // Ignored, so it may be any three words.
            Keyword::Normal => {
                for _ in 0..3 {
                    words.next();
                }
            }
            Keyword::EndLoop => {
                close(&polygon, &mut cuts, triangles).ok_or_else(|| too_many(path))?;
                polygon.clear();
            }
            Keyword::EndFacet if !polygon.is_empty() => {
                return Err(words.malformed(path, format!("expected 'endloop', found {}", quoted(word))));
            }
            Keyword::EndFacet => is_in_facet = false,
            Keyword::Solid | Keyword::EndSolid => words.skip_line(),
            Keyword::Loop => {}
        }
        last = keyword;
    }
    if is_in_facet || !polygon.is_empty() {
        return Err(words.malformed(path, "unexpected end of file in a facet"));
    }
    if last != Keyword::EndSolid {
        grouped.add("missing 'endsolid'", &words.line());
    }
    grouped.finish(warnings);
    Ok(())
}

fn vertex(path: &Path, words: &mut Words) -> Result<[f32; 3], ReadError> {
    let mut position = [0.0; 3];
    for coordinate in &mut position {
        let word = words.next().ok_or_else(|| words.malformed(path, "unexpected end of file in a vertex"))?;
        *coordinate = text::float(word)
            .ok_or_else(|| words.malformed(path, format!("vertex: expected a number, found {}", quoted(word))))?;
    }
    Ok(position)
}

/// Adds the triangles of a facet; `None` for too many vertices.
fn close(polygon: &[[f32; 3]], cuts: &mut Vec<[usize; 3]>, triangles: &mut Triangles) -> Option<()> {
    match *polygon {
        [a, b, c] => triangles.add([a, b, c])?,
        [] | [_] | [_, _] => triangles.checks.n_small_faces += 1,
        _ => {
            triangles.checks.triangulate(polygon, cuts);
            for cut in cuts {
                triangles.push(cut.map(|k| polygon[k]))?;
            }
        }
    }
    Some(())
}
