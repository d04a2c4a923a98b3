//! Finding the sensor distance of the best focus.
//!
//! *Coarse*: at each place of the stepper the piezo takes three images, 190 um of travel apart at most. How their spectra
//! differ tells on which side the focus lies and about how far away (`model`), so the stepper goes there
//! directly instead of sweeping the whole range. *Fine*: a sweep by piezo around the estimate, and the tip of the parabola
//! through the largest measures ([`farnear_depth::focus_measure::peak`]). All images are taken by exposure programs.
//!
//! Positions are sums of stage A's coarse and fine positions in nanometres unless a name says otherwise.

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
    ready::base_nm,
};
use model::{Spectrum, estimate};

/// Places of the stepper before the search is given up.
const PLACES_MAX: usize = 8;
/// The estimate is good enough for the fine sweep when it lies so near to the middle of what was looked at.
const GOOD_NM: f64 = 45_000.0;
/// Steps of the fine sweep to either side, and their size.
const FINE_STEPS: i32 = 4;
const FINE_STEP_NM: i32 = 14_000;
/// The fine sweep may run out of the peak so often.
const SWEEPS_MAX: usize = 3;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FocusSettings {
    pub measure: FocusMeasure,
    /// How far the focus may be from where the sensor stands, mm.
    pub range_mm: f64,
    /// Length of each exposure.
    pub exposure: Micros,
    /// Longest wait for an image.
    pub image_wait: Duration,
    /// Part of the image that is looked at: column, row, width, height in pixels. All of it where none.
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
    /// Sensor distance of the best focus, mm: m1, where the sensor stands now.
    pub sensor_mm: f64,
    /// Coarse position, by its encoder.
    pub coarse: Nanometres,
    /// Piezo position, by its gauge.
    pub fine: Nanometres,
    /// Places of the stepper that were looked at.
    pub places: usize,
    /// Images that were taken.
    pub exposures: usize,
    /// The board's time for all of it.
    pub board: Duration,
    /// The fine sweep: sensor distance in mm, and focus measure.
    pub sweep: Vec<(f64, f64)>,
}

#[derive(Debug, thiserror::Error)]
pub enum FocusSearchError {
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Measure(#[from] FocusError),
    /// The region is not inside the image.
    #[error(
        "the region {column},{row},{region_width},{region_height} does not lie in an image of {width}x{height} px"
    )]
    Region {
        column: usize,
        row: usize,
        region_width: usize,
        /// Height of the region.
        region_height: usize,
        width: usize,
        height: usize,
    },
    /// The search left the range, or did not settle.
    #[error(
        "no focus within {range_mm} mm of the start at {start_mm:.4} mm (last looked at {last_mm:.4} mm): is there a textured \
         target, is the lens cap off, does the start suit the target's distance?"
    )]
    NotFound {
        /// How far it was sought.
        range_mm: f64,
        /// Where the sensor stood, mm.
        start_mm: f64,
        /// Where it was looked at last, mm.
        last_mm: f64,
    },
}

impl From<ClientError> for FocusSearchError {
    fn from(error: ClientError) -> Self {
        Self::Capture(error.into())
    }
}

/// Finds the best focus near where the sensor stands, and leaves the sensor there. Both of stage A's axes must be homed.
/// `say` is told in words what is being done.
pub fn find_focus(
    client: &Client,
    camera: &mut dyn Camera,
    optics: &Optics,
    settings: &FocusSettings,
    say: &mut dyn FnMut(&str),
) -> Result<Focus, FocusSearchError> {
    let status = client.status()?;
    let limits = client.hello().limits;
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
    /// Where the axes stood at the last exposure.
    coarse: Nanometres,
    fine: Nanometres,
    exposures: usize,
}

impl Search<'_> {
    fn middle(&self) -> i32 {
        (self.limits.fine_min.0 + self.limits.fine_max.0) / 2
    }

    /// Where the piezo goes for a position, with the stepper where it is.
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

    /// A shot of the search: roughly where it was sent is enough.
    fn look(&self, axis: Axis, target: i32) -> Shot {
        self.shot(axis, target, Settle::of_search(axis))
    }

    /// Takes the shots and gives each with the part of its image that counts.
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

    /// Brings the stepper to where the focus lies in the middle of the piezo's range. Gives about where that is, and how
    /// many places it took.
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
            if (around - looked_at).abs() <= GOOD_NM {
                return Ok((around, place));
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

    /// Standard deviation of the blur in pixels, per nanometre from focus.
    fn blur_per_nm(&self) -> f64 {
        let k = match self.optics.psf() {
            Psf::Gaussian { k } | Psf::Generalised { k, .. } => k,
            // Along an axis; of a disc of radius R that is R / 2.
            psf => (0.5 * psf.second_moment()).sqrt(),
        };
        k / (2.0 * self.optics.f_number() * self.optics.pixel_um() * 1e3)
    }

    /// Sweeps the piezo around a position. Gives the best position and the sweep.
    fn fine(
        &mut self,
        around: f64,
        start: f64,
        say: &mut dyn FnMut(&str),
    ) -> Result<(f64, Vec<(f64, f64)>), FocusSearchError> {
        let mut around = around;
        for _ in 0..SWEEPS_MAX {
            let reach = FINE_STEPS * FINE_STEP_NM;
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
            // The largest measure stands at an end: go on beyond it.
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

/// The part of an image that counts, as floats.
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

/// Means over squares of `bin` pixels; as large as whole squares go.
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
    fn binning_means_and_regions_are_cut() {
        let image = Image { pixels: Array2::from_shape_fn((5, 6), |(r, c)| (r * 6 + c) as u16), bits: 8 };
        let part = cut(&image, Some([2, 1, 4, 2])).unwrap();
        assert_eq!(binned(&part, 2), ndarray::array![[11.5, 13.5]]);
        assert!(matches!(cut(&image, Some([3, 0, 4, 1])), Err(FocusSearchError::Region { .. })));
        assert!(matches!(cut(&image, Some([0, usize::MAX, 1, 2])), Err(FocusSearchError::Region { .. })));
    }
}
