//! Backlash of a screw, measured at the home switch, which the stage actuates. The switch closes going down and opens a
//! known distance higher going up; the additional motor travel is the backlash. Each round closes and opens it once, a pulse
//! per millisecond, with positions by encoder. Position 0 depends on the backlash, so the axis is homed again.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure, StepperKeys};

use super::{Step, go_home};
use crate::motion::axis::{Purpose, Stepper};
use crate::motion::home::Homing;
use crate::motion::leg::{Leg, Until};
use crate::motion::stage::Stage;
use crate::settings::{Settings, StepperSettings};

const ROUNDS: usize = 5;
/// Largest plausible backlash; also the setting's range.
const MOST: i32 = 100_000;

#[derive(Clone, Debug)]
enum Phase {
    Home(Homing),
    Clear,
    Close,
    /// Further than any play.
    Pass {
        closed: Nanometres,
    },
    Open {
        closed: Nanometres,
    },
    HomeAgain(Homing),
}

#[derive(Clone, Debug)]
pub(crate) struct Backlash {
    axis: Axis,
    phase: Phase,
    leg: Leg,
    rounds: heapless::Vec<i32, ROUNDS>,
}

impl Backlash {
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, phase: Phase::Home(Homing::new()), leg: Leg::REST, rounds: heapless::Vec::new() }
    }

    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        let axis = self.axis;
        let carried = stage.carried(axis);
        let Some((stepper, settings)) = stage.with_numbers(axis, settings) else { return Step::On };
        let next = match &mut self.phase {
            Phase::Home(homing) => match go_home(homing, axis, stepper, settings, carried) {
                Ok(()) => Phase::Clear,
                Err(step) => return step,
            },
            Phase::HomeAgain(homing) => {
                return match go_home(homing, axis, stepper, settings, carried) {
                    Ok(()) => Step::Done(self.result(settings)),
                    Err(step) => step,
                };
            }
            _ if !self.leg.is_over(stepper) => return Step::On,
            phase => match (phase, self.leg.edge()) {
                (Phase::Clear, _) => Phase::Close,
                (Phase::Close, Some(edge)) => Phase::Pass { closed: edge.measured },
                (Phase::Pass { closed }, _) => Phase::Open { closed: *closed },
                (Phase::Open { closed }, Some(opened)) => {
                    // Full only at the end of the routine.
                    let _ = self.rounds.push(opened.measured.0.saturating_sub(closed.0));
                    if self.rounds.is_full() {
                        self.phase = Phase::HomeAgain(Homing::new());
                        return self.found(settings);
                    }
                    Phase::Clear
                }
                // Homing has shown that the switch works.
                _ => return Step::Failed(axis, Failure::Implausible),
            },
        };
        self.leg = set_off(&next, stepper, settings);
        self.phase = next;
        Step::On
    }

    fn found(&self, settings: &StepperSettings) -> Step {
        let backlash = self.mean(settings);
        match StepperKeys::of(self.axis) {
            Some(keys) if (-1_000..=MOST).contains(&backlash) => Step::Set(keys.backlash, backlash.max(0)),
            _ => Step::Failed(self.axis, Failure::Implausible),
        }
    }

    /// Mean of the rounds, without the switch's hysteresis.
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

fn set_off(phase: &Phase, stepper: &mut Stepper, settings: &StepperSettings) -> Leg {
    let (leave_speed, approach_speed) = (settings.home_leave_speed, settings.home_approach_speed);
    let (way, until) = match phase {
        Phase::Home(_) | Phase::HomeAgain(_) => return Leg::REST,
        Phase::Clear => {
            ((settings.home_clearance.0 + settings.home_hysteresis.0, leave_speed), Until::Arrival)
        }
        Phase::Close => ((-settings.home_approach.0, approach_speed), Until::Home(true)),
        Phase::Pass { .. } => ((-settings.home_clearance.0, leave_speed), Until::Arrival),
        Phase::Open { .. } => ((settings.home_approach.0, approach_speed), Until::Home(false)),
    };
    Leg::start(stepper, way, Purpose::SeekHome, until)
}
