//! The AVX2 path. The only `unsafe` here calls instructions that the token proves to be available.
#![expect(unsafe_code, reason = "intrinsics; each block says why it is sound")]

use std::arch::x86_64::{
    __m256, __m256d, _CMP_LE_OQ, _CMP_LT_OQ, _MM_HINT_T0, _mm_loadu_ps, _mm_prefetch, _mm_storeu_ps, _mm256_add_pd,
    _mm256_add_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_blendv_ps, _mm256_castps_si256, _mm256_castps256_ps128,
    _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cvtpd_ps, _mm256_cvtps_pd, _mm256_div_ps, _mm256_fmadd_ps,
    _mm256_fmsub_ps, _mm256_fnmsub_ps, _mm256_insertf128_ps, _mm256_loadu_ps, _mm256_max_epi32, _mm256_max_ps,
    _mm256_min_epi32, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_pd, _mm256_mul_ps, _mm256_permute2f128_ps,
    _mm256_permute4x64_pd, _mm256_set1_pd, _mm256_set1_ps, _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_storeu_pd,
    _mm256_storeu_ps, _mm256_sub_pd, _mm256_sub_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps, _mm256_xor_ps,
    _mm256_zextps128_ps256,
};

use canted_trace::F64x4;

use super::{Simd, Task};

/// Proof that the machine has AVX2 and FMA.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// The token, if the machine has the instructions.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        let has = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2");
        has.then_some(Self(()))
    }
}

/// Runs `task` with the instructions enabled, so that everything inlined into it may use them.
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn with_features<T: Task>(simd: Avx2, task: T) -> T::Output {
    task.on(simd)
}

/// Functions of lanes that are one expression of intrinsics.
macro_rules! lanes {
    ($(fn $name:ident($($x:ident),*) = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($x: __m256),*) -> __m256 {
            // SAFETY: the token proves AVX, AVX2 and FMA.
            unsafe { $value }
        }
    )*};
}

impl F64x4 for Avx2 {
    type V = __m256d;

    #[inline(always)]
    fn widen(self, x: &[f32; 4]) -> __m256d {
        // SAFETY: the token proves AVX, and the array holds four lanes.
        unsafe { _mm256_cvtps_pd(_mm_loadu_ps(x.as_ptr())) }
    }
    #[inline(always)]
    fn splat(self, x: f64) -> __m256d {
        // SAFETY: the token proves AVX.
        unsafe { _mm256_set1_pd(x) }
    }
    #[inline(always)]
    fn add(self, a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: the token proves AVX.
        unsafe { _mm256_add_pd(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: the token proves AVX.
        unsafe { _mm256_sub_pd(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: the token proves AVX.
        unsafe { _mm256_mul_pd(a, b) }
    }
    #[inline(always)]
    fn rotate(self, a: __m256d) -> __m256d {
        // SAFETY: the token proves AVX2.
        unsafe { _mm256_permute4x64_pd::<0b11_00_10_01>(a) }
    }
    #[inline(always)]
    fn store(self, a: __m256d) -> [f64; 4] {
        let mut out = [0.0; 4];
        // SAFETY: the token proves AVX, and the array holds four lanes.
        unsafe { _mm256_storeu_pd(out.as_mut_ptr(), a) };
        out
    }
    #[inline(always)]
    fn narrow(self, a: __m256d) -> [f32; 4] {
        let mut out = [0.0; 4];
        // SAFETY: the token proves AVX, and the array holds four lanes.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), _mm256_cvtpd_ps(a)) };
        out
    }
}

impl Simd for Avx2 {
    type F = __m256;
    type Four = Self;

    lanes! {
        fn add(a, b) = _mm256_add_ps(a, b);
        fn sub(a, b) = _mm256_sub_ps(a, b);
        fn mul(a, b) = _mm256_mul_ps(a, b);
        fn div(a, b) = _mm256_div_ps(a, b);
        fn sqrt(a) = _mm256_sqrt_ps(a);
        fn min(a, b) = _mm256_min_ps(a, b);
        fn max(a, b) = _mm256_max_ps(a, b);
        fn min_bits(a, b) = _mm256_castsi256_ps(_mm256_min_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
        fn max_bits(a, b) = _mm256_castsi256_ps(_mm256_max_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
        fn mul_add(a, b, c) = _mm256_fmadd_ps(a, b, c);
        fn mul_sub(a, b, c) = _mm256_fmsub_ps(a, b, c);
        fn neg_mul_sub(a, b, c) = _mm256_fnmsub_ps(a, b, c);
        fn pick(a, b, x, y) = _mm256_blendv_ps(y, x, _mm256_cmp_ps::<_CMP_LT_OQ>(a, b));
        fn power_of_two(a) = _mm256_and_ps(a, _mm256_set1_ps(f32::INFINITY));
        fn abs(a) = _mm256_andnot_ps(_mm256_set1_ps(-0.0), a);
        fn xor_sign(a, b) = _mm256_xor_ps(a, _mm256_and_ps(b, _mm256_set1_ps(-0.0)));
    }

    #[inline(always)]
    fn four(self) -> Self {
        self
    }
    #[inline]
    fn run<T: Task>(self, task: T) -> T::Output {
        // SAFETY: the token was made where the features were detected.
        unsafe { with_features(self, task) }
    }
    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        // SAFETY: the token proves AVX.
        unsafe { _mm256_set1_ps(x) }
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> __m256 {
        // SAFETY: the token proves AVX, and the array holds eight lanes.
        unsafe { _mm256_loadu_ps(x.as_ptr()) }
    }
    #[inline(always)]
    fn load_half(self, x: &[f32; 4]) -> __m256 {
        // SAFETY: the token proves AVX, and the array holds four lanes.
        unsafe { _mm256_zextps128_ps256(_mm_loadu_ps(x.as_ptr())) }
    }
    #[inline(always)]
    fn store(self, a: __m256) -> [f32; 8] {
        let mut out = [0.0; 8];
        // SAFETY: the token proves AVX, and the array holds eight lanes.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), a) };
        out
    }
    #[inline(always)]
    fn transpose(self, [a, b, c, d, e, f, g, h]: [__m256; 8]) -> [__m256; 8] {
        // SAFETY: the token proves AVX.
        unsafe {
            let pairs = |a, b| (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let ((ab0, ab2), (cd0, cd2), (ef0, ef2), (gh0, gh2)) = (pairs(a, b), pairs(c, d), pairs(e, f), pairs(g, h));
            let low = |a, b| _mm256_shuffle_ps::<0x44>(a, b);
            let high = |a, b| _mm256_shuffle_ps::<0xee>(a, b);
            let first = [low(ab0, cd0), high(ab0, cd0), low(ab2, cd2), high(ab2, cd2)];
            let last = [low(ef0, gh0), high(ef0, gh0), low(ef2, gh2), high(ef2, gh2)];
            let join = |k: usize| {
                let (a, b) = (first[k], last[k]);
                (_mm256_permute2f128_ps::<0x20>(a, b), _mm256_permute2f128_ps::<0x31>(a, b))
            };
            let ((r0, r4), (r1, r5), (r2, r6), (r3, r7)) = (join(0), join(1), join(2), join(3));
            [r0, r1, r2, r3, r4, r5, r6, r7]
        }
    }
    #[inline(always)]
    fn transpose_half(self, [a, b, c, d, e, f, g, h]: [__m256; 8]) -> [__m256; 4] {
        // SAFETY: the token proves AVX.
        unsafe {
            let pair = |low, high| _mm256_insertf128_ps::<1>(low, _mm256_castps256_ps128(high));
            let (a, b, c, d) = (pair(a, e), pair(b, f), pair(c, g), pair(d, h));
            let (ab0, ab2) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd0, cd2) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            [
                _mm256_shuffle_ps::<0x44>(ab0, cd0),
                _mm256_shuffle_ps::<0xee>(ab0, cd0),
                _mm256_shuffle_ps::<0x44>(ab2, cd2),
                _mm256_shuffle_ps::<0xee>(ab2, cd2),
            ]
        }
    }
    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: the token proves AVX.
        let bits = unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) };
        bits.cast_unsigned()
    }
    #[inline(always)]
    fn prefetch<T>(self, memory: &T) {
        let at: *const T = memory;
        // SAFETY: all of x86_64 has the instruction, which only reads into caches.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) }
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: the token proves AVX.
        let bits = unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) };
        bits.cast_unsigned()
    }
}
