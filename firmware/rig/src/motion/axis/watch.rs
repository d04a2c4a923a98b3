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

    /// The axis must be homed again: steps and encoder may disagree, or position 0 has changed.
    pub(crate) const fn lose(&mut self) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    /// A homed and enabled axis at these steps, by count and by encoder.
    fn at(position: i32) -> Stepper {
        let mut stepper = Stepper::new(Settings::DEFAULT.coarse);
        (stepper.state, stepper.enabled) = (PositionState::Homed, true);
        stepper.position = position;
        stepper.encoder = steps::to_encoder(steps::to_nanometres(position));
        stepper
    }

    #[test]
    fn the_encoder_may_be_anywhere_in_the_running_segment() {
        // The step and the count of the encoder are rounded.
        const ROUNDING_NM: i32 = 300;
        // 400 of 1000 pulses of the segment are counted: 600 are to come.
        for (away, ahead) in [(true, 600_i32), (false, -600)] {
            for (from, sign) in [(0, -ahead.signum()), (ahead, ahead.signum())] {
                let error = |beyond_nm: i32| {
                    let mut stepper = at(4_000);
                    stepper.away = away;
                    let _ = stepper.outstanding.push_back(1_000);
                    stepper.counted_of_oldest = 400;
                    let limit = stepper.settings.following.0;
                    let end = steps::to_nanometres(4_000 + from).0;
                    stepper.encoder = steps::to_encoder(Nanometres(end + sign * (limit + beyond_nm)));
                    stepper.following_error().map(|error| error.0.signum())
                };
                assert_eq!(error(-ROUNDING_NM), None, "{away} {from}");
                assert_eq!(error(ROUNDING_NM), Some(-sign), "{away} {from}");
            }
        }
    }

    #[test]
    fn pulses_away_take_up_the_play_and_pulses_back_restore_it() {
        let mut stepper = at(0);
        stepper.settings.backlash = Nanometres(6_250);
        let most = steps::to_steps(stepper.approach()).unsigned_abs();
        let mut pulses = 0;
        let mut count = |stepper: &mut Stepper, away, new| {
            stepper.away = away;
            pulses += new;
            stepper.count(&StepperState { pulses, ..StepperState::IDLE });
            stepper.slack
        };
        count(&mut stepper, true, 0);
        stepper.slack = u32::MAX;
        assert_eq!(count(&mut stepper, true, 10), most - 10);
        assert_eq!(count(&mut stepper, true, 0), most - 10);
        assert_eq!(count(&mut stepper, false, 4), most - 6);
        assert_eq!(count(&mut stepper, false, 400), most);
        assert_eq!(count(&mut stepper, true, most + 5), 0);
        assert_eq!(stepper.position, 10 - 4 - 400 + most as i32 + 5);
    }

    #[test]
    fn the_home_switch_may_be_closed_up_to_the_end_of_its_zone() {
        let fault = |beyond| {
            let zone = steps::to_steps(Settings::DEFAULT.coarse.home_zone);
            let mut stepper = at(zone + beyond);
            stepper.go(Nanometres(5_000_000));
            stepper.home_switch.sample(true, Place { position: 0, measured: Nanometres(0) });
            stepper.find_fault(&MotorInputs::IDLE, false)
        };
        assert_eq!(fault(0), None);
        assert_eq!(fault(1), Some(Failure::HomeSwitch));
    }
}
