//! The mechanics behind the board: what is really there, as opposed to what the firmware measures.
//!
//! Lengths are f64 micrometres in a stage's own frame: 0 = the true home edge, positive = sensor and lens away from
//! each other.
//! Times are virtual nanoseconds. The plant advances only when someone asks for a moment; the order of those
//! moments changes nothing but rounding, and lockstep fixes the order.

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

/// Distance from the lens' principal plane to the sensor with both stages and the piezo at 0, millimetres. The rig
/// is assembled and measured to this; the firmware holds the same number.
pub const DATUM_MM: f64 = 47.0;
/// Converter code at the relaxed piezo; one code is 1 nm (data sheet of the gauge's amplifier board).
const GAUGE_CODE_ZERO: f64 = 10_000.0;
const GAUGE_CODE_MAX: f64 = 262_143.0;

/// What the sensor did during an exposure.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ExposureTruth {
    /// Mean distance of the sensor from the principal plane, millimetres.
    pub sensor_mm: f64,
    /// Mean position of the sensor's stage, micrometres.
    pub coarse_um: f64,
    /// Mean position of the lens' stage, micrometres.
    pub lens_um: f64,
    /// Mean position of the piezo, micrometres.
    pub piezo_um: f64,
    /// Smallest position of the piezo, micrometres.
    pub piezo_min_um: f64,
    /// Largest position of the piezo, micrometres.
    pub piezo_max_um: f64,
}

/// Sums over an exposure that is under way.
#[derive(Clone, Copy, Debug)]
struct Exposing {
    since_ns: u64,
    coarse_um_ns: f64,
    lens_um_ns: f64,
    piezo_um_ns: f64,
    piezo_min_um: f64,
    piezo_max_um: f64,
}

/// The gauge's zero on its way.
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

/// Both stages, piezo and gauge.
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
    /// The mechanics as they stand at power-on; the seed decides how their screws err. Where the sensor's and the lens' stage stand it
    /// draws it unless `start_um` says otherwise.
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

    /// Lets time pass until `now_ns`; a moment in the past changes nothing.
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

    /// A rising edge of STEP reaches a driver that is on.
    pub fn step_edge(&mut self, now_ns: u64, name: StageName, away: bool) {
        if self.exposing.is_some() {
            self.advance(now_ns);
        }
        let stage = self.stage_mut(name);
        stage.advance(now_ns);
        stage.step(away);
    }

    /// The piezo's DAC takes a code.
    pub fn set_dac(&mut self, now_ns: u64, code: u16) {
        self.advance(now_ns);
        self.piezo.set_dac(code);
    }

    /// The gauge's converter samples: 18 bit.
    pub fn sample_gauge(&mut self, now_ns: u64) -> u32 {
        self.advance(now_ns);
        let GaugeParts { gain, offset_um, noise_um } = self.gauge;
        let um = offset_um
            + self.drift.um(now_ns)
            + gain * self.piezo.position_um()
            + noise_um * self.gauge_noise.normal();
        libm::round(GAUGE_CODE_ZERO + 1000.0 * um).clamp(0.0, GAUGE_CODE_MAX) as u32
    }

    /// The gauge's zero moves from now on as it warms up, so fast; 0 takes all of it back.
    pub fn drift_gauge(&mut self, now_ns: u64, um_per_s: f64) {
        self.drift = Drift { since_ns: now_ns, um_per_s };
    }

    /// The sensor begins to collect light.
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

    /// The sensor stops collecting light; `None` where it was not collecting.
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

    /// One of the stages, to break something.
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
    fn an_exposure_sees_the_mean_of_what_moved() {
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
        // It was there for 46 to 50 ms; the rotor swings about its place for some milliseconds.
        let share = (truth.coarse_um - start_um) / (end_um - start_um);
        assert!((end_um - start_um) > 5.0 && (0.44..0.52).contains(&share), "{share} {truth:?}");
        assert!((truth.lens_um - lens_um).abs() < 1e-6);
        let sum_um = truth.coarse_um + truth.lens_um + truth.piezo_um;
        assert!((truth.sensor_mm - (DATUM_MM + 1e-3 * sum_um)).abs() < 1e-12);
    }

    #[test]
    fn a_gauge_that_warms_up_drifts_and_one_that_is_mended_does_not() {
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
    fn the_gauge_reads_its_zero_with_its_noise() {
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
