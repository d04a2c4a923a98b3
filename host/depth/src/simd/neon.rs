//! Four lanes of NEON, which every 64-bit ARM processor has (Raspberry Pi, Jetson, Apple's). No detection at run time:
//! compiled only where the target guarantees the unit.

use std::arch::aarch64::*;

use super::lanes::Lanes;

#[derive(Clone, Copy)]
pub(crate) struct Neon(float32x4_t);

// SAFETY of the intrinsics without pointers: they only need their instruction set, which the target guarantees.
impl Lanes for Neon {
    const N: usize = 4;
    /// Not measured for lack of hardware. There are 32 registers, twice as many as with AVX2.
    const INTERLEAVED: usize = 2;

    #[inline(always)]
    unsafe fn load(p: *const f32) -> Self {
        // SAFETY: the caller's promise.
        Self(unsafe { vld1q_f32(p) })
    }

    #[inline(always)]
    unsafe fn store(self, p: *mut f32) {
        // SAFETY: the caller's promise.
        unsafe { vst1q_f32(p, self.0) }
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { vdupq_n_f32(value) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { vaddq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { vsubq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { vmulq_f32(self.0, other.0) })
    }
    /// Of a number and NaN the number; `vminq_f32` would return NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { vminnmq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { vmaxnmq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { vfmaq_f32(summand.0, self.0, factor.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { vfmsq_f32(summand.0, self.0, factor.0) })
    }
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        Self(unsafe {
            match K {
                1 => vextq_f32::<1>(self.0, next.0),
                2 => vextq_f32::<2>(self.0, next.0),
                3 => vextq_f32::<3>(self.0, next.0),
                4 => next.0,
                _ => unreachable!("a shift by {K}"),
            }
        })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { vabsq_f32(self.0) })
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(unsafe { vbslq_f32(vdupq_n_u32(1 << 31), other.0, self.0) })
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        Self(unsafe {
            let ones = vreinterpretq_u32_f32(vdupq_n_f32(1.0));
            vreinterpretq_f32_u32(vandq_u32(vcltq_f32(self.0, other.0), ones))
        })
    }
    /// The instruction's 8 bits and a Newton step: 16.
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        Self(unsafe {
            let estimate = vrecpeq_f32(self.0);
            vmulq_f32(estimate, vrecpsq_f32(self.0, estimate))
        })
    }
    /// As for the reciprocal. The square of the estimate comes first: it is infinite for 0, which the step handles.
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        Self(unsafe {
            let estimate = vrsqrteq_f32(self.0);
            vmulq_f32(estimate, vrsqrtsq_f32(vmulq_f32(estimate, estimate), self.0))
        })
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut numbers = [0.0; 16];
        // SAFETY: the array holds 16 numbers.
        unsafe { self.store(numbers.as_mut_ptr()) };
        numbers
    }
}
