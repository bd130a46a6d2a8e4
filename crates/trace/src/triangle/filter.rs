/// Result of an f32 filter for a line and a triangle: barycentric coordinates times a determinant, and their error.
///
/// Holds: if `finish` accepts the triangle, then [`misses`](Self::misses) is false. For that, `error` must bound, in
/// units of `det`, the sum of
/// - the rounding of `u`, of `v` and of `u + v`, each with that of `det`, whose sign may then be wrong, too;
/// - `WEIGHT_SLACK·|det|`, the tolerance of `finish` for coordinates outside the triangle.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Proportional to the normal times the direction; positive or negative.
    pub det: f32,
    /// Coordinate of the second vertex, times `det`.
    pub u: f32,
    /// Coordinate of the third vertex, times `det`.
    pub v: f32,
    /// The bound; infinite if a product may have overflowed.
    pub error: f32,
}

impl Weights {
    /// Whether the line is certain to miss the triangle.
    #[inline]
    pub fn misses(&self) -> bool {
        let sign = 1.0f32.copysign(self.det);
        let (u, v) = (sign * self.u, sign * self.v);
        // NaN is left to `finish`.
        u < -self.error || v < -self.error || u + v > self.det.abs() + self.error
    }
}

/// Sum of the absolute components, cheaper than their maximum.
#[inline]
pub(super) fn norm([x, y, z]: [f32; 3]) -> f32 {
    x.abs() + y.abs() + z.abs()
}
