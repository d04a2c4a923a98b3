//! Depth correction fitted on the board to flat targets, compared bit by bit with this computer.

use std::path::PathBuf;

use farnear_capture::board_correction::{CodedTarget, encode};
use farnear_depth::corrections::{CorrectionError, Method};
use farnear_maths::clsf::{Columns, DepthScale, Error, Frame, FullFit, RegionFit};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{Rig, RigAddress};
use crate::{
    calibrate::correction,
    context::Context,
    error::{Result, WorkflowError},
    parameters::within,
    request::{PathKind, Request},
};

/// Let the board fit a depth correction to flat targets, and keep it in its memory.
///
/// The depth maps of PATTERNS.toml are sent row by row; the coefficients are compared bit for bit with the same calculation here.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig calibrate fit series/PATTERNS.toml --port sim --method clsf-full --step 16 --store"
    )
)]
#[serde(default)]
pub struct FitRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    /// The list of depth maps, as `farnear rig calibrate targets` writes it.
    pub patterns: PathBuf,
    /// Method: clsf (3x3 regions), clsf-blend (3x3 regions without steps) or clsf-full (one polynomial).
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "DisplayFromStr")]
    pub method: Method,
    /// Take every Nth pixel of every Nth row only: 1 to 256.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "PX", default_value_t = Self::default().step, value_parser = clap::value_parser!(u16).range(1..=256))
    )]
    pub step: u16,
    /// Keep the correction in the board's memory.
    #[cfg_attr(feature = "clap", arg(long))]
    pub store: bool,
}

impl Default for FitRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            patterns: PathBuf::new(),
            method: Method::Clsf,
            step: 8,
            store: false,
        }
    }
}

impl Request for FitRequest {
    const NAME: &'static str = "rig calibrate fit";
    const REQUIRED: &'static [&'static str] = &["patterns", "method"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("patterns", PathKind::Input)];
    type Figures = FitFigures;

    fn check(&self) -> Result<()> {
        within("step", self.step, &(1..=256), "px")
    }

    fn run(&self, context: &Context<'_>) -> Result<FitFigures> {
        fit(self, context)
    }

    fn verdict(figures: &FitFigures) -> Result<()> {
        figures.check()
    }
}

crate::request::rig_request!(FitRequest);

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct FitFigures {
    pub method: String,
    pub targets: usize,
    pub samples: usize,
    pub coefficients: usize,
    /// Coefficients that differ from this computer's.
    pub different: usize,
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

/// Sends the maps row by row, fits on the board, and compares the coefficients with the same fit here.
pub fn fit(settings: &FitRequest, context: &Context<'_>) -> Result<FitFigures> {
    if settings.method.board_form().is_none() {
        let expected = format!("the board fits {}", Method::board_names());
        return Err(WorkflowError::parameter("method", settings.method, expected));
    }
    let maps = correction::read(&settings.patterns, context)?;
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
    let FitRequest { method, step, store, .. } = *settings;
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

/// The same fit on the host, with the board's code.
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
