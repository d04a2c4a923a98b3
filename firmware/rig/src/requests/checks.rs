use farnear_protocol::message::{Axis, PositionState, RequestError, sensor_distance_nm};
use farnear_protocol::{Micros, Nanometres};

use crate::motion::axis::Stepper;
use crate::rig::Rig;
use crate::work::Active;

impl Rig {
    /// Motion is permitted, and the silence deadline is in range.
    pub(super) fn may_move(&self, silence: Micros) -> Result<(), RequestError> {
        if let Some(record) = self.alarms.latched() {
            return Err(RequestError::Alarm { number: record.number, alarm: record.alarm });
        }
        let (min, max) = (self.settings.link.silence_min, self.settings.link.silence_max);
        if (min..=max).contains(&silence) { Ok(()) } else { Err(RequestError::Silence { min, max }) }
    }

    pub(super) fn must_be_free(&self, axis: Axis) -> Result<(), RequestError> {
        let reboot = self.reboot.map(|reboot| reboot.request);
        match self.works.request_on(axis).or(reboot) {
            Some(request) => Err(RequestError::Busy { request }),
            None => Ok(()),
        }
    }

    pub(super) fn all_must_be_free(&self) -> Result<(), RequestError> {
        Axis::ALL.into_iter().try_for_each(|axis| self.must_be_free(axis))
    }

    /// Nothing moves, so work beyond a tick is harmless.
    pub(super) fn must_stand(&self) -> Result<(), RequestError> {
        match self.works.any() {
            Some(request) => Err(RequestError::Busy { request }),
            None => Ok(()),
        }
    }

    pub(super) fn no_program_runs(&self) -> Result<(), RequestError> {
        match &self.works.whole {
            Some(Active { request, .. }) => Err(RequestError::Busy { request: *request }),
            None => Ok(()),
        }
    }

    pub(super) fn must_be_homed(&self, axis: Axis) -> Result<(), RequestError> {
        match self.stage.state(axis) {
            PositionState::Homed => Ok(()),
            state => Err(RequestError::NotHomed { axis, state }),
        }
    }

    pub(super) fn must_be_inside(&self, axis: Axis, asked: Nanometres) -> Result<(), RequestError> {
        let (min, max) = self.settings.limits(axis);
        if (min..=max).contains(&asked) {
            Ok(())
        } else {
            Err(RequestError::OutOfRange { axis, asked, min, max })
        }
    }

    /// Lowest position of the current move.
    pub(super) fn lowest(&self, axis: Axis) -> Nanometres {
        let Some(stepper) = self.stage.stepper(axis) else { return self.stage.fine.lowest() };
        let (lowest, of_homing) = (stepper.lowest(), stepper.lowest_of_homing());
        let homes = self.works.homes(axis) || !stepper.is_still() && lowest <= of_homing;
        if homes { self.below_carried(axis, lowest.min(of_homing)) } else { lowest }
    }

    /// Lowest position of homing with the present piezo; for the piezo, relaxed.
    pub(super) fn lowest_of_homing(&self, axis: Axis) -> Nanometres {
        let lowest = self.stage.stepper(axis).map_or(Nanometres(0), Stepper::lowest_of_homing);
        self.below_carried(axis, lowest)
    }

    /// Stage A's home switch is met lower by the piezo's extension, which carries its tab.
    fn below_carried(&self, axis: Axis, lowest: Nanometres) -> Nanometres {
        let carried = self.stage.carried(axis).unwrap_or(self.stage.measured(Axis::SensorFine));
        Nanometres(lowest.0.saturating_sub(carried.0.max(0)))
    }

    /// Distance for a routine with all its axes at their extreme: each alone may pass while all together violate it.
    pub(super) fn routine_must_not_come_close(&self, axes: &[Axis]) -> Result<(), RequestError> {
        let piezo_relaxes = axes.contains(&Axis::SensorFine);
        let extreme = |axis| {
            let homing = match self.stage.stepper(axis) {
                // The routine relaxes the piezo first.
                Some(stepper) if piezo_relaxes => stepper.lowest_of_homing(),
                _ => self.lowest_of_homing(axis),
            };
            homing.min(self.lowest(axis))
        };
        let retreats = |axis: &Axis| {
            self.stage.state(*axis) == PositionState::Homed && extreme(*axis) >= self.stage.measured(*axis)
        };
        if axes.iter().all(retreats) {
            return Ok(());
        }
        self.must_be_apart(|axis| if axes.contains(&axis) { extreme(axis) } else { self.lowest(axis) })
    }

    /// Lowest position on the way to a target.
    pub(super) fn lowest_to(&self, axis: Axis, target: Nanometres) -> Nanometres {
        self.with_approach(axis, target).min(self.stage.measured(axis))
    }

    pub(super) fn with_approach(&self, axis: Axis, target: Nanometres) -> Nanometres {
        let approach = self.stage.stepper(axis).map_or(0, |stepper| stepper.approach().0);
        Nanometres(target.0.saturating_sub(approach))
    }

    /// Sensor and lens stay apart with an axis at its lowest and the others moving. Moving apart is permitted.
    pub(super) fn must_not_come_close(&self, axis: Axis, lowest: Nanometres) -> Result<(), RequestError> {
        let homed = self.stage.state(axis) == PositionState::Homed;
        if homed && lowest >= self.stage.measured(axis) {
            return Ok(());
        }
        self.must_be_apart(|other| if other == axis { lowest } else { self.lowest(other) })
    }

    /// The smallest distance of sensor and lens at these positions.
    pub(super) fn must_be_apart(&self, position: impl Fn(Axis) -> Nanometres) -> Result<(), RequestError> {
        let min = self.settings.distance_min;
        let distance = sensor_distance_nm(self.settings.datum, position);
        if distance >= i64::from(min.0) {
            return Ok(());
        }
        let distance = distance.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        Err(RequestError::TooClose { distance: Nanometres(distance), min })
    }
}
