//! Both stages: two steppers and a piezo, sensed and driven together, and the way to one position on any of them.

use farnear_protocol::message::{Axis as AxisName, AxisStatus, Failure, PositionState};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use crate::axis::Axis;
use crate::io::{Inputs, Outputs};
use crate::piezo::Piezo;
use crate::settings::Settings;
use crate::settle::Settle;

/// All axes.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    pub(crate) coarse: Axis,
    pub(crate) lens: Axis,
    pub(crate) fine: Piezo,
}

impl Stage {
    pub(crate) const fn new(settings: &Settings) -> Self {
        Self {
            coarse: Axis::new(settings.coarse),
            lens: Axis::new(settings.lens),
            fine: Piezo::new(settings.fine),
        }
    }

    /// Reads the board.
    pub(crate) fn sense(&mut self, inputs: &Inputs) {
        self.coarse.sense(&inputs.coarse);
        self.lens.sense(&inputs.lens);
        self.fine.sense(inputs.gauge_code);
    }

    /// Orders the board.
    pub(crate) fn act(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        self.coarse.act(&inputs.coarse.stepper, &mut outputs.coarse);
        self.lens.act(&inputs.lens.stepper, &mut outputs.lens);
        outputs.piezo_dac = self.fine.act();
    }

    /// Where the encoder or gauge says the axis is.
    pub(crate) const fn measured(&self, axis: AxisName) -> Nanometres {
        match axis {
            AxisName::SensorCoarse => self.coarse.measured(),
            AxisName::Lens => self.lens.measured(),
            AxisName::SensorFine => self.fine.measured(),
        }
    }

    /// What is known of the axis' position. The gauge is absolute.
    pub(crate) const fn state(&self, axis: AxisName) -> PositionState {
        match axis {
            AxisName::SensorCoarse => self.coarse.state(),
            AxisName::Lens => self.lens.state(),
            AxisName::SensorFine => PositionState::Homed,
        }
    }

    /// For the status answer.
    pub(crate) fn status(&self, axis: AxisName, request: Option<u32>) -> AxisStatus {
        let (asked, moving) = match axis {
            AxisName::SensorCoarse => (self.coarse.target(), !self.coarse.is_still()),
            AxisName::Lens => (self.lens.target(), !self.lens.is_still()),
            AxisName::SensorFine => (self.fine.target(), !self.fine.arrived()),
        };
        AxisStatus { state: self.state(axis), asked, measured: self.measured(axis), moving, request }
    }

    /// Ends all motion: the stepper brakes, the piezo stays where it is.
    pub(crate) fn stop(&mut self) {
        self.coarse.stop();
        self.lens.stop();
        self.fine.hold();
    }

    /// Whether no stepper pulse comes any more.
    pub(crate) const fn is_still(&self) -> bool {
        self.coarse.is_still() && self.lens.is_still()
    }
}

/// Smallest and largest position of an axis.
pub(crate) const fn limits(settings: &Settings, axis: AxisName) -> (Nanometres, Nanometres) {
    match axis {
        AxisName::SensorCoarse => (settings.coarse.min, settings.coarse.max),
        AxisName::Lens => (settings.lens.min, settings.lens.max),
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
            AxisName::Lens => {
                stage.lens.go(target);
                (settings.lens.settle_deadline, None)
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
            AxisName::Lens => (settings.lens.settle_window, settings.lens.settle_dwell),
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
            AxisName::Lens => {
                if !stage.lens.is_still() {
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
