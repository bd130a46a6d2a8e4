//! The NEON path. The only `unsafe` here calls instructions that the token proves to be available.
#![expect(unsafe_code, reason = "intrinsics; each block says why it is sound")]

use std::arch::aarch64::{
    float32x4_t, float32x4x2_t, uint32x4_t, vabsq_f32, vaddq_f32, vaddvq_u16, vandq_u16, vandq_u32, vbslq_f32,
    vcgtq_f32, vcleq_f32, vcltq_f32, vcombine_u16, vdivq_f32, vdupq_n_f32, vdupq_n_u32, veorq_u32, vfmaq_f32,
    vfmsq_f32, vld1q_f32, vld1q_u16, vmaxq_s32, vminq_s32, vmovn_u32, vmulq_f32, vnegq_f32, vreinterpretq_f32_f64,
    vreinterpretq_f32_s32, vreinterpretq_f32_u32, vreinterpretq_f64_f32, vreinterpretq_s32_f32, vreinterpretq_u32_f32,
    vsqrtq_f32, vst1q_f32, vsubq_f32, vtrn1q_f32, vtrn1q_f64, vtrn2q_f32, vtrn2q_f64,
};
use std::arch::is_aarch64_feature_detected;

use super::{Simd, Task};

/// Proof that the machine has NEON.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neon(());

impl Neon {
    /// The token, if the machine has the instructions.
    ///
    /// `None` on big-endian machines: the order of lanes is not tested there.
    #[inline]
    pub(crate) fn new() -> Option<Self> {
        let has = cfg!(target_endian = "little") && is_aarch64_feature_detected!("neon");
        has.then_some(Self(()))
    }

    /// Low bits for the lanes of a comparison that holds.
    #[inline(always)]
    fn mask(self, low: uint32x4_t, high: uint32x4_t) -> u32 {
        const BITS: [u16; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
        // SAFETY: the token proves NEON, and the array holds eight numbers of 16 bits.
        u32::from(unsafe {
            let lanes = vcombine_u16(vmovn_u32(low), vmovn_u32(high));
            vaddvq_u16(vandq_u16(lanes, vld1q_u16(BITS.as_ptr())))
        })
    }

    /// Four rows of four lanes, transposed.
    #[inline(always)]
    fn transposed(self, [a, b, c, d]: [float32x4_t; 4]) -> [float32x4_t; 4] {
        // SAFETY: the token proves NEON.
        unsafe {
            let halves = |a, b| [vreinterpretq_f64_f32(vtrn1q_f32(a, b)), vreinterpretq_f64_f32(vtrn2q_f32(a, b))];
            let ([ab_even, ab_odd], [cd_even, cd_odd]) = (halves(a, b), halves(c, d));
            [
                vreinterpretq_f32_f64(vtrn1q_f64(ab_even, cd_even)),
                vreinterpretq_f32_f64(vtrn1q_f64(ab_odd, cd_odd)),
                vreinterpretq_f32_f64(vtrn2q_f64(ab_even, cd_even)),
                vreinterpretq_f32_f64(vtrn2q_f64(ab_odd, cd_odd)),
            ]
        }
    }
}

/// Runs `task` with the instructions enabled, so that everything inlined into it may use them.
#[target_feature(enable = "neon")]
fn with_features<T: Task>(simd: Neon, task: T) -> T::Output {
    task.on(simd)
}

/// Functions of lanes, computed for lanes 0 to 3 and for lanes 4 to 7.
macro_rules! lanes {
    ($(fn $name:ident($($x:ident),*) = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($x: float32x4x2_t),*) -> float32x4x2_t {
            let half = |$($x: float32x4_t),*| -> float32x4_t {
                // SAFETY: the token proves NEON.
                unsafe { $value }
            };
            float32x4x2_t(half($($x.0),*), half($($x.1),*))
        }
    )*};
}

/// Lanes 0 to 3, then 4 to 7. Products and sums are fused: `mul_add` and similar round once.
impl Simd for Neon {
    type F = float32x4x2_t;
    type Four = canted_trace::Arrays;

    lanes! {
        fn add(a, b) = vaddq_f32(a, b);
        fn sub(a, b) = vsubq_f32(a, b);
        fn mul(a, b) = vmulq_f32(a, b);
        fn div(a, b) = vdivq_f32(a, b);
        fn sqrt(a) = vsqrtq_f32(a);
        // The minimum instruction orders -0.0 before 0.0; returning `b` of equals takes a comparison and a selection.
        fn min(a, b) = vbslq_f32(vcltq_f32(a, b), a, b);
        fn max(a, b) = vbslq_f32(vcgtq_f32(a, b), a, b);
        fn min_bits(a, b) = vreinterpretq_f32_s32(vminq_s32(vreinterpretq_s32_f32(a), vreinterpretq_s32_f32(b)));
        fn max_bits(a, b) = vreinterpretq_f32_s32(vmaxq_s32(vreinterpretq_s32_f32(a), vreinterpretq_s32_f32(b)));
        fn mul_add(a, b, c) = vfmaq_f32(c, a, b);
        // Flipping the sign of `c` first is exact, zeros included.
        fn mul_sub(a, b, c) = vfmaq_f32(vnegq_f32(c), a, b);
        fn neg_mul_sub(a, b, c) = vfmsq_f32(vnegq_f32(c), a, b);
        fn pick(a, b, x, y) = vbslq_f32(vcltq_f32(a, b), x, y);
        fn abs(a) = vabsq_f32(a);
        fn power_of_two(a) = vreinterpretq_f32_u32(vandq_u32(vreinterpretq_u32_f32(a), vdupq_n_u32(0x7f80_0000)));
        fn xor_sign(a, b) = vreinterpretq_f32_u32(veorq_u32(
            vreinterpretq_u32_f32(a),
            vandq_u32(vreinterpretq_u32_f32(b), vdupq_n_u32(1 << 31)),
        ));
    }

    #[inline(always)]
    fn four(self) -> canted_trace::Arrays {
        canted_trace::Arrays
    }
    #[inline]
    fn run<T: Task>(self, task: T) -> T::Output {
        // SAFETY: the token was made where the feature was detected.
        unsafe { with_features(self, task) }
    }
    #[inline(always)]
    fn splat(self, x: f32) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vdupq_n_f32(x), vdupq_n_f32(x)) }
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> float32x4x2_t {
        let [low, high]: &[[f32; 4]; 2] = bytemuck::cast_ref(x);
        // SAFETY: the token proves NEON, and each array holds four lanes.
        unsafe { float32x4x2_t(vld1q_f32(low.as_ptr()), vld1q_f32(high.as_ptr())) }
    }
    #[inline(always)]
    fn load_half(self, x: &[f32; 4]) -> float32x4x2_t {
        // SAFETY: the token proves NEON, and the array holds four lanes.
        unsafe { float32x4x2_t(vld1q_f32(x.as_ptr()), vdupq_n_f32(0.0)) }
    }
    #[inline(always)]
    fn store(self, a: float32x4x2_t) -> [f32; 8] {
        let mut out = [[0.0; 4]; 2];
        // SAFETY: the token proves NEON, and each array holds four lanes.
        unsafe {
            vst1q_f32(out[0].as_mut_ptr(), a.0);
            vst1q_f32(out[1].as_mut_ptr(), a.1);
        }
        bytemuck::cast(out)
    }
    #[inline(always)]
    fn transpose(self, rows: [float32x4x2_t; 8]) -> [float32x4x2_t; 8] {
        let [a, b, c, d, e, f, g, h] = rows;
        // A row of the result: lanes of the first four rows, then of the others.
        let [low_first, high_first] = [[a.0, b.0, c.0, d.0], [a.1, b.1, c.1, d.1]].map(|block| self.transposed(block));
        let [low_last, high_last] = [[e.0, f.0, g.0, h.0], [e.1, f.1, g.1, h.1]].map(|block| self.transposed(block));
        let [[a, b, c, d], [e, f, g, h]] = [low_first, high_first];
        let [[i, j, k, l], [m, n, o, p]] = [low_last, high_last];
        [(a, i), (b, j), (c, k), (d, l), (e, m), (f, n), (g, o), (h, p)].map(|(low, high)| float32x4x2_t(low, high))
    }
    #[inline(always)]
    fn transpose_half(self, [a, b, c, d, e, f, g, h]: [float32x4x2_t; 8]) -> [float32x4x2_t; 4] {
        let [i, j, k, l] = self.transposed([a.0, b.0, c.0, d.0]);
        let [m, n, o, p] = self.transposed([e.0, f.0, g.0, h.0]);
        [float32x4x2_t(i, m), float32x4x2_t(j, n), float32x4x2_t(k, o), float32x4x2_t(l, p)]
    }
    #[inline(always)]
    fn lt(self, a: float32x4x2_t, b: float32x4x2_t) -> u32 {
        // SAFETY: the token proves NEON.
        let (low, high) = unsafe { (vcltq_f32(a.0, b.0), vcltq_f32(a.1, b.1)) };
        self.mask(low, high)
    }
    #[inline(always)]
    fn prefetch<T>(self, _: &T) {}
    #[inline(always)]
    fn le(self, a: float32x4x2_t, b: float32x4x2_t) -> u32 {
        // SAFETY: the token proves NEON.
        let (low, high) = unsafe { (vcleq_f32(a.0, b.0), vcleq_f32(a.1, b.1)) };
        self.mask(low, high)
    }
}
