//! Eight numbers at once, for loops over the pixels of a row: operations on arrays of fixed length, which compile to vector instructions.

use std::ops::{Add, Div, Mul, Sub};

/// Numbers of [`Lanes`].
pub(crate) const N: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes(pub(crate) [f32; N]);

impl Lanes {
    pub(crate) fn splat(x: f32) -> Self {
        Self([x; N])
    }

    /// The first eight numbers of a slice that has as many.
    #[inline(always)]
    pub(crate) fn of(numbers: &[f32]) -> Self {
        Self(numbers.first_chunk().copied().unwrap_or([f32::NAN; N]))
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Self {
        self.zip(self, |x, _| f(x))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        self.map(f32::abs)
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }

    #[inline(always)]
    pub(crate) fn squared(self) -> Self {
        self * self
    }

    /// Zero where `mask` is not positive, NaN included.
    #[inline(always)]
    pub(crate) fn where_positive(self, mask: Self) -> Self {
        self.zip(mask, |x, mask| if mask > 0.0 { x } else { 0.0 })
    }

    /// 1 for numbers of at least zero, else 0.
    #[inline(always)]
    pub(crate) fn is_not_negative(self) -> Self {
        self.map(|x| if x >= 0.0 { 1.0 } else { 0.0 })
    }

    /// `e⁻ˣ` for `x >= 0`, as `(1 + x/1024)⁻¹⁰²⁴`: relative error `x²/2048`. NaN for NaN.
    #[inline(always)]
    pub(crate) fn decay(self) -> Self {
        const HALVINGS: u32 = 10;
        let one = Self::splat(1.0);
        let mut power = one + self * Self::splat(1.0 / (1_u32 << HALVINGS) as f32);
        for _ in 0..HALVINGS {
            power = power.squared();
        }
        one / power
    }
}

macro_rules! operator {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| $operator::$method(a, b))
            }
        }
    )*};
}

operator!(Add add, Sub sub, Mul mul, Div div);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decay_is_close_to_the_exponential() {
        for x in [0.0_f32, 1e-6, 0.1, 1.0, 3.0, 10.0] {
            let found = Lanes::splat(x).decay().0[N - 1];
            let exact = (-x).exp();
            assert!((found / exact - 1.0).abs() < x * x / 2000.0 + 2e-4, "{x}: {found} {exact}");
        }
        for x in [1e6, f32::MAX, f32::INFINITY] {
            assert_eq!(Lanes::splat(x).decay(), Lanes::splat(0.0));
        }
        assert!(Lanes::splat(f32::NAN).decay().0[0].is_nan());
    }

    #[test]
    fn numbers_stay_in_their_lanes() {
        let numbers: Vec<f32> = (0..9_u8).map(f32::from).collect();
        let lanes = Lanes::of(&numbers[1..]);
        assert_eq!(lanes.0, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        let kept = (lanes - Lanes::splat(4.0)).where_positive(Lanes::of(&numbers) - Lanes::splat(5.5));
        assert_eq!(kept.0, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0]);
    }
}
