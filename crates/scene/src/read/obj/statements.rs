//! Parses OBJ statements into arrays and resolves indices.

use std::collections::HashMap;
use std::path::Path;

use crate::read::ReadError;
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
}

impl Statements<'_> {
    /// Corners of a face.
    pub(super) fn face(&self, face: usize) -> &[Corner] {
        let start = if face == 0 { 0 } else { self.face_ends[face - 1] };
        &self.corners[start..self.face_ends[face]]
    }
}

/// Parses all statements. Ignores lines, points, free-form surfaces, smoothing groups and unknown statements.
pub(super) fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<Statements<'a>, ReadError> {
    let mut parser = Parser::default();
    for line in text::lines(bytes) {
        parser.line(&line).map_err(|message| malformed(path, line.number, message))?;
    }
    parser.check_indices(path)?;
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
}

impl<'a> Parser<'a> {
    fn line(&mut self, line: &Line<'a>) -> Result<(), String> {
        match line.keyword {
            b"v" => self.statements.positions.push(coordinates(line.rest, 3, "vertex")?),
            b"vt" => self.statements.uvs.push(coordinates(line.rest, 1, "texture coordinate")?),
            b"vn" => self.statements.normals.push(coordinates(line.rest, 3, "normal")?),
            b"f" => self.face(line)?,
            b"o" => self.state.object = line.rest,
            b"g" => self.state.group = line.rest,
            b"usemtl" => self.state.material = Some(line.rest).filter(|name| !name.is_empty()),
            b"mtllib" => self.statements.libraries.push(line.rest),
            _ => {}
        }
        Ok(())
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
            return Err(format!("face corner {} has more than 3 indices", text::quoted(word)));
        }
        let [position, uv, normal] = indices;
        Ok(Corner { position, uv, normal })
    }

    /// Resolves a one-based index, or a negative one relative to the end of `count` elements.
    fn index(&mut self, kind: usize, part: &[u8], count: usize, line: usize) -> Result<u32, String> {
        let what = KINDS[kind];
        let value = text::integer(part).ok_or_else(|| format!("invalid {what} index {}", text::quoted(part)))?;
        let from_one = match value {
            0 => return Err(format!("invalid {what} index 0 (indices start at 1)")),
            1.. => value,
            _ => i64::try_from(count).map_or(0, |count| count + value + 1),
        };
        if from_one < 1 {
            return Err(format!("relative {what} index {value} out of range ({count} defined so far)"));
        }
        if from_one > self.max_indices[kind].index {
            self.max_indices[kind] = MaxIndex { index: from_one, line };
        }
        match u32::try_from(from_one - 1) {
            Ok(index) if index != ABSENT => Ok(index),
            _ => Err(format!("{what} index {value} exceeds 32 bits")),
        }
    }

    /// Checks all indices against the complete arrays.
    fn check_indices(&self, path: &Path) -> Result<(), ReadError> {
        let counts = [self.statements.positions.len(), self.statements.uvs.len(), self.statements.normals.len()];
        for ((max, count), what) in self.max_indices.iter().zip(counts).zip(KINDS) {
            if usize::try_from(max.index).is_ok_and(|index| index > count) {
                return Err(malformed(
                    path,
                    max.line,
                    format!("{what} index {} out of range ({count} defined)", max.index),
                ));
            }
        }
        Ok(())
    }
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
