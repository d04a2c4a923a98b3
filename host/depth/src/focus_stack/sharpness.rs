//! Focus measures of Pertuz, Puig & Garcia (Analysis of focus measure operators for shape-from-focus, Pattern
//! Recognition 46, 2013), with their abbreviations. Each is a value per pixel, from its neighbours, and a mean or a
//! variance over a window around it. Borders are reflected. Cost: 10 to 60 operations a pixel for any window; for the
//! range twice the window's side.

use std::{fmt, str::FromStr};

use ndarray::{Array2, ArrayView2, Zip};

use crate::{border::reflect, prepare::band::box_mean};

/// Standard deviation of the Gaussian whose derivatives are taken, px.
const SIGMA_PX: f64 = 1.0;
/// Directions that steerable filters try.
const DIRECTIONS: usize = 8;
/// Keeps quotients finite where a picture is black, part of full scale.
const DARK: f32 = 1e-3;

macro_rules! measures {
    ($($(#[doc = $about:literal])* $name:ident = $text:literal;)+) => {
        /// A focus measure.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Sharpness {
            $($(#[doc = $about])* $name,)+
        }

        impl Sharpness {
            /// All there are.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// The name in options.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => $text,)+ }
            }
        }
    };
}

measures! {
    /// Sum of the magnitudes of both second differences (LAPM; Nayar & Nakagawa 1994).
    ModifiedLaplacian = "modified-laplacian";
    /// The same with the diagonals (LAPD; Thelen et al. 2009).
    DiagonalLaplacian = "diagonal-laplacian";
    /// Square of the Laplacian (LAPE; Subbarao et al. 1992).
    LaplacianEnergy = "laplacian-energy";
    /// Variance of the Laplacian (LAPV; Pech-Pacheco et al. 2000).
    LaplacianVariance = "laplacian-variance";
    /// Squared Sobel gradient (TENG; Krotkov 1987).
    Tenengrad = "tenengrad";
    /// Variance of the Sobel gradient's magnitude (TENV; Pech-Pacheco et al. 2000).
    TenengradVariance = "tenengrad-variance";
    /// Squared differences to the right and below (GRAE; Subbarao et al. 1992).
    GradientEnergy = "gradient-energy";
    /// Larger of the magnitudes of both differences (GRAT; Santos et al. 1997).
    AbsoluteGradient = "absolute-gradient";
    /// Squared difference to the right (GRAS; Eskicioglu & Fisher 1995).
    SquaredGradient = "squared-gradient";
    /// Squared difference at a distance of two pixels, the larger of both directions (BREN; Brenner et al. 1976).
    Brenner = "brenner";
    /// Squared gradient of the smoothed image (GDER; Geusebroek et al. 2000).
    GaussianDerivative = "gaussian-derivative";
    /// Largest derivative over directions of the smoothed image (SFIL; Minhas et al. 2009).
    Steerable = "steerable";
    /// Root of the mean squared differences of rows and columns (SFRQ; Eskicioglu & Fisher 1995).
    SpatialFrequency = "spatial-frequency";
    /// Variance of the grey values (GLVA; Krotkov & Martin 1986).
    GreyVariance = "grey-variance";
    /// Variance divided by the mean (GLVN; Santos et al. 1997).
    NormalisedVariance = "normalised-variance";
    /// Variance of the local variance (GLLV; Pech-Pacheco et al. 2000).
    VarianceOfVariance = "variance-of-variance";
    /// Correlation at a distance of one pixel minus that at two (VOLA; Vollath 1987).
    Vollath = "vollath";
    /// Magnitudes of the differences to all eight neighbours (CONT; Nanda & Cutler 2001).
    Contrast = "contrast";
    /// Magnitudes of the coefficients of a quadratic surface (CURV; Helmli & Scherer 2001).
    Curvature = "curvature";
    /// Pixel divided by mean, or its inverse, whichever is above 1 (HELM; Helmli & Scherer 2001).
    MeanQuotient = "mean-quotient";
    /// Largest minus smallest grey value (HISR; Firestone et al. 1991).
    Range = "range";
}

/// An unknown name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a focus measure: expected one of {names}", names = names())]
pub struct UnknownSharpness(String);

fn names() -> String {
    Sharpness::ALL.iter().map(|measure| measure.name()).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Sharpness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Sharpness {
    type Err = UnknownSharpness;

    fn from_str(text: &str) -> Result<Self, UnknownSharpness> {
        let known = Self::ALL.iter().find(|measure| measure.name() == text.trim());
        known.copied().ok_or_else(|| UnknownSharpness(text.to_owned()))
    }
}

/// Rows of a pixel's neighbourhood.
type Around = [[f32; 3]; 3];

impl Sharpness {
    /// Pixels beyond the window that a value depends on.
    pub(super) const REACH_PX: usize = 4;

    /// The measure around each pixel of an image of (height, width), over a window of odd side.
    pub fn of(self, image: ArrayView2<f32>, window_px: usize) -> Array2<f32> {
        let mean = |map: Array2<f32>| box_mean(map.view(), window_px);
        let around = |f: fn(&Around) -> f32| neighbourhoods(image, f);
        match self {
            Self::ModifiedLaplacian => mean(around(|a| second(a).iter().map(|d| d.abs()).sum())),
            Self::DiagonalLaplacian => mean(around(|a| {
                let straight: f32 = second(a).iter().map(|d| d.abs()).sum();
                let across =
                    (2.0 * a[1][1] - a[0][0] - a[2][2]).abs() + (2.0 * a[1][1] - a[0][2] - a[2][0]).abs();
                straight + across * std::f32::consts::FRAC_1_SQRT_2
            })),
            Self::LaplacianEnergy => mean(around(|a| laplacian(a).powi(2))),
            Self::LaplacianVariance => variance(around(laplacian), window_px),
            Self::Tenengrad => mean(around(|a| sobel(a).iter().map(|d| d * d).sum())),
            Self::TenengradVariance => variance(around(|a| sobel(a)[0].hypot(sobel(a)[1])), window_px),
            Self::GradientEnergy => mean(around(|a| first(a).iter().map(|d| d * d).sum())),
            Self::AbsoluteGradient => mean(around(|a| first(a)[0].abs().max(first(a)[1].abs()))),
            Self::SquaredGradient => mean(around(|a| first(a)[0].powi(2))),
            Self::Brenner => {
                let [across, down] = [[0, 2], [2, 0]].map(|to| moved(image, to));
                mean(
                    Zip::from(image)
                        .and(&across)
                        .and(&down)
                        .map_collect(|here, across, down| (across - here).powi(2).max((down - here).powi(2))),
                )
            }
            Self::GaussianDerivative => {
                let [x, y] = derivatives(image);
                mean(Zip::from(&x).and(&y).map_collect(|x, y| x * x + y * y))
            }
            Self::Steerable => mean(steered(image)),
            Self::SpatialFrequency => {
                mean(around(|a| first(a).iter().map(|d| d * d).sum())).mapv_into(f32::sqrt)
            }
            Self::GreyVariance => variance(image.to_owned(), window_px),
            Self::NormalisedVariance => {
                let mut quotient = variance(image.to_owned(), window_px);
                quotient.zip_mut_with(&mean(image.to_owned()), |variance, mean| {
                    *variance /= mean.abs().max(DARK)
                });
                quotient
            }
            Self::VarianceOfVariance => variance(variance(image.to_owned(), 3), window_px),
            Self::Vollath => {
                let products = |by: usize| &image * &moved(image, [0, by]);
                let mut difference = mean(products(1) - products(2));
                difference.mapv_inplace(|v| v.max(0.0));
                difference
            }
            Self::Contrast => mean(around(|a| a.iter().flatten().map(|v| (v - a[1][1]).abs()).sum())),
            Self::Curvature => mean(around(quadratic)),
            Self::MeanQuotient => mean_quotient(image, window_px),
            Self::Range => range(image, window_px),
        }
    }
}

/// What `f` makes of each pixel's neighbourhood.
fn neighbourhoods(image: ArrayView2<f32>, f: impl Fn(&Around) -> f32) -> Array2<f32> {
    let (height, width) = image.dim();
    let mut result = Array2::zeros((height, width));
    for (y, mut row) in result.rows_mut().into_iter().enumerate() {
        let rows = [-1, 0, 1].map(|d| image.row(reflect(y as isize + d, height)));
        for (x, value) in row.iter_mut().enumerate() {
            let columns = [-1, 0, 1].map(|d| reflect(x as isize + d, width));
            *value = f(&rows.map(|row| columns.map(|column| row[column])));
        }
    }
    result
}

/// The image moved up and left by this many rows and columns.
fn moved(image: ArrayView2<f32>, [down, across]: [usize; 2]) -> Array2<f32> {
    let (height, width) = image.dim();
    Array2::from_shape_fn((height, width), |(y, x)| {
        image[(reflect((y + down) as isize, height), reflect((x + across) as isize, width))]
    })
}

fn first(a: &Around) -> [f32; 2] {
    [a[1][2] - a[1][1], a[2][1] - a[1][1]]
}

fn second(a: &Around) -> [f32; 2] {
    [2.0 * a[1][1] - a[1][0] - a[1][2], 2.0 * a[1][1] - a[0][1] - a[2][1]]
}

fn laplacian(a: &Around) -> f32 {
    second(a).iter().sum()
}

fn sobel(a: &Around) -> [f32; 2] {
    [
        (a[0][2] + 2.0 * a[1][2] + a[2][2]) - (a[0][0] + 2.0 * a[1][0] + a[2][0]),
        (a[2][0] + 2.0 * a[2][1] + a[2][2]) - (a[0][0] + 2.0 * a[0][1] + a[0][2]),
    ]
}

/// Sum of the magnitudes of c0 to c3 of the least squares of `c + c0 x + c1 y + c2 x^2 + c3 y^2` over the neighbourhood. Without c, as
/// published, c2 and c3 would contain the brightness.
fn quadratic(a: &Around) -> f32 {
    let columns = [0, 1, 2].map(|x| a[0][x] + a[1][x] + a[2][x]);
    let rows = [0, 1, 2].map(|y| a[y].iter().sum::<f32>());
    let [x2, y2] = [columns[0] + columns[2], rows[0] + rows[2]];
    let slopes = ((columns[2] - columns[0]).abs() + (rows[2] - rows[0]).abs()) / 6.0;
    // The squares have a mean of 2 / 3 over the nine pixels.
    let all: f32 = rows.iter().sum();
    slopes + [x2, y2].map(|sum| (0.5 * sum - all / 3.0).abs()).iter().sum::<f32>()
}

/// Variance over a window.
fn variance(map: Array2<f32>, window_px: usize) -> Array2<f32> {
    // Relative to the image's mean, against cancellation.
    let middle = map.mean().unwrap_or(0.0);
    let centred = map.mapv_into(|v| v - middle);
    let mean = box_mean(centred.view(), window_px);
    let mut squares = box_mean(centred.mapv(|v| v * v).view(), window_px);
    squares.zip_mut_with(&mean, |square, mean| *square = (*square - mean * mean).max(0.0));
    squares
}

/// Derivatives of the image smoothed by a Gaussian, along x and y.
fn derivatives(image: ArrayView2<f32>) -> [Array2<f32>; 2] {
    let radius = Sharpness::REACH_PX as isize;
    let gauss = |t: f64| (-0.5 * t * t / (SIGMA_PX * SIGMA_PX)).exp();
    let total: f64 = (-radius..=radius).map(|t| gauss(t as f64)).sum();
    let smooth: Vec<f32> = (-radius..=radius).map(|t| (gauss(t as f64) / total) as f32).collect();
    let slope: Vec<f32> = (-radius..=radius)
        .map(|t| (t as f64 / (SIGMA_PX * SIGMA_PX) * gauss(t as f64) / total) as f32)
        .collect();
    [(&slope, &smooth), (&smooth, &slope)].map(|(across, down)| separable(image, across, down))
}

/// The image blurred by a Gaussian of this standard deviation, which reaches [`blur_reach_px`] far.
pub(super) fn blurred(image: ArrayView2<f32>, sd_px: f32) -> Array2<f32> {
    let radius = blur_reach_px(sd_px) as isize;
    let gauss = |t: isize| (-0.5 * (t as f32 / sd_px).powi(2)).exp();
    let total: f32 = (-radius..=radius).map(gauss).sum();
    let taps: Vec<f32> = (-radius..=radius).map(|t| gauss(t) / total).collect();
    separable(image, &taps, &taps)
}

/// How far [`blurred`] looks.
pub(super) fn blur_reach_px(sd_px: f32) -> usize {
    (3.0 * sd_px).ceil() as usize
}

fn separable(image: ArrayView2<f32>, across: &[f32], down: &[f32]) -> Array2<f32> {
    let pass = |image: ArrayView2<f32>, taps: &[f32]| {
        let (height, width) = image.dim();
        let radius = (taps.len() / 2) as isize;
        let columns: Vec<usize> = (-radius..width as isize + radius).map(|x| reflect(x, width)).collect();
        let mut result = Array2::zeros((height, width));
        for (mut row, from) in result.rows_mut().into_iter().zip(image.rows()) {
            let padded: Vec<f32> = columns.iter().map(|x| from[*x]).collect();
            for (x, value) in row.iter_mut().enumerate() {
                *value = padded[x..x + taps.len()].iter().zip(taps).map(|(v, tap)| v * tap).sum();
            }
        }
        result
    };
    let rows = pass(image, across);
    pass(rows.t(), down).reversed_axes()
}

/// Largest magnitude of the derivative over the directions.
fn steered(image: ArrayView2<f32>) -> Array2<f32> {
    let [x, y] = derivatives(image);
    let directions: [(f32, f32); DIRECTIONS] =
        std::array::from_fn(|i| (std::f32::consts::PI * i as f32 / DIRECTIONS as f32).sin_cos());
    Zip::from(&x)
        .and(&y)
        .map_collect(|x, y| directions.iter().map(|(sin, cos)| (cos * x + sin * y).abs()).fold(0.0, f32::max))
}

fn mean_quotient(image: ArrayView2<f32>, window_px: usize) -> Array2<f32> {
    let mean = box_mean(image, window_px);
    let quotient = Zip::from(image).and(&mean).map_collect(|here, mean| {
        let [here, mean] = [here.max(DARK), mean.max(DARK)];
        // A place without texture has 1, so 1 is subtracted.
        (here / mean).max(mean / here) - 1.0
    });
    box_mean(quotient.view(), window_px)
}

fn range(image: ArrayView2<f32>, window_px: usize) -> Array2<f32> {
    let extreme = |pick: fn(f32, f32) -> f32| {
        let pass = |map: ArrayView2<f32>| {
            let (height, width) = map.dim();
            let half = window_px / 2;
            Array2::from_shape_fn((height, width), |(y, x)| {
                let row = map.row(y);
                (x.saturating_sub(half)..(x + half + 1).min(width))
                    .fold(row[x], |best, at| pick(best, row[at]))
            })
        };
        let rows = pass(image);
        pass(rows.t()).reversed_axes()
    };
    extreme(f32::max) - extreme(f32::min)
}

#[cfg(test)]
mod tests {
    use ndarray::s;

    use super::*;

    fn texture(blur: usize) -> Array2<f32> {
        // Mixed as in Fibonacci hashing, twice: neighbours are as good as independent.
        let noise = Array2::from_shape_fn((48, 64), |(y, x)| {
            let mixed = ((64 * y + x + 1) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (mixed >> 40) as f32 / (1 << 24) as f32 + 0.2
        });
        box_mean(noise.view(), blur)
    }

    #[test]
    fn every_measure_falls_as_the_image_blurs_and_is_nought_without_texture() {
        for measure in Sharpness::ALL {
            // Some are noisy where few pixels are seen (Vollath's ends of the window times the mean).
            let middle = |image: Array2<f32>| {
                let map = measure.of(image.view(), 9);
                map.slice(s![12..36, 12..52]).mean().unwrap_or(f32::NAN)
            };
            let [sharp, soft, softer] = [3, 5, 9].map(|blur| middle(texture(blur)));
            assert!(sharp > soft && soft > softer, "{measure}: {sharp} {soft} {softer}");
            let flat = middle(Array2::from_elem((48, 64), 0.5));
            assert!((0.0..1e-6).contains(&flat), "{measure}: {flat}");
            assert_eq!(measure.name().parse(), Ok(*measure));
        }
        assert!(Sharpness::ALL.len() >= 20);
        assert!("sharp".parse::<Sharpness>().unwrap_err().to_string().contains("tenengrad"));
    }

    #[test]
    fn a_ramp_has_its_slope_and_no_curvature() {
        let ramp = Array2::from_shape_fn((40, 40), |(y, x)| 0.03 * x as f32 + 0.01 * y as f32);
        let at = |measure: Sharpness| measure.of(ramp.view(), 7)[(20, 20)];
        let close = |measure: Sharpness, expected: f32| {
            assert!((at(measure) - expected).abs() < 1e-3 * expected.max(1e-3), "{measure}: {}", at(measure));
        };
        close(Sharpness::SquaredGradient, 9e-4);
        close(Sharpness::GradientEnergy, 1e-3);
        close(Sharpness::Tenengrad, 64.0 * 1e-3);
        close(Sharpness::Brenner, 3.6e-3);
        close(Sharpness::GaussianDerivative, 1e-3);
        close(Sharpness::Curvature, 0.04);
        close(Sharpness::LaplacianEnergy, 0.0);
        close(Sharpness::ModifiedLaplacian, 0.0);
        // Over 7 pixels: 6 steps of each slope.
        close(Sharpness::Range, 0.24);
        // Variance of 7 equal steps: 4 squared slopes in each direction.
        close(Sharpness::GreyVariance, 4e-3);
    }

    /// A pixel's neighbour, rows down and columns to the right.
    type Neighbour<'a> = &'a dyn Fn(isize, isize) -> f64;

    fn offsets(reach: isize) -> impl Iterator<Item = [isize; 2]> {
        (-reach..=reach).flat_map(move |y| (-reach..=reach).map(move |x| [y, x]))
    }

    fn mean_and_variance(values: impl Iterator<Item = f64>) -> [f64; 2] {
        let values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        [mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64]
    }

    /// The measures over 3x3 pixels as the survey defines them: sums of masks at each pixel, and their mean or variance.
    fn by_definition(measure: Sharpness, v: Neighbour) -> f64 {
        let masked = |weight: fn(f64, f64) -> f64, reach: isize, v: Neighbour| -> f64 {
            offsets(reach).map(|[y, x]| weight(y as f64, x as f64) * v(y, x)).sum()
        };
        let over = |f: &dyn Fn(Neighbour) -> f64| {
            mean_and_variance(offsets(1).map(|[y, x]| f(&|dy, dx| v(y + dy, x + dx))))
        };
        let mean = |f: &dyn Fn(Neighbour) -> f64| over(f)[0];
        let variance = |f: &dyn Fn(Neighbour) -> f64| over(f)[1];
        let right = |v: Neighbour| v(0, 1) - v(0, 0);
        let below = |v: Neighbour| v(1, 0) - v(0, 0);
        let second = |v: Neighbour, y: isize, x: isize| (2.0 * v(0, 0) - v(y, x) - v(-y, -x)).abs();
        let laplacian = |v: Neighbour| 4.0 * v(0, 0) - v(0, 1) - v(0, -1) - v(1, 0) - v(-1, 0);
        let sobel = |v: Neighbour| {
            [masked(|y, x| x * (2.0 - y.abs()), 1, v), masked(|y, x| y * (2.0 - x.abs()), 1, v)]
        };
        let bell = |v: Neighbour| {
            let total: f64 = (-4..=4).map(|t| (-0.5 * f64::from(t * t)).exp()).sum();
            let slopes: [f64; 2] = [
                masked(|y, x| x * (-0.5 * (y * y + x * x)).exp(), 4, v),
                masked(|y, x| y * (-0.5 * (y * y + x * x)).exp(), 4, v),
            ];
            slopes.map(|slope| slope / (total * total))
        };
        let around = |v: Neighbour| offsets(1).map(|[y, x]| v(y, x)).collect::<Vec<_>>();
        match measure {
            Sharpness::ModifiedLaplacian => mean(&|v| second(v, 0, 1) + second(v, 1, 0)),
            Sharpness::DiagonalLaplacian => mean(&|v| {
                second(v, 0, 1) + second(v, 1, 0) + (second(v, 1, 1) + second(v, 1, -1)) / 2.0_f64.sqrt()
            }),
            Sharpness::LaplacianEnergy => mean(&|v| laplacian(v).powi(2)),
            Sharpness::LaplacianVariance => variance(&laplacian),
            Sharpness::Tenengrad => mean(&|v| sobel(v).map(|s| s * s).iter().sum()),
            Sharpness::TenengradVariance => variance(&|v| sobel(v)[0].hypot(sobel(v)[1])),
            Sharpness::GradientEnergy => mean(&|v| right(v).powi(2) + below(v).powi(2)),
            Sharpness::AbsoluteGradient => mean(&|v| right(v).abs().max(below(v).abs())),
            Sharpness::SquaredGradient => mean(&|v| right(v).powi(2)),
            Sharpness::Brenner => mean(&|v| (v(0, 2) - v(0, 0)).powi(2).max((v(2, 0) - v(0, 0)).powi(2))),
            Sharpness::GaussianDerivative => mean(&|v| bell(v).map(|s| s * s).iter().sum()),
            Sharpness::Steerable => mean(&|v| {
                let [x, y] = bell(v);
                let along = |i| (f64::from(i) * std::f64::consts::PI / 8.0).sin_cos();
                (0..8).map(|i| (along(i).1 * x + along(i).0 * y).abs()).fold(0.0, f64::max)
            }),
            Sharpness::SpatialFrequency => mean(&|v| right(v).powi(2) + below(v).powi(2)).sqrt(),
            Sharpness::GreyVariance => variance(&|v| v(0, 0)),
            Sharpness::NormalisedVariance => variance(&|v| v(0, 0)) / mean(&|v| v(0, 0)),
            Sharpness::VarianceOfVariance => variance(&|v| mean_and_variance(around(v).into_iter())[1]),
            Sharpness::Vollath => mean(&|v| v(0, 0) * (v(0, 1) - v(0, 2))).max(0.0),
            Sharpness::Contrast => mean(&|v| around(v).iter().map(|n| (n - v(0, 0)).abs()).sum()),
            // The surface has a constant, too; over nine pixels the sum of x^2 is 6, that of (x^2 - 2/3)^2 is 2.
            Sharpness::Curvature => mean(&|v| {
                let slopes = masked(|_, x| x, 1, v).abs() + masked(|y, _| y, 1, v).abs();
                let squares = masked(|_, x| x * x - 2.0 / 3.0, 1, v).abs()
                    + masked(|y, _| y * y - 2.0 / 3.0, 1, v).abs();
                slopes / 6.0 + squares / 2.0
            }),
            Sharpness::MeanQuotient => mean(&|v| {
                let local = mean_and_variance(around(v).into_iter())[0];
                (v(0, 0) / local).max(local / v(0, 0)) - 1.0
            }),
            Sharpness::Range => {
                let values = around(v);
                values.iter().fold(0.0, |a: f64, b| a.max(*b))
                    - values.iter().fold(9.0, |a: f64, b| a.min(*b))
            }
        }
    }

    #[test]
    fn every_measure_is_what_the_survey_defines() {
        let image = texture(1);
        for measure in Sharpness::ALL {
            let map = measure.of(image.view(), 3);
            for (row, column) in [(20_usize, 30_usize), (21, 30), (33, 11), (14, 47)] {
                let value = |y: isize, x: isize| {
                    f64::from(image[(row.wrapping_add_signed(y), column.wrapping_add_signed(x))])
                };
                let (found, expected) = (f64::from(map[(row, column)]), by_definition(*measure, &value));
                // Running sums over a row in single precision, of values around 1.
                assert!((found - expected).abs() < 1e-3 * expected + 1e-5, "{measure}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_blurred_point_is_a_gaussian_and_a_ramp_has_its_slope() {
        let mut point = Array2::zeros((41, 41));
        point[(20, 20)] = 1.0;
        let blurred = blurred(point.view(), 3.0);
        assert!((blurred.sum() - 1.0).abs() < 1e-5);
        for ((down, across), sds) in
            [((3, 0), 1.0_f32), ((0, 3), 1.0), ((6, 0), 2.0), ((3, 3), 2.0_f32.sqrt())]
        {
            let ratio = blurred[(20 + down, 20 + across)] / blurred[(20, 20)];
            assert!((ratio - (-0.5 * sds * sds).exp()).abs() < 1e-5, "{ratio}");
        }
        assert_eq!((blur_reach_px(3.0), blur_reach_px(0.5), blurred[(20, 30)]), (9, 2, 0.0));
        let ramp = Array2::from_shape_fn((20, 20), |(y, x)| 0.3 * x as f32 + 0.1 * y as f32);
        let slopes = derivatives(ramp.view()).map(|map| map[(10, 10)].abs());
        // The Gaussian ends at 4 of its standard deviations.
        assert!((slopes[0] - 0.3).abs() < 3e-3 && (slopes[1] - 0.1).abs() < 1e-3, "{slopes:?}");
    }
}
