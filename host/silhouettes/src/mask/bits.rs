//! Masks as bits, 64 pixels a word, for fast morphology. The structuring element is a square of side 2 r + 1;
//! pixels outside the image are unset for dilation and set for erosion. O(height width r / 64).

use ndarray::{Array2, ArrayView2};

/// Each row begins on a word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BitMask {
    height: usize,
    width: usize,
    row_words: usize,
    words: Vec<u64>,
}

impl BitMask {
    #[must_use]
    pub fn pack(mask: ArrayView2<'_, bool>) -> Self {
        let (height, width) = mask.dim();
        let row_words = width.div_ceil(64);
        let mut words = vec![0; row_words * height];
        if row_words > 0 {
            for (row, packed) in mask.outer_iter().zip(words.chunks_exact_mut(row_words)) {
                let bit = |(at, &set): (usize, &bool)| u64::from(set) << (at % 64);
                match row.as_slice() {
                    Some(row) => row.chunks(64).zip(packed).for_each(|(pixels, word)| {
                        *word = pixels.iter().enumerate().map(bit).fold(0, |word, bit| word | bit);
                    }),
                    None => row.indexed_iter().for_each(|(at, set)| packed[at / 64] |= bit((at, set))),
                }
            }
        }
        Self { height, width, row_words, words }
    }

    #[must_use]
    pub fn unpack(&self) -> Array2<bool> {
        let mut mask = Array2::from_elem((self.height, self.width), false);
        if self.row_words > 0 {
            for (mut row, packed) in mask.outer_iter_mut().zip(self.words.chunks_exact(self.row_words)) {
                for (at, pixel) in row.iter_mut().enumerate() {
                    *pixel = packed[at / 64] >> (at % 64) & 1 == 1;
                }
            }
        }
        mask
    }

    #[must_use]
    pub fn dilated(mut self, radius_px: usize) -> Self {
        for _ in 0..radius_px.min(self.width.max(self.height)) {
            self.grow();
        }
        self
    }

    #[must_use]
    pub fn eroded(self, radius_px: usize) -> Self {
        self.inverted().dilated(radius_px).inverted()
    }

    /// Removes parts thinner than 2 `radius_px` + 1.
    #[must_use]
    pub fn opened(self, radius_px: usize) -> Self {
        self.eroded(radius_px).dilated(radius_px)
    }

    /// Bridges gaps narrower than 2 `radius_px` + 1.
    #[must_use]
    pub fn closed(self, radius_px: usize) -> Self {
        self.dilated(radius_px).eroded(radius_px)
    }

    #[must_use]
    pub fn inverted(mut self) -> Self {
        if self.row_words > 0 {
            for row in self.words.chunks_exact_mut(self.row_words) {
                row.iter_mut().for_each(|word| *word = !*word);
                trim(row, self.width);
            }
        }
        self
    }

    fn grow(&mut self) {
        let step = self.row_words;
        if step == 0 {
            return;
        }
        for row in self.words.chunks_exact_mut(step) {
            let mut before = 0;
            for at in 0..step {
                let word = row[at];
                let after = row.get(at + 1).copied().unwrap_or(0);
                row[at] = word | (word << 1 | before >> 63) | (word >> 1 | after << 63);
                before = word;
            }
            trim(row, self.width);
        }
        // Original rows from above.
        let mut above = vec![0; step];
        for start in (0..self.words.len()).step_by(step) {
            for (at, above) in above.iter_mut().enumerate() {
                let word = self.words[start + at];
                let below = self.words.get(start + at + step).copied().unwrap_or(0);
                self.words[start + at] = word | *above | below;
                *above = word;
            }
        }
    }
}

fn trim(row: &mut [u64], width: usize) {
    if let (Some(last), rest @ 1..) = (row.last_mut(), width % 64) {
        *last &= (1 << rest) - 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dilated_plainly(mask: &Array2<bool>, radius: usize) -> Array2<bool> {
        Array2::from_shape_fn(mask.dim(), |(row, column)| {
            mask.indexed_iter()
                .any(|((r, c), &set)| set && r.abs_diff(row) <= radius && c.abs_diff(column) <= radius)
        })
    }

    fn masks() -> impl Strategy<Value = Array2<bool>> {
        (0_usize..9, 0_usize..140).prop_flat_map(|size| {
            prop::collection::vec(prop::bool::weighted(0.1), size.0 * size.1)
                .prop_map(move |pixels| Array2::from_shape_vec(size, pixels).unwrap())
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn packing_keeps_every_pixel(mask in masks()) {
            prop_assert_eq!(BitMask::pack(mask.view()).unpack(), mask.clone());
            let twice = BitMask::pack(mask.view()).inverted().inverted();
            prop_assert_eq!(twice.unpack(), mask);
        }

        #[test]
        fn dilation_and_erosion_are_what_their_definitions_say(mask in masks(), radius in 0_usize..4) {
            let bits = BitMask::pack(mask.view());
            prop_assert_eq!(bits.clone().dilated(radius).unpack(), dilated_plainly(&mask, radius));
            let eroded = dilated_plainly(&mask.mapv(|set| !set), radius).mapv(|set| !set);
            prop_assert_eq!(bits.eroded(radius).unpack(), eroded);
        }

        #[test]
        fn opening_only_takes_and_closing_only_gives(mask in masks(), radius in 0_usize..4) {
            let bits = BitMask::pack(mask.view());
            let (opened, closed) = (bits.clone().opened(radius).unpack(), bits.clone().closed(radius).unpack());
            prop_assert!(opened.iter().zip(&mask).all(|(&after, &before)| before || !after));
            prop_assert!(closed.iter().zip(&mask).all(|(&after, &before)| after || !before));
            // Idempotent, as in Serra's definitions.
            prop_assert_eq!(bits.clone().opened(radius).opened(radius).unpack(), opened);
            prop_assert_eq!(bits.closed(radius).closed(radius).unpack(), closed);
        }
    }

    #[test]
    fn a_view_with_gaps_packs_like_a_copy() {
        let mask = Array2::from_shape_fn((5, 200), |(row, column)| (row * 31 + column * 17) % 5 == 0);
        let view = mask.slice(ndarray::s![.., ..;2]);
        assert_eq!(BitMask::pack(view), BitMask::pack(view.to_owned().view()));
    }
}
