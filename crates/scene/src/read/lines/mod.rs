//! Lines and points with a thickness: hair, tracks of fibers, molecules, paths of tools, and those of files of meshes.
//!
//! ```text
//! bytes -> strands of points -> segments, numbered strand by strand
//! ```
//!
//! Segments with a point that is not finite are dropped and have no number.

mod elements;
mod gcode;
mod hair;
mod molecule;
mod obj;
mod tracks;

use std::path::Path;

use canted_obb::Affine;

use super::error::ReadError;
use super::input::{Format as MeshFormat, Input, ReadOptions, inner_name, open, read_all};
use super::strands::{Lines, Strands, point_index};
use super::{gltf, ply};
use crate::{CurveSegments, CurveShape, Curves, Instance, Material, MaterialId, Mesh, MeshId, Part, Scene};

/// A format of lines alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Hair,
    Tck,
    Trk,
    Pdb,
    Xyz,
    Gcode,
}

fn format_of(path: &Path) -> Option<Format> {
    match inner_name(path).extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "hair" => Some(Format::Hair),
        "tck" => Some(Format::Tck),
        "trk" => Some(Format::Trk),
        "pdb" | "ent" => Some(Format::Pdb),
        "xyz" => Some(Format::Xyz),
        "gcode" | "gco" | "g" => Some(Format::Gcode),
        _ => None,
    }
}

/// Whether a file holds lines and no triangles, by its extension: `.hair`, `.tck`, `.trk`, `.pdb`, `.ent`, `.xyz`, `.gcode`, `.gco`, `.g`, or one of these with
/// `.gz`.
#[must_use]
pub fn is_lines(path: &Path) -> bool {
    format_of(path).is_some()
}

/// Reads the lines and points of a file: `.hair` (Yuksel), `.tck` (MRtrix), `.trk` (TrackVis), `.pdb` and `.xyz` (molecules), `.gcode`
/// (paths of an extruder), by their extension; and of a mesh file the lines of OBJ, PLY and glTF, and the points where
/// [`ReadOptions::point_radius`] is given.
///
/// Thickness in `.hair` is a diameter. Points of `.trk` are in millimeters of the space of its matrix. Radii are in world units: transforms
/// of glTF do not scale them.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("path.obj");
/// # std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nl 1 2 3")?;
/// use canted_scene::{ReadOptions, read_lines};
///
/// let lines = read_lines(&path, &ReadOptions { line_radius: Some(0.1), ..ReadOptions::default() })?;
/// assert_eq!(lines.segments, [[0, 1], [1, 2]]);
/// assert_eq!(lines.radii, [0.1; 3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ReadError`] with file, location and value.
pub fn read_lines(path: &Path, options: &ReadOptions) -> Result<Lines, ReadError> {
    let strands = match format_of(path) {
        Some(format) => {
            let bytes = read_all(path)?;
            match format {
                Format::Hair => hair::parse(path, &bytes)?,
                Format::Tck => tracks::parse_tck(path, &bytes)?,
                Format::Trk => tracks::parse_trk(path, &bytes)?,
                Format::Pdb => molecule::parse_pdb(path, &bytes, options)?,
                Format::Xyz => molecule::parse_xyz(path, &bytes, options)?,
                Format::Gcode => gcode::parse(path, &bytes, options)?,
            }
        }
        None => {
            let Input { format, bytes } = open(path, options)?;
            match format {
                MeshFormat::Obj => obj::parse(path, &bytes, options)?,
                MeshFormat::Ply => ply::lines::parse(path, &bytes, options)?,
                MeshFormat::Gltf => gltf::read_lines(path, &bytes, options)?,
                MeshFormat::Stl | MeshFormat::Off => {
                    return Err(ReadError::empty(path, "no lines, as files of this format have faces alone"));
                }
            }
        }
    };
    strands.into_lines(path, options)
}

/// A scene of one mesh of curves, named after the file.
pub(super) fn scene(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    if let Some(wanted) = options.animation.as_ref().filter(|_| is_lines(path)) {
        return Err(ReadError::UnknownAnimation { path: path.to_owned(), wanted: wanted.clone(), known: Vec::new() });
    }
    let Lines { points, radii, colors, segments, warnings } = read_lines(path, options)?;
    let mut scene = Scene { warnings, ..Scene::default() };
    if let Some(time) = options.time.filter(|_| is_lines(path)) {
        scene.warnings.push(format!("ignoring time {time}: files of lines have no animation"));
    }
    let name = inner_name(path).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let base_color = if colors.is_some() { [1.0; 3] } else { Material::default().base_color };
    scene.materials = vec![Material { name: name.clone(), base_color, ..Material::default() }];
    scene.meshes.push(Mesh {
        name,
        positions: points,
        colors: colors.map(|colors| colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()),
        parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
        curves: Some(Curves { radii, segments: CurveSegments::Linear(segments), shape: CurveShape::Tube }),
        ..Mesh::default()
    });
    scene.instances.push(Instance {
        mesh: MeshId(0),
        world_from_object: Affine::IDENTITY,
        world_from_object_close: None,
        first_primitive: 0,
    });
    Ok(scene)
}

/// Numbers of a binary file, read in order.
struct Numbers<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Numbers<'a> {
    fn new(path: &'a Path, bytes: &'a [u8], at: usize) -> Self {
        Self { path, bytes, at }
    }

    /// The next `n` bytes; `what` is named where they are missing.
    fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8], ReadError> {
        let found = self.at.checked_add(n).and_then(|end| self.bytes.get(self.at..end));
        let found = found.ok_or_else(|| {
            let n_left = self.bytes.len().saturating_sub(self.at);
            ReadError::malformed(
                self.path,
                format!("byte {}", self.at),
                format!("{what} has {n} bytes, {n_left} are left"),
            )
        })?;
        self.at += n;
        Ok(found)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ReadError> {
        Ok(self.take(N, what)?.try_into().expect("of this length"))
    }

    /// `n` values of `f32`, little-endian.
    fn floats(&mut self, n: usize, what: &str) -> Result<Vec<f32>, ReadError> {
        let bytes = self.take(n.saturating_mul(4), what)?;
        Ok(bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }

    /// `n` points.
    fn points(&mut self, n: usize, what: &str) -> Result<Vec<[f32; 3]>, ReadError> {
        Ok(self.floats(n.saturating_mul(3), what)?.as_chunks().0.to_vec())
    }
}
