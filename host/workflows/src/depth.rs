//! Computes a depth map from a far- and a near-focused image, with confidence and provenance.

pub mod method;
pub mod noise;
pub mod output;
mod pair;
pub mod part;
mod record;
mod request;
pub mod tone;

use std::{sync::Arc, time::Instant};

use farnear_depth::{
    adaptive_window::Window,
    corrections::Correction,
    fill::{FillBy, refill_as_thesis},
    measure::{Finding, LEAST_REPORTED, MeasureSettings, binned, measure_pair},
    mosaic::is_mosaic,
    optics::Optics,
    pipeline::DepthMap,
    prepare::{CameraFrames, PrepareSettings, Report},
    reason::Reason,
    validity::{Lost, Validity, lost_pixels},
};
use ndarray::Array2;
use serde::Serialize;

use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::{rounded, rounded_for},
    optics::{self, OpticsDoubt},
    quantile,
    request::Request,
};
use farnear_files::image_file::{ReadSettings, Samples};
use method::Prepared;
use noise::Uncertainty;
use output::Results;
use pair::Pair;
use part::{AROUND_PX, Cut, Part};
pub use request::DepthRequest;

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct DepthFigures {
    /// Depth, deviation and correction, without reading and writing.
    pub seconds: f64,
    pub width: usize,
    pub height: usize,
    /// NaN if no pixel has a depth.
    pub median_mm: f64,
    pub low_texture_fraction: f64,
    pub valid_fraction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    pub warnings: Vec<String>,
}

/// Computes a depth map and writes the folder: all files, or none on failure or cancellation.
pub fn compute(settings: &DepthRequest, context: &Context<'_>) -> Result<DepthFigures> {
    settings.check()?;
    match settings.threads {
        n if n > 0 && n != rayon::current_num_threads() => rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .map_err(|error| WorkflowError::parameter("threads", n, error.to_string()))?
            .install(|| compute_here(settings, context)),
        _ => compute_here(settings, context),
    }
}

/// [`compute`] on the threads at hand.
fn compute_here(settings: &DepthRequest, context: &Context<'_>) -> Result<DepthFigures> {
    let mut inputs = Inputs::read(settings, context)?;
    let start = Instant::now();
    let computed = inputs.compute(settings, context)?;
    let seconds = start.elapsed().as_secs_f64();
    let warnings = computed.findings.clone();
    for warning in &warnings {
        context.progress.warn(warning);
    }
    let out = settings.out.clone().unwrap_or_else(|| pair::default_folder(&settings.far));
    Results::new(settings, &inputs, &computed, &warnings, &out)?.write(&out, context)?;
    context.info(&format!("wrote {}", out.display()));
    let (height, width) = computed.map.depth_mm.dim();
    let range = inputs.optics.working_range();
    let median_mm = quantile::of_map(computed.map.depth_mm.view(), 0.5).unwrap_or(f64::NAN);
    Ok(DepthFigures {
        seconds: rounded(seconds, 6),
        width,
        height,
        median_mm: rounded_for(range.far_mm - range.near_mm, median_mm, 3),
        low_texture_fraction: rounded(computed.map.low_texture_fraction, 6),
        valid_fraction: rounded(computed.map.valid_fraction(), 6),
        uncertainty: computed.deviation.map(|(_, found)| found),
        warnings,
    })
}

struct Inputs {
    optics: Optics,
    pair: Pair,
    method: Prepared,
    correction: Option<Arc<Correction>>,
    camera: Option<Arc<CameraFrames>>,
    cut: Option<Cut>,
    /// Place of the map in the images; `None` for all of them.
    part: Option<Part>,
    doubts: Vec<OpticsDoubt>,
}

struct Computed {
    map: DepthMap,
    deviation: Option<(Array2<f32>, Uncertainty)>,
    reasons: Array2<u8>,
    /// Number of pixels without depth, by reason.
    lost: Vec<Lost>,
    image: Array2<f32>,
    report: Report,
    window: Window,
    findings: Vec<String>,
}

impl Inputs {
    fn read(settings: &DepthRequest, context: &Context<'_>) -> Result<Self> {
        let (optics, doubts) = optics::of_pair(settings.optics.as_deref(), &settings.far)?;
        let (optics, doubts) = match &settings.psf {
            Some(source) => {
                optics::check_new_psf(&optics, source)?;
                let doubts = doubts.into_iter().filter(|doubt| *doubt != OpticsDoubt::NoPsf).collect();
                (optics.with_psf(source.read(context)?), doubts)
            }
            None => (optics, doubts),
        };
        settings.write.check(&optics)?;
        let reading = ReadSettings { grey: settings.grey, white_level: settings.white_level };
        let mut pair = Pair::read(&settings.far, &settings.near, &reading)?;
        let mut doubts = doubts;
        doubts.extend(optics::another_size(&optics, pair.far.dim()));
        if let (Some(bin @ 2..), Some(stage)) = (settings.bin, optics.stage()) {
            let expected = format!(
                "the optics of calibrate stack average {0} x {0} pixels by themselves: give no bin",
                stage.bin
            );
            return Err(WorkflowError::parameter("bin", bin, expected));
        }
        if let (Some(region), Some(stage)) = (settings.region, optics.stage())
            && stage.bin > 1
        {
            let expected =
                format!("the optics of calibrate stack average {0} x {0} pixels: give no region", stage.bin);
            return Err(WorkflowError::parameter("region", region, expected));
        }
        if let Some(frames) = settings.camera_frames.as_ref().filter(|_| pair.is_without_dark) {
            let expected = "the dark signal of this capture was subtracted with its ambient light or by camera frames: give no \
                            camera frames";
            return Err(WorkflowError::parameter("camera-frames", frames.display(), expected));
        }
        let image = pair.far.dim();
        let bin = settings.bin_for(&optics, is_mosaic(pair.far.view()), &mut doubts);
        if bin > 1 {
            let [far, near] = [&mut pair.far, &mut pair.near].map(|image| binned(std::mem::take(image), bin));
            (pair.far, pair.near) = (far, near);
            pair.coding_variance /= (bin * bin) as f64;
        }
        let optics = optics.binned(bin);
        let around = optics.distortion().is_none().then_some(AROUND_PX);
        let cut = settings.region.map(|region| Cut::out_of(&mut pair, region, around)).transpose()?;
        let bins = bin * optics.stage().map_or(1, |stage| stage.bin);
        let part = cut.map(|cut| cut.part()).or_else(|| Part::of_bins(image, bins));
        let method =
            Prepared::new(settings.method(), settings.operators.as_deref(), &optics, &context.cache)?;
        let correction =
            settings.correction.as_deref().map(|file| context.cache.correction(file)).transpose()?;
        if let Some(correction) = &correction {
            correction.check_range(&optics.working_range())?;
        }
        let camera =
            settings.camera_frames.as_deref().map(|folder| context.cache.camera(folder)).transpose()?;
        let camera = match (camera, &cut) {
            (Some(frames), Some(cut)) => Some(Arc::new(cut.frames(&frames)?)),
            (camera, _) => camera,
        };
        // The frames have the scale of the files.
        let camera = match camera {
            Some(frames) if pair.white != 1.0 => {
                Some(Arc::new(Arc::unwrap_or_clone(frames).relative_to(pair.white)))
            }
            camera => camera,
        };
        Ok(Self { optics, pair, method, correction, camera, cut, part, doubts })
    }

    /// Takes the images out of `self` to release their memory early.
    fn compute(&mut self, settings: &DepthRequest, context: &Context<'_>) -> Result<Computed> {
        let cancel = |during| context.cancel.check(during);
        cancel("reading the pair")?;
        let real = self.settings(settings);
        let found = measure_pair(
            [&mut self.pair.far, &mut self.pair.near].map(std::mem::take),
            &self.optics,
            self.method.as_real(),
            self.camera.as_deref(),
            &real,
        )
        .about(|| format!("{} and {}", settings.far.display(), settings.near.display()))?;
        cancel("computing depth")?;
        let curved = tone::doubt(&found.prepared.far, &found.prepared.near);
        let (mut map, Validity { mut reasons, mut lost, deviation_mm, .. }) = (found.map, found.validity);
        let mut deviation = settings
            .uncertainty
            .map(|noise| noise::corrected(noise, deviation_mm, &map, self.correction.as_deref()))
            .transpose()?;
        cancel("computing its deviation")?;
        let mut image =
            if settings.write.show_image() { found.prepared.far } else { Array2::default((0, 0)) };
        if let Some(cut) = &self.cut {
            [&mut map.depth_mm, &mut map.confidence, &mut image].into_iter().for_each(|map| cut.wanted(map));
            cut.wanted(&mut reasons);
            if let Some(filled) = &mut map.filled {
                cut.wanted(filled);
            }
            if let Some((deviation, _)) = &mut deviation {
                cut.wanted(deviation);
            }
            lost = lost_pixels(&reasons);
        }
        if let Some(correction) = &self.correction {
            correct(&mut map, &mut reasons, correction)?;
            if real.run.fill && real.run.fill_by == FillBy::Thesis {
                refill_as_thesis(&mut map);
            }
            lost = lost_pixels(&reasons);
        }
        let mut findings: Vec<String> = self.doubts.iter().map(ToString::to_string).collect();
        findings.extend(found.findings.iter().map(ToString::to_string));
        findings.extend(curved);
        let beyond = |lost: &&Lost| lost.reason == Reason::BeyondCorrection && lost.fraction > LEAST_REPORTED;
        findings.extend(lost.iter().find(beyond).map(|lost| Finding::Lost(*lost).to_string()));
        if !found.findings.iter().any(Finding::is_swapped) {
            findings.extend(pair::swapped_by_names(&settings.far, &settings.near));
        }
        let report = found.report;
        Ok(Computed { map, deviation, reasons, lost, image, report, window: real.window, findings })
    }

    fn settings(&self, request: &DepthRequest) -> MeasureSettings {
        let limits = match self.pair.samples {
            Samples::Integer(_) => Some([0.0, 1.0]),
            Samples::Float => None,
        };
        let noise = request.uncertainty.and_then(|noise| noise.of_camera(self.pair.samples));
        MeasureSettings {
            prepare: PrepareSettings {
                limits,
                noise,
                coding: self.pair.coding_variance,
                ..request.prepare()
            },
            ..request.measure(self.method.as_real())
        }
    }
}

/// Corrects a map; pixels outside the correction lose depth and confidence.
fn correct(depth: &mut DepthMap, reasons: &mut Array2<u8>, correction: &Correction) -> Result<()> {
    correction.apply_in_place(depth.depth_mm.view_mut())?;
    let pixels = depth.confidence.iter_mut().zip(&depth.depth_mm).zip(reasons);
    for ((confidence, depth_mm), reason) in pixels {
        if depth_mm.is_nan() {
            *confidence = 0.0;
            if *reason == 0 {
                *reason = Reason::BeyondCorrection.code();
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
