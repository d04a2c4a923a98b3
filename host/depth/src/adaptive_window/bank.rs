//! Filters before the windows: the residual's four parts and the matched filter, for either kind of operators.

use std::sync::{Mutex, PoisonError};

use super::whitened::Whitened;
use crate::depth_of_alpha::DepthOfAlpha;
use crate::kernel::Kernel;
use crate::operators::{DesignError, Operators, linearise};
use crate::optics::Optics;
use crate::simd::{self, Backend, MAX_ROWS, Plane, Taps};

/// The last design: a stream or series of pairs has one lens, and a design takes as long as a map of 640x480.
static LAST: Mutex<Option<(Optics, Whitened)>> = Mutex::new(None);

/// Filter bank.
#[derive(Debug, Clone)]
pub enum Bank {
    /// White residual.
    Whitened(Box<Whitened>),
    /// Rational operators behind their pre-filter.
    Rational(Box<Operators>),
}

impl Bank {
    /// The bank with a white residual. Returns [`DesignError`] for a PSF that allows none.
    pub fn whitened(optics: &Optics) -> Result<Self, DesignError> {
        let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, filters)) = last.as_ref().filter(|(of, _)| of == optics) {
            return Ok(Self::Whitened(Box::new(filters.clone())));
        }
        let filters = Whitened::design(optics)?;
        *last = Some((*optics, filters.clone()));
        Ok(Self::Whitened(Box::new(filters)))
    }

    /// The bank of rational operators.
    pub fn rational(operators: &Operators) -> Self {
        Self::Rational(Box::new(operators.clone()))
    }

    pub(crate) fn reach_px(&self) -> usize {
        match self {
            Self::Whitened(_) => super::whitened::SIZE / 2,
            Self::Rational(operators) => 2 * (operators.kernel_size() / 2),
        }
    }

    /// Least c1 in energies of the matched filter: half of the expected value.
    pub(super) fn least_slope(&self) -> f32 {
        match self {
            Self::Whitened(filters) => 0.5 * filters.slope_in_energy as f32,
            Self::Rational(_) => 0.5,
        }
    }

    /// Variance of `alpha` for noise of unit variance, in energies / slope^2: a polynomial in alpha^2. It is the residual's
    /// noise where the texture has its energy, because neighbouring residuals correlate.
    pub(super) fn variance_gain(&self) -> [f32; 4] {
        match self {
            Self::Whitened(filters) => filters.variance_gain,
            Self::Rational(_) => {
                // Measured at 8 bit on planes, relative to the gain at alpha = 0.
                let gain = self.residual_gain();
                gain.map(|coefficient| 1.2 * coefficient / gain[0])
            }
        }
    }

    /// As [`Self::variance_gain`], for all depths.
    pub(super) fn weighing_factor(&self) -> f32 {
        match self {
            Self::Whitened(_) => 0.87,
            Self::Rational(_) => 1.2,
        }
    }

    /// Energy of the matched filter's output for noise of unit variance.
    pub(super) fn noise_energy(&self) -> f32 {
        match self {
            Self::Whitened(filters) => 2.0 * product(&filters.matched, &filters.matched) as f32,
            Self::Rational(operators) => {
                let p1 = operators.gp1();
                2.0 * filtered_product(operators.prefilter(), p1, p1) as f32
            }
        }
    }

    /// Mean square of the residual at `alpha` for noise of unit variance.
    pub(super) fn residual_gain(&self) -> [f32; 4] {
        match self {
            // The design aims at A^2 + B^2 = 1; the difference is below 10 % over the range.
            Self::Whitened(filters) => {
                let energy = |a: &Kernel, b: &Kernel| 2.0 * product(a, b) as f32;
                let [r0, r1, r2, r3] = &filters.residual;
                [
                    energy(r0, r0),
                    energy(r1, r1) + 2.0 * energy(r0, r2),
                    energy(r2, r2) + 2.0 * energy(r1, r3),
                    energy(r3, r3),
                ]
            }
            Self::Rational(operators) => {
                let [m, p1, p2] = [operators.gm1(), operators.gp1(), operators.gp2()];
                let energy =
                    |a: &Kernel, b: &Kernel| 2.0 * filtered_product(operators.prefilter(), a, b) as f32;
                [energy(m, m), energy(p1, p1), 2.0 * energy(p1, p2), energy(p2, p2)]
            }
        }
    }

    pub(super) fn depth_of(&self, optics: &Optics) -> DepthOfAlpha {
        match self {
            Self::Whitened(_) => DepthOfAlpha::linear(optics, linearise::IDENTITY),
            Self::Rational(operators) => DepthOfAlpha::new(operators, optics),
        }
    }
}

/// Working filters for rows that arrive in blocks; c0 to c3 are window sums of `rho[k] u`.
pub(super) enum Filters {
    /// R0 to R3 and U0.
    Whitened {
        /// One each, with its unfinished rows.
        taps: Box<[Taps; 5]>,
        rho: Box<[Plane; 5]>,
    },
    /// Pre-filters of difference and sum, then Gm1, Gp1 and Gp2.
    Rational {
        prefilters: Box<[Taps; 2]>,
        filtered: Box<[Plane; 2]>,
        taps: Box<[Taps; 3]>,
        rho: Box<[Plane; 3]>,
    },
}

impl Filters {
    pub(super) fn new(bank: &Bank, ring: usize, width: usize) -> Self {
        let taps = |kernel: &Kernel| Taps::new(kernel, width);
        let plane = || Plane::new(ring, width);
        match bank {
            Bank::Whitened(filters) => {
                let [r0, r1, r2, r3] = &filters.residual;
                Self::Whitened {
                    taps: Box::new([r0, r1, r2, r3, &filters.matched].map(taps)),
                    rho: Box::new([(); 5].map(|()| plane())),
                }
            }
            Bank::Rational(operators) => Self::Rational {
                prefilters: Box::new([operators.prefilter(), operators.prefilter()].map(taps)),
                filtered: Box::new([(); 2].map(|()| Plane::new(MAX_ROWS, width))),
                taps: Box::new([operators.gm1(), operators.gp1(), operators.gp2()].map(taps)),
                rho: Box::new([(); 3].map(|()| plane())),
            },
        }
    }

    pub(super) fn reset(&mut self) {
        match self {
            Self::Whitened { taps, .. } => taps.iter_mut().for_each(Taps::reset),
            Self::Rational { prefilters, taps, .. } => {
                prefilters.iter_mut().chain(taps.iter_mut()).for_each(Taps::reset);
            }
        }
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
        fn rows(plane: &Plane, first: usize, count: usize) -> [&[f32]; MAX_ROWS] {
            std::array::from_fn(|y| if y < count { plane.row(first + y) } else { &[] })
        }
        let filter =
            |taps: &mut Taps, from: [&[f32]; MAX_ROWS], to: &mut Plane, first: usize, left: usize| {
                let stride = to.stride();
                let mut output: [&mut [f32]; MAX_ROWS] = Default::default();
                let planes = to.all_mut()[first * stride..].chunks_exact_mut(stride);
                output[..count].iter_mut().zip(planes).for_each(|(to, row)| *to = row);
                simd::convolve_rows(backend, taps, &from[..count], &mut output[..count], left);
            };
        match self {
            Self::Whitened { taps, rho } => {
                let inputs = [difference, sum, difference, sum, sum];
                for ((taps, input), to) in taps.iter_mut().zip(inputs).zip(rho.iter_mut()) {
                    let left = columns + 1 - taps.size();
                    filter(taps, rows(input, first, count), to, first, left);
                }
            }
            Self::Rational { prefilters, filtered, taps, rho } => {
                for ((taps, input), to) in
                    prefilters.iter_mut().zip([difference, sum]).zip(filtered.iter_mut())
                {
                    let left = columns + 1 - taps.size();
                    filter(taps, rows(input, first, count), to, 0, left);
                }
                let [difference, sum] = &**filtered;
                for ((taps, input), to) in taps.iter_mut().zip([difference, sum, sum]).zip(rho.iter_mut()) {
                    let left = columns + 2 - prefilters[0].size() - taps.size();
                    filter(taps, rows(input, 0, count), to, first, left);
                }
            }
        }
    }

    pub(super) fn rho(&self) -> [Option<&Plane>; 4] {
        match self {
            Self::Whitened { rho, .. } => [Some(&rho[0]), Some(&rho[1]), Some(&rho[2]), Some(&rho[3])],
            Self::Rational { rho, .. } => [Some(&rho[0]), Some(&rho[1]), None, Some(&rho[2])],
        }
    }

    pub(super) fn matched_mut(&mut self) -> &mut Plane {
        match self {
            Self::Whitened { rho, .. } => &mut rho[4],
            Self::Rational { rho, .. } => &mut rho[1],
        }
    }

    pub(super) fn matched(&self) -> &Plane {
        match self {
            Self::Whitened { rho, .. } => &rho[4],
            Self::Rational { rho, .. } => &rho[1],
        }
    }
}

fn product(a: &Kernel, b: &Kernel) -> f64 {
    a.to_array().iter().zip(&b.to_array()).map(|(a, b)| a * b).sum()
}

fn filtered_product(filter: &Kernel, a: &Kernel, b: &Kernel) -> f64 {
    let r = (filter.size() + a.size()) as isize / 2;
    let at = |kernel: &Kernel, y: isize, x: isize| -> f64 {
        let h = (filter.size() / 2) as isize;
        let taps = (-h..=h).flat_map(|dy| (-h..=h).map(move |dx| (dy, dx)));
        taps.map(|(dy, dx)| filter.at(dx, dy) * kernel.at(x - dx, y - dy)).sum()
    };
    (-r..=r).flat_map(|y| (-r..=r).map(move |x| (y, x))).map(|(y, x)| at(a, y, x) * at(b, y, x)).sum()
}
