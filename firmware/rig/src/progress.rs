use farnear_protocol::BoardMicros;
use farnear_protocol::message::{Axis, Calibration, EventKind, Failure, RecordName};

use crate::calibrate::Step;
use crate::program::{Flash, Progress, Run};
use crate::rig::Rig;
use crate::work::{AxisWork, WholeWork};

impl Rig {
    pub(crate) fn advance(&mut self, now: BoardMicros) {
        for axis in Axis::ALL {
            self.advance_axis(axis, now);
        }
        self.advance_whole(now);
    }

    fn advance_axis(&mut self, axis: Axis, now: BoardMicros) {
        let Some(mut active) = self.works.on(axis).take() else { return };
        let request = active.request;
        let carried = self.stage.carried(axis);
        let end = match &mut active.work {
            AxisWork::Home(homing) => match self.stage.with_numbers(axis, &self.settings) {
                None => None, // only steppers are homed
                Some((stepper, settings)) => match homing.tick(stepper, settings, carried) {
                    None => None,
                    Some(Ok(shift)) => {
                        self.counters.homings = self.counters.homings.saturating_add(1);
                        Some(EventKind::Homed { request, axis, shift })
                    }
                    Some(Err(reason)) => {
                        active.work = AxisWork::Ending(reason);
                        None
                    }
                },
            },
            AxisWork::Move { target, positioning } => match positioning.tick(&self.stage, now) {
                None => None,
                Some(Ok(_)) => {
                    let measured = self.stage.measured(axis);
                    Some(EventKind::MoveDone { request, axis, asked: *target, measured })
                }
                Some(Err(reason)) => {
                    active.work = AxisWork::Ending(reason);
                    None
                }
            },
            AxisWork::Ending(reason) if self.stage.is_still(axis) => {
                Some(EventKind::Failed { request, axis: named(axis, *reason), reason: *reason })
            }
            AxisWork::Ending(_) => None,
        };
        match end {
            None => *self.works.on(axis) = Some(active),
            Some(terminal) => self.events.push(now, terminal),
        }
    }

    fn advance_whole(&mut self, now: BoardMicros) {
        let Some(mut active) = self.works.whole.take() else { return };
        let request = active.request;
        let end = match &mut active.work {
            WholeWork::Program(run) => match self.advance_program(run, request, now) {
                Ok(end) => end,
                Err((axis, reason)) => {
                    self.stage.stop();
                    active.work = WholeWork::Ending { axis, reason };
                    None
                }
            },
            WholeWork::Calibration(routine) => {
                let step = routine.tick(&mut self.stage, &self.settings);
                match self.take_step(step) {
                    Ok(result) => result.map(|result| EventKind::Calibrated { request, result }),
                    Err((axis, reason)) => {
                        active.work = WholeWork::Ending { axis, reason };
                        None
                    }
                }
            }
            WholeWork::Ending { axis, reason } if self.stage.steppers_still() => {
                Some(EventKind::Failed { request, axis: *axis, reason: *reason })
            }
            WholeWork::Ending { .. } => None,
        };
        match end {
            None => self.works.whole = Some(active),
            Some(terminal) => {
                self.events.push(now, terminal);
                self.camera.give_up();
                self.store.mark(RecordName::Counters); // triggers
            }
        }
    }

    fn advance_program(
        &mut self,
        run: &mut Run,
        request: u32,
        now: BoardMicros,
    ) -> Result<Option<EventKind>, (Option<Axis>, Failure)> {
        let progress = run.tick(&self.shots, &mut self.stage, &mut self.camera, &self.settings, now);
        let (index, repeat, shot) = run.shot();
        let (event, end) = match progress {
            Progress::On => return Ok(None),
            Progress::Ready { number } => {
                let (trigger_number, exposure) = (number, shot.exposure);
                (EventKind::ShotReady { request, index, repeat, trigger_number, exposure }, None)
            }
            Progress::Paused => (EventKind::Paused { request, index }, None),
            Progress::Taken { shot, end } => {
                let end = end.map(|exposures| EventKind::ProgramDone { request, exposures });
                (EventKind::ShotDone { request, shot }, end)
            }
            Progress::Frame { frame, deviation, shot, end } => {
                let end =
                    end.map(|(exposures, dropped)| EventKind::ContinuousDone { request, exposures, dropped });
                (EventKind::FrameTaken { request, frame, deviation, shot }, end)
            }
            Progress::Dropped { frame, reason } => {
                (EventKind::FrameDropped { request, frame, index, reason }, None)
            }
            Progress::Failed { axis, reason } => return Err((axis, reason)),
        };
        self.events.push(now, event);
        if let Some(Flash { trigger_number, levels, edges: [on, off] }) = run.take_flash() {
            self.events.push(now, EventKind::Flash { request, trigger_number, levels, on, off });
        }
        Ok(end)
    }

    /// Applies a calibration's step; returns its result or failure.
    fn take_step(&mut self, step: Step) -> Result<Option<Calibration>, (Option<Axis>, Failure)> {
        match step {
            Step::On => Ok(None),
            Step::Set(key, value) => {
                self.values.set(key, value).map_err(|_| (None, Failure::Implausible))?;
                self.apply_settings();
                Ok(None)
            }
            Step::Done(result) => Ok(Some(result)),
            Step::Failed(axis, reason) => Err((Some(axis), reason)),
        }
    }
}

/// Axis of a failure; a stop has none, and an alarm names its own.
const fn named(axis: Axis, reason: Failure) -> Option<Axis> {
    match reason {
        Failure::Stopped | Failure::Alarm { .. } => None,
        _ => Some(axis),
    }
}
