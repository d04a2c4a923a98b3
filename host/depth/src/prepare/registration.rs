//! Whether and how the near image is resampled to lie on the far one.

use super::align::{self, Alignment, Model};
use super::thinned::Thinned;
use super::warp::Warp;
use super::{Align, Aligned, SIGNIFICANT};
use crate::optics::Optics;

/// Displacement (root mean square over the image) below which a pair is not changed, px.
pub(super) const LEAST_DISPLACEMENT_PX: f64 = 0.06;
/// Correlation of the shared band from which an alignment is believed.
const BELIEVED: f64 = 0.25;

/// Registration of a near image to the far one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Registration {
    pub size: (usize, usize),
    /// `None` if the image is not resampled.
    pub warp: Option<Warp>,
    pub aligned: Option<Aligned>,
    pub looks_not_telecentric: bool,
}

impl Registration {
    /// Registers the near image to the far one.
    pub(super) fn find(pair: &Thinned, size: (usize, usize), optics: &Optics, align: Align) -> Self {
        let stays = Self { size, warp: None, aligned: None, looks_not_telecentric: false };
        let of_optics = || Warp::about_middle(size, optics.magnification_ratio(), 0.0, [0.0; 2]);
        let start = match (align, optics.telecentric()) {
            (Align::None, _) => return stays,
            (Align::Optics, _) | (_, Some(false)) => of_optics(),
            _ => Warp::IDENTITY,
        };
        // A displacement that cannot be significant needs no search.
        let in_place = |model: &Model| {
            align == Align::Auto
                && align::displaced(pair, *model, start, size).is_some_and(|px| px < LEAST_DISPLACEMENT_PX)
        };
        let found = model(align)
            .filter(|model| !in_place(model))
            .and_then(|model| align::estimate_thinned(pair, model, start))
            .filter(|found| {
                let beyond_doubt = align != Align::Auto || significant(found, &start, size);
                beyond_doubt && found.correlation > BELIEVED
            });
        let warp = found.map_or(start, |found| found.warp);
        if warp == Warp::IDENTITY {
            return stays;
        }
        let [of_lens, found_ratio] = [optics.magnification_ratio(), warp.magnification()];
        Self {
            size,
            warp: Some(warp),
            aligned: Some(Aligned {
                shift_px: warp.shift_of_middle_px(size),
                magnification: warp.magnification(),
                rotation_deg: warp.rotation_deg(),
                displacement_px: warp.rms_px(size),
                standard_error_px: found.map(|found| found.standard_error_px),
            }),
            looks_not_telecentric: optics.telecentric().is_none()
                && found.is_some_and(|_| (found_ratio - of_lens).abs() < 0.25 * (of_lens - 1.0)),
        }
    }
}

/// The parameters to estimate; `None` for no registration.
pub(super) fn model(align: Align) -> Option<Model> {
    match align {
        Align::Shift => Some(Model::Shift),
        Align::Affine => Some(Model::Affine),
        Align::Auto | Align::Similarity => Some(Model::Similarity),
        Align::None | Align::Optics => None,
    }
}

/// Whether the result differs from the start by more than chance and by more than matters.
fn significant(found: &Alignment, start: &Warp, size: (usize, usize)) -> bool {
    let Some(back) = start.inverse() else { return false };
    let displacement = found.warp.after(&back).rms_px(size);
    displacement > LEAST_DISPLACEMENT_PX
        && displacement > SIGNIFICANT * found.standard_error_px
        && found.correlation > found.correlation_before
}
