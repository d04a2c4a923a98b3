//! Optics of a rig or a pair, from `optics.toml` or a capture's record.

mod advice;
mod expected;
mod task;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use farnear_capture::record::{CAPTURE_FILE, read_record};
use farnear_depth::{
    optics::{Doubt, LightSection, Optics, OpticsFile, USABLE_BLUR_PX},
    psf::Psf,
};
use farnear_protocol::message::LightLevels;

pub use expected::{ExpectedError, expected_error};
pub use task::{OpticsFigures, OpticsRequest};

use crate::{
    error::{About, Result, WorkflowError},
    rig::camera::light_of_percent,
    text_file,
};

pub const KIND: &str = "the optics file";

/// Largest distance of the optical axis from the middle of whole images, in their sides. A matrix for images of twice or half the size
/// is off by 0.5 or 0.25.
const OFF_CENTRE: f64 = 0.2;

#[derive(Clone, Debug)]
pub struct GivenOptics {
    pub path: PathBuf,
    pub optics: Optics,
    pub table: toml::Table,
    /// Of `[light]`, if it switches one on.
    pub light: Option<LightLevels>,
}

impl GivenOptics {
    pub fn read(path: &Path) -> Result<Self> {
        let text = text_file::read(path).map_err(WorkflowError::read(KIND, path))?;
        Self::parse(&text, path)
    }

    /// Checks optics that are part of the file `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let table = text.parse().about(|| about(path))?;
        let file: OpticsFile = toml::from_str(text).about(|| about(path))?;
        let light = file.light.map(|LightSection { first, second }| light_of_percent([first, second]));
        let wrong = |expected: String| {
            WorkflowError::parameter("light", path.display(), format!("[light]: {expected}"))
        };
        let light = light.transpose().map_err(wrong)?.filter(|levels| *levels != LightLevels::OFF);
        Ok(Self { path: path.into(), optics: file.check().about(|| about(path))?, table, light })
    }

    fn with_doubts(self) -> (Optics, Vec<OpticsDoubt>) {
        let found = doubts(&self.optics, self.table.contains_key("psf"));
        (self.optics, found)
    }

    pub fn for_emulation(&self) -> (&Path, Psf) {
        (&self.path, self.optics.psf())
    }
}

pub fn read(path: &Path) -> Result<Optics> {
    GivenOptics::read(path).map(|given| given.optics)
}

#[derive(Clone, PartialEq, Debug)]
pub enum OpticsDoubt {
    /// An implausible camera value.
    Unusual(Doubt),
    NoPsf,
    /// Width and height of the slices that the lens was learned from, and of the images.
    AnotherSize {
        slices: [usize; 2],
        images: [usize; 2],
    },
    /// Position of the optical axis in the images, by the camera matrix, and their width and height.
    OffCentre {
        centre: [f64; 2],
        images: [usize; 2],
    },
    TooMuchBlur {
        blur_px: f64,
        /// Side of the square of pixels to average.
        bin: usize,
        binned: bool,
    },
    LittleBlur {
        blur_px: f64,
        /// Side of the square of pixels that were averaged.
        bin: usize,
    },
    /// The raw mosaic of a colour sensor, which was made grey.
    Mosaic {
        /// Side of the square of pixels that were averaged.
        bin: usize,
    },
}

impl fmt::Display for OpticsDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unusual(doubt) => doubt.fmt(f),
            Self::NoPsf => f.write_str(
                "the optics name no [psf]: a pill-box is assumed, which may be wrong by millimetres; calibrate psf finds it",
            ),
            Self::AnotherSize { slices: [w, h], images: [width, height] } => write!(
                f,
                "the lens was calibrated with images of {w}x{h} px, these have {width}x{height}: right for a part of such images, \
                 wrong for scaled ones; calibrate in the mode of the images"
            ),
            Self::OffCentre { centre: [cx, cy], images: [width, height] } => write!(
                f,
                "[distortion] camera_matrix has its centre at cx = {cx}, cy = {cy}, far from the middle of these images of \
                 {width}x{height} px: right for a part of the sensor away from its middle, wrong for scaled images; give the matrix in \
                 pixels of these images"
            ),
            Self::Mosaic { bin } => write!(
                f,
                "the images look like the raw mosaic of a colour sensor: {bin} x {bin} pixels were averaged into one, which \
                 makes them grey; bin 1 keeps all pixels"
            ),
            Self::LittleBlur { blur_px, bin } => {
                if *bin > 1 {
                    write!(f, "averaging {bin} x {bin} pixels leaves ")?;
                }
                write!(
                    f,
                    "a largest blur of {blur_px:.2} px: fine texture aliases then, and depth may be off by several of its standard \
                     deviations; "
                )?;
                if *bin > 1 {
                    f.write_str("average fewer pixels, or ")?;
                }
                f.write_str("choose planes that are farther apart")
            }
            Self::TooMuchBlur { blur_px, bin, binned } => {
                write!(f, "a largest blur of {blur_px:.1} px is more than the 2 to 4 px that can be used: ")?;
                match binned {
                    true => write!(f, "{bin} x {bin} pixels were averaged into one; bin 1 keeps all pixels"),
                    false => write!(f, "average {bin} x {bin} pixels of the images into one first"),
                }
            }
        }
    }
}

/// Of the values of the optics, and of a point spread function that their file does not name.
pub fn doubts(optics: &Optics, psf_is_given: bool) -> Vec<OpticsDoubt> {
    let unusual = optics.doubts().into_iter().map(OpticsDoubt::Unusual);
    unusual.chain((!psf_is_given).then_some(OpticsDoubt::NoPsf)).collect()
}

/// From the named file, else `capture.toml` or `optics.toml` in the far image's folder.
pub fn of_pair(named: Option<&Path>, far: &Path) -> Result<(Optics, Vec<OpticsDoubt>)> {
    if let Some(path) = named {
        return GivenOptics::read(path).map(|given| given.with_doubts());
    }
    let folder = far.parent().unwrap_or(Path::new(""));
    if let Some(record) = read_record(folder)? {
        let text = toml::to_string(&record.optics)?;
        return GivenOptics::parse(&text, &folder.join(CAPTURE_FILE)).map(|given| given.with_doubts());
    }
    let beside = folder.join("optics.toml");
    if beside.exists() {
        return GivenOptics::read(&beside).map(|given| given.with_doubts());
    }
    Err(WorkflowError::NoOptics { far: far.into() })
}

/// Pixels per side to average into one for a blur that can be used; 1 = none.
pub fn usable_bin(optics: &Optics) -> usize {
    (optics.max_blur_px() / USABLE_BLUR_PX).ceil().clamp(1.0, 16.0) as usize
}

/// A doubt about a lens that was learned, or whose distortion was, from images of another size than this (height, width).
pub fn another_size(optics: &Optics, (height, width): (usize, usize)) -> Option<OpticsDoubt> {
    let images = [width, height];
    let slices = optics.stage().and_then(|stage| stage.image_px).filter(|slices| *slices != images);
    if let Some(slices) = slices {
        return Some(OpticsDoubt::AnotherSize { slices, images });
    }
    let centre = optics.unbinned().distortion()?.centre_px();
    let is_off = |(at, side): (&f64, &usize)| {
        let side = *side as f64;
        (at - 0.5 * (side - 1.0)).abs() > OFF_CENTRE * side
    };
    centre.iter().zip(&images).any(is_off).then_some(OpticsDoubt::OffCentre { centre, images })
}

/// Fails for a lens with a learned response, which holds for its own point spread function only.
pub fn check_new_psf(optics: &Optics, psf: impl ToString) -> Result<()> {
    if optics.stage().is_none() {
        return Ok(());
    }
    let expected = "the lens of calibrate stack has a response that was learned for its own point spread function: leave psf out, or \
                    give the optics file of the camera";
    Err(WorkflowError::parameter("psf", psf, expected))
}

/// `None` if [`of_pair`] reads no file.
pub(crate) fn file_of_pair(named: Option<&Path>, far: &Path) -> Option<PathBuf> {
    let folder = far.parent().unwrap_or(Path::new(""));
    let beside =
        || [CAPTURE_FILE, "optics.toml"].map(|name| folder.join(name)).into_iter().find(|file| file.exists());
    named.map(Path::to_path_buf).or_else(beside)
}

fn about(path: &Path) -> String {
    format!("the optics in {}", path.display())
}

#[cfg(test)]
mod tests {
    use farnear_depth::optics::Stage;

    use super::*;

    #[test]
    fn images_of_another_size_than_the_learned_ones_are_doubted() {
        let optics: Optics = toml::from_str(include_str!("../../../examples/rig.toml")).unwrap();
        assert_eq!(another_size(&optics, (480, 640)), None);
        let learned = optics.with_stage(Stage { image_px: Some([640, 480]), ..Stage::identity(2, 1) });
        assert_eq!(another_size(&learned, (480, 640)), None);
        let doubt = another_size(&learned, (240, 320)).unwrap().to_string();
        assert!(doubt.contains("640x480") && doubt.contains("320x240"), "{doubt}");
    }

    #[test]
    fn a_camera_matrix_for_images_of_another_size_is_doubted() {
        let doubt = |[cx, cy]: [f64; 2]| {
            let distortion = format!(
                "[distortion]\ncamera_matrix = [[1200.0, 0, {cx:?}], [0, 1200.0, {cy:?}], [0, 0, 1]]\n\
                 coefficients = [-0.3, 0.1, 0.0, 0.0]\n"
            );
            let text = format!("{}\n{distortion}", include_str!("../../../examples/rig.toml"));
            let optics: Optics = toml::from_str(&text).unwrap();
            another_size(&optics, (480, 640)).map(|doubt| doubt.to_string())
        };
        assert_eq!(doubt([318.25, 243.5]), None);
        for centre in [[639.5, 479.5], [159.5, 119.5], [-100.0, 243.5], [318.25, 350.0]] {
            let (doubt, cx) = (doubt(centre).unwrap(), format!("cx = {},", centre[0]));
            for phrase in ["[distortion] camera_matrix", &cx, "640x480"] {
                assert!(doubt.contains(phrase), "{doubt}");
            }
        }
    }
}
