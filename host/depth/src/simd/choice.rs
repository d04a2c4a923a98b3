//! Choice of window, row by row.

use super::dispatch;
use super::lanes::Lanes;
use super::windows::polynomial;

dispatch! {
    /// Takes a larger window's value where the present one is less certain than required.
    fn choose_certain(alpha: &[f32], variance: &[f32], noise: &[f32], largest: f32, chosen: &mut [f32], of_chosen: &mut [f32]) =
        choose_certain_generic
}

#[inline(always)]
fn choose_certain_generic<L: Lanes>(
    alpha: &[f32],
    variance: &[f32],
    noise: &[f32],
    largest: f32,
    chosen: &mut [f32],
    of_chosen: &mut [f32],
) {
    let width = chosen.len();
    let (alpha, variance, noise) = (&alpha[..width], &variance[..width], &noise[..width]);
    let of_chosen = &mut of_chosen[..width];
    for x in 0..width {
        let certain = of_chosen[x] * noise[x] <= largest;
        chosen[x] = if certain { chosen[x] } else { alpha[x] };
        of_chosen[x] = if certain { of_chosen[x] } else { variance[x] };
    }
}

/// How two windows are compared.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contrast {
    /// Variance of alpha relative to the window's own, a polynomial in alpha^2.
    pub gain: [f32; 4],
    /// Variance of alpha within which windows may differ by the model's error, whose own is [`OF_MODEL`] of it.
    pub tolerance: f32,
    /// Variance of alpha from which a window tells nothing.
    pub largest: f32,
    /// Part of the difference's excess over noise by which the larger window's variance grows.
    pub doubt: f32,
}

/// Largest counted squared difference, relative to the variance.
const LARGEST_CONTRAST: f32 = 100.0;
/// Mean square difference of two windows, relative to the smaller one's variance, from which the surface is not flat
/// over the larger one. On planes 99 % are below 1.9.
const NOT_FLAT: f32 = 2.0;
/// The same mean square of a flat surface: 75 % are below.
const FLAT: f32 = 1.05;
/// Variance of the model's error in the smaller window, relative to the tolerance; rare large errors make it more than what the
/// tolerance was taken from. Chosen on a metal plate and a lens with spherical aberration, for honest deviations of planes and waves.
const OF_MODEL: f32 = 0.6;
/// Largest growth of the smaller one's variance: a certain depth next to a large step remains certain.
const LARGEST_GROWTH: f32 = 9.0;

dispatch! {
    /// Compares windows: `to` gets alpha and variance of the smaller one (of the larger one where it tells nothing), the squared
    /// difference relative to this variance, 1 where it tells something, and there alpha of the larger one.
    fn contrast_row(of: Contrast, small: [&[f32]; 2], large: [&[f32]; 2], to: [&mut [f32]; 5]) = contrast_generic
}

#[inline(always)]
fn contrast_generic<L: Lanes>(of: Contrast, small: [&[f32]; 2], large: [&[f32]; 2], to: [&mut [f32]; 5]) {
    let [alpha, variance, difference, counted, larger] = to;
    let width = alpha.len();
    let ([small, of_small], [large, of_large]) = (small.map(|s| &s[..width]), large.map(|s| &s[..width]));
    let [variance, difference, counted, larger] =
        [variance, difference, counted, larger].map(|row| &mut row[..width]);
    for x in 0..width {
        let a = small[x];
        let factor = polynomial(of.gain, a * a);
        let own = factor * of_small[x] + OF_MODEL * of.tolerance;
        let total = own + (1.0 - OF_MODEL) * of.tolerance;
        let tells = total <= of.largest;
        let apart = a - large[x];
        let square = (apart * apart / total).min(LARGEST_CONTRAST);
        alpha[x] = if tells { a } else { large[x] };
        variance[x] = if tells { own / factor } else { of_large[x] };
        difference[x] = if tells { square } else { 0.0 };
        counted[x] = if tells { 1.0 } else { 0.0 };
        larger[x] = if tells { large[x] } else { 0.0 };
    }
}

dispatch! {
    /// Alpha and variance of the larger window where the surface is flat, else of the smaller one. `sums` are of
    /// [`contrast_row`]'s differences and counts.
    fn decide_row(of: Contrast, sums: [&[f32]; 3], small: [&[f32]; 2], large: [&[f32]; 2], to: [&mut [f32]; 2]) = decide_generic
}

#[inline(always)]
fn decide_generic<L: Lanes>(
    of: Contrast,
    sums: [&[f32]; 3],
    small: [&[f32]; 2],
    large: [&[f32]; 2],
    to: [&mut [f32]; 2],
) {
    let [alpha, variance] = to;
    let width = alpha.len();
    let variance = &mut variance[..width];
    // By closures the compiler would lose the lengths, and with them the vectors.
    let (differences, counts, larger) = (&sums[0][..width], &sums[1][..width], &sums[2][..width]);
    let (small, of_small) = (&small[0][..width], &small[1][..width]);
    let (large, of_large) = (&large[0][..width], &large[1][..width]);
    for x in 0..width {
        let count = counts[x].max(1.0);
        let mean = differences[x] / count;
        // A division in the branch would keep the loop from being vectorised.
        let mean_larger = larger[x] / count;
        let curved = if counts[x] > 0.0 { large[x] - mean_larger } else { 0.0 };
        let flat = mean <= NOT_FLAT;
        let factor = polynomial(of.gain, large[x] * large[x]);
        // The smaller one's variance lacks the rest of the tolerance, which the differences are relative to.
        let tolerated = (1.0 - OF_MODEL) * of.tolerance / factor;
        // An infinite variance times 0 is NaN.
        let apart = (of_small[x].min(f32::MAX) * (mean - FLAT) + mean * tolerated).max(0.0);
        let curved = (curved * curved / factor - of_large[x]).max(0.0);
        // On an evenly curved surface the larger window is off by its difference from its own mean over the window.
        let widened = of_large[x] + of.doubt * apart + curved;
        let grown = of_small[x] * mean.min(LARGEST_GROWTH);
        alpha[x] = if flat { large[x] } else { small[x] };
        variance[x] = if flat { widened } else { grown };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    /// A plane, and a step of 0.2 in the middle, seen by windows with a variance of 1e-3 and 1e-4.
    #[test]
    fn the_larger_window_counts_where_the_surface_is_flat() {
        let of = Contrast { gain: [1.0, 0.0, 0.0, 0.0], tolerance: 0.0, largest: 2e-3, doubt: 0.5 };
        for backend in Backend::available() {
            let small = [[0.13, 0.30, 0.3], [1e-3, 1e-3, f32::NAN]];
            let large = [[0.11, 0.20, 0.2], [1e-4; 3]];
            let mut to = [[0.0; 3]; 5];
            let [small, large] = [&small, &large].map(|rows| rows.each_ref().map(|row| &row[..]));
            contrast_row(backend, of, small, large, to.each_mut().map(|row| &mut row[..]));
            let [alpha, variance, difference, counted, larger] = to;
            assert_eq!((alpha, counted), ([0.13, 0.30, 0.2], [1.0, 1.0, 0.0]));
            assert!((difference[0] - 0.4).abs() < 1e-4 && (difference[1] - 10.0).abs() < 1e-3);
            let (mut chosen, mut of_chosen) = ([0.0; 3], [0.0; 3]);
            let small = [&alpha[..], &variance];
            decide_row(
                backend,
                of,
                [&difference, &counted, &larger],
                small,
                large,
                [&mut chosen, &mut of_chosen],
            );
            assert_eq!(chosen, [0.11, 0.30, 0.2]);
            assert!((of_chosen[1] - 9e-3).abs() < 1e-6 && of_chosen[0] == 1e-4 && of_chosen[2] == 1e-4);
            // A crest, 0.05 from the mean over the window.
            let crest = [&difference[..1], &[1.0], &[0.06]];
            let [small, large] = [small, large].map(|rows| rows.map(|row| &row[..1]));
            decide_row(backend, of, crest, small, large, [&mut chosen[..1], &mut of_chosen[..1]]);
            assert!(chosen[0] == 0.11 && (of_chosen[0] - 2.5e-3).abs() < 1e-6, "{of_chosen:?}");
        }
    }
}
