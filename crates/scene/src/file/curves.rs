//! Curves of a scene file: the tables `[[curves]]`.

use serde::de::{self, Deserialize, Deserializer, SeqAccess, Visitor};
use serde_spanned::Spanned;

use super::tables::{Fraction, In, Point, Source};
use super::writer::{TomlWriter, number, numbers, quoted, vectors};
use crate::{CurveSegments, CurveShape, Curves, Material, Mesh, MeshClose, ReadError};

/// How the points of a curve make its segments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
pub enum CurveBasis {
    /// Straight segments between consecutive points, with a linear radius.
    #[default]
    #[serde(rename = "linear")]
    Linear,
    /// Segments of four points that share their ends: `3n + 1` points.
    #[serde(rename = "bezier")]
    Bezier,
    /// The uniform B-spline: each four consecutive points make a segment.
    #[serde(rename = "bspline")]
    BSpline,
    /// Each four consecutive points make a segment between the middle two, with half the difference of their neighbors as tangents.
    #[serde(rename = "catmull-rom")]
    CatmullRom,
    /// Points and tangents alternately: each two consecutive pairs make a segment. Radii, too, alternate with their derivatives.
    #[serde(rename = "hermite")]
    Hermite,
}

impl CurveBasis {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Linear, Self::Bezier, Self::BSpline, Self::CatmullRom, Self::Hermite];

    /// Its name in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Bezier => "bezier",
            Self::BSpline => "bspline",
            Self::CatmullRom => "catmull-rom",
            Self::Hermite => "hermite",
        }
    }

    /// Points from the first of a segment to that of the next, and points of a segment.
    fn step_and_length(self) -> [usize; 2] {
        match self {
            Self::Linear => [1, 2],
            Self::Bezier => [3, 4],
            Self::BSpline | Self::CatmullRom => [1, 4],
            Self::Hermite => [2, 4],
        }
    }

    /// Number of segments of `n` points; `None` if they do not make whole segments, or none.
    #[must_use]
    pub fn n_segments(self, n: usize) -> Option<usize> {
        let [step, length] = self.step_and_length();
        let more = n.checked_sub(length)?;
        more.is_multiple_of(step).then(|| more / step + 1)
    }

    /// The Bézier control values of four values in a cubic basis, in one coordinate.
    #[must_use]
    pub fn bezier(self, [a, b, c, d]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Linear | Self::Bezier => [a, b, c, d],
            Self::BSpline => {
                let [first, last] = [(a + 4.0 * b + c) / 6.0, (b + 4.0 * c + d) / 6.0];
                [first, (2.0 * b + c) / 3.0, (b + 2.0 * c) / 3.0, last]
            }
            Self::CatmullRom => [b, b + (c - a) / 6.0, c - (d - b) / 6.0, c],
            Self::Hermite => [a, a + b / 3.0, c - d / 3.0, c],
        }
    }

    /// What a number of points must be.
    fn expected(self) -> &'static str {
        match self {
            Self::Linear => "at least 2",
            Self::Bezier => "4, 7, 10 and so on",
            Self::BSpline | Self::CatmullRom => "at least 4",
            Self::Hermite => "an even number from 4 on, points and tangents alternately",
        }
    }
}

/// Curves of a scene file, a chain of segments.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveTable {
    /// Name in messages; may be empty.
    pub name: String,
    /// Control points, world space.
    pub points: Vec<[f32; 3]>,
    /// The radius at each point; one for all, where there is one.
    pub radii: Vec<f32>,
    /// The points at shutter close, as many, for curves whose points move; those above are at shutter open.
    pub close_points: Option<Vec<[f32; 3]>>,
    /// The radii at shutter close: one for each point, or one for all.
    pub close_radii: Option<Vec<f32>>,
    /// How points make segments.
    pub basis: CurveBasis,
    /// Round, or flat; half the width of ribbons is the radius.
    pub shape: CurveShape,
    /// Linear RGB; `None` for that of the material.
    pub color: Option<[f32; 3]>,
    /// Linear RGB at each point, which multiplies the color.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Name of a new material.
    pub material: Option<String>,
    /// Line in the file; 0 if not read from one.
    pub line: usize,
}

/// One number, or a list.
struct Radii(Vec<f32>);

impl<'de> Deserialize<'de> for Radii {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RadiiVisitor)
    }
}

struct RadiiVisitor;

impl<'de> Visitor<'de> for RadiiVisitor {
    type Value = Radii;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a number or a list of numbers")
    }

    fn visit_f64<E: de::Error>(self, radius: f64) -> Result<Radii, E> {
        Ok(Radii(vec![radius as f32]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Radii, A::Error> {
        let mut all = Vec::new();
        while let Some(radius) = list.next_element::<f32>()? {
            all.push(radius);
        }
        Ok(Radii(all))
    }
}

/// A reflectance.
pub(super) type Rgb = In<[f32; 3], Fraction>;

/// The keys of a table.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CurveRows {
    #[serde(default)]
    name: String,
    points: Spanned<Vec<Point>>,
    radii: Spanned<Radii>,
    close_points: Option<Spanned<Vec<Point>>>,
    close_radii: Option<Spanned<Radii>>,
    #[serde(default)]
    basis: CurveBasis,
    #[serde(default)]
    shape: CurveShape,
    color: Option<Rgb>,
    colors: Option<Spanned<Vec<Rgb>>>,
    material: Option<String>,
}

pub(super) fn read(table: Spanned<CurveRows>, source: &Source<'_>) -> Result<CurveTable, ReadError> {
    let line = source.line(table.span().start);
    let CurveRows { name, points, radii, close_points, close_radii, basis, shape, color, colors, material } =
        table.into_inner();
    let points_at = points.span().start;
    let points: Vec<[f32; 3]> = points.into_inner().into_iter().map(|point| point.0).collect();
    let n = points.len();
    if basis.n_segments(n).is_none() {
        let message = format!("{n} points in [[curves]] of the basis {}: expected {}", basis.name(), basis.expected());
        return Err(source.error(points_at, message));
    }
    let radii = read_radii(radii, n, basis, "radii", source)?;
    let close_points = read_close(close_points, n, "curves", source)?;
    let close_radii = close_radii.map(|radii| read_radii(radii, n, basis, "close_radii", source)).transpose()?;
    let colors = colors.map(|colors| {
        let at = colors.span().start;
        let colors: Vec<[f32; 3]> = colors.into_inner().into_iter().map(|color| color.0).collect();
        let message = format!("{} colors for {n} points in [[curves]]: expected one for each point", colors.len());
        if colors.len() == n { Ok(colors) } else { Err(source.error(at, message)) }
    });
    Ok(CurveTable {
        name,
        points,
        radii,
        close_points,
        close_radii,
        basis,
        shape,
        color: color.map(|color| color.0),
        colors: colors.transpose()?,
        material,
        line,
    })
}

/// The radii of `n` points, by the key `key`.
fn read_radii(
    radii: Spanned<Radii>,
    n: usize,
    basis: CurveBasis,
    key: &str,
    source: &Source<'_>,
) -> Result<Vec<f32>, ReadError> {
    let at = radii.span().start;
    let Radii(radii) = radii.into_inner();
    if radii.len() != n && radii.len() != 1 {
        let message =
            format!("{} {key} for {n} points in [[curves]]: expected one number, or one for each point", radii.len());
        return Err(source.error(at, message));
    }
    // Every other one of a list may be a derivative, which has any sign.
    let step = if basis == CurveBasis::Hermite && radii.len() > 1 { 2 } else { 1 };
    let is_wrong =
        |(k, radius): &(usize, f32)| !(0.0..f32::INFINITY).contains(radius) && k % step == 0 || !radius.is_finite();
    match radii.iter().copied().enumerate().find(is_wrong) {
        Some((k, radius)) => {
            let what = if key == "radii" { "radius" } else { "close radius" };
            let expected = if k % step == 0 { "0 or more" } else { "a finite number" };
            Err(source.error(at, format!("{what} {k} in [[curves]] is {radius}: expected {expected}")))
        }
        None => Ok(radii),
    }
}

/// The positions of `n` points at shutter close in a table of this name, if they move.
pub(super) fn read_close(
    points: Option<Spanned<Vec<Point>>>,
    n: usize,
    table: &str,
    source: &Source<'_>,
) -> Result<Option<Vec<[f32; 3]>>, ReadError> {
    let Some(points) = points else { return Ok(None) };
    let at = points.span().start;
    let points: Vec<[f32; 3]> = points.into_inner().into_iter().map(|point| point.0).collect();
    if points.len() == n {
        return Ok(Some(points));
    }
    Err(source.error(at, format!("{} close_points for {n} points in [[{table}]]: expected as many", points.len())))
}

impl CurveTable {
    /// The mesh of the curves, without parts.
    pub(super) fn mesh(&self) -> Mesh {
        let n = self.points.len();
        let [step, length] = self.basis.step_and_length();
        let (positions, radii) = self.controls(&self.points, &self.radii);
        let close = (self.close_points.is_some() || self.close_radii.is_some()).then(|| {
            let points = self.close_points.as_ref().unwrap_or(&self.points);
            let (positions, radii) = self.controls(points, self.close_radii.as_ref().unwrap_or(&self.radii));
            MeshClose { positions, radii: Some(radii), ..MeshClose::default() }
        });
        let rgba = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
        let colors = self.colors.as_ref().map(|colors| match self.basis {
            CurveBasis::Linear => colors.iter().copied().map(rgba).collect(),
            _ => self.beziers(colors).map(|color| rgba(color.map(|x| x.clamp(0.0, 1.0)))).collect(),
        });
        let n_segments = self.basis.n_segments(n).unwrap_or(0) as u32;
        let segments = match self.basis {
            CurveBasis::Linear => CurveSegments::Linear((0..n_segments).map(|i| [i, i + step as u32]).collect()),
            _ => {
                let length = length as u32;
                CurveSegments::Cubic((0..n_segments).map(|i| [0, 1, 2, 3].map(|k| length * i + k)).collect())
            }
        };
        Mesh {
            name: if self.name.is_empty() { "curves".to_owned() } else { self.name.clone() },
            positions,
            colors,
            curves: Some(Curves { radii, segments, shape: self.shape }),
            close,
            ..Mesh::default()
        }
    }

    /// Positions and radii of the mesh: the points themselves, or the control points of each segment.
    fn controls(&self, points: &[[f32; 3]], radii: &[f32]) -> (Vec<[f32; 3]>, Vec<f32>) {
        let radius = |i: usize| match (radii, self.basis) {
            // A constant radius has no derivative.
            ([_], CurveBasis::Hermite) if i % 2 == 1 => 0.0,
            ([radius], _) => *radius,
            (radii, _) => radii[i],
        };
        let radii: Vec<f32> = (0..points.len()).map(radius).collect();
        if self.basis == CurveBasis::Linear {
            return (points.to_vec(), radii);
        }
        let radii: Vec<[f32; 1]> = radii.into_iter().map(|radius| [radius]).collect();
        // Splines through points may have control values below zero; the bounds of a segment are those of its control balls.
        (self.beziers(points).collect(), self.beziers(&radii).map(|[radius]| radius.max(0.0)).collect())
    }

    /// The Bézier control values of all segments, number by number.
    fn beziers<'a, const N: usize>(&'a self, values: &'a [[f32; N]]) -> impl Iterator<Item = [f32; N]> + 'a {
        let [step, _] = self.basis.step_and_length();
        (0..self.basis.n_segments(values.len()).unwrap_or(0)).flat_map(move |segment| {
            let of = |k: usize| self.basis.bezier([0, 1, 2, 3].map(|i| values[segment * step + i][k].into()));
            let axes: [[f64; 4]; N] = std::array::from_fn(of);
            [0, 1, 2, 3].map(|i| axes.map(|axis| axis[i] as f32))
        })
    }

    /// The material of curves that name none.
    pub(super) fn own_material(&self) -> Material {
        let plain = if self.colors.is_some() { [1.0; 3] } else { Material::default().base_color };
        Material { name: self.name.clone(), base_color: self.color.unwrap_or(plain), ..Material::default() }
    }
}

/// Writes a table.
pub(super) fn write(table: &CurveTable, out: &mut TomlWriter) {
    let CurveTable { name, points, radii, close_points, close_radii, basis, shape, color, colors, material, line: _ } =
        table;
    out.heading("[[curves]]");
    if !name.is_empty() {
        out.entry("name", &quoted(name), "");
    }
    out.entry("basis", &quoted(basis.name()), "linear, bezier, bspline, catmull-rom, hermite");
    if *shape != CurveShape::default() {
        out.entry("shape", &quoted(shape.name()), "tube, ribbon");
    }
    out.entry("points", &vectors(points), "");
    let mut write_radii = |key: &str, radii: &[f32]| match radii {
        [radius] => out.entry(key, &number(*radius), "of all points"),
        radii => out.entry(key, &numbers(radii), ""),
    };
    write_radii("radii", radii);
    if let Some(radii) = close_radii {
        write_radii("close_radii", radii);
    }
    write_close(close_points.as_deref(), out);
    write_colors(color.as_ref(), colors.as_deref(), material.as_deref(), out);
}

/// Writes the points as the shutter closes.
pub(super) fn write_close(points: Option<&[[f32; 3]]>, out: &mut TomlWriter) {
    if let Some(points) = points {
        out.entry("close_points", &vectors(points), "as the shutter closes");
    }
}

/// Writes the keys of the color and the material.
pub(super) fn write_colors(
    color: Option<&[f32; 3]>,
    colors: Option<&[[f32; 3]]>,
    material: Option<&str>,
    out: &mut TomlWriter,
) {
    if let Some(color) = color {
        out.entry("color", &numbers(color), "linear RGB");
    }
    if let Some(colors) = colors {
        out.entry("colors", &vectors(colors), "");
    }
    if let Some(material) = material {
        out.entry("material", &quoted(material), "new material");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every basis at its ends, after the textbook formulas.
    #[test]
    fn bases_are_bezier_curves() {
        let p = [1.0, 2.0, 4.0, -3.0];
        // Weights 1/6, 4/6, 1/6 of the B-spline at the ends of a segment.
        assert_eq!(CurveBasis::BSpline.bezier(p), [13.0 / 6.0, 8.0 / 3.0, 10.0 / 3.0, 15.0 / 6.0]);
        assert_eq!(CurveBasis::CatmullRom.bezier(p), [2.0, 2.5, 4.0 + 5.0 / 6.0, 4.0]);
        assert_eq!(CurveBasis::Hermite.bezier([1.0, 3.0, 4.0, -6.0]), [1.0, 2.0, 6.0, 4.0]);
        assert_eq!(CurveBasis::Bezier.bezier(p), p);
    }

    #[test]
    fn numbers_of_points_make_whole_segments() {
        for (basis, n, want) in [
            (CurveBasis::Linear, 2, Some(1)),
            (CurveBasis::Linear, 1, None),
            (CurveBasis::Bezier, 7, Some(2)),
            (CurveBasis::Bezier, 6, None),
            (CurveBasis::BSpline, 6, Some(3)),
            (CurveBasis::CatmullRom, 3, None),
            (CurveBasis::Hermite, 6, Some(2)),
            (CurveBasis::Hermite, 5, None),
        ] {
            assert_eq!(basis.n_segments(n), want, "{basis:?} {n}");
        }
    }
}
