//! Vectors of single-precision numbers: 16 lanes (AVX-512), 8 (AVX2) or 4 as plain arrays; NEON is in `neon.rs`.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// A vector of [`Lanes::N`] numbers.
///
/// Functions over lanes must use loops, not closures: a closure is compiled without the instructions of its enclosing
/// function. Pointer methods are unsafe because of their reads and writes. On x86 the others may be called only from
/// functions inlined into one with the instructions enabled, which `dispatch!` ensures.
pub(crate) trait Lanes: Copy {
    const N: usize;

    /// Vectors to interleave in a chain of dependent operations, to hide latency: 1 or 2, measured on Zen 4.
    const INTERLEAVED: usize;

    /// # Safety
    /// `N` numbers must be readable at `p`.
    unsafe fn load(p: *const f32) -> Self;

    /// # Safety
    /// `N` numbers must be writable at `p`.
    unsafe fn store(self, p: *mut f32);

    /// `T` vectors that start at `p`, `p + 1`, ... `p + T - 1`.
    ///
    /// # Safety
    /// 32 numbers must be readable at `p`; `T` is at most 16.
    #[inline(always)]
    unsafe fn taps<const T: usize>(p: *const f32) -> [Self; T] {
        let mut vectors = [Self::splat(0.0); T];
        for i in 0..T {
            // SAFETY: the last vector ends at p + T - 1 + N, within the 32 numbers that the caller promises.
            vectors[i] = unsafe { Self::load(p.add(i)) };
        }
        vectors
    }

    /// The vector at `p + K`, from memory or from `here` at `p` and `next` at `p + N`, whichever is cheaper.
    ///
    /// # Safety
    /// `K + N` numbers must be readable at `p`; `K` is at most 10.
    #[inline(always)]
    unsafe fn beside<const K: i32>(p: *const f32, _here: Self, _next: Self) -> Self {
        // SAFETY: the caller's promise.
        unsafe { Self::load(p.add(K as usize)) }
    }

    fn splat(value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// `self * factor + summand`, fused where possible.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// `summand - self * factor`, fused where possible.
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self;
    /// The last `N - K` lanes, followed by the first `K` of `next`; `K` is from 1 to 4.
    fn after<const K: i32>(self, next: Self) -> Self;
    fn abs(self) -> Self;
    /// `self`, not negative, with the sign of `other`.
    fn with_sign_of(self, other: Self) -> Self;
    /// 1 in the lanes where `self < other`, 0 in the others.
    fn one_where_less(self, other: Self) -> Self;
    /// `1 / self` to 12 bits or better.
    fn reciprocal_estimate(self) -> Self;
    /// `1 / sqrt(self)` to 12 bits or better.
    fn inverse_root_estimate(self) -> Self;
    fn to_array(self) -> [f32; 16];

    /// `1 / self` to the last bits for 1e-37 to 1e37: estimate and a Newton step, a third of a division's cost.
    #[inline(always)]
    fn reciprocal(self) -> Self {
        let estimate = self.reciprocal_estimate();
        let error = self.neg_mul_add(estimate, Self::splat(1.0));
        error.mul_add(estimate, estimate)
    }

    /// `1 / sqrt(self)` to single precision: estimate and a Newton step.
    #[inline(always)]
    fn inverse_root(self) -> Self {
        let y = self.inverse_root_estimate();
        let half = self.mul(Self::splat(-0.5));
        let correction = half.mul(y).mul_add(y, Self::splat(1.5));
        y.mul(correction)
    }
}

#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512);

#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

#[derive(Clone, Copy)]
pub(crate) struct Portable([f32; 4]);

// SAFETY of the intrinsics without pointers: they only need their instruction set; every caller is inlined into a
// function that enables it after detection (`dispatch!`).
#[cfg(target_arch = "x86_64")]
impl Lanes for Avx512 {
    const N: usize = 16;
    const INTERLEAVED: usize = 1;

    #[inline(always)]
    unsafe fn load(p: *const f32) -> Self {
        // SAFETY: the caller's promise.
        Self(unsafe { _mm512_loadu_ps(p) })
    }

    #[inline(always)]
    unsafe fn store(self, p: *mut f32) {
        // SAFETY: the caller's promise.
        unsafe { _mm512_storeu_ps(p, self.0) }
    }

    /// Two loads and shifts: an unaligned load of a whole cache line costs two accesses.
    #[inline(always)]
    unsafe fn taps<const T: usize>(p: *const f32) -> [Self; T] {
        // SAFETY: the caller promises 32 readable numbers at p.
        let [low, high] = unsafe { [_mm512_loadu_si512(p.cast()), _mm512_loadu_si512(p.add(16).cast())] };
        let mut vectors = [Self::splat(0.0); T];
        for i in 0..T {
            // SAFETY: the shifts need their instruction set only; the load as above.
            vectors[i] = Self(unsafe {
                _mm512_castsi512_ps(match i {
                    0 => low,
                    1 => _mm512_alignr_epi32::<1>(high, low),
                    2 => _mm512_alignr_epi32::<2>(high, low),
                    3 => _mm512_alignr_epi32::<3>(high, low),
                    4 => _mm512_alignr_epi32::<4>(high, low),
                    5 => _mm512_alignr_epi32::<5>(high, low),
                    6 => _mm512_alignr_epi32::<6>(high, low),
                    7 => _mm512_alignr_epi32::<7>(high, low),
                    8 => _mm512_alignr_epi32::<8>(high, low),
                    9 => _mm512_alignr_epi32::<9>(high, low),
                    10 => _mm512_alignr_epi32::<10>(high, low),
                    _ => _mm512_loadu_si512(p.add(i).cast()),
                })
            });
        }
        vectors
    }

    #[inline(always)]
    unsafe fn beside<const K: i32>(_p: *const f32, here: Self, next: Self) -> Self {
        here.after::<K>(next)
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm512_fnmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        Self(unsafe {
            let [low, high] = [_mm512_castps_si512(self.0), _mm512_castps_si512(next.0)];
            _mm512_castsi512_ps(_mm512_alignr_epi32::<K>(high, low))
        })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_abs_ps(self.0) })
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(unsafe {
            let sign = _mm512_and_si512(_mm512_castps_si512(other.0), _mm512_set1_epi32(i32::MIN));
            _mm512_castsi512_ps(_mm512_or_si512(_mm512_castps_si512(self.0), sign))
        })
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        Self(unsafe {
            let less = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0);
            _mm512_maskz_mov_ps(less, _mm512_set1_ps(1.0))
        })
    }
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        Self(unsafe { _mm512_rcp14_ps(self.0) })
    }
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        Self(unsafe { _mm512_rsqrt14_ps(self.0) })
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut numbers = [0.0; 16];
        // SAFETY: the array holds 16 numbers.
        unsafe { self.store(numbers.as_mut_ptr()) };
        numbers
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx2 {
    const N: usize = 8;
    const INTERLEAVED: usize = 2;

    #[inline(always)]
    unsafe fn load(p: *const f32) -> Self {
        // SAFETY: the caller's promise.
        Self(unsafe { _mm256_loadu_ps(p) })
    }

    #[inline(always)]
    unsafe fn store(self, p: *mut f32) {
        // SAFETY: the caller's promise.
        unsafe { _mm256_storeu_ps(p, self.0) }
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, summand.0) })
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, summand.0) })
    }
    /// AVX2 shifts only within halves, so the middle halves come first.
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        Self(unsafe {
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
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(unsafe { _mm256_or_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), other.0)) })
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        Self(unsafe {
            let less = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0);
            _mm256_and_ps(less, _mm256_set1_ps(1.0))
        })
    }
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        Self(unsafe { _mm256_rcp_ps(self.0) })
    }
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        Self(unsafe { _mm256_rsqrt_ps(self.0) })
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut numbers = [0.0; 16];
        // SAFETY: the array holds 16 numbers.
        unsafe { self.store(numbers.as_mut_ptr()) };
        numbers
    }
}

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for Portable {
    const N: usize = 4;
    const INTERLEAVED: usize = 2;

    #[inline(always)]
    unsafe fn load(p: *const f32) -> Self {
        // SAFETY: the caller's promise; an array of f32 has the alignment of f32.
        Self(unsafe { p.cast::<[f32; 4]>().read() })
    }

    #[inline(always)]
    unsafe fn store(self, p: *mut f32) {
        // SAFETY: the caller's promise.
        unsafe { p.cast::<[f32; 4]>().write(self.0) }
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 4])
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // Not fused: without the instruction, fusing is a slow library call.
        self.mul(factor).add(summand)
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self {
        summand.sub(self.mul(factor))
    }
    #[inline(always)]
    fn after<const K: i32>(self, next: Self) -> Self {
        let both = [self.0, next.0];
        Self(std::array::from_fn(|i| both.as_flattened()[i + K as usize]))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        self.zip(other, f32::copysign)
    }
    #[inline(always)]
    fn one_where_less(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { 1.0 } else { 0.0 })
    }
    #[inline(always)]
    fn reciprocal_estimate(self) -> Self {
        Self(self.0.map(|v| 1.0 / v))
    }
    #[inline(always)]
    fn inverse_root_estimate(self) -> Self {
        Self(self.0.map(|v| 1.0 / v.sqrt()))
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        std::array::from_fn(|i| self.0.get(i).copied().unwrap_or(0.0))
    }
}
