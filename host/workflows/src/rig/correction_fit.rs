//! The board fits a depth correction to flat targets, and this computer checks its bits.

use std::path::PathBuf;

use farnear_capture::board_correction::{CodedTarget, encode};
use farnear_depth::corrections::{CorrectionError, Method};
use farnear_maths::clsf::{Columns, DepthScale, Error, Frame, FullFit, RegionFit};
use ndarray::Array2;
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{
    calibrate::correction,
    context::Context,
    error::{Result, WorkflowError},
};

#[derive(Clone, PartialEq, Debug)]
pub struct FitSettings {
    pub rig: RigAddress,
    /// The list of depth maps; see [`correction::read`].
    pub patterns: PathBuf,
    /// Which correction; the board knows [`Method::board_names`].
    pub method: Method,
    /// Step in columns and rows between the pixels used.
    pub step: u16,
    /// Whether the board keeps the correction in its memory, if its bits are right.
    pub store: bool,
}

/// What there is to say of a fit.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct FitFigures {
    pub method: String,
    pub targets: usize,
    /// Pixels that were taken of all of them.
    pub samples: usize,
    /// Coefficients of the correction.
    pub coefficients: usize,
    /// Coefficients that differ from this computer's.
    pub different: usize,
    /// Whether the board has stored it.
    pub stored: bool,
}

impl FitFigures {
    pub fn check(&self) -> Result<()> {
        match self.different {
            0 => Ok(()),
            different => Err(WorkflowError::Differs(format!("{different} coefficients; nothing was stored"))),
        }
    }
}

/// Sends the maps row by row, lets the board fit, and compares its coefficients with the same calculation here.
pub fn fit(settings: &FitSettings, context: &Context<'_>) -> Result<FitFigures> {
    if settings.method.board_form().is_none() {
        let expected = format!("the board fits {}", Method::board_names());
        return Err(WorkflowError::parameter("method", settings.method, expected));
    }
    let maps = correction::read(&settings.patterns)?;
    let (frame, scale) = frame_and_scale(&maps)?;
    let targets: Vec<CodedTarget> = maps
        .iter()
        .map(|(map, true_mm)| CodedTarget {
            codes: encode(map.view(), scale),
            truth: scale.encode(*true_mm as f32),
        })
        .collect();
    let rig = Rig::connect(&settings.rig, None, context)?;
    let rows = targets.len() * usize::from(frame.height().div_ceil(settings.step));
    let say_row = &mut |row| {
        if row % 200 == 0 || row == rows {
            context.info(&format!("{row} of {rows} rows"));
        }
    };
    let FitSettings { method, step, store, .. } = *settings;
    let found = rig.client.fit_correction(method, frame, scale, &targets, step, say_row)?;
    let expected = on_host(method, frame, &targets, step).map_err(CorrectionError::from)?;
    let different = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
    let stored = different == 0 && store;
    if stored {
        rig.client.store_correction()?;
    }
    Ok(FitFigures {
        method: method.to_string(),
        targets: targets.len(),
        samples: rows * usize::from(frame.width().div_ceil(step)),
        coefficients: found.len(),
        different,
        stored,
    })
}

/// Size of the maps, and the scale of their codes.
fn frame_and_scale(maps: &[(Array2<f32>, f64)]) -> Result<(Frame, DepthScale), CorrectionError> {
    let (height, width) = maps.first().map_or((0, 0), |(map, _)| map.dim());
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    let depths_mm = || maps.iter().map(|(_, true_mm)| *true_mm as f32);
    let nearest = depths_mm().fold(f32::INFINITY, f32::min);
    let farthest = depths_mm().fold(f32::NEG_INFINITY, f32::max);
    Ok((Frame::new(side(width), side(height))?, DepthScale::for_range(farthest, nearest)?))
}

/// The same fit here, by the code that the board runs.
fn on_host(method: Method, frame: Frame, targets: &[CodedTarget], step: u16) -> Result<Vec<i32>, Error> {
    let columns = Columns { first: 0, step };
    let rows = || {
        targets
            .iter()
            .flat_map(|target| (0..frame.height()).step_by(usize::from(step)).map(move |row| (target, row)))
    };
    let codes = |target: &CodedTarget, row: u16| -> Vec<i16> {
        target.codes.row(usize::from(row)).iter().copied().step_by(usize::from(step)).collect()
    };
    if method == Method::ClsfFull {
        let mut fit = FullFit::new(frame);
        for (target, row) in rows() {
            fit.add_row(row, columns, &codes(target, row), target.truth)?;
        }
        return Ok(fit.solve()?.iter().map(|c| c.to_bits()).collect());
    }
    let mut fit = RegionFit::new(frame);
    for (target, row) in rows() {
        fit.add_row(row, columns, &codes(target, row), target.truth)?;
    }
    Ok(fit.solve()?.as_flattened().as_flattened().iter().map(|c| c.to_bits()).collect())
}
