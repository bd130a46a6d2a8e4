/// What an f32 filter knows of a line and a triangle: the weights times a determinant, and their error.
///
/// Holds: if the finish accepts the triangle, then [`misses`](Self::misses) is false. For that, `error` must bound, in
/// units of `det`, the sum of
/// - the rounding of `u`, of `v` and of `u + v`, each with that of `det`, whose sign may then be wrong, too;
/// - `WEIGHT_SLACK·|det|`, by which the finish lets weights lie outside.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Proportional to the normal times the direction; positive or negative.
    pub det: f32,
    /// Weight of the second vertex, times `det`.
    pub u: f32,
    /// Weight of the third vertex, times `det`.
    pub v: f32,
    /// The bound; infinite where nothing is known, because a product might have overflown.
    pub error: f32,
}

impl Weights {
    /// Whether the line certainly misses the triangle.
    #[inline]
    pub fn misses(&self) -> bool {
        let sign = 1.0f32.copysign(self.det);
        let (u, v) = (sign * self.u, sign * self.v);
        // What is not a number stays for the finish.
        u < -self.error || v < -self.error || u + v > self.det.abs() + self.error
    }
}

/// Sum of the absolute components, cheaper than their greatest.
#[inline]
pub(super) fn norm([x, y, z]: [f32; 3]) -> f32 {
    x.abs() + y.abs() + z.abs()
}
