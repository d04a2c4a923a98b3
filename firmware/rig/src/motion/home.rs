//! Homing: finds the switch fast, then exactly.
//!
//! 1. Search: towards the switch at some speed, braking when it closes. Left out where it is closed already.
//! 2. Leave: away until it opens, then a little further.
//! 3. Approach: a pulse a millisecond until it closes again; that edge, with the screw's backlash, becomes position 0.
//! 4. Return: to position 0 from below, like every move.
//!
//! The exact approach always comes from the same side at the same speed, so that the switch's hysteresis and its
//! delay cancel; what is left is its own repeatability.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Failure, PositionState};

use crate::motion::axis::{Purpose, Stepper};
use crate::motion::steps;
use crate::settings::StepperSettings;

/// Where homing is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Begin,
    Search,
    Leave,
    Clear,
    Approach,
    Return { shift: Nanometres },
}

/// A homing under way.
#[derive(Clone, Debug)]
pub(crate) struct Homing {
    phase: Phase,
    /// Whether the switch did in this phase what the phase waits for, and at which pulse.
    edge: Option<i32>,
    /// Whether the position was ever known, so that the shift says something.
    known_before: bool,
}

impl Homing {
    /// Begins with the next tick, when the switch was read.
    pub(crate) const fn new() -> Self {
        Self { phase: Phase::Begin, edge: None, known_before: false }
    }

    /// Goes on while the axis has no fault; gives the shift of position 0 at the end.
    pub(crate) fn tick(
        &mut self,
        axis: &mut Stepper,
        settings: &StepperSettings,
    ) -> Option<Result<Nanometres, Failure>> {
        let home_switch = axis.home_closed();
        let awaited = match self.phase {
            Phase::Search | Phase::Approach => home_switch,
            Phase::Leave => !home_switch,
            Phase::Begin | Phase::Clear | Phase::Return { .. } => false,
        };
        if awaited && self.edge.is_none() {
            self.edge = Some(axis.position());
            axis.stop();
        }
        if !axis.is_still() {
            return None;
        }
        let next = match (self.phase, self.edge) {
            (Phase::Begin, _) => {
                self.known_before = axis.state() != PositionState::Unknown;
                if axis.state() != PositionState::Homed {
                    axis.follow_encoder();
                }
                if home_switch { Phase::Leave } else { Phase::Search }
            }
            (Phase::Search, Some(_)) => Phase::Leave,
            (Phase::Leave, Some(_)) => Phase::Clear,
            (Phase::Clear, _) => Phase::Approach,
            (Phase::Approach, Some(zero)) => {
                let shift = axis.set_home(zero);
                Phase::Return { shift: if self.known_before { shift } else { Nanometres(0) } }
            }
            (Phase::Return { shift }, _) => return Some(Ok(shift)),
            (Phase::Leave, None) => return Some(Err(Failure::HomeSwitchStuck)),
            (Phase::Search | Phase::Approach, None) => return Some(Err(Failure::HomeSwitchNotFound)),
        };
        self.enter(next, axis, settings);
        None
    }

    fn enter(&mut self, phase: Phase, axis: &mut Stepper, settings: &StepperSettings) {
        (self.phase, self.edge) = (phase, None);
        let (way, speed) = match phase {
            Phase::Begin => (0, settings.home_approach_speed),
            Phase::Search => (-steps::to_steps(settings.home_search), settings.home_search_speed),
            Phase::Leave => (steps::to_steps(settings.home_leave), settings.home_leave_speed),
            Phase::Clear => (steps::to_steps(settings.home_clearance), settings.home_leave_speed),
            Phase::Approach => (-steps::to_steps(settings.home_approach), settings.home_approach_speed),
            Phase::Return { .. } => {
                axis.go_from_below(0, settings.home_leave_speed, Purpose::SeekHome);
                return;
            }
        };
        axis.go_steps(axis.position().wrapping_add(way), speed, Purpose::SeekHome);
    }
}
