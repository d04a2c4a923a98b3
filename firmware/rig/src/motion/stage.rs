use farnear_protocol::message::{Axis, AxisStatus, PositionState};
use farnear_protocol::{BoardMicros, Nanometres};

use crate::io::{Inputs, Outputs, REST_TICKS, TICK_US};
use crate::motion::axis::Stepper;
use crate::motion::since;
use crate::piezo::Piezo;
use crate::settings::{Settings, StepperSettings};

#[derive(Clone, Debug)]
pub(crate) struct Stage {
    pub(crate) coarse: Stepper,
    pub(crate) lens: Stepper,
    pub(crate) fine: Piezo,
    /// Last run of the piezo's loop, and whether it runs in this tick.
    looped: Option<BoardMicros>,
    on_time: bool,
}

impl Stage {
    pub(crate) const fn new(settings: &Settings, piezo_code: Option<u16>) -> Self {
        let mut fine = Piezo::new(settings.fine);
        fine.start_at(piezo_code);
        Self {
            coarse: Stepper::new(settings.coarse),
            lens: Stepper::new(settings.lens),
            fine,
            looped: None,
            on_time: true,
        }
    }

    /// All axes must be at rest.
    pub(crate) fn apply(&mut self, settings: &Settings) {
        self.coarse.apply(settings.coarse);
        self.lens.apply(settings.lens);
        self.fine.apply(settings.fine);
    }

    /// `rested`: after a rest.
    pub(crate) fn sense(&mut self, inputs: &Inputs, rested: bool) {
        self.coarse.sense(&inputs.coarse);
        self.lens.sense(&inputs.lens);
        // Catch-up ticks are faster than the loop's model.
        let since = self.looped.map_or(TICK_US, |looped| since(looped, inputs.now).0);
        self.on_time = since >= TICK_US / 2;
        if self.on_time {
            self.looped = Some(inputs.now);
            self.fine.after(if rested { REST_TICKS } else { 1 });
            self.fine.sense(inputs.gauge_code);
        }
    }

    pub(crate) fn act(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        self.coarse.act(&inputs.coarse.stepper, &mut outputs.coarse);
        self.lens.act(&inputs.lens.stepper, &mut outputs.lens);
        outputs.piezo_dac = if self.on_time { self.fine.act() } else { self.fine.played() };
    }

    pub(crate) const fn stepper(&self, axis: Axis) -> Option<&Stepper> {
        match axis {
            Axis::SensorCoarse => Some(&self.coarse),
            Axis::Lens => Some(&self.lens),
            Axis::SensorFine => None,
        }
    }

    pub(crate) const fn stepper_mut(&mut self, axis: Axis) -> Option<&mut Stepper> {
        match axis {
            Axis::SensorCoarse => Some(&mut self.coarse),
            Axis::Lens => Some(&mut self.lens),
            Axis::SensorFine => None,
        }
    }

    pub(crate) const fn with_numbers<'s>(
        &mut self,
        axis: Axis,
        settings: &'s Settings,
    ) -> Option<(&mut Stepper, &'s StepperSettings)> {
        match axis {
            Axis::SensorCoarse => Some((&mut self.coarse, &settings.coarse)),
            Axis::Lens => Some((&mut self.lens, &settings.lens)),
            Axis::SensorFine => None,
        }
    }

    pub(crate) const fn measured(&self, axis: Axis) -> Nanometres {
        match self.stepper(axis) {
            Some(stepper) => stepper.measured(),
            None => self.fine.measured(),
        }
    }

    /// Displacement of stage A's switch tab by the piezo. `None` if unknown: homing could not find position 0.
    pub(crate) fn carried(&self, axis: Axis) -> Option<Nanometres> {
        match axis {
            Axis::SensorCoarse => self.fine.extension(),
            Axis::SensorFine | Axis::Lens => Some(Nanometres(0)),
        }
    }

    /// The absolute gauge is valid while it responds.
    pub(crate) const fn state(&self, axis: Axis) -> PositionState {
        match self.stepper(axis) {
            Some(stepper) => stepper.state(),
            None if self.fine.gauge_failed() => PositionState::Lost,
            None => PositionState::Homed,
        }
    }

    pub(crate) fn status(&self, axis: Axis, request: Option<u32>) -> AxisStatus {
        let (asked, moving) = match self.stepper(axis) {
            Some(stepper) => (stepper.target(), !stepper.is_still()),
            None => (self.fine.target(), self.fine.is_moving()),
        };
        AxisStatus { state: self.state(axis), asked, measured: self.measured(axis), moving, request }
    }

    /// Steppers brake, the piezo stays.
    pub(crate) fn stop(&mut self) {
        self.coarse.stop();
        self.lens.stop();
        self.fine.hold();
    }

    pub(crate) fn abort(&mut self) {
        self.coarse.abort();
        self.lens.abort();
        self.fine.hold();
    }

    pub(crate) fn is_still(&self, axis: Axis) -> bool {
        self.stepper(axis).is_none_or(Stepper::is_still)
    }

    /// All axes are idle, so that rare ticks suffice.
    pub(crate) fn is_settled_idle(&self) -> bool {
        self.coarse.is_settled_idle() && self.lens.is_settled_idle() && self.fine.is_settled_idle()
    }

    pub(crate) const fn steppers_still(&self) -> bool {
        self.coarse.is_still() && self.lens.is_still()
    }
}
