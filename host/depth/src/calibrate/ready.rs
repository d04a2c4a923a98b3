//! A pair for calibration: the lens' distortion taken out, the near image laid on the far one.

use ndarray::Array2;

use crate::optics::Optics;
use crate::prepare::band::without_holes;
use crate::prepare::{Align, Balance, PrepareError, PrepareSettings, Report, prepare_owned};

/// The images `[far, near]` of a target as [`fit_psf`](super::fit_psf) needs them, with a report. An image that shifts
/// against the other takes from what both share, which a wider PSF would explain as well: 1 px makes a `k` of 0.516 from 0.458.
/// Pixels beyond an image's edge are set to the mean; windows suppress them. Images that do not fit together or have missing
/// pixels stay as they are, so that the fit names them.
///
/// # Errors
/// [`PrepareError`].
pub fn made_ready(
    images: [Array2<f32>; 2],
    optics: &Optics,
    align: Align,
) -> Result<([Array2<f32>; 2], Report), PrepareError> {
    let whole = images.iter().all(|image| image.iter().all(|value| value.is_finite()));
    if !whole || images[0].dim() != images[1].dim() {
        return Ok((images, Report::default()));
    }
    // Nothing that moves has a place before a target; and a blank pair is the fit's to name.
    let settings =
        PrepareSettings { align, balance: Balance::Auto, trust: true, ..PrepareSettings::default() };
    let prepared = prepare_owned(images, optics, None, &settings)?;
    let [far, near] = [prepared.far, prepared.near].map(|image| without_holes(image.view()).into_owned());
    Ok(([far, near], prepared.report))
}
