//! The path of WebAssembly with 128-bit vectors. A module is compiled for them or not, so the token needs no test, and no call is unsafe.

use std::arch::wasm32::{
    f32x4, f32x4_abs, f32x4_add, f32x4_div, f32x4_extract_lane, f32x4_le, f32x4_lt, f32x4_mul, f32x4_neg, f32x4_pmax,
    f32x4_pmin, f32x4_splat, f32x4_sqrt, f32x4_sub, i32x4_bitmask, i32x4_max, i32x4_min, i32x4_shuffle, u32x4_splat,
    v128, v128_and, v128_bitselect, v128_xor,
};

use super::{Simd, Task};

/// Proof that the module is compiled for 128-bit vectors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Simd128;

/// Lanes 0 to 3, then 4 to 7.
#[derive(Clone, Copy)]
pub(crate) struct Lanes(v128, v128);

/// Functions of lanes, computed for lanes 0 to 3 and for lanes 4 to 7.
macro_rules! lanes {
    ($(fn $name:ident($($x:ident),*) = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($x: Lanes),*) -> Lanes {
            let half = |$($x: v128),*| -> v128 { $value };
            Lanes(half($($x.0),*), half($($x.1),*))
        }
    )*};
}

/// Four rows of four lanes, transposed.
#[inline(always)]
fn transposed([a, b, c, d]: [v128; 4]) -> [v128; 4] {
    let (ab_low, ab_high) = (i32x4_shuffle::<0, 4, 1, 5>(a, b), i32x4_shuffle::<2, 6, 3, 7>(a, b));
    let (cd_low, cd_high) = (i32x4_shuffle::<0, 4, 1, 5>(c, d), i32x4_shuffle::<2, 6, 3, 7>(c, d));
    [
        i32x4_shuffle::<0, 1, 4, 5>(ab_low, cd_low),
        i32x4_shuffle::<2, 3, 6, 7>(ab_low, cd_low),
        i32x4_shuffle::<0, 1, 4, 5>(ab_high, cd_high),
        i32x4_shuffle::<2, 3, 6, 7>(ab_high, cd_high),
    ]
}

#[inline(always)]
fn from_array([a, b, c, d]: [f32; 4]) -> v128 {
    f32x4(a, b, c, d)
}

#[inline(always)]
fn to_array(a: v128) -> [f32; 4] {
    [f32x4_extract_lane::<0>(a), f32x4_extract_lane::<1>(a), f32x4_extract_lane::<2>(a), f32x4_extract_lane::<3>(a)]
}

/// Products and sums are rounded one by one.
impl Simd for Simd128 {
    type F = Lanes;
    type Four = canted_trace::Arrays;

    lanes! {
        fn add(a, b) = f32x4_add(a, b);
        fn sub(a, b) = f32x4_sub(a, b);
        fn mul(a, b) = f32x4_mul(a, b);
        fn div(a, b) = f32x4_div(a, b);
        fn sqrt(a) = f32x4_sqrt(a);
        fn mul_add(a, b, c) = f32x4_add(f32x4_mul(a, b), c);
        fn mul_sub(a, b, c) = f32x4_sub(f32x4_mul(a, b), c);
        fn neg_mul_sub(a, b, c) = f32x4_sub(f32x4_neg(f32x4_mul(a, b)), c);
        // These return their first operand unless the second one is less or greater.
        fn min(a, b) = f32x4_pmin(b, a);
        fn max(a, b) = f32x4_pmax(b, a);
        fn min_bits(a, b) = i32x4_min(a, b);
        fn max_bits(a, b) = i32x4_max(a, b);
        fn pick(a, b, x, y) = v128_bitselect(x, y, f32x4_lt(a, b));
        fn abs(a) = f32x4_abs(a);
        fn power_of_two(a) = v128_and(a, u32x4_splat(0x7f80_0000));
        fn xor_sign(a, b) = v128_xor(a, v128_and(b, u32x4_splat(1 << 31)));
    }

    #[inline(always)]
    fn four(self) -> canted_trace::Arrays {
        canted_trace::Arrays
    }
    #[inline]
    fn run<T: Task>(self, task: T) -> T::Output {
        task.on(self)
    }
    #[inline(always)]
    fn splat(self, x: f32) -> Lanes {
        Lanes(f32x4_splat(x), f32x4_splat(x))
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> Lanes {
        let [low, high]: &[[f32; 4]; 2] = bytemuck::cast_ref(x);
        Lanes(from_array(*low), from_array(*high))
    }
    #[inline(always)]
    fn load_half(self, x: &[f32; 4]) -> Lanes {
        Lanes(from_array(*x), f32x4_splat(0.0))
    }
    #[inline(always)]
    fn store(self, a: Lanes) -> [f32; 8] {
        bytemuck::cast([to_array(a.0), to_array(a.1)])
    }
    #[inline(always)]
    fn transpose(self, [a, b, c, d, e, f, g, h]: [Lanes; 8]) -> [Lanes; 8] {
        // Lanes of the first four rows, then of the others.
        let (first, last) = (transposed([a.0, b.0, c.0, d.0]), transposed([e.0, f.0, g.0, h.0]));
        let (first_upper, last_upper) = (transposed([a.1, b.1, c.1, d.1]), transposed([e.1, f.1, g.1, h.1]));
        std::array::from_fn(|j| match j {
            0..4 => Lanes(first[j], last[j]),
            _ => Lanes(first_upper[j - 4], last_upper[j - 4]),
        })
    }
    #[inline(always)]
    fn transpose_half(self, [a, b, c, d, e, f, g, h]: [Lanes; 8]) -> [Lanes; 4] {
        let (first, last) = (transposed([a.0, b.0, c.0, d.0]), transposed([e.0, f.0, g.0, h.0]));
        std::array::from_fn(|j| Lanes(first[j], last[j]))
    }
    #[inline(always)]
    fn lt(self, a: Lanes, b: Lanes) -> u32 {
        u32::from(i32x4_bitmask(f32x4_lt(a.0, b.0)) | i32x4_bitmask(f32x4_lt(a.1, b.1)) << 4)
    }
    #[inline(always)]
    fn prefetch<T>(self, _: &T) {}
    #[inline(always)]
    fn le(self, a: Lanes, b: Lanes) -> u32 {
        u32::from(i32x4_bitmask(f32x4_le(a.0, b.0)) | i32x4_bitmask(f32x4_le(a.1, b.1)) << 4)
    }
}
