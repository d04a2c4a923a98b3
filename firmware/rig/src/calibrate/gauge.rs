//! Gain and zero of the strain gauge, held against the encoder.
//!
//! The tab that actuates stage A's home switch is on the sensor's plate, which the piezo carries. So the switch is met at another
//! place of the screw for each position of the piezo, and the encoder says how far apart these places are:
//!
//! 1. The piezo is relaxed: what the gauge says there is its zero.
//! 2. Homed, the switch is met from above with the piezo low and with the piezo high, in turns, a pulse a millisecond.
//! 3. The ways by encoder over those by gauge are the gain. Then the stage is homed anew, for the piezo's part in it has changed.
//!
//! What is left is the repeatability of the switch and the screw's error within a third of a turn, together 0.3 % of the way.

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

/// Where the piezo is for the two meetings, by the gauge.
const PLACES: [Nanometres; 2] = [Nanometres(20_000), Nanometres(180_000)];
/// Meetings of each kind.
const ROUNDS: usize = 4;
/// The exact approach begins so far above where the switch should be: more than the gauge may err.
const NEAR_NM: i32 = 30_000;
/// Ticks of the way to the relaxed piezo, of its rest, of a settling, and of a mean at the end of the two.
const LOWER: u32 = TICK_HZ / 4;
const REST: u32 = TICK_HZ;
const SETTLE: u32 = TICK_HZ / 10;
const MEAN: u32 = TICK_HZ / 20;
/// A gain farther from 1 than this, or a zero, is none of a gauge that works; also the settings' ranges.
const GAIN_PPM: core::ops::RangeInclusive<i64> = 900_000..=1_100_000;
const OFFSET_NM: core::ops::RangeInclusive<i64> = -9_000..=9_000;

/// Where the routine is.
#[derive(Clone, Debug)]
enum Phase {
    Begin,
    /// The piezo goes down from a code.
    Lower(u16),
    Rest,
    Home(Homing),
    /// The stage goes up, so far that the piezo may go anywhere.
    Lift,
    /// The piezo goes to its place.
    Place,
    Near,
    Approach,
    /// The piezo goes down again, all meetings made.
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
    /// What the gauge says where the piezo is relaxed.
    relaxed: i64,
    /// Meetings so far, and of each kind the sums of the gauge's and of the encoder's positions.
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
            Phase::Begin => Phase::Lower(piezo.code()),
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

    /// Where the piezo is to be at the next meeting.
    const fn target(&self) -> Nanometres {
        PLACES[self.met % 2]
    }

    /// The phase after a leg; `None` where the switch was not where it should be.
    fn after_leg(&mut self, stepper: &Stepper, piezo: &Piezo) -> Option<Phase> {
        match (&self.phase, self.leg.edge()) {
            (Phase::Lift, _) if self.met == 2 * ROUNDS => Some(Phase::LowerAgain(piezo.code())),
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

    /// The gauge's mean over the last ticks of a wait, once that is over.
    fn mean(&mut self, piezo: &Piezo, wait: u32) -> Option<i64> {
        if self.ticks > wait - MEAN {
            self.sum += i64::from(piezo.measured().0);
        }
        (self.ticks >= wait).then_some(self.sum / i64::from(MEAN))
    }

    /// Gain and zero as settings; `None` where they make no sense.
    fn evaluate(&self, settings: &Settings) -> Option<(i32, i32)> {
        let by_gauge = self.gauge[1] - self.gauge[0];
        // The farther the piezo holds the tab away, the lower is the stage that meets the switch.
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
            // Position 0 is where the switch is met, from below, with the piezo's position taken off.
            let switch = -numbers.backlash.0 - piezo.0;
            ((switch + NEAR_NM - stepper.measured().0, numbers.home_leave_speed), Until::Arrival)
        }
        Phase::Approach => ((-numbers.home_approach.0, numbers.home_approach_speed), Until::Home(true)),
        _ => return Leg::REST,
    };
    Leg::start(stepper, way, Purpose::SeekHome, until)
}
