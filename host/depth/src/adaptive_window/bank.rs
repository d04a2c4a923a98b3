//! Filters before the windows: the residual's four parts and the matched filter.

use std::sync::{Mutex, PoisonError};

use super::whitened::Whitened;
use crate::kernel::Kernel;
use crate::operators::DesignError;
use crate::optics::Optics;
use crate::simd::{self, Backend, MAX_ROWS, OfNoise, Plane, Taps};

/// Least part of the energy that counts as evidence.
const LEAST_EVIDENCE: f32 = 0.02;

/// The last design: a stream or series of pairs has one lens, and a design takes as long as a map of 640x480.
static LAST: Mutex<Option<(Optics, Whitened)>> = Mutex::new(None);

/// The filters of one lens.
#[derive(Debug, Clone)]
pub struct Bank(Whitened);

impl Bank {
    /// The bank with a white residual. Returns [`DesignError`] for a PSF that allows none.
    pub fn whitened(optics: &Optics) -> Result<Self, DesignError> {
        let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, filters)) = last.as_ref().filter(|(of, _)| of == optics) {
            return Ok(Self(filters.clone()));
        }
        let filters = Whitened::design(optics)?;
        *last = Some((*optics, filters.clone()));
        Ok(Self(filters))
    }

    pub(crate) fn reach_px(&self) -> usize {
        super::whitened::SIZE / 2
    }

    /// Variance of `alpha` for noise of unit variance, in energies / slope^2: a polynomial in alpha^2.
    pub(super) fn variance_gain(&self) -> [f32; 4] {
        self.0.variance_gain
    }

    /// What noise of unit variance adds to a pixel's products. R1, R3 and U0 act on the sum of the images, so their products
    /// have a mean; without its removal noise would draw depth to alpha = 0. `white` is the part of the noise that these
    /// products are known of. The least slope is half of the expected one.
    pub(super) fn of_noise(&self, white: f32) -> OfNoise {
        let Whitened { residual: [_, r1, _, r3], matched, slope_in_energy, .. } = &self.0;
        let [c1, c3, energy] = [r1, r3, matched].map(|kernel| 2.0 * product(kernel, matched) as f32);
        let least_slope = 0.5 * *slope_in_energy as f32;
        let [c1, c3] = [c1, c3].map(|of_white| white * of_white);
        OfNoise { c1, c3, energy, least_evidence: LEAST_EVIDENCE, least_slope }
    }

    /// Mean square of the residual at `alpha` for noise of unit variance: a polynomial in alpha^2. The design aims at
    /// A^2 + B^2 = 1; the difference is below 10 % over the range.
    pub(super) fn residual_gain(&self) -> [f32; 4] {
        let energy = |a: &Kernel, b: &Kernel| 2.0 * product(a, b) as f32;
        let [r0, r1, r2, r3] = &self.0.residual;
        [
            energy(r0, r0),
            energy(r1, r1) + 2.0 * energy(r0, r2),
            energy(r2, r2) + 2.0 * energy(r1, r3),
            energy(r3, r3),
        ]
    }
}

/// Working filters for rows that arrive in blocks; c0 to c3 are window sums of `rho[k] u`.
pub(super) struct Filters {
    /// R0 to R3 and U0, with their unfinished rows.
    taps: [Taps; 5],
    planes: [Plane; 5],
}

impl Filters {
    pub(super) fn new(Bank(filters): &Bank, ring: usize, width: usize) -> Self {
        let [r0, r1, r2, r3] = &filters.residual;
        Self {
            taps: [r0, r1, r2, r3, &filters.matched].map(|kernel| Taps::new(kernel, width)),
            planes: [(); 5].map(|()| Plane::new(ring, width)),
        }
    }

    pub(super) fn reset(&mut self) {
        self.taps.iter_mut().for_each(Taps::reset);
    }

    /// Filters `count` rows of the pair's difference and sum from row `first` on, shifted by [`Bank::reach_px`].
    pub(super) fn feed(
        &mut self,
        backend: Backend,
        [difference, sum]: [&Plane; 2],
        first: usize,
        count: usize,
        columns: usize,
    ) {
        let inputs = [difference, sum, difference, sum, sum];
        for ((taps, input), to) in self.taps.iter_mut().zip(inputs).zip(&mut self.planes) {
            let rows: [&[f32]; MAX_ROWS] =
                std::array::from_fn(|y| if y < count { input.row(first + y) } else { &[] });
            let stride = to.stride();
            let mut output: [&mut [f32]; MAX_ROWS] = Default::default();
            let planes = to.all_mut()[first * stride..].chunks_exact_mut(stride);
            output[..count].iter_mut().zip(planes).for_each(|(to, row)| *to = row);
            let width = columns + 1 - taps.size();
            simd::convolve_rows(backend, taps, &rows[..count], &mut output[..count], width);
        }
    }

    pub(super) fn rho(&self) -> [&Plane; 4] {
        let [r0, r1, r2, r3, _] = &self.planes;
        [r0, r1, r2, r3]
    }

    pub(super) fn matched_mut(&mut self) -> &mut Plane {
        &mut self.planes[4]
    }

    pub(super) fn matched(&self) -> &Plane {
        &self.planes[4]
    }
}

fn product(a: &Kernel, b: &Kernel) -> f64 {
    a.to_array().iter().zip(&b.to_array()).map(|(a, b)| a * b).sum()
}
