//! The coarse stage: motor, micrometer screw, encoder, end switches.
//!
//! The stage is spring-loaded against a micrometer screw of 0.5 mm pitch and 13 mm travel, so it has no
//! backlash. The screw errs as one of Mitutoyo's 148 series of micrometer heads may (catalogue accuracy
//! +-2 um over the travel): here a slow error of the lead and a periodic one per turn, each drawn from the seed,
//! together below 2 um. 1 um of sensor position is about 0.3 mm of depth, so a rig keeps this below its depth
//! accuracy only because the far and the near exposure differ by the PIEZO, whose gauge sees its true
//! position: the screw's error shifts both exposures alike, a bias of up to 0.6 mm and no noise.

use super::noise::Noise;

/// Travel between the end switches, micrometres.
pub const TRAVEL_UM: f64 = 13_000.0;
/// One STEP pulse: 0.5 mm / 3200.
const MICROSTEP_UM: f64 = 0.15625;
const MICROSTEPS_PER_TURN: f64 = 3200.0;
/// The encoder's counts per microstep: 4000 / 3200.
const COUNTS_PER_MICROSTEP: (i64, i64) = (5, 4);
/// The carriage runs against rubber this far beyond either switch: the motor stalls.
const END_STOP_UM: f64 = 700.0;
/// The far switch closes this far beyond the travel.
const FAR_SWITCH_UM: f64 = TRAVEL_UM + 150.0;
/// Repeatability of the home switch, standard deviation in micrometres.
const HOME_SD_UM: f64 = 0.3;
/// Way from where the home switch closes to where it opens again (a precision switch of the Baumer My-Com
/// class has micrometres; a snap-action one has 0.1 mm).
const HOME_DIFFERENTIAL_UM: f64 = 2.0;
/// Amplitudes of the screw's errors, micrometres: lowest and highest.
const LEAD_ERROR_UM: (f64, f64) = (0.3, 0.7);
const TURN_ERROR_UM: (f64, f64) = (0.2, 0.3);

/// The coarse stage.
#[derive(Debug)]
pub struct Screw {
    /// Commanded position of the rotor, microsteps from the true home edge.
    microsteps: i64,
    lead_error_um: f64,
    turn_error_um: f64,
    lead_phase: f64,
    turn_phase: f64,
    home_noise: Noise,
    home_offset_um: f64,
    home_closed: bool,
    stalled: bool,
    step_edges: u64,
    /// A switch that no longer works, and what it says for ever.
    stuck_home: Option<bool>,
}

impl Screw {
    /// A stage somewhere in the first half of its travel.
    pub fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, "screw");
        let tau = core::f64::consts::TAU;
        let start_um = noise.between(500.0, TRAVEL_UM / 2.0);
        let mut screw = Self {
            microsteps: libm::round(start_um / MICROSTEP_UM) as i64,
            lead_error_um: noise.between(LEAD_ERROR_UM.0, LEAD_ERROR_UM.1),
            turn_error_um: noise.between(TURN_ERROR_UM.0, TURN_ERROR_UM.1),
            lead_phase: noise.between(0.0, tau),
            turn_phase: noise.between(0.0, tau),
            home_noise: Noise::new(seed, "home switch"),
            home_offset_um: 0.0,
            home_closed: false,
            stalled: false,
            step_edges: 0,
            stuck_home: None,
        };
        screw.home_offset_um = HOME_SD_UM * screw.home_noise.normal();
        screw
    }

    /// One STEP pulse; against an end stop the motor stalls and nothing moves.
    pub fn step(&mut self, away: bool) {
        self.step_edges += 1;
        let next = self.microsteps + if away { 1 } else { -1 };
        if self.stalled || !(-END_STOP_UM..=TRAVEL_UM + END_STOP_UM).contains(&(next as f64 * MICROSTEP_UM)) {
            return;
        }
        self.microsteps = next;
        self.update_home();
    }

    /// Each closing is at another place: that is the repeatability.
    fn update_home(&mut self) {
        let um = self.position_um();
        if !self.home_closed && um <= self.home_offset_um {
            self.home_closed = true;
        } else if self.home_closed && um > self.home_offset_um + HOME_DIFFERENTIAL_UM {
            self.home_closed = false;
            self.home_offset_um = HOME_SD_UM * self.home_noise.normal();
        }
    }

    /// The screw's error where the rotor stands at `microsteps`, 0 at 0.
    fn error_um(&self, microsteps: i64) -> f64 {
        let turns = microsteps as f64 / MICROSTEPS_PER_TURN;
        let tau = core::f64::consts::TAU;
        let travel = turns * 500.0 / TRAVEL_UM;
        let lead = libm::sin(tau * travel + self.lead_phase) - libm::sin(self.lead_phase);
        let turn = libm::sin(tau * turns + self.turn_phase) - libm::sin(self.turn_phase);
        self.lead_error_um * lead + self.turn_error_um * turn
    }

    /// Where the stage really is, micrometres from the true home edge.
    pub fn position_um(&self) -> f64 {
        self.microsteps as f64 * MICROSTEP_UM + self.error_um(self.microsteps)
    }

    /// The encoder's count on the rotor (it cannot see the screw's error).
    pub fn encoder_counts(&self) -> i64 {
        (self.microsteps * COUNTS_PER_MICROSTEP.0).div_euclid(COUNTS_PER_MICROSTEP.1)
    }

    /// The home switch is closed.
    pub fn home_closed(&self) -> bool {
        self.stuck_home.unwrap_or(self.home_closed)
    }

    /// The far switch is closed.
    pub fn far_closed(&self) -> bool {
        self.position_um() >= FAR_SWITCH_UM
    }

    /// STEP edges that reached the driver while it was on.
    pub fn step_edges(&self) -> u64 {
        self.step_edges
    }

    /// Blocks the motor, or frees it.
    pub fn set_stalled(&mut self, stalled: bool) {
        self.stalled = stalled;
    }

    /// Breaks the home switch so that it says this for ever, or repairs it.
    pub fn set_stuck_home(&mut self, says: Option<bool>) {
        self.stuck_home = says;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_screw_stays_within_its_data_sheet() {
        for seed in 0..50 {
            let screw = Screw::new(seed);
            let steps = (TRAVEL_UM / MICROSTEP_UM) as i64;
            let worst = (0..steps).step_by(37).map(|n| screw.error_um(n).abs()).fold(0.0, f64::max);
            assert!(worst <= 2.0, "seed {seed}: {worst} um");
            assert!(screw.error_um(0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_encoder_counts_five_per_four_steps_and_the_stops_hold() {
        let mut screw = Screw::new(1);
        let start = screw.encoder_counts();
        for _ in 0..400 {
            screw.step(true);
        }
        // A floor on either side: within one count of 500.
        assert!((screw.encoder_counts() - start - 500).abs() <= 1);
        for _ in 0..100_000 {
            screw.step(false);
        }
        assert!(screw.position_um() > -END_STOP_UM - 2.0 && screw.home_closed() && !screw.far_closed());
        assert_eq!(screw.step_edges(), 100_400);
    }

    #[test]
    fn the_home_switch_repeats_to_its_standard_deviation() {
        let mut screw = Screw::new(5);
        let mut places = Vec::new();
        for _ in 0..400 {
            while !screw.home_closed() {
                screw.step(false);
            }
            places.push(screw.position_um());
            while screw.position_um() < 20.0 {
                screw.step(true);
            }
        }
        let mean = places.iter().sum::<f64>() / 400.0;
        let sd = (places.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / 400.0).sqrt();
        // 0.3 um and the microstep's 0.156/sqrt(12); five standard errors of an SD over 400.
        assert!((sd - 0.303).abs() < 0.055, "{sd}");
    }
}
