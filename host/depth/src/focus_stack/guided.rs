//! Places of a stack, corrected along the edges of the sharp image.
//!
//! Window and blur enlarge a textured object in front of a dull surface; the sharp image still has its edges. Each
//! place becomes the weighted median of its surroundings (Ma et al., Constant time weighted median filtering for stereo
//! matching and beyond, ICCV 2013). Near and equally bright places weigh more. A weight falls with the sharpness
//! (strong detail spreads over weak surroundings) and rises with the curve's height above its mean (a place without
//! texture has no information). Places that the median confirms keep their own value, so that smooth surfaces keep
//! their accuracy. Cost: about 200 places for each pixel, for any window, and a histogram of 8 bins for each image of
//! the stack.

use ndarray::{Array2, ArrayView2, Axis, Zip};
use rayon::prelude::*;

use crate::median::median;

/// The window's radius in its standard deviations; pixels beyond have less than 6 % of the weight of the centre.
const RADIUS: f32 = 2.4;
/// Sampled places per standard deviation.
const PLACES: f32 = 4.0;
/// Standard deviation of the brightness weight, relative to the image's. From 0.1 to 0.5 little changes.
const EQUAL: f32 = 0.25;
/// Added to every sharpness, relative to the image's median: noise below it weighs equally.
const NOISE: f32 = 0.2;
/// Bins of the histogram for each image of the stack.
const BINS: f32 = 8.0;
/// Largest distance from the median, in images, at which a place is confirmed.
const CONFIRMED: f32 = 1.0;
/// Steps of the table of weights over the brightness, and of its end in standard deviations.
const STEPS: f32 = 16.0;
const END: f32 = 4.0;
/// Pixels between two calls of `after`: about 0.1 s.
const BAND_PX: usize = 1 << 18;

/// What the places are corrected by; all (height, width).
pub(super) struct Guide<'a> {
    /// The image that is sharp everywhere, finite.
    pub sharp: ArrayView2<'a, f32>,
    /// How sharp each place is.
    pub sharpness: ArrayView2<'a, f32>,
    /// Standard deviation of the window, px, above 0.
    pub reach_px: f32,
    /// Images in the stack: places are from 0 to one less.
    pub images: usize,
}

/// The places (finite) corrected along the guide's edges; `rise` is how far each one's curve rises above its mean, 0 to 1.
/// `after` is called with the number of rows that are done, and may end the work.
pub(super) fn mended<E>(
    place: ArrayView2<f32>,
    rise: Array2<f32>,
    guide: &Guide<'_>,
    mut after: impl FnMut(usize) -> Result<(), E>,
) -> Result<Array2<f32>, E> {
    let (height, width) = place.dim();
    let offsets = offsets(guide.reach_px);
    // Equally dark images have no edges to keep to: everything is equally bright then.
    let equal = (EQUAL * guide.sharp.std(0.0)).max(f32::MIN_POSITIVE);
    let table: Vec<f32> =
        (0..=(END * STEPS) as usize).map(|step| (-0.5 * (step as f32 / STEPS).powi(2)).exp()).collect();
    let usual = median(guide.sharpness.iter().copied().collect(), f32::total_cmp).unwrap_or(0.0);
    let noise = (NOISE * usual).max(f32::MIN_POSITIVE);
    let mut says = rise;
    Zip::from(&mut says)
        .and(guide.sharpness)
        .for_each(|says, sharpness| *says = *says * noise / (sharpness + noise));
    let bins = guide.images * BINS as usize + 1;
    let bin = place.mapv(|place| bin_of(place).min(bins - 1) as u32);
    let mut result = Array2::zeros((height, width));
    let band = (BAND_PX / width.max(1)).max(rayon::current_num_threads());
    for (index, mut rows) in result.axis_chunks_iter_mut(Axis(0), band).enumerate() {
        let first = index * band;
        rows.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(y, mut row)| {
            let y = first + y;
            let mut histogram = Histogram::new(bins);
            for (x, value) in row.iter_mut().enumerate() {
                let (own, bright) = (place[(y, x)], guide.sharp[(y, x)]);
                histogram.clear();
                for &(down, across, near) in &offsets {
                    let at = (y.wrapping_add_signed(down), x.wrapping_add_signed(across));
                    if at.0 >= height || at.1 >= width {
                        continue;
                    }
                    let step = (guide.sharp[at] - bright).abs() / equal * STEPS;
                    if let Some(alike) = table.get(step as usize) {
                        histogram.add(bin[at] as usize, place[at], near * alike * says[at]);
                    }
                }
                let found = histogram.median().unwrap_or(own);
                *value = if (found - own).abs() <= CONFIRMED { own } else { found };
            }
        });
        after(first + rows.nrows())?;
    }
    Ok(result)
}

/// The bin of a place of 0 or more.
fn bin_of(place: f32) -> usize {
    (place * BINS).round() as usize
}

/// Rows down, columns across and the weight by the distance, of a round window.
fn offsets(reach_px: f32) -> Vec<(isize, isize, f32)> {
    let stride = (reach_px / PLACES).ceil().max(1.0) as isize;
    let radius = (RADIUS * reach_px).ceil();
    let steps = radius as isize / stride;
    let all = (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i * stride, j * stride)));
    all.map(|(down, across)| (down, across, (down * down + across * across) as f32))
        .filter(|(.., square)| *square <= radius * radius)
        .map(|(down, across, square)| (down, across, (-0.5 * square / (reach_px * reach_px)).exp()))
        .collect()
}

/// Weights, and weighted places, by place.
struct Histogram {
    weights: Vec<f32>,
    places: Vec<f32>,
    total: f32,
}

impl Histogram {
    fn new(bins: usize) -> Self {
        Self { weights: vec![0.0; bins], places: vec![0.0; bins], total: 0.0 }
    }

    fn clear(&mut self) {
        self.weights.fill(0.0);
        self.places.fill(0.0);
        self.total = 0.0;
    }

    fn add(&mut self, bin: usize, place: f32, weight: f32) {
        self.weights[bin] += weight;
        self.places[bin] += weight * place;
        self.total += weight;
    }

    /// The mean of the bin in which half of the weight is reached; `None` without any weight.
    fn median(&self) -> Option<f32> {
        let mut below = 0.0;
        let reached = self.weights.iter().zip(&self.places).find(|(weight, _)| {
            below += **weight;
            below >= 0.5 * self.total && **weight > 0.0
        });
        reached.map(|(weight, place)| place / weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (40, 60);

    /// Corrected over 6 px in a stack of 12 images; all curves rise alike.
    fn mend(place: &Array2<f32>, sharp: &Array2<f32>, sharpness: &Array2<f32>) -> Array2<f32> {
        let rise = Array2::from_elem(SIZE, 0.5);
        let guide = Guide { sharp: sharp.view(), sharpness: sharpness.view(), reach_px: 6.0, images: 12 };
        mended_whole(place, rise, &guide)
    }

    fn mended_whole(place: &Array2<f32>, rise: Array2<f32>, guide: &Guide<'_>) -> Array2<f32> {
        let Ok(found) = mended(place.view(), rise, guide, |_| Ok::<_, std::convert::Infallible>(()));
        found
    }

    #[test]
    fn objects_on_a_dull_background_end_at_the_edge_of_the_sharp_image() {
        // The bright thing ends at column 30, its place at column 36.
        let across = |ends: usize, left: f32, right: f32| {
            Array2::from_shape_fn(SIZE, |(_, x)| if x < ends { left } else { right })
        };
        let found = mend(&across(36, 2.0, 9.0), &across(30, 0.8, 0.3), &across(36, 1.0, 0.05));
        // The mean of a bin is rounded.
        let farthest = (found - across(30, 2.0, 9.0)).fold(0.0_f32, |most, error| most.max(error.abs()));
        assert!(farthest < 1e-4, "{farthest}");
    }

    #[test]
    fn a_slope_keeps_its_places_whatever_the_pattern_on_it() {
        let slope = Array2::from_shape_fn(SIZE, |(y, x)| 2.0 + 0.1 * x as f32 + 0.013 * y as f32);
        let sharp = Array2::from_shape_fn(SIZE, |(y, x)| if (x / 5 + y / 5) % 2 == 0 { 0.2 } else { 0.7 });
        let found = mend(&slope, &sharp, &Array2::from_elem(SIZE, 0.3));
        // But at the picture's border, where the window lies on one side only: 6 px of it are half an image.
        assert_eq!(found, slope);
    }

    #[test]
    fn an_image_without_brightness_and_curves_without_a_tip_leave_all_as_it_is() {
        let place = Array2::from_shape_fn(SIZE, |(y, x)| ((x * 7 + y * 5) % 12) as f32);
        let [dark, flat] = [Array2::zeros(SIZE), Array2::<f32>::zeros(SIZE)];
        let guide = Guide { sharp: dark.view(), sharpness: flat.view(), reach_px: 6.0, images: 12 };
        assert_eq!(mended_whole(&place, flat.clone(), &guide), place);
    }

    #[test]
    fn a_wrong_place_in_a_narrow_bright_stripe_is_mended_by_the_stripe() {
        let in_stripe = |x: usize| (20..25).contains(&x);
        // Much brighter than its surroundings; two of the standard deviations over which brightness counts as equal, in an
        // image with more contrast beyond the window.
        for (stripe, end) in [(0.9, 0.2), (0.35, 1.0)] {
            let sharp = Array2::from_shape_fn(SIZE, |(_, x)| match x {
                x if in_stripe(x) => stripe,
                50.. => end,
                _ => 0.2,
            });
            let mut wrong = Array2::from_shape_fn(SIZE, |(_, x)| if in_stripe(x) { 2.0 } else { 9.0 });
            wrong[(20, 22)] = 9.0;
            let found = mend(&wrong, &sharp, &Array2::from_elem(SIZE, 0.3));
            // The mean of a bin is rounded.
            assert!((found[(20, 22)] - 2.0).abs() < 1e-4, "{stripe}: {}", found[(20, 22)]);
        }
    }

    #[test]
    fn the_window_is_round_and_its_weight_is_that_of_the_distance() {
        // Every second pixel within 15 px, every pixel within 6 px.
        for (reach_px, count, stride, weight) in [(6.0_f32, 177, 2, 0.945_96), (2.5, 113, 1, 0.923_12)] {
            let offsets = offsets(reach_px);
            assert_eq!(offsets.len(), count);
            let of = |down: isize, across: isize| {
                offsets.iter().find(|o| (o.0, o.1) == (down, across)).map(|o| o.2)
            };
            assert_eq!(of(0, 0), Some(1.0));
            for found in [of(0, stride), of(-stride, 0)] {
                assert!((found.unwrap() - weight).abs() < 1e-4, "{found:?}");
            }
            assert_eq!(of(0, 1).is_some(), stride == 1);
        }
    }

    /// What a wrong place in the middle becomes where every third column has the place 2 and the others 9.
    fn decided(
        sharp: impl Fn(bool) -> f32,
        sharpness: impl Fn(bool) -> f32,
        rise: impl Fn(bool) -> f32,
    ) -> f32 {
        // A reach of 3 px: the window takes every column.
        let map = |of: &dyn Fn(bool) -> f32| Array2::from_shape_fn(SIZE, |(_, x)| of(x % 3 == 0));
        let (mut sharp, sharpness) = (map(&sharp), map(&sharpness));
        // Contrast of the image beyond the window.
        sharp.slice_mut(ndarray::s![.., ..18]).fill(0.1);
        sharp.slice_mut(ndarray::s![.., 42..]).fill(0.9);
        let mut place = map(&|third| if third { 2.0 } else { 9.0 });
        place[(20, 30)] = 0.0; // among the smaller ones, as its column is
        let guide = Guide { sharp: sharp.view(), sharpness: sharpness.view(), reach_px: 3.0, images: 12 };
        mended_whole(&place, map(&rise), &guide)[(20, 30)]
    }

    #[test]
    fn brightness_sharpness_and_rise_weigh_as_documented() {
        // A third of the places wins if each weighs twice as much as another.
        let same = |_: bool| 0.5;
        let either = |third: f32, other: f32| move |is: bool| if is { third } else { other };
        // By brightness at exp(-d^2 / 2) = 1/2, d = 1.18 times a quarter of the image's standard deviation, 0.31.
        assert_eq!(decided(either(0.5, 0.5 + 0.085), same, same).round(), 9.0);
        assert_eq!(decided(either(0.5, 0.5 + 0.097), same, same).round(), 2.0);
        // By sharpness s relative to the median: 0.2 / (s + 0.2) is twice 0.2 / 1.2 at s = 0.4.
        assert_eq!(decided(same, either(0.43, 1.0), same).round(), 9.0);
        assert_eq!(decided(same, either(0.37, 1.0), same).round(), 2.0);
        assert_eq!(decided(same, same, either(0.5, 0.26)).round(), 9.0);
        assert_eq!(decided(same, same, either(0.5, 0.24)).round(), 2.0);
    }
}
