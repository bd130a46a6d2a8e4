use canted_obb::Aabb;
use canted_trace::{HIT_ERROR, Ray, ScaledRay, Side, Sphere};

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// Distance in units of the scaled direction.
    pub t: f32,
    /// Coordinates on the surface, as the primitive defines them.
    pub u: f32,
    /// See `u`.
    pub v: f32,
    /// The side met, as the primitive defines it.
    pub side: Side,
}

/// A shape of the caller's in a [`PrimitiveTree`](crate::PrimitiveTree).
///
/// It is a surface: a ray meets it in a few points, of which each is reported.
pub trait Primitive: Send + Sync {
    /// How far a reported point may lie outside of the bounds: each coordinate of `o + t·d`, in real arithmetic with
    /// the reported `t`, is within `ERROR·(|o|∞ + ρ∞)` of the bounds' interval, with `|o|∞` the greatest coordinate of
    /// the ray's origin and `ρ∞` that of the bounds. At most 1/8.
    ///
    /// A `t` computed in f64 and rounded once takes 2^-24 of it. Whoever states too little loses hits.
    const ERROR: f32 = HIT_ERROR;

    /// A box around it, object space: finite, not empty.
    fn bounds(&self) -> Aabb;

    /// The first hit with `ray.t_min <= t <= t_max`, by the ray's line alone: another interval may hide a hit but not
    /// change it.
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit>;
}

impl<P: Primitive> Primitive for &P {
    const ERROR: f32 = P::ERROR;

    fn bounds(&self) -> Aabb {
        P::bounds(self)
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        P::intersect(self, ray, t_max)
    }
}

/// A ray meets the front where it enters, the back where it leaves; surface coordinates are 0.
///
/// # Error
/// Let u = 2^-24 and `S = |o|∞ + ρ∞`, which bounds the radius and all coordinates. The roots are computed in f64: an
/// error of some 2^-50·S in the vector from the centre to the line moves the point from the sphere by as much; one of
/// the chord's square, of some 2^-50 relative, moves it along the line and from the sphere by less. Rounding `t` takes
/// u·S, rounding the bounds another: 2.1 u of the 20 u that are stated.
impl Primitive for Sphere {
    fn bounds(&self) -> Aabb {
        Aabb { min: self.center.map(|c| c - self.radius), max: self.center.map(|c| c + self.radius) }
    }

    #[inline]
    fn intersect(&self, ray: &ScaledRay, t_max: f32) -> Option<PrimitiveHit> {
        // A scaled ray's t is that of the ray with its direction.
        let [enters, leaves] = self.roots(&Ray::new(ray.origin, ray.direction))?;
        let (t, side) = if enters >= ray.t_min { (enters, Side::Front) } else { (leaves, Side::Back) };
        (ray.t_min <= t && t <= t_max).then_some(PrimitiveHit { t, u: 0.0, v: 0.0, side })
    }
}
