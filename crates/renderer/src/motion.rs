use canted_obb::Affine;
use canted_tlas::Motion;
use canted_trace::{Hit, Query};

use crate::mask::RayKeyed;
use crate::vector::{Vector, add, cross, scale, wide};

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

    pub(crate) fn on_the_way(motion: &Motion, time: f32) -> Self {
        Self::new(motion.world_from_object(time))
    }

    pub(crate) fn still(map: &Affine) -> Self {
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

/// A query with the time of its rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timed<Q> {
    pub(crate) inner: Q,
    pub(crate) time: f32,
}

impl<Q: RayKeyed> RayKeyed for Timed<Q> {
    fn keyed(&self, number: u32) -> Self {
        Self { inner: self.inner.keyed(number), ..*self }
    }
}

impl<Q: Query> Query for Timed<Q> {
    const MAY_REJECT: bool = Q::MAY_REJECT;

    #[inline]
    fn boxes(&mut self, n: u32) {
        self.inner.boxes(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.inner.triangles(n);
    }
    #[inline]
    fn time(&self) -> f32 {
        self.time
    }
    #[inline]
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.inner.accepts(hit)
    }
}
