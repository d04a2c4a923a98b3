//! Exact quantiles of large maps in two passes, without copy or sort.

use ndarray::{ArrayView2, Axis};
use rayon::prelude::*;

/// Histogram bins by the upper half of the ordered key.
const BINS: usize = 1 << 16;

pub struct Quantiles<'a> {
    map: ArrayView2<'a, f32>,
    counts: Vec<u32>,
    finite: usize,
}

/// Integer key with the order of the values.
fn key(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

fn value(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

impl<'a> Quantiles<'a> {
    pub fn new(map: ArrayView2<'a, f32>) -> Self {
        let counts = histogram(map, |key| Some(key >> 16));
        let finite = counts.iter().map(|count| *count as usize).sum();
        Self { map, counts, finite }
    }

    pub fn finite(&self) -> usize {
        self.finite
    }

    /// The finite value of this rank (0: smallest).
    pub fn at(&self, rank: usize) -> Option<f32> {
        let (upper, before) = place(&self.counts, rank)?;
        let counts = histogram(self.map, |key| ((key >> 16) as usize == upper).then_some(key & 0xffff));
        let (lower, _) = place(&counts, rank - before)?;
        Some(value((upper as u32) << 16 | lower as u32))
    }
}

/// Counts of the finite values by the bin of their key, on all threads.
fn histogram(map: ArrayView2<f32>, bin: impl Fn(u32) -> Option<u32> + Sync) -> Vec<u32> {
    let rows = map.nrows().div_ceil(rayon::current_num_threads()).max(1);
    let parts = map.axis_chunks_iter(Axis(0), rows).into_par_iter().map(|part| {
        // Neighbours often have one bin: with one count for both, each would wait for the one before.
        let mut counts = vec![[0_u32; 4]; BINS];
        for (i, value) in part.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            if let Some(bin) = bin(key(*value)) {
                counts[bin as usize][i % 4] += 1;
            }
        }
        counts.into_iter().map(|counts| counts.iter().sum()).collect::<Vec<u32>>()
    });
    parts.reduce(
        || vec![0; BINS],
        |mut all, part| {
            all.iter_mut().zip(part).for_each(|(all, count)| *all += count);
            all
        },
    )
}

fn place(counts: &[u32], rank: usize) -> Option<(usize, usize)> {
    let mut before = 0;
    for (bin, count) in counts.iter().enumerate() {
        if rank < before + *count as usize {
            return Some((bin, before));
        }
        before += *count as usize;
    }
    None
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_rank_is_that_of_the_sorted_values(bits in proptest::collection::vec(any::<u32>(), 1..80)) {
            let map = Array2::from_shape_fn((1, bits.len()), |(_, x)| f32::from_bits(bits[x]));
            let mut sorted: Vec<f32> = map.iter().copied().filter(|value| value.is_finite()).collect();
            sorted.sort_by(f32::total_cmp);
            let quantiles = Quantiles::new(map.view());
            prop_assert_eq!(quantiles.finite(), sorted.len());
            for (rank, value) in sorted.iter().enumerate() {
                prop_assert_eq!(quantiles.at(rank).map(f32::to_bits), Some(value.to_bits()));
            }
            prop_assert_eq!(quantiles.at(sorted.len()), None);
        }
    }
}
