//! Any round PSF: its light over the radius, and its OTF over frequency times blur.
//!
//! The density of the light is a sum of [`HATS`] hats over the radius with weights of 0 or more; the OTF is linear in
//! them. The cost is that of the models, `sum |H1 I2 - H2 I1|^2 / (H1^2 + H2^2)`, minimised by Newton steps with
//! weights of at least 0 from the best Gaussian. A smoothness prior decides what the pairs do not: second differences
//! of about [`BEND`] of the density's peak weigh as much as noise. Cost: 30 ms for a pair.

use nalgebra::{DMatrix, DVector};

use super::search::Observation;
use super::spread::{TOGETHER, covariance, noise, seen, turn};
use super::{CalibrationError, search};
use crate::psf::{Otf, Psf, RINGS, RadialPsf};

const HATS: usize = 16;

/// The outermost radius in `k` of the best Gaussian, which has 1e-4 of its light beyond.
const EXTENT_IN_K: f64 = 4.2;

/// Limits of that: less has no profile, more is not due to defocus.
const EXTENT: [f64; 2] = [1.2, 4.0];

/// Usual second differences of the density, relative to its peak.
const BEND: f64 = 0.3;

const STEPS: usize = 60;

/// Places of the OTF table, in radians of frequency times blur radius.
const PLACES: [f64; 10] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0];

/// A place of a measured OTF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtfPoint {
    /// Frequency times blur radius, rad.
    pub z: f64,
    /// The OTF there.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

pub(super) struct Found {
    pub psf: RadialPsf,
    pub cost: f64,
    pub otf: Vec<OtfPoint>,
    pub of_k: Option<f64>,
}

struct Hats {
    extent: f64,
    light: Vec<[f64; RINGS]>,
    total: Vec<f64>,
    otfs: Vec<Otf>,
}

impl Hats {
    fn new(extent: f64, largest_phase: f64) -> Result<Self, CalibrationError> {
        let spacing = RINGS as f64 / HATS as f64;
        let light: Vec<[f64; RINGS]> = (0..HATS)
            .map(|hat| {
                std::array::from_fn(|ring| {
                    let away = (ring as f64 + 0.5) / spacing - hat as f64;
                    (1.0 - away.abs()).max(0.0) * (2 * ring + 1) as f64
                })
            })
            .collect();
        let otf = |light: &[f64; RINGS]| {
            let rings = light.map(|light| light as f32);
            let psf = RadialPsf::new(extent, &rings)
                .map_err(|error| CalibrationError::Profile(error.to_string()))?;
            Ok(Psf::Radial(psf).otf_up_to(largest_phase))
        };
        let otfs = light.iter().map(otf).collect::<Result<_, CalibrationError>>()?;
        let total = light.iter().map(|light| light.iter().sum()).collect();
        Ok(Self { extent, light, total, otfs })
    }

    fn at(&self, radius_px: f64, frequency: f64) -> [f64; HATS] {
        std::array::from_fn(|hat| self.total[hat] * self.otfs[hat].at(radius_px, frequency))
    }

    fn profile(&self, weights: &[f64; HATS]) -> Result<RadialPsf, CalibrationError> {
        let light: [f32; RINGS] = std::array::from_fn(|ring| {
            self.light.iter().zip(weights).map(|(light, weight)| light[ring] * weight).sum::<f64>() as f32
        });
        RadialPsf::new(self.extent, &light).map_err(|error| CalibrationError::Profile(error.to_string()))
    }

    fn normalised(&self, weights: [f64; HATS]) -> [f64; HATS] {
        let sum: f64 = weights.iter().zip(&self.total).map(|(weight, total)| weight * total).sum();
        weights.map(|weight| weight / sum)
    }
}

struct Row<'a> {
    ring: &'a super::spectra::Ring,
    hats: [[f64; HATS]; 2],
}

impl Row<'_> {
    fn otf(&self, weights: &[f64; HATS]) -> [f64; 2] {
        self.hats.map(|hats| hats.iter().zip(weights).map(|(hat, weight)| hat * weight).sum())
    }
}

pub(super) fn profile(observations: &[Observation]) -> Result<Found, CalibrationError> {
    let (k, _) = search::gaussian(observations)?;
    let extent = (EXTENT_IN_K * k).clamp(EXTENT[0], EXTENT[1]);
    let phases = observations.iter().flat_map(|(bins, radii)| {
        let last = bins.rings.last().map_or(0.0, |ring| ring.frequency);
        radii.iter().map(move |radius| last * radius.abs())
    });
    let reach = phases.fold(0.0, f64::max);
    let hats = Hats::new(extent, reach)?;
    let rows: Vec<Row<'_>> = observations
        .iter()
        .flat_map(|(bins, radii)| bins.rings.iter().map(move |ring| (ring, *radii)))
        .map(|(ring, radii)| Row { ring, hats: radii.map(|radius| hats.at(radius, ring.frequency)) })
        .collect();
    let cost =
        |weights: &[f64; HATS]| -> f64 { rows.iter().map(|row| seen(row.ring, row.otf(weights)).left).sum() };
    let width = extent / HATS as f64;
    let mut weights =
        hats.normalised(std::array::from_fn(|hat| (-0.5 * (hat as f64 * width / k).powi(2)).exp()));
    // Relative to the Gaussian's peak, which is about that of any PSF of equal width.
    let prior = bends() * (weights[0] * BEND).powi(-2);
    let bends = &prior * (TOGETHER * noise(observations).max(1e-12 * cost(&weights)));
    let total = |weights: &[f64; HATS]| {
        let x = DVector::from_column_slice(weights);
        cost(weights) + (x.transpose() * &bends * &x)[0]
    };
    let mut value = total(&weights);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut hessian = bends.clone();
        let mut gradient = &bends * DVector::from_column_slice(&weights);
        for row in &rows {
            let h = row.otf(&weights);
            let seen = seen(row.ring, h);
            let turn: DVector<f64> = DVector::from_fn(HATS, |i, _| turn(h, [row.hats[0][i], row.hats[1][i]]));
            hessian += &turn * turn.transpose() * (seen.signal - seen.left).max(0.0);
            gradient += turn * seen.mixed;
        }
        // Damped until a step lowers the cost.
        let mut better = None;
        while better.is_none() && damping < 1e9 {
            let trial = hats.normalised(step(&hessian, &gradient, &weights, damping));
            let there = total(&trial);
            if there < value {
                better = Some((trial, there));
                damping *= 0.2;
            } else {
                damping *= 8.0;
            }
        }
        let Some((trial, there)) = better else { break };
        let gained = value - there;
        (weights, value) = (trial, there);
        if gained < 1e-9 * value {
            break;
        }
    }
    let psf = hats.profile(&weights)?;
    let (otf, of_k) = errors(observations, &hats, &weights, &prior, reach, psf);
    Ok(Found { psf, cost: cost(&weights), otf, of_k })
}

/// Summed squared second differences of the weights, even in the radius and 0 beyond the last hat, as a quadratic form.
fn bends() -> DMatrix<f64> {
    let mut form = DMatrix::zeros(HATS, HATS);
    for middle in 0..HATS {
        let mut row = DVector::zeros(HATS);
        row[middle] = -2.0;
        row[if middle == 0 { 1 } else { middle - 1 }] += 1.0;
        if middle + 1 < HATS {
            row[middle + 1] += 1.0;
        }
        form += &row * row.transpose();
    }
    form
}

/// Minimum of the quadratic model over weights of 0 or more, by coordinate descent.
fn step(hessian: &DMatrix<f64>, gradient: &DVector<f64>, weights: &[f64; HATS], damping: f64) -> [f64; HATS] {
    const ROUNDS: usize = 300;
    let mut moved = *weights;
    let damped = |i: usize| hessian[(i, i)] * (1.0 + damping) + f64::MIN_POSITIVE;
    for _ in 0..ROUNDS {
        for i in 0..HATS {
            let slope: f64 = gradient[i]
                + (0..HATS).map(|j| hessian[(i, j)] * (moved[j] - weights[j])).sum::<f64>()
                + damping * hessian[(i, i)] * (moved[i] - weights[i]);
            moved[i] = (moved[i] - slope / damped(i)).max(0.0);
        }
    }
    moved
}

fn errors(
    observations: &[Observation],
    hats: &Hats,
    weights: &[f64; HATS],
    prior: &DMatrix<f64>,
    reach: f64,
    psf: RadialPsf,
) -> (Vec<OtfPoint>, Option<f64>) {
    let of_all = Psf::Radial(psf).otf_up_to(reach);
    // The total light is 1: a weight that grows reduces the others.
    let by_weights = |radius_px: f64, frequency: f64| -> (f64, Vec<f64>) {
        let values = hats.at(radius_px, frequency);
        let h: f64 = values.iter().zip(weights).map(|(value, weight)| value * weight).sum();
        (h, values.iter().zip(&hats.total).map(|(value, total)| value - h * total).collect())
    };
    let covariance = covariance(observations, HATS, Some(prior), by_weights);
    let deviation = |gradient: Vec<f64>| {
        let gradient = DVector::from_vec(gradient);
        covariance
            .as_ref()
            .map(|covariance| (gradient.transpose() * covariance * gradient)[0].max(0.0).sqrt())
    };
    let otf = PLACES.into_iter().filter(|z| *z <= reach).filter_map(|z| {
        let standard_error = deviation(by_weights(1.0, z).1)?;
        Some(OtfPoint { z, value: of_all.at(1.0, z), standard_error })
    });
    let moments: Vec<f64> = hats
        .light
        .iter()
        .map(|light| {
            let radius = |ring: usize| (ring as f64 + 0.5) * hats.extent / RINGS as f64;
            light.iter().enumerate().map(|(ring, light)| light * radius(ring).powi(2)).sum()
        })
        .collect();
    let moment = psf.second_moment();
    // k = sqrt(moment / 2), so that its derivative is a quarter of the moment's over k.
    let of_k = deviation(
        moments
            .iter()
            .zip(&hats.total)
            .map(|(of_hat, total)| (of_hat - moment * total) / (4.0 * (0.5 * moment).sqrt()))
            .collect(),
    );
    (otf.collect(), of_k)
}
