//! Vectors of single-precision numbers: 16 lanes (AVX-512), 8 (AVX2) or 4 as plain arrays.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::{Avx2, HasAvx2};
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::{Avx512, HasAvx512};
pub(crate) use portable::Portable;

/// A vector of [`Lanes::N`] numbers.
///
/// Vectors are made from a proof that the processor has the instructions, which only its detection gives: so whatever
/// is done with a vector is safe.
///
/// Functions over lanes must use loops rather than closures: a closure is a function of its own, which is compiled
/// without the instructions of the function around it.
pub(crate) trait Lanes: Copy {
    /// The proof.
    type Has: Copy;

    /// Number of lanes.
    const N: usize;

    /// How many vectors at a time a chain of dependent operations is worth: with more than one, each fills the gaps of the
    /// other, as long as the registers suffice. 1 or 2, as measured on Zen 4.
    const INTERLEAVED: usize;

    /// The first `N` numbers of `from`, which must hold so many.
    fn load(has: Self::Has, from: &[f32]) -> Self;

    /// Writes to the first `N` numbers of `to`, which must hold so many.
    fn store(self, to: &mut [f32]);

    /// The vectors that start at the first, second, ... `T`th number; `T` is at most 16.
    #[inline(always)]
    fn taps<const T: usize>(has: Self::Has, from: &[f32; 32]) -> [Self; T] {
        let mut vectors = [Self::splat(has, 0.0); T];
        for i in 0..T {
            vectors[i] = Self::load(has, &from[i..]);
        }
        vectors
    }

    /// The vector at number `K` of `from`, which begins with `here` and `next`: from memory or from these, whichever is
    /// cheaper. `K` is at most 10.
    #[inline(always)]
    fn beside<const K: i32>(has: Self::Has, from: &[f32], _here: Self, _next: Self) -> Self {
        Self::load(has, &from[K as usize..])
    }

    fn splat(has: Self::Has, value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// `self * factor + summand`, fused where the processor can.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// `summand - self * factor`, fused where the processor can.
    fn neg_mul_add(self, factor: Self, summand: Self) -> Self;
    /// The last `N - K` lanes, followed by the first `K` of `next`; `K` is from 1 to 4.
    fn after<const K: i32>(self, next: Self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// `self`, which must not be negative, with the sign of `other`.
    fn with_sign_of(self, other: Self) -> Self;
    /// 1 in the lanes where `self < other`, 0 in the others.
    fn one_where_less(self, other: Self) -> Self;
    /// `1 / self` to 12 bits or better.
    fn reciprocal_estimate(self) -> Self;
    /// `1 / sqrt(self)` to 12 bits or better.
    fn inverse_root_estimate(self) -> Self;

    /// The numbers; those beyond `N` are 0.
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut numbers = [0.0; 16];
        self.store(&mut numbers);
        numbers
    }

    /// `1 / self` to the last bit or two: the estimate and a Newton step, at a third of the cost of a division. Finite for
    /// magnitudes from 1e-37 to 1e37.
    #[inline(always)]
    fn reciprocal(self, has: Self::Has) -> Self {
        let estimate = self.reciprocal_estimate();
        let error = self.neg_mul_add(estimate, Self::splat(has, 1.0));
        error.mul_add(estimate, estimate)
    }

    /// `1 / sqrt(self)` to single precision: the estimate and a Newton step.
    #[inline(always)]
    fn inverse_root(self, has: Self::Has) -> Self {
        let y = self.inverse_root_estimate();
        let half = self.mul(Self::splat(has, -0.5));
        let correction = half.mul(y).mul_add(y, Self::splat(has, 1.5));
        y.mul(correction)
    }
}

/// The first `N` numbers.
#[inline(always)]
pub(super) fn numbers<const N: usize>(from: &[f32]) -> &[f32; N] {
    from.first_chunk().unwrap_or_else(|| unreachable!("{} numbers for a vector of {N}", from.len()))
}

/// Room for the first `N` numbers.
#[inline(always)]
fn room<const N: usize>(to: &mut [f32]) -> &mut [f32; N] {
    let length = to.len();
    to.first_chunk_mut().unwrap_or_else(|| unreachable!("room for {length} numbers of a vector of {N}"))
}
