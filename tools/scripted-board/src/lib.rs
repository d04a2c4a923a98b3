//! A scripted board with configurable faults of line and board, for tests and examples. It follows the
//! protocol (an id acts once, events are numbered and can be read again), so tests see how the client handles
//! a fault. Work ends immediately. The line is in memory ([`Peer::connect`]) or, on Linux, a pseudo-terminal
//! (`plug_in`). `farnear-sim` is realistic.

#![allow(clippy::unwrap_used)] // panics fail the test

use std::{
    collections::{BTreeMap, VecDeque},
    io,
    sync::{Arc, Mutex, MutexGuard},
    time::{Duration, Instant},
};

use farnear_capture::Transport;
use farnear_protocol::{
    Event, Log, PROTOCOL_CURRENT, PROTOCOL_MIN, Request, Response,
    frame::{Decoder, Kind},
    message::{
        Alarm, AlarmRecord, Axis, AxisStatus, Capabilities, Counters, EventKind, Failure, Hello, LINK_TRIAL,
        Limits, LinkCounters, LinkRate, NO_SESSION, PositionState, ProgramState, ProgramStatus, ResetCause,
        SCHEMA_KEY, Shot, Status,
    },
    units::{BoardMicros, Micros, Nanometres},
};
use serde::Serialize;

mod answers;
mod keep;
#[cfg(target_os = "linux")]
mod port;
mod work;

#[cfg(target_os = "linux")]
pub use port::plug_in;

#[derive(Default, Clone)]
pub struct Faults {
    pub lose_requests: u32,
    pub lose_answers: u32,
    pub duplicate_answers: bool,
    /// Numbers of the events to lose.
    pub lose_events: Vec<u32>,
    /// Bytes before each frame of the board.
    pub garbage: Vec<u8>,
    /// Resets instead of executing a move.
    pub reset_at_move: bool,
    /// The reset sends no `Started` event.
    pub silent_reset: bool,
    /// The line breaks at a program request.
    pub gone_at_program: bool,
    /// Frame numbers dropped by a continuous run.
    pub drop_frames: Vec<u32>,
    pub never_ends: bool,
    /// Number of keep-alives before work ends.
    pub asks_first: u32,
    /// Events are forgotten immediately.
    pub forgetful: bool,
    /// Work ends without an event.
    pub end_unsaid: bool,
    pub fails_with: Option<Failure>,
    pub alarm_at_work: Option<Alarm>,
    /// Status requests during which it brakes after a stop.
    pub brakes_for: u32,
    /// The only accepted protocol version.
    pub other_version: Option<u8>,
    /// The board rejects rate changes.
    pub one_rate: bool,
    /// The board moves, and refuses rate changes.
    pub busy: bool,
    pub no_counters_after_reset: bool,
    pub strobe_longer_us: u64,
    /// Rate at which the adapter passes nothing.
    pub no_rate: Option<LinkRate>,
}

pub struct Board {
    pub hello: Hello,
    pub faults: Faults,
    /// Since the reset, us.
    pub time: u64,
    pub coarse: Nanometres,
    pub fine: Nanometres,
    pub lens: Nanometres,
    pub homed: bool,
    pub lens_homed: bool,
    /// Completed homings, moves and programs.
    pub acts: u32,
    pub stops: u32,
    pub halts: u32,
    /// Keep-alive timeouts of the requests.
    pub keep_alives: Vec<Micros>,
    pub program: Vec<Option<Shot>>,
    pub armed: u8,
    /// All events since power-on.
    pub events: Vec<Event>,
    pub triggers: u32,
    pub alarms: Vec<AlarmRecord>,
    /// Whether the last alarm is latched.
    pub latched: bool,
    /// Changed settings by name.
    pub settings: BTreeMap<&'static str, i32>,
    pub switches: [bool; 2],
    pub lens_switches: [bool; 2],
    pub emergency_stop: bool,
    pub counters: Counters,
    /// Status requests that answered [`EventKind::StillThere`].
    pub still_there: u32,
    pub connections: usize,
    /// Line broken: nothing arrives or can be opened.
    pub gone: bool,
    active: Option<(u32, Request)>,
    /// Remaining status requests until rest.
    pub braking: u32,
    asking: u32,
    logs: u32,
    pub rate_requests: u32,
    /// Board rate, fallback rate with its time, and host rate.
    pub rate: LinkRate,
    trial: Option<(LinkRate, Instant)>,
    host_rate: LinkRate,
    pub session: u32,
    remembered: BTreeMap<u32, Vec<u8>>,
    decoder: Decoder,
    out: VecDeque<u8>,
}

struct Connection(Peer);

impl Drop for Connection {
    fn drop(&mut self) {
        self.0.board().connections -= 1;
    }
}

/// The host's end of the line.
#[derive(Clone)]
pub struct Peer(Arc<Mutex<Board>>);

impl Peer {
    /// A board at rest, not homed.
    pub fn new(faults: Faults) -> Self {
        let limits = Limits {
            datum: Nanometres(47_000_000),
            coarse_min: Nanometres(0),
            coarse_max: Nanometres(13_000_000),
            coarse_step_pm: 156_250,
            fine_min: Nanometres(0),
            fine_max: Nanometres(200_000),
            shots_max: 16,
            exposure_min: Micros(10),
            exposure_max: Micros(1_000_000),
            lens_min: Nanometres(0),
            lens_max: Nanometres(12_000_000),
            lens_step_pm: 156_250,
            distance_min: Nanometres(46_000_000),
            silence_min: Micros(100_000),
            silence_max: Micros(60_000_000),
            row_pixels_max: 1024,
        };
        let hello = Hello {
            protocol_min: PROTOCOL_MIN,
            protocol_current: PROTOCOL_CURRENT,
            schema_key: SCHEMA_KEY,
            board: "scripted".try_into().unwrap(),
            firmware: "0.0.1".try_into().unwrap(),
            unique_id: *b"twelve bytes",
            boot: 7,
            reset_cause: ResetCause::PowerOn,
            emulated: false,
            capabilities: Capabilities {
                sensor_coarse: true,
                sensor_fine: true,
                strobe: true,
                lens: true,
                memory: true,
                emergency_stop: true,
            },
            limits,
            last_id: 0,
            outstanding: 8,
        };
        let started = Event { time: BoardMicros(0), kind: EventKind::Started { cause: ResetCause::PowerOn } };
        Self(Arc::new(Mutex::new(Board {
            hello,
            faults,
            time: 1000,
            coarse: Nanometres(123),
            fine: Nanometres(0),
            lens: Nanometres(77),
            homed: false,
            lens_homed: false,
            acts: 0,
            stops: 0,
            halts: 0,
            keep_alives: Vec::new(),
            program: vec![None; 16],
            armed: 0,
            events: vec![started],
            triggers: 0,
            alarms: Vec::new(),
            latched: false,
            settings: BTreeMap::new(),
            switches: [false; 2],
            lens_switches: [false; 2],
            emergency_stop: false,
            counters: Counters { boots: 7, ..Counters::default() },
            still_there: 0,
            connections: 0,
            gone: false,
            active: None,
            braking: 0,
            asking: 0,
            logs: 0,
            rate_requests: 0,
            rate: LinkRate::START,
            trial: None,
            host_rate: LinkRate::START,
            session: NO_SESSION,
            remembered: BTreeMap::new(),
            decoder: Decoder::new(),
            out: VecDeque::new(),
        })))
    }

    pub fn connect(&self) -> farnear_capture::Connect {
        let peer = self.clone();
        Box::new(move || {
            if peer.board().gone {
                let (port, present) = ("scripted".into(), Vec::new());
                return Err(farnear_capture::PortError::Absent { port, present });
            }
            Ok(Box::new(peer.connection()) as Box<dyn Transport>)
        })
    }

    fn connection(&self) -> Connection {
        let mut board = self.board();
        board.connections += 1;
        board.host_rate = LinkRate::START;
        drop(board);
        Connection(self.clone())
    }

    /// Panics if the lock is poisoned.
    pub fn board(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap()
    }
}

impl Transport for Connection {
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let mut board = self.0.board();
        if board.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        if board.out.is_empty() {
            drop(board);
            std::thread::sleep(wait);
            return Ok(0);
        }
        let count = board.out.len().min(buffer.len());
        for (slot, byte) in buffer.iter_mut().zip(board.out.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8], _: Duration) -> io::Result<()> {
        let mut board = self.0.board();
        if board.gone {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        if !board.hears_the_host() {
            return Ok(());
        }
        for byte in bytes {
            if let Some(Ok(packet)) = board.decoder.push(*byte) {
                board.receive(&packet);
            }
        }
        Ok(())
    }

    fn discard_input(&mut self) -> io::Result<()> {
        self.0.board().out.clear();
        Ok(())
    }

    fn set_rate(&mut self, rate: LinkRate) -> io::Result<()> {
        self.0.board().host_rate = rate;
        Ok(())
    }
}

impl Board {
    fn put<T: Serialize>(&mut self, kind: Kind, id: u32, message: &T) {
        let frame = answers::frame(self.hello.boot, kind, id, message);
        self.send(&frame);
    }

    /// Whether both ends have a rate that the adapter passes. An unconfirmed rate is abandoned after its trial.
    fn hears_the_host(&mut self) -> bool {
        if let Some((back, _)) = self.trial.filter(|(_, until)| Instant::now() >= *until) {
            (self.rate, self.trial) = (back, None);
        }
        let hears = self.host_rate == self.rate && self.faults.no_rate != Some(self.rate);
        if hears {
            self.trial = None;
        }
        hears
    }

    fn change_rate(&mut self, rate: LinkRate) {
        let until = Instant::now() + Duration::from_micros(u64::from(LINK_TRIAL.0));
        self.trial = Some((self.rate, until));
        self.rate = rate;
    }

    fn send(&mut self, frame: &[u8]) {
        self.out.extend(&self.faults.garbage);
        self.out.extend(frame);
    }

    /// Puts a stale frame of another program on the line.
    pub fn put_stale(&mut self, id: u32, response: &Response) {
        self.put(Kind::Response, id, response);
    }

    fn event(&mut self, kind: EventKind) {
        self.time += 100;
        let event = Event { time: BoardMicros(self.time), kind };
        let number = self.events.len() as u32;
        self.events.push(event.clone());
        if !self.faults.lose_events.contains(&number) {
            self.put(Kind::Event, number, &event);
        }
    }

    pub fn say(&mut self, kind: EventKind) {
        self.event(kind);
    }

    /// Near the target, with an error like a screw's.
    fn place(&mut self, axis: Axis, target: Nanometres) {
        match axis {
            Axis::SensorCoarse => self.coarse = Nanometres(target.0 + 375),
            Axis::SensorFine => self.fine = Nanometres(target.0 - 2),
            Axis::Lens => self.lens = Nanometres(target.0 + 125),
        }
    }

    fn measured(&self, axis: Axis) -> Nanometres {
        match axis {
            Axis::SensorCoarse => self.coarse,
            Axis::SensorFine => self.fine,
            Axis::Lens => self.lens,
        }
    }

    /// Increments the boot number.
    pub fn reset(&mut self, cause: ResetCause) {
        self.hello.boot += 1;
        (self.rate, self.trial) = (LinkRate::START, None);
        self.hello.reset_cause = cause;
        self.homed = false;
        self.lens_homed = false;
        self.armed = 0;
        self.active = None;
        self.remembered.clear();
        self.hello.last_id = 0;
        self.session = NO_SESSION;
        self.events.clear();
        self.faults.reset_at_move = false;
        if self.faults.silent_reset {
            self.events.push(Event { time: BoardMicros(0), kind: EventKind::Started { cause } });
        } else {
            self.event(EventKind::Started { cause });
        }
    }

    pub fn log(&mut self, bytes: &[u8]) {
        let log = Log { bytes: bytes.try_into().unwrap() };
        let number = self.logs;
        self.logs += 1;
        self.put(Kind::Log, number, &log);
    }

    pub fn lose_log(&mut self) {
        self.logs += 1;
    }

    fn status(&self) -> Status {
        let axis = |homed: bool, position| AxisStatus {
            state: if homed { PositionState::Homed } else { PositionState::Unknown },
            asked: position,
            measured: position,
            moving: false,
            request: None,
        };
        let active = self.active.as_ref().map(|(id, _)| *id);
        let state = if self.armed > 0 { ProgramState::Armed } else { ProgramState::Idle };
        Status {
            time: BoardMicros(self.time),
            coarse: AxisStatus { request: active, moving: self.braking > 0, ..axis(self.homed, self.coarse) },
            fine: axis(true, self.fine),
            lens: axis(self.lens_homed, self.lens),
            home_switch: self.switches[0],
            far_switch: self.switches[1],
            lens_home_switch: self.lens_switches[0],
            lens_far_switch: self.lens_switches[1],
            emergency_stop: self.emergency_stop,
            supply_low: false,
            alarm: self.alarms.last().copied().filter(|_| self.latched),
            program: ProgramStatus { state, shots: self.armed, index: 0, exposures: 0 },
            next_event: self.events.len() as u32,
            triggers: self.triggers,
            steps: 0,
            link: LinkCounters::default(),
        }
    }
}
