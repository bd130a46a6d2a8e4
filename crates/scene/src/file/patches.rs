//! Patches of a scene file: the tables `[[patches]]`.

use serde_spanned::Spanned;

use super::curves::{Rgb, read_close, write_close, write_colors};
use super::tables::{Point, Source};
use super::writer::{TomlWriter, quoted, vectors};
use crate::{CurveSegments, CurveShape, Curves, Material, Mesh, MeshClose, ReadError};

/// Bicubic Bézier patches of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchTable {
    /// Name in messages; may be empty.
    pub name: String,
    /// Control points, world space: sixteen of each patch, four rows along the second parameter, one after another along the first.
    pub points: Vec<[f32; 3]>,
    /// The points at shutter close, as many, for patches whose points move.
    pub close_points: Option<Vec<[f32; 3]>>,
    /// Linear RGB; `None` for that of the material.
    pub color: Option<[f32; 3]>,
    /// Linear RGB at each point, which multiplies the color.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Name of a new material.
    pub material: Option<String>,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// The keys of a table.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PatchRows {
    #[serde(default)]
    name: String,
    points: Spanned<Vec<Point>>,
    close_points: Option<Spanned<Vec<Point>>>,
    color: Option<Rgb>,
    colors: Option<Spanned<Vec<Rgb>>>,
    material: Option<String>,
}

pub(super) fn read(table: Spanned<PatchRows>, source: &Source<'_>) -> Result<PatchTable, ReadError> {
    let line = source.line(table.span().start);
    let PatchRows { name, points, close_points, color, colors, material } = table.into_inner();
    let points_at = points.span().start;
    let points: Vec<[f32; 3]> = points.into_inner().into_iter().map(|point| point.0).collect();
    let n = points.len();
    if n == 0 || !n.is_multiple_of(16) {
        return Err(source.error(points_at, format!("{n} points in [[patches]]: expected 16 for each patch")));
    }
    let close_points = read_close(close_points, n, "patches", source)?;
    let colors = colors.map(|colors| {
        let at = colors.span().start;
        let colors: Vec<[f32; 3]> = colors.into_inner().into_iter().map(|color| color.0).collect();
        let message = format!("{} colors for {n} points in [[patches]]: expected one for each point", colors.len());
        if colors.len() == n { Ok(colors) } else { Err(source.error(at, message)) }
    });
    let (color, colors) = (color.map(|color| color.0), colors.transpose()?);
    Ok(PatchTable { name, points, close_points, color, colors, material, line })
}

impl PatchTable {
    /// The mesh of the patches, without parts.
    pub(super) fn mesh(&self) -> Mesh {
        let n = (self.points.len() / 16) as u32;
        let patches = (0..n).map(|patch| std::array::from_fn(|k| 16 * patch + k as u32)).collect();
        let rgba = |&[r, g, b]: &[f32; 3]| [r, g, b, 1.0];
        Mesh {
            name: if self.name.is_empty() { "patches".to_owned() } else { self.name.clone() },
            positions: self.points.clone(),
            colors: self.colors.as_ref().map(|colors| colors.iter().map(rgba).collect()),
            curves: Some(Curves {
                radii: vec![0.0; self.points.len()],
                segments: CurveSegments::Patches(patches),
                shape: CurveShape::default(),
            }),
            close: self
                .close_points
                .as_ref()
                .map(|points| MeshClose { positions: points.clone(), ..MeshClose::default() }),
            ..Mesh::default()
        }
    }

    /// The material of patches that name none.
    pub(super) fn own_material(&self) -> Material {
        let plain = if self.colors.is_some() { [1.0; 3] } else { Material::default().base_color };
        Material { name: self.name.clone(), base_color: self.color.unwrap_or(plain), ..Material::default() }
    }
}

/// Writes a table.
pub(super) fn write(table: &PatchTable, out: &mut TomlWriter) {
    let PatchTable { name, points, close_points, color, colors, material, line: _ } = table;
    out.heading("[[patches]]");
    if !name.is_empty() {
        out.entry("name", &quoted(name), "");
    }
    out.entry("points", &vectors(points), "16 of each patch");
    write_close(close_points.as_deref(), out);
    write_colors(color.as_ref(), colors.as_deref(), material.as_deref(), out);
}
