//! The travel of a stepper axis: from the home switch to the far switch and back.
//!
//! After homing the far switch is sought as the home switch was: fast, away from it, and then exactly, from below.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure};

use super::Step;
use crate::motion::axis::{Purpose, Stepper};
use crate::motion::home::Homing;
use crate::motion::stage::Stage;
use crate::motion::steps;
use crate::settings::{Settings, StepperSettings};

/// Where the routine is.
#[derive(Clone, Debug)]
enum Phase {
    Home(Homing),
    Search,
    Leave,
    Clear,
    Approach,
    Return { length: Nanometres },
}

/// The routine.
#[derive(Clone, Debug)]
pub(crate) struct Travel {
    axis: Axis,
    phase: Phase,
    /// Whether the switch did in this phase what the phase waits for, and where.
    edge: Option<Nanometres>,
}

impl Travel {
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, phase: Phase::Home(Homing::new()), edge: None }
    }

    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        let axis = self.axis;
        let Some((stepper, settings)) = stage.with_numbers(axis, settings) else { return Step::On };
        if let Phase::Home(homing) = &mut self.phase {
            match homing.tick(stepper, settings) {
                None => {}
                Some(Ok(_)) => self.enter(Phase::Search, stepper, settings),
                Some(Err(failure)) => return Step::Failed(axis, failure),
            }
            return Step::On;
        }
        let awaited = match self.phase {
            Phase::Search | Phase::Approach => stepper.far_closed(),
            Phase::Leave => !stepper.far_closed(),
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
            (Phase::Search, Some(_)) => Phase::Leave,
            (Phase::Leave, Some(_)) => Phase::Clear,
            (Phase::Clear, _) => Phase::Approach,
            (Phase::Approach, Some(length)) => Phase::Return { length },
            (Phase::Return { length }, _) => {
                return Step::Done(Calibration::Travel { axis, length: *length });
            }
            _ => return Step::Failed(axis, Failure::Implausible),
        };
        self.enter(next, stepper, settings);
        Step::On
    }

    fn enter(&mut self, phase: Phase, stepper: &mut Stepper, settings: &StepperSettings) {
        let (way, speed) = match phase {
            Phase::Home(_) => (Nanometres(0), settings.home_leave_speed),
            Phase::Search => (settings.home_search, settings.home_search_speed),
            Phase::Leave => (Nanometres(-settings.home_leave.0), settings.home_leave_speed),
            Phase::Clear => (Nanometres(-settings.home_clearance.0), settings.home_leave_speed),
            Phase::Approach => (settings.home_approach, settings.home_approach_speed),
            Phase::Return { .. } => (Nanometres(0), 0),
        };
        if matches!(phase, Phase::Return { .. }) {
            stepper.go(Nanometres(0));
        } else {
            let target = stepper.position().wrapping_add(steps::to_steps(way));
            stepper.go_steps(target, speed, Purpose::SeekFar);
        }
        (self.phase, self.edge) = (phase, None);
    }
}
