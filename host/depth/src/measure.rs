//! Depth of a pair from a real camera: preparation, measurement, validity.

mod finding;
mod scaled_blur;

use std::ops::RangeInclusive;

use ndarray::{Array2, ArrayView2, Zip, s};

use crate::adaptive_window::{
    Bank, Estimate, Window, WindowSettings, check_pair, estimate, estimate_without_depth,
};
use crate::baselines::{self, BaselineError};
use crate::coarseness::coarseness;
use crate::depth_map::{DepthMap, Warning};
use crate::direction::anisotropy;
use crate::fill;
use crate::median::median;
use crate::mosaic::is_mosaic;
use crate::operators::{DesignError, Operators};
use crate::optics::{Optics, Stage};
use crate::pipeline::{
    RunError, Settings, depth_from_pair, extend_border, fill_border, warnings_after, widen_border,
};
use crate::prepare::{
    CameraFrames, PrepareError, PrepareSettings, Prepared, Registration, Report, prepare_after,
    usual_magnitude,
};
use crate::psf::Psf;
use crate::reason::Reason;
use crate::validity::{Lost, Validity, ValiditySettings, assess};
pub use finding::Finding;
use scaled_blur::undo_scaled_blur;

/// Alpha of a pixel measured out of range before blur scaling is undone.
const OUT_OF_RANGE_ALPHA: f64 = 1.2;
/// Least part of the estimated noise that the residual may leave.
const LEAST_NOISE: f64 = 0.1;
/// Distance of the median coarseness from that of the target, beyond which the texture is another one. Planes of the target's own
/// texture, on simulated lenses, were at most 0.03 outside, of 1/f texture 1.3.
const OTHER_TEXTURE: f64 = 0.3;
/// Rows in the middle of a learned lens's images whose residual is compared with the noise first.
const SAMPLED_ROWS: usize = 96;
/// Magnitudes whose squares, and small parts of them, f32 holds.
const USUAL_MAGNITUDES: RangeInclusive<f32> = 1e-9..=1e9;
/// Part of the pixels lost for one reason above which it is reported.
pub const LEAST_REPORTED: f64 = 0.01;
/// Part of the noise by lossy compression that is worth a word: JPEG of quality 95 has 0.3, 90 has 0.4.
const COMPRESSED: f64 = 0.35;
/// Deviation of a band's brightness that is worth a word.
const BANDED: f64 = 0.02;
/// Unexplained texture, mean squares, from which PSF or blur are doubted.
const DOUBTFUL: f64 = 3e-4;
/// The same relative to the noise, which is known to some percent.
const EXCESSIVE: f64 = 1.025;
/// Least part of the image with detail for that doubt.
const TELLING: f64 = 0.2;

/// Standard deviation of alpha by correcting scaled blur through its second moment, per difference of the blurs' squared
/// scales: chosen after errors of up to 0.6 mm on planes at a magnification of 1.09, not fitted.
const SCALED_BLUR_ERROR: f64 = 0.1;
/// Standard deviation of rational operators relative to white-residual ones in equal windows; measured 1.05 to 1.16.
const RATIONAL_OVER_WHITENED: f32 = 1.12;
/// The same for baselines: Subbarao's; Favaro's is below 1.
const BASELINE_OVER_WHITENED: f32 = 2.5;

/// Depth method.
#[derive(Debug, Clone, Copy)]
pub enum DepthMethod<'a> {
    /// Rational operators.
    Rational(&'a Operators),
    /// Operators with a white residual.
    Whitened,
    /// A method to compare with.
    Baseline(baselines::Method),
}

impl DepthMethod<'_> {
    /// The default window.
    pub fn usual_window(&self) -> Window {
        match self {
            Self::Whitened => Window::Adaptive,
            Self::Rational(_) | Self::Baseline(_) => Window::Fixed(7),
        }
    }
}

/// Settings of the whole measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasureSettings {
    /// Geometry, brightness, the camera's limits.
    pub prepare: PrepareSettings,
    /// Window over which evidence is summed.
    pub window: Window,
    /// Median, filling and threads; `smoothing_px` is ignored.
    pub run: Settings,
    /// Confidence below which a depth is removed.
    pub least_confidence: f32,
}

impl Default for MeasureSettings {
    fn default() -> Self {
        Self {
            prepare: PrepareSettings::default(),
            window: Window::Fixed(7),
            run: Settings::default(),
            least_confidence: 0.0,
        }
    }
}

/// Why there is no depth map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum MeasureError {
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    #[error("the optics were learned by calibrate stack for method whitened: use that method")]
    LearnedForWhitened,
    #[error("window adaptive is for method whitened: give a number of pixels")]
    FixedWindow,
    #[error(transparent)]
    Design(#[from] DesignError),
}

/// Depth of a real pair with its quality.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// Depth and confidence: the probability of an error below three standard deviations.
    pub map: DepthMap,
    /// Reasons and standard deviations.
    pub validity: Validity,
    /// Report of the preparation.
    pub report: Report,
    /// What a user should know.
    pub findings: Vec<Finding>,
    /// The pair as it was measured.
    pub prepared: Prepared,
}

/// Depth of a pair in any common scale, with [`prepare`](crate::prepare) and [`assess`](crate::validity).
pub fn measure_pair_of_views(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    optics: &Optics,
    method: DepthMethod<'_>,
    camera: Option<&CameraFrames>,
    settings: &MeasureSettings,
) -> Result<Measurement, MeasureError> {
    let images = [far, near].map(|image| image.as_standard_layout().into_owned());
    measure_pair(images, optics, method, camera, settings)
}

/// As [`measure_pair_of_views`], consuming the images `[far, near]`. Peak memory: 30 bytes a pixel, images included.
pub fn measure_pair(
    images: [Array2<f32>; 2],
    optics: &Optics,
    method: DepthMethod<'_>,
    camera: Option<&CameraFrames>,
    settings: &MeasureSettings,
) -> Result<Measurement, MeasureError> {
    let [far, near] = &images;
    check_pair(far.view(), near.view())?;
    if is_same(far.view(), near.view()) {
        return Err(RunError::SameImage.into());
    }
    let mut images = images;
    // Known noise has the unit of the images, a camera's frames and limits are of values up to 1.
    if settings.prepare.noise.is_none() && settings.prepare.limits.is_none() && camera.is_none() {
        scale_to_usual(&mut images);
    }
    let white = Bank::whitened(optics)?;
    // On a thread of the pool: another one would wake the pool for each parallel loop.
    rayon::scope(|_| measure_after(&mut None, &white, images, optics, method, camera, settings))
}

/// Scales a pair whose squares are beyond f32, by a power of two, which rounds nothing.
fn scale_to_usual(images: &mut [Array2<f32>; 2]) {
    let usual = images.iter().filter_map(|image| usual_magnitude(image.view())).fold(0.0, f32::max);
    if usual > 0.0 && !USUAL_MAGNITUDES.contains(&usual) {
        // The limit keeps the factor a normal number.
        let factor = 2.0_f32.powf(-usual.log2().round().clamp(-120.0, 120.0));
        images.iter_mut().for_each(|image| image.par_mapv_inplace(|value| value * factor));
    }
}

/// Whether all pixels are alike; NaN (transparent) is alike NaN.
fn is_same(far: ArrayView2<f32>, near: ArrayView2<f32>) -> bool {
    let alike = |(a, b): (&f32, &f32)| a == b || a.is_nan() && b.is_nan();
    far.dim() == near.dim() && far.iter().zip(near).all(alike)
}

/// [`measure_pair`] of the next pair of a rig, as [`prepare_after`]; `white` is of the optics.
pub(crate) fn measure_after(
    last: &mut Option<Registration>,
    white: &Bank,
    images: [Array2<f32>; 2],
    optics: &Optics,
    method: DepthMethod<'_>,
    camera: Option<&CameraFrames>,
    settings: &MeasureSettings,
) -> Result<Measurement, MeasureError> {
    check_pair(images[0].view(), images[1].view())?;
    if optics.stage().is_some() && !matches!(method, DepthMethod::Whitened) {
        return Err(MeasureError::LearnedForWhitened);
    }
    let mut prepare = settings.prepare;
    let (mut images, mut camera) = (images, camera);
    if let Some(stage) = optics.stage() {
        // A learned response compares the residual with its own usual one instead.
        prepare.trust = true;
        prepare.coding /= (stage.bin * stage.bin) as f64;
        // The frames are of single pixels.
        if let Some(frames) = camera.take_if(|_| stage.bin > 1) {
            let white = prepare.limits.map_or(f32::INFINITY, |[_, white]| white);
            for image in &mut images {
                *image = frames.correct_below(image.view(), white).map_err(PrepareError::from)?;
            }
        }
        images = images.map(|image| binned(image, stage.bin));
    }
    check_pair(images[0].view(), images[1].view())?;
    let is_mosaic = is_mosaic(images[0].view());
    let prepared = prepare_after(last, images, optics, camera, &prepare)?;
    let (mut map, estimate) = measure(&prepared, white, optics, method, settings)?;
    let mut findings = findings(&map, &prepared, &estimate, optics);
    findings.extend(is_mosaic.then_some(Finding::Mosaic));
    let judging = ValiditySettings { least_confidence: settings.least_confidence, filled: settings.run.fill };
    let mut validity = assess(&mut map, &prepared, estimate, optics, &judging);
    // The deviations of other methods do not explain how their neighbours differ.
    if matches!(method, DepthMethod::Whitened) {
        widen_border(&mut validity.deviation_mm, &map.depth_mm, white.reach_px() + 1);
    }
    // The loss that the caller asked for is news only if nothing is left.
    let reported = |lost: &&Lost| {
        lost.fraction > LEAST_REPORTED && (lost.reason != Reason::Unsure || validity.valid_fraction == 0.0)
    };
    findings.extend(validity.lost.iter().filter(reported).copied().map(Finding::Lost));
    let is_asked_for = validity.lost.iter().any(|lost| lost.reason == Reason::Unsure);
    if validity.valid_fraction == 0.0 && !is_asked_for {
        findings.insert(0, Finding::NoDepth);
    }
    if validity.valid_fraction < TELLING {
        // With nearly no depth, the residual carries no information on the lens.
        findings.retain(|finding| !matches!(finding, Finding::Unexplained { .. }));
    }
    map.warnings.clear();
    let report = prepared.report;
    Ok(Measurement { map, validity, report, findings, prepared })
}

/// The white residual judges every method, because its deviation is known best.
pub(crate) fn measure(
    prepared: &Prepared,
    white: &Bank,
    optics: &Optics,
    method: DepthMethod<'_>,
    settings: &MeasureSettings,
) -> Result<(DepthMap, Estimate), MeasureError> {
    let (far, near) = (prepared.far.view(), prepared.near.view());
    let mut of_windows = WindowSettings {
        window: settings.window,
        median_px: settings.run.median_px,
        noise: prepared.noise,
        backend: settings.run.backend,
    };
    // Part of the pair's noise that the estimate is given.
    let mut of_noise = 1.0;
    if optics.stage().is_some() {
        // With too much noise the choice of windows would smooth relief away.
        let middle = far.nrows().saturating_sub(SAMPLED_ROWS) / 2;
        let rows = middle..(middle + SAMPLED_ROWS).min(far.nrows());
        let [far, near] = [far, near].map(|image| image.slice_move(s![rows.clone(), ..]));
        // The middle may be blank.
        if let Ok(sample) = estimate_without_depth(far, near, white, optics, &of_windows) {
            of_noise = of_residual(sample.excess);
            of_windows.noise = of_windows.noise.scaled(of_noise);
        }
    }
    let run = |side: usize| Settings { smoothing_px: side, ..settings.run };
    // The map first: validity needs no depth of its own, and maps are large.
    let (mut map, mut estimate) = match (method, settings.window) {
        (DepthMethod::Whitened, _) => {
            let mut found = estimate(far, near, white, optics, &of_windows)?;
            let depth_mm = std::mem::take(&mut found.depth_mm);
            (of_estimate(depth_mm, &found.deviation_mm, prepared, white, optics, settings), found)
        }
        (_, Window::Adaptive) => return Err(MeasureError::FixedWindow),
        (method, Window::Fixed(side)) => {
            let map = match method {
                DepthMethod::Rational(operators) => {
                    depth_from_pair(far, near, operators, optics, &run(side))?
                }
                DepthMethod::Baseline(method) => {
                    baselines::depth_from_pair(method, far, near, optics, &run(side))?
                }
                DepthMethod::Whitened => unreachable!("above"),
            };
            (map, estimate_without_depth(far, near, white, optics, &of_windows)?)
        }
    };
    let noisier = match method {
        DepthMethod::Whitened => 1.0,
        DepthMethod::Rational(_) => RATIONAL_OVER_WHITENED,
        DepthMethod::Baseline(_) => BASELINE_OVER_WHITENED,
    };
    let noise = (of_residual(estimate.excess * of_noise) / of_noise) as f32;
    let of_deviation = noisier * noise.sqrt();
    if of_deviation != 1.0 {
        estimate.deviation_mm.par_mapv_inplace(|deviation| deviation * of_deviation);
    }
    if noise != 1.0 {
        estimate.misfit.par_mapv_inplace(|misfit| misfit / noise);
    }
    // The border has the depth, so also the deviation and misfit, of the pixels next to it.
    let border = match method {
        DepthMethod::Rational(operators) => operators.kernel_size().max(white.reach_px() + 1),
        _ => white.reach_px() + 1,
    };
    for map in [&mut estimate.deviation_mm, &mut estimate.misfit] {
        extend_border(map, border);
    }
    if let Some(aligned) = prepared.report.aligned {
        undo_scaled_blur(&mut map.depth_mm, aligned.magnification, optics);
        if optics.stage().is_none() {
            let moments = (SCALED_BLUR_ERROR * (1.0 - aligned.magnification.powi(-2)).abs()) as f32;
            let slope_mm = slope_mm(optics);
            Zip::from(&mut estimate.deviation_mm)
                .and(&map.depth_mm)
                .par_for_each(|deviation, depth| *deviation = deviation.hypot(moments * slope_mm(*depth)));
        }
    }
    if let (DepthMethod::Whitened, Some(stage)) = (method, optics.stage()) {
        let warning = respond([&mut map.depth_mm, &mut estimate.deviation_mm], prepared, stage, optics);
        map.warnings.extend(warning);
    }
    Ok((map, estimate))
}

/// Magnitude of the change of depth with alpha at a depth, mm.
fn slope_mm(optics: &Optics) -> impl Fn(f32) -> f32 + Copy + Sync {
    let (steepness, focal_length_mm) = (optics.steepness() as f32, optics.focal_length_mm() as f32);
    move |depth_mm| steepness * (depth_mm - focal_length_mm).powi(2)
}

/// Whether the texture of most pixels is unlike the learned ones, from `low` to `high`; not if noise hides it everywhere.
fn other_texture(coarseness: Array2<f32>, [low, high]: [f64; 2]) -> Option<Warning> {
    let known = coarseness.into_iter().filter(|value| value.is_finite()).collect();
    let median = f64::from(median(known, f32::total_cmp)?);
    let is_usual = (low - OTHER_TEXTURE..=high + OTHER_TEXTURE).contains(&median);
    (!is_usual).then_some(Warning::OtherTexture { is_coarser: median > high })
}

/// Part of the noise of a pair that its residual shows. That noise contains what fine texture the blur leaves; the residual of the
/// right depth does not.
fn of_residual(excess: f64) -> f64 {
    if excess < 1.0 { excess.max(LEAST_NOISE) } else { 1.0 }
}

/// Applies the stage's response and scales the deviation; unlearned depths move out of the valid range.
fn respond(
    [depth_mm, deviation_mm]: [&mut Array2<f32>; 2],
    pair: &Prepared,
    stage: &Stage,
    optics: &Optics,
) -> Option<Warning> {
    let is_used = stage.coarser.is_some() || stage.coarseness.is_some();
    let coarseness = is_used.then(|| coarseness(pair));
    let direction = stage.astigmatism.is_some().then(|| anisotropy(pair));
    Zip::indexed(depth_mm).and(deviation_mm).par_for_each(|at, depth, deviation| {
        let measured = optics.alpha(f64::from(*depth));
        let coarseness = coarseness.as_ref().map_or(f64::NAN, |map| f64::from(map[at]));
        match stage.respond(measured, coarseness) {
            Some([alpha, slope, of_texture]) => {
                let anisotropy = direction
                    .as_ref()
                    .map_or([f64::NAN; 2], |of| of.each_ref().map(|map| f64::from(map[at])));
                let [shift, of_direction] = stage.shift(measured, anisotropy);
                let alpha = (alpha - shift).clamp(-OUT_OF_RANGE_ALPHA, OUT_OF_RANGE_ALPHA);
                *depth = optics.depth_mm(alpha) as f32;
                let [before, now] = [measured, alpha].map(|alpha| optics.depth_per_alpha_mm(alpha).abs());
                let of_alpha = f64::from(*deviation) / before * slope;
                *deviation = (of_alpha.hypot(of_texture).hypot(of_direction) * now) as f32;
            }
            None if measured.is_finite() => {
                *depth = optics.depth_mm(OUT_OF_RANGE_ALPHA.copysign(measured)) as f32;
            }
            None => {}
        }
    });
    let [low, high] = stage.coarseness?;
    let coarsest = stage.coarser.iter().flat_map(|coarser| coarser.coarseness);
    other_texture(coarseness?, [low, coarsest.fold(high, f64::max)])
}

/// The image with `bin` x `bin` pixels averaged into one; surplus pixels at the right and lower border are dropped.
pub fn binned(image: Array2<f32>, bin: usize) -> Array2<f32> {
    if bin <= 1 {
        return image;
    }
    let (height, width) = image.dim();
    let area = (bin * bin) as f32;
    Array2::from_shape_fn((height / bin, width / bin), |(y, x)| {
        image.slice(s![y * bin..(y + 1) * bin, x * bin..(x + 1) * bin]).sum() / area
    })
}

fn of_estimate(
    depth_mm: Array2<f32>,
    deviation_mm: &Array2<f32>,
    prepared: &Prepared,
    bank: &Bank,
    optics: &Optics,
    settings: &MeasureSettings,
) -> DepthMap {
    let slope_mm = slope_mm(optics);
    // Evidence is the reciprocal variance of alpha, like texture energy in the run time.
    let of = |depth: f32, deviation: f32| (0.05 * slope_mm(depth) / deviation).powi(2);
    let mut confidence = Array2::zeros(deviation_mm.dim());
    Zip::from(&mut confidence).and(&depth_mm).and(deviation_mm).par_for_each(|to, depth, deviation| {
        let evidence = of(*depth, *deviation);
        *to = if evidence < f32::INFINITY { evidence / (1.0 + evidence) } else { 0.0 };
    });
    let evidence = settings.run.fill.then(|| {
        Zip::from(&depth_mm).and(deviation_mm).map_collect(|depth, deviation| of(*depth, *deviation))
    });
    let mut map =
        DepthMap { depth_mm, confidence, filled: None, low_texture_fraction: 0.0, warnings: Vec::new() };
    fill_border(&mut map, bank.reach_px() + 1);
    if let Some(evidence) = evidence {
        let pair = [prepared.far.view(), prepared.near.view()];
        fill::fill(&mut map, evidence.view(), pair, bank.reach_px() + 3, settings.run.filling());
    }
    map.warnings.extend(warnings_after(&map, optics));
    map
}

fn findings(map: &DepthMap, prepared: &Prepared, estimate: &Estimate, optics: &Optics) -> Vec<Finding> {
    let mut findings: Vec<Finding> = map
        .warnings
        .iter()
        .filter(|warning| !matches!(warning, Warning::NotFinite { .. } | Warning::Saturated { .. }))
        .map(|warning| match warning {
            Warning::LooksSwapped(_) => Finding::SwappedByScene(warning.to_string()),
            _ => Finding::Run(warning.to_string()),
        })
        .collect();
    let report = &prepared.report;
    let of_optics = optics.magnification_ratio();
    if let Some(aligned) = report.aligned.filter(|_| report.looks_not_telecentric) {
        findings.push(Finding::NotTelecentric { magnification: aligned.magnification, of_optics });
    }
    if let Some(aligned) = report.aligned.filter(|aligned| aligned.standard_error_px.is_some()) {
        let shrunk = aligned.magnification.recip();
        if optics.telecentric() == Some(false) && (shrunk - of_optics).abs() < 0.25 * (of_optics - 1.0) {
            findings.push(Finding::SwappedByMagnification { magnification: aligned.magnification });
        }
    }
    if let Some(amplitude) = report.bands.filter(|amplitude| *amplitude > BANDED) {
        findings.push(Finding::Bands { amplitude });
    }
    let of_noise = prepared.noise.coding / prepared.noise.mean_variance;
    if of_noise > COMPRESSED {
        findings.push(Finding::Compressed { of_noise });
    }
    if report.equally_sharp {
        findings.push(Finding::EquallySharp);
    }
    if report.detailed_fraction < 0.01 {
        findings.push(Finding::NothingSharp);
    } else if report.detailed_fraction > TELLING
        // A lens of calibrate stack has its model error in every deviation.
        && optics.stage().is_none()
        && estimate.left_over > DOUBTFUL
        && estimate.excess > EXCESSIVE
    {
        let psf: Psf = optics.psf();
        findings.push(Finding::Unexplained {
            left_over: estimate.left_over,
            psf: psf.to_string(),
            max_blur_px: optics.max_blur_px(),
        });
    }
    findings
}
