//! Four lanes of portable code: what every 64-bit processor has.

use super::{Lanes, numbers, room};

/// No proof is needed.
pub(crate) type Always = ();

/// Four numbers.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f32; 4]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for Portable {
    type Has = Always;
    const N: usize = 4;
    const INTERLEAVED: usize = 2;

    #[inline(always)]
    fn load(_: Always, from: &[f32]) -> Self {
        Self(*numbers(from))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        *room(to) = self.0;
    }

    #[inline(always)]
    fn splat(_: Always, value: f32) -> Self {
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
        // Not fused: without the instruction a fused one is a slow library call.
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
}
