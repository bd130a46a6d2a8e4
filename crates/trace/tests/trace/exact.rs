//! Geometry in rational arithmetic; every finite float is rational.

use num_rational::BigRational;
use num_traits::{Signed, Zero};

use canted_trace::{ScaledRay, Slabs};

/// Relative error of one rounding to `f64`.
pub(crate) const UNIT_ROUNDOFF_F64: f64 = f64::EPSILON / 2.0;

pub(crate) type Q = BigRational;
pub(crate) type Q3 = [Q; 3];

/// The exact number.
pub(crate) fn q(x: impl Into<f64>) -> Q {
    BigRational::from_float(x.into()).expect("a finite number")
}

pub(crate) fn q3(a: [f32; 3]) -> Q3 {
    a.map(q)
}

pub(crate) fn dot(a: &Q3, b: &Q3) -> Q {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn sub(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| &a[k] - &b[k])
}

pub(crate) fn cross(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &a[i] * &b[j] - &a[j] * &b[i]
    })
}

pub(crate) fn at(ray: &ScaledRay, t: &Q) -> Q3 {
    std::array::from_fn(|k| q(ray.origin[k]) + t * q(ray.direction[k]))
}

/// Greatest absolute coordinate.
pub(crate) fn reach(a: &Q3) -> Q {
    a.iter().map(Signed::abs).max().expect("three coordinates")
}

pub(crate) fn contains(slabs: &Slabs, point: &Q3) -> bool {
    (0..3).all(|k| {
        let place = dot(&q3(slabs.rows[k]), point);
        q(slabs.lo[k]) <= place && place <= q(slabs.hi[k])
    })
}

/// The interval of all real `t >= ray.t_min` at which the ray is in the box; without rounding.
pub(crate) fn clip(slabs: &Slabs, ray: &ScaledRay) -> Option<(Q, Option<Q>)> {
    let (mut near, mut far) = (q(ray.t_min), None::<Q>);
    for k in 0..3 {
        let row = q3(slabs.rows[k]);
        let (origin, slope) = (dot(&row, &q3(ray.origin)), dot(&row, &q3(ray.direction)));
        let (below, above) = (q(slabs.lo[k]) - &origin, q(slabs.hi[k]) - &origin);
        if slope.is_zero() {
            if below.is_positive() || above.is_negative() {
                return None;
            }
            continue;
        }
        let (enter, leave) = if slope.is_positive() { (below, above) } else { (above, below) };
        near = near.max(enter / &slope);
        let leave = leave / &slope;
        far = Some(far.map_or(leave.clone(), |far| far.min(leave)));
    }
    far.as_ref().is_none_or(|far| near <= *far).then_some((near, far))
}

/// `(det, u·det, v·det, t·det)` of the line of the ray and the plane of the triangle, with signs such that `det >= 0`.
pub(crate) fn triangle(ray: &ScaledRay, vertices: &[[f32; 3]; 3]) -> (Q, Q, Q, Q) {
    let [v0, v1, v2] = vertices.map(q3);
    let (o, d) = (q3(ray.origin), q3(ray.direction));
    let (e1, e2, s) = (sub(&v1, &v0), sub(&v2, &v0), sub(&o, &v0));
    let (p, n) = (cross(&d, &e2), cross(&s, &e1));
    let solved = (dot(&p, &e1), dot(&p, &s), dot(&n, &d), dot(&n, &e2));
    if solved.0.is_negative() { (-solved.0, -solved.1, -solved.2, -solved.3) } else { solved }
}
