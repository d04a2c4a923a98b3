//! A depth map from a far- and a near-focused image, in a folder with its confidence and what made it.

pub mod method;
pub mod noise;
pub mod output;
mod pair;
mod record;

use std::{path::PathBuf, time::Instant};

use farnear_depth::{
    corrections::Correction,
    optics::Optics,
    pipeline::{DepthMap, Settings},
};
use ndarray::Array2;
use serde::Serialize;

use crate::{
    context::Context,
    correction_file,
    error::{About, Result, WorkflowError},
    figures::rounded,
    optics,
};
use method::{Method, Prepared};
use noise::{CameraNoise, Source, Uncertainty};
use output::{Outputs, Results};
use pair::Pair;

/// What depth is computed from, how, and where it goes.
#[derive(Clone, Debug)]
pub struct DepthSettings {
    /// The far-focused image: PNG, TIFF (8, 16 bit, float), JPEG or PGM.
    pub far: PathBuf,
    /// The near-focused image.
    pub near: PathBuf,
    /// The optics file; without it what `capture.toml` or `optics.toml` beside the far image says.
    pub optics: Option<PathBuf>,
    /// Name (family:design) or file of the operators; without it they are designed for the optics.
    pub operators: Option<PathBuf>,
    /// How.
    pub method: Method,
    /// Windows, filling and threads.
    pub computation: Settings,
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
    settings.check()?;
    let inputs = Inputs::read(settings)?;
    let start = Instant::now();
    let computed = inputs.compute(settings, context)?;
    let seconds = start.elapsed().as_secs_f64();
    let warnings = pair::warnings(&computed.map.warnings, &settings.far, &settings.near);
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
        uncertainty: computed.deviation.map(|(_, found)| found),
        warnings,
    })
}

impl DepthSettings {
    /// Finds what contradicts itself.
    fn check(&self) -> Result<()> {
        let Method::Baseline(method) = self.method else { return Ok(()) };
        if let Some(asked) = &self.operators {
            return Err(WorkflowError::parameter(
                "operators",
                asked.display(),
                format!("method {method} uses none"),
            ));
        }
        if let Some(noise) = self.uncertainty {
            let expected = format!("the standard deviation is known of method ro, not of {method}");
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
    correction: Option<Correction>,
}

/// What was computed.
struct Computed {
    map: DepthMap,
    deviation: Option<(Array2<f32>, Uncertainty)>,
}

impl Inputs {
    fn read(settings: &DepthSettings) -> Result<Self> {
        let optics = optics::of_pair(settings.optics.as_deref(), &settings.far)?;
        let pair = Pair::read(&settings.far, &settings.near)?;
        let method = Prepared::new(settings.method, settings.operators.as_deref(), &optics)?;
        let correction = settings.correction.as_deref().map(correction_file::read).transpose()?;
        if let Some(correction) = &correction {
            correction.check_range(&optics.working_range())?;
        }
        Ok(Self { optics, pair, method, correction })
    }

    fn compute(&self, settings: &DepthSettings, context: &Context<'_>) -> Result<Computed> {
        let cancel = |during| context.cancel.check(during);
        cancel("reading the pair")?;
        let mut map = self
            .method
            .depth(&self.pair, &self.optics, &settings.computation)
            .about(|| format!("{} and {}", settings.far.display(), settings.near.display()))?;
        cancel("computing depth")?;
        let deviation = match (settings.uncertainty, self.method.operators()) {
            (Some(noise), Some(operators)) => {
                let Self { pair, optics, .. } = self;
                let source = Source { pair, operators, optics, settings: &settings.computation };
                Some(noise::deviation(noise, &source, &map, self.correction.as_ref())?)
            }
            _ => None,
        };
        cancel("computing its deviation")?;
        if let Some(correction) = &self.correction {
            correct(&mut map, correction)?;
        }
        Ok(Computed { map, deviation })
    }
}

/// Corrects a map; what lies beyond the correction loses depth and confidence alike.
fn correct(depth: &mut DepthMap, correction: &Correction) -> Result<()> {
    correction.apply_in_place(depth.depth_mm.view_mut())?;
    for (confidence, depth_mm) in depth.confidence.iter_mut().zip(&depth.depth_mm) {
        if depth_mm.is_nan() {
            *confidence = 0.0;
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
        for (name, factor) in [("near.png", 7919), ("far.png", 104_729)] {
            let pixels = Array2::from_shape_fn((48, 64), |(y, x)| ((y * 31 + x * 17) * factor % 251) as u16);
            fs::write(folder.join(name), encode_png(pixels.view(), 8).unwrap()).unwrap();
        }
        DepthSettings {
            far: folder.join("near.png"),
            near: folder.join("far.png"),
            optics: None,
            operators: None,
            method: Method::default(),
            computation: Settings::default(),
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
