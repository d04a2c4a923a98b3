//! A stepper axis: feeds the step timer, counts, and checks encoder, switches and driver ([`watch`]).
//!
//! The position is the timer's pulse count, continuously compared with the encoder. The count may lag by the running
//! segment (1 ms at full speed is 40 pulses), so the encoder must be between the counted pulses and the segment's end,
//! within [`StepperSettings::following`]. [`Stepper::stop`] brakes along the ramp and keeps the position;
//! [`Stepper::abort`] takes at most 1 ms and loses it. A motion ends when the timer is idle.
//!
//! Because of the screw's play moves end from below: if the flanks do not touch on that side, the motor first moves
//! back by more than the play. The position is that with touching flanks.

mod watch;

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Failure, PositionState};
use heapless::Deque;

use crate::io::{MotorOutputs, STEP_TIMER_HZ, Segment, StepperState, TICK_HZ, TICK_US};
use crate::motion::ramp::{self, Ramp, RampLimits};
use crate::motion::steps;
use crate::motion::switch::{self, Place, Switch};
use crate::settings::StepperSettings;

/// Segments queued in the board plus the running one.
const OUTSTANDING: usize = 6;

/// Motion planned per control tick: two control ticks so that the queue grows; planning more takes too long.
const PLANNED_TICKS: u32 = STEP_TIMER_HZ / TICK_HZ * 2;

/// Selects jerk, acceleration, and the switch that may close.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Purpose {
    /// A move: only the home switch near position 0 may close.
    Move,
    SeekHome,
    SeekFar,
}

#[derive(Clone, Debug)]
enum Motion {
    Still,
    /// Driver and direction are set; pulses follow after these ticks.
    Preparing {
        ramp: Ramp,
        ticks: u32,
    },
    Stepping {
        ramp: Ramp,
        quiet_ticks: u32,
    },
    Aborting {
        ticks: u32,
    },
}

#[derive(Clone, Debug)]
pub(crate) struct Stepper {
    settings: StepperSettings,
    state: PositionState,
    motion: Motion,
    away: bool,
    purpose: Purpose,
    enabled: bool,
    /// Ticks since the driver was enabled.
    enabled_ticks: u32,
    /// The motion is recorded in memory; the first pulse is permitted.
    permitted: bool,
    /// Final target after moving back to approach from below.
    then: Option<i32>,
    /// Upward pulses until the screw's flanks touch.
    slack: u32,
    /// Counted pulses; relative to the reset until homed.
    position: i32,
    encoder_zero: i32,
    encoder: i32,
    pulses: Option<u32>,
    total_pulses: u64,
    /// Pulses in which the rotor may still snap to a pole.
    falling: u32,
    /// Pulses of outstanding segments, oldest first, and the counted part of the oldest.
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

    pub(crate) const fn home_closed(&self) -> bool {
        self.home_switch.is_closed()
    }

    /// The home switch's samples agree with its state.
    pub(crate) const fn home_is_steady(&self) -> bool {
        self.home_switch.is_steady()
    }

    pub(crate) const fn changed(&self, far: bool) -> Place {
        if far { self.far_switch.changed() } else { self.home_switch.changed() }
    }

    pub(crate) const fn driver_fault(&self) -> bool {
        self.driver_fault
    }

    pub(crate) const fn far_closed(&self) -> bool {
        self.far_switch.is_closed()
    }

    pub(crate) const fn state(&self) -> PositionState {
        self.state
    }

    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    pub(crate) const fn measured(&self) -> Nanometres {
        steps::encoder_to_nanometres(self.encoder.wrapping_sub(self.encoder_zero))
    }

    pub(crate) const fn target(&self) -> Nanometres {
        self.target
    }

    pub(crate) const fn total_pulses(&self) -> u64 {
        self.total_pulses
    }

    /// No more pulses come.
    pub(crate) const fn is_still(&self) -> bool {
        matches!(self.motion, Motion::Still)
    }

    pub(crate) const fn is_settled_idle(&self) -> bool {
        self.is_still() && self.home_switch.is_steady() && self.far_switch.is_steady()
    }

    /// Given once.
    pub(crate) const fn take_fault(&mut self) -> Option<Failure> {
        self.fault.take()
    }

    /// The axis must be at rest.
    pub(crate) const fn apply(&mut self, settings: StepperSettings) {
        self.settings = settings;
    }

    /// Permits the first pulse of a motion.
    pub(crate) const fn permit(&mut self, permitted: bool) {
        self.permitted = permitted;
    }

    /// Distance below the target for an approach from below.
    pub(crate) const fn approach(&self) -> Nanometres {
        let StepperSettings { backlash, approach_margin, .. } = self.settings;
        if backlash.0 == 0 { Nanometres(0) } else { Nanometres(backlash.0 + approach_margin.0) }
    }

    pub(crate) fn go(&mut self, target: Nanometres) {
        self.target = target;
        self.go_from_below(steps::to_steps(target), self.settings.speed, Purpose::Move);
    }

    /// Moves to a pulse with touching flanks.
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

    /// Moves to a pulse at a speed. Ignored during motion.
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
        // At least one tick, so that DIR is stable before STEP.
        let ticks = (settings.enable_delay.0 / TICK_US + 1).saturating_sub(self.enabled_ticks).max(1);
        self.enabled = true;
        self.motion = Motion::Preparing { ramp: Ramp::new(way.unsigned_abs(), limits), ticks };
    }

    pub(crate) fn stop(&mut self) {
        self.then = None;
        match &mut self.motion {
            Motion::Preparing { .. } => self.motion = Motion::Still,
            Motion::Stepping { ramp, .. } => ramp.stop(),
            Motion::Still | Motion::Aborting { .. } => {}
        }
    }

    /// Stops within a millisecond. A moving axis loses its position, because a motor stopped from full speed may slip.
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

    pub(crate) const fn was_interrupted(&mut self) {
        self.state = PositionState::Lost;
    }

    /// Lowest position of the current motion; of the travel if unknown.
    pub(crate) fn lowest(&self) -> Nanometres {
        match (self.state, &self.motion) {
            (PositionState::Homed, Motion::Still) => self.measured(),
            (PositionState::Homed, _) if self.purpose == Purpose::Move => {
                let back = self.target.0.saturating_sub(self.approach().0);
                Nanometres(self.measured().0.min(back))
            }
            // An axis below its switch moves up from there.
            (PositionState::Homed, _) => self.measured().min(self.lowest_of_homing()),
            // Wherever the search for its switch may have moved it.
            _ => self.lowest_of_homing(),
        }
    }

    /// Lowest position during homing: it brakes behind the switch.
    pub(crate) fn lowest_of_homing(&self) -> Nanometres {
        let settings = &self.settings;
        let limits = RampLimits {
            start_speed: settings.start_speed,
            speed: settings.home_search_speed.max(settings.start_speed),
            acceleration: settings.home_acceleration,
            jerk: settings.home_jerk,
        };
        // Queued segments are played, a millisecond each; the switch needs some samples.
        let late_us = OUTSTANDING as u32 * 1_000 + u32::from(switch::SAMPLES) * TICK_US;
        let late = u64::from(limits.speed) * u64::from(late_us) / 1_000_000;
        let way = ramp::braking(&limits).saturating_add(late as u32); // some milliseconds of pulses
        let way = steps::to_nanometres(i32::try_from(way).unwrap_or(i32::MAX));
        Nanometres(settings.min.0.min(0).saturating_sub(way.0))
    }

    /// Homing starts where steps and encoder may disagree.
    pub(crate) const fn follow_encoder(&mut self) {
        self.position = steps::to_steps(self.measured());
    }

    /// Follows the encoder also while the first pulses release a rotor between two poles, e.g. after a jam: it snaps by
    /// half a torque period, 32 pulses, and overshoots. A blocked motor is detected that many pulses later.
    pub(crate) const fn begin_to_home(&mut self) {
        self.follow_encoder();
        self.falling = 32;
    }

    /// Makes the home switch's edge, met going down at `edge` (counted pulses), position 0; returns the change of the
    /// encoder's zero. The axis is at rest. From below, the motor is higher by the backlash at the same stage position.
    /// The switch detects a tab that the piezo holds `carried` further away.
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

/// Submits a segment and records it; the caller has checked the room.
fn feed(outstanding: &mut Deque<u16, OUTSTANDING>, outputs: &mut MotorOutputs, segment: Segment) {
    if outputs.segments.push(segment).is_ok() {
        let _ = outstanding.push_back(segment.pulses);
    }
}
