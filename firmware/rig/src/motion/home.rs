//! Homing: finds the switch fast, then exactly.
//!
//! 1. Search towards the switch, braking when it closes; skipped if already closed.
//! 2. Leave until it opens, then a little further.
//! 3. Approach, a pulse per millisecond, until it closes again; this edge, corrected for backlash and the piezo's
//!    displacement of the tab, becomes position 0. The switch must close where it first closed and open where its
//!    hysteresis predicts: other edges indicate a broken wire or a dead contact.
//! 4. Return to position 0 from below, like every move.
//!
//! The approach always has the same side and speed, so that hysteresis and delay cancel; repeatability remains.

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

/// Tolerance between edges of one switch at different speeds.
const REPEATS: i32 = 5_000;

/// Delay of the closing edge in the fast search: 5 ms of bounce at 4 mm/s, and 0.6 ms of filtering.
const SEARCH_LATE: i32 = 25_000;

/// `most` is in nm.
fn is_above(lower: i32, upper: i32, most: i32) -> bool {
    let apart = steps::to_nanometres(upper.saturating_sub(lower)).0;
    (-REPEATS..=most).contains(&apart)
}

#[derive(Clone, Debug)]
pub(crate) struct Homing {
    phase: Phase,
    leg: Leg,
    closed: Option<i32>,
    opened: i32,
    /// The position was known before, so the shift is meaningful.
    known_before: bool,
}

impl Homing {
    pub(crate) const fn new() -> Self {
        Self { phase: Phase::Begin, leg: Leg::REST, closed: None, opened: 0, known_before: false }
    }

    /// Returns the shift of position 0 at the end. `carried`: the piezo's displacement of the switch's tab, if known.
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
            // A bouncing switch settles soon.
            (Phase::Begin, _) if !axis.home_is_steady() => return None,
            (Phase::Begin, _) => {
                self.known_before = axis.state() != PositionState::Unknown;
                // A deviation permitted at rest would become a fault with the encoder's lag in motion.
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
            // It was closed initially: a second approach confirms the first.
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
