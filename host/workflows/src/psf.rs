//! Point spread functions given by name or as an image file.

use std::path::{Path, PathBuf};

use farnear_depth::psf::{Psf, RadialPsf};
use farnear_files::{
    image_file::{self, Samples},
    map,
    video::pictures,
};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Share of an image's energy that is not rotationally symmetric, above which a warning is given.
const NOT_ROUND: f64 = 0.1;

#[derive(Clone, PartialEq, Debug)]
pub enum PsfSource {
    Named(Psf),
    Image {
        /// A picture or a .npy.
        file: PathBuf,
        /// Blur radius (edge of the aperture) in pixels of the image. Default: half of the shorter side.
        radius_px: Option<f64>,
    },
}

#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error(
    "{0}; or a file with an image of it: FILE.png or FILE.npy, and ,radius=PX where the blur radius is not half its shorter side"
)]
pub struct NoPsf(String);

impl std::str::FromStr for PsfSource {
    type Err = NoPsf;

    fn from_str(text: &str) -> std::result::Result<Self, NoPsf> {
        let (file, radius) = text.rsplit_once(",radius=").map_or((text, None), |(file, px)| (file, Some(px)));
        let ending = Path::new(file).extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let is_image = ending
            .is_some_and(|ending| pictures::EXTENSIONS.iter().chain(&["npy"]).any(|image| ending == *image));
        if !is_image {
            return text.parse().map(Self::Named).map_err(|error| NoPsf(format!("{error}")));
        }
        let radius_px = radius.map(|px| {
            let usable = px.parse().ok().filter(|px: &f64| px.is_finite() && *px >= 1.0);
            usable.ok_or_else(|| NoPsf(format!("radius = {px}, expected a number of pixels from 1")))
        });
        Ok(Self::Image { file: file.into(), radius_px: radius_px.transpose()? })
    }
}

impl std::fmt::Display for PsfSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Named(psf) => psf.fmt(f),
            Self::Image { file, radius_px } => {
                file.display().fmt(f)?;
                radius_px.map_or(Ok(()), |radius| write!(f, ",radius={radius}"))
            }
        }
    }
}

impl PsfSource {
    /// Averages an image over the angle, with a warning for a large deviation.
    pub fn read(&self, context: &Context<'_>) -> Result<Psf> {
        let (file, radius_px) = match self {
            Self::Named(psf) => return Ok(*psf),
            Self::Image { file, radius_px } => (file, *radius_px),
        };
        let is_map = file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npy"));
        let image = if is_map {
            map::read(file)?
        } else {
            let mut image = image_file::read_grey(file)?;
            // Transparent pixels (NaN) of a drawing are dark.
            if image.samples != Samples::Float {
                image.pixels.mapv_inplace(|value| value.max(0.0));
            }
            image.pixels
        };
        let drawn = RadialPsf::from_image(image.view(), radius_px)
            .map_err(|error| WorkflowError::parameter("psf", file.display(), error.to_string()))?;
        if drawn.not_round > NOT_ROUND {
            context.progress.warn(&format!(
                "{:.0} % of {} are not round: operators take its mean over each circle, and depth is biased by what the pattern's \
                 direction does to the scene's",
                100.0 * drawn.not_round,
                file.display()
            ));
        }
        Ok(Psf::Radial(drawn.psf))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_transparent_in_a_drawing_is_dark() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, outside: [u8; 4]| {
            let file = folder.path().join(name);
            let inside = |x: u32, y: u32| (f64::from(x) - 15.5).hypot(f64::from(y) - 15.5) < 14.0;
            let pixel = |x: u32, y: u32| image::Rgba(if inside(x, y) { [255; 4] } else { outside });
            image::RgbaImage::from_fn(32, 32, pixel).save(&file).unwrap();
            PsfSource::Image { file, radius_px: None }.read(&Context::unattended()).unwrap()
        };
        assert_eq!(read("clear.png", [255, 255, 255, 0]), read("black.png", [0, 0, 0, 255]));
    }

    #[test]
    fn names_are_distinguished_from_files() {
        assert_eq!("pillbox".parse(), Ok(PsfSource::Named(Psf::PillBox)));
        assert_eq!("ring:inner=0.5".parse(), Ok(PsfSource::Named(Psf::Ring { inner: 0.5 })));
        let image = |file: &str, radius_px| Ok(PsfSource::Image { file: file.into(), radius_px });
        assert_eq!("a/ring.PNG".parse(), image("a/ring.PNG", None));
        assert_eq!("psf.npy,radius=20.5".parse(), image("psf.npy", Some(20.5)));
        for wrong in ["airy", "psf.npy,radius=x", "psf.npy,radius=0.2"] {
            let error = wrong.parse::<PsfSource>().unwrap_err().to_string();
            assert!(error.contains("FILE.npy"), "{error}");
        }
    }
}
