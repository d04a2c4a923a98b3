//! The backlash of a screw, measured at the home switch, which the stage itself actuates.
//!
//! Going down the stage closes the switch, going up it opens it again a known way farther: what the motor turns
//! beyond that is the play. Each round closes and opens the switch once, a pulse a millisecond. The encoder on the
//! motor's shaft says where the motor is at the edges. Afterwards the axis is homed anew, because position 0
//! depends on the backlash.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure, SettingKey};

use super::Step;
use crate::motion::axis::{Purpose, Stepper};
use crate::motion::home::Homing;
use crate::motion::stage::Stage;
use crate::motion::steps;
use crate::settings::{Settings, StepperSettings};

/// Reversals that are measured.
const ROUNDS: usize = 5;
/// Largest backlash that is believed; also the setting's range.
const MOST: i32 = 100_000;

/// Where the routine is.
#[derive(Clone, Debug)]
enum Phase {
    Home(Homing),
    /// Up, well off the switch.
    Clear,
    /// Down until it closes.
    Close,
    /// On, farther than the play may be wide.
    Pass {
        closed: Nanometres,
    },
    /// Up until it opens.
    Open {
        closed: Nanometres,
    },
    HomeAgain(Homing),
}

/// The routine.
#[derive(Clone, Debug)]
pub(crate) struct Backlash {
    axis: Axis,
    phase: Phase,
    edge: Option<Nanometres>,
    rounds: heapless::Vec<i32, ROUNDS>,
}

impl Backlash {
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, phase: Phase::Home(Homing::new()), edge: None, rounds: heapless::Vec::new() }
    }

    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        let axis = self.axis;
        let Some((stepper, settings)) = stage.with_numbers(axis, settings) else { return Step::On };
        match &mut self.phase {
            Phase::Home(homing) => {
                match homing.tick(stepper, settings) {
                    None => {}
                    Some(Ok(_)) => self.enter(Phase::Clear, stepper, settings),
                    Some(Err(failure)) => return Step::Failed(axis, failure),
                }
                return Step::On;
            }
            Phase::HomeAgain(homing) => {
                return match homing.tick(stepper, settings) {
                    None => Step::On,
                    Some(Ok(_)) => Step::Done(self.result(settings)),
                    Some(Err(failure)) => Step::Failed(axis, failure),
                };
            }
            Phase::Clear | Phase::Close | Phase::Pass { .. } | Phase::Open { .. } => {}
        }
        let awaited = match self.phase {
            Phase::Close => stepper.home_closed(),
            Phase::Open { .. } => !stepper.home_closed(),
            _ => false,
        };
        if awaited && self.edge.is_none() {
            self.edge = Some(stepper.measured());
            stepper.stop();
        }
        if !stepper.is_still() {
            return Step::On;
        }
        let next = match (&self.phase, self.edge) {
            (Phase::Clear, _) => Phase::Close,
            (Phase::Close, Some(closed)) => Phase::Pass { closed },
            (Phase::Pass { closed }, _) => Phase::Open { closed: *closed },
            (Phase::Open { closed }, Some(opened)) => {
                let _ = self.rounds.push(opened.0.saturating_sub(closed.0)); // it is over when it is full
                if !self.rounds.is_full() {
                    self.enter(Phase::Clear, stepper, settings);
                    return Step::On;
                }
                self.phase = Phase::HomeAgain(Homing::new());
                let backlash = self.mean(settings);
                if !(-1_000..=MOST).contains(&backlash) {
                    return Step::Failed(axis, Failure::Implausible);
                }
                let coarse = axis == Axis::SensorCoarse;
                let key = if coarse { SettingKey::CoarseBacklashNm } else { SettingKey::LensBacklashNm };
                return Step::Set(key, backlash.max(0));
            }
            // The switch was seen to work at homing.
            _ => return Step::Failed(axis, Failure::Implausible),
        };
        self.enter(next, stepper, settings);
        Step::On
    }

    fn enter(&mut self, phase: Phase, stepper: &mut Stepper, settings: &StepperSettings) {
        let (way, speed) = match phase {
            Phase::Home(_) | Phase::HomeAgain(_) => (0, settings.home_leave_speed),
            Phase::Clear => {
                (settings.home_clearance.0 + settings.home_hysteresis.0, settings.home_leave_speed)
            }
            Phase::Close => (-settings.home_approach.0, settings.home_approach_speed),
            Phase::Pass { .. } => (-settings.home_clearance.0, settings.home_leave_speed),
            Phase::Open { .. } => (settings.home_approach.0, settings.home_approach_speed),
        };
        let target = stepper.position().wrapping_add(steps::to_steps(Nanometres(way)));
        stepper.go_steps(target, speed, Purpose::SeekHome);
        (self.phase, self.edge) = (phase, None);
    }

    /// Mean of the rounds, less the switch's own way.
    fn mean(&self, settings: &StepperSettings) -> i32 {
        let sum: i64 = self.rounds.iter().map(|round| i64::from(*round)).sum();
        (sum / ROUNDS as i64) as i32 - settings.home_hysteresis.0
    }

    fn result(&self, settings: &StepperSettings) -> Calibration {
        let mean = self.mean(settings);
        let deviation = |round: &i32| (round - settings.home_hysteresis.0 - mean).abs();
        let spread = self.rounds.iter().map(deviation).max().unwrap_or(0);
        Calibration::Backlash {
            axis: self.axis,
            backlash: Nanometres(mean.max(0)),
            spread: Nanometres(spread),
        }
    }
}
