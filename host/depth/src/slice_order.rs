//! Slices of a focal stack that are out of order. The sharpness of a place rises up to its focus and falls behind it, so the
//! right order is the shortest path through the sharpness of all places, from no sharpness and back. Exchanged slices are
//! those whose exchange removes most of the excess, and the first slice of a wrapped stack is the one at which the path must
//! begin. Noise, irregular steps and a single bad slice cause an excess that no exchange removes, and a path that begins at a
//! bad slice removes no more than the absence of that slice does. A picture that is composed of the slices is sharp
//! everywhere, also where they are not.

use ndarray::{ArrayView2, s};

use crate::brightness;
use crate::focus_measure::{SMALLEST_PX, tenengrad};

/// Fewest slices whose order tells anything.
const FEWEST: usize = 5;
/// Largest excess after an exchange, relative to that before, and to that without one of two distant slices.
const LEFT: f64 = 0.65;
const LEFT_OF_ABSENT: f64 = 0.75;
/// Largest excess of exchanged neighbours beyond that without one of them, which also removes the excess of a bad slice.
const MORE_THAN_ABSENT: f64 = 0.15;
/// Least excess that is removed, relative to the range of sharpness.
const LEAST: f64 = 0.04;
/// Least part of the blocks that gain, least gain of a block relative to its range, and blocks that lose relative to these. In 94 public
/// stacks thresholds of 0.25 to 0.4 found the same exchanged slices; a composed picture next to the focus of most blocks gained in 0.32.
const GAINING: f64 = 0.3;
const GAIN: f64 = 0.02;
const LOSING: f64 = 0.25;
/// Largest excess without a composed picture, relative to that of all.
const LEFT_OF_ALL: f64 = 0.5;
/// Largest part of the excess of a wrapped order that the absence of one slice removes, too. In 107 public stacks with one blurred or
/// shaken slice it was never less.
const REMOVED_BY_ABSENCE: f64 = 0.9;
/// Sharpness of a composed picture relative to the sharpest slice, and least part of the blocks that have it.
const COMPOSED: f64 = 0.8;
const COMPOSED_BLOCKS: f64 = 0.9;
/// By how much an exchange with the first or the last slice must be better than one without: sharpness has one neighbour there.
const AT_END: f64 = 0.1;

/// Sharpness of each of the [`brightness::blocks`] of a slice, relative to its brightness; not finite where half of a block was
/// not seen, and empty for slices that are too small or dark. See [`comparable`].
pub fn sharpness(image: ArrayView2<f32>) -> Vec<f64> {
    let seen = |part: ArrayView2<f32>| part.iter().filter(|value| value.is_finite()).count();
    let mean = brightness::mean(image);
    let parts: Vec<_> =
        brightness::blocks(image.dim()).map(|[rows, columns]| image.slice(s![rows, columns])).collect();
    let is_small = |part: &ArrayView2<f32>| part.nrows().min(part.ncols()) < SMALLEST_PX;
    if mean <= 0.0 || parts.iter().any(is_small) {
        return Vec::new();
    }
    let measured = |part: ArrayView2<f32>| match 2 * seen(part) < part.len() {
        true => f64::NAN,
        false => tenengrad(part) / (mean * mean),
    };
    parts.into_iter().map(measured).collect()
}

/// The [`sharpness`] of the slices of a stack in the blocks that all of them show and that have detail in any; empty for a
/// slice that shows less than half.
pub fn comparable(measured: &[Vec<f64>]) -> Vec<Vec<f64>> {
    /// Detail below this part of the largest sharpness of a usual slice does not count.
    const LEAST: f64 = 1e-4;
    // A slice that shows little must not cost the others their blocks, nor noise in a black one their detail.
    let tells = |slice: &Vec<f64>| {
        let seen = slice.iter().filter(|value| value.is_finite()).count();
        seen > 0 && 2 * seen >= slice.len()
    };
    let telling = || measured.iter().filter(|slice| tells(slice));
    let mut largest: Vec<f64> = telling().map(|slice| slice.iter().copied().fold(0.0, f64::max)).collect();
    largest.sort_unstable_by(f64::total_cmp);
    let least = LEAST * largest.get(largest.len() / 2).copied().unwrap_or(0.0);
    let blocks = telling().map(Vec::len).max().unwrap_or(0);
    let of = |block: usize| telling().map(move |slice| slice[block]);
    let is_kept = |block: &usize| of(*block).all(f64::is_finite) && of(*block).any(|value| value > least);
    let kept: Vec<usize> = (0..blocks).filter(is_kept).collect();
    let of_slice = |slice: &Vec<f64>| match tells(slice) {
        true => kept.iter().map(|block| slice[*block].max(least)).collect(),
        false => Vec::new(),
    };
    measured.iter().map(of_slice).collect()
}

/// Slices that show anything, and their numbers: a black slice has no place in the order.
fn shown(sharpness: &[Vec<f64>]) -> (Vec<usize>, Vec<&[f64]>) {
    sharpness.iter().map(Vec::as_slice).enumerate().filter(|(_, slice)| !slice.is_empty()).unzip()
}

/// Pairs of slices that look exchanged, from the [`comparable`] sharpness of each slice in the given order. Not found: neighbours at an
/// end, slices equally far from the focus of a flat target, and differences below the noise.
pub fn exchanged(sharpness: &[Vec<f64>]) -> Vec<[usize; 2]> {
    let mut found = Vec::new();
    let (numbers, sharpness) = shown(sharpness);
    let Some(mut path) = Path::of(&sharpness) else { return found };
    while found.len() < sharpness.len() / 3
        && let Some([a, b]) = path.exchange()
    {
        path.slices.swap(a, b);
        found.push([numbers[a - 1], numbers[b - 1]]);
    }
    found
}

/// The first slice of a stack whose order is wrapped (6 to 9, then 1 to 5), from the [`comparable`] sharpness of each slice in the given order.
/// Not found: a single slice at the wrong end, which looks like a bad one.
pub fn wrapped(sharpness: &[Vec<f64>]) -> Option<usize> {
    let (numbers, sharpness) = shown(sharpness);
    let path = Path::of(&sharpness)?;
    let from = |first: usize| {
        let mut order = path.order();
        order[1..=sharpness.len()].rotate_left(first);
        path.excess(&order)
    };
    let firsts = (1..sharpness.len()).map(|first| (first, from(first)));
    let (first, excess) = firsts.min_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))?;
    let given = path.excess(&path.order());
    // Noise adds about as much to the excess of each order, so only differences tell.
    let removed = |excess: &[f64]| total(&given) - total(excess);
    let least = REMOVED_BY_ABSENCE * removed(&excess);
    let is_one_bad = || (0..sharpness.len()).any(|absent| removed(&path.without(absent)) > least);
    (path.is_better(&given, &excess) && !is_one_bad()).then(|| numbers[first])
}

/// A slice that is sharp everywhere and does not fit into the order, such as a picture that is composed of the others, from the
/// [`comparable`] sharpness of each slice.
pub fn composed(sharpness: &[Vec<f64>]) -> Option<usize> {
    let (numbers, sharpness) = shown(sharpness);
    let path = Path::of(&sharpness)?;
    let is_sharp = |own: &usize| {
        let others = || sharpness.iter().enumerate().filter(move |(other, _)| other != own);
        let sharpest = |block: usize| others().map(|(_, other)| other[block]).fold(0.0, f64::max);
        let blocks = sharpness[*own].iter().enumerate();
        let sharp = blocks.filter(|(block, value)| **value >= COMPOSED * sharpest(*block)).count();
        sharp as f64 >= COMPOSED_BLOCKS * path.ranges.len() as f64
    };
    // Next to a sharp end of the stack, a bad slice alone would contradict the order.
    let is_alone = |own: &usize, excess: &[f64]| {
        let mut others = (0..sharpness.len()).filter(|other| other != own);
        others.all(|other| total(excess) < LEFT_OF_ABSENT * total(&path.without(other)))
    };
    let found = (0..sharpness.len()).filter(is_sharp).find(|own| {
        let excess = path.without(*own);
        path.is_right(&excess) && is_alone(own, &excess)
    });
    found.map(|own| numbers[own])
}

fn total(excess: &[f64]) -> f64 {
    excess.iter().sum()
}

/// Logarithms of sharpness by slice and block, with the least of each block before the first slice and behind the last one.
struct Path {
    slices: Vec<Vec<f64>>,
    /// Range of each block.
    ranges: Vec<f64>,
}

impl Path {
    fn of(sharpness: &[&[f64]]) -> Option<Self> {
        if sharpness.len() < FEWEST {
            return None;
        }
        let logarithms =
            |slice: &&[f64]| slice.iter().map(|value| value.max(f64::MIN_POSITIVE).ln()).collect();
        let mut slices: Vec<Vec<f64>> = sharpness.iter().map(logarithms).collect();
        let extreme = |of: fn(f64, f64) -> f64| -> Vec<f64> {
            let blocks = 0..slices[0].len();
            blocks.map(|block| slices.iter().map(|slice| slice[block]).reduce(of).unwrap_or(0.0)).collect()
        };
        let [least, most] = [extreme(f64::min), extreme(f64::max)];
        let ranges = least.iter().zip(most).map(|(least, most)| most - least).collect();
        slices.insert(0, least.clone());
        slices.push(least);
        Some(Self { slices, ranges })
    }

    /// The order given.
    fn order(&self) -> Vec<usize> {
        (0..self.slices.len()).collect()
    }

    /// The excess in the order given without one slice.
    fn without(&self, absent: usize) -> Vec<f64> {
        let mut order = self.order();
        order.remove(absent + 1);
        self.excess(&order)
    }

    /// Numbers of two slices that look exchanged, from 1.
    fn exchange(&self) -> Option<[usize; 2]> {
        let count = self.slices.len() - 2;
        let before = self.excess(&self.order());
        let all = total(&before);
        let is_end = |[a, b]: [usize; 2]| a == 1 || b == count;
        let cost = |pair| self.change(pair) + if is_end(pair) { AT_END * all } else { 0.0 };
        let pairs = (1..=count).flat_map(|a| (a + 1..=count).map(move |b| [a, b]));
        let pair = pairs
            .filter(|pair| !(is_end(*pair) && pair[1] == pair[0] + 1))
            .map(|pair| (cost(pair), pair))
            .min_by(|one, other| one.0.total_cmp(&other.0))?
            .1;
        let mut exchanged = self.order();
        exchanged.swap(pair[0], pair[1]);
        let after = self.excess(&exchanged);
        let left = total(&after);
        let absent = pair.map(|absent| total(&self.without(absent - 1)));
        let [less, more] = [absent[0].min(absent[1]), absent[0].max(absent[1])];
        let mended = if pair[1] == pair[0] + 1 {
            more < LEFT * all && left < less + MORE_THAN_ABSENT * all
        } else {
            left < LEFT_OF_ABSENT * less
        };
        let clear = left < LEFT * all && self.is_better(&before, &after);
        (mended && clear).then_some(pair)
    }

    /// Whether an order with this excess in each block is clearly better than another, in most blocks.
    fn is_better(&self, before: &[f64], after: &[f64]) -> bool {
        let blocks = |better: &[f64], worse: &[f64]| {
            let gains = better.iter().zip(worse).zip(&self.ranges);
            gains.filter(|((better, worse), range)| *worse - *better > GAIN * *range).count() as f64
        };
        let [gaining, losing] = [blocks(after, before), blocks(before, after)];
        let agreed = gaining > GAINING * before.len() as f64 && losing < LOSING * gaining;
        agreed && total(before) - total(after) > LEAST * total(&self.ranges)
    }

    /// Whether an order with this excess in each block explains almost all that contradicts the order given.
    fn is_right(&self, excess: &[f64]) -> bool {
        let given = self.excess(&self.order());
        total(excess) < LEFT_OF_ALL * total(&given) && self.is_better(&given, excess)
    }

    /// By how much an exchange changes the length of the path.
    fn change(&self, [a, b]: [usize; 2]) -> f64 {
        let after = |place: usize| {
            if place == a {
                b
            } else if place == b {
                a
            } else {
                place
            }
        };
        let mut steps = [a - 1, a, b - 1, b].to_vec();
        steps.dedup();
        let step = |from: usize, to: usize| -> f64 {
            self.slices[from].iter().zip(&self.slices[to]).map(|(from, to)| (to - from).abs()).sum()
        };
        steps.iter().map(|from| step(after(*from), after(from + 1)) - step(*from, from + 1)).sum()
    }

    /// Length of the path in each block, in this order, beyond the way from the least sharpness to the largest and back.
    fn excess(&self, order: &[usize]) -> Vec<f64> {
        let of_block = |block: usize| {
            let values: Vec<f64> = order.iter().map(|slice| self.slices[*slice][block]).collect();
            let length: f64 = values.windows(2).map(|two| (two[1] - two[0]).abs()).sum();
            let most = values.iter().copied().fold(values[0], f64::max);
            length - 2.0 * (most - values[0])
        };
        (0..self.ranges.len()).map(of_block).collect()
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    const SIZE: (usize, usize) = (72, 96);

    fn scene(seed: u64) -> Array2<f32> {
        Array2::from_shape_fn(SIZE, |(y, x)| {
            let mixed = ((y * SIZE.1 + x) as u64 + seed * 1_000_003).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            0.3 + 0.4 * (mixed >> 40) as f32 / (1 << 24) as f32
        })
    }

    /// Blur of half a pixel squared.
    fn smoothed(image: &Array2<f32>) -> Array2<f32> {
        let (height, width) = image.dim();
        let row = |y: usize, x: usize| {
            let [left, right] = [x.saturating_sub(1), (x + 1).min(width - 1)];
            0.25 * image[(y, left)] + 0.5 * image[(y, x)] + 0.25 * image[(y, right)]
        };
        Array2::from_shape_fn(image.dim(), |(y, x)| {
            0.25 * row(y.saturating_sub(1), x) + 0.5 * row(y, x) + 0.25 * row((y + 1).min(height - 1), x)
        })
    }

    /// Noisy slices of a plane that is in focus from `depths[0]` to `depths[1]`; the blur grows by 0.45 px per position.
    fn stack(positions: &[f32], depths: [f32; 2], noise: f32) -> Vec<Array2<f32>> {
        let passes = |x: usize, position: f32| {
            let depth = depths[0] + (depths[1] - depths[0]) * x as f32 / SIZE.1 as f32;
            2.0 * (0.45 * (depth - position)).powi(2)
        };
        let most = positions.iter().flat_map(|position| [passes(0, *position), passes(SIZE.1, *position)]);
        let most = most.fold(0.0, f32::max) as usize;
        let blurred: Vec<Array2<f32>> =
            std::iter::successors(Some(scene(1)), |image| Some(smoothed(image))).take(most + 2).collect();
        let image = |(index, position): (usize, &f32)| {
            let grain = scene(100 + index as u64);
            Array2::from_shape_fn(SIZE, |(y, x)| {
                let passes = passes(x, *position);
                let below = passes as usize;
                let part = passes - below as f32;
                let value = (1.0 - part) * blurred[below][(y, x)] + part * blurred[below + 1][(y, x)];
                value + noise * (grain[(y, x)] - 0.5)
            })
        };
        positions.iter().enumerate().map(image).collect()
    }

    fn measured(images: &[Array2<f32>]) -> Vec<Vec<f64>> {
        comparable(&images.iter().map(|image| sharpness(image.view())).collect::<Vec<_>>())
    }

    fn even(count: usize) -> Vec<f32> {
        (0..count).map(|index| index as f32).collect()
    }

    #[test]
    fn exchanged_slices_are_found() {
        for (count, depths) in [(15, [3.0, 11.0]), (8, [2.0, 5.5]), (15, [8.2, 9.4])] {
            let good = measured(&stack(&even(count), depths, 0.02));
            assert!(exchanged(&good).is_empty(), "{depths:?}");
            let middle = count / 2;
            for pair in [[middle - 1, middle], [middle - 1, middle + 1], [middle - 3, middle + 1]] {
                let mut bad = good.clone();
                bad.swap(pair[0], pair[1]);
                assert_eq!(exchanged(&bad), [pair], "{depths:?}");
                assert_eq!((wrapped(&bad), composed(&bad)), (None, None), "{depths:?} {pair:?}");
            }
        }
    }

    #[test]
    fn two_exchanges_are_found() {
        let mut bad = measured(&stack(&even(15), [3.0, 11.0], 0.02));
        bad.swap(4, 8);
        bad.swap(10, 11);
        assert_eq!(exchanged(&bad), [[4, 8], [10, 11]]);
    }

    #[test]
    fn a_right_order_is_right_in_uneven_coarse_or_noisy_stacks() {
        let uneven: Vec<f32> = even(15).iter().map(|at| at + 0.4 * (1.7 * at).sin()).collect();
        let coarse: Vec<f32> = even(6).iter().map(|at| 2.8 * at).collect();
        for positions in [even(15), uneven, coarse] {
            for depths in [[3.0, 11.0], [7.0, 7.0], [-4.0, 2.0]] {
                for noise in [0.0, 0.05, 0.4] {
                    let images = stack(&positions, depths, noise);
                    let good = measured(&images);
                    assert!(exchanged(&good).is_empty(), "{positions:?} {depths:?} {noise}");
                    assert_eq!(
                        (wrapped(&good), composed(&good)),
                        (None, None),
                        "{positions:?} {depths:?} {noise}"
                    );
                    let drift = |(index, image): (usize, &Array2<f32>)| image * (1.0 - 0.03 * index as f32);
                    let drifting: Vec<Array2<f32>> = images.iter().enumerate().map(drift).collect();
                    assert!(exchanged(&measured(&drifting)).is_empty(), "{positions:?} {depths:?} {noise}");
                }
            }
        }
    }

    #[test]
    fn a_wrapped_order_is_found_by_its_first_slice() {
        for depths in [[3.0, 11.0], [8.2, 9.4]] {
            let good = measured(&stack(&even(15), depths, 0.02));
            for first in [3, 8, 12] {
                let mut bad = good.clone();
                bad.rotate_right(first);
                assert_eq!(wrapped(&bad), Some(first), "{depths:?}");
            }
        }
    }

    #[test]
    fn a_wrapped_order_is_found_in_noise() {
        let mut bad = measured(&stack(&even(15), [5.0, 8.0], 0.2));
        bad.rotate_right(12);
        let first = wrapped(&bad);
        assert!(first.is_some_and(|first| (11..=13).contains(&first)), "{first:?}");
    }

    /// Most of the excess is the noise's, in the right order, too.
    #[test]
    fn a_wrapped_order_is_found_below_much_noise() {
        let mut bad = measured(&stack(&even(15), [3.0, 11.0], 1.0));
        assert_eq!(wrapped(&bad), None);
        bad.rotate_right(8);
        let first = wrapped(&bad);
        assert!(first.is_some_and(|first| (7..=9).contains(&first)), "{first:?}");
    }

    /// From a blurred slice on, sharpness rises and falls once.
    #[test]
    fn a_blurred_slice_is_not_the_end_of_a_wrapped_stack() {
        for (depths, blurred, passes) in [([8.2, 9.4], 1, 12), ([6.0, 8.0], 13, 12), ([6.0, 8.0], 1, 40)] {
            let mut images = stack(&even(15), depths, 0.02);
            images[blurred] = (0..passes).fold(images[blurred].clone(), |image, _| smoothed(&image));
            assert_eq!(wrapped(&measured(&images)), None, "{depths:?} {blurred}");
        }
    }

    /// Only a third of the blocks are sharp elsewhere.
    #[test]
    fn a_composed_picture_is_found_next_to_the_focus_of_most_blocks() {
        let mut images = stack(&even(9), [1.5, 5.5], 0.02);
        images.insert(4, scene(1));
        assert_eq!(composed(&measured(&images)), Some(4));
    }

    #[test]
    fn a_composed_picture_is_found_at_any_place() {
        let good = stack(&even(15), [3.0, 11.0], 0.02);
        for at in [0, 7, 15] {
            let mut bad = good.clone();
            bad.insert(at, scene(1));
            assert_eq!(composed(&measured(&bad)), Some(at));
        }
    }

    /// A background without detail, and a border that one slice does not show.
    #[test]
    fn blocks_without_detail_and_unseen_ones_tell_nothing() {
        let mut images = stack(&even(15), [3.0, 11.0], 0.0);
        images.rotate_right(5);
        let dark = |image: &mut Array2<f32>| image.slice_mut(s![..40, ..40]).fill(0.01);
        images.iter_mut().for_each(dark);
        images[7].column_mut(0).fill(f32::NAN);
        images[8].slice_mut(s![.., ..10]).fill(f32::NAN);
        assert_eq!(wrapped(&measured(&images)), Some(5));
        images.rotate_left(5);
        images.insert(6, scene(1));
        images.iter_mut().for_each(dark);
        assert_eq!(composed(&measured(&images)), Some(6));
    }

    #[test]
    fn a_black_slice_and_one_that_shows_little_cost_the_others_nothing() {
        let good = stack(&even(15), [3.0, 11.0], 0.02);
        let mut black = Array2::zeros(good[0].dim());
        black[(5, 5)] = 1e-3;
        let mut cut = good[8].clone();
        cut.slice_mut(s![.., 30..]).fill(f32::NAN);
        let usual = measured(&good);
        for bad in [black, cut] {
            let all = measured(&[good.clone(), vec![bad]].concat());
            assert!(all[..15] == usual, "{:?}", all[0]);
        }
    }

    #[test]
    fn slices_around_a_black_one_keep_their_order() {
        let good = stack(&even(15), [3.0, 11.0], 0.02);
        let with_black = |mut images: Vec<Array2<f32>>| {
            images.insert(2, Array2::zeros(SIZE));
            measured(&images)
        };
        let mut images = good.clone();
        images.rotate_right(5);
        assert_eq!(wrapped(&with_black(images)), Some(6));
        let mut images = good.clone();
        images.swap(7, 9);
        assert_eq!(exchanged(&with_black(images)), [[8, 10]]);
        let mut images = good;
        images.insert(7, scene(1));
        assert_eq!(composed(&with_black(images)), Some(8));
    }

    #[test]
    fn a_sharp_end_next_to_a_blurred_slice_is_not_composed() {
        for (depths, blurred) in [([0.0, 0.8], 1), ([11.0, 10.2], 10)] {
            let mut images = stack(&even(12), depths, 0.02);
            images[blurred] = (0..12).fold(images[blurred].clone(), |image, _| smoothed(&image));
            assert_eq!(composed(&measured(&images)), None, "{depths:?}");
        }
    }

    #[test]
    fn a_defocused_or_foreign_slice_is_not_exchanged() {
        let good = stack(&even(15), [3.0, 11.0], 0.02);
        for at in 0..good.len() {
            let defocused = (0..12).fold(good[at].clone(), |image, _| smoothed(&image));
            for bad in [defocused, scene(2)] {
                let mut images = good.clone();
                images[at] = bad;
                let found = measured(&images);
                assert_eq!((exchanged(&found), wrapped(&found)), (vec![], None), "{at}");
            }
        }
    }
}
