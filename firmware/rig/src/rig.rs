//! The rig as a whole: what a request starts, what runs, how it ends.
//!
//! One piece of long work at a time (the protocol's `active`). Work that fails or is stopped stays active until
//! nothing moves any more, and then ends with its one terminal event.

use farnear_protocol::frame::{self, Encoded, Kind};
use farnear_protocol::message::{
    Axis, Capabilities, EventKind, Failure, Hello, Limits, PositionState, ProgramState, ProgramStatus,
    Request, RequestError, Response, SCHEMA_KEY, Shot, ShotFault, Status,
};
use farnear_protocol::{BoardMicros, Micros, Nanometres, PROTOCOL_CURRENT, PROTOCOL_MIN};
use heapless::String;

use crate::camera::Camera;
use crate::events::Events;
use crate::home::Homing;
use crate::identity::Identity;
use crate::io::{Inputs, MEMORY_BYTES, MotorOutputs, Outputs};
use crate::program::{Run, SHOTS_MAX, Shots};
use crate::session::{Incoming, Session};
use crate::settings::{STEP_PM, Settings};
use crate::stage::{Positioning, Stage, limits, since};

/// Long work.
#[derive(Clone, Debug)]
enum Work {
    Home(Axis, Homing),
    Move {
        axis: Axis,
        target: Nanometres,
        positioning: Positioning,
    },
    Program(Run),
    /// Ends with this once nothing moves.
    Ending {
        axis: Option<Axis>,
        reason: Failure,
    },
}

/// Long work and the request that began it.
#[derive(Clone, Debug)]
struct Active {
    request: u32,
    work: Work,
}

/// A reboot that was asked for.
#[derive(Clone, Copy, Debug)]
struct Reboot {
    request: u32,
    asked: BoardMicros,
    /// Since when nothing moves and nothing waits to be sent.
    quiet_since: Option<BoardMicros>,
}

/// Everything the board does, without its hardware.
#[derive(Clone, Debug)]
pub struct Rig {
    identity: Identity,
    settings: Settings,
    stage: Stage,
    camera: Camera,
    shots: Shots,
    armed: u8,
    active: Option<Active>,
    events: Events,
    session: Session,
    reboot: Option<Reboot>,
}

/// What the rig may take of a board's memory.
const _: () = assert!(size_of::<Rig>() <= 16 * 1024);

impl Rig {
    /// The rig of `docs/rig.md`, just reset, at `now`.
    /// `memory` is what the FRAM holds, `None` where none answers.
    pub fn new(identity: Identity, memory: Option<&[u8; MEMORY_BYTES]>, now: BoardMicros) -> Self {
        let _ = memory;
        Self::with_settings(identity, Settings::DEFAULT, now)
    }

    /// The number of this boot.
    pub const fn boot(&self) -> u32 {
        self.identity.boot
    }

    /// A rig with other numbers.
    pub fn with_settings(identity: Identity, settings: Settings, now: BoardMicros) -> Self {
        let mut events = Events::new();
        events.push(now, EventKind::Started { cause: identity.reset_cause });
        Self {
            identity,
            settings,
            stage: Stage::new(&settings),
            camera: Camera::new(settings.camera),
            shots: Shots::new(),
            armed: 0,
            active: None,
            events,
            session: Session::new(identity.boot),
            reboot: None,
        }
    }

    /// Who it is.
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Takes one byte from the link. At the end of a request the request is carried out or begun, and its answer
    /// waits in [`Self::transmit`].
    pub fn receive(&mut self, byte: u8, now: BoardMicros) {
        if let Some(incoming) = self.session.receive(byte) {
            let answer = self.carry_out(&incoming, now);
            self.session.answer(incoming, &answer);
        }
    }

    /// The next frame for the link, answers before events; call it until it gives `None`.
    pub fn transmit(&mut self) -> Option<Encoded> {
        if let Some(answer) = self.session.send() {
            return Some(answer);
        }
        let (number, event) = self.events.send()?;
        frame::encode(self.session.header(Kind::Event, number), event)
    }

    /// One control tick; call it [`crate::io::TICK_HZ`] times a second and carry its outputs out at once.
    pub fn tick(&mut self, inputs: &Inputs) -> Outputs {
        let now = inputs.now;
        self.stage.sense(inputs);
        self.camera.sense(inputs.exposure, now);
        self.advance(now);
        let mut outputs = Outputs {
            piezo_dac: 0,
            coarse: MotorOutputs::default(),
            lens: MotorOutputs::default(),
            trigger: self.camera.take_order(),
            listen: false,
            memory: None,
            reset: self.reset_is_due(now),
        };
        self.stage.act(inputs, &mut outputs);
        outputs
    }

    fn carry_out(&mut self, incoming: &Incoming, now: BoardMicros) -> Result<Response, RequestError> {
        let id = incoming.id;
        match &incoming.request {
            Request::Hello => Ok(Response::Hello(self.hello())),
            Request::Status => Ok(Response::Status(self.status(now))),
            Request::ReadEvent { number } => self.read_event(*number),
            Request::Stop => {
                self.end_early(None, Failure::Stopped);
                Ok(Response::Accepted)
            }
            Request::Reboot => {
                self.end_early(None, Failure::Stopped);
                self.reboot.get_or_insert(Reboot { request: id, asked: now, quiet_since: None });
                Ok(Response::Accepted)
            }
            Request::Home { axis, .. } => self.home(*axis, id),
            Request::Move { axis, target, .. } => self.go(*axis, *target, id, now),
            Request::LoadShot { index, shot } => self.load_shot(*index, shot),
            Request::RunProgram { .. } => self.run_program(id, now),
            Request::ArmProgram { shots } => {
                self.armed = *shots;
                Ok(Response::Accepted)
            }
            _ => Err(RequestError::NoSuchRoutine),
        }
    }

    fn home(&mut self, axis: Axis, request: u32) -> Result<Response, RequestError> {
        self.must_be_free()?;
        if axis == Axis::SensorFine {
            return Err(RequestError::CannotHome { axis });
        }
        self.active = Some(Active { request, work: Work::Home(axis, Homing::new()) });
        Ok(Response::Accepted)
    }

    fn go(
        &mut self,
        axis: Axis,
        target: Nanometres,
        request: u32,
        now: BoardMicros,
    ) -> Result<Response, RequestError> {
        self.must_be_inside(axis, target)?;
        self.must_be_homed(axis)?;
        self.must_be_free()?;
        let settled = Positioning::plain(&self.settings, axis);
        let positioning = Positioning::start(&mut self.stage, &self.settings, (axis, target), settled, now);
        self.active = Some(Active { request, work: Work::Move { axis, target, positioning } });
        Ok(Response::Accepted)
    }

    fn load_shot(&mut self, index: u8, shot: &Shot) -> Result<Response, RequestError> {
        if let Some(Active { request, work: Work::Program(_) }) = self.active {
            return Err(RequestError::Busy { request });
        }
        self.must_be_inside(shot.axis, shot.target)?;
        self.shots
            .load(index, *shot, &self.settings)
            .map_err(|reason| RequestError::Shot { index, reason })?;
        Ok(Response::Accepted)
    }

    fn run_program(&mut self, request: u32, now: BoardMicros) -> Result<Response, RequestError> {
        let count = self.armed;
        self.must_be_free()?;
        if usize::from(count) > SHOTS_MAX {
            return Err(RequestError::Shot { index: count, reason: ShotFault::Index });
        }
        for index in 0..count {
            let missing = RequestError::Shot { index, reason: ShotFault::Missing };
            let axis = self.shots.get(index).ok_or(missing)?.axis;
            self.must_be_homed(axis)?;
        }
        let Some(first) = self.shots.get(0).copied().filter(|_| count > 0) else {
            return Err(RequestError::Shot { index: 0, reason: ShotFault::Index });
        };
        let run = Run::start(count, first, &mut self.stage, &self.settings, now);
        self.active = Some(Active { request, work: Work::Program(run) });
        Ok(Response::Accepted)
    }

    fn read_event(&self, number: u32) -> Result<Response, RequestError> {
        match self.events.get(number) {
            Some(event) => Ok(Response::Event(event.clone())),
            None => {
                Err(RequestError::EventGone { oldest: self.events.oldest(), next: self.events.next_number() })
            }
        }
    }

    fn must_be_free(&self) -> Result<(), RequestError> {
        let reboot = self.reboot.map(|reboot| reboot.request);
        match self.active.as_ref().map(|active| active.request).or(reboot) {
            Some(request) => Err(RequestError::Busy { request }),
            None => Ok(()),
        }
    }

    fn must_be_homed(&self, axis: Axis) -> Result<(), RequestError> {
        match self.stage.state(axis) {
            PositionState::Homed => Ok(()),
            state => Err(RequestError::NotHomed { axis, state }),
        }
    }

    fn must_be_inside(&self, axis: Axis, asked: Nanometres) -> Result<(), RequestError> {
        let (min, max) = limits(&self.settings, axis);
        if (min..=max).contains(&asked) {
            Ok(())
        } else {
            Err(RequestError::OutOfRange { axis, asked, min, max })
        }
    }

    /// Takes the active work one tick further.
    fn advance(&mut self, now: BoardMicros) {
        // Whatever runs: a coarse axis that was pushed, stalled or met a switch ends it. Without work nobody is
        // told but whoever asks for the status.
        if self.stage.is_still() {
            if let Some(reason) = self.stage.coarse.take_fault() {
                self.end_early(Some(Axis::SensorCoarse), reason);
            }
            if let Some(reason) = self.stage.lens.take_fault() {
                self.end_early(Some(Axis::Lens), reason);
            }
        }
        let Some(Active { request, work }) = &mut self.active else { return };
        let request = *request;
        match work {
            Work::Home(axis, homing) => {
                let axis = *axis;
                let (stepper, settings) = match axis {
                    Axis::Lens => (&mut self.stage.lens, &self.settings.lens),
                    _ => (&mut self.stage.coarse, &self.settings.coarse),
                };
                let home_switch = stepper.home_closed();
                match homing.tick(stepper, settings, home_switch) {
                    None => {}
                    Some(Ok(shift)) => self.finish(now, EventKind::Homed { request, axis, shift }),
                    Some(Err(reason)) => self.end_early(Some(axis), reason),
                }
            }
            Work::Move { axis, target, positioning } => {
                let (axis, asked) = (*axis, *target);
                match positioning.tick(&self.stage, now) {
                    None => {}
                    Some(Ok(_)) => {
                        let measured = self.stage.measured(axis);
                        self.finish(now, EventKind::MoveDone { request, axis, asked, measured });
                    }
                    Some(Err(reason)) => self.end_early(Some(axis), reason),
                }
            }
            Work::Program(run) => {
                let axis = run.axis();
                let progress = run.tick(&self.shots, &mut self.stage, &mut self.camera, &self.settings, now);
                if let Some(shot) = progress.taken {
                    self.events.push(now, EventKind::ShotDone { request, shot });
                }
                match progress.end {
                    None => {}
                    Some(Ok(exposures)) => self.finish(now, EventKind::ProgramDone { request, exposures }),
                    Some(Err(Failure::NoStrobe)) => self.end_early(None, Failure::NoStrobe),
                    Some(Err(reason)) => self.end_early(Some(axis), reason),
                }
            }
            Work::Ending { axis, reason } if self.stage.is_still() => {
                let (axis, reason) = (*axis, *reason);
                self.finish(now, EventKind::Failed { request, axis, reason });
            }
            Work::Ending { .. } => {}
        }
    }

    fn finish(&mut self, now: BoardMicros, terminal: EventKind) {
        self.active = None;
        self.events.push(now, terminal);
    }

    /// Stops what moves; the active work ends with `reason` once it stands. A fault on the way there tells more
    /// than the stop, so it takes its place. Does nothing where nothing is active.
    fn end_early(&mut self, axis: Option<Axis>, reason: Failure) {
        let Some(active) = &mut self.active else { return };
        if !matches!(active.work, Work::Ending { .. }) {
            self.stage.stop();
        } else if reason == Failure::Stopped {
            return;
        }
        active.work = Work::Ending { axis, reason };
    }

    /// Everything was said and nothing moves, or that took too long.
    fn reset_is_due(&mut self, now: BoardMicros) -> bool {
        let quiet = self.active.is_none() && self.session.all_sent() && self.events.all_sent();
        let link = &self.settings.link;
        let Some(reboot) = &mut self.reboot else { return false };
        if !quiet {
            reboot.quiet_since = None;
            return since(reboot.asked, now) > link.reset_deadline;
        }
        let quiet_since = *reboot.quiet_since.get_or_insert(now);
        since(quiet_since, now) >= link.reset_drain
    }

    fn hello(&self) -> Hello {
        Hello {
            protocol_min: PROTOCOL_MIN,
            protocol_current: PROTOCOL_CURRENT,
            schema_key: SCHEMA_KEY,
            board: cut(self.identity.board),
            firmware: cut(self.identity.firmware),
            unique_id: self.identity.unique_id,
            boot: self.identity.boot,
            reset_cause: self.identity.reset_cause,
            emulated: self.identity.emulated,
            capabilities: Capabilities {
                sensor_coarse: true,
                sensor_fine: true,
                strobe: true,
                lens: true,
                memory: false,
                emergency_stop: false,
            },
            limits: Limits {
                datum: self.settings.datum,
                coarse_min: self.settings.coarse.min,
                coarse_max: self.settings.coarse.max,
                coarse_step_pm: STEP_PM,
                fine_min: self.settings.fine.min,
                fine_max: self.settings.fine.max,
                shots_max: SHOTS_MAX as u8,
                exposure_min: self.settings.camera.exposure_min,
                exposure_max: self.settings.camera.exposure_max,
                lens_min: self.settings.lens.min,
                lens_max: self.settings.lens.max,
                lens_step_pm: STEP_PM,
                distance_min: Nanometres(0),
                silence_min: Micros(100_000),
                silence_max: Micros(60_000_000),
                row_pixels_max: 1024,
            },
        }
    }

    fn status(&self, now: BoardMicros) -> Status {
        let active = self.active.as_ref().map(|active| active.request);
        Status {
            time: now,
            coarse: self.stage.status(Axis::SensorCoarse, active),
            fine: self.stage.status(Axis::SensorFine, active),
            lens: self.stage.status(Axis::Lens, active),
            home_switch: self.stage.coarse.home_closed(),
            far_switch: self.stage.coarse.far_closed(),
            lens_home_switch: self.stage.lens.home_closed(),
            lens_far_switch: self.stage.lens.far_closed(),
            emergency_stop: false,
            supply_low: false,
            alarm: None,
            program: ProgramStatus { state: ProgramState::Idle, shots: self.armed, index: 0, exposures: 0 },
            next_event: self.events.next_number(),
            triggers: self.camera.triggers(),
            steps: self.stage.coarse.total_pulses() + self.stage.lens.total_pulses(),
            link: self.session.counters(),
        }
    }
}

/// As much of a text as fits.
fn cut<const N: usize>(text: &str) -> String<N> {
    let mut out = String::new();
    for character in text.chars() {
        if out.push(character).is_err() {
            break;
        }
    }
    out
}
