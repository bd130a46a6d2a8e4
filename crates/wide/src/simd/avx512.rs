//! The AVX-512 path: AVX2's operations with twice the registers, and comparisons that give masks.
//!
//! The only `unsafe` here calls instructions that the token proves to be available.
#![expect(unsafe_code, reason = "intrinsics; each block says why it is sound")]

use std::arch::x86_64::{__m256, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_cmp_ps_mask};

use super::{Avx2, Simd, Task};

/// Proof that the machine has AVX-512 F, VL and DQ and all of the AVX2 path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512(Avx2);

impl Avx512 {
    /// The token, if the machine has the instructions.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq");
        Avx2::new().filter(|_| has).map(Self)
    }
}

/// Runs `task` with the instructions enabled, so that everything inlined into it may use them.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512dq")]
fn with_features<T: Task>(simd: Avx512, task: T) -> T::Output {
    task.on(simd)
}

/// Functions of the AVX2 path.
macro_rules! as_avx2 {
    ($(fn $name:ident($($x:ident: $type:ty),*) -> $result:ty;)*) => {$(
        #[inline(always)]
        fn $name(self, $($x: $type),*) -> $result {
            self.0.$name($($x),*)
        }
    )*};
}

impl Simd for Avx512 {
    type F = __m256;
    type Four = Avx2;

    as_avx2! {
        fn splat(x: f32) -> __m256;
        fn load(x: &[f32; 8]) -> __m256;
        fn load_half(x: &[f32; 4]) -> __m256;
        fn store(a: __m256) -> [f32; 8];
        fn add(a: __m256, b: __m256) -> __m256;
        fn sub(a: __m256, b: __m256) -> __m256;
        fn mul(a: __m256, b: __m256) -> __m256;
        fn div(a: __m256, b: __m256) -> __m256;
        fn sqrt(a: __m256) -> __m256;
        fn min(a: __m256, b: __m256) -> __m256;
        fn max(a: __m256, b: __m256) -> __m256;
        fn min_bits(a: __m256, b: __m256) -> __m256;
        fn max_bits(a: __m256, b: __m256) -> __m256;
        fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256;
        fn mul_sub(a: __m256, b: __m256, c: __m256) -> __m256;
        fn neg_mul_sub(a: __m256, b: __m256, c: __m256) -> __m256;
        fn pick(a: __m256, b: __m256, x: __m256, y: __m256) -> __m256;
        fn power_of_two(a: __m256) -> __m256;
        fn transpose(rows: [__m256; 8]) -> [__m256; 8];
        fn transpose_half(rows: [__m256; 8]) -> [__m256; 4];
        fn abs(a: __m256) -> __m256;
        fn xor_sign(a: __m256, b: __m256) -> __m256;
    }

    #[inline(always)]
    fn prefetch<T>(self, memory: &T) {
        self.0.prefetch(memory);
    }
    #[inline(always)]
    fn four(self) -> Avx2 {
        self.0
    }
    #[inline]
    fn run<T: Task>(self, task: T) -> T::Output {
        // SAFETY: the token was made where the features were detected.
        unsafe { with_features(self, task) }
    }
    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: the token proves AVX-512 VL.
        unsafe { u32::from(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b)) }
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: the token proves AVX-512 VL.
        unsafe { u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)) }
    }
}
