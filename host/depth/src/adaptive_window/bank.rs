//! The filters in front of the windows: the residual's four parts and the matched filter, for either kind of operators.

use ndarray::{Array2, ArrayView2};

use super::whitened::Whitened;
use crate::depth_of_alpha::DepthOfAlpha;
use crate::filter::convolve;
use crate::kernel::Kernel;
use crate::operators::{DesignError, Operators, linearise};
use crate::optics::Optics;
use crate::simd::Backend;

/// A set of filters.
#[derive(Debug, Clone)]
pub enum Bank {
    /// White residual.
    Whitened(Box<Whitened>),
    /// Rational operators behind their pre-filter.
    Rational(Box<Operators>),
}

/// What the filters make of a part of a pair: c0 to c3 are window sums of `rho[k] u`.
pub(super) struct Filtered {
    pub rho: [Option<Array2<f32>>; 4],
    pub matched: Array2<f32>,
}

impl Bank {
    /// The filters with a white residual for some optics.
    ///
    /// # Errors
    /// [`DesignError`] for a point spread function that gives none.
    pub fn whitened(optics: &Optics) -> Result<Self, DesignError> {
        Ok(Self::Whitened(Box::new(Whitened::design(optics)?)))
    }

    /// Rational operators as they are.
    pub fn rational(operators: &Operators) -> Self {
        Self::Rational(Box::new(operators.clone()))
    }

    /// How far a filtered pixel sees.
    pub(crate) fn reach_px(&self) -> usize {
        match self {
            Self::Whitened(_) => super::whitened::SIZE / 2,
            Self::Rational(operators) => 2 * (operators.kernel_size() / 2),
        }
    }

    /// Least c1 in energies of the matched filter: half of what it is expected to be.
    pub(super) fn least_slope(&self) -> f32 {
        match self {
            Self::Whitened(filters) => 0.5 * filters.slope_in_energy as f32,
            Self::Rational(_) => 0.5,
        }
    }

    /// Variance of `alpha` for noise of unit variance, in units of (residual's gain x energy / slope^2): what correlations between
    /// neighbouring pixels make of it, as measured over planes at 8 bit.
    pub(super) fn variance_factor(&self) -> f32 {
        match self {
            Self::Whitened(_) => 1.15,
            // Relative to the gain at alpha = 0.
            Self::Rational(_) => 1.2 / self.residual_gain()[0],
        }
    }

    /// The same as windows are weighed against each other.
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
            // A^2 + B^2 = 1 is what they are designed for; the difference is below 10 % over the range.
            Self::Whitened(filters) => {
                let energy = |a: &Kernel, b: &Kernel| 2.0 * product(a, b) as f32;
                let [r0, r1, r2, r3] = &filters.residual;
                // Odd powers of alpha cancel between the images.
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

    /// Alpha to depth.
    pub(super) fn depth_of(&self, optics: &Optics) -> DepthOfAlpha {
        match self {
            Self::Whitened(_) => DepthOfAlpha::linear(optics, linearise::IDENTITY),
            Self::Rational(operators) => DepthOfAlpha::new(operators, optics),
        }
    }

    /// Filters the far image's and the near image's part; both hold what they have beyond their mean.
    pub(super) fn filter(&self, far: ArrayView2<f32>, near: ArrayView2<f32>, backend: Backend) -> Filtered {
        let by = |image: &Array2<f32>, kernel: &Kernel| {
            let mut output = Array2::zeros(image.dim());
            convolve(image.view(), kernel, backend, output.view_mut());
            output
        };
        let [difference, sum] = [&far - &near, &far + &near];
        match self {
            Self::Whitened(filters) => {
                let [r0, r1, r2, r3] = &filters.residual;
                let rho = [(&difference, r0), (&sum, r1), (&difference, r2), (&sum, r3)];
                Filtered {
                    rho: rho.map(|(image, kernel)| Some(by(image, kernel))),
                    matched: by(&sum, &filters.matched),
                }
            }
            Self::Rational(operators) => {
                let [difference, sum] = [difference, sum].map(|image| by(&image, operators.prefilter()));
                let p1 = by(&sum, operators.gp1());
                Filtered {
                    rho: [
                        Some(by(&difference, operators.gm1())),
                        Some(p1.clone()),
                        None,
                        Some(by(&sum, operators.gp2())),
                    ],
                    matched: p1,
                }
            }
        }
    }
}

/// Sum of the products of two kernels' taps.
fn product(a: &Kernel, b: &Kernel) -> f64 {
    a.to_array().iter().zip(&b.to_array()).map(|(a, b)| a * b).sum()
}

/// The same behind a pre-filter.
fn filtered_product(filter: &Kernel, a: &Kernel, b: &Kernel) -> f64 {
    let r = (filter.size() + a.size()) as isize / 2;
    let at = |kernel: &Kernel, y: isize, x: isize| -> f64 {
        let h = (filter.size() / 2) as isize;
        let taps = (-h..=h).flat_map(|dy| (-h..=h).map(move |dx| (dy, dx)));
        taps.map(|(dy, dx)| filter.at(dx, dy) * kernel.at(x - dx, y - dy)).sum()
    };
    (-r..=r).flat_map(|y| (-r..=r).map(move |x| (y, x))).map(|(y, x)| at(a, y, x) * at(b, y, x)).sum()
}
