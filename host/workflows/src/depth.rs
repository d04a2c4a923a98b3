//! A depth map from a far- and a near-focused image, in a folder with its confidence and what made it.

pub mod method;
pub mod noise;
pub mod output;
mod pair;
pub mod part;
mod record;
mod shared;

use std::{path::PathBuf, sync::Arc, time::Instant};

use farnear_depth::{
    adaptive_window::Window,
    corrections::Correction,
    fill::{FillBy, refill_as_thesis},
    measure::{MeasureSettings, measure_pair},
    optics::Optics,
    pipeline::{DepthMap, Settings},
    prepare::{Align, Balance, CameraFrames, PrepareSettings, Report},
    reason::Reason,
    validity::{Lost, Validity, lost_pixels},
};
use ndarray::Array2;
use serde::Serialize;

use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::rounded,
    measure::Rectangle,
    optics,
    psf::PsfSource,
};
use farnear_files::image_file::Samples;
use method::{Method, Prepared};
use noise::{CameraNoise, Source, Uncertainty};
use output::{Outputs, Results};
use pair::Pair;
use part::{AROUND_PX, Cut};

pub use shared::Shared;

/// What depth is computed from, how, and where it goes.
#[derive(Clone, Debug)]
pub struct DepthSettings {
    /// The far-focused image: PNG, TIFF (8, 16 bit, float), JPEG or PGM.
    pub far: PathBuf,
    /// The near-focused image.
    pub near: PathBuf,
    /// The optics file; without it what `capture.toml` or `optics.toml` beside the far image says.
    pub optics: Option<PathBuf>,
    /// Point spread function in place of that of the optics.
    pub psf: Option<PsfSource>,
    /// Name (family:design) or file of the operators; without it they are designed for the optics.
    pub operators: Option<PathBuf>,
    /// How.
    pub method: Method,
    /// Windows, filling and threads.
    pub computation: Settings,
    /// Over how many pixels evidence is summed; without it adaptive windows for whitened operators, and the computation's
    /// smoothing for the others.
    pub window: Option<Window>,
    /// How the near image is laid on the far one.
    pub align: Align,
    /// How both are brought to one brightness.
    pub balance: Balance,
    /// The part of the images whose depth is wanted; without it all of them.
    pub region: Option<Rectangle>,
    /// Folder with the camera's dark and flat frames.
    pub camera: Option<PathBuf>,
    /// Confidence, 0 to 1, below which a depth is taken away.
    pub min_confidence: f32,
    /// The file of a correction that the map goes through.
    pub correction: Option<PathBuf>,
    /// Whether the standard deviation of each depth is wanted, and from what noise.
    pub uncertainty: Option<CameraNoise>,
    /// What is written.
    pub write: Outputs,
    /// Folder for the results; without it the folder of a capture, else `depth` beside the far image.
    pub out: Option<PathBuf>,
}

/// What there is to say of a map.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct DepthFigures {
    /// For the depth, its deviation and its correction, without reading and writing.
    pub seconds: f64,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Median of the depths that there are; NaN where there are none.
    pub median_mm: f64,
    /// Part of the pixels with too little texture.
    pub low_texture_fraction: f64,
    /// Part of the pixels that have a depth.
    pub valid_fraction: f64,
    /// Figures of the standard deviation, where it was wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    /// What the user was warned of.
    pub warnings: Vec<String>,
}

/// Computes a depth map and writes it; the folder gets all files or, after a failure or a cancellation, none.
///
/// # Errors
/// [`WorkflowError::Parameter`] for what contradicts itself, before anything is read; then optics, images, operators,
/// correction, computation, files.
pub fn compute(settings: &DepthSettings, context: &Context<'_>) -> Result<DepthFigures> {
    compute_sharing(settings, &Shared::default(), context)
}

/// The same for one of many maps, which share what they are computed with.
///
/// # Errors
/// As [`compute`].
pub fn compute_sharing(
    settings: &DepthSettings,
    shared: &Shared,
    context: &Context<'_>,
) -> Result<DepthFigures> {
    settings.check()?;
    let mut inputs = Inputs::read(settings, shared, context)?;
    let start = Instant::now();
    let computed = inputs.compute(settings, context)?;
    let seconds = start.elapsed().as_secs_f64();
    let warnings = pair::warnings(computed.findings.clone(), &settings.far, &settings.near);
    for warning in &warnings {
        context.progress.warn(warning);
    }
    let out = settings.out.clone().unwrap_or_else(|| pair::default_folder(&settings.far));
    Results::new(settings, &inputs, &computed, &warnings)?.write(&out, context)?;
    context.say(&format!("wrote {}", out.display()));
    let (height, width) = computed.map.depth_mm.dim();
    Ok(DepthFigures {
        seconds: rounded(seconds, 6),
        width,
        height,
        median_mm: rounded(median(&computed.map.depth_mm), 3),
        low_texture_fraction: rounded(computed.map.low_texture_fraction, 6),
        valid_fraction: rounded(valid_fraction(&computed.map.depth_mm), 6),
        uncertainty: computed.deviation.map(|(_, found)| found),
        warnings,
    })
}

impl DepthSettings {
    /// Finds what contradicts itself.
    fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.min_confidence) {
            return Err(WorkflowError::parameter(
                "min-confidence",
                self.min_confidence,
                "a probability, 0 to 1",
            ));
        }
        if let (Method::Whitened, Some(asked)) = (self.method, &self.operators) {
            return Err(WorkflowError::parameter("operators", asked.display(), "method whitened uses none"));
        }
        if let (Some(_), Some(file)) = (self.region, &self.correction) {
            let expected = "a correction knows the lens by the place in the whole image: correct the whole map, or give no region";
            return Err(WorkflowError::parameter("correction", file.display(), expected));
        }
        let Method::Baseline(method) = self.method else { return Ok(()) };
        if let Some(window @ (Window::Adaptive | Window::Safe)) = self.window {
            return Err(WorkflowError::parameter(
                "window",
                window,
                format!("method {method} takes a number of pixels"),
            ));
        }
        if let Some(asked) = &self.operators {
            return Err(WorkflowError::parameter(
                "operators",
                asked.display(),
                format!("method {method} uses none"),
            ));
        }
        if let Some(noise) = self.uncertainty {
            let expected =
                format!("the standard deviation is known of methods ro and whitened, not of {method}");
            return Err(WorkflowError::parameter("uncertainty", noise, expected));
        }
        Ok(())
    }
}

/// What was read and checked.
struct Inputs {
    optics: Optics,
    pair: Pair,
    method: Prepared,
    correction: Option<Arc<Correction>>,
    camera: Option<Arc<CameraFrames>>,
    /// What of the images is looked at, where it is not all.
    cut: Option<Cut>,
    /// What there is to say of the optics.
    doubts: Vec<String>,
}

/// What was computed.
struct Computed {
    map: DepthMap,
    deviation: Option<(Array2<f32>, Uncertainty)>,
    /// Why each pixel has no depth.
    reasons: Array2<u8>,
    /// How many pixels have none, by reason.
    lost: Vec<Lost>,
    /// The far image as it was measured, where an output shows it; else empty.
    image: Array2<f32>,
    report: Report,
    window: Window,
    findings: Vec<String>,
}

impl Inputs {
    fn read(settings: &DepthSettings, shared: &Shared, context: &Context<'_>) -> Result<Self> {
        let (optics, doubts) = optics::of_pair(settings.optics.as_deref(), &settings.far)?;
        let (optics, doubts) = match &settings.psf {
            // What there is to doubt then is that there was none.
            Some(source) => {
                let doubts = doubts.into_iter().filter(|doubt| !doubt.contains("[psf]")).collect();
                (optics.with_psf(source.read(context)?), doubts)
            }
            None => (optics, doubts),
        };
        let mut pair = Pair::read(&settings.far, &settings.near)?;
        let around = optics.distortion().is_none().then_some(AROUND_PX);
        let cut = settings.region.map(|region| Cut::out_of(&mut pair, region, around)).transpose()?;
        let method = Prepared::new(settings.method, settings.operators.as_deref(), &optics, shared)?;
        let correction = settings.correction.as_deref().map(|file| shared.correction(file)).transpose()?;
        if let Some(correction) = &correction {
            correction.check_range(&optics.working_range())?;
        }
        let camera = settings.camera.as_deref().map(|folder| shared.camera(folder)).transpose()?;
        let camera = match (camera, &cut) {
            (Some(frames), Some(cut)) => Some(Arc::new(cut.frames(&frames)?)),
            (camera, _) => camera,
        };
        Ok(Self { optics, pair, method, correction, camera, cut, doubts })
    }

    /// Takes the images, which nothing needs afterwards.
    fn compute(&mut self, settings: &DepthSettings, context: &Context<'_>) -> Result<Computed> {
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
        let (mut map, validity) = (found.map, found.validity);
        let deviation = settings
            .uncertainty
            .map(|noise| {
                let Self { optics, .. } = self;
                let source = Source {
                    samples: self.pair.samples,
                    prepared: &found.prepared,
                    operators: self.method.operators().filter(|_| matches!(real.window, Window::Fixed(_))),
                    optics,
                    settings: &real.run,
                    judged: &validity.deviation_mm,
                };
                noise::deviation(noise, &source, &map, self.correction.as_deref())
            })
            .transpose()?;
        cancel("computing its deviation")?;
        let mut image =
            if settings.write.show_image() { found.prepared.far } else { Array2::default((0, 0)) };
        let Validity { mut reasons, mut lost, .. } = validity;
        let mut deviation = deviation;
        if let Some(cut) = &self.cut {
            [&mut map.depth_mm, &mut map.confidence, &mut image].into_iter().for_each(|map| cut.wanted(map));
            cut.wanted(&mut reasons);
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
        }
        let said = found.findings.iter().map(ToString::to_string);
        let findings = self.doubts.iter().cloned().chain(said).collect();
        let report = found.report;
        Ok(Computed { map, deviation, reasons, lost, image, report, window: real.window, findings })
    }

    /// As the library takes them.
    fn settings(&self, settings: &DepthSettings) -> MeasureSettings {
        let usual = match settings.method {
            Method::Whitened => Window::Adaptive,
            Method::RationalOperators | Method::Baseline(_) => {
                Window::Fixed(settings.computation.smoothing_px)
            }
        };
        let window = settings.window.unwrap_or(usual);
        let smoothing_px =
            if let Window::Fixed(side) = window { side } else { settings.computation.smoothing_px };
        let limits = match self.pair.samples {
            Samples::Integer(_) => Some([0.0, 1.0]),
            Samples::Float => None,
        };
        MeasureSettings {
            prepare: PrepareSettings {
                align: settings.align,
                balance: settings.balance,
                limits,
                trust: false,
                noise: settings.uncertainty.and_then(|noise| noise.of_camera(self.pair.samples)),
            },
            window,
            run: Settings { smoothing_px, ..settings.computation },
            least_confidence: settings.min_confidence,
        }
    }
}

/// Part of the pixels that have a depth.
fn valid_fraction(map: &Array2<f32>) -> f64 {
    map.iter().filter(|depth| depth.is_finite()).count() as f64 / map.len() as f64
}

/// Corrects a map; what lies beyond the correction loses depth and confidence alike.
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

/// Median of the values that there are, NaN where there are none.
fn median(map: &Array2<f32>) -> f64 {
    let mut finite: Vec<f32> = map.iter().copied().filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return f64::NAN;
    }
    let middle = finite.len() / 2;
    f64::from(*finite.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use farnear_files::image_file::encode_png;

    use super::*;
    use crate::context::{Cancel, Nobody, Progress};

    const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                          [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n";

    /// A pair whose names contradict its order, so that a warning stands between computing and writing.
    fn settings(folder: &Path) -> DepthSettings {
        fs::write(folder.join("optics.toml"), OPTICS).unwrap();
        for (name, spread) in [("near.png", 1), ("far.png", 2)] {
            // A texture, and the mean of it over some pixels.
            let texture = |y: usize, x: usize| 40 + (y * 31 + x * 17) * (y + 7) * 7919 % 151;
            let pixels = Array2::from_shape_fn((48, 64), |(y, x)| {
                let sum: usize = (0..spread * spread).map(|i| texture(y + i / spread, x + i % spread)).sum();
                (sum / (spread * spread)) as u16
            });
            fs::write(folder.join(name), encode_png(pixels.view(), 8).unwrap()).unwrap();
        }
        DepthSettings {
            far: folder.join("near.png"),
            near: folder.join("far.png"),
            optics: None,
            psf: None,
            operators: None,
            method: Method::default(),
            computation: Settings::default(),
            window: None,
            align: Align::default(),
            balance: Balance::default(),
            region: None,
            camera: None,
            min_confidence: 0.0,
            correction: None,
            uncertainty: None,
            write: Outputs::default(),
            out: None,
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Cancels as soon as anything is said.
    struct Impatient(Cancel);

    impl Progress for Impatient {
        fn say(&self, _: &str) {
            self.0.cancel();
        }
    }

    #[test]
    fn a_cancelled_map_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let settings = settings(folder.path());
        let before = names(folder.path());
        let early = Context::unattended();
        early.cancel.cancel();
        let late = Cancel::default();
        let impatient = Impatient(late.clone());
        let late = Context { progress: &impatient, questions: &Nobody, cancel: late };
        for (context, stage) in [(&early, "reading the pair"), (&late, "writing the results")] {
            let error = compute(&settings, context).unwrap_err();
            assert!(matches!(&error, WorkflowError::Cancelled { during } if during == stage), "{error}");
            assert_eq!(names(folder.path()), before, "{stage}");
        }
        compute(&settings, &Context::unattended()).unwrap();
        assert!(folder.path().join("depth/depth.toml").exists());
    }

    #[test]
    fn what_a_method_has_no_use_for_is_bad_usage() {
        let folder = tempfile::tempdir().unwrap();
        let other = Method::Baseline(farnear_depth::baselines::Method::Subbarao);
        let settings = DepthSettings { method: other, ..settings(folder.path()) };
        for settings in [
            DepthSettings { operators: Some("gro".into()), ..settings.clone() },
            DepthSettings { uncertainty: Some(CameraNoise::Estimated), ..settings },
        ] {
            let error = compute(&settings, &Context::unattended()).unwrap_err();
            assert!(error.is_usage(), "{error}");
        }
    }
}
