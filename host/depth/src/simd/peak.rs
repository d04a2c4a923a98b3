//! Multiply-adds in registers only: a core's limit, the reference of the benchmarks.

use std::hint::black_box;

use super::dispatch;
use super::lanes::Lanes;
use crate::simd::Backend;

/// Independent sums: more than latency times units on any known processor, few enough for 16 registers.
const SUMS: usize = 12;

impl Backend {
    /// Independent multiply-adds in registers; returns their floating-point operations, two per lane and multiply-add.
    pub fn multiply_adds(self, rounds: u32) -> u64 {
        let [factor, summand] = black_box([0.999_f32, 0.001]);
        black_box(chains(self, rounds, factor, summand))
    }
}

dispatch! {
    fn chains(rounds: u32, factor: f32, summand: f32) -> u64 = chains_generic
}

#[inline(always)]
fn chains_generic<L: Lanes>(rounds: u32, factor: f32, summand: f32) -> u64 {
    let [factor, summand] = [L::splat(factor), L::splat(summand)];
    let mut sums = [summand; SUMS];
    for i in 1..SUMS {
        // Different starts, or the compiler would compute a single chain.
        sums[i] = sums[i - 1].add(summand);
    }
    for _ in 0..rounds {
        for i in 0..SUMS {
            sums[i] = sums[i].mul_add(factor, summand);
        }
    }
    for i in 0..SUMS {
        black_box(sums[i].to_array());
    }
    u64::from(rounds) * (2 * SUMS * L::N) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_are_counted_by_lanes() {
        for (backend, lanes) in
            [(Backend::Avx512, 16), (Backend::Avx2, 8), (Backend::Neon, 4), (Backend::Portable, 4)]
        {
            if backend.is_available() {
                assert_eq!(backend.multiply_adds(10), 10 * 2 * 12 * lanes);
            }
        }
    }
}
