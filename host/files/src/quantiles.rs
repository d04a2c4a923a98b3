//! Exact quantiles of large maps in two passes, without copy or sort.

use ndarray::ArrayView2;

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
        let mut counts = vec![0_u32; BINS];
        for value in map.iter().filter(|value| value.is_finite()) {
            counts[(key(*value) >> 16) as usize] += 1;
        }
        let finite = counts.iter().map(|count| *count as usize).sum();
        Self { map, counts, finite }
    }

    pub fn finite(&self) -> usize {
        self.finite
    }

    /// The finite value of this rank (0: smallest).
    pub fn at(&self, rank: usize) -> Option<f32> {
        let (upper, before) = place(&self.counts, rank)?;
        let mut counts = vec![0_u32; BINS];
        for key in self.map.iter().filter(|value| value.is_finite()).map(|value| key(*value)) {
            if (key >> 16) as usize == upper {
                counts[(key & 0xffff) as usize] += 1;
            }
        }
        let (lower, _) = place(&counts, rank - before)?;
        Some(value((upper as u32) << 16 | lower as u32))
    }
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
