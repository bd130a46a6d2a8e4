//! What an instance does to normals, and how far off its surfaces new rays start.
//!
//! # The offset
//!
//! A ray that leaves a surface must not meet it again through rounding. Let `u = 2⁻²⁴`, `ρ` the greatest absolute
//! vertex coordinate of the mesh, `M` and `T` the linear part and translation of `world_from_object`,
//! `R_k = ρ·Σ_i |M_ki|` and `W` the greatest `R_k + |T_k|`: no coordinate of the instance in world space is above `W`.
//! The origin is the hit point, which `f64` knows to a part in 2⁵⁰, moved along the normal and rounded to `f32`: an
//! error of `u·W` along each axis. Then, along each axis,
//!
//! - a tracer with one level has rounded the vertices to world space, `u·W`, and accepts points within
//!   [`HIT_ERROR`]` · (|o|∞ + ρ∞) <= HIT_ERROR · 2W` of a triangle;
//! - a tracer with two levels rounds origin and direction to object space. Up to any point of the instance the ray
//!   moves at most `2ρ` along an object axis, so these are `u·ρ` and `u·2ρ`; it accepts points within
//!   `HIT_ERROR · 2ρ`. `M` takes the sum to at most `(2·HIT_ERROR + 3u)·R_k` in world space.
//!
//! Either way the errors of origin and hit stay within `slack = (2·HIT_ERROR + 4u)·W` along each axis, and within
//! `slack · (|n_x| + |n_y| + |n_z|)` along a unit normal `n`. A ray that starts that far off the plane of its triangle
//! and leads away from it meets neither that triangle nor any other of the instance on the plane's far side; that
//! covers every neighbour over a convex edge.
//!
//! Nothing here is a fixed length: the offset scales with the scene, bit for bit under powers of two. What lies
//! closer to a surface than its offset, be it a coplanar surface of another instance or the far wall of a wedge, is
//! below what `f32` positions resolve and may be missed or met.

use std::borrow::Cow;

use canted_obb::Affine;
use canted_tlas::Motion;
use canted_trace::HIT_ERROR;

use crate::vector::{Vector, add, cross, scale, wide};

/// Half a unit in the last place of 1.
const U: f64 = 0.5 * f32::EPSILON as f64;

/// Covers terms of second order: `f64` roundings, and origins that lie above `W` by the offset itself, all below 2⁻¹⁶.
const ROOM: f64 = 1.0 + 1.0 / 1024.0;

/// `world_from_object` of an instance that stands still, or at a time on the way, ready for points and normals.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    columns: [Vector; 4],
    /// Columns of the cofactor matrix, which takes object normals to world normals but for length and sign.
    cofactor: [Vector; 3],
}

impl Pose {
    fn new(columns: [Vector; 4]) -> Self {
        Self { columns, cofactor: cofactors(&columns) }
    }

    pub(crate) fn at_time(motion: &Motion, time: f32) -> Self {
        Self::new(motion.world_from_object(time))
    }

    pub(crate) fn fixed(map: &Affine) -> Self {
        Self::new(map.columns.map(wide))
    }

    pub(crate) fn point_world(&self, point_object: Vector) -> Vector {
        add(self.vector_world(point_object), self.columns[3])
    }

    pub(crate) fn vector_world(&self, [x, y, z]: Vector) -> Vector {
        let [a, b, c, _] = self.columns;
        add(add(scale(a, x), scale(b, y)), scale(c, z))
    }

    /// World-space direction perpendicular to the image of a plane with normal `normal_object`; any length, either side.
    ///
    /// The inverse transpose would give the same direction; cofactors need no division.
    pub(crate) fn normal_world(&self, [x, y, z]: Vector) -> Vector {
        let [a, b, c] = self.cofactor;
        add(scale(a, x), add(scale(b, y), scale(c, z)))
    }
}

/// Columns of the cofactor matrix of the linear part.
pub(crate) fn cofactors([x, y, z, _]: &[Vector; 4]) -> [Vector; 3] {
    [cross(*y, *z), cross(*z, *x), cross(*x, *y)]
}

/// One instance, prepared for shading.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    /// Where it stands, or where a moving one starts.
    fixed: Pose,
    /// Error along each world axis between the plane of a triangle and a ray that leaves it.
    slack: f64,
    is_mirrored: bool,
    /// The way of an instance that moves.
    motion: Option<Box<Motion>>,
}

impl Placement {
    /// Prepares a mesh whose greatest absolute coordinate is `reach_object`, placed by an invertible map.
    ///
    /// One that moves to `close` has the greater `W` of the two ends: `R_k` and `|T_k|` are convex along a straight line, so
    /// no time between exceeds it. It is traced with two levels.
    pub(crate) fn new(world_from_object: &Affine, close: Option<&Affine>, reach_object: f32) -> Self {
        let reach_world =
            std::iter::once(world_from_object).chain(close).map(|map| map.reach(reach_object)).fold(0.0, f64::max);
        Self {
            fixed: Pose::fixed(world_from_object),
            // No transform on the way is singular, so none changes the side.
            is_mirrored: world_from_object.determinant() < 0.0,
            motion: close.map(|close| Box::new(Motion::new(world_from_object, close))),
            // The last term is for subnormal numbers, whose rounding is absolute.
            slack: ROOM * (2.0 * f64::from(HIT_ERROR) + 4.0 * U) * reach_world + f64::from(f32::MIN_POSITIVE),
        }
    }

    /// Whether the transform mirrors: what runs counter-clockwise then runs clockwise.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// Where the instance is at a time of the shutter.
    pub(crate) fn pose(&self, time: f32) -> Cow<'_, Pose> {
        match &self.motion {
            None => Cow::Borrowed(&self.fixed),
            Some(motion) => Cow::Owned(Pose::at_time(motion, time)),
        }
    }

    /// Distance that new rays keep off a surface with this unit normal, in world units.
    pub(crate) fn offset(&self, normal_world: Vector) -> f64 {
        self.slack * normal_world.iter().map(|x| x.abs()).sum::<f64>()
    }
}
