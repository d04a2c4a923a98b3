//! Homing: finds the switch fast, then exactly.
//!
//! 1. Search: towards the switch at some speed, braking when it closes. Left out where it is closed already.
//! 2. Leave: away until it opens, then a little further.
//! 3. Approach: a pulse a millisecond until it closes again; that edge, with the screw's backlash and what a piezo on the
//!    stage carries the switch's tab away, becomes position 0. Only from a switch that is open: one that closed again by
//!    itself would put position 0 anywhere.
//!
//!    The three edges have to lie together: one that closes above where it opened, or either far from the other, is a broken wire or
//!    a dead contact, and its position 0 would be anywhere.
//! 4. Return: to position 0 from below, like every move.
//!
//! The exact approach always comes from the same side at the same speed, so that the switch's hysteresis and its
//! delay cancel; what is left is its own repeatability.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Failure, PositionState};

use crate::motion::axis::{Purpose, Stepper};
use crate::motion::leg::{Leg, Until};
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

/// What a switch repeats to, with its bounce at the speed of the search: so far it may open below where it closed.
const REPEATS: i32 = 5_000;

/// Whether a switch that closed and opened at these pulses did so by one and the same edge. Between them lie its hysteresis and the
/// screw's play, for which the clearance is made.
fn is_one_edge(closed: i32, opened: i32, settings: &StepperSettings) -> bool {
    let apart = steps::to_nanometres(opened.saturating_sub(closed)).0;
    (-REPEATS..=settings.home_clearance.0).contains(&apart)
}

/// A homing under way.
#[derive(Clone, Debug)]
pub(crate) struct Homing {
    phase: Phase,
    leg: Leg,
    /// The pulse at which the search met the switch, where there was one.
    closed: Option<i32>,
    /// The pulse at which it opened.
    opened: i32,
    /// Whether the position was ever known, so that the shift says something.
    known_before: bool,
}

impl Homing {
    /// Begins with the next tick, when the switch was read.
    pub(crate) const fn new() -> Self {
        Self { phase: Phase::Begin, leg: Leg::REST, closed: None, opened: 0, known_before: false }
    }

    /// Goes on while the axis has no fault; gives the shift of position 0 at the end. `carried`: how far the piezo on the stage
    /// holds the switch's tab away.
    pub(crate) fn tick(
        &mut self,
        axis: &mut Stepper,
        settings: &StepperSettings,
        carried: Nanometres,
    ) -> Option<Result<Nanometres, Failure>> {
        if !self.leg.is_over(axis) {
            return None;
        }
        self.phase = match (self.phase, self.leg.edge()) {
            // One that bounces, or was just released, says in a moment what it is.
            (Phase::Begin, _) if !axis.home_is_steady() => return None,
            (Phase::Begin, _) => {
                self.known_before = axis.state() != PositionState::Unknown;
                if axis.state() != PositionState::Homed {
                    axis.follow_encoder();
                }
                if axis.home_closed() { Phase::Leave } else { Phase::Search }
            }
            (Phase::Search, Some(edge)) => {
                self.closed = Some(edge.position);
                Phase::Leave
            }
            (Phase::Leave, Some(edge))
                if self.closed.is_some_and(|closed| !is_one_edge(closed, edge.position, settings)) =>
            {
                return Some(Err(Failure::HomeSwitchStuck));
            }
            (Phase::Leave, Some(edge)) => {
                self.opened = edge.position;
                Phase::Clear
            }
            (Phase::Clear, _) if axis.home_closed() => return Some(Err(Failure::HomeSwitchStuck)),
            (Phase::Clear, _) => Phase::Approach,
            (Phase::Approach, Some(zero)) if !is_one_edge(zero.position, self.opened, settings) => {
                return Some(Err(Failure::HomeSwitchStuck));
            }
            (Phase::Approach, Some(zero)) => {
                let shift = axis.set_home(zero.position, carried);
                Phase::Return { shift: if self.known_before { shift } else { Nanometres(0) } }
            }
            (Phase::Return { shift }, _) => return Some(Ok(shift)),
            (Phase::Leave, None) => return Some(Err(Failure::HomeSwitchStuck)),
            (Phase::Search | Phase::Approach, None) => return Some(Err(Failure::HomeSwitchNotFound)),
        };
        self.leg = set_off(self.phase, axis, settings);
        None
    }
}

/// The leg of a phase.
fn set_off(phase: Phase, axis: &mut Stepper, settings: &StepperSettings) -> Leg {
    let leave_speed = settings.home_leave_speed;
    let (way, until) = match phase {
        Phase::Begin => return Leg::REST,
        Phase::Search => ((-settings.home_search.0, settings.home_search_speed), Until::Home(true)),
        Phase::Leave => ((settings.home_leave.0, leave_speed), Until::Home(false)),
        Phase::Clear => ((settings.home_clearance.0, leave_speed), Until::Arrival),
        Phase::Approach => ((-settings.home_approach.0, settings.home_approach_speed), Until::Home(true)),
        Phase::Return { .. } => {
            axis.go_from_below(0, leave_speed, Purpose::SeekHome);
            return Leg::REST;
        }
    };
    Leg::start(axis, way, Purpose::SeekHome, until)
}
