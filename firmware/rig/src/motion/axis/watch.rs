//! Supervision of a stepper axis: counts, encoder, switches, driver.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Failure, PositionState};

use super::{Motion, Purpose, Stepper};
use crate::io::{MotorInputs, StepperState, TICK_US};
use crate::motion::steps;
use crate::motion::switch::Place;

impl Stepper {
    pub(crate) fn sense(&mut self, inputs: &MotorInputs) {
        self.encoder = inputs.encoder_counts;
        self.driver_fault = inputs.driver_fault;
        let progressed = self.count(&inputs.stepper);
        let here = Place { position: self.position, measured: self.measured() };
        self.home_switch.sample(inputs.home_switch, here);
        self.far_switch.sample(inputs.far_switch, here);
        if let Motion::Aborting { ticks } = &mut self.motion {
            *ticks += 1;
            let late = *ticks * TICK_US > self.settings.pulse_deadline.0;
            if late && !inputs.stepper.idle {
                // A timer that does not finish its segment may not stop; without current nothing moves.
                self.enabled = false;
                self.lose();
            }
            if late || inputs.stepper.idle {
                self.settle_accounts();
            }
            return;
        }
        if let Some(fault) = self.find_fault(inputs, progressed) {
            self.fail(fault);
        } else if self.has_ended(&inputs.stepper) {
            self.motion = Motion::Still;
            self.counted_of_oldest = 0;
            if let Some(target) = self.then.take() {
                self.set_off(target);
            }
        }
    }

    /// Updates the count; returns whether it advanced.
    fn count(&mut self, stepper: &StepperState) -> bool {
        let new = stepper.pulses.wrapping_sub(self.pulses.unwrap_or(stepper.pulses));
        self.pulses = Some(stepper.pulses);
        self.total_pulses += u64::from(new);
        self.falling = self.falling.saturating_sub(new);
        let way = new as i32; // between two ticks there are a few pulses
        self.position = self.position.wrapping_add(if self.away { way } else { -way });
        if new > 0 {
            let most = steps::to_steps(self.approach()).unsigned_abs();
            let slack = self.slack.min(most);
            self.slack =
                if self.away { slack.saturating_sub(new) } else { slack.saturating_add(new).min(most) };
        }
        self.counted_of_oldest = self.counted_of_oldest.saturating_add(new);
        while let Some(oldest) = self.outstanding.front().copied()
            && self.counted_of_oldest >= u32::from(oldest)
        {
            self.counted_of_oldest -= u32::from(oldest);
            self.outstanding.pop_front();
        }
        new > 0
    }

    fn has_ended(&self, stepper: &StepperState) -> bool {
        matches!(&self.motion, Motion::Stepping { ramp, .. } if ramp.remaining() == 0)
            && self.outstanding.is_empty()
            && stepper.idle
    }

    fn find_fault(&mut self, inputs: &MotorInputs, progressed: bool) -> Option<Failure> {
        let resting = matches!(self.motion, Motion::Still | Motion::Preparing { .. });
        if resting && self.state != PositionState::Homed {
            // No position to lose: a stopped motor may roll on, and a re-energised one snaps to the next
            // phase.
            self.follow_encoder();
        } else if let Some(error) = self.following_error() {
            // Irrelevant after a failed homing.
            if resting || self.falling == 0 || self.purpose != Purpose::SeekHome {
                return Some(Failure::Following { error });
            }
            self.follow_encoder();
        }
        if inputs.driver_fault && self.enabled && !matches!(self.motion, Motion::Preparing { .. }) {
            return Some(Failure::DriverFault);
        }
        let waiting = !self.outstanding.is_empty();
        match &mut self.motion {
            Motion::Stepping { ramp, quiet_ticks } => {
                *quiet_ticks = if progressed || !waiting { 0 } else { *quiet_ticks + 1 };
                // Underrun, silence, or a wrong number of pulses.
                let silent = *quiet_ticks * TICK_US > self.settings.pulse_deadline.0;
                let short = inputs.stepper.idle && (waiting || (ramp.has_begun() && ramp.remaining() > 0));
                let over = !waiting && self.counted_of_oldest > 0;
                if inputs.stepper.underrun || silent || short || over {
                    return Some(Failure::StepUnderrun);
                }
            }
            Motion::Still | Motion::Aborting { .. } => return None,
            Motion::Preparing { .. } => {}
        }
        if self.away && self.far_closed() && self.purpose != Purpose::SeekFar {
            return Some(Failure::FarSwitch);
        }
        let outside = self.position > steps::to_steps(self.settings.home_zone);
        (self.home_closed() && outside && self.purpose != Purpose::SeekHome).then_some(Failure::HomeSwitch)
    }

    /// Encoder deviation from the possible motor positions, if too large. Not before the first motion: an unpowered
    /// motor may be moved.
    fn following_error(&self) -> Option<Nanometres> {
        if !self.enabled {
            return None;
        }
        let running =
            self.outstanding.front().map_or(0, |pulses| u32::from(*pulses) - self.counted_of_oldest) as i32;
        let ahead = self.position.wrapping_add(if self.away { running } else { -running });
        let (low, high) = (self.position.min(ahead), self.position.max(ahead));
        let measured = self.measured().0;
        let nearest = measured.clamp(steps::to_nanometres(low).0, steps::to_nanometres(high).0);
        let error = nearest.saturating_sub(measured);
        (error.saturating_abs() > self.settings.following.0).then_some(Nanometres(error))
    }

    fn fail(&mut self, fault: Failure) {
        // If steps and encoder may disagree, the position is also lost at rest.
        if matches!(fault, Failure::Following { .. } | Failure::DriverFault | Failure::StepUnderrun) {
            self.lose();
        }
        self.abort();
        // No current for a faulty driver; a blocked motor stays where the encoder says.
        self.enabled = !matches!(fault, Failure::DriverFault) && self.enabled;
        self.fault = Some(fault);
        if self.is_still() {
            self.settle_accounts();
        }
    }

    /// Steps and encoder may disagree.
    pub(super) const fn lose(&mut self) {
        if matches!(self.state, PositionState::Homed) {
            self.state = PositionState::Lost;
        }
    }

    /// After an abort: nothing is outstanding, and a lost position is the encoder's.
    fn settle_accounts(&mut self) {
        self.motion = Motion::Still;
        self.outstanding.clear();
        self.counted_of_oldest = 0;
        self.slack = u32::MAX;
        if self.state != PositionState::Homed {
            self.follow_encoder();
        }
    }
}
