//! The mechanics: true positions, as opposed to what the firmware measures.
//!
//! Micrometres in a stage's frame: 0 = true home edge, positive = sensor and lens apart. Virtual nanoseconds.
//! The plant advances on request only; the request times affect only rounding, and lockstep fixes them.

mod contact;
mod motor;
mod noise;
mod piezo;
mod screw;
mod stage;

pub use contact::Contact;
pub use motor::Motor;
pub use noise::Noise;
pub use piezo::Piezo;
pub use screw::{BACKLASH_UM, Screw, TRAVEL_UM};
pub use stage::{Stage, StageName};

use crate::parts::{GaugeParts, Parts};

/// Distance from principal plane to sensor with all axes at 0, as assembled; the firmware has the same value.
pub const DATUM_MM: f64 = 47.0;
/// Converter code at the relaxed piezo; 1 nm per code (data sheet of the gauge amplifier).
const GAUGE_CODE_ZERO: f64 = 10_000.0;
const GAUGE_CODE_MAX: f64 = 262_143.0;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ExposureTruth {
    /// Mean distance from the principal plane.
    pub sensor_mm: f64,
    pub coarse_um: f64,
    pub lens_um: f64,
    pub piezo_um: f64,
    pub piezo_min_um: f64,
    pub piezo_max_um: f64,
}

#[derive(Clone, Copy, Debug)]
struct Exposing {
    since_ns: u64,
    coarse_um_ns: f64,
    lens_um_ns: f64,
    piezo_um_ns: f64,
    piezo_min_um: f64,
    piezo_max_um: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Drift {
    since_ns: u64,
    um_per_s: f64,
}

impl Drift {
    fn um(&self, now_ns: u64) -> f64 {
        self.um_per_s * 1e-9 * now_ns.saturating_sub(self.since_ns) as f64
    }
}

#[derive(Debug)]
pub struct Plant {
    now_ns: u64,
    sensor_stage: Stage,
    lens_stage: Stage,
    piezo: Piezo,
    gauge: GaugeParts,
    drift: Drift,
    gauge_noise: Noise,
    exposing: Option<Exposing>,
}

impl Plant {
    /// `seed` sets the screw errors and, without `start_um`, the positions of sensor and lens stage.
    pub fn new(seed: u64, parts: &Parts, start_um: Option<[f64; 2]>) -> Self {
        Self {
            now_ns: 0,
            sensor_stage: Stage::new(StageName::Sensor, seed, start_um.map(|[sensor, _]| sensor)),
            lens_stage: Stage::new(StageName::Lens, seed, start_um.map(|[_, lens]| lens)),
            piezo: Piezo::new(parts.piezo),
            gauge: parts.gauge,
            drift: Drift::default(),
            gauge_noise: Noise::new(seed, "gauge"),
            exposing: None,
        }
    }

    /// Advances to `now_ns`; a time in the past has no effect.
    pub fn advance(&mut self, now_ns: u64) {
        let moves = self.now_ns < now_ns;
        while self.now_ns < now_ns {
            let step_ns = (now_ns - self.now_ns).min(Piezo::STEP_NS);
            self.piezo.step(step_ns);
            self.now_ns += step_ns;
            if let Some(sums) = &mut self.exposing {
                self.sensor_stage.advance(self.now_ns);
                self.lens_stage.advance(self.now_ns);
                let um = self.piezo.position_um();
                sums.coarse_um_ns += self.sensor_stage.position_um() * step_ns as f64;
                sums.lens_um_ns += self.lens_stage.position_um() * step_ns as f64;
                sums.piezo_um_ns += um * step_ns as f64;
                sums.piezo_min_um = sums.piezo_min_um.min(um);
                sums.piezo_max_um = sums.piezo_max_um.max(um);
            }
        }
        self.sensor_stage.advance(now_ns);
        self.lens_stage.advance(now_ns);
        if moves {
            self.sensor_stage.set_carried_um(self.piezo.position_um());
        }
    }

    pub fn step_edge(&mut self, now_ns: u64, name: StageName, away: bool) {
        if self.exposing.is_some() {
            self.advance(now_ns);
        }
        let stage = self.stage_mut(name);
        stage.advance(now_ns);
        stage.step(away);
    }

    pub fn set_dac(&mut self, now_ns: u64, code: u16) {
        self.advance(now_ns);
        self.piezo.set_dac(code);
    }

    /// See [`Piezo::disturb_dac`].
    pub fn disturb_dac(&mut self, now_ns: u64, code: u16) {
        self.advance(now_ns);
        self.piezo.disturb_dac(code);
    }

    pub fn sample_gauge(&mut self, now_ns: u64) -> u32 {
        self.advance(now_ns);
        let GaugeParts { gain, offset_um, noise_um } = self.gauge;
        let um = offset_um
            + self.drift.um(now_ns)
            + gain * self.piezo.position_um()
            + noise_um * self.gauge_noise.normal();
        libm::round(GAUGE_CODE_ZERO + 1000.0 * um).clamp(0.0, GAUGE_CODE_MAX) as u32
    }

    /// Starts a gauge zero drift; 0 removes it completely.
    pub fn drift_gauge(&mut self, now_ns: u64, um_per_s: f64) {
        self.drift = Drift { since_ns: now_ns, um_per_s };
    }

    pub fn begin_exposure(&mut self, now_ns: u64) {
        self.advance(now_ns);
        let um = self.piezo.position_um();
        self.exposing = Some(Exposing {
            since_ns: now_ns,
            coarse_um_ns: 0.0,
            lens_um_ns: 0.0,
            piezo_um_ns: 0.0,
            piezo_min_um: um,
            piezo_max_um: um,
        });
    }

    pub fn end_exposure(&mut self, now_ns: u64) -> Option<ExposureTruth> {
        self.advance(now_ns);
        let sums = self.exposing.take()?;
        let length_ns = (now_ns.saturating_sub(sums.since_ns)).max(1) as f64;
        let coarse_um = sums.coarse_um_ns / length_ns;
        let lens_um = sums.lens_um_ns / length_ns;
        let piezo_um = sums.piezo_um_ns / length_ns;
        Some(ExposureTruth {
            sensor_mm: DATUM_MM + 1e-3 * (coarse_um + lens_um + piezo_um),
            coarse_um,
            lens_um,
            piezo_um,
            piezo_min_um: sums.piezo_min_um,
            piezo_max_um: sums.piezo_max_um,
        })
    }

    pub fn stage(&self, name: StageName) -> &Stage {
        match name {
            StageName::Sensor => &self.sensor_stage,
            StageName::Lens => &self.lens_stage,
        }
    }

    pub fn stage_mut(&mut self, name: StageName) -> &mut Stage {
        match name {
            StageName::Sensor => &mut self.sensor_stage,
            StageName::Lens => &mut self.lens_stage,
        }
    }

    pub fn piezo(&self) -> &Piezo {
        &self.piezo
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_reports_mean_positions() {
        let mut plant = Plant::new(1, &Parts::default(), None);
        let start_um = plant.stage(StageName::Sensor).position_um();
        let lens_um = plant.stage(StageName::Lens).position_um();
        plant.begin_exposure(1_000_000);
        // 64 microsteps, 10 um, in the middle of 100 ms, at 16 kHz: 6.2 um beyond the play.
        for step in 0..64 {
            plant.step_edge(51_000_000 + step * 62_500, StageName::Sensor, true);
        }
        let truth = plant.end_exposure(101_000_000).expect("it was exposing");
        let end_um = plant.stage(StageName::Sensor).position_um();
        // 46 to 50 ms at the new position; the rotor swings for some milliseconds.
        let share = (truth.coarse_um - start_um) / (end_um - start_um);
        assert!((end_um - start_um) > 5.0 && (0.44..0.52).contains(&share), "{share} {truth:?}");
        assert!((truth.lens_um - lens_um).abs() < 1e-6);
        let sum_um = truth.coarse_um + truth.lens_um + truth.piezo_um;
        assert!((truth.sensor_mm - (DATUM_MM + 1e-3 * sum_um)).abs() < 1e-12);
    }

    #[test]
    fn the_gauge_drifts_until_it_is_repaired() {
        let mut parts = Parts::default();
        parts.gauge.noise_um = 0.0;
        let mut plant = Plant::new(1, &parts, None);
        let cold = plant.sample_gauge(0);
        plant.drift_gauge(0, 0.05);
        // 0.05 um/s for 2 s; a code is 1 nm.
        assert_eq!(plant.sample_gauge(2_000_000_000), cold + 100);
        plant.drift_gauge(2_000_000_000, 0.0);
        assert_eq!(plant.sample_gauge(2_000_000_000), cold);
    }

    #[test]
    fn the_gauge_reads_zero_with_noise() {
        let mut plant = Plant::new(7, &Parts::default(), None);
        let codes: Vec<f64> =
            (1..=2000u32).map(|i| f64::from(plant.sample_gauge(u64::from(i) * 200_000))).collect();
        let mean = codes.iter().sum::<f64>() / codes.len() as f64;
        let sd = (codes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / codes.len() as f64).sqrt();
        // Five standard errors of a mean over 2000 samples of 3 nm; the SD gains 1/12 nm2 from rounding.
        assert!((mean - GAUGE_CODE_ZERO).abs() < 0.35, "{mean}");
        assert!((sd - 3.01).abs() < 0.25, "{sd}");
    }
}
