//! The statements of an OBJ file: vertices, faces and what names them.

use std::collections::HashMap;
use std::path::Path;

use crate::read::error::ReadError;
use crate::read::mesh::NO_COLOR;
use crate::read::text::{self, Line};

/// Missing index in a [`Corner`].
pub(super) const ABSENT: u32 = u32::MAX;

/// A corner of a face: zero-based indices into the arrays of [`Statements`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub(super) position: u32,
    /// Or [`ABSENT`].
    pub(super) uv: u32,
    /// Or [`ABSENT`].
    pub(super) normal: u32,
}

/// Consecutive faces with equal object, group and material.
#[derive(Debug)]
pub(super) struct Run<'a> {
    /// Name of the group, else of the object.
    pub(super) name: &'a [u8],
    /// Index into [`Statements::materials`].
    pub(super) material: usize,
    /// First face; the run ends where the next one starts.
    pub(super) first_face: usize,
}

/// Contents of an OBJ file.
#[derive(Debug, Default)]
pub(super) struct Statements<'a> {
    /// Positions; may be NaN or infinite.
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    /// The color of each position after its coordinates; empty if no position has one.
    pub(super) colors: Vec<[f32; 3]>,
    /// The color value of full intensity; `None` where the range of the numbers decides.
    pub(super) max_color: Option<f32>,
    /// Normals of any length.
    pub(super) normals: Vec<[f32; 3]>,
    /// Corners of all faces, concatenated.
    pub(super) corners: Vec<Corner>,
    /// End of each face in `corners`.
    pub(super) face_ends: Vec<usize>,
    pub(super) runs: Vec<Run<'a>>,
    /// Names of used materials in order of first use; `None` for faces without `usemtl`.
    pub(super) materials: Vec<Option<&'a [u8]>>,
    /// Arguments of `mtllib` statements.
    pub(super) libraries: Vec<&'a [u8]>,
    /// Skipped faces with fewer than three corners.
    pub(super) n_small_faces: usize,
    /// Skipped statements by entry of [`OTHERS`].
    n_others: [usize; OTHERS.len()],
    /// What was ignored.
    pub(super) warnings: Vec<String>,
    /// What is not drawn.
    pub(super) notes: Vec<String>,
}

/// Keywords of what is read, which some programs write in capitals.
const KEYWORDS: [&[u8]; 8] = [b"v", b"vt", b"vn", b"f", b"o", b"g", b"usemtl", b"mtllib"];

/// Elements that are no faces: keywords, the name of one and the name of several.
const OTHERS: [(&[&[u8]], &str, &str); 4] = [
    (&[b"l"], "line", "lines"),
    (&[b"p"], "point", "points"),
    (&[b"curv", b"curv2", b"surf"], "curve or surface", "curves and surfaces"),
    (&[b"call", b"csh"], "call of another file", "calls of other files"),
];

impl Statements<'_> {
    /// How many elements were skipped that are no faces: `2 lines, 1 point`; `None` without any.
    pub(super) fn skipped(&self) -> Option<String> {
        let counts = OTHERS.iter().zip(self.n_others).filter(|&(_, n)| n > 0);
        let texts: Vec<String> =
            counts.map(|((_, one, several), n)| format!("{n} {}", if n == 1 { one } else { several })).collect();
        (!texts.is_empty()).then(|| texts.join(", "))
    }

    /// Corners of a face.
    pub(super) fn face(&self, face: usize) -> &[Corner] {
        let start = if face == 0 { 0 } else { self.face_ends[face - 1] };
        &self.corners[start..self.face_ends[face]]
    }
}

/// Parses all statements. Skips lines, points, free-form curves and surfaces and calls, which are reported, and ignores smoothing groups
/// and unknown statements.
pub(super) fn parse_statements<'a>(path: &Path, bytes: &'a [u8]) -> Result<Statements<'a>, ReadError> {
    let mut parser = Parser::default();
    for line in text::lines(bytes) {
        parser.line(&line).map_err(|message| malformed(path, line.number, message))?;
    }
    parser.check_indices(path)?;
    parser.drop_unusable_indices();
    if let Some(skipped) = parser.statements.skipped() {
        parser.statements.notes.push(format!("skipping elements that are not faces: {skipped}"));
    }
    let n = parser.statements.positions.len();
    parser.use_painted(n);
    if !parser.statements.colors.is_empty() {
        parser.statements.colors.resize(n, NO_COLOR);
    }
    Ok(parser.statements)
}

fn malformed(path: &Path, line: usize, message: String) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// The largest index used by a face, and its line. Vertices may be defined after use, so it is checked at the end.
#[derive(Clone, Copy, Default)]
struct MaxIndex {
    index: i64,
    line: usize,
}

/// The three kinds of vertex data, for messages.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// State for the next face.
#[derive(Clone, Copy, Default, PartialEq)]
struct State<'a> {
    object: &'a [u8],
    group: &'a [u8],
    material: Option<&'a [u8]>,
}

/// Parser state.
#[derive(Default)]
struct Parser<'a> {
    statements: Statements<'a>,
    state: State<'a>,
    last: Option<State<'a>>,
    material_indices: HashMap<Option<&'a [u8]>, usize>,
    max_indices: [MaxIndex; 3],
    /// Indices of texture coordinates and of normals that are out of range: how many, and the first.
    unusable: [(usize, String); 3],
    /// The colors of [`text::MRGB`] statements, of consecutive vertices.
    painted: Vec<[f32; 3]>,
    /// Those that are not eight hexadecimal digits: how many, and the first.
    unpainted: (usize, String),
    /// Face corners with more than three indices: how many, and the first.
    surplus: (usize, String),
}

impl<'a> Parser<'a> {
    fn line(&mut self, line: &Line<'a>) -> Result<(), String> {
        match line.keyword {
            b"v" => {
                self.statements.positions.push(coordinates(line.rest, 3, "vertex")?);
                self.color(line.rest);
            }
            b"vt" => self.statements.uvs.push(coordinates(line.rest, 1, "texture coordinate")?),
            b"vn" => self.statements.normals.push(coordinates(line.rest, 3, "normal")?),
            b"f" => self.face(line)?,
            b"o" => self.state.object = line.rest,
            b"g" => self.state.group = line.rest,
            b"usemtl" => self.state.material = Some(line.rest).filter(|name| !name.is_empty()),
            b"mtllib" => self.statements.libraries.push(line.rest),
            text::MRGB => self.paint(line),
            other => {
                let is = |known: &&[u8]| known.eq_ignore_ascii_case(other);
                if let Some(keyword) = KEYWORDS.into_iter().find(|known| is(known) && *known != other) {
                    return self.line(&Line { keyword, ..*line });
                }
                if let Some(kind) = OTHERS.iter().position(|(keywords, ..)| keywords.iter().any(is)) {
                    self.statements.n_others[kind] += 1;
                }
            }
        }
        Ok(())
    }

    /// The color of the last position: three numbers after its coordinates.
    fn color(&mut self, rest: &[u8]) {
        let mut words = text::words(rest).skip(3).map(text::float);
        if let (Some(Some(r)), Some(Some(g)), Some(Some(b))) = (words.next(), words.next(), words.next()) {
            let colors = &mut self.statements.colors;
            colors.resize(self.statements.positions.len() - 1, NO_COLOR);
            colors.push([r, g, b]);
        }
    }

    /// Colors of ZBrush, `MMRRGGBB` each: a mask, which is no part of the look, and bytes of red, green and blue.
    fn paint(&mut self, line: &Line) {
        for digits in text::words(line.rest).flat_map(|word| word.chunks(8)) {
            let number = std::str::from_utf8(digits).ok().filter(|text| text.len() == 8);
            let number = number.and_then(|text| u32::from_str_radix(text, 16).ok());
            let [_, red, green, blue] = number.unwrap_or(u32::MAX).to_be_bytes();
            self.painted.push([red, green, blue].map(f32::from));
            if number.is_none() {
                count(&mut self.unpainted, || format!("{} in line {}", text::quoted(digits), line.number));
            }
        }
    }

    /// Gives the first of `n` vertices the colors of ZBrush, unless vertices have other colors; those after them are white.
    fn use_painted(&mut self, n: usize) {
        let statements = &mut self.statements;
        if !statements.colors.is_empty() || self.painted.is_empty() {
            return;
        }
        if self.unpainted.0 > 0 {
            let (n, first) = &self.unpainted;
            let warning = format!("white for {n} colors of #MRGB that are not 8 hexadecimal digits, such as {first}");
            statements.warnings.push(warning);
        }
        if self.painted.len() != n {
            statements.warnings.push(format!("{} colors of #MRGB for {n} vertices", self.painted.len()));
        }
        self.painted.truncate(n);
        statements.colors = std::mem::take(&mut self.painted);
        statements.max_color = Some(255.0);
    }

    fn face(&mut self, line: &Line) -> Result<(), String> {
        let start = self.statements.corners.len();
        for word in text::words(line.rest) {
            let corner = self.corner(word, line.number)?;
            self.statements.corners.push(corner);
        }
        if self.statements.corners.len() - start < 3 {
            self.statements.corners.truncate(start);
            self.statements.n_small_faces += 1;
            return Ok(());
        }
        self.open_run();
        self.statements.face_ends.push(self.statements.corners.len());
        Ok(())
    }

    /// Starts a new run if object, group or material has changed.
    fn open_run(&mut self) {
        if self.last == Some(self.state) {
            return;
        }
        let State { object, group, material: name } = self.state;
        let materials = &mut self.statements.materials;
        let material = *self.material_indices.entry(name).or_insert_with(|| {
            materials.push(name);
            materials.len() - 1
        });
        let name = if group.is_empty() { object } else { group };
        self.statements.runs.push(Run { name, material, first_face: self.statements.face_ends.len() });
        self.last = Some(self.state);
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &[u8], line: usize) -> Result<Corner, String> {
        let mut parts = word.split(|&byte| byte == b'/');
        let counts = [self.statements.positions.len(), self.statements.uvs.len(), self.statements.normals.len()];
        let mut indices = [ABSENT; 3];
        for (k, index) in indices.iter_mut().enumerate() {
            let part = parts.next().unwrap_or_default();
            if k == 0 || !part.is_empty() {
                *index = self.index(k, part, counts[k], line)?;
            }
        }
        if parts.next().is_some() {
            count(&mut self.surplus, || format!("line {line}: {}", text::quoted(word)));
        }
        let [position, uv, normal] = indices;
        Ok(Corner { position, uv, normal })
    }

    /// Resolves a one-based index, or a negative one relative to the end of `count` elements.
    fn index(&mut self, kind: usize, part: &[u8], count: usize, line: usize) -> Result<u32, String> {
        let what = KINDS[kind];
        let value = text::integer(part).ok_or_else(|| format!("invalid {what} index {}", text::quoted(part)))?;
        let from_one = match value {
            0 if kind > 0 => 0,
            0 => return Err(format!("invalid {what} index 0 (indices start at 1)")),
            1.. => value,
            _ => i64::try_from(count).map_or(0, |count| count + value + 1),
        };
        if from_one < 1 && kind > 0 {
            count_unusable(&mut self.unusable[kind], line, value);
            return Ok(ABSENT);
        }
        if from_one < 1 {
            return Err(format!("relative {what} index {value} out of range ({count} defined so far)"));
        }
        if from_one > self.max_indices[kind].index {
            self.max_indices[kind] = MaxIndex { index: from_one, line };
        }
        match u32::try_from(from_one - 1) {
            Ok(index) if index != ABSENT => Ok(index),
            // Beyond all arrays; found to be unusable at the end.
            _ if kind > 0 => Ok(ABSENT - 1),
            _ => Err(format!("{what} index {value} exceeds 32 bits")),
        }
    }

    /// Checks the vertex indices against the complete array.
    fn check_indices(&self, path: &Path) -> Result<(), ReadError> {
        let (max, n) = (self.max_indices[0], self.statements.positions.len());
        match usize::try_from(max.index) {
            Ok(index) if index > n => {
                Err(malformed(path, max.line, format!("vertex index {} out of range ({n} defined)", max.index)))
            }
            _ => Ok(()),
        }
    }

    /// Drops texture coordinates and normals of corners whose indices are out of range: the geometry is sound without.
    fn drop_unusable_indices(&mut self) {
        let counts = [0, self.statements.uvs.len(), self.statements.normals.len()];
        for kind in [1, 2] {
            let (n, max) = (counts[kind], self.max_indices[kind]);
            if usize::try_from(max.index).is_ok_and(|index| index > n) {
                for corner in &mut self.statements.corners {
                    let index = if kind == 1 { &mut corner.uv } else { &mut corner.normal };
                    if *index != ABSENT && *index as usize >= n {
                        *index = ABSENT;
                        count_unusable(&mut self.unusable[kind], max.line, max.index);
                    }
                }
            }
            let (n_unusable, first) = &self.unusable[kind];
            if *n_unusable > 0 {
                let what = KINDS[kind];
                self.statements.warnings.push(format!(
                    "ignoring {n_unusable} {what} indices that are out of range ({n} defined), such as {first}"
                ));
            }
        }
        if self.surplus.0 > 0 {
            let (n, first) = &self.surplus;
            self.statements.warnings.push(format!("ignoring a fourth index of {n} face corners, such as {first}"));
        }
    }
}

/// Counts an event; the first one is described.
fn count((n, first): &mut (usize, String), describe: impl FnOnce() -> String) {
    if *n == 0 {
        *first = describe();
    }
    *n += 1;
}

fn count_unusable(unusable: &mut (usize, String), line: usize, value: i64) {
    count(unusable, || format!("{value} in line {line}"));
}

/// The first `N` numbers of a statement; the first `n_needed` are required, the others default to 0.
fn coordinates<const N: usize>(rest: &[u8], n_needed: usize, what: &str) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    let mut words = text::words(rest);
    for (k, number) in numbers.iter_mut().enumerate() {
        match words.next() {
            Some(word) => {
                *number = text::float(word)
                    .ok_or_else(|| format!("{what}: expected a number, found {}", text::quoted(word)))?;
            }
            None if k >= n_needed => break,
            None => return Err(format!("{what} has {k} coordinates (expected {n_needed})")),
        }
    }
    Ok(numbers)
}
