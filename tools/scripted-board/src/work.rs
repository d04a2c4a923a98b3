//! Work of the scripted board: homing, moves, programs, calibrations. All end immediately, faults aside.

use farnear_protocol::{
    Request, RequestError, Response,
    message::{
        Alarm, AlarmRecord, Axis, Calibration, DropReason, EventKind, Failure, Limits, PositionState,
        ProgramState, ResetCause, Routine, Shot, ShotFault, ShotRecord, TriggerMode,
    },
    units::{BoardMicros, Micros, Nanometres},
};

use crate::Board;

/// Exposures of an endless continuous run.
const UNTIL_STOPPED: u32 = 40;

impl Board {
    pub(super) fn prepare(&mut self, id: u32, request: Request) {
        let answer = match request {
            Request::LoadShot { index, shot } => {
                self.program[usize::from(index)] = Some(shot);
                self.armed = 0;
                Ok(Response::Accepted)
            }
            Request::ArmProgram { shots } => {
                let missing = self.program[..usize::from(shots)].iter().position(Option::is_none);
                match missing {
                    _ if shots == 0 => Err(RequestError::Shot { index: 0, reason: ShotFault::Index }),
                    Some(index) => Err(RequestError::Shot { index: index as u8, reason: ShotFault::Missing }),
                    None => {
                        self.armed = shots;
                        Ok(Response::Accepted)
                    }
                }
            }
            _ => Err(RequestError::Program { state: ProgramState::Idle }),
        };
        self.answer(id, answer);
    }

    pub(super) fn work(&mut self, id: u32, request: Request) {
        if self.braking > 0 {
            let request = self.active.as_ref().map_or(0, |(id, _)| *id);
            return self.answer(id, Err(RequestError::Busy { request }));
        }
        if let Some(error) = self.refusal(&request) {
            return self.answer(id, Err(error));
        }
        if self.faults.reset_at_move {
            return self.reset(ResetCause::Watchdog);
        }
        if self.faults.gone_at_program && matches!(request, Request::RunProgram { .. }) {
            self.answer(id, Ok(Response::Accepted));
            self.gone = true;
            return;
        }
        self.acts += 1;
        self.answer(id, Ok(Response::Accepted));
        if self.faults.never_ends {
            self.active = Some((id, request));
        } else if self.faults.asks_first > 0 {
            self.active = Some((id, request));
            self.asking = self.faults.asks_first;
            self.event(EventKind::StillThere { request: id });
        } else if !self.faults.end_unsaid {
            self.end(id, request);
        }
    }

    fn refusal(&mut self, request: &Request) -> Option<RequestError> {
        if self.latched {
            let AlarmRecord { number, alarm, .. } = *self.alarms.last().unwrap();
            return Some(RequestError::Alarm { number, alarm });
        }
        let silence = match request {
            Request::Home { silence, .. }
            | Request::Move { silence, .. }
            | Request::RunProgram { silence }
            | Request::RunContinuously { silence, .. }
            | Request::Calibrate { silence, .. } => *silence,
            _ => Micros(0),
        };
        let Limits { silence_min, silence_max, coarse_min, coarse_max, lens_min, lens_max, .. } =
            self.hello.limits;
        if silence < silence_min || silence > silence_max {
            return Some(RequestError::Silence { min: silence_min, max: silence_max });
        }
        self.keep_alives.push(silence);
        let runs = matches!(request, Request::RunProgram { .. } | Request::RunContinuously { .. });
        if runs && self.armed == 0 {
            return Some(RequestError::Program { state: ProgramState::Idle });
        }
        let Request::Move { axis, target, .. } = *request else { return None };
        let (homed, min, max) = match axis {
            Axis::SensorCoarse => (self.homed, coarse_min, coarse_max),
            Axis::SensorFine => return None,
            Axis::Lens => (self.lens_homed, lens_min, lens_max),
        };
        if !homed {
            return Some(RequestError::NotHomed { axis, state: PositionState::Unknown });
        }
        (target < min || target > max).then_some(RequestError::OutOfRange { axis, asked: target, min, max })
    }

    /// The host has answered the keep-alive; work continues.
    pub(super) fn hear_from_host(&mut self) {
        if self.asking == 0 {
            return;
        }
        self.still_there += 1;
        self.asking -= 1;
        let Some((request, _)) = self.active else { return };
        if self.asking > 0 {
            self.event(EventKind::StillThere { request });
        } else if let Some((id, request)) = self.active.take() {
            self.end(id, request);
        }
    }

    pub fn raise(&mut self, alarm: Alarm) -> u32 {
        let number = self.alarms.len() as u32 + 1;
        let record = AlarmRecord { number, boot: self.hello.boot, time: BoardMicros(self.time), alarm };
        self.alarms.push(record);
        self.latched = true;
        self.event(EventKind::Alarm(record));
        number
    }

    fn end(&mut self, id: u32, request: Request) {
        if let Some(alarm) = self.faults.alarm_at_work {
            let number = self.raise(alarm);
            let reason = Failure::Alarm { number };
            return self.event(EventKind::Failed { request: id, axis: None, reason });
        }
        if let Some(reason) = self.faults.fails_with {
            return self.event(EventKind::Failed { request: id, axis: Some(Axis::SensorCoarse), reason });
        }
        match request {
            Request::Home { axis, .. } => {
                match axis {
                    Axis::Lens => (self.lens_homed, self.lens) = (true, Nanometres(0)),
                    _ => (self.homed, self.coarse) = (true, Nanometres(0)),
                }
                self.counters.homings += 1;
                self.event(EventKind::Homed { request: id, axis, shift: Nanometres(0) });
            }
            Request::Move { axis, target, .. } => {
                self.place(axis, target);
                let measured = self.measured(axis);
                self.event(EventKind::MoveDone { request: id, axis, asked: target, measured });
            }
            Request::Calibrate { routine, .. } => {
                let result = match routine {
                    Routine::Travel { axis } => Calibration::Travel { axis, length: Nanometres(13_600_000) },
                    Routine::Backlash { axis } => {
                        Calibration::Backlash { axis, backlash: Nanometres(4_000), spread: Nanometres(250) }
                    }
                    Routine::Piezo => Calibration::Piezo {
                        gain_pm_per_code: 3_052,
                        hysteresis_ppm: 120_000,
                        creep_ppm_per_decade: 15_000,
                    },
                    Routine::Gauge => Calibration::Gauge { gain_ppm: 1_000_000, offset: Nanometres(0) },
                };
                self.event(EventKind::Calibrated { request: id, result });
            }
            Request::RunContinuously { period, exposures, .. } => {
                self.run_continuously(id, (period, exposures), &request);
            }
            _ => self.run(id),
        }
    }

    fn run(&mut self, id: u32) {
        let shots: Vec<Shot> =
            self.program[..usize::from(self.armed)].iter().map(|shot| shot.unwrap()).collect();
        let mut exposures = 0;
        for (index, shot) in (0..).zip(&shots) {
            self.place(shot.axis, shot.target);
            for repeat in 0..shot.repeat {
                let trigger_number = self.triggers;
                if shot.mode == TriggerMode::Software {
                    let exposure = shot.exposure;
                    let kind = EventKind::ShotReady { request: id, index, repeat, trigger_number, exposure };
                    self.event(kind);
                }
                self.time += 20_000;
                exposures += 1;
                let shot = self.expose(index, repeat, shot);
                self.event(EventKind::ShotDone { request: id, shot });
            }
        }
        self.event(EventKind::ProgramDone { request: id, exposures });
    }

    fn expose(&mut self, index: u8, repeat: u16, shot: &Shot) -> ShotRecord {
        let trigger_number = self.triggers;
        self.triggers += 1;
        let strobe_start = BoardMicros(self.time + 20);
        ShotRecord {
            index,
            repeat,
            trigger_number,
            axis: shot.axis,
            asked: shot.target,
            coarse: self.coarse,
            fine: self.fine,
            lens: self.lens,
            settle: Micros(9_000),
            trigger: BoardMicros(self.time),
            strobe_start,
            strobe_end: BoardMicros(
                strobe_start.0 + u64::from(shot.exposure.0) + self.faults.strobe_longer_us,
            ),
            exposure: shot.exposure,
        }
    }

    /// Paced frames, some dropped; an endless run takes [`UNTIL_STOPPED`] and waits for the stop.
    fn run_continuously(&mut self, id: u32, (period, wanted): (Micros, u32), request: &Request) {
        let shots: Vec<Shot> =
            self.program[..usize::from(self.armed)].iter().map(|shot| shot.unwrap()).collect();
        let (mut exposures, mut dropped) = (0, 0);
        let mut cycle = (0..).zip(&shots).cycle().peekable();
        while exposures < if wanted == 0 { UNTIL_STOPPED } else { wanted } {
            let (frame, (index, shot)) = (exposures + dropped, *cycle.peek().unwrap());
            self.time += u64::from(period.0.max(20_000));
            if self.faults.drop_frames.contains(&frame) {
                dropped += 1;
                let reason = DropReason::CameraBusy;
                self.event(EventKind::FrameDropped { request: id, frame, index, reason });
                continue;
            }
            cycle.next();
            exposures += 1;
            self.place(shot.axis, shot.target);
            let shot = self.expose(index, 0, shot);
            self.event(EventKind::FrameTaken { request: id, frame, deviation: Nanometres(7), shot });
        }
        if wanted == 0 {
            self.active = Some((id, request.clone()));
        } else {
            self.event(EventKind::ContinuousDone { request: id, exposures, dropped });
        }
    }
}
