//! Seeded damage to silhouettes as by bad segmentation.

use crate::mask::{BoundingBox, Mask, bits::BitMask};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// A gap at the neck (four of five frames), one at any height (every other frame) and three holes of up
    /// to 12 % of the height; one frame in ten loses up to a quarter of its width. Like the KTH set.
    Broken,
    /// Pixels within two of the outline are inverted with probability 30 %.
    Ragged,
}

pub fn damaged(mask: &Mask, damage: Damage, seed: u64) -> Mask {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let Some(bounds) = BoundingBox::of(mask.view()) else { return mask.clone() };
    match damage {
        Damage::Broken => broken(mask, bounds, &mut rng),
        Damage::Ragged => ragged(mask, &mut rng),
    }
}

fn broken(mask: &Mask, bounds: BoundingBox, rng: &mut ChaCha8Rng) -> Mask {
    let (height, width) = (bounds.height() as f64, bounds.width() as f64);
    let mut gaps: Vec<[f64; 2]> = Vec::new();
    let mut gap = |place: f64, thickness: f64| {
        let top = bounds.top as f64 + place * height;
        gaps.push([top, top + (thickness * height).max(1.0)]);
    };
    if rng.random_bool(0.8) {
        gap(rng.random_range(0.12..0.17), rng.random_range(0.01..0.035));
    }
    if rng.random_bool(0.5) {
        gap(rng.random_range(0.3..0.9), rng.random_range(0.01..0.04));
    }
    let holes: Vec<[f64; 3]> = (0..3)
        .map(|_| {
            let (y, x) = (rng.random_range(0.1..0.9), rng.random_range(0.1..0.9));
            [
                bounds.top as f64 + y * height,
                bounds.left as f64 + x * width,
                rng.random_range(0.02..0.06) * height,
            ]
        })
        .collect();
    let (mut from, mut to) = (bounds.left as f64, bounds.right as f64);
    if rng.random_bool(0.1) {
        let lost = rng.random_range(0.05..0.25) * width;
        if rng.random_bool(0.5) { from += lost } else { to -= lost }
    }
    Mask::from_shape_fn(mask.dim(), |(row, column)| {
        let (y, x) = (row as f64 + 0.5, column as f64 + 0.5);
        mask[[row, column]]
            && (from..to).contains(&x)
            && !gaps.iter().any(|gap| (gap[0]..gap[1]).contains(&y))
            && !holes.iter().any(|hole| (y - hole[0]).hypot(x - hole[1]) < hole[2])
    })
}

fn ragged(mask: &Mask, rng: &mut ChaCha8Rng) -> Mask {
    const REACH_PX: usize = 2;
    const CHANCE: f64 = 0.3;
    let grown = BitMask::pack(mask.view()).dilated(REACH_PX).unpack();
    let shrunk = BitMask::pack(mask.view()).eroded(REACH_PX).unpack();
    Mask::from_shape_fn(mask.dim(), |at| {
        let near = grown[at] && !shrunk[at];
        mask[at] != (near && rng.random_bool(CHANCE))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar() -> Mask {
        Mask::from_shape_fn((200, 80), |(y, x)| (20..180).contains(&y) && (25..55).contains(&x))
    }

    fn differs(a: &Mask, b: &Mask) -> usize {
        a.iter().zip(b).filter(|(a, b)| a != b).count()
    }

    #[test]
    fn broken_masks_only_lose_pixels_and_keep_most() {
        let whole = bar();
        for seed in 0..30 {
            let found = damaged(&whole, Damage::Broken, seed);
            assert!(found.iter().zip(&whole).all(|(found, whole)| !found || *whole));
            let lost = differs(&found, &whole);
            assert!(lost > 0 && lost < 30 * 160 / 2, "seed {seed}: {lost}");
        }
        assert_eq!(damaged(&whole, Damage::Broken, 3), damaged(&whole, Damage::Broken, 3));
    }

    #[test]
    fn ragged_masks_change_at_the_outline_only() {
        let whole = bar();
        let found = damaged(&whole, Damage::Ragged, 1);
        let changed = differs(&found, &whole);
        // The outline is 2 (160 + 30) pixels long and four thick; three in ten are inverted.
        assert!((350..600).contains(&changed), "{changed}");
        assert!(found[[100, 40]] && !found[[100, 10]]);
    }
}
