/// A ray `origin + t · direction` over the closed interval `t_min <= t <= t_max`.
///
/// The direction may have any length but zero and is never renormalised: `t` is one number in every space, in units
/// of the caller's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Start, in the space named by the variable that holds the ray.
    pub origin: [f32; 3],
    /// Direction, in the same space.
    pub direction: [f32; 3],
    /// Least accepted `t`, at least 0.
    pub t_min: f32,
    /// Greatest accepted `t`; infinity is allowed.
    pub t_max: f32,
}

impl Ray {
    /// A ray from `origin` without end.
    #[must_use]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// The point at `t`, computed in `f64`.
    #[must_use]
    pub fn at(&self, t: f64) -> [f64; 3] {
        std::array::from_fn(|k| f64::from(self.origin[k]) + t * f64::from(self.direction[k]))
    }
}
