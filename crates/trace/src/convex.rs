use canted_obb::vector::{cross, dot, sub, to_f64};
use canted_obb::{Aabb, Obb};

use crate::rounding::UNIT_ROUNDOFF_F64;

/// Rounding of a projection onto an axis, relative to the sum of the axis' absolute components times the greatest
/// coordinate: three roundings touch a product, and four a corner of an oriented box; two projections are compared, doubled.
const PROJECTION_ERROR: f64 = 32.0 * UNIT_ROUNDOFF_F64;

const COORDINATE_AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

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
    edges: [[f64; 3]; 6],
    magnitude: f64,
}

impl Convex {
    /// The axis-aligned box from `min` to `max`.
    #[must_use]
    pub fn from_aabb(min: impl Into<[f32; 3]>, max: impl Into<[f32; 3]>) -> Self {
        let planes = [to_f64(min.into()), to_f64(max.into())];
        let corners = core::array::from_fn(|corner| core::array::from_fn(|k| planes[corner >> k & 1][k]));
        Self::new(corners, twice(COORDINATE_AXES), twice(COORDINATE_AXES))
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
        Self::new(corners, twice(faces), twice(axes))
    }

    /// A frustum, or any solid with six flat faces: four corners of the near face in order around it, then those of the far
    /// face in the same order.
    #[must_use]
    pub fn from_frustum(near: [[f32; 3]; 4], far: [[f32; 3]; 4]) -> Self {
        let [near, far] = [near, far].map(|face| face.map(to_f64));
        let corners: [[f64; 3]; 8] = core::array::from_fn(|i| if i < 4 { near[i] } else { far[i - 4] });
        let sides: [[f64; 3]; 4] = core::array::from_fn(|i| sub(far[i], near[i]));
        let around = [sub(far[1], far[0]), sub(far[2], far[1])];
        // The far face is the larger one; a near face may be a point.
        let facing = cross(around[0], around[1]);
        let normals = |i: usize| if i < 4 { cross(sub(far[(i + 1) % 4], far[i]), sides[i]) } else { facing };
        let edges = |i: usize| if i < 4 { sides[i] } else { around[i - 4] };
        Self::new(corners, core::array::from_fn(normals), core::array::from_fn(edges))
    }

    fn new(corners: [[f64; 3]; 8], normals: [[f64; 3]; 6], edges: [[f64; 3]; 6]) -> Self {
        let magnitude = corners.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        let axes = core::array::from_fn(|i| if i < 6 { normals[i] } else { COORDINATE_AXES[i - 6] });
        Self { corners, axes, edges, magnitude }
    }

    /// The interval of the region along `axis`.
    #[must_use]
    pub fn interval(&self, axis: [f64; 3]) -> [f64; 2] {
        interval(&self.corners, axis)
    }

    /// Axes along which every overlap test looks for a gap: across the faces, and the coordinate axes.
    #[must_use]
    pub fn axes(&self) -> &[[f64; 3]; 9] {
        &self.axes
    }

    /// Greatest absolute coordinate.
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
        !aabb.is_empty() && self.overlaps(&other.corners, &other.axes[..3], &other.edges[..3])
    }

    fn overlaps(&self, points: &[[f64; 3]], normals: &[[f64; 3]], edges: &[[f64; 3]]) -> bool {
        let magnitude = points.iter().flatten().fold(self.magnitude, |most, x| most.max(x.abs()));
        let is_separating = |axis: [f64; 3]| {
            let ([a_min, a_max], [b_min, b_max]) = (self.interval(axis), interval(points, axis));
            let slack = PROJECTION_ERROR * magnitude * (axis[0].abs() + axis[1].abs() + axis[2].abs());
            (a_min - b_max).max(b_min - a_max) > slack
        };
        let mut crossed = self.edges.iter().flat_map(|&a| edges.iter().map(move |&b| cross(a, b)));
        !(self.axes.iter().chain(normals).any(|&axis| is_separating(axis)) || crossed.any(is_separating))
    }
}

/// Three axes, each listed twice.
fn twice(axes: [[f64; 3]; 3]) -> [[f64; 3]; 6] {
    core::array::from_fn(|i| axes[i % 3])
}

fn interval(points: &[[f64; 3]], axis: [f64; 3]) -> [f64; 2] {
    let along = points.iter().map(|&point| dot(point, axis));
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], x| [min.min(x), max.max(x)])
}
