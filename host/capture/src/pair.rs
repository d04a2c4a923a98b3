//! Takes a pair: homes if necessary, moves the coarse stage, exposes far and near by piezo.

use std::time::Duration;

use farnear_protocol::{
    Settle,
    message::{Axis, Limits, Shot, ShotRecord, TriggerMode},
    units::Micros,
};

use crate::{
    average::Average,
    camera::{Camera, Image},
    client::Client,
    describe::um,
    expose::{check_exposure, expose, sensor_mm, strobe_note},
    meter,
    plan::{SensorPair, coarse_for, fine_for},
    ready::{base_nm, base_when_homed_nm, ensure_homed},
    work::Moved,
};

pub use crate::expose::CaptureError;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exposures {
    pub exposure: Micros,
    pub settle: Settle,
    /// Longest wait for an image after its exposure was reported.
    pub image_wait: Duration,
    /// Averaged exposures per image, at least 1.
    pub averaged: u16,
    /// Finds the exposure time, beginning with `exposure`.
    pub auto: bool,
    /// Subtracts as many exposures without the board's light.
    pub subtract_ambient: bool,
}

impl Default for Exposures {
    fn default() -> Self {
        Self {
            exposure: Micros(5_000),
            settle: Settle::of_move(Axis::SensorFine),
            image_wait: Duration::from_secs(30),
            averaged: 1,
            auto: false,
            subtract_ambient: false,
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub struct Taken {
    pub image: Image,
    /// Sensor distance by the optics.
    pub sensor_asked_mm: f64,
    /// By encoder and gauge at the trigger.
    pub sensor_measured_mm: f64,
    pub record: ShotRecord,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Pair {
    pub far: Taken,
    pub near: Taken,
    pub coarse: Moved,
    /// Extra sensor distance of the second camera ([`crate::half_mirror`]); `None`: one camera, two exposures.
    pub further_mm: Option<f64>,
}

impl Pair {
    /// Board time from the far move to the end of the near exposure, without exposures.
    pub fn moving_us(&self) -> u64 {
        let (far, near) = (&self.far.record, &self.near.record);
        let begin = far.trigger.0.saturating_sub(u64::from(far.settle.0));
        let whole = near.strobe_end.0.saturating_sub(begin);
        let second_us = if self.further_mm.is_some() { 0 } else { near.exposure.0 };
        whole.saturating_sub(u64::from(far.exposure.0) + u64::from(second_us))
    }
}

/// A rig whose piezo reaches both positions of a pair.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reach {
    pub coarse: Moved,
    pub shots: [Shot; 2],
}

/// Moves the coarse stage so that the piezo reaches both positions; homes if necessary. Checks limits first.
pub fn reach(
    client: &Client,
    sensor: &SensorPair,
    exposures: &Exposures,
    say: &mut dyn FnMut(&str),
) -> Result<Reach, CaptureError> {
    let limits = client.hello().limits;
    check_exposure(client, exposures.exposure)?;
    coarse_for(sensor, base_when_homed_nm(client, &client.status()?), &limits)?;
    ensure_homed(client, say)?;
    let base = base_nm(client, &client.status()?);
    let target = coarse_for(sensor, base, &limits)?;
    say(&format!("moving the coarse stage to {:.3} um", um(target)));
    let coarse = client.move_to(Axis::SensorCoarse, target)?;
    let shot = |sensor_mm| -> Result<Shot, CaptureError> {
        Ok(Shot {
            axis: Axis::SensorFine,
            target: fine_for(sensor_mm, base, coarse.measured, &limits)?,
            exposure: exposures.exposure,
            settle_window: exposures.settle.window,
            settle_dwell: exposures.settle.dwell,
            repeat: 1,
            mode: TriggerMode::Hardware,
        })
    };
    Ok(Reach { coarse, shots: [shot(sensor.far_mm)?, shot(sensor.near_mm)?] })
}

/// Takes a pair. `say` receives progress messages. The record has the first of averaged exposures.
pub fn capture_pair(
    client: &Client,
    camera: &mut dyn Camera,
    sensor: &SensorPair,
    exposures: &Exposures,
    say: &mut dyn FnMut(&str),
) -> Result<Pair, CaptureError> {
    let mut reach = reach(client, sensor, exposures, say)?;
    if exposures.auto {
        let (found, share) = meter::exposure(client, camera, reach.shots[0], exposures.image_wait)?;
        say(&format!(
            "exposure time {} us: the brightest pixels have {:.0} % of white",
            found.0,
            100.0 * share
        ));
        reach.shots.iter_mut().for_each(|shot| shot.exposure = found);
    }
    let [far, near] = reach.shots.map(|shot| um(shot.target));
    say(&format!("exposing far (piezo at {far:.3} um) and near ({near:.3} um)"));
    let repeat = exposures.averaged.max(1);
    let [far, near] = reach.shots.map(|shot| Shot { repeat, ..shot });
    let (shots, lit) = match exposures.subtract_ambient {
        true => (vec![far, far, near, near], &client.with_alternating_light()),
        false => (vec![far, near], client),
    };
    let mut taken: Vec<Option<(ShotRecord, Average)>> = vec![None; shots.len()];
    let asked = shots.len() * usize::from(repeat);
    let mut reported = 0;
    expose(lit, camera, &shots, exposures.image_wait, |record, image| -> Result<(), CaptureError> {
        reported += 1;
        match taken.get_mut(usize::from(record.index)) {
            Some(Some((_, average))) => average.add(&image),
            Some(none) => *none = Some((record, Average::of(image))),
            None => return Err(CaptureError::Count { reported, asked }),
        }
        Ok(())
    })?;
    let finished = |(record, average): (ShotRecord, Average)| (record, average.finish());
    let images: Option<Vec<_>> = taken.into_iter().map(|taken| taken.map(finished)).collect();
    let both = match images.as_deref() {
        Some([far, near]) => [far.clone(), near.clone()],
        Some([far, dark, near, dark_near]) => {
            [(far.0, far.1.without(&dark.1)), (near.0, near.1.without(&dark_near.1))]
        }
        _ => return Err(CaptureError::Count { reported, asked }),
    };
    both.iter().filter_map(|(record, _)| strobe_note(record)).for_each(|note| say(&note));
    pair_of(both, sensor, reach.coarse, &client.hello().limits)
}

pub fn pair_of(
    [far, near]: [(ShotRecord, Image); 2],
    sensor: &SensorPair,
    coarse: Moved,
    limits: &Limits,
) -> Result<Pair, CaptureError> {
    let taken = |(record, image): (ShotRecord, Image), sensor_asked_mm| {
        let sensor_measured_mm = sensor_mm(&record, limits);
        Taken { image, sensor_asked_mm, sensor_measured_mm, record }
    };
    let (far, near) = (taken(far, sensor.far_mm), taken(near, sensor.near_mm));
    alike(&far.image, &near.image)?;
    Ok(Pair { far, near, coarse, further_mm: None })
}

fn alike(far: &Image, near: &Image) -> Result<(), CaptureError> {
    let ((far_height, far_width), (near_height, near_width)) = (far.pixels.dim(), near.pixels.dim());
    let (far_bits, near_bits) = (far.bits, near.bits);
    if (far_width, far_height, far_bits) == (near_width, near_height, near_bits) {
        return Ok(());
    }
    Err(CaptureError::Unlike { far_width, far_height, far_bits, near_width, near_height, near_bits })
}
