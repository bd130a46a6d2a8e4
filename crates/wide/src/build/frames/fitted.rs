//! What frames are fitted to: triangles, and balls of primitives of the caller that have them, in leaf order, scaled and near the origin, in four
//! lanes each; other primitives with extents and principal axes as they report them.

use canted_lbvh::Corners;
use canted_obb::{Moments, eigen};
use glam::{Vec3A, Vec4};

use super::vector::{frame, to_glam, unit};
use crate::leaf::Placed;
use crate::par;

/// A primitive, scaled so that the largest extent of the scene is about one.
pub(crate) trait Fitted: Send + Sync + Sized {
    /// Weight, mean and scatter, for principal axes.
    fn moments(&self) -> Moments;

    /// A frame of its own that may have a smaller box than `most`, half of a surface area; `None` where none has.
    fn own_frame(&self, most: f32) -> Option<[Vec3A; 3]>;

    /// Other frames of its own, worth trying for the few primitives around the largest one.
    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]>;

    /// Extents of every `stride`-th of some primitives along `N` rows; zeros for none.
    fn extents<const N: usize>(items: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N];
}

/// The principal axes, where they are finite. Coarse ones: with exact axes the plan has more leaves of several segments, and 0.92 to 0.98 of the rays
/// a second.
pub(super) fn principal_frame(moments: &Moments) -> Option<[Vec3A; 3]> {
    let rows = to_glam(moments.axes(eigen::COARSE));
    rows.iter().all(|row| row.is_finite()).then_some(rows)
}

/// Half of the surface area of a box with these sides.
#[inline]
pub(super) fn half_area([x, y, z]: [f32; 3]) -> f32 {
    (x + z) * y + z * x
}

/// A triangle's vertices, the first of them twice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScaledTriangle {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

/// Triangles that one job converts.
const CHUNK: usize = 1 << 14;

/// Scales edges to a size at which no product of three underflows or overflows: from 1e-9 of the scene to all of it.
const ENLARGED: f32 = 4096.0;

impl ScaledTriangle {
    /// Scales `corners` and moves the first vertex to the origin.
    ///
    /// Scaling by a power of two is exact. Near the origin projections keep the digits that they would lose to an
    /// offset of the whole scene.
    pub(crate) fn all(corners: &[Corners], scale: f32) -> Vec<Self> {
        let origin = corners.first().map_or(Vec3A::ZERO, |c| Vec3A::from_array(c[0]) * scale);
        par::map(corners, CHUNK, |corners| Self::of(corners.map(|p| Vec3A::from_array(p) * scale - origin)))
    }

    fn of([a, b, c]: [Vec3A; 3]) -> Self {
        Self { x: Vec4::new(a.x, b.x, c.x, a.x), y: Vec4::new(a.y, b.y, c.y, a.y), z: Vec4::new(a.z, b.z, c.z, a.z) }
    }

    #[inline]
    fn vertices(&self) -> [Vec3A; 3] {
        let (x, y, z) = (self.x.to_array(), self.y.to_array(), self.z.to_array());
        [0, 1, 2].map(|k| Vec3A::new(x[k], y[k], z[k]))
    }

    /// Projections of the vertices, relative to `origin`, to a row.
    #[inline]
    fn along(&self, row: &[Vec4; 3], origin: &[Vec4; 3]) -> Vec4 {
        (self.x - origin[0]) * row[0] + (self.y - origin[1]) * row[1] + (self.z - origin[2]) * row[2]
    }

    /// A vertex, in all lanes.
    #[inline]
    fn first(&self) -> [Vec4; 3] {
        [Vec4::splat(self.x.x), Vec4::splat(self.y.x), Vec4::splat(self.z.x)]
    }
}

impl Fitted for ScaledTriangle {
    fn moments(&self) -> Moments {
        Moments::from_triangle(self.vertices().map(|v| v.to_array()))
    }

    /// The frame along the longest edge: of all rectangles around a triangle its rectangle is the smallest, twice the
    /// triangle.
    fn own_frame(&self, most: f32) -> Option<[Vec3A; 3]> {
        let edges = Edges::of(self);
        // Half of the surface area of a flat box is the rectangle.
        if edges.normal.length_squared() >= (most * ENLARGED * ENLARGED).powi(2) {
            return None;
        }
        edges.frame_along(edges.longest())
    }

    /// Along the other two edges: the sides of a rectangle are edges of its two triangles, but not the longest.
    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]> {
        let edges = Edges::of(self);
        let longest = edges.longest();
        [(longest + 1) % 3, (longest + 2) % 3].into_iter().filter_map(move |edge| edges.frame_along(edge))
    }

    /// Projections are taken relative to a vertex, so the digits lost are those of the extent and not of the position.
    #[inline]
    fn extents<const N: usize>(triangles: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N] {
        let Some((first, others)) = triangles.split_first() else { return [0.0; N] };
        let rows = rows.map(|row| [Vec4::splat(row.x), Vec4::splat(row.y), Vec4::splat(row.z)]);
        let origin = first.first();
        let mut low = rows.map(|row| first.along(&row, &origin));
        let mut high = low;
        let mut grow = |triangle: &Self| {
            for k in 0..N {
                let along = triangle.along(&rows[k], &origin);
                low[k] = low[k].min(along);
                high[k] = high[k].max(along);
            }
        };
        // Most nodes are small; for them the adapter of the strided loop costs more than strides save elsewhere.
        if stride == 1 {
            others.iter().for_each(&mut grow);
        } else {
            triangles.iter().step_by(stride).for_each(&mut grow);
        }
        std::array::from_fn(|k| high[k].max_element() - low[k].min_element())
    }
}

/// Edges of a triangle and its normal, enlarged.
struct Edges {
    edges: [Vec3A; 3],
    normal: Vec3A,
}

impl Edges {
    #[inline]
    fn of(triangle: &ScaledTriangle) -> Self {
        let [a, b, c] = triangle.vertices();
        let edges = [(b - a) * ENLARGED, (c - b) * ENLARGED, (a - c) * ENLARGED];
        Self { edges, normal: edges[0].cross(edges[1]) }
    }

    /// Index of the longest edge.
    #[inline]
    fn longest(&self) -> usize {
        let squares = self.edges.map(Vec3A::length_squared);
        (1..3).fold(0, |best, k| if squares[k] > squares[best] { k } else { best })
    }

    /// The frame along an edge and the normal; `None` where edge or normal is too short.
    #[inline]
    fn frame_along(&self, edge: usize) -> Option<[Vec3A; 3]> {
        frame(self.edges[edge], self.normal)
    }
}

/// The balls of a primitive, [`Primitive::FIT_BALLS`](crate::Primitive::FIT_BALLS).
pub(crate) struct ScaledBalls {
    centers: [Vec4; 3],
    radii: Vec4,
}

/// The square of the bend relative to the chord up to which a curve is straight.
const STRAIGHT: f32 = 1e-6;

impl ScaledBalls {
    /// Scales the balls of all items and moves the first center to the origin; `None` where items have none.
    pub(crate) fn all(items: &[Placed], scale: f32) -> Option<Vec<Self>> {
        let first = items.first()?;
        let origin = first.reference.moved(center(first.primitive.fit_balls()?[0])).map(|x| x * scale);
        let of = |item: &Placed| {
            let balls = item.primitive.fit_balls().expect("all primitives are of one type");
            let mut rows = [[0.0; 4]; 4];
            for (i, ball) in balls.into_iter().enumerate() {
                let center = item.reference.moved(center(ball));
                for k in 0..3 {
                    rows[k][i] = center[k] * scale - origin[k];
                }
                rows[3][i] = ball[3] * scale;
            }
            let [x, y, z, radii] = rows.map(Vec4::from_array);
            Self { centers: [x, y, z], radii }
        };
        Some(par::map(items, CHUNK, of))
    }
}

#[cfg(test)]
impl ScaledBalls {
    /// Overwrites a ball by another.
    pub(crate) fn copy_ball(&mut self, from: usize, to: usize) {
        for row in self.centers.iter_mut().chain([&mut self.radii]) {
            row[to] = row[from];
        }
    }
}

fn center([x, y, z, _]: [f32; 4]) -> [f32; 3] {
    [x, y, z]
}

impl Fitted for ScaledBalls {
    /// Of the centers. [`Moments::from_points`] adds one point after the other, with a division each.
    fn moments(&self) -> Moments {
        let (mut mean, mut apart) = ([0.0; 3], [[0.0; 4]; 3]);
        for k in 0..3 {
            let [a, b, c, d] = self.centers[k].to_array();
            let row = [f64::from(a), f64::from(b), f64::from(c), f64::from(d)];
            mean[k] = 0.25 * ((row[0] + row[1]) + (row[2] + row[3]));
            apart[k] = [row[0] - mean[k], row[1] - mean[k], row[2] - mean[k], row[3] - mean[k]];
        }
        let sum = |i: usize, j: usize| {
            let (a, b) = (&apart[i], &apart[j]);
            (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
        };
        Moments { weight: 4.0, mean, scatter: [sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)] }
    }

    /// Along the chord, and as far as a curve is bent in the plane of its bend: a search for principal axes takes several times as long.
    fn own_frame(&self, _: f32) -> Option<[Vec3A; 3]> {
        let ball = |i: usize| Vec3A::from_array(self.centers.map(|row| row.to_array()[i]));
        let [a, b, c, d] = [ball(0), ball(1), ball(2), ball(3)];
        let (chord, bend) = (d - a, (b + c) - (a + d));
        if bend.length_squared() > chord.length_squared() {
            return principal_frame(&self.moments());
        }
        let along = unit(chord)?;
        let across = bend - along * bend.dot(along);
        let is_bent = across.length_squared() > STRAIGHT * chord.length_squared();
        let second = unit(if is_bent { across } else { along.any_orthonormal_vector() })?;
        Some([along, second, unit(along.cross(second))?])
    }

    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]> {
        std::iter::empty()
    }

    /// Relative to a center, as of triangles.
    #[inline]
    fn extents<const N: usize>(all: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N] {
        let Some(first) = all.first() else { return [0.0; N] };
        let origin = first.centers.map(|row| Vec4::splat(row.x));
        let rows = rows.map(|row| [Vec4::splat(row.x), Vec4::splat(row.y), Vec4::splat(row.z)]);
        let (mut low, mut high) = ([Vec4::MAX; N], [Vec4::MIN; N]);
        let mut grow = |balls: &Self| {
            let [x, y, z] = [0, 1, 2].map(|k| balls.centers[k] - origin[k]);
            for k in 0..N {
                let along = x * rows[k][0] + y * rows[k][1] + z * rows[k][2];
                low[k] = low[k].min(along - balls.radii);
                high[k] = high[k].max(along + balls.radii);
            }
        };
        if stride == 1 {
            all.iter().for_each(&mut grow);
        } else {
            all.iter().step_by(stride).for_each(&mut grow);
        }
        std::array::from_fn(|k| high[k].max_element() - low[k].min_element())
    }
}

/// A primitive and the scale of the scene.
pub(crate) struct ScaledShape<'a> {
    pub(crate) placed: Placed<'a>,
    pub(crate) scale: f32,
}

impl Fitted for ScaledShape<'_> {
    /// Moments that are not finite or have a negative weight count as none.
    fn moments(&self) -> Moments {
        let moments = self.placed.primitive.moments();
        let mut numbers = moments.mean.iter().chain(&moments.scatter).chain([&moments.weight]);
        if numbers.all(|x| x.is_finite()) && moments.weight >= 0.0 { moments } else { Moments::EMPTY }
    }

    fn own_frame(&self, _: f32) -> Option<[Vec3A; 3]> {
        principal_frame(&self.moments())
    }

    fn other_frames(&self) -> impl Iterator<Item = [Vec3A; 3]> {
        std::iter::empty()
    }

    fn extents<const N: usize>(shapes: &[Self], stride: usize, rows: &[Vec3A; N]) -> [f32; N] {
        let Some(first) = shapes.first() else { return [0.0; N] };
        let rows = rows.map(|row| row.to_array());
        let (mut lo, mut hi, mut extents) = ([f32::MAX; N], [f32::MIN; N], [[0.0; 2]; N]);
        // What boxes contain is decided later, so primitives are believed, and their intervals not moved.
        for shape in shapes.iter().step_by(stride) {
            shape.placed.primitive.extents_along(&rows, &mut extents);
            for k in 0..N {
                let [least, greatest] = extents[k];
                lo[k] = lo[k].min(least);
                hi[k] = hi[k].max(greatest);
            }
        }
        std::array::from_fn(|k| (hi[k] - lo[k]) * first.scale)
    }
}
