//! The NEON path. The only `unsafe` here calls instructions that the token proves to be available.
#![expect(unsafe_code, reason = "intrinsics; each block says why it is sound")]

use std::arch::aarch64::{
    float32x4_t, float32x4x2_t, uint32x4_t, vabsq_f32, vaddq_f32, vaddvq_u16, vandq_u16, vandq_u32, vbslq_f32,
    vcgtq_f32, vcleq_f32, vcltq_f32, vcombine_u16, vdivq_f32, vdupq_n_f32, vdupq_n_u32, veorq_u32, vfmaq_f32,
    vfmsq_f32, vld1q_f32, vld1q_u16, vmovn_u32, vmulq_f32, vnegq_f32, vreinterpretq_f32_u32, vreinterpretq_u32_f32,
    vst1q_f32, vsubq_f32,
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

    /// `a` with its sign flipped where `b` is negative.
    #[inline(always)]
    fn xor_signs(self, a: float32x4_t, b: float32x4_t) -> float32x4_t {
        // SAFETY: the token proves NEON.
        unsafe {
            let sign = vandq_u32(vreinterpretq_u32_f32(b), vdupq_n_u32(1 << 31));
            vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(a), sign))
        }
    }
}

/// Runs `task` with the instructions enabled, so that everything inlined into it may use them.
#[target_feature(enable = "neon")]
fn with_features<T: Task>(simd: Neon, task: T) -> T::Output {
    task.on(simd)
}

/// Lanes 0 to 3, then 4 to 7. Products and sums are fused: `mul_add` and similar round once.
impl Simd for Neon {
    type F = float32x4x2_t;

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
    fn add(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vaddq_f32(a.0, b.0), vaddq_f32(a.1, b.1)) }
    }
    #[inline(always)]
    fn sub(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vsubq_f32(a.0, b.0), vsubq_f32(a.1, b.1)) }
    }
    #[inline(always)]
    fn mul(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vmulq_f32(a.0, b.0), vmulq_f32(a.1, b.1)) }
    }
    #[inline(always)]
    fn div(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vdivq_f32(a.0, b.0), vdivq_f32(a.1, b.1)) }
    }
    // The minimum instruction puts -0.0 below 0.0: to give `b` of equals takes a comparison and a choice.
    #[inline(always)]
    fn min(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe {
            let low = vbslq_f32(vcltq_f32(a.0, b.0), a.0, b.0);
            float32x4x2_t(low, vbslq_f32(vcltq_f32(a.1, b.1), a.1, b.1))
        }
    }
    #[inline(always)]
    fn max(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe {
            let low = vbslq_f32(vcgtq_f32(a.0, b.0), a.0, b.0);
            float32x4x2_t(low, vbslq_f32(vcgtq_f32(a.1, b.1), a.1, b.1))
        }
    }
    #[inline(always)]
    fn mul_add(self, a: float32x4x2_t, b: float32x4x2_t, c: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vfmaq_f32(c.0, a.0, b.0), vfmaq_f32(c.1, a.1, b.1)) }
    }
    // To turn the sign of `c` first is exact, zeros included, and both forms below share it.
    #[inline(always)]
    fn mul_sub(self, a: float32x4x2_t, b: float32x4x2_t, c: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vfmaq_f32(vnegq_f32(c.0), a.0, b.0), vfmaq_f32(vnegq_f32(c.1), a.1, b.1)) }
    }
    #[inline(always)]
    fn neg_mul_sub(self, a: float32x4x2_t, b: float32x4x2_t, c: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vfmsq_f32(vnegq_f32(c.0), a.0, b.0), vfmsq_f32(vnegq_f32(c.1), a.1, b.1)) }
    }
    #[inline(always)]
    fn abs(self, a: float32x4x2_t) -> float32x4x2_t {
        // SAFETY: the token proves NEON.
        unsafe { float32x4x2_t(vabsq_f32(a.0), vabsq_f32(a.1)) }
    }
    #[inline(always)]
    fn xor_sign(self, a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
        float32x4x2_t(self.xor_signs(a.0, b.0), self.xor_signs(a.1, b.1))
    }
    #[inline(always)]
    fn lt(self, a: float32x4x2_t, b: float32x4x2_t) -> u32 {
        // SAFETY: the token proves NEON.
        let (low, high) = unsafe { (vcltq_f32(a.0, b.0), vcltq_f32(a.1, b.1)) };
        self.mask(low, high)
    }
    #[inline(always)]
    fn le(self, a: float32x4x2_t, b: float32x4x2_t) -> u32 {
        // SAFETY: the token proves NEON.
        let (low, high) = unsafe { (vcleq_f32(a.0, b.0), vcleq_f32(a.1, b.1)) };
        self.mask(low, high)
    }
}
