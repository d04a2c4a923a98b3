//! Finds the sensor distance of best focus. *Coarse*: per stepper position the piezo takes three images up to
//! 190 um apart, whose spectra give side and distance of the focus (`model`); the stepper moves there.
//! *Fine*: a piezo sweep, and the tip of a parabola through the largest measures
//! ([`farnear_depth::focus_measure::peak`]). Positions: coarse plus fine, nm, unless named otherwise.

mod model;

use std::time::Duration;

use farnear_depth::{
    focus_measure::{FocusError, FocusMeasure, peak},
    optics::Optics,
    psf::Psf,
};
use farnear_protocol::{
    Settle,
    message::{Axis, Limits, Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};
use ndarray::{Array2, s};

use crate::{
    camera::{Camera, Image},
    client::Client,
    describe::um,
    error::ClientError,
    expose::{CaptureError, expose},
    plan::PlanError,
    ready::base_nm,
};
use model::{Spectrum, estimate};

const PLACES_MAX: usize = 8;
/// The estimate suffices for the fine sweep within this distance of the centre.
const GOOD_NM: f64 = 45_000.0;
/// Steps of the fine sweep on either side, and their size.
const FINE_STEPS: i32 = 4;
const FINE_STEP_NM: i32 = 14_000;
const FINE_REACH_NM: i32 = FINE_STEPS * FINE_STEP_NM;
const SWEEPS_MAX: usize = 3;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FocusSettings {
    pub measure: FocusMeasure,
    /// Search range around the present sensor position.
    pub range_mm: f64,
    pub exposure: Micros,
    pub image_wait: Duration,
    /// Evaluated region: column, row, width, height in pixels; `None`: all.
    pub region: Option<[usize; 4]>,
}

impl Default for FocusSettings {
    fn default() -> Self {
        Self {
            measure: FocusMeasure::Tenengrad,
            range_mm: 1.0,
            exposure: Micros(5_000),
            image_wait: Duration::from_secs(30),
            region: None,
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub struct Focus {
    /// Sensor distance of best focus, where the sensor is now.
    pub sensor_mm: f64,
    /// By encoder; `fine` by gauge.
    pub coarse: Nanometres,
    pub fine: Nanometres,
    pub places: usize,
    pub exposures: usize,
    /// Duration by the clock of the board.
    pub board: Duration,
    /// Fine sweep: sensor distance in mm, focus measure.
    pub sweep: Vec<(f64, f64)>,
}

#[derive(Debug, thiserror::Error)]
pub enum FocusSearchError {
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Measure(#[from] FocusError),
    #[error(
        "the region {column},{row},{region_width},{region_height} does not lie in an image of {width}x{height} px"
    )]
    Region {
        column: usize,
        row: usize,
        region_width: usize,
        region_height: usize,
        width: usize,
        height: usize,
    },
    #[error(
        "no focus within {range_mm} mm of the start at {start_mm:.4} mm (last looked at {last_mm:.4} mm): is there a textured \
         target, is the lens cap off, do start and range suit the target's distance?"
    )]
    NotFound { range_mm: f64, start_mm: f64, last_mm: f64 },
}

impl From<ClientError> for FocusSearchError {
    fn from(error: ClientError) -> Self {
        Self::Capture(error.into())
    }
}

/// Leaves the sensor at the best focus near its position. Both axes of stage A must be homed. `say` receives progress.
pub fn find_focus(
    client: &Client,
    camera: &mut dyn Camera,
    optics: &Optics,
    settings: &FocusSettings,
    say: &mut dyn FnMut(&str),
) -> Result<Focus, FocusSearchError> {
    let limits = client.hello().limits;
    check_range(&limits).map_err(CaptureError::from)?;
    let status = client.status()?;
    let mut search = Search {
        client,
        camera,
        optics,
        settings,
        limits,
        base_nm: base_nm(client, &status),
        coarse: status.coarse.measured,
        fine: status.fine.measured,
        exposures: 0,
    };
    let start = f64::from(search.coarse.0) + f64::from(search.fine.0);
    let (around, places) = search.coarse(start, say)?;
    let (best, sweep) = search.fine(around, start, say)?;
    let moved = client.move_to(Axis::SensorFine, search.fine_at(best))?;
    let after = client.status()?;
    let position = i64::from(after.coarse.measured.0) + i64::from(moved.measured.0);
    Ok(Focus {
        sensor_mm: (search.base_nm + position) as f64 / 1e6,
        coarse: after.coarse.measured,
        fine: moved.measured,
        places,
        exposures: search.exposures,
        board: Duration::from_micros(after.time.0.saturating_sub(status.time.0)),
        sweep,
    })
}

struct Search<'a> {
    client: &'a Client,
    camera: &'a mut dyn Camera,
    optics: &'a Optics,
    settings: &'a FocusSettings,
    limits: Limits,
    base_nm: i64,
    /// Axes at the last exposure.
    coarse: Nanometres,
    fine: Nanometres,
    exposures: usize,
}

impl Search<'_> {
    fn middle(&self) -> i32 {
        (self.limits.fine_min.0 + self.limits.fine_max.0) / 2
    }

    fn fine_at(&self, position: f64) -> Nanometres {
        let fine = position - f64::from(self.coarse.0);
        Nanometres(
            fine.round().clamp(f64::from(self.limits.fine_min.0), f64::from(self.limits.fine_max.0)) as i32
        )
    }

    fn mm(&self, position: f64) -> f64 {
        (self.base_nm as f64 + position) / 1e6
    }

    fn not_found(&self, start: f64) -> FocusSearchError {
        let last = f64::from(self.coarse.0) + f64::from(self.fine.0);
        let range_mm = self.settings.range_mm;
        FocusSearchError::NotFound { range_mm, start_mm: self.mm(start), last_mm: self.mm(last) }
    }

    fn shot(&self, axis: Axis, target: i32, settle: Settle) -> Shot {
        Shot {
            axis,
            target: Nanometres(target),
            exposure: self.settings.exposure,
            settle_window: settle.window,
            settle_dwell: settle.dwell,
            repeat: 1,
            mode: TriggerMode::Hardware,
        }
    }

    fn look(&self, axis: Axis, target: i32) -> Shot {
        self.shot(axis, target, Settle::of_search(axis))
    }

    fn take(&mut self, shots: &[Shot]) -> Result<Vec<(ShotRecord, Array2<f32>)>, FocusSearchError> {
        let mut taken = Vec::new();
        let (wait, region) = (self.settings.image_wait, self.settings.region);
        expose(self.client, self.camera, shots, wait, |record, image| -> Result<(), FocusSearchError> {
            taken.push((record, cut(&image, region)?));
            Ok(())
        })?;
        self.exposures += taken.len();
        if let Some((record, _)) = taken.last() {
            (self.coarse, self.fine) = (record.coarse, record.fine);
        }
        Ok(taken)
    }

    /// Moves the stepper until the focus is in mid-range of the piezo. Returns the estimate and the positions used.
    fn coarse(&mut self, start: f64, say: &mut dyn FnMut(&str)) -> Result<(f64, usize), FocusSearchError> {
        let reach = self.settings.range_mm * 1e6;
        let mut goal = None;
        for place in 1..=PLACES_MAX {
            let mut shots = Vec::new();
            let (low, high) = (self.limits.fine_min.0, self.limits.fine_max.0);
            let from_below = self.fine.0 <= self.middle();
            let (first, last) = if from_below { (low, high) } else { (high, low) };
            match goal {
                None => shots.push(self.look(Axis::SensorFine, first)),
                Some(goal) => shots.push(self.look(Axis::SensorCoarse, goal)),
            }
            shots.push(self.look(Axis::SensorFine, self.middle()));
            shots.push(self.look(Axis::SensorFine, last));
            let spectra: Vec<Spectrum> = self
                .take(&shots)?
                .iter()
                .map(|(record, image)| {
                    Spectrum::of(image, f64::from(record.coarse.0) + f64::from(record.fine.0))
                })
                .collect();
            let looked_at = f64::from(self.coarse.0) + f64::from(self.middle());
            let estimated = estimate(&spectra, self.blur_per_nm()).ok_or_else(|| self.not_found(start))?;
            let around = estimated.clamp(start - reach, start + reach);
            say(&format!(
                "at {:.3} mm: the focus seems to be {:+.0} um away",
                self.mm(looked_at),
                (around - looked_at) / 1e3
            ));
            if (estimated - looked_at).abs() <= GOOD_NM {
                return Ok((around, place));
            }
            if (around - looked_at).abs() <= GOOD_NM {
                // At the end of the range, and the focus is beyond it.
                return Err(self.not_found(start));
            }
            let wanted = around - f64::from(self.middle());
            let (min, max) = (f64::from(self.limits.coarse_min.0), f64::from(self.limits.coarse_max.0));
            let next = wanted.clamp(min, max) as i32;
            if goal == Some(next) {
                return Err(self.not_found(start));
            }
            goal = Some(next);
        }
        Err(self.not_found(start))
    }

    /// Standard deviation of the blur in px per nm of defocus.
    fn blur_per_nm(&self) -> f64 {
        let k = match self.optics.psf() {
            Psf::Gaussian { k } | Psf::Generalised { k, .. } => k,
            // Along one axis; R / 2 for a disc of radius R.
            psf => (0.5 * psf.second_moment()).sqrt(),
        };
        k / (2.0 * self.optics.f_number() * self.optics.pixel_um() * 1e3)
    }

    /// Sweeps the piezo around a position; returns the best position and the sweep.
    fn fine(
        &mut self,
        around: f64,
        start: f64,
        say: &mut dyn FnMut(&str),
    ) -> Result<(f64, Vec<(f64, f64)>), FocusSearchError> {
        let mut around = around;
        for _ in 0..SWEEPS_MAX {
            let reach = FINE_REACH_NM;
            let middle =
                self.fine_at(around).0.clamp(self.limits.fine_min.0 + reach, self.limits.fine_max.0 - reach);
            let mut targets: Vec<i32> =
                (-FINE_STEPS..=FINE_STEPS).map(|step| middle + step * FINE_STEP_NM).collect();
            if self.fine.0 > middle {
                targets.reverse();
            }
            say(&format!(
                "sweeping the piezo from {:.1} to {:.1} um",
                um(Nanometres(middle - reach)),
                um(Nanometres(middle + reach))
            ));
            let (axis, settle) = (Axis::SensorFine, Settle::of_sweep(Axis::SensorFine));
            let shots: Vec<Shot> = targets.iter().map(|target| self.shot(axis, *target, settle)).collect();
            let mut samples = Vec::new();
            for (record, image) in self.take(&shots)? {
                let place = f64::from(record.coarse.0) + f64::from(record.fine.0);
                samples.push((place, self.settings.measure.of(image.view())?));
            }
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (places, values): (Vec<f64>, Vec<f64>) = samples.iter().copied().unzip();
            if let Some(best) = peak(&places, &values) {
                let sweep = samples.iter().map(|(place, value)| (self.mm(*place), *value)).collect();
                return Ok((best, sweep));
            }
            // The maximum is at an end: continue beyond it.
            let largest = samples.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(around, |best| best.0);
            around = largest + (largest - around).signum() * f64::from(reach) / 2.0;
            let room = self.fine_at(around);
            if (f64::from(self.coarse.0) + f64::from(room.0) - around).abs() > f64::from(reach) {
                let coarse = around - f64::from(self.middle());
                let moved = self.client.move_to(Axis::SensorCoarse, Nanometres(coarse as i32))?;
                self.coarse = moved.measured;
            }
        }
        Err(self.not_found(start))
    }
}

/// Whether the fine sweep fits between the piezo's limits.
fn check_range(limits: &Limits) -> Result<(), PlanError> {
    let (piezo_nm, needed_nm) = (limits.fine_max.0 - limits.fine_min.0, 2 * FINE_REACH_NM);
    match piezo_nm >= needed_nm {
        true => Ok(()),
        false => {
            let [piezo_um, needed_um] = [piezo_nm, needed_nm].map(|nm| um(Nanometres(nm)));
            Err(PlanError::Sweep { piezo_um, needed_um })
        }
    }
}

fn cut(image: &Image, region: Option<[usize; 4]>) -> Result<Array2<f32>, FocusSearchError> {
    let (height, width) = image.pixels.dim();
    let [column, row, region_width, region_height] = region.unwrap_or([0, 0, width, height]);
    let fits = |from: usize, length: usize, whole: usize| {
        length > 0 && from.checked_add(length).is_some_and(|end| end <= whole)
    };
    if !fits(column, region_width, width) || !fits(row, region_height, height) {
        return Err(FocusSearchError::Region { column, row, region_width, region_height, width, height });
    }
    let part = image.pixels.slice(s![row..row + region_height, column..column + region_width]);
    Ok(part.mapv(f32::from))
}

/// Means over squares of `bin` pixels; partial squares are dropped.
fn binned(image: &Array2<f32>, bin: usize) -> Array2<f32> {
    let (height, width) = image.dim();
    let scale = 1.0 / (bin * bin) as f32;
    Array2::from_shape_fn((height / bin, width / bin), |(row, column)| {
        image.slice(s![row * bin..(row + 1) * bin, column * bin..(column + 1) * bin]).sum() * scale
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piezo_range_shorter_than_the_sweep_is_rejected() {
        let limits = |fine_max| Limits { fine_max: Nanometres(fine_max), ..crate::plan::tests::limits() };
        assert_eq!(check_range(&limits(117_000)), Ok(()));
        let error = check_range(&limits(105_000)).unwrap_err().to_string();
        assert!(error.contains("100.0 um") && error.contains("needs 112.0 um"), "{error}");
    }

    #[test]
    fn bins_images_and_crops_regions() {
        let image = Image::new(Array2::from_shape_fn((5, 6), |(r, c)| (r * 6 + c) as u16), 8);
        let part = cut(&image, Some([2, 1, 4, 2])).unwrap();
        assert_eq!(binned(&part, 2), ndarray::array![[11.5, 13.5]]);
        assert!(matches!(cut(&image, Some([3, 0, 4, 1])), Err(FocusSearchError::Region { .. })));
        assert!(matches!(cut(&image, Some([0, usize::MAX, 1, 2])), Err(FocusSearchError::Region { .. })));
    }
}
