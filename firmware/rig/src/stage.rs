//! Stage A: its coarse and its fine axis, sensed and driven together, and the way to one position on either.

use farnear_protocol::message::{Axis as AxisName, AxisStatus, Failure, PositionState};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use crate::axis::Axis;
use crate::io::{Inputs, Outputs};
use crate::piezo::Piezo;
use crate::settings::Settings;
use crate::settle::Settle;

/// Both axes.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    pub(crate) coarse: Axis,
    pub(crate) fine: Piezo,
    pub(crate) home_switch: bool,
    pub(crate) far_switch: bool,
}

impl Stage {
    pub(crate) const fn new(settings: &Settings) -> Self {
        Self {
            coarse: Axis::new(settings.coarse),
            fine: Piezo::new(settings.fine),
            home_switch: false,
            far_switch: false,
        }
    }

    /// Reads the board.
    pub(crate) fn sense(&mut self, inputs: &Inputs) {
        self.home_switch = inputs.home_switch;
        self.far_switch = inputs.far_switch;
        self.coarse.sense(inputs);
        self.fine.sense(inputs.gauge_code);
    }

    /// Orders the board.
    pub(crate) fn act(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        self.coarse.act(&inputs.stepper, outputs);
        outputs.piezo_dac = self.fine.act();
    }

    /// Where the encoder or gauge says the axis is.
    pub(crate) const fn measured(&self, axis: AxisName) -> Nanometres {
        match axis {
            AxisName::SensorCoarse => self.coarse.measured(),
            AxisName::SensorFine => self.fine.measured(),
        }
    }

    /// What is known of the axis' position. The gauge is absolute.
    pub(crate) const fn state(&self, axis: AxisName) -> PositionState {
        match axis {
            AxisName::SensorCoarse => self.coarse.state(),
            AxisName::SensorFine => PositionState::Homed,
        }
    }

    /// For the status answer.
    pub(crate) fn status(&self, axis: AxisName) -> AxisStatus {
        let (asked, moving) = match axis {
            AxisName::SensorCoarse => (self.coarse.target(), !self.coarse.is_still()),
            AxisName::SensorFine => (self.fine.target(), !self.fine.arrived()),
        };
        AxisStatus { state: self.state(axis), asked, measured: self.measured(axis), moving }
    }

    /// Ends all motion: the stepper brakes, the piezo stays where it is.
    pub(crate) fn stop(&mut self) {
        self.coarse.stop();
        self.fine.hold();
    }

    /// Whether no stepper pulse comes any more.
    pub(crate) const fn is_still(&self) -> bool {
        self.coarse.is_still()
    }
}

/// Smallest and largest position of an axis.
pub(crate) const fn limits(settings: &Settings, axis: AxisName) -> (Nanometres, Nanometres) {
    match axis {
        AxisName::SensorCoarse => (settings.coarse.min, settings.coarse.max),
        AxisName::SensorFine => (settings.fine.min, settings.fine.max),
    }
}

/// A way to a position: motion, then settling.
#[derive(Clone, Debug)]
pub(crate) struct Positioning {
    axis: AxisName,
    target: Nanometres,
    settle: Settle,
    started: BoardMicros,
    /// From when the time to settle counts; for the coarse axis the end of its motion.
    waiting_since: Option<BoardMicros>,
    patience: Micros,
}

impl Positioning {
    /// Sets off. The caller has checked limits and state.
    pub(crate) fn start(
        stage: &mut Stage,
        settings: &Settings,
        (axis, target): (AxisName, Nanometres),
        (window, dwell): (Nanometres, Micros),
        now: BoardMicros,
    ) -> Self {
        let (deadline, waiting_since) = match axis {
            AxisName::SensorCoarse => {
                stage.coarse.go(target);
                (settings.coarse.settle_deadline, None)
            }
            AxisName::SensorFine => {
                stage.fine.go(target);
                (settings.fine.settle_deadline, Some(now))
            }
        };
        let patience = Micros(deadline.0.saturating_add(dwell.0));
        Self { axis, target, settle: Settle::new(window, dwell), started: now, waiting_since, patience }
    }

    /// To the settle window of a plain move.
    pub(crate) const fn plain(settings: &Settings, axis: AxisName) -> (Nanometres, Micros) {
        match axis {
            AxisName::SensorCoarse => (settings.coarse.settle_window, settings.coarse.settle_dwell),
            AxisName::SensorFine => (settings.fine.settle_window, settings.fine.settle_dwell),
        }
    }

    /// Goes on while the coarse axis has no fault; gives the time from the start once the position is settled. May be asked again while it stays.
    pub(crate) fn tick(&mut self, stage: &Stage, now: BoardMicros) -> Option<Result<Micros, Failure>> {
        let error = Nanometres(self.target.0.saturating_sub(stage.measured(self.axis).0));
        let at_rest = match self.axis {
            AxisName::SensorCoarse => {
                if !stage.coarse.is_still() {
                    return None;
                }
                true
            }
            AxisName::SensorFine => {
                if stage.fine.gauge_failed() {
                    return Some(Err(Failure::Gauge));
                }
                stage.fine.arrived() && stage.fine.gauge_fresh()
            }
        };
        if at_rest {
            self.settle.push(error, stage.fine.measured());
        } else {
            self.settle.interrupt();
        }
        if self.settle.is_settled() {
            return Some(Ok(since(self.started, now)));
        }
        let waiting_since = *self.waiting_since.get_or_insert(now);
        (since(waiting_since, now) > self.patience).then_some(Err(Failure::NotSettled { error }))
    }

    /// Gauge position, mean over the last whole dwell.
    pub(crate) const fn mean_fine(&self) -> Nanometres {
        self.settle.mean()
    }
}

/// Time from one moment to a later one; saturates.
pub(crate) fn since(earlier: BoardMicros, now: BoardMicros) -> Micros {
    Micros(u32::try_from(now.0.saturating_sub(earlier.0)).unwrap_or(u32::MAX))
}
