//! Gain and zero of the strain gauge, compared with the encoder.
//!
//! The tab of stage A's home switch is on the sensor plate, which the piezo moves. The screw position of the contact
//! therefore depends on the piezo, and the encoder measures the difference:
//! 1. The relaxed piezo's reading is the zero.
//! 2. After homing the switch is met from above with the piezo alternately low and high, a pulse per millisecond.
//! 3. Encoder distance over gauge distance is the gain. The stage is homed again, because the piezo's share changed.
//!
//! Remaining error: switch repeatability and screw error within a third of a turn, together 0.2 to 0.8 %.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure, SettingKey};

use super::sweep::ramp;
use super::{Step, go_home};
use crate::io::TICK_HZ;
use crate::motion::axis::{Purpose, Stepper};
use crate::motion::home::Homing;
use crate::motion::leg::{Leg, Until};
use crate::motion::stage::Stage;
use crate::piezo::Piezo;
use crate::settings::{Settings, StepperSettings};

/// Piezo positions for the two contacts, by gauge.
pub(super) const PLACES: [Nanometres; 2] = [Nanometres(20_000), Nanometres(180_000)];
const ROUNDS: usize = 4;
/// Start of the exact approach above the switch: more than the gauge's error.
const NEAR_NM: i32 = 30_000;
/// Ticks to relax the piezo, to rest, to settle, and to average at the end of the last two.
const LOWER: u32 = TICK_HZ / 4;
const REST: u32 = TICK_HZ;
const SETTLE: u32 = TICK_HZ / 10;
const MEAN: u32 = TICK_HZ / 20;
/// Gains further from 1, or zeros beyond, indicate a defective gauge; also the settings' ranges.
const GAIN_PPM: core::ops::RangeInclusive<i64> = 900_000..=1_100_000;
const OFFSET_NM: core::ops::RangeInclusive<i64> = -9_000..=9_000;

#[derive(Clone, Debug)]
enum Phase {
    Begin,
    Lower(u16),
    Rest,
    Home(Homing),
    Lift,
    Place,
    Near,
    Approach,
    LowerAgain(u16),
    Tell(u8),
    HomeAgain(Homing),
}

#[derive(Clone, Debug)]
pub(crate) struct GaugeScale {
    phase: Phase,
    leg: Leg,
    ticks: u32,
    sum: i64,
    relaxed: i64,
    /// Contacts so far, and per position the sums of gauge and encoder positions.
    met: usize,
    gauge: [i64; 2],
    encoder: [i64; 2],
    found: (i32, i32),
}

impl GaugeScale {
    pub(crate) const fn new() -> Self {
        Self {
            phase: Phase::Begin,
            leg: Leg::REST,
            ticks: 0,
            sum: 0,
            relaxed: 0,
            met: 0,
            gauge: [0; 2],
            encoder: [0; 2],
            found: (0, 0),
        }
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        let (axis, carried) = (Axis::SensorCoarse, stage.carried(Axis::SensorCoarse));
        let (stepper, piezo, numbers) = (&mut stage.coarse, &mut stage.fine, &settings.coarse);
        self.ticks += 1;
        let next = match &mut self.phase {
            Phase::Begin => match piezo.driven_from() {
                None => return Step::Failed(Axis::SensorFine, Failure::Gauge),
                Some(from) => Phase::Lower(from),
            },
            Phase::Lower(from) if ramp(piezo, self.ticks, LOWER, *from, 0) => Phase::Rest,
            Phase::Rest => match self.mean(piezo, REST) {
                None => return Step::On,
                Some(relaxed) => {
                    self.relaxed = relaxed;
                    Phase::Home(Homing::new())
                }
            },
            Phase::Home(homing) => match go_home(homing, axis, stepper, numbers, carried) {
                Ok(()) => Phase::Lift,
                Err(step) => return step,
            },
            Phase::Place => match self.mean(piezo, SETTLE) {
                None => return Step::On,
                Some(place) => {
                    self.gauge[self.met % 2] += place;
                    Phase::Near
                }
            },
            Phase::LowerAgain(from) if ramp(piezo, self.ticks, LOWER, *from, 0) => {
                match self.evaluate(settings) {
                    Some(found) => {
                        self.found = found;
                        Phase::Tell(0)
                    }
                    None => return Step::Failed(Axis::SensorFine, Failure::Implausible),
                }
            }
            Phase::Lower(_) | Phase::LowerAgain(_) => return Step::On,
            Phase::Tell(0) => {
                self.phase = Phase::Tell(1);
                return Step::Set(SettingKey::GaugeOffsetNm, self.found.1);
            }
            Phase::Tell(_) => {
                self.phase = Phase::HomeAgain(Homing::new());
                return Step::Set(SettingKey::GaugeGainPpm, self.found.0);
            }
            Phase::HomeAgain(homing) => {
                let (gain_ppm, offset_nm) = self.found;
                return match go_home(homing, axis, stepper, numbers, carried) {
                    Ok(()) => Step::Done(Calibration::Gauge { gain_ppm, offset: Nanometres(offset_nm) }),
                    Err(step) => step,
                };
            }
            Phase::Lift | Phase::Near | Phase::Approach => {
                if !self.leg.is_over(stepper) {
                    return Step::On;
                }
                match self.after_leg(stepper, piezo) {
                    Some(next) => next,
                    None => return Step::Failed(axis, Failure::Implausible),
                }
            }
        };
        self.leg = set_off(&next, stepper, numbers, self.target());
        if let Phase::Place = next {
            piezo.go(self.target());
        }
        (self.phase, self.ticks, self.sum) = (next, 0, 0);
        Step::On
    }

    const fn target(&self) -> Nanometres {
        PLACES[self.met % 2]
    }

    /// The phase after a leg; `None` if the switch was elsewhere.
    fn after_leg(&mut self, stepper: &Stepper, piezo: &Piezo) -> Option<Phase> {
        match (&self.phase, self.leg.edge()) {
            (Phase::Lift, _) if self.met == 2 * ROUNDS => piezo.played().map(Phase::LowerAgain),
            (Phase::Lift, _) => Some(Phase::Place),
            (Phase::Near, _) => (!stepper.home_closed()).then_some(Phase::Approach),
            (_, Some(edge)) => {
                self.encoder[self.met % 2] += i64::from(edge.measured.0);
                self.met += 1;
                Some(Phase::Lift)
            }
            (_, None) => None,
        }
    }

    /// Mean reading over the last ticks of a wait, once it is over.
    fn mean(&mut self, piezo: &Piezo, wait: u32) -> Option<i64> {
        if self.ticks > wait - MEAN {
            self.sum += i64::from(piezo.measured().0);
        }
        (self.ticks >= wait).then_some(self.sum / i64::from(MEAN))
    }

    /// `None` if implausible.
    fn evaluate(&self, settings: &Settings) -> Option<(i32, i32)> {
        let by_gauge = self.gauge[1] - self.gauge[0];
        // A higher piezo position meets the switch at a lower stage position.
        let by_encoder = self.encoder[0] - self.encoder[1];
        let (gain_ppm, offset) = (i64::from(settings.fine.gauge_gain_ppm), settings.fine.gauge_offset);
        if by_gauge <= 0 || gain_ppm == 0 {
            return None;
        }
        let gain = gain_ppm * by_encoder / by_gauge;
        let zero = i64::from(offset.0) + self.relaxed * 1_000_000 / gain_ppm;
        let plausible = GAIN_PPM.contains(&gain) && OFFSET_NM.contains(&zero);
        plausible.then_some((gain as i32, zero as i32)) // within their ranges
    }
}

fn set_off(phase: &Phase, stepper: &mut Stepper, numbers: &StepperSettings, piezo: Nanometres) -> Leg {
    let (way, until) = match phase {
        Phase::Lift => {
            let span = PLACES[1].0 - PLACES[0].0;
            ((span + numbers.home_clearance.0, numbers.home_leave_speed), Until::Arrival)
        }
        Phase::Near => {
            // Position 0 is the contact from below, without the piezo's position.
            let switch = -numbers.backlash.0 - piezo.0;
            ((switch + NEAR_NM - stepper.measured().0, numbers.home_leave_speed), Until::Arrival)
        }
        Phase::Approach => ((-numbers.home_approach.0, numbers.home_approach_speed), Until::Home(true)),
        _ => return Leg::REST,
    };
    Leg::start(stepper, way, Purpose::SeekHome, until)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain and zero for contacts this far apart by gauge and encoder, nm; the old scale is 0.98 and 500 nm.
    fn found(by_gauge: i64, by_encoder: i64, relaxed: i64) -> Option<(i32, i32)> {
        let rounds = ROUNDS as i64;
        let (gauge, encoder) = ([20_000 * rounds, (20_000 + by_gauge) * rounds], [0, -by_encoder * rounds]);
        let mut settings = Settings::DEFAULT;
        (settings.fine.gauge_gain_ppm, settings.fine.gauge_offset) = (980_000, Nanometres(500));
        GaugeScale { gauge, encoder, relaxed, ..GaugeScale::new() }.evaluate(&settings)
    }

    #[test]
    fn the_new_scale_corrects_the_old_one_within_plausible_limits() {
        // The gauge shows 160 um where the screw moved by 152: 0.98 * 0.95. 98 nm are a reading of 100.
        assert_eq!(found(160_000, 152_000, 98), Some((931_000, 600)));
        assert_eq!(found(98_000, 110_000, -9_310), Some((1_100_000, -9_000)));
        assert_eq!(found(98_000, 90_000, 8_330), Some((900_000, 9_000)));
        for (by_gauge, by_encoder, relaxed) in [
            (980_000, 1_100_001, 0),
            (980_000, 899_999, 0),
            (98_000, 98_000, -9_311),
            (98_000, 98_000, 8_331),
            (98_000, -98_000, 0),
            (-98_000, -98_000, 0),
            (0, 98_000, 0),
        ] {
            assert_eq!(found(by_gauge, by_encoder, relaxed), None, "{by_gauge} {by_encoder} {relaxed}");
        }
    }
}
