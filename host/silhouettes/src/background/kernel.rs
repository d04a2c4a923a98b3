//! Mixture update of one frame with the processor's vectors (selected at run time by `pulp`; one pixel at a
//! time without AVX2 or NEON).
//!
//! The recursive equations of Zivkovic 2004 (equations 4 to 6 with the prior of 14) and Zivkovic and van der
//! Heijden 2006 (equations 4 to 9), for isotropic components; o is 1 for the component that owns the sample:
//! ```text
//! weight   += rate (o - weight) - rate c_T       discarded at 0, then normalised to sum 1
//! mean     += o (rate / weight) (x - mean)
//! variance += o (rate / weight) (|x - mean|^2 - variance)
//! ```
//! The owner is the heaviest component within `COMPONENT_THRESHOLD`. One pass of neighbour exchanges keeps
//! components sorted by weight, because at most one has grown. A tile of a component holds weight, variance
//! and channel means of [`TILE`] pixels; unused components are never touched. About 10 floating-point
//! operations and one division per pixel, component in use and channel.

use std::array::from_fn;

use pulp::{Simd, WithSimd};

use super::model::Settings;

/// Most components of a pixel.
pub const COMPONENTS: usize = 5;
// The papers' values (three and four standard deviations) and common variances, squared grey levels.
/// Squared Mahalanobis distance of background.
const BACKGROUND_THRESHOLD: f32 = 16.0;
/// Squared Mahalanobis distance of a component; beyond it a new one is created.
const COMPONENT_THRESHOLD: f32 = 9.0;
/// Share of the data explained by background components, 1 - c_f (2006, equation 9).
const BACKGROUND_SHARE: f32 = 0.9;
/// Weight removed from every component by the Dirichlet prior, c_T (2004, equation 14).
const COMPLEXITY_PRIOR: f32 = 0.05;
pub const INITIAL_VARIANCE: f32 = 15.0;
const MIN_VARIANCE: f32 = 4.0;
const MAX_VARIANCE: f32 = 75.0;

/// Pixels per tile: the widest f32 vector (AVX-512).
pub const TILE: usize = 16;

const WEIGHT: usize = 0;
const VARIANCE: usize = 1;
const MEAN: usize = 2;

pub const BACKGROUND: u8 = 0;
pub const SHADOW: u8 = 1;
pub const FOREGROUND: u8 = 2;

pub const fn component_len(channels: usize) -> usize {
    (MEAN + channels) * TILE
}

pub const VARIANCE_OFFSET: usize = VARIANCE * TILE;

/// Offset of a channel's means within a component.
pub const fn mean_offset(channel: usize) -> usize {
    (MEAN + channel) * TILE
}

pub const fn state_len(tiles: usize, channels: usize) -> usize {
    tiles * COMPONENTS * component_len(channels)
}

pub struct Update<'a, const CHANNELS: usize> {
    pub settings: &'a Settings,
    /// Learning rate of this frame, 0 to 1.
    pub rate: f32,
    pub state: &'a mut [f32],
    pub used: &'a mut [u8],
    pub pixels: &'a [u8],
    pub labels: &'a mut [u8],
    /// Tiles that are labelled and learn nothing; may be empty.
    pub held: &'a [bool],
}

impl<const CHANNELS: usize> WithSimd for Update<'_, CHANNELS> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let tiles = self.used.len();
        let stride = tiles * component_len(CHANNELS);
        let learning = Constants::new(simd, self.settings, self.rate);
        let still = Constants::new(simd, self.settings, 0.0);
        let tile_pixels = self.pixels.chunks(TILE * CHANNELS).zip(self.labels.chunks_mut(TILE));
        for (tile, (pixels, labels)) in tile_pixels.enumerate() {
            let constants = if self.held.get(tile) == Some(&true) { &still } else { &learning };
            let samples = planes::<CHANNELS>(pixels);
            let mut codes = [0.0_f32; TILE];
            let first = tile * component_len(CHANNELS);
            let mut tile_used = 0;
            for part in 0..TILE / S::F32_LANES {
                let lanes = part * S::F32_LANES;
                let mut mixture =
                    Mixture::<S, CHANNELS> { simd, state: &mut *self.state, first: first + lanes, stride };
                let x = from_fn(|channel| load(simd, &samples[channel][lanes..]));
                let (used, code) = mixture.observe(constants, usize::from(self.used[tile]), x);
                store(simd, &mut codes[lanes..], code);
                tile_used = tile_used.max(used);
            }
            self.used[tile] = tile_used as u8;
            for (label, code) in labels.iter_mut().zip(codes) {
                *label = code as u8;
            }
        }
    }
}

/// Splits up to [`TILE`] interleaved pixels into planes; missing pixels repeat the first.
#[inline(always)]
fn planes<const CHANNELS: usize>(pixels: &[u8]) -> [[f32; TILE]; CHANNELS] {
    let mut out = [[0.0; TILE]; CHANNELS];
    let whole = pixels.len() / CHANNELS;
    for (channel, plane) in out.iter_mut().enumerate() {
        for (i, sample) in plane.iter_mut().enumerate() {
            // The first test is constant for full tiles and moves out of the loop.
            let from = if whole == TILE || i < whole { i } else { 0 };
            *sample = f32::from(pixels[from * CHANNELS + channel]);
        }
    }
    out
}

#[inline(always)]
fn load<S: Simd>(_: S, values: &[f32]) -> S::f32s {
    S::as_simd_f32s(values).0[0]
}

#[inline(always)]
fn store<S: Simd>(_: S, values: &mut [f32], value: S::f32s) {
    S::as_mut_simd_f32s(values).0[0] = value;
}

#[inline(always)]
fn any<S: Simd>(simd: S, mask: S::m32s) -> bool {
    simd.first_true_m32s(mask) < S::F32_LANES
}

struct Constants<S: Simd> {
    rate: S::f32s,
    keep: S::f32s,
    prior: S::f32s,
    background_threshold: S::f32s,
    component_threshold: S::f32s,
    background_share: S::f32s,
    initial_variance: S::f32s,
    min_variance: S::f32s,
    max_variance: S::f32s,
    darkest: Option<S::f32s>,
    zero: S::f32s,
    one: S::f32s,
}

impl<S: Simd> Constants<S> {
    #[inline(always)]
    fn new(simd: S, settings: &Settings, rate: f32) -> Self {
        let splat = |value| simd.splat_f32s(value);
        Self {
            rate: splat(rate),
            keep: splat(1.0 - rate),
            prior: splat(rate * COMPLEXITY_PRIOR),
            background_threshold: splat(BACKGROUND_THRESHOLD),
            component_threshold: splat(COMPONENT_THRESHOLD),
            background_share: splat(BACKGROUND_SHARE),
            initial_variance: splat(INITIAL_VARIANCE),
            min_variance: splat(MIN_VARIANCE),
            max_variance: splat(MAX_VARIANCE),
            darkest: settings.shadow.map(splat),
            zero: splat(0.0),
            one: splat(1.0),
        }
    }
}

struct Mixture<'a, S: Simd, const CHANNELS: usize> {
    simd: S,
    state: &'a mut [f32],
    first: usize,
    stride: usize,
}

impl<S: Simd, const CHANNELS: usize> Mixture<'_, S, CHANNELS> {
    #[inline(always)]
    fn get(&self, component: usize, field: usize) -> S::f32s {
        load(self.simd, &self.state[self.first + component * self.stride + field * TILE..])
    }

    #[inline(always)]
    fn set(&mut self, component: usize, field: usize, value: S::f32s) {
        store(self.simd, &mut self.state[self.first + component * self.stride + field * TILE..], value);
    }

    #[inline(always)]
    fn means(&self, component: usize) -> [S::f32s; CHANNELS] {
        from_fn(|channel| self.get(component, MEAN + channel))
    }

    /// Adds one sample per pixel; returns the components in use and each pixel's label code.
    #[inline(always)]
    fn observe(&mut self, c: &Constants<S>, used: usize, x: [S::f32s; CHANNELS]) -> (usize, S::f32s) {
        let simd = self.simd;
        let mut total = c.zero;
        let mut owned = simd.less_than_f32s(c.one, c.zero);
        let mut background = owned;
        for component in 0..used {
            let weight = self.get(component, WEIGHT);
            let variance = self.get(component, VARIANCE);
            let mean = self.means(component);
            let offset: [S::f32s; CHANNELS] = from_fn(|i| simd.sub_f32s(x[i], mean[i]));
            let distance = squared_norm(simd, c.zero, offset);

            let candidate = simd.and_m32s(simd.not_m32s(owned), simd.greater_than_f32s(weight, c.zero));
            let common = simd.less_than_f32s(total, c.background_share);
            let within = |threshold| simd.less_than_f32s(distance, simd.mul_f32s(threshold, variance));
            let explains = simd.and_m32s(common, within(c.background_threshold));
            background = simd.or_m32s(background, simd.and_m32s(candidate, explains));
            let owner = simd.and_m32s(candidate, within(c.component_threshold));

            let reward = simd.sub_f32s(simd.select_f32s(owner, c.rate, c.zero), c.prior);
            let weight = simd.max_f32s(simd.mul_add_f32s(weight, c.keep, reward), c.zero);
            // A pixel without this component must not gain one; a single young component weighs less than the
            // rate.
            let step = simd.min_f32s(simd.div_f32s(c.rate, simd.max_f32s(weight, c.rate)), c.one);
            let step = simd.select_f32s(owner, step, c.zero);
            for i in 0..CHANNELS {
                self.set(component, MEAN + i, simd.mul_add_f32s(step, offset[i], mean[i]));
            }
            let spread = simd.mul_add_f32s(step, simd.sub_f32s(distance, variance), variance);
            let spread = simd.min_f32s(simd.max_f32s(spread, c.min_variance), c.max_variance);
            self.set(component, VARIANCE, simd.select_f32s(owner, spread, variance));
            self.set(component, WEIGHT, weight);
            total = simd.add_f32s(total, weight);
            owned = simd.or_m32s(owned, owner);
        }
        let orphan = simd.not_m32s(owned);
        let mut used = used;
        if any(simd, orphan) {
            (used, total) = self.found(c, used, orphan, total, x);
        }
        self.normalise_and_sort(c, used, total);
        while used > 1 && !any(simd, simd.greater_than_f32s(self.get(used - 1, WEIGHT), c.zero)) {
            used -= 1;
        }

        let mut code = simd.splat_f32s(f32::from(BACKGROUND));
        let foreground = simd.not_m32s(background);
        if any(simd, foreground) {
            code = simd.select_f32s(foreground, simd.splat_f32s(f32::from(FOREGROUND)), code);
            if let Some(darkest) = c.darkest {
                let shadow = simd.and_m32s(foreground, self.shadow(c, darkest, used, x));
                code = simd.select_f32s(shadow, simd.splat_f32s(f32::from(SHADOW)), code);
            }
        }
        (used, code)
    }

    /// Creates a component for each orphan sample, in the first empty place or instead of the lightest.
    #[inline(always)]
    fn found(
        &mut self,
        c: &Constants<S>,
        used: usize,
        orphan: S::m32s,
        total: S::f32s,
        x: [S::f32s; CHANNELS],
    ) -> (usize, S::f32s) {
        let simd = self.simd;
        let places = (used + 1).min(COMPONENTS);
        let mut homeless = orphan;
        let mut total = total;
        for component in 0..places {
            let weight = self.get(component, WEIGHT);
            let empty = simd.less_than_or_equal_f32s(weight, c.zero);
            let here = if component + 1 == COMPONENTS { homeless } else { simd.and_m32s(homeless, empty) };
            if !any(simd, here) {
                continue;
            }
            // At rate 0 a first component must still exist, hence the tiny floor.
            let young = simd.max_f32s(c.rate, simd.splat_f32s(f32::MIN_POSITIVE));
            let gain = simd.select_f32s(here, simd.sub_f32s(young, weight), c.zero);
            total = simd.add_f32s(total, gain);
            self.set(component, WEIGHT, simd.select_f32s(here, young, weight));
            let variance = self.get(component, VARIANCE);
            self.set(component, VARIANCE, simd.select_f32s(here, c.initial_variance, variance));
            let mean = self.means(component);
            for i in 0..CHANNELS {
                self.set(component, MEAN + i, simd.select_f32s(here, x[i], mean[i]));
            }
            homeless = simd.and_m32s(homeless, simd.not_m32s(here));
        }
        (places, total)
    }

    #[inline(always)]
    fn normalise_and_sort(&mut self, c: &Constants<S>, used: usize, total: S::f32s) {
        let simd = self.simd;
        let scale = simd.div_f32s(c.one, total);
        for component in 0..used {
            let weight = self.get(component, WEIGHT);
            self.set(component, WEIGHT, simd.mul_f32s(weight, scale));
        }
        for lower in (1..used).rev() {
            let upper = lower - 1;
            let exchange = simd.greater_than_f32s(self.get(lower, WEIGHT), self.get(upper, WEIGHT));
            if !any(simd, exchange) {
                continue;
            }
            for field in 0..MEAN + CHANNELS {
                let (above, below) = (self.get(upper, field), self.get(lower, field));
                self.set(upper, field, simd.select_f32s(exchange, below, above));
                self.set(lower, field, simd.select_f32s(exchange, above, below));
            }
        }
    }

    /// Darker copies of a background component: projection a on the mean's line within darkest <= a <= 1, rest
    /// `|a mean - x|^2` within BACKGROUND_THRESHOLD a^2 variance ("statistical non-parametric": Prati, PAMI 25, 2003).
    #[inline(always)]
    fn shadow(&self, c: &Constants<S>, darkest: S::f32s, used: usize, x: [S::f32s; CHANNELS]) -> S::m32s {
        let simd = self.simd;
        let mut total = c.zero;
        let mut found = simd.less_than_f32s(c.one, c.zero);
        for component in 0..used {
            let weight = self.get(component, WEIGHT);
            let mean = self.means(component);
            let common = simd.and_m32s(
                simd.less_than_or_equal_f32s(total, c.background_share),
                simd.greater_than_f32s(weight, c.zero),
            );
            let mut along = c.zero;
            for i in 0..CHANNELS {
                along = simd.mul_add_f32s(x[i], mean[i], along);
            }
            let length = squared_norm(simd, c.zero, mean);
            let ratio = simd.div_f32s(along, length);
            let rest: [S::f32s; CHANNELS] = from_fn(|i| simd.sub_f32s(simd.mul_f32s(ratio, mean[i]), x[i]));
            let limit = simd.mul_f32s(simd.mul_f32s(ratio, ratio), self.get(component, VARIANCE));
            let limit = simd.mul_f32s(limit, c.background_threshold);
            let darker = simd.and_m32s(
                simd.less_than_or_equal_f32s(along, length),
                simd.greater_than_or_equal_f32s(along, simd.mul_f32s(darkest, length)),
            );
            // A black mean gives NaN, which fails all comparisons.
            let same_colour = simd.less_than_f32s(squared_norm(simd, c.zero, rest), limit);
            found = simd.or_m32s(found, simd.and_m32s(common, simd.and_m32s(darker, same_colour)));
            total = simd.add_f32s(total, weight);
        }
        found
    }
}

#[inline(always)]
fn squared_norm<S: Simd, const CHANNELS: usize>(
    simd: S,
    zero: S::f32s,
    values: [S::f32s; CHANNELS],
) -> S::f32s {
    let mut sum = zero;
    for value in values {
        sum = simd.mul_add_f32s(value, value, sum);
    }
    sum
}
