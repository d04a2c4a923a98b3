//! Move to a position on any axis, and settling.

use farnear_protocol::message::{Axis, Failure};
use farnear_protocol::{BoardMicros, Micros, Nanometres, Settle};

use crate::motion::settling::Settling;
use crate::motion::since;
use crate::motion::stage::Stage;
use crate::settings::Settings;

#[derive(Clone, Debug)]
pub(crate) struct Positioning {
    axis: Axis,
    target: Nanometres,
    settling: Settling,
    started: BoardMicros,
    /// Start of the settling deadline; for a stepper the end of its motion.
    waiting_since: Option<BoardMicros>,
    patience: Micros,
}

impl Positioning {
    /// The caller has checked limits and state.
    pub(crate) fn start(
        stage: &mut Stage,
        settings: &Settings,
        (axis, target): (Axis, Nanometres),
        mut settle: Settle,
        now: BoardMicros,
    ) -> Self {
        let (deadline, waiting_since) = match stage.with_numbers(axis, settings) {
            Some((stepper, settings)) => {
                stepper.go(target);
                (settings.settle_deadline, None)
            }
            None => {
                stage.fine.go(target);
                settle.dwell = settle.dwell.max(settings.fine.dwell_min);
                (settings.fine.settle_deadline, Some(now))
            }
        };
        let patience = Micros(deadline.0.saturating_add(settle.dwell.0));
        Self { axis, target, settling: Settling::new(settle), started: now, waiting_since, patience }
    }

    /// Continues without an alarm; returns the time from the start once settled, repeatedly while it stays settled.
    pub(crate) fn tick(&mut self, stage: &Stage, now: BoardMicros) -> Option<Result<Micros, Failure>> {
        if !stage.is_still(self.axis) {
            return None;
        }
        if self.axis == Axis::SensorFine && stage.fine.waits() {
            self.waiting_since = Some(now);
            return None;
        }
        let error = self.error(stage);
        let at_rest = self.axis != Axis::SensorFine || stage.fine.arrived() && stage.fine.gauge_fresh();
        if at_rest {
            self.settling.push(error, stage.fine.measured());
        } else {
            self.settling.interrupt();
        }
        if self.settling.is_settled() {
            // A later disturbance is tolerated like one during the move.
            self.waiting_since = Some(now);
            return Some(Ok(since(self.started, now)));
        }
        let waiting_since = *self.waiting_since.get_or_insert(now);
        (since(waiting_since, now) > self.patience).then_some(Err(Failure::NotSettled { error }))
    }

    /// Waits from `now` for the axis to settle, as after an exposure, in which it was not watched.
    pub(crate) const fn wait_from(&mut self, now: BoardMicros) {
        self.waiting_since = Some(now);
    }

    /// Target minus measured.
    pub(crate) fn error(&self, stage: &Stage) -> Nanometres {
        Nanometres(self.target.0.saturating_sub(stage.measured(self.axis).0))
    }

    pub(crate) fn deviation(&self, stage: &Stage) -> Nanometres {
        Nanometres(self.error(stage).0.saturating_abs())
    }

    /// Mean gauge position over the last dwell.
    pub(crate) const fn mean_fine(&self) -> Nanometres {
        self.settling.mean()
    }
}
