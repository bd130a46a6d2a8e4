//! The float functions that `core` lacks: from `std`, or from the crate `libm` where there is no `std`.
//!
//! Square root and fused multiply-add are correctly rounded in both; sine, cosine and arc tangent may differ in the
//! last place.

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("canted-obb needs the feature `std` or the feature `libm`");

macro_rules! float_functions {
    ($($name:ident($($x:ident),+) -> $out:ty = $std:expr, $libm:expr;)+) => {$(
        #[inline]
        pub(crate) fn $name($($x: f64),+) -> $out {
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
    sqrt(x) -> f64 = x.sqrt(), libm::sqrt(x);
    mul_add(a, b, c) -> f64 = a.mul_add(b, c), libm::fma(a, b, c);
    sin_cos(x) -> (f64, f64) = x.sin_cos(), libm::sincos(x);
    atan2(y, x) -> f64 = y.atan2(x), libm::atan2(y, x);
}
