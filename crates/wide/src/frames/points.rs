//! Vertices in leaf order, scaled and near the origin, four lanes a triangle.

use canted_lbvh::Corners;
use glam::{Vec3A, Vec4};

use crate::par;

/// A triangle's vertices, the first of them twice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

/// The vertices of all leaves, in leaf order.
pub(super) struct Points {
    triangles: Vec<Triangle>,
}

/// Triangles that one job converts.
const CHUNK: usize = 1 << 14;

impl Points {
    /// Scales `corners` and moves the first vertex to the origin.
    ///
    /// Scaling by a power of two is exact. Near the origin projections keep the digits that they would lose to an
    /// offset of the whole scene.
    pub(super) fn of(corners: &[Corners], scale: f32) -> Self {
        let origin = corners.first().map_or(Vec3A::ZERO, |c| Vec3A::from_array(c[0]) * scale);
        let unset = Triangle { x: Vec4::ZERO, y: Vec4::ZERO, z: Vec4::ZERO };
        let triangles = par::map(corners, CHUNK, unset, |corners| {
            Triangle::of(corners.map(|p| Vec3A::from_array(p) * scale - origin))
        });
        Self { triangles }
    }

    /// All triangles.
    pub(super) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }
}

impl Triangle {
    fn of([a, b, c]: [Vec3A; 3]) -> Self {
        Self { x: Vec4::new(a.x, b.x, c.x, a.x), y: Vec4::new(a.y, b.y, c.y, a.y), z: Vec4::new(a.z, b.z, c.z, a.z) }
    }

    /// The three vertices.
    #[inline]
    pub(super) fn vertices(&self) -> [Vec3A; 3] {
        let (x, y, z) = (self.x.to_array(), self.y.to_array(), self.z.to_array());
        [0, 1, 2].map(|k| Vec3A::new(x[k], y[k], z[k]))
    }

    /// Projections of the vertices, taken about `origin`, to a row.
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

/// Extents of every `stride`-th of some triangles along `N` rows; zeros for none.
///
/// Projections are taken about a vertex, so the digits lost are those of the extent and not of the place.
#[inline]
pub(super) fn extents<const N: usize>(triangles: &[Triangle], stride: usize, rows: &[Vec3A; N]) -> [f32; N] {
    let Some((first, others)) = triangles.split_first() else { return [0.0; N] };
    let rows = rows.map(|row| [Vec4::splat(row.x), Vec4::splat(row.y), Vec4::splat(row.z)]);
    let origin = first.first();
    let mut low = rows.map(|row| first.along(&row, &origin));
    let mut high = low;
    let mut grow = |triangle: &Triangle| {
        for k in 0..N {
            let along = triangle.along(&rows[k], &origin);
            low[k] = low[k].min(along);
            high[k] = high[k].max(along);
        }
    };
    // Most nodes are small, and a step that is not one costs them more than it saves the others.
    if stride == 1 {
        others.iter().for_each(&mut grow);
    } else {
        triangles.iter().step_by(stride).for_each(&mut grow);
    }
    std::array::from_fn(|k| high[k].max_element() - low[k].min_element())
}

/// Half of the surface area of a box with these sides.
#[inline]
pub(super) fn half_area([x, y, z]: [f32; 3]) -> f32 {
    (x + z) * y + z * x
}
