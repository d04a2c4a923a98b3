//! Eight lanes of AVX2 with FMA.

use std::arch::x86_64::*;

use super::{Lanes, numbers, room};

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy)]
pub(crate) struct HasAvx2(());

impl HasAvx2 {
    /// The proof, where the processor has both. Detection is cached by the standard library.
    #[inline]
    pub fn detect() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
    }
}

/// Eight numbers.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

/// Wraps what intrinsics give.
macro_rules! vector {
    ($intrinsics:expr) => {
        // SAFETY: the intrinsics ask for AVX2 and FMA, of which the caller holds the proof or a vector, which nothing
        // makes without the proof; those that read memory are given arrays of eight numbers.
        Avx2(unsafe { $intrinsics })
    };
}

impl Lanes for Avx2 {
    type Has = HasAvx2;
    const N: usize = 8;
    const INTERLEAVED: usize = 2;

    #[inline(always)]
    fn load(_: HasAvx2, from: &[f32]) -> Self {
        let numbers: &[f32; 8] = numbers(from);
        vector!(_mm256_loadu_ps(numbers.as_ptr()))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        let room: &mut [f32; 8] = room(to);
        // SAFETY: eight numbers can be written; a vector is the proof of AVX2.
        unsafe { _mm256_storeu_ps(room.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn splat(_: HasAvx2, value: f32) -> Self {
        vector!(_mm256_set1_ps(value))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        vector!(_mm256_add_ps(self.0, other.0))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        vector!(_mm256_sub_ps(self.0, other.0))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        vector!(_mm256_mul_ps(self.0, other.0))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        vector!(_mm256_min_ps(self.0, other.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        vector!(_mm256_max_ps(self.0, other.0))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        vector!(_mm256_fmadd_ps(self.0, factor.0, summand.0))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        vector!(_mm256_fnmadd_ps(self.0, factor.0, summand.0))
    }
    /// AVX2 shifts only within halves, so the middle halves come first.
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        vector!({
            let [low, high] = [_mm256_castps_si256(self.0), _mm256_castps_si256(next.0)];
            let middle = _mm256_permute2x128_si256::<0x21>(low, high);
            _mm256_castsi256_ps(match K {
                1 => _mm256_alignr_epi8::<4>(middle, low),
                2 => _mm256_alignr_epi8::<8>(middle, low),
                3 => _mm256_alignr_epi8::<12>(middle, low),
                4 => middle,
                _ => unreachable!("a shift by {K}"),
            })
        })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        vector!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0))
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        vector!(_mm256_or_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), other.0)))
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        vector!({
            let less = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0);
            _mm256_and_ps(less, _mm256_set1_ps(1.0))
        })
    }
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        vector!(_mm256_rcp_ps(self.0))
    }
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        vector!(_mm256_rsqrt_ps(self.0))
    }
}
