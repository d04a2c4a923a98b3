//! Sixteen lanes of AVX-512.

use std::arch::x86_64::*;

use super::{Lanes, numbers, room};

/// Proof that the processor has AVX-512F.
#[derive(Clone, Copy)]
pub(crate) struct HasAvx512(());

impl HasAvx512 {
    /// The proof, where the processor has it. Detection is cached by the standard library.
    #[inline]
    pub fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx512f").then_some(Self(()))
    }
}

/// Sixteen numbers.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512);

/// Wraps what intrinsics give.
macro_rules! vector {
    ($intrinsics:expr) => {
        // SAFETY: the intrinsics ask for AVX-512F, of which the caller holds the proof or a vector, which nothing makes
        // without the proof; those that read memory are given arrays of sixteen numbers.
        Avx512(unsafe { $intrinsics })
    };
}

impl Lanes for Avx512 {
    type Has = HasAvx512;
    const N: usize = 16;
    const INTERLEAVED: usize = 1;

    #[inline(always)]
    fn load(_: HasAvx512, from: &[f32]) -> Self {
        let numbers: &[f32; 16] = numbers(from);
        vector!(_mm512_loadu_ps(numbers.as_ptr()))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        let room: &mut [f32; 16] = room(to);
        // SAFETY: sixteen numbers can be written; a vector is the proof of AVX-512F.
        unsafe { _mm512_storeu_ps(room.as_mut_ptr(), self.0) }
    }

    /// Two loads and shifts between them: an unaligned load of a whole cache line costs two accesses.
    #[inline(always)]
    fn taps<const T: usize>(has: HasAvx512, from: &[f32; 32]) -> [Self; T] {
        let [low, high] = [Self::load(has, from), Self::load(has, &from[16..])];
        let mut vectors = [low; T];
        for i in 1..T {
            vectors[i] = match i {
                1 => low.after::<1>(high),
                2 => low.after::<2>(high),
                3 => low.after::<3>(high),
                4 => low.after::<4>(high),
                5 => low.after::<5>(high),
                6 => low.after::<6>(high),
                7 => low.after::<7>(high),
                8 => low.after::<8>(high),
                9 => low.after::<9>(high),
                10 => low.after::<10>(high),
                _ => Self::load(has, &from[i..]),
            };
        }
        vectors
    }

    #[inline(always)]
    fn beside<const K: i32>(_: HasAvx512, _: &[f32], here: Self, next: Self) -> Self {
        here.after::<K>(next)
    }

    #[inline(always)]
    fn splat(_: HasAvx512, value: f32) -> Self {
        vector!(_mm512_set1_ps(value))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        vector!(_mm512_add_ps(self.0, other.0))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        vector!(_mm512_sub_ps(self.0, other.0))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        vector!(_mm512_mul_ps(self.0, other.0))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        vector!(_mm512_min_ps(self.0, other.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        vector!(_mm512_max_ps(self.0, other.0))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        vector!(_mm512_fmadd_ps(self.0, factor.0, summand.0))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        vector!(_mm512_fnmadd_ps(self.0, factor.0, summand.0))
    }
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        vector!({
            let [low, high] = [_mm512_castps_si512(self.0), _mm512_castps_si512(next.0)];
            _mm512_castsi512_ps(_mm512_alignr_epi32::<K>(high, low))
        })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        vector!(_mm512_abs_ps(self.0))
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        vector!({
            let sign = _mm512_and_si512(_mm512_castps_si512(other.0), _mm512_set1_epi32(i32::MIN));
            _mm512_castsi512_ps(_mm512_or_si512(_mm512_castps_si512(self.0), sign))
        })
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        vector!({
            let less = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0);
            _mm512_maskz_mov_ps(less, _mm512_set1_ps(1.0))
        })
    }
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        vector!(_mm512_rcp14_ps(self.0))
    }
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        vector!(_mm512_rsqrt14_ps(self.0))
    }
}
