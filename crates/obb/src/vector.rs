//! Arithmetic of three-component arrays, shared by the workspace, and the float functions that `core` lacks. Not part of the stable
//! interface.
//!
//! Every function fixes the order of its operations: results are the same bits wherever it is used. Float functions are from `std`, or
//! from the crate `libm` where there is no `std`. Square root and fused multiply-add are correctly rounded in both; sine, cosine and arc
//! tangent may differ in the last place.

use core::ops::{Add, Mul, Sub};

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("canted-obb needs the feature `std` or the feature `libm`");

macro_rules! float_functions {
    ($($doc:literal $name:ident($($x:ident),+) -> $out:ty = $std:expr, $libm:expr;)+) => {$(
        #[doc = $doc]
        #[inline]
        #[must_use]
        pub fn $name($($x: f64),+) -> $out {
            #[cfg(feature = "std")]
            return $std;
            #[cfg(all(feature = "libm", not(feature = "std")))]
            return $libm;
            #[cfg(not(any(feature = "std", feature = "libm")))]
            unreachable!()
        }
    )+};
}

float_functions! {
    "Square root, also without a standard library." sqrt(x) -> f64 = x.sqrt(), libm::sqrt(x);
    "`a·b + c`, rounded once." mul_add(a, b, c) -> f64 = a.mul_add(b, c), libm::fma(a, b, c);
    "Sine and cosine." sin_cos(x) -> (f64, f64) = x.sin_cos(), libm::sincos(x);
    "The angle of `(x, y)`." atan2(y, x) -> f64 = y.atan2(x), libm::atan2(y, x);
}

/// A point or direction in `f64`.
pub type Vector = [f64; 3];

/// Each component in `f64`, exactly.
#[inline(always)]
#[must_use]
pub fn to_f64([x, y, z]: [f32; 3]) -> Vector {
    [x.into(), y.into(), z.into()]
}

/// Each component rounded to `f32`.
#[inline]
#[must_use]
pub fn to_f32(v: Vector) -> [f32; 3] {
    v.map(|x| x as f32)
}

/// `a + b`.
#[inline]
#[must_use]
pub fn add<T: Copy + Add<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
#[inline]
#[must_use]
pub fn sub<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `s · a`.
#[inline]
#[must_use]
pub fn scale<T: Copy + Mul<Output = T>>(a: [T; 3], s: T) -> [T; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a · b`, summed from the left.
#[inline]
#[must_use]
pub fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// `a × b`.
#[inline]
#[must_use]
pub fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length.
#[inline]
#[must_use]
pub fn length(a: Vector) -> f64 {
    sqrt(dot(a, a))
}

/// Greatest absolute component; that of a point is its reach ([`Aabb::reach`](crate::Aabb::reach)).
#[inline]
#[must_use]
pub fn reach(a: Vector) -> f64 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

/// The unit vector along `a`, at any scale; `None` for zero and for a component that is not finite.
#[must_use]
pub fn normalized(a: Vector) -> Option<Vector> {
    let reach = reach(a);
    if !(reach > 0.0 && a.iter().all(|x| x.is_finite())) {
        return None;
    }
    let a = scale(a, crate::round::binade_inverse(reach));
    Some(scale(a, 1.0 / length(a)))
}

/// The unit vector along `a` by one division; `None` for zero and where the square of `a` leaves the range of `f64`.
#[inline]
#[must_use]
pub fn unit(a: Vector) -> Option<Vector> {
    let length = length(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}
