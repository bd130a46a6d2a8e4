/// An affine map `x -> columns[0]·x + columns[1]·y + columns[2]·z + columns[3]`, column vectors.
///
/// Transforms are named by their spaces: `world_from_object` maps object coordinates to world coordinates.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Affine {
    /// Images of the three axes, then the image of the origin.
    pub columns: [[f32; 3]; 4],
}

impl Affine {
    /// The identity.
    pub const IDENTITY: Self = Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] };

    /// Image of a point, each coordinate computed in `f64` and rounded once.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub fn point(&self, p: impl Into<[f32; 3]>) -> [f32; 3] {
        self.point_f64(p.into().map(f64::from)).map(|x| x as f32)
    }

    /// Image of a point in `f64`.
    #[must_use]
    pub fn point_f64(&self, p: [f64; 3]) -> [f64; 3] {
        let linear = self.vector_f64(p);
        core::array::from_fn(|k| linear[k] + f64::from(self.columns[3][k]))
    }

    /// Image of a direction in `f64`: the linear part only.
    #[must_use]
    pub fn vector_f64(&self, v: [f64; 3]) -> [f64; 3] {
        let c = &self.columns;
        core::array::from_fn(|k| f64::from(c[0][k]) * v[0] + f64::from(c[1][k]) * v[1] + f64::from(c[2][k]) * v[2])
    }

    /// Determinant of the linear part; negative for a mirroring map.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        let c = |i: usize| self.columns[i].map(f64::from);
        let (a, b, d) = (c(0), c(1), c(2));
        a[0] * (b[1] * d[2] - b[2] * d[1]) + a[1] * (b[2] * d[0] - b[0] * d[2]) + a[2] * (b[0] * d[1] - b[1] * d[0])
    }

    /// Greatest row sum of absolute values of the linear part: its operator norm in the maximum norm.
    #[must_use]
    pub fn row_sum_norm(&self) -> f64 {
        (0..3).map(|k| self.columns[..3].iter().map(|column| f64::from(column[k]).abs()).sum()).fold(0.0, f64::max)
    }

    /// Bound on the reach ([`Aabb::reach`](crate::Aabb::reach)) of the image of points: on its absolute coordinates, if those of
    /// the points do not exceed `reach`.
    #[must_use]
    pub fn reach(&self, reach: f32) -> f64 {
        let [x, y, z, shift] = self.columns.map(|column| column.map(|c| f64::from(c).abs()));
        (0..3).map(|k| f64::from(reach) * (x[k] + y[k] + z[k]) + shift[k]).fold(0.0, f64::max)
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.columns.iter().flatten().all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_the_greatest_coordinate_of_a_mapped_cube() {
        let map = Affine { columns: [[1.0, -2.0, 0.5], [4.0, 3.0, 0.0], [-0.25, 0.0, 8.0], [-10.0, 0.0, 1.0]] };
        let corners = (0..8).map(|i| core::array::from_fn(|k| if i >> k & 1 == 0 { -2.0 } else { 2.0 }));
        let images = corners.clone().map(|corner| map.point_f64(corner));
        let greatest = images.flatten().map(f64::abs).fold(0.0, f64::max);
        assert_eq!(map.reach(2.0), greatest);
        let linear = corners.map(|corner| map.vector_f64(corner));
        let greatest = linear.flatten().map(f64::abs).fold(0.0, f64::max);
        assert_eq!(2.0 * map.row_sum_norm(), greatest);
        assert_eq!((Affine::IDENTITY.reach(3.0), Affine::IDENTITY.row_sum_norm()), (3.0, 1.0));
    }
}
