//! A scripted board at the other end of a line, with the faults a line and a board can have: for tests and examples.
//!
//! It keeps the protocol's promises (an id acts once, events are numbered and can be read again), so that what
//! the client makes of a fault is seen, not what the peer makes of it. Work ends at once. The line is in memory
//! ([`Peer::connect`]) or, on Linux, a pseudo-terminal (`plug_in`). How a rig really behaves is `farnear-sim`'s to show.

#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

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

/// What is wrong with the line or the board.
#[derive(Default, Clone)]
pub struct Faults {
    /// So many requests are lost on their way to the board.
    pub lose_requests: u32,
    /// So many answers are lost on their way back.
    pub lose_answers: u32,
    /// Every answer comes twice.
    pub duplicate_answers: bool,
    /// Events with these numbers are lost.
    pub lose_events: Vec<u32>,
    /// These bytes come before every frame of the board.
    pub garbage: Vec<u8>,
    /// The board resets instead of carrying out this kind of request.
    pub reset_at_move: bool,
    /// Whether the reset announces itself with a `Started` event.
    pub silent_reset: bool,
    /// The line breaks at the first request of this kind.
    pub gone_at_program: bool,
    /// A continuous run drops the frames with these numbers.
    pub drop_frames: Vec<u32>,
    /// Work is taken on and never ends.
    pub never_ends: bool,
    /// Work that was taken on asks so often whether the host is still there, and ends at the last answer.
    pub asks_first: u32,
    /// The board forgets events at once.
    pub forgetful: bool,
    /// The board works, ends, and says nothing.
    pub end_unsaid: bool,
    pub fails_with: Option<Failure>,
    /// Work ends with this alarm.
    pub alarm_at_work: Option<Alarm>,
    /// After a stop it brakes for so many looks at its status.
    pub brakes_for: u32,
    /// The board refuses every version but this.
    pub other_version: Option<u8>,
    /// The board does not know the request for another rate.
    pub one_rate: bool,
    /// The adapter passes nothing at this rate.
    pub no_rate: Option<LinkRate>,
}

/// The board: what it is, where it stands, what it was told.
pub struct Board {
    /// What it says of itself.
    pub hello: Hello,
    /// What is wrong with it and its line.
    pub faults: Faults,
    /// Its clock since the reset, us.
    pub time: u64,
    /// Where the sensor's coarse axis stands.
    pub coarse: Nanometres,
    /// Where the piezo stands.
    pub fine: Nanometres,
    /// Where the lens stage stands.
    pub lens: Nanometres,
    /// Whether the coarse axis was homed.
    pub homed: bool,
    /// Whether the lens stage was homed.
    pub lens_homed: bool,
    /// Homings, moves and programs that were carried out.
    pub acts: u32,
    /// How often it was told to stop.
    pub stops: u32,
    /// How often it was halted.
    pub halts: u32,
    /// Keep-alive timeouts that came with work.
    pub keep_alives: Vec<Micros>,
    /// The shots that were loaded, by their place.
    pub program: Vec<Option<Shot>>,
    /// How many of them are armed.
    pub armed: u8,
    /// What happened, from the first event on.
    pub events: Vec<Event>,
    /// Exposures that were triggered.
    pub triggers: u32,
    pub alarms: Vec<AlarmRecord>,
    /// Whether the last of them is latched.
    pub latched: bool,
    /// Settings that were changed, by name.
    pub settings: BTreeMap<&'static str, i32>,
    /// Whether the home and the far switch of the coarse axis are closed.
    pub switches: [bool; 2],
    /// The same of the lens stage.
    pub lens_switches: [bool; 2],
    /// Whether the emergency stop is pressed.
    pub emergency_stop: bool,
    pub counters: Counters,
    /// Status requests that answered [`EventKind::StillThere`].
    pub still_there: u32,
    /// Connections that are open at the host's end.
    pub connections: usize,
    /// The line is broken: nothing arrives and nothing can be opened.
    pub gone: bool,
    active: Option<(u32, Request)>,
    /// Looks at its status until it stands.
    pub braking: u32,
    asking: u32,
    logs: u32,
    /// The rate of the board's end, the one it goes back to and when, and the rate of the host's end.
    pub rate: LinkRate,
    trial: Option<(LinkRate, Instant)>,
    host_rate: LinkRate,
    /// The number of the open session.
    pub session: u32,
    remembered: BTreeMap<u32, Vec<u8>>,
    decoder: Decoder,
    out: VecDeque<u8>,
}

/// An open connection to a board.
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
    /// A board that is at rest and was not homed yet.
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
            rate: LinkRate::START,
            trial: None,
            host_rate: LinkRate::START,
            session: NO_SESSION,
            remembered: BTreeMap::new(),
            decoder: Decoder::new(),
            out: VecDeque::new(),
        })))
    }

    /// What opens the line to this board again and again.
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

    /// One more connection to this board.
    fn connection(&self) -> Connection {
        let mut board = self.board();
        board.connections += 1;
        board.host_rate = LinkRate::START;
        drop(board);
        Connection(self.clone())
    }

    /// The board, to look at it or to change it.
    ///
    /// # Panics
    /// Where a thread that had it panicked.
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

    /// Whether both ends have one rate, which the adapter passes. A rate at which nobody was heard is left.
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

    /// Has another rate from now on, on trial.
    fn change_rate(&mut self, rate: LinkRate) {
        let until = Instant::now() + Duration::from_micros(u64::from(LINK_TRIAL.0));
        self.trial = Some((self.rate, until));
        self.rate = rate;
    }

    /// A frame, behind whatever garbage the line adds.
    fn send(&mut self, frame: &[u8]) {
        self.out.extend(&self.faults.garbage);
        self.out.extend(frame);
    }

    /// Something that another program left on the line.
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

    /// Says that something happened, whether or not it did.
    pub fn say(&mut self, kind: EventKind) {
        self.event(kind);
    }

    /// The coarse axis lands where a screw lands: near the place asked for.
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

    /// The board starts anew, in its next boot.
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

    /// Says something into the log.
    ///
    /// # Panics
    /// Where it does not fit a frame.
    pub fn log(&mut self, bytes: &[u8]) {
        let log = Log { bytes: bytes.try_into().unwrap() };
        let number = self.logs;
        self.logs += 1;
        self.put(Kind::Log, number, &log);
    }

    /// A piece of the log that gets lost on the line.
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
