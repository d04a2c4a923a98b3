//! A stepper axis: feeds the step timer, counts, and watches encoder, switches and driver ([`watch`]).
//!
//! The position is what the timer counted, in pulses; the encoder is compared with it all the time. A reported
//! count may lag by up to the running segment (a 1 ms segment at full speed is 40 pulses), so the encoder must lie
//! between the counted pulses and the end of the running segment, give or take [`StepperSettings::following`].
//!
//! Two ways to stop: [`Stepper::stop`] brakes along the ramp and keeps the position; [`Stepper::abort`] takes at most
//! 1 ms and loses it. A motion is over when the timer is idle.
//!
//! The screw has play, so moves end from below: where the flanks do not touch on that side already, the motor first goes
//! farther back than the play is wide. The position is that of the motor with its flanks on that side.

mod watch;

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Failure, PositionState};
use heapless::Deque;

use crate::io::{MotorOutputs, STEP_TIMER_HZ, Segment, StepperState, TICK_HZ, TICK_US};
use crate::motion::ramp::{self, Ramp, RampLimits};
use crate::motion::steps;
use crate::motion::switch::{self, Place, Switch};
use crate::settings::StepperSettings;

/// Segments that may be under way at once: those that wait in the board and the one that runs.
const OUTSTANDING: usize = 6;

/// Motion that is planned in one control tick, in ticks of the step timer: two control ticks of it, so that the queue grows, and no more than
/// that, for a tick in which several segments are planned is a long one.
const PLANNED_TICKS: u32 = STEP_TIMER_HZ / TICK_HZ * 2;

/// What a motion is for: how fast it may change its speed, and which switch may close on it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Purpose {
    /// A move: no switch may close but the home switch near position 0.
    Move,
    /// Looks for the home switch.
    SeekHome,
    /// Looks for the far switch.
    SeekFar,
}

#[derive(Clone, Debug)]
enum Motion {
    Still,
    /// Driver and direction are set up; pulses follow after these ticks.
    Preparing {
        ramp: Ramp,
        ticks: u32,
    },
    Stepping {
        ramp: Ramp,
        quiet_ticks: u32,
    },
    /// Everything was thrown away; waits for the running segment to end.
    Aborting {
        ticks: u32,
    },
}

/// A stepper axis.
#[derive(Clone, Debug)]
pub(crate) struct Stepper {
    settings: StepperSettings,
    state: PositionState,
    motion: Motion,
    away: bool,
    purpose: Purpose,
    enabled: bool,
    /// How long the driver has been on.
    enabled_ticks: u32,
    /// The first pulse may be given: the memory knows that the axis moves.
    permitted: bool,
    /// Where the motion goes on to, when the axis has gone back far enough to come from below.
    then: Option<i32>,
    /// Pulses upwards until the screw's flanks surely touch on that side.
    slack: u32,
    /// Position in counted pulses; from the reset's position until homed.
    position: i32,
    /// Encoder reading at position 0.
    encoder_zero: i32,
    encoder: i32,
    pulses: Option<u32>,
    total_pulses: u64,
    /// Pulses in which the rotor may still fall to a pole.
    falling: u32,
    /// Pulses of the segments under way, oldest first, and how many of the oldest are counted already.
    outstanding: Deque<u16, OUTSTANDING>,
    counted_of_oldest: u32,
    target: Nanometres,
    speed: u32,
    fault: Option<Failure>,
    home_switch: Switch,
    far_switch: Switch,
    driver_fault: bool,
}

impl Stepper {
    pub(crate) const fn new(settings: StepperSettings) -> Self {
        Self {
            settings,
            state: PositionState::Unknown,
            motion: Motion::Still,
            away: true,
            purpose: Purpose::Move,
            enabled: false,
            enabled_ticks: 0,
            permitted: true,
            then: None,
            slack: u32::MAX,
            position: 0,
            encoder_zero: 0,
            encoder: 0,
            pulses: None,
            total_pulses: 0,
            falling: 0,
            outstanding: Deque::new(),
            counted_of_oldest: 0,
            target: Nanometres(0),
            speed: 0,
            fault: None,
            home_switch: Switch::new(),
            far_switch: Switch::new(),
            driver_fault: false,
        }
    }

    /// Whether the home switch is closed.
    pub(crate) const fn home_closed(&self) -> bool {
        self.home_switch.is_closed()
    }

    /// Whether the home switch says what it is believed to say.
    pub(crate) const fn home_is_steady(&self) -> bool {
        self.home_switch.is_steady()
    }

    /// Where the home switch (or the far one) changed last.
    pub(crate) const fn changed(&self, far: bool) -> Place {
        if far { self.far_switch.changed() } else { self.home_switch.changed() }
    }

    /// Whether the driver reported a fault at the last tick.
    pub(crate) const fn driver_fault(&self) -> bool {
        self.driver_fault
    }

    /// Whether the far switch is closed.
    pub(crate) const fn far_closed(&self) -> bool {
        self.far_switch.is_closed()
    }

    /// What is known of the position.
    pub(crate) const fn state(&self) -> PositionState {
        self.state
    }

    /// Position in pulses, as counted.
    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    /// Position as the encoder sees it.
    pub(crate) const fn measured(&self) -> Nanometres {
        steps::encoder_to_nanometres(self.encoder.wrapping_sub(self.encoder_zero))
    }

    /// Where it was last sent.
    pub(crate) const fn target(&self) -> Nanometres {
        self.target
    }

    /// Pulses given since the reset.
    pub(crate) const fn total_pulses(&self) -> u64 {
        self.total_pulses
    }

    /// Whether no pulse comes any more.
    pub(crate) const fn is_still(&self) -> bool {
        matches!(self.motion, Motion::Still)
    }

    /// Whether it stands, and its switches say what is believed.
    pub(crate) const fn is_settled_idle(&self) -> bool {
        self.is_still() && self.home_switch.is_steady() && self.far_switch.is_steady()
    }

    /// Why the last motion ended early; given once.
    pub(crate) const fn take_fault(&mut self) -> Option<Failure> {
        self.fault.take()
    }

    /// Takes other numbers; the axis stands still.
    pub(crate) const fn apply(&mut self, settings: StepperSettings) {
        self.settings = settings;
    }

    /// Whether the first pulse of a motion may be given.
    pub(crate) const fn permit(&mut self, permitted: bool) {
        self.permitted = permitted;
    }

    /// How far below its target a move may have to go to come from below.
    pub(crate) const fn approach(&self) -> Nanometres {
        let StepperSettings { backlash, approach_margin, .. } = self.settings;
        if backlash.0 == 0 { Nanometres(0) } else { Nanometres(backlash.0 + approach_margin.0) }
    }

    /// Goes to a position at the speed of moves. The caller has checked limits and state.
    pub(crate) fn go(&mut self, target: Nanometres) {
        self.target = target;
        self.go_from_below(steps::to_steps(target), self.settings.speed, Purpose::Move);
    }

    /// Goes to a pulse so that the screw's flanks touch as always.
    pub(crate) fn go_from_below(&mut self, target: i32, speed: u32, purpose: Purpose) {
        let approach = steps::to_steps(self.approach());
        let way = i64::from(target) - i64::from(self.position);
        let touching = i64::from(self.slack.min(approach.unsigned_abs())) <= way;
        if touching || approach == 0 {
            self.go_steps(target, speed, purpose);
        } else {
            self.go_steps(target.saturating_sub(approach), speed, purpose);
            self.then = Some(target);
        }
    }

    /// Goes to a pulse at a speed. Nothing happens while it moves.
    pub(crate) fn go_steps(&mut self, target: i32, speed: u32, purpose: Purpose) {
        if !self.is_still() {
            return;
        }
        self.counted_of_oldest = 0;
        self.purpose = purpose;
        self.speed = speed;
        self.then = None;
        self.set_off(target);
    }

    fn set_off(&mut self, target: i32) {
        let way = target.wrapping_sub(self.position);
        if way == 0 {
            self.motion = Motion::Still;
            return;
        }
        self.away = way > 0;
        let settings = &self.settings;
        let (acceleration, jerk) = match self.purpose {
            Purpose::Move => (settings.acceleration, settings.jerk),
            Purpose::SeekHome | Purpose::SeekFar => (settings.home_acceleration, settings.home_jerk),
        };
        let limits = RampLimits { start_speed: settings.start_speed, speed: self.speed, acceleration, jerk };
        // One tick at least, so that DIR is stable before STEP.
        let ticks = (settings.enable_delay.0 / TICK_US + 1).saturating_sub(self.enabled_ticks).max(1);
        self.enabled = true;
        self.motion = Motion::Preparing { ramp: Ramp::new(way.unsigned_abs(), limits), ticks };
    }

    /// Brakes along the ramp.
    pub(crate) fn stop(&mut self) {
        self.then = None;
        match &mut self.motion {
            Motion::Preparing { .. } => self.motion = Motion::Still,
            Motion::Stepping { ramp, .. } => ramp.stop(),
            Motion::Still | Motion::Aborting { .. } => {}
        }
    }

    /// Stops within a millisecond. An axis that moved has lost its position: a motor that is stopped from full speed may
    /// slip.
    pub(crate) fn abort(&mut self) {
        self.then = None;
        match self.motion {
            Motion::Still | Motion::Aborting { .. } => {}
            Motion::Preparing { .. } => self.motion = Motion::Still,
            Motion::Stepping { .. } => {
                self.lose();
                self.motion = Motion::Aborting { ticks: 0 };
            }
        }
    }

    /// It was in motion when the power went.
    pub(crate) const fn was_interrupted(&mut self) {
        self.state = PositionState::Lost;
    }

    /// The lowest position on the way that is under way; where the position is not known, the lowest there is.
    pub(crate) fn lowest(&self) -> Nanometres {
        match (self.state, &self.motion) {
            (PositionState::Homed, Motion::Still) => self.measured(),
            (PositionState::Homed, _) if self.purpose == Purpose::Move => {
                let back = self.target.0.saturating_sub(self.approach().0);
                Nanometres(self.measured().0.min(back))
            }
            // One that was led below its switch comes up from there.
            (PositionState::Homed, _) => self.measured().min(self.lowest_of_homing()),
            // Wherever the search for its switch brought it, or may bring it.
            _ => self.lowest_of_homing(),
        }
    }

    /// The lowest position that homing comes to: beyond its switch it brakes.
    pub(crate) fn lowest_of_homing(&self) -> Nanometres {
        let settings = &self.settings;
        let limits = RampLimits {
            start_speed: settings.start_speed,
            speed: settings.home_search_speed.max(settings.start_speed),
            acceleration: settings.home_acceleration,
            jerk: settings.home_jerk,
        };
        // What was handed over is played, a millisecond each; the switch is believed after some ticks.
        let late_us = OUTSTANDING as u32 * 1_000 + u32::from(switch::SAMPLES) * TICK_US;
        let late = u64::from(limits.speed) * u64::from(late_us) / 1_000_000;
        let way = ramp::braking(&limits).saturating_add(late as u32); // some milliseconds of pulses
        let way = steps::to_nanometres(i32::try_from(way).unwrap_or(i32::MAX));
        Nanometres(settings.min.0.min(0).saturating_sub(way.0))
    }

    /// Believes the encoder: homing begins from a position that steps and encoder do not agree on.
    pub(crate) const fn follow_encoder(&mut self) {
        self.position = steps::to_steps(self.measured());
    }

    /// Believes the encoder, also while the first pulses wake a rotor that stood between two poles: a jam that was freed may have left it there.
    /// It falls by half a period of the torque, 32 pulses, and swings on. That many pulses of a motor that is blocked are no
    /// following error yet.
    pub(crate) const fn begin_to_home(&mut self) {
        self.follow_encoder();
        self.falling = 32;
    }

    /// Makes the edge of the home switch, which was met going down at `edge` (in pulses of the present count), position 0
    /// and the position known; gives how far the encoder's zero moved. The axis stands still. Coming from below the
    /// motor is the backlash farther up when the stage is there. The switch sees what the axis carries, `carried` farther away
    /// from it: without that it would have been met there.
    pub(crate) const fn set_home(&mut self, edge: i32, carried: Nanometres) -> Nanometres {
        let farther = self.settings.backlash.0.saturating_add(carried.0);
        let zero = edge.wrapping_add(steps::to_steps(Nanometres(farther)));
        self.position = self.position.wrapping_sub(zero);
        let expected = steps::to_encoder(steps::to_nanometres(self.position));
        let new_zero = self.encoder.wrapping_sub(expected);
        let shift = steps::encoder_to_nanometres(new_zero.wrapping_sub(self.encoder_zero));
        self.encoder_zero = new_zero;
        self.state = PositionState::Homed;
        self.target = Nanometres(0);
        shift
    }

    /// Orders the board; feeds the timer.
    pub(crate) fn act(&mut self, stepper: &StepperState, outputs: &mut MotorOutputs) {
        outputs.enable = self.enabled;
        self.enabled_ticks = if self.enabled { self.enabled_ticks.saturating_add(1) } else { 0 };
        outputs.direction_away = self.away;
        match &mut self.motion {
            Motion::Still => {}
            Motion::Aborting { .. } => outputs.abort_steps = true,
            Motion::Preparing { ramp, ticks } => {
                outputs.abort_steps = true; // forgets an underrun from before
                *ticks = ticks.saturating_sub(1);
                if *ticks == 0 && self.permitted {
                    self.motion = Motion::Stepping { ramp: ramp.clone(), quiet_ticks: 0 };
                }
            }
            Motion::Stepping { ramp, .. } => {
                let mut planned = 0;
                for _ in 0..stepper.room {
                    if outputs.segments.is_full() || self.outstanding.is_full() || planned >= PLANNED_TICKS {
                        break;
                    }
                    let Some(segment) = ramp.next() else { break };
                    planned += u32::from(segment.pulses) * u32::from(segment.period_ticks);
                    feed(&mut self.outstanding, outputs, segment);
                }
            }
        }
    }
}

/// Hands a segment over and remembers it. There is room in both: the caller has looked.
fn feed(outstanding: &mut Deque<u16, OUTSTANDING>, outputs: &mut MotorOutputs, segment: Segment) {
    if outputs.segments.push(segment).is_ok() {
        let _ = outstanding.push_back(segment.pulses);
    }
}
