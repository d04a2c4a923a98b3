//! Travel of a stepper axis between home and far switch, which is found like the home switch: fast, then exactly.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure};

use super::{Step, go_home};
use crate::motion::axis::{Purpose, Stepper};
use crate::motion::home::Homing;
use crate::motion::leg::{Leg, Until};
use crate::motion::stage::Stage;
use crate::settings::{Settings, StepperSettings};

#[derive(Clone, Debug)]
enum Phase {
    Home(Homing),
    Search,
    Leave,
    Clear,
    Approach,
    Return { length: Nanometres },
}

#[derive(Clone, Debug)]
pub(crate) struct Travel {
    axis: Axis,
    phase: Phase,
    leg: Leg,
}

impl Travel {
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, phase: Phase::Home(Homing::new()), leg: Leg::REST }
    }

    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        let axis = self.axis;
        let carried = stage.carried(axis);
        let Some((stepper, settings)) = stage.with_numbers(axis, settings) else { return Step::On };
        let next = if let Phase::Home(homing) = &mut self.phase {
            match go_home(homing, axis, stepper, settings, carried) {
                Ok(()) => Phase::Search,
                Err(step) => return step,
            }
        } else {
            if !self.leg.is_over(stepper) {
                return Step::On;
            }
            match (&self.phase, self.leg.edge()) {
                (Phase::Search, Some(_)) => Phase::Leave,
                (Phase::Leave, Some(_)) => Phase::Clear,
                (Phase::Clear, _) => Phase::Approach,
                (Phase::Approach, Some(far)) => Phase::Return { length: far.measured },
                (Phase::Return { length }, _) => {
                    return Step::Done(Calibration::Travel { axis, length: *length });
                }
                _ => return Step::Failed(axis, Failure::Implausible),
            }
        };
        self.leg = set_off(&next, stepper, settings);
        self.phase = next;
        Step::On
    }
}

fn set_off(phase: &Phase, stepper: &mut Stepper, settings: &StepperSettings) -> Leg {
    let leave_speed = settings.home_leave_speed;
    let (way, until) = match phase {
        Phase::Home(_) => return Leg::REST,
        Phase::Search => ((settings.home_search.0, settings.home_search_speed), Until::Far(true)),
        Phase::Leave => ((-settings.home_leave.0, leave_speed), Until::Far(false)),
        Phase::Clear => ((-settings.home_clearance.0, leave_speed), Until::Arrival),
        Phase::Approach => ((settings.home_approach.0, settings.home_approach_speed), Until::Far(true)),
        Phase::Return { .. } => {
            stepper.go(Nanometres(0));
            return Leg::REST;
        }
    };
    Leg::start(stepper, way, Purpose::SeekFar, until)
}
