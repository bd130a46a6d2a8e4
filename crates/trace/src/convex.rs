use core::{error, fmt};

use canted_obb::round::{down, up};
use canted_obb::vector::{cross, dot, length, sub, to_f64};
use canted_obb::{Aabb, Obb};

use crate::closest_point::closest_to_zero;
use crate::rounding::UNIT_ROUNDOFF_F64;

/// Rounding of a projection onto an axis, relative to the sum of the axis' absolute components times the greatest
/// coordinate: three roundings touch a product, and four a corner of an oriented box; two projections are compared, doubled.
const PROJECTION_ERROR: f64 = 32.0 * UNIT_ROUNDOFF_F64;

/// How far beyond its radius a ball may be and count as touching, relative to the coordinates: far more than the error of distances.
const BALL_ERROR: f64 = 1.0 / (1_u64 << 44) as f64;

const COORDINATE_AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A box whose least coordinate exceeds its greatest, or whose half-extent is negative.
///
/// [`Aabb::EMPTY`] is no such box: it is empty on purpose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvertedBox {
    /// Of the first coordinate or half-extent that is inverted: 0, 1 or 2.
    pub axis: usize,
    /// The least coordinate; the negative of the half-extent.
    pub min: f32,
    /// The greatest coordinate; the half-extent.
    pub max: f32,
}

impl fmt::Display for InvertedBox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { axis, min, max } = self;
        let name = ["x", "y", "z"][*axis];
        write!(f, "a box from {min} to {max} in {name} is inverted; exchange both, or use Aabb::EMPTY for an empty box")
    }
}

impl error::Error for InvertedBox {}

/// A convex region with eight corners: an axis-aligned box, an oriented box, or a frustum.
///
/// ```
/// use canted_trace::Convex;
///
/// let region = Convex::from_aabb([0.0; 3], [1.0; 3]);
/// assert!(region.overlaps_triangle(&[[0.5, 0.5, -1.0], [0.5, 0.5, 2.0], [5.0, 5.0, 0.5]]));
/// assert!(!region.overlaps_triangle(&[[2.5, 0.0, 0.5], [0.0, 2.5, 0.5], [9.0, 9.0, 0.5]]));
/// ```
#[derive(Clone, Debug)]
pub struct Convex {
    corners: [[f64; 3]; 8],
    /// Directions across the faces, of which some may be equal, and the coordinate axes.
    axes: [[f64; 3]; 9],
    /// Directions of the edges, and how many are stored: parallel ones of boxes once.
    edges: [[f64; 3]; 12],
    n_edges: usize,
    /// Whether all corners are in a plane.
    is_flat: bool,
    /// NaN if a coordinate is not finite, or of an empty box: such a region overlaps nothing.
    magnitude: f64,
}

impl Convex {
    /// The axis-aligned box from `min` to `max`, which may be infinite. It overlaps nothing where `min` exceeds `max` or one is NaN.
    #[must_use]
    pub fn from_aabb(min: impl Into<[f32; 3]>, max: impl Into<[f32; 3]>) -> Self {
        let (min, max) = (min.into(), max.into());
        let planes = [min, max].map(|corner| to_f64(corner.map(|x| x.clamp(-f32::MAX, f32::MAX))));
        let corners = core::array::from_fn(|corner| core::array::from_fn(|k| planes[corner >> k & 1][k]));
        let region = Self::new(corners, twice(COORDINATE_AXES), &COORDINATE_AXES);
        let is_empty = (0..3).any(|k| min[k].is_nan() || max[k].is_nan() || min[k] > max[k]);
        Self { magnitude: if is_empty { f64::NAN } else { region.magnitude }, ..region }
    }

    /// [`Convex::from_aabb`] of a box that is not inverted. The empty box, from infinity to minus infinity, overlaps nothing.
    ///
    /// # Errors
    /// A least coordinate that exceeds the greatest.
    pub fn checked_aabb(min: impl Into<[f32; 3]>, max: impl Into<[f32; 3]>) -> Result<Self, InvertedBox> {
        let (min, max) = (min.into(), max.into());
        let is_empty = Aabb { min, max } == Aabb::EMPTY;
        match (0..3).find(|&k| min[k] > max[k] && !is_empty) {
            Some(axis) => Err(InvertedBox { axis, min: min[axis], max: max[axis] }),
            None => Ok(Self::from_aabb(min, max)),
        }
    }

    /// [`Convex::from_obb`] of a box that is not inverted.
    ///
    /// # Errors
    /// A negative half-extent.
    pub fn checked_obb(obb: &Obb) -> Result<Self, InvertedBox> {
        match (0..3).find(|&k| obb.half_extents[k] < 0.0) {
            Some(axis) => Err(InvertedBox { axis, min: -obb.half_extents[axis], max: obb.half_extents[axis] }),
            None => Ok(Self::from_obb(obb)),
        }
    }

    /// An oriented box.
    #[must_use]
    pub fn from_obb(obb: &Obb) -> Self {
        let axes: [[f64; 3]; 3] = core::array::from_fn(|i| to_f64(obb.frame[i]));
        let half = to_f64(obb.half_extents);
        let center = to_f64(obb.center);
        let corners = core::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { -half[axis] } else { half[axis] };
            core::array::from_fn(|k| center[k] + (0..3).map(|axis| side(axis) * axes[axis][k]).sum::<f64>())
        });
        let [x, y, z] = axes;
        let faces = [cross(y, z), cross(z, x), cross(x, y)];
        Self::new(corners, twice(faces), &axes)
    }

    /// A frustum, or any convex solid with six flat faces: four corners of the near face in order around it, then those of the far
    /// face in the same order. Corners may coincide: the near face of a pyramid is a point.
    ///
    /// Faces are flat up to the rounding of their corners, and gaps as small may be reported as overlaps. A region with a coordinate
    /// that is not finite overlaps nothing.
    #[must_use]
    pub fn from_frustum(near: [[f32; 3]; 4], far: [[f32; 3]; 4]) -> Self {
        let [near, far] = [near, far].map(|face| face.map(to_f64));
        let corners: [[f64; 3]; 8] = core::array::from_fn(|i| if i < 4 { near[i] } else { far[i - 4] });
        // Perpendicular to both diagonals, so a corner may coincide with its neighbor.
        let across = |[a, b, c, d]: [[f64; 3]; 4]| cross(sub(c, a), sub(d, b));
        let next = |i: usize| (i + 1) % 4;
        let side = |i: usize| across([near[i], far[i], far[next(i)], near[next(i)]]);
        let normals = core::array::from_fn(|i| if i < 4 { side(i) } else { across([near, far][i - 4]) });
        let edges: [[f64; 3]; 12] = core::array::from_fn(|i| match i / 4 {
            0 => sub(far[i], near[i]),
            face => {
                let (face, i) = ([near, far][face - 1], i % 4);
                sub(face[next(i)], face[i])
            }
        });
        Self::new(corners, normals, &edges)
    }

    fn new(corners: [[f64; 3]; 8], normals: [[f64; 3]; 6], given: &[[f64; 3]]) -> Self {
        let is_finite = corners.iter().flatten().all(|x| x.is_finite());
        let greatest = corners.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        let magnitude = if is_finite { greatest } else { f64::NAN };
        let axes = core::array::from_fn(|i| if i < 6 { normals[i] } else { COORDINATE_AXES[i - 6] });
        let mut edges = [[0.0; 3]; 12];
        edges[..given.len()].copy_from_slice(given);
        let is_thin = |axis: &[f64; 3]| {
            let [min, max] = interval(&corners, *axis);
            max - min <= slack(magnitude, *axis)
        };
        let is_flat = normals.iter().all(is_thin);
        Self { corners, axes, edges, n_edges: given.len(), is_flat, magnitude }
    }

    /// The region under an affine map, given by its rows with the translation last, and the map's inverse.
    ///
    /// The map is computed in `f64`. Its roundings, and those of an inverse that was computed, are at most those of coordinates times the
    /// condition number of the map.
    #[must_use]
    pub fn transformed(&self, to: &[[f64; 4]; 3], from: &[[f64; 4]; 3]) -> Self {
        let linear = |v: [f64; 3]| to.map(|[x, y, z, _]| x * v[0] + y * v[1] + z * v[2]);
        let corners = self.corners.map(|corner| core::array::from_fn(|k| linear(corner)[k] + to[k][3]));
        // A normal is mapped by the transposed inverse.
        let normal = |n: [f64; 3]| core::array::from_fn(|k| from[0][k] * n[0] + from[1][k] * n[1] + from[2][k] * n[2]);
        let axes = core::array::from_fn(|i| if i < 6 { normal(self.axes[i]) } else { COORDINATE_AXES[i - 6] });
        // Terms of sums, which may cancel.
        let row_sum = |[x, y, z, _]: [f64; 4]| x.abs() + y.abs() + z.abs();
        let [norm, norm_of_inverse] = [to, from].map(|rows| rows.map(row_sum).into_iter().fold(0.0, f64::max));
        let terms = to.map(|row| (row_sum(row) * self.magnitude + row[3].abs()) * (1.0 + norm * norm_of_inverse));
        let magnitude = if self.magnitude.is_finite() { terms.into_iter().fold(0.0, f64::max) } else { f64::NAN };
        Self { corners, axes, edges: self.edges.map(linear), magnitude, ..*self }
    }

    /// The interval of the region along `axis`.
    #[must_use]
    pub fn interval(&self, axis: [f64; 3]) -> [f64; 2] {
        interval(&self.corners, axis)
    }

    /// A box around the region; empty for a region that overlaps nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        if !self.magnitude.is_finite() {
            return Aabb::EMPTY;
        }
        let intervals = COORDINATE_AXES.map(|axis| self.interval(axis));
        Aabb { min: intervals.map(|[min, _]| down(min)), max: intervals.map(|[_, max]| up(max)) }
    }

    /// Axes along which every overlap test looks for a gap: across the faces, and the coordinate axes.
    #[must_use]
    pub fn axes(&self) -> &[[f64; 3]; 9] {
        &self.axes
    }

    /// Greatest absolute coordinate; NaN if one is not finite, and of an empty box.
    #[must_use]
    pub fn magnitude(&self) -> f64 {
        self.magnitude
    }

    /// Whether the region and a triangle share a point; touching counts.
    ///
    /// An overlap is never denied; a gap below 2^-46 of the coordinates may be reported as an overlap.
    /// By separating axes: normals of both, and cross products of their edges. Source: Ericson 2005, section 5.2.1.
    #[must_use]
    pub fn overlaps_triangle(&self, vertices: &[[f32; 3]; 3]) -> bool {
        let points = vertices.map(to_f64);
        let edges = [sub(points[1], points[0]), sub(points[2], points[1]), sub(points[0], points[2])];
        self.overlaps(&points, &[cross(edges[0], edges[1])], &edges)
    }

    /// Whether the region and an axis-aligned box share a point, with the same error as for triangles.
    #[must_use]
    pub fn overlaps_aabb(&self, aabb: &Aabb) -> bool {
        let other = Self::from_aabb(aabb.min, aabb.max);
        !aabb.is_empty() && self.overlaps(&other.corners, &COORDINATE_AXES, &COORDINATE_AXES)
    }

    /// Whether the region and a solid ball share a point; touching counts.
    ///
    /// An overlap is never denied; a gap below 2^-44 of the coordinates may be reported as an overlap.
    #[must_use]
    pub fn overlaps_ball(&self, center: [f64; 3], radius: f64) -> bool {
        let reach = center.iter().fold(self.magnitude, |most: f64, x| most.max(x.abs())) + radius;
        if !(self.magnitude.is_finite() && reach.is_finite()) {
            return false;
        }
        let beyond = |axis: [f64; 3]| {
            let ([min, max], at) = (self.interval(axis), dot(axis, center));
            ((min - at).max(at - max), slack(reach, axis))
        };
        let is_separated = self.axes.iter().any(|&axis| {
            let (gap, slack) = beyond(axis);
            gap > radius * length(axis) + slack
        });
        // A region with a volume is what is between its faces.
        let is_inside = || !self.is_flat && self.axes.iter().all(|&axis| beyond(axis).0 <= 0.0);
        !is_separated && (is_inside() || self.distance_to_triples(center) <= radius + BALL_ERROR * reach)
    }

    /// The distance of a point from the triangles of any three corners: of these the surface of the region consists, and the rest is
    /// inside.
    fn distance_to_triples(&self, point: [f64; 3]) -> f64 {
        let corners = self.corners.map(|corner| sub(corner, point));
        let triples = (0..8).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [i, j, k])));
        let squared = |triple: [usize; 3]| closest_to_zero(&triple.map(|i| corners[i])).distance_squared;
        canted_obb::vector::sqrt(triples.map(squared).fold(f64::INFINITY, f64::min))
    }

    /// Whether the region lies in the ball, without touching the sphere around it, but for a gap below 2^-44 of the coordinates.
    #[must_use]
    pub fn is_inside_ball(&self, center: [f64; 3], radius: f64) -> bool {
        let reach = center.iter().fold(self.magnitude, |most: f64, x| most.max(x.abs())) + radius;
        self.corners.iter().all(|&corner| length(sub(corner, center)) < radius - BALL_ERROR * reach)
    }

    /// Whether the region lies between the faces of a box, without touching them, but for a gap below 2^-46 of the coordinates.
    #[must_use]
    pub fn is_inside_aabb(&self, aabb: &Aabb) -> bool {
        let reach = self.magnitude.max(f64::from(aabb.reach()));
        (0..3).all(|k| {
            let axis = COORDINATE_AXES[k];
            let ([min, max], slack) = (self.interval(axis), slack(reach, axis));
            min > f64::from(aabb.min[k]) + slack && max < f64::from(aabb.max[k]) - slack
        })
    }

    fn overlaps(&self, points: &[[f64; 3]], normals: &[[f64; 3]], edges: &[[f64; 3]]) -> bool {
        let magnitude = points.iter().flatten().fold(self.magnitude, |most, x| most.max(x.abs()));
        let is_separating = |axis: [f64; 3]| {
            let ([a_min, a_max], [b_min, b_max]) = (self.interval(axis), interval(points, axis));
            (a_min - b_max).max(b_min - a_max) > slack(magnitude, axis)
        };
        let own_edges = &self.edges[..self.n_edges];
        let mut crossed = own_edges.iter().flat_map(|&a| edges.iter().map(move |&b| cross(a, b)));
        // Two figures in one plane are separated within it.
        let plane = if self.is_flat { plane_of(&self.corners, points) } else { [0.0; 3] };
        let mut in_plane = own_edges.iter().chain(edges).map(|&edge| cross(plane, edge));
        self.magnitude.is_finite()
            && !(self.axes.iter().chain(normals).any(|&axis| is_separating(axis))
                || crossed.any(is_separating)
                || in_plane.any(is_separating))
    }
}

/// Three axes, each listed twice.
fn twice(axes: [[f64; 3]; 3]) -> [[f64; 3]; 6] {
    core::array::from_fn(|i| axes[i % 3])
}

/// The normal of the plane through all points of two figures, if there is one; zero if they are on a line.
fn plane_of(corners: &[[f64; 3]], points: &[[f64; 3]]) -> [f64; 3] {
    let offsets = || corners.iter().chain(points).map(|&point| sub(point, corners[0]));
    let longer = |a: [f64; 3], b: [f64; 3]| if dot(b, b) > dot(a, a) { b } else { a };
    let longest = offsets().fold([0.0; 3], longer);
    offsets().map(|offset| cross(longest, offset)).fold([0.0; 3], longer)
}

/// What roundings may add to a gap along `axis`.
fn slack(magnitude: f64, axis: [f64; 3]) -> f64 {
    PROJECTION_ERROR * magnitude * (axis[0].abs() + axis[1].abs() + axis[2].abs())
}

fn interval(points: &[[f64; 3]], axis: [f64; 3]) -> [f64; 2] {
    let along = points.iter().map(|&point| dot(point, axis));
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], x| [min.min(x), max.max(x)])
}
