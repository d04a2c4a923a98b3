//! A motorised stage: motor, screw, encoder on the motor's shaft, end switches at the stage.
//!
//! Micrometres from the true home edge, positive = sensor and lens apart. The encoder misses screw errors and
//! play. Stage A's home switch detects the sensor plate on the piezo, so the gauge can be checked.

use super::{
    Noise,
    motor::{MICROSTEPS_PER_TURN, Motor},
    screw::{MICROSTEP_UM, Screw, TRAVEL_UM},
};

const COUNTS_PER_TURN: f64 = 4000.0;
/// Distance from a switch to the rubber end stop, where the motor stalls.
const END_STOP_UM: f64 = 700.0;
const LOWEST: f64 = -END_STOP_UM / MICROSTEP_UM;
const HIGHEST: f64 = (TRAVEL_UM + END_STOP_UM) / MICROSTEP_UM;
const FAR_SWITCH_UM: f64 = TRAVEL_UM + 150.0;
/// Repeatability of the home switch, standard deviation in micrometres.
const HOME_SD_UM: f64 = 0.3;
/// Hysteresis: precision switches (Baumer My-Com) have micrometres, snap-action ones 0.1 mm.
const HOME_DIFFERENTIAL_UM: f64 = 2.0;

#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StageName {
    Sensor,
    Lens,
}

/// Each closing draws another position.
#[derive(Debug)]
struct HomeSwitch {
    noise: Noise,
    offset_um: f64,
    closed: bool,
}

impl HomeSwitch {
    fn update(&mut self, um: f64) {
        if !self.closed && um <= self.offset_um {
            self.closed = true;
        } else if self.closed && um > self.offset_um + HOME_DIFFERENTIAL_UM {
            self.closed = false;
            self.offset_um = HOME_SD_UM * self.noise.normal();
        }
    }
}

#[derive(Debug)]
pub struct Stage {
    motor: Motor,
    screw: Screw,
    home: HomeSwitch,
    /// Piezo position that the home switch sees in addition.
    carried_um: f64,
    stuck_home: Option<bool>,
    stuck_far: Option<bool>,
    pressed: u64,
}

impl Stage {
    /// A stage at `start_um`, else at a random place in the first half of its travel.
    pub fn new(name: StageName, seed: u64, start_um: Option<f64>) -> Self {
        let (screw, switch) = match name {
            StageName::Sensor => ("screw", "home switch"),
            StageName::Lens => ("lens screw", "lens home switch"),
        };
        let mut noise = Noise::new(seed, screw);
        let drawn_um = noise.between(500.0, TRAVEL_UM / 2.0);
        let start_um = start_um.unwrap_or(drawn_um);
        let mut home = HomeSwitch { noise: Noise::new(seed, switch), offset_um: 0.0, closed: false };
        home.offset_um = HOME_SD_UM * home.noise.normal();
        let microsteps = libm::round(start_um / MICROSTEP_UM) as i64;
        let mut screw = Screw::new(&mut noise);
        // The last motion was upwards.
        screw.turn(microsteps as f64);
        Self {
            motor: Motor::new(microsteps),
            screw,
            home,
            carried_um: 0.0,
            stuck_home: None,
            stuck_far: None,
            pressed: 0,
        }
    }

    pub fn step(&mut self, away: bool) {
        let rotor = self.motor.rotor();
        self.pressed += u64::from(if away { rotor >= HIGHEST } else { rotor <= LOWEST });
        self.motor.step(away);
    }

    /// Microsteps against a hard stop since power-on.
    pub fn pressed(&self) -> u64 {
        self.pressed
    }

    pub fn advance(&mut self, now_ns: u64) {
        let Self { motor, screw, home, carried_um, .. } = self;
        motor.advance(now_ns, |rotor| {
            let held = rotor.clamp(LOWEST, HIGHEST);
            screw.turn(held);
            home.update(screw.stage_um() + *carried_um);
            held
        });
    }

    pub fn set_carried_um(&mut self, um: f64) {
        self.carried_um = um;
        self.home.update(self.screw.stage_um() + um);
    }

    pub fn position_um(&self) -> f64 {
        self.screw.stage_um()
    }

    /// Sequencer position, microsteps from the true home edge.
    pub fn microsteps(&self) -> i64 {
        self.motor.field()
    }

    pub fn lost_microsteps(&self) -> f64 {
        self.motor.field() as f64 - self.motor.rotor()
    }

    pub fn encoder_counts(&self) -> i64 {
        libm::floor(self.motor.rotor() * (COUNTS_PER_TURN / MICROSTEPS_PER_TURN)) as i64
    }

    pub fn home_closed(&self) -> bool {
        self.stuck_home.unwrap_or(self.home.closed)
    }

    pub fn far_closed(&self) -> bool {
        self.stuck_far.unwrap_or_else(|| self.position_um() >= FAR_SWITCH_UM)
    }

    pub fn set_stalled(&mut self, stalled: bool) {
        self.motor.set_blocked(stalled);
    }

    pub fn set_torque(&mut self, share: f64) {
        self.motor.set_torque(share);
    }

    pub fn set_backlash_um(&mut self, um: f64) {
        self.screw.set_backlash_um(um);
    }

    pub fn reset_sequencer(&mut self) {
        self.motor.reset_sequencer();
    }

    /// Sticks the far switch at this level, or repairs it.
    pub fn set_stuck_far(&mut self, says: Option<bool>) {
        self.stuck_far = says;
    }

    pub fn set_stuck_home(&mut self, says: Option<bool>) {
        self.stuck_home = says;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Turned {
        stage: Stage,
        now_ns: u64,
    }

    impl Turned {
        fn new(seed: u64) -> Self {
            Self { stage: Stage::new(StageName::Sensor, seed, None), now_ns: 0 }
        }

        fn step(&mut self, away: bool) {
            self.now_ns += 250_000;
            self.stage.advance(self.now_ns);
            self.stage.step(away);
        }
    }

    #[test]
    fn the_encoder_counts_five_per_four_steps_and_the_end_stops_block() {
        let mut turned = Turned::new(1);
        let start = turned.stage.encoder_counts();
        for _ in 0..401 {
            turned.step(true);
        }
        // Rounding on either side and one microstep of the rotor: within two counts of 500.
        assert!((turned.stage.encoder_counts() - start - 500).abs() <= 2);
        for _ in 0..60_000 {
            turned.step(false);
        }
        let stage = &turned.stage;
        assert!(stage.position_um() > -END_STOP_UM - 5.0 && stage.home_closed() && !stage.far_closed());
        assert!(stage.lost_microsteps() < -1000.0, "the motor has stalled against its stop");
    }

    #[test]
    fn the_home_switch_repeats_to_its_standard_deviation() {
        let mut turned = Turned::new(5);
        let mut places = Vec::new();
        for _ in 0..400 {
            while !turned.stage.home_closed() {
                turned.step(false);
            }
            places.push(turned.stage.position_um());
            while turned.stage.position_um() < 20.0 {
                turned.step(true);
            }
        }
        let mean = places.iter().sum::<f64>() / 400.0;
        let sd = (places.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / 400.0).sqrt();
        // 0.3 um and the microstep's 0.156/sqrt(12); five standard errors of an SD over 400.
        assert!((sd - 0.303).abs() < 0.055, "{sd}");
    }

    #[test]
    fn the_two_stages_have_different_errors() {
        let at = |name| Stage::new(name, 1, None).position_um();
        assert_ne!(at(StageName::Sensor), at(StageName::Lens));
    }
}
