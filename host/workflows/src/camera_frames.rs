//! A camera's dark and flat frames in a folder: calibrated from exposures, used for depth maps.

use std::path::{Path, PathBuf};

use farnear_depth::prepare::{CameraFrames, check_saturation};
use farnear_files::{
    image_file::{Samples, encode_png, read_grey},
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
const DARKEST: f64 = 0.5;
/// Largest distance of a dark frame's mean from the darkest one's, relative to the flat frames' mean: dark current may differ by some
/// per cent, a frame with light by much more.
const UNLIKE: f64 = 0.05;
/// Fraction of pixels with the largest value above which a flat frame is clipped or without noise.
const CLIPPED: f64 = 0.5;
/// Part of full scale below which light is weak: a step of 8 bits is then more than 4 % of it.
const WEAK: f64 = 0.1;

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
    let flat = Exposures::read("flat", &settings.flat, context)?;
    let dark = Exposures::read("dark", &settings.dark, context)?;
    flat.check(&flat)?;
    dark.check(&flat)?;
    let brightest = flat.means.iter().copied().fold(0.0, f64::max);
    flat.check_means(
        "brightest",
        brightest,
        DARKEST * brightest,
        "one exposure; a dark frame belongs to --dark",
    )?;
    let darkest = dark.means.iter().copied().fold(f64::INFINITY, f64::min);
    dark.check_means(
        "darkest",
        darkest,
        UNLIKE * flat.mean(),
        "one exposure and the lens covered; a flat frame belongs to --flat",
    )?;
    flat.check_values()?;
    let frames = CameraFrames::learn(&dark.images, &flat.images)?;
    doubts(&flat, &dark).iter().for_each(|doubt| context.progress.warn(doubt));
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

/// Exposures of one kind, with their means.
struct Exposures<'a> {
    kind: &'static str,
    files: &'a [PathBuf],
    images: Vec<Array2<f32>>,
    means: Vec<f64>,
    are_integers: bool,
    /// Variance of a pixel by lossy compression.
    coding: Vec<f64>,
}

impl<'a> Exposures<'a> {
    /// Fails for an exposure with pixels without a value, or saturated ones.
    fn read(kind: &'static str, files: &'a [PathBuf], context: &Context<'_>) -> Result<Self> {
        let mut found = Self {
            kind,
            files,
            images: Vec::new(),
            means: Vec::new(),
            are_integers: true,
            coding: Vec::new(),
        };
        for (index, file) in files.iter().enumerate() {
            context.cancel.check("reading the exposures")?;
            let image = read_grey(file)?;
            let holes = image.pixels.iter().filter(|value| !value.is_finite()).count();
            if holes > 0 {
                let expected =
                    format!("expected a value in each pixel, but {holes} have none (NaN or transparent)");
                return found.refused(index, expected);
            }
            if let Some(white) = image.white_level {
                check_saturation(kind, index + 1, &image.pixels, white)?;
            }
            found.means.push(mean(image.pixels.iter().map(|value| f64::from(*value))));
            found.are_integers &= image.samples != Samples::Float;
            found.coding.push(image.coding_variance);
            found.images.push(image.pixels);
        }
        Ok(found)
    }

    fn refused<T>(&self, index: usize, expected: String) -> Result<T> {
        Err(WorkflowError::parameter(self.kind, self.files[index].display(), expected))
    }

    fn mean(&self) -> f64 {
        mean(self.means.iter().copied())
    }

    /// Fails if one has another size than the first flat frame, or if two are one image; only frames of one value may be.
    fn check(&self, flat: &Self) -> Result<()> {
        let Some((first, file)) = flat.images.first().zip(flat.files.first()) else { return Ok(()) };
        let (rows, columns) = first.dim();
        for (index, image) in self.images.iter().enumerate() {
            let (height, width) = image.dim();
            if (height, width) != (rows, columns) {
                let first = file.display();
                let expected = format!(
                    "it has {width}x{height} pixels, and {first} {columns}x{rows}: take all in the camera's mode of the images"
                );
                return self.refused(index, expected);
            }
            let same = self.images[..index].iter().position(|other| other == image);
            let value = image.iter().next();
            if let Some(same) = same.filter(|_| image.iter().any(|other| Some(other) != value)) {
                let same = self.files[same].display();
                let expected = format!("it is the same image as {same}, and adds nothing: leave it out");
                return self.refused(index, expected);
            }
        }
        Ok(())
    }

    /// Fails for a frame that is clipped at any level, or without noise.
    fn check_values(&self) -> Result<()> {
        for (index, image) in self.images.iter().enumerate() {
            let largest = image.iter().copied().fold(0.0, f32::max);
            let clipped = image.iter().filter(|value| **value == largest).count() as f64 / image.len() as f64;
            if clipped > CLIPPED {
                let expected = format!(
                    "{:.0} % of its pixels have its largest value, {largest:.3} of full scale: it is saturated, or rounding hides the \
                     response of the pixels; expose to about half of full scale and save all bits of the camera",
                    100.0 * clipped
                );
                return self.refused(index, expected);
            }
        }
        Ok(())
    }

    /// Fails if a mean is farther than `most` from that of the darkest or the brightest frame.
    fn check_means(&self, which: &str, reference: f64, most: f64, advice: &str) -> Result<()> {
        let off = |index: &usize| (self.means[*index] - reference).abs();
        let farthest = (0..self.means.len()).max_by(|a, b| off(a).total_cmp(&off(b)));
        let Some(index) = farthest.filter(|index| off(index) > most) else { return Ok(()) };
        let (kind, mean) = (self.kind, self.means[index]);
        let expected = format!(
            "its mean is {mean:.3} of full scale, the {which} {kind} frame has {reference:.3}: all need {advice}"
        );
        self.refused(index, expected)
    }
}

/// 0 without values.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// Warnings of light that is too weak for rounded values, and of lossy compression.
fn doubts(flat: &Exposures<'_>, dark: &Exposures<'_>) -> Vec<String> {
    let mut found = Vec::new();
    let light = flat.mean() - dark.mean();
    if flat.are_integers && light < WEAK {
        found.push(format!(
            "the flat frames are {:.1} % of full scale above black: noise and rounding then hide the response of the pixels; expose to \
             about half of full scale (unless the camera uses only the lower of the files' bits)",
            100.0 * light
        ));
    }
    let files = [flat, dark].into_iter().flat_map(|of| of.coding.iter().zip(of.files));
    let compressed: Vec<_> = files.filter(|(variance, _)| **variance > 0.0).collect();
    if let Some((variance, file)) = compressed.iter().max_by(|a, b| a.0.total_cmp(b.0)) {
        found.push(format!(
            "lossy compression (JPEG) removes detail of the pixels' response, {:.1} % of the flat frames' mean in {} (compressed frames: \
             {}): save PNG or TIFF",
            100.0 * variance.sqrt() / flat.mean(),
            file.display(),
            compressed.len()
        ));
    }
    found
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Heard;

    struct Bench(tempfile::TempDir);

    impl Bench {
        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        /// An even exposure of (height, width) with noise, as PNG of 16 bits.
        fn exposure(&self, name: &str, (height, width): (usize, usize), [mean, noise]: [f64; 2]) -> PathBuf {
            let seed = name.bytes().fold(7_u32, |seed, byte| seed.wrapping_mul(31).wrapping_add(byte.into()));
            let codes = Array2::from_shape_fn((height, width), |(y, x)| {
                let mut hash = seed ^ (y * 7919 + x * 104_729) as u32;
                hash = (hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d);
                let value = f64::from(hash ^ (hash >> 13)) / f64::from(u32::MAX) - 0.5;
                (65535.0 * (mean + noise * value)) as u16
            });
            let path = self.path(name);
            std::fs::write(&path, encode_png(codes.view(), 16).unwrap()).unwrap();
            path
        }

        fn flat(&self, name: &str) -> PathBuf {
            self.exposure(name, SIZE, [0.5, 0.02])
        }

        fn dark(&self, name: &str) -> PathBuf {
            self.exposure(name, SIZE, [0.01, 0.004])
        }

        /// The warnings.
        fn calibrate(&self, flat: &[&PathBuf], dark: &[&PathBuf]) -> Result<Vec<String>> {
            let (found, said) = self.tried(flat, dark);
            found.map(|_| said)
        }

        fn tried(&self, flat: &[&PathBuf], dark: &[&PathBuf]) -> (Result<CameraFigures>, Vec<String>) {
            let [flat, dark] = [flat, dark].map(|files| files.iter().copied().cloned().collect());
            let heard = Heard::default();
            let request = CalibrateCameraRequest { flat, dark, out: self.path("out") };
            let found = calibrate(&request, &heard.context());
            (found, heard.warnings())
        }

        fn refused(&self, flat: &[&PathBuf], dark: &[&PathBuf], phrases: [&str; 3]) {
            let error = self.calibrate(flat, dark).unwrap_err();
            assert!(error.is_usage(), "{error}");
            for phrase in phrases {
                assert!(error.to_string().contains(phrase), "{phrase:?}: {error}");
            }
        }
    }

    const SIZE: (usize, usize) = (60, 80);

    #[test]
    fn an_exposure_that_differs_from_the_others_is_refused_by_name() {
        let bench = Bench(tempfile::tempdir().unwrap());
        let [a, b, c] = ["a.png", "b.png", "c.png"].map(|name| bench.flat(name));
        let [d, e, f] = ["d.png", "e.png", "f.png"].map(|name| bench.dark(name));
        assert_eq!(bench.calibrate(&[&a, &b], &[&d, &e, &f]).unwrap(), [""; 0]);
        bench.refused(&[&a, &b], &[&d, &c, &e, &f], ["dark", "c.png: its mean is 0.500", "--flat"]);
        bench.refused(&[&a, &b], &[&d, &c], ["dark", "c.png: its mean is 0.500", "dark frame has 0.010"]);
        bench.refused(&[&a], &[&b, &c, &d], ["dark", "its mean is 0.500", "dark frame has 0.010"]);
        bench.refused(&[&a, &d, &b], &[], ["flat", "d.png: its mean is 0.010", "--dark"]);
        bench.refused(&[&a, &b], &[&d, &e, &d], ["dark", "d.png", "the same image"]);
        bench.refused(&[&a, &a], &[&d], ["flat", "a.png", "the same image"]);
        let small = bench.exposure("small.png", (30, 80), [0.5, 0.02]);
        bench.refused(&[&a, &small], &[&d], ["flat", "small.png: it has 80x30 pixels", "a.png 80x60"]);
        bench.refused(&[&a, &b], &[&d, &small], ["dark", "small.png: it has 80x30 pixels", "a.png 80x60"]);
    }

    #[test]
    fn a_camera_that_clips_at_black_has_equal_dark_frames() {
        let bench = Bench(tempfile::tempdir().unwrap());
        let flat = bench.flat("a.png");
        // Two codes of 8 bits.
        for level in [0.0, 2.0 / 255.0] {
            let [black, again] = ["d.png", "e.png"].map(|name| bench.exposure(name, SIZE, [level, 0.0]));
            assert_eq!(bench.calibrate(&[&flat], &[&black, &again]).unwrap(), [""; 0]);
        }
    }

    #[test]
    fn a_flat_frame_without_noise_is_refused() {
        let bench = Bench(tempfile::tempdir().unwrap());
        let [good, dark] = [bench.flat("a.png"), bench.dark("d.png")];
        let clipped = bench.exposure("clipped.png", SIZE, [0.97, 0.0]);
        let phrase = "clipped.png: 100 % of its pixels have its largest value, 0.970";
        bench.refused(&[&clipped], &[&dark], ["flat", phrase, "half of full scale"]);
        let even = bench.exposure("even.png", SIZE, [0.4, 0.0]);
        bench.refused(&[&good, &even], &[&dark], ["flat", "even.png: 100 %", "all bits"]);
    }

    #[test]
    fn weak_light_and_lossy_compression_are_told_with_their_size() {
        let bench = Bench(tempfile::tempdir().unwrap());
        let dark = bench.dark("d.png");
        let weak = bench.exposure("weak.png", SIZE, [0.03, 0.002]);
        let [said] = &bench.calibrate(&[&weak], &[&dark]).unwrap()[..] else { panic!("one warning") };
        assert!(said.contains("2.0 % of full scale above black"), "{said}");
        // Floats have any scale.
        let float = bench.path("float.tiff");
        let pixels = read_grey(&weak).unwrap().pixels;
        std::fs::write(&float, map::Format::Tiff.encode(pixels.view()).unwrap()).unwrap();
        assert_eq!(bench.calibrate(&[&float], &[&dark]).unwrap(), [""; 0]);
        // An error says more.
        let as_bright = bench.exposure("e.png", SIZE, [0.03, 0.002]);
        let (found, said) = bench.tried(&[&weak], &[&as_bright]);
        assert!(found.is_err() && said.is_empty(), "{said:?}");
        let flat = bench.exposure("a.png", SIZE, [0.5, 0.1]);
        let jpeg = bench.path("a.jpg");
        image::open(&flat).unwrap().into_luma8().save(&jpeg).unwrap();
        let [said] = &bench.calibrate(&[&jpeg], &[&dark]).unwrap()[..] else { panic!("one warning") };
        assert!(
            said.contains("compression (JPEG)") && said.contains("a.jpg (compressed frames: 1)"),
            "{said}"
        );
    }
}
