//! An instance prepared for shading: its transform for points and normals, and the error bound of rays that leave it
//! (derived at [`canted_trace::SurfacePoint`]).

use std::borrow::Cow;

use canted_obb::Affine;
use canted_tlas::Motion;
use canted_trace::{SurfacePoint, position_error};

use crate::vector::{Vector, add, cross, scale, wide};

/// `world_from_object` at one time, prepared for points and normals.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    columns: [Vector; 4],
    /// Columns of the cofactor matrix, which maps object normals to world normals up to length and sign.
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

    /// World-space normal of the image of a plane with normal `normal_object`; any length, either side.
    ///
    /// Same direction as the inverse transpose, without a division.
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
    /// Pose of a static instance, or of a moving one as the shutter opens.
    fixed: Pose,
    /// Error along each world axis between the plane of a triangle and a ray that leaves it.
    slack: f64,
    is_mirrored: bool,
    /// The motion of a moving instance.
    motion: Option<Box<Motion>>,
}

impl Placement {
    /// Prepares an instance of a mesh whose maximum absolute coordinate is `reach_object`.
    ///
    /// An instance that moves to `close` uses the larger reach of both ends: every coordinate is convex along a
    /// straight line, so no time in between exceeds it.
    pub(crate) fn new(world_from_object: &Affine, close: Option<&Affine>, reach_object: f32) -> Self {
        let reach_world =
            std::iter::once(world_from_object).chain(close).map(|map| map.reach(reach_object)).fold(0.0, f64::max);
        Self {
            fixed: Pose::fixed(world_from_object),
            // No intermediate transform is singular, so the sign is constant.
            is_mirrored: world_from_object.determinant() < 0.0,
            motion: close.map(|close| Box::new(Motion::new(world_from_object, close))),
            slack: position_error(reach_world),
        }
    }

    /// Whether the transform mirrors, which reverses the winding of triangles.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// The pose at a shutter time.
    pub(crate) fn pose(&self, time: f32) -> Cow<'_, Pose> {
        match &self.motion {
            None => Cow::Borrowed(&self.fixed),
            Some(motion) => Cow::Owned(Pose::at_time(motion, time)),
        }
    }

    /// Distance at which rays start from a surface with this unit normal, in world units.
    pub(crate) fn offset(&self, normal_world: Vector) -> f64 {
        SurfacePoint::with_error([0.0; 3], normal_world, self.slack).offset
    }
}
