//! A camera's dark and flat frames in a folder: calibrated from exposures, used for depth maps.

use std::path::{Path, PathBuf};

use farnear_depth::prepare::{CameraFrames, check_saturation};
use farnear_files::{
    image_file::{encode_png, read_grey},
    map, npy,
    staging::Staging,
};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

const DARK: &str = "dark.npy";
const RESPONSE: &str = "response.npy";
const BAD: &str = "bad.png";
/// Least brightness of a flat frame relative to the brightest.
const DARKEST: f32 = 0.5;

/// Learn a camera's dark frame, the response of its pixels and its bad ones, for `farnear depth --camera-frames`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear calibrate camera --flat flat1.png flat2.png --dark dark1.png dark2.png --out camera/"
    )
)]
#[serde(default)]
pub struct CalibrateCameraRequest {
    /// Exposures of even light at about half of full scale, out of focus. Several, because their noise stays.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", num_args = 1.., required = true))]
    pub flat: Vec<PathBuf>,
    /// Exposures with the lens covered [default: black is 0].
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", num_args = 1..))]
    pub dark: Vec<PathBuf>,
    /// The folder for dark.npy, response.npy and bad.png.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Request for CalibrateCameraRequest {
    const NAME: &'static str = "calibrate camera";
    const REQUIRED: &'static [&'static str] = &["flat", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("flat", PathKind::Input), ("dark", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = CameraFigures;

    fn run(&self, context: &Context<'_>) -> Result<CameraFigures> {
        calibrate(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CameraFigures {
    pub width: usize,
    pub height: usize,
    /// Mean value in the dark, 1 = full scale.
    pub dark_mean: f64,
    pub response_sd_percent: f64,
    pub bad_pixels: usize,
}

pub fn calibrate(settings: &CalibrateCameraRequest, context: &Context<'_>) -> Result<CameraFigures> {
    let read = |files: &[PathBuf], kind| -> Result<Vec<Array2<f32>>> {
        let mut exposures = Vec::with_capacity(files.len());
        for (index, file) in files.iter().enumerate() {
            context.cancel.check("reading the exposures")?;
            let image = read_grey(file)?;
            let holes = image.pixels.iter().filter(|value| !value.is_finite()).count();
            if holes > 0 {
                let expected =
                    format!("expected a value in each pixel, but {holes} have none (NaN or transparent)");
                return Err(WorkflowError::parameter(kind, file.display(), expected));
            }
            if let Some(white) = image.white_level {
                check_saturation(kind, index + 1, &image.pixels, white)?;
            }
            exposures.push(image.pixels);
        }
        Ok(exposures)
    };
    let (dark, flat) = (read(&settings.dark, "dark")?, read(&settings.flat, "flat")?);
    check_flats(&flat, &settings.flat)?;
    let frames = CameraFrames::learn(&dark, &flat)?;
    let staged = Staging::into_folder(&settings.out)?;
    staged.write(DARK, &npy::write(frames.dark()))?;
    staged.write(RESPONSE, &npy::write(frames.response()))?;
    let bad = frames.bad_pixels().mapv(|bad| if bad { 255 } else { 0 });
    staged.write(BAD, &encode_png(bad.view(), 8)?)?;
    context.cancel.check("writing the frames")?;
    staged.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    let (height, width) = frames.response().dim();
    Ok(CameraFigures {
        width,
        height,
        dark_mean: rounded(f64::from(frames.dark().mean().unwrap_or(f32::NAN)), 6),
        response_sd_percent: rounded(100.0 * f64::from(frames.response().std(0.0)), 4),
        bad_pixels: frames.bad_count(),
    })
}

/// Fails if two flat frames are one image, or one is much darker than the brightest.
fn check_flats(flats: &[Array2<f32>], files: &[PathBuf]) -> Result<()> {
    let refused = |index: usize, expected: String| {
        Err(WorkflowError::parameter("flat", files[index].display(), expected))
    };
    let means: Vec<f32> = flats.iter().map(|flat| flat.mean().unwrap_or(0.0)).collect();
    let brightest = means.iter().copied().fold(0.0, f32::max);
    for (index, flat) in flats.iter().enumerate() {
        if let Some(same) = flats[..index].iter().position(|other| other == flat) {
            let same = files[same].display();
            return refused(index, format!("it is the same image as {same}, and adds nothing: leave it out"));
        }
        let mean = means[index];
        if mean < DARKEST * brightest {
            return refused(
                index,
                format!(
                    "its mean is {mean:.3} of full scale, the brightest flat frame has {brightest:.3}: all need one exposure; \
                     a dark frame belongs to --dark"
                ),
            );
        }
    }
    Ok(())
}

pub fn read(folder: &Path) -> Result<CameraFrames> {
    if !folder.is_dir() {
        let none = std::io::Error::new(std::io::ErrorKind::NotFound, "no such folder");
        return Err(WorkflowError::read("the camera's frames", folder)(none));
    }
    let dark = map::read(&folder.join(DARK))?;
    let response = map::read(&folder.join(RESPONSE))?;
    let bad = map::read_mask(&folder.join(BAD))?;
    Ok(CameraFrames::new(dark, response, bad)?)
}
