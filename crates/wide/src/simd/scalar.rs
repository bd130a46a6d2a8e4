use super::{Simd, Task};

/// Plain Rust over arrays: the reference that the other paths are tested against.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scalar;

#[inline(always)]
fn mask(a: [f32; 8], b: [f32; 8], f: impl Fn(&f32, &f32) -> bool) -> u32 {
    (0..8).fold(0, |mask, i| mask | u32::from(f(&a[i], &b[i])) << i)
}

/// Functions of lanes, each computed from its operands' lanes.
macro_rules! lanes {
    ($(fn $name:ident($($x:ident),*) = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($x: [f32; 8]),*) -> [f32; 8] {
            std::array::from_fn(|i| {
                $(let $x = $x[i];)*
                $value
            })
        }
    )*};
}

impl Simd for Scalar {
    type F = [f32; 8];
    type Four = canted_trace::Arrays;

    lanes! {
        fn add(a, b) = a + b;
        fn sub(a, b) = a - b;
        fn mul(a, b) = a * b;
        fn div(a, b) = a / b;
        fn sqrt(a) = a.sqrt();
        fn mul_add(a, b, c) = a * b + c;
        fn mul_sub(a, b, c) = a * b - c;
        fn neg_mul_sub(a, b, c) = -(a * b) - c;
        fn min(a, b) = if a < b { a } else { b };
        fn max(a, b) = if a > b { a } else { b };
        fn min_bits(a, b) = f32::from_bits(a.to_bits().cast_signed().min(b.to_bits().cast_signed()).cast_unsigned());
        fn max_bits(a, b) = f32::from_bits(a.to_bits().cast_signed().max(b.to_bits().cast_signed()).cast_unsigned());
        fn pick(a, b, x, y) = if a < b { x } else { y };
        fn abs(a) = a.abs();
        fn power_of_two(a) = f32::from_bits(a.to_bits() & 0x7f80_0000);
        fn xor_sign(a, b) = f32::from_bits(a.to_bits() ^ (b.to_bits() & 0x8000_0000));
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
    fn splat(self, x: f32) -> [f32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> [f32; 8] {
        *x
    }
    #[inline(always)]
    fn load_half(self, x: &[f32; 4]) -> [f32; 8] {
        [x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0]
    }
    #[inline(always)]
    fn store(self, a: [f32; 8]) -> [f32; 8] {
        a
    }
    #[inline(always)]
    fn transpose(self, rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
        std::array::from_fn(|j| std::array::from_fn(|i| rows[i][j]))
    }
    #[inline(always)]
    fn transpose_half(self, rows: [[f32; 8]; 8]) -> [[f32; 8]; 4] {
        std::array::from_fn(|j| std::array::from_fn(|i| rows[i][j]))
    }
    #[inline(always)]
    fn lt(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a < b)
    }
    #[inline(always)]
    fn prefetch<T>(self, _: &T) {}
    #[inline(always)]
    fn le(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a <= b)
    }
}
