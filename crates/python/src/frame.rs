//! An origin that keeps `float32` coordinates accurate, and rays that start near a mesh.

use canted::Aabb;
use pyo3::prelude::*;

use crate::arrays;
use crate::error::invalid;

/// A mesh is traced relative to an origin where rounding moves a vertex by more than this part of its smallest edge.
const HARMFUL: f64 = 1e-4;

/// How far outside of the sphere around a mesh rays start, relative to its radius: far more than roundings of `f64` and of the `f32`
/// coordinates, so that no hit lies before the start.
const MARGIN: f64 = 1.0 + 1.0 / 1024.0;

/// The argument `origin` of a mesh as Python passes it.
#[derive(FromPyObject)]
pub(crate) enum OriginArgument<'py> {
    Name(String),
    Other(Bound<'py, PyAny>),
}

/// How the origin of a mesh is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Origin {
    /// Near the mesh, where rounding without an origin is harmful.
    Auto,
    /// Near the mesh.
    Near,
    /// Given; results are `float32`.
    At([f64; 3]),
}

impl OriginArgument<'_> {
    pub(crate) fn auto() -> Self {
        Self::Name("auto".to_owned())
    }

    pub(crate) fn read(&self) -> PyResult<Origin> {
        match self {
            Self::Name(name) => match &name[..] {
                "auto" => Ok(Origin::Auto),
                "near" => Ok(Origin::Near),
                _ => Err(invalid(format!("origin is '{name}'; use 'auto', 'near', three numbers or None"))),
            },
            Self::Other(given) if given.is_none() => Ok(Origin::At(arrays::NO_ORIGIN)),
            Self::Other(given) => Ok(Origin::At(arrays::origin(Some(given))?.unwrap_or(arrays::NO_ORIGIN))),
        }
    }
}

/// How far rounding to `f32` moves vertices, relative to edges.
#[derive(Clone, Copy)]
pub(crate) struct Rounding {
    /// Squared.
    greatest: f64,
    /// Squared, of the edges that have a length.
    smallest_edge: f64,
}

impl Default for Rounding {
    fn default() -> Self {
        Self { greatest: 0.0, smallest_edge: f64::INFINITY }
    }
}

impl Rounding {
    pub(crate) fn add(&mut self, [a, b, c]: [[f64; 3]; 3]) {
        let squared = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>();
        for (start, end) in [(a, b), (b, c), (c, a)] {
            self.greatest = self.greatest.max(squared(start, start.map(|x| f64::from(x as f32))));
            let edge = squared(start, end);
            if edge > 0.0 {
                self.smallest_edge = self.smallest_edge.min(edge);
            }
        }
    }

    /// Whether a vertex moves by more than [`HARMFUL`] of the smallest edge that has a length.
    pub(crate) fn is_harmful(&self) -> bool {
        self.smallest_edge.is_finite() && self.greatest > HARMFUL * HARMFUL * self.smallest_edge
    }
}

/// Whether rounding to `f32` is harmful to a mesh.
pub(crate) fn is_rounding_harmful(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> bool {
    let mut rounding = Rounding::default();
    for triangle in triangles {
        // A build reports indices that are out of range.
        let [Some(&a), Some(&b), Some(&c)] = triangle.map(|index| vertices.get(index as usize)) else { return false };
        rounding.add([a, b, c]);
    }
    rounding.is_harmful()
}

/// Whether rounding to `f32` may move the corners of a box by more than [`HARMFUL`] of its longest side.
pub(crate) fn is_far(corners: &[[f64; 3]]) -> bool {
    let of_axis = |k: usize| {
        let (low, high) = corners
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| (low.min(corner[k]), high.max(corner[k])));
        (high - low, low.abs().max(high.abs()))
    };
    let (side, reach) =
        [0, 1, 2].map(of_axis).into_iter().fold((0.0_f64, 0.0_f64), |all, axis| (all.0.max(axis.0), all.1.max(axis.1)));
    side > 0.0 && reach * f64::from(f32::EPSILON) / 2.0 > HARMFUL * side
}

/// Bounds of finite vertices.
#[derive(Clone, Copy, Default)]
pub(crate) struct Extent(Option<[[f64; 3]; 2]>);

impl Extent {
    pub(crate) fn add(&mut self, vertex: [f64; 3]) {
        if !vertex.iter().all(|x| x.is_finite()) {
            return;
        }
        let [low, high] = self.0.unwrap_or([vertex; 2]);
        self.0 =
            Some([std::array::from_fn(|k| low[k].min(vertex[k])), std::array::from_fn(|k| high[k].max(vertex[k]))]);
    }

    /// A point to subtract from the vertices before they are rounded to `f32`.
    ///
    /// It is within one extent of them, so that an error of `f32` is relative to the extent and not to the distance from zero. It is a multiple
    /// of a power of two above the extent, so that integers and other short numbers stay exact, and zero for a mesh around zero.
    pub(crate) fn origin(&self) -> [f64; 3] {
        let Some([low, high]) = self.0 else { return arrays::NO_ORIGIN };
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        if extent == 0.0 {
            // All vertices at one point, which becomes zero.
            return low;
        }
        let unit = extent.log2().ceil().exp2();
        let near: [f64; 3] = std::array::from_fn(|k| ((low[k] / 2.0 + high[k] / 2.0) / unit).round_ties_even() * unit);
        // Not so where the extent overflows.
        if near.iter().all(|x| x.is_finite()) { near } else { arrays::NO_ORIGIN }
    }
}

/// The origin of [`Extent::origin`] for vertices.
pub(crate) fn origin_of(vertices: impl IntoIterator<Item = [f64; 3]>) -> [f64; 3] {
    let mut extent = Extent::default();
    vertices.into_iter().for_each(|vertex| extent.add(vertex));
    extent.origin()
}

/// The sphere around a mesh, relative to its origin.
#[derive(Clone, Copy)]
pub(crate) struct Near {
    center: [f64; 3],
    radius: f64,
}

impl Near {
    pub(crate) fn new(bounds: &Aabb) -> Self {
        let [low, high] = [bounds.min, bounds.max].map(|end| end.map(f64::from));
        let half: [f64; 3] = std::array::from_fn(|k| 0.5 * (high[k] - low[k]));
        Self { center: std::array::from_fn(|k| low[k] + half[k]), radius: dot(half, half).sqrt() }
    }

    /// The sphere within which a sphere of this radius touches the mesh.
    pub(crate) fn grown(self, by: f64) -> Self {
        Self { radius: self.radius + by, ..self }
    }

    /// The `t` at which a ray reaches the sphere; zero for one that starts there, or whose `t` is not finite.
    ///
    /// Rounding a direction to `f32` moves a hit by the distance times 2^-24: from near the mesh that is little.
    #[inline]
    pub(crate) fn start(&self, origin: [f64; 3], direction: [f64; 3]) -> f64 {
        let squared = dot(direction, direction);
        let to_center = std::array::from_fn(|k| self.center[k] - origin[k]);
        let t = (dot(to_center, direction) - self.radius * MARGIN * squared.sqrt()) / squared;
        if t.is_finite() { t.max(0.0) } else { 0.0 }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
