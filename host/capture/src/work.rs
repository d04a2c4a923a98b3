//! Long work: homing, moves, exposure programs and calibrations, from the request to the final event. While a [`Work`]
//! is held, keep-alives are answered. Dropping it before its end stops the rig; if the program dies, the board stops at
//! its deadline ([`crate::Timing::keep_alive`]). Each wait has a deadline ([`crate::timing`]). At the deadline and on
//! interruption the board is stopped before the error is returned.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use farnear_protocol::{
    Request, Response,
    message::{
        AlarmRecord, Axis, Calibration, EventKind, Failure, ProgramState, Routine, SettingKey, Shot,
        ShotLight,
    },
    units::{Micros, Nanometres},
};

use crate::{
    client::Client,
    describe::{axis_name, routine_name, um},
    error::ClientError,
    owner::{Listener, Message, Question, nonsense, nothing},
    timing::{Pace, calibration_time, homing_time, move_time, program_time},
};

const SLICE: Duration = Duration::from_millis(50);

struct Plan {
    request: Request,
    /// Longest time of a healthy board.
    work: Duration,
    during: String,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Moved {
    pub asked: Nanometres,
    /// By encoder or gauge.
    pub measured: Nanometres,
}

pub struct Work {
    client: Client,
    id: u32,
    request: Request,
    during: String,
    messages: Receiver<Message>,
    /// Held weakly by the port's thread.
    _held: Arc<()>,
    allowed: Duration,
    left: Duration,
    /// A paused program has no timeout.
    paused: bool,
    alarm: Option<AlarmRecord>,
    over: bool,
    received: Instant,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// Intermediate event, e.g. an exposure.
    Event(EventKind),
    Done(EventKind),
}

impl Work {
    pub fn id(&self) -> u32 {
        self.id
    }

    pub fn received(&self) -> Instant {
        self.received
    }

    /// The next event; `None` after `wait`. Only waiting counts for the deadline. An error ends the work.
    pub fn step_within(&mut self, wait: Duration) -> Result<Option<Step>, ClientError> {
        let until = Instant::now() + wait;
        loop {
            if self.client.interrupted() {
                return Err(
                    self.stop_with(ClientError::Interrupted { during: self.during.clone(), stopped: true })
                );
            }
            let begin = Instant::now();
            let slice = SLICE.min(until.saturating_duration_since(begin)).min(self.left);
            let message = self.messages.recv_timeout(slice);
            if !self.paused {
                self.left = self.left.saturating_sub(begin.elapsed());
            }
            match message {
                Ok(message) => return self.take(message).map(Some),
                Err(RecvTimeoutError::Disconnected) => {
                    self.over = true;
                    return Err(self.client.ended(&self.during));
                }
                Err(RecvTimeoutError::Timeout) if self.left.is_zero() => {
                    let (during, allowed) = (self.during.clone(), self.allowed);
                    return Err(self.stop_with(ClientError::Overdue { during, allowed }));
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() >= until => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// The next event; only the work's deadline applies. An error ends the work.
    pub fn step(&mut self) -> Result<Step, ClientError> {
        loop {
            if let Some(step) = self.step_within(Duration::from_secs(3600))? {
                return Ok(step);
            }
        }
    }

    pub fn wait(mut self) -> Result<EventKind, ClientError> {
        loop {
            if let Step::Done(kind) = self.step()? {
                return Ok(kind);
            }
        }
    }

    pub fn moved(self) -> Result<Moved, ClientError> {
        let during = self.during.clone();
        match self.wait()? {
            EventKind::MoveDone { asked, measured, .. } => Ok(Moved { asked, measured }),
            other => Err(wrong_end(&during, &other)),
        }
    }

    /// Waits for the end of a homing; returns the change of the encoder's zero.
    pub fn homed(self) -> Result<Nanometres, ClientError> {
        let during = self.during.clone();
        match self.wait()? {
            EventKind::Homed { shift, .. } => Ok(shift),
            other => Err(wrong_end(&during, &other)),
        }
    }

    fn take(&mut self, message: Message) -> Result<Step, ClientError> {
        let during = || self.during.clone();
        let kind = match message {
            Message::Event(kind, received) => {
                self.received = received;
                kind
            }
            Message::Broken(broken) => {
                self.over = true;
                return Err(broken.error(self.client.port(), &self.during));
            }
            Message::EventsLost { from, to } => {
                let error = ClientError::EventsLost { during: during(), from, to };
                return Err(self.stop_with(error));
            }
            Message::NoEnd => {
                self.over = true;
                return Err(ClientError::NoEnd { during: during() });
            }
        };
        if !belongs(&kind, &self.request) {
            let answer = format!("{kind:?} to {:?}", self.request);
            return Err(self.stop_with(ClientError::Nonsense { during: during(), answer }));
        }
        match kind {
            // The stop may have been sent by the caller of the interruption; its event may come first.
            EventKind::Failed { reason: Failure::Stopped, .. } if self.client.interrupted() => {
                self.over = true;
                Err(ClientError::Interrupted { during: during(), stopped: true })
            }
            EventKind::Failed { axis, reason, .. } => {
                self.over = true;
                Err(ClientError::Failed { during: during(), axis, reason, alarm: self.alarm_of(reason) })
            }
            EventKind::Homed { .. }
            | EventKind::MoveDone { .. }
            | EventKind::ProgramDone { .. }
            | EventKind::ContinuousDone { .. }
            | EventKind::Calibrated { .. } => {
                self.over = true;
                Ok(Step::Done(kind))
            }
            kind => {
                if self.is_continuous() {
                    self.left = self.allowed;
                }
                self.paused = matches!(kind, EventKind::Paused { .. });
                if let EventKind::Alarm(record) = kind {
                    self.alarm = Some(record);
                }
                Ok(Step::Event(kind))
            }
        }
    }

    /// The alarm of a failure: from an earlier event, else from the board's list.
    fn alarm_of(&self, reason: Failure) -> Option<AlarmRecord> {
        let Failure::Alarm { number } = reason else { return self.alarm };
        self.alarm.filter(|record| record.number == number).or_else(|| self.client.alarm(number).ok())
    }

    /// Endless work: the deadline is that of its next event.
    fn is_continuous(&self) -> bool {
        matches!(self.request, Request::RunContinuously { .. })
    }

    fn stop_with(&mut self, error: ClientError) -> ClientError {
        self.over = true;
        // The rig's state is valid only at standstill, so wait until it has braked.
        match self.client.stop().and_then(|()| self.client.wait_until_it_stands()) {
            Ok(()) => error,
            Err(failed) => failed,
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        if !self.over {
            // The caller has its own error; the board has its deadline.
            let _ = self.client.stop();
        }
    }
}

impl Client {
    pub(crate) fn start_work(
        &self,
        request: &Request,
        work: Duration,
        during: String,
    ) -> Result<Work, ClientError> {
        let name = during.clone();
        only(self.start_together(&[Plan { request: request.clone(), work, during }])?, &name)
    }

    /// Starts several works simultaneously. If one is refused, the others are stopped.
    fn start_together(&self, plans: &[Plan]) -> Result<Vec<Work>, ClientError> {
        self.after_lost_work(|| self.start_once(plans))
    }

    fn start_once(&self, plans: &[Plan]) -> Result<Vec<Work>, ClientError> {
        if plans.is_empty() {
            return Ok(Vec::new());
        }
        let during = plans.iter().map(|plan| plan.during.as_str()).collect::<Vec<_>>().join(" and ");
        if self.interrupted() {
            return Err(ClientError::Interrupted { during, stopped: true });
        }
        let (mut questions, mut ends) = (Vec::new(), Vec::new());
        for plan in plans {
            let ((messages, receiver), held) = (channel(), Arc::new(()));
            let bears_loss = matches!(plan.request, Request::RunContinuously { .. });
            let listener = Listener { messages, held: Arc::downgrade(&held), bears_loss };
            let (request, during) = (plan.request.clone(), plan.during.clone());
            questions.push(Question { request, during, listener: Some(listener) });
            ends.push((receiver, held));
        }
        let answered = self.ask_together(questions, &during)?;
        let (mut started, mut refused) = (Vec::new(), None);
        for ((plan, answered), (messages, held)) in plans.iter().zip(answered).zip(ends) {
            match answered {
                Ok((id, Response::Accepted)) => {
                    let allowed = self.timing().allowance(plan.work);
                    started.push(Work {
                        client: self.clone(),
                        id,
                        request: plan.request.clone(),
                        during: plan.during.clone(),
                        messages,
                        _held: held,
                        allowed,
                        left: allowed,
                        paused: false,
                        alarm: None,
                        over: false,
                        received: Instant::now(),
                    });
                }
                Ok((_, other)) => refused = refused.or_else(|| Some(nonsense(&plan.during, &other))),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        match refused {
            Some(error) => Err(error),
            None => Ok(started),
        }
    }

    /// Keep-alive timeout, limited to the board's range.
    pub(crate) fn keep_alive(&self) -> Micros {
        let limits = &self.hello().limits;
        let asked = Micros(u32::try_from(self.timing().keep_alive.as_micros()).unwrap_or(u32::MAX));
        asked.max(limits.silence_min).min(limits.silence_max)
    }

    /// Speed of an axis by the board's settings, read on first use.
    fn pace(&self, axis: Axis) -> Result<Pace, ClientError> {
        let known = self.known().paces.iter().find(|(of, _)| *of == axis).map(|(_, pace)| *pace);
        if let Some(pace) = known {
            return Ok(pace);
        }
        let pace = Pace::of(axis, |key| self.setting(key).map(|setting| setting.value))?;
        self.known().paces.push((axis, pace));
        Ok(pace)
    }

    /// Homes the axes simultaneously.
    pub fn start_homing(&self, axes: &[Axis]) -> Result<Vec<Work>, ClientError> {
        let plan = |axis: &Axis| {
            Ok(Plan {
                request: Request::Home { axis: *axis, silence: self.keep_alive() },
                work: homing_time(*axis, &self.hello().limits, self.pace(*axis)?),
                during: format!("homing the {}", axis_name(*axis)),
            })
        };
        self.start_together(&axes.iter().map(plan).collect::<Result<Vec<_>, ClientError>>()?)
    }

    pub fn start_home(&self, axis: Axis) -> Result<Work, ClientError> {
        only(self.start_homing(&[axis])?, "homing")
    }

    /// Homes an axis; returns the change of the encoder's zero.
    pub fn home(&self, axis: Axis) -> Result<Nanometres, ClientError> {
        self.start_home(axis)?.homed()
    }

    /// Moves the axes to absolute positions simultaneously.
    pub fn start_moves(&self, targets: &[(Axis, Nanometres)]) -> Result<Vec<Work>, ClientError> {
        let status = self.status()?;
        let plan = |&(axis, target): &(Axis, Nanometres)| {
            Ok(Plan {
                request: Request::Move { axis, target, silence: self.keep_alive() },
                work: move_time(axis, status.axis(axis).measured, target, self.pace(axis)?),
                during: format!("moving the {} to {:.3} um", axis_name(axis), um(target)),
            })
        };
        self.start_together(&targets.iter().map(plan).collect::<Result<Vec<_>, ClientError>>()?)
    }

    pub fn start_move(&self, axis: Axis, target: Nanometres) -> Result<Work, ClientError> {
        only(self.start_moves(&[(axis, target)])?, "moving")
    }

    pub fn move_to(&self, axis: Axis, target: Nanometres) -> Result<Moved, ClientError> {
        self.start_move(axis, target)?.moved()
    }

    pub fn calibrate(&self, routine: Routine) -> Result<Calibration, ClientError> {
        let during = format!("measuring the {}", routine_name(routine));
        let axis = match routine {
            Routine::Travel { axis } | Routine::Backlash { axis } => axis,
            Routine::Gauge => Axis::SensorCoarse,
            Routine::Piezo => Axis::SensorFine,
        };
        let work = calibration_time(routine, &self.hello().limits, self.pace(axis)?);
        let request = Request::Calibrate { routine, silence: self.keep_alive() };
        match self.start_work(&request, work, during.clone())?.wait()? {
            EventKind::Calibrated { result, .. } => Ok(result),
            other => Err(wrong_end(&during, &other)),
        }
    }

    /// Loads and arms a program; it stays armed. Returns [`ClientError::TooManyShots`] before anything is loaded.
    pub fn arm(&self, shots: &[Shot]) -> Result<(), ClientError> {
        let max = self.hello().limits.shots_max;
        let Some(count) = u8::try_from(shots.len()).ok().filter(|count| *count <= max) else {
            return Err(ClientError::TooManyShots { shots: shots.len(), max });
        };
        self.after_lost_work(|| self.arm_once(shots, count))
    }

    fn arm_once(&self, shots: &[Shot], count: u8) -> Result<(), ClientError> {
        for (index, shot) in (0..count).zip(shots) {
            let request = Request::LoadShot { index, shot: *shot };
            self.expect_accepted(&request, &format!("loading shot {index}"))?;
            if let Some(levels) = self.light(index) {
                let light = Some(ShotLight { levels, delay: Micros(0), length: shot.exposure });
                let during = format!("setting the light of shot {index}");
                self.expect_accepted(&Request::SetShotLight { index, light }, &during)?;
            }
        }
        self.expect_accepted(&Request::ArmProgram { shots: count }, "arming the exposure program")
    }

    /// Runs the armed program; `shots` set its deadline.
    pub fn start_program(&self, shots: &[Shot]) -> Result<Work, ClientError> {
        let work = self.program_time(shots)?;
        let during = "running the exposure program".to_string();
        self.start_work(&Request::RunProgram { silence: self.keep_alive() }, work, during)
    }

    pub(crate) fn program_time(&self, shots: &[Shot]) -> Result<Duration, ClientError> {
        let status = self.status()?;
        if status.program.state == ProgramState::Idle {
            return Err(ClientError::NotArmed);
        }
        let mut paces = Vec::new();
        for axis in Axis::ALL {
            if shots.iter().any(|shot| shot.axis == axis) {
                paces.push((axis, self.pace(axis)?));
            }
        }
        Ok(program_time(shots, &status, &paces, self.readout()?))
    }

    /// Read-out time of the camera by the board's settings, read on first use.
    fn readout(&self) -> Result<Duration, ClientError> {
        let known = self.known().readout;
        if let Some(readout) = known {
            return Ok(readout);
        }
        let micros = self.setting(SettingKey::CameraReadoutUs)?.value;
        let readout = Duration::from_micros(u64::try_from(micros).unwrap_or(0));
        self.known().readout = Some(readout);
        Ok(readout)
    }

    /// Arms and runs a program. `on_event` receives [`EventKind::ShotDone`] and [`EventKind::ShotReady`] immediately;
    /// its error stops the board and is returned. Returns the number of exposures.
    pub fn run_program<E: From<ClientError>>(
        &self,
        shots: &[Shot],
        mut on_event: impl FnMut(&EventKind) -> Result<(), E>,
    ) -> Result<u16, E> {
        self.arm(shots)?;
        let mut work = self.start_program(shots)?;
        loop {
            match work.step()? {
                Step::Event(kind) => on_event(&kind)?,
                Step::Done(EventKind::ProgramDone { exposures, .. }) => return Ok(exposures),
                Step::Done(other) => return Err(wrong_end("running the exposure program", &other).into()),
            }
        }
    }
}

fn only(started: Vec<Work>, during: &str) -> Result<Work, ClientError> {
    started.into_iter().next().ok_or_else(|| nothing(during))
}

/// Whether an event with the request's id matches its axis and target.
fn belongs(kind: &EventKind, request: &Request) -> bool {
    match (kind, request) {
        (EventKind::Homed { axis, .. }, Request::Home { axis: asked, .. }) => axis == asked,
        (EventKind::MoveDone { axis, asked, .. }, Request::Move { axis: of, target, .. }) => {
            (axis, asked) == (of, target)
        }
        (
            EventKind::Failed { axis: Some(axis), .. },
            Request::Home { axis: of, .. } | Request::Move { axis: of, .. },
        ) => axis == of,
        (EventKind::ProgramDone { .. }, Request::RunProgram { .. })
        | (EventKind::ContinuousDone { .. }, Request::RunContinuously { .. })
        | (EventKind::Calibrated { .. }, Request::Calibrate { .. }) => true,
        (
            EventKind::Homed { .. }
            | EventKind::MoveDone { .. }
            | EventKind::ProgramDone { .. }
            | EventKind::ContinuousDone { .. }
            | EventKind::Calibrated { .. },
            _,
        ) => false,
        _ => true,
    }
}

pub(crate) fn wrong_end(during: &str, kind: &EventKind) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: format!("{kind:?}") }
}
