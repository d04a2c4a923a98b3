//! The way to a position on any axis: motion, then settling.

use farnear_protocol::message::{Axis, Failure};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use crate::motion::settle::Settle;
use crate::motion::since;
use crate::motion::stage::Stage;
use crate::settings::Settings;

/// A way to a position.
#[derive(Clone, Debug)]
pub(crate) struct Positioning {
    axis: Axis,
    target: Nanometres,
    settle: Settle,
    started: BoardMicros,
    /// From when the time to settle counts; for a stepper the end of its motion.
    waiting_since: Option<BoardMicros>,
    patience: Micros,
}

impl Positioning {
    /// Sets off. The caller has checked limits and state.
    pub(crate) fn start(
        stage: &mut Stage,
        settings: &Settings,
        (axis, target): (Axis, Nanometres),
        (window, dwell): (Nanometres, Micros),
        now: BoardMicros,
    ) -> Self {
        let (deadline, waiting_since) = match stage.with_numbers(axis, settings) {
            Some((stepper, settings)) => {
                stepper.go(target);
                (settings.settle_deadline, None)
            }
            None => {
                stage.fine.go(target);
                (settings.fine.settle_deadline, Some(now))
            }
        };
        let patience = Micros(deadline.0.saturating_add(dwell.0));
        Self { axis, target, settle: Settle::new(window, dwell), started: now, waiting_since, patience }
    }

    /// To the settle window of a plain move.
    pub(crate) const fn plain(settings: &Settings, axis: Axis) -> (Nanometres, Micros) {
        match axis {
            Axis::SensorCoarse => (settings.coarse.settle_window, settings.coarse.settle_dwell),
            Axis::Lens => (settings.lens.settle_window, settings.lens.settle_dwell),
            Axis::SensorFine => (settings.fine.settle_window, settings.fine.settle_dwell),
        }
    }

    /// Goes on while no alarm comes; gives the time from the start once the position is settled. May be asked again
    /// while it stays.
    pub(crate) fn tick(&mut self, stage: &Stage, now: BoardMicros) -> Option<Result<Micros, Failure>> {
        if !stage.is_still(self.axis) {
            return None;
        }
        let error = Nanometres(self.target.0.saturating_sub(stage.measured(self.axis).0));
        let at_rest = self.axis != Axis::SensorFine || stage.fine.arrived() && stage.fine.gauge_fresh();
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
