//! Homing: finds the switch fast, then exactly.
//!
//! 1. Search: towards the switch at some speed, braking when it closes. Left out where it is closed already.
//! 2. Leave: away until it opens, then a little further.
//! 3. Approach: a pulse a millisecond until it closes again; that edge, with the screw's backlash and what a piezo on the
//!    stage carries the switch's tab away, becomes position 0. Only from a switch that is open: one that closed again by
//!    itself would put position 0 anywhere.
//!
//!    It has to close where it closed first, in the search or in an approach before this one, and to open where a switch
//!    opens that closes there: edges that lie apart are a broken wire's or a dead contact's.
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

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Begin,
    Search,
    Leave,
    Clear,
    Approach,
    Return { shift: Nanometres },
}

/// How far the edges of one switch, met at different speeds, may lie on the wrong side of each other.
const REPEATS: i32 = 5_000;

/// How much lower the fast search may see it close: a contact bounces for 5 ms, at 4 mm/s, and is believed 0.6 ms after that.
const SEARCH_LATE: i32 = 25_000;

/// Whether pulse `upper` lies above pulse `lower`, by no more than `most` (nm).
fn is_above(lower: i32, upper: i32, most: i32) -> bool {
    let apart = steps::to_nanometres(upper.saturating_sub(lower)).0;
    (-REPEATS..=most).contains(&apart)
}

/// A homing under way.
#[derive(Clone, Debug)]
pub(crate) struct Homing {
    phase: Phase,
    leg: Leg,
    /// The pulse at which it closed first.
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
    /// holds the switch's tab away, where that is known.
    pub(crate) fn tick(
        &mut self,
        axis: &mut Stepper,
        settings: &StepperSettings,
        carried: Option<Nanometres>,
    ) -> Option<Result<Nanometres, Failure>> {
        if !self.leg.is_over(axis) {
            return None;
        }
        let Some(carried) = carried else { return Some(Err(Failure::Gauge)) };
        self.phase = match (self.phase, self.leg.edge()) {
            // One that bounces, or was just released, says in a moment what it is.
            (Phase::Begin, _) if !axis.home_is_steady() => return None,
            (Phase::Begin, _) => {
                self.known_before = axis.state() != PositionState::Unknown;
                // A disagreement that is allowed at rest becomes a fault by the encoder's lag in motion.
                axis.begin_to_home();
                if axis.home_closed() { Phase::Leave } else { Phase::Search }
            }
            (Phase::Search, Some(edge)) => {
                self.closed = Some(edge.position);
                Phase::Leave
            }
            (Phase::Leave, Some(edge)) => {
                self.opened = edge.position;
                let one_switch = |closed| is_above(closed, self.opened, settings.home_zone.0);
                if !self.closed.is_none_or(one_switch) {
                    return Some(Err(Failure::HomeSwitchStuck));
                }
                Phase::Clear
            }
            (Phase::Clear, _) if axis.home_closed() => return Some(Err(Failure::HomeSwitchStuck)),
            (Phase::Clear, _) => Phase::Approach,
            (Phase::Approach, Some(zero))
                if !is_above(zero.position, self.opened, settings.home_zone.0)
                    || self.closed.is_some_and(|closed| !is_above(closed, zero.position, SEARCH_LATE)) =>
            {
                return Some(Err(Failure::HomeSwitchStuck));
            }
            // It was closed from the beginning: a second approach bears the first one out.
            (Phase::Approach, Some(edge)) if self.closed.is_none() => {
                self.closed = Some(edge.position);
                Phase::Leave
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
