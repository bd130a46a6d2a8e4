//! The statements of an OBJ file as arrays; indices are resolved and checked, materials and shapes are not yet looked at.

use std::collections::HashMap;
use std::path::Path;

use crate::read::ReadError;
use crate::read::text::{self, Line};

/// Stands in a [`Corner`] for what the file leaves out.
pub(super) const ABSENT: u32 = u32::MAX;

/// A corner of a face: indices from 0 into the arrays of [`Statements`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    pub(super) position: u32,
    /// Or [`ABSENT`].
    pub(super) uv: u32,
    /// Or [`ABSENT`].
    pub(super) normal: u32,
}

/// Consecutive faces with the same object, group and material.
#[derive(Debug)]
pub(super) struct Run<'a> {
    /// The group's name where there is one, else the object's.
    pub(super) name: &'a [u8],
    /// Index into [`Statements::materials`].
    pub(super) material: usize,
    /// First face of the run; it ends where the next run begins.
    pub(super) first_face: usize,
}

/// What an OBJ file states.
#[derive(Debug, Default)]
pub(super) struct Statements<'a> {
    /// Positions; may be NaN or infinite.
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    /// Normals as written, of any length.
    pub(super) normals: Vec<[f32; 3]>,
    /// Corners of all faces, one face after the other.
    pub(super) corners: Vec<Corner>,
    /// Where each face ends in `corners`.
    pub(super) face_ends: Vec<usize>,
    pub(super) runs: Vec<Run<'a>>,
    /// Names of the materials that faces use, by first use; `None` where no material is in force.
    pub(super) materials: Vec<Option<&'a [u8]>>,
    /// Material libraries, as written.
    pub(super) libraries: Vec<&'a [u8]>,
    /// Faces with fewer than three corners, which are left out.
    pub(super) n_small_faces: usize,
}

impl Statements<'_> {
    /// Corners of a face.
    pub(super) fn face(&self, face: usize) -> &[Corner] {
        let start = if face == 0 { 0 } else { self.face_ends[face - 1] };
        &self.corners[start..self.face_ends[face]]
    }
}

/// Reads all statements. Lines, points, free forms, smoothing and unknown statements are ignored.
pub(super) fn statements<'a>(path: &Path, bytes: &'a [u8]) -> Result<Statements<'a>, ReadError> {
    let mut parser = Parser::default();
    for line in text::lines(bytes) {
        parser.line(&line).map_err(|message| malformed(path, line.number, message))?;
    }
    parser.check_reach(path)?;
    Ok(parser.stated)
}

fn malformed(path: &Path, line: usize, message: String) -> ReadError {
    ReadError::malformed(path, format!("line {line}"), message)
}

/// The greatest index that a face uses, and where. Files may use vertices before they state them, so it is checked last.
#[derive(Clone, Copy, Default)]
struct Reach {
    index: i64,
    line: usize,
}

/// The three kinds of vertex data, for messages.
const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// What is in force for the next face.
#[derive(Clone, Copy, Default, PartialEq)]
struct State<'a> {
    object: &'a [u8],
    group: &'a [u8],
    material: Option<&'a [u8]>,
}

/// Statements so far, and the state of the last run of faces.
#[derive(Default)]
struct Parser<'a> {
    stated: Statements<'a>,
    state: State<'a>,
    last: Option<State<'a>>,
    material_indices: HashMap<Option<&'a [u8]>, usize>,
    reach: [Reach; 3],
}

impl<'a> Parser<'a> {
    fn line(&mut self, line: &Line<'a>) -> Result<(), String> {
        match line.keyword {
            b"v" => self.stated.positions.push(coordinates(line.rest, 3, "vertex")?),
            b"vt" => self.stated.uvs.push(coordinates(line.rest, 1, "texture coordinate")?),
            b"vn" => self.stated.normals.push(coordinates(line.rest, 3, "normal")?),
            b"f" => self.face(line)?,
            b"o" => self.state.object = line.rest,
            b"g" => self.state.group = line.rest,
            b"usemtl" => self.state.material = Some(line.rest).filter(|name| !name.is_empty()),
            b"mtllib" => self.stated.libraries.push(line.rest),
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, line: &Line) -> Result<(), String> {
        let start = self.stated.corners.len();
        for word in text::words(line.rest) {
            let corner = self.corner(word, line.number)?;
            self.stated.corners.push(corner);
        }
        if self.stated.corners.len() - start < 3 {
            self.stated.corners.truncate(start);
            self.stated.n_small_faces += 1;
            return Ok(());
        }
        self.open_run();
        self.stated.face_ends.push(self.stated.corners.len());
        Ok(())
    }

    /// Opens a run where the next face differs from the last in object, group or material.
    fn open_run(&mut self) {
        if self.last == Some(self.state) {
            return;
        }
        let State { object, group, material: name } = self.state;
        let materials = &mut self.stated.materials;
        let material = *self.material_indices.entry(name).or_insert_with(|| {
            materials.push(name);
            materials.len() - 1
        });
        let name = if group.is_empty() { object } else { group };
        self.stated.runs.push(Run { name, material, first_face: self.stated.face_ends.len() });
        self.last = Some(self.state);
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &[u8], line: usize) -> Result<Corner, String> {
        let mut parts = word.split(|&byte| byte == b'/');
        let counts = [self.stated.positions.len(), self.stated.uvs.len(), self.stated.normals.len()];
        let mut indices = [ABSENT; 3];
        for (k, index) in indices.iter_mut().enumerate() {
            let part = parts.next().unwrap_or_default();
            if k == 0 || !part.is_empty() {
                *index = self.index(k, part, counts[k], line)?;
            }
        }
        if parts.next().is_some() {
            return Err(format!("face corner {} has more than three indices", text::quoted(word)));
        }
        let [position, uv, normal] = indices;
        Ok(Corner { position, uv, normal })
    }

    /// An index from 1, or a negative one counted back from the last of `count` read so far.
    fn index(&mut self, kind: usize, part: &[u8], count: usize, line: usize) -> Result<u32, String> {
        let what = KINDS[kind];
        let stated =
            text::integer(part).ok_or_else(|| format!("{what} index {} is not an index", text::quoted(part)))?;
        let from_one = match stated {
            0 => return Err(format!("{what} index 0; indices start at 1")),
            1.. => stated,
            _ => i64::try_from(count).map_or(0, |count| count + stated + 1),
        };
        if from_one < 1 {
            return Err(format!("relative {what} index {stated}, but {count} are stated before it"));
        }
        if from_one > self.reach[kind].index {
            self.reach[kind] = Reach { index: from_one, line };
        }
        match u32::try_from(from_one - 1) {
            Ok(index) if index != ABSENT => Ok(index),
            _ => Err(format!("{what} index {stated} is beyond 32 bits")),
        }
    }

    /// Every index lies in its array, now that the arrays are complete.
    fn check_reach(&self, path: &Path) -> Result<(), ReadError> {
        let counts = [self.stated.positions.len(), self.stated.uvs.len(), self.stated.normals.len()];
        for ((reach, count), what) in self.reach.iter().zip(counts).zip(KINDS) {
            if usize::try_from(reach.index).is_ok_and(|index| index > count) {
                return Err(malformed(path, reach.line, format!("{what} index {} of {count}", reach.index)));
            }
        }
        Ok(())
    }
}

/// The first `N` numbers of a statement, of which `n_needed` must be there; absent ones are 0, more are ignored.
fn coordinates<const N: usize>(rest: &[u8], n_needed: usize, what: &str) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    let mut words = text::words(rest);
    for (k, number) in numbers.iter_mut().enumerate() {
        match words.next() {
            Some(word) => {
                *number = text::float(word).ok_or_else(|| format!("{what}: {} is not a number", text::quoted(word)))?;
            }
            None if k >= n_needed => break,
            None => return Err(format!("{what} with {k} of {n_needed} coordinates")),
        }
    }
    Ok(numbers)
}
