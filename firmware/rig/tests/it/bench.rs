//! A rig on the bench: the behaviour under test, a small model of its hardware, and a host's end of the link.
//!
//! The hardware model is as simple as the tests allow (a resonant piezo without hysteresis, a screw with play); the
//! emulated board's plant is the thorough one.

pub mod hardware;
pub mod motor;

use self::hardware::Hardware;
use farnear_protocol::frame::{self, Decoder, Encoded, Header, Kind, Packet};
use farnear_protocol::message::{Alarm, Axis, Event, EventKind, Failure, Hello, ResetCause, Status};
use farnear_protocol::{
    BoardMicros, Call, Micros, Nanometres, PROTOCOL_CURRENT, Request, RequestError, Response,
};
use farnear_rig::io::{MEMORY_BYTES, MemoryWrite, Outputs, TICK_US};
use farnear_rig::{Identity, Rig};

/// Boot number of the bench.
pub const BOOT: u32 = 7;

/// The session that the bench opens.
pub const SESSION: u32 = 0x5e55_1001;

/// Silence that the bench's requests allow: longer than any of its work.
pub const SILENCE: Micros = Micros(60_000_000);

/// A move.
pub fn go(axis: Axis, nm: i32) -> Request {
    Request::Move { axis, target: Nanometres(nm), silence: SILENCE }
}

/// A homing.
pub fn home(axis: Axis) -> Request {
    Request::Home { axis, silence: SILENCE }
}

/// What a piece of work failed with.
pub fn failure(end: &EventKind) -> Failure {
    match end {
        EventKind::Failed { reason, .. } => *reason,
        other => panic!("did not fail: {other:?}"),
    }
}

/// What a request was answered.
pub type Answer = Result<Response, RequestError>;

/// The rig, its hardware and its host.
pub struct Bench {
    pub rig: Rig,
    pub hardware: Hardware,
    pub memory: Box<[u8; MEMORY_BYTES]>,
    boot: u32,
    /// The next write to the FRAM ends after this many bytes; whether one has.
    pub tear: Option<usize>,
    pub torn: bool,
    /// The power goes when this many more bytes have been written to the FRAM; nothing is written after that.
    pub cut_after: Option<usize>,
    pub now: u64,
    pub next_id: u32,
    decoder: Decoder,
    /// Answers in the order they came.
    pub answers: Vec<(u32, Answer)>,
    /// Events in the order they came.
    pub events: Vec<(u32, Event)>,
    /// When the rig asked for its reset.
    pub reset_at: Option<u64>,
    /// Frames are left in the rig while this is set.
    pub deaf: bool,
}

impl Bench {
    /// A rig whose stage A stands at `position_um` from its home switch, with a blank memory.
    pub fn new(position_um: f64) -> Self {
        Self::with_memory(position_um, Box::new([0; MEMORY_BYTES]))
    }

    /// A rig whose memory holds something.
    pub fn with_memory(position_um: f64, memory: Box<[u8; MEMORY_BYTES]>) -> Self {
        let rig = Rig::new(identity(BOOT, ResetCause::Pin), Some(&memory), BoardMicros(0));
        let mut bench = Self {
            boot: rig.boot(),
            rig,
            hardware: Hardware::new(position_um),
            memory,
            tear: None,
            torn: false,
            cut_after: None,
            now: 0,
            next_id: 1,
            decoder: Decoder::new(),
            answers: Vec::new(),
            events: Vec::new(),
            reset_at: None,
            deaf: false,
        };
        bench.keep_boot();
        bench.open_session();
        bench
    }

    /// Opens the bench's session, in no time.
    pub fn open_session(&mut self) {
        let id = self.next_id;
        self.send_as(id, self.boot, &Request::OpenSession);
        self.collect();
        assert_eq!(self.answers.pop(), Some((id, Ok(Response::Accepted))));
    }

    /// The power goes and comes: `boot` is what retained RAM proposes, 1 where it lost that.
    pub fn restart(&mut self, boot: u32, cause: ResetCause) {
        self.hardware.power_off();
        self.rig = Rig::new(identity(boot, cause), Some(&self.memory), BoardMicros(0));
        (self.boot, self.now, self.reset_at) = (self.rig.boot(), 0, None);
        self.events.clear();
        self.answers.clear();
        self.keep_boot();
        self.open_session();
    }

    /// Writes what a board writes before it says anything.
    fn keep_boot(&mut self) {
        while let Some(write) = self.rig.keep_boot() {
            self.write(&write);
        }
    }

    /// Writes to the FRAM, as long as there is power.
    fn write(&mut self, write: &MemoryWrite) {
        let at = usize::from(write.address);
        let written = self.tear.take().map_or(write.bytes.len(), |bytes| bytes.min(write.bytes.len()));
        let written = match &mut self.cut_after {
            None => written,
            Some(left) => {
                let last = written.min(*left);
                *left -= last;
                last
            }
        };
        self.torn |= written < write.bytes.len();
        self.memory[at..at + written].copy_from_slice(&write.bytes[..written]);
    }

    /// Stage A homed and ready.
    pub fn homed() -> Self {
        let mut bench = Self::new(800.0);
        let end = bench.work(&home(Axis::SensorCoarse));
        assert!(matches!(end, EventKind::Homed { .. }), "{end:?}");
        bench
    }

    /// Both stages homed and ready.
    pub fn both_homed() -> Self {
        let mut bench = Self::homed();
        let end = bench.work(&home(Axis::Lens));
        assert!(matches!(end, EventKind::Homed { .. }), "{end:?}");
        bench
    }

    /// The alarm that is latched.
    pub fn alarm(&mut self) -> Option<Alarm> {
        self.status().alarm.map(|record| record.alarm)
    }

    /// Clears the latched alarm.
    pub fn clear(&mut self) {
        let number = self.status().alarm.expect("an alarm is latched").number;
        self.accepted(&Request::ClearAlarm { number });
    }

    pub fn tick(&mut self) -> Outputs {
        let inputs = self.hardware.inputs(BoardMicros(self.now));
        let outputs = self.rig.tick(&inputs);
        self.hardware.run(&outputs, self.now);
        if let Some(write) = &outputs.memory {
            self.write(write);
        }
        if outputs.reset {
            self.reset_at.get_or_insert(self.now);
        }
        self.now += u64::from(TICK_US);
        if !self.deaf {
            self.collect();
        }
        outputs
    }

    /// A calculation takes some ticks; then they are made up for, 5 us apart.
    pub fn catch_up(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.hardware.swing();
        }
        for tick in 0..ticks {
            let now = self.now + (ticks - 1) * u64::from(TICK_US) + 5 * tick;
            let inputs = self.hardware.inputs(BoardMicros(now));
            self.hardware.dac = self.rig.tick(&inputs).piezo_dac.unwrap_or(self.hardware.dac);
        }
        self.now += ticks * u64::from(TICK_US);
    }

    pub fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms * 1_000 / u64::from(TICK_US) {
            self.tick();
        }
    }

    /// Takes the rig's frames.
    pub fn collect(&mut self) {
        while let Some(frame) = self.rig.transmit() {
            for byte in frame {
                match self.decoder.push(byte) {
                    None => {}
                    Some(packet) => {
                        let packet = packet.expect("the rig sends whole frames");
                        self.take(&packet);
                    }
                }
            }
        }
    }

    fn take(&mut self, packet: &Packet) {
        let id = packet.header.id;
        assert_eq!((packet.header.version, packet.header.boot), (PROTOCOL_CURRENT, self.boot));
        match packet.header.kind {
            Kind::Response => self.answers.push((id, Ok(packet.message().expect("a response")))),
            Kind::Error => self.answers.push((id, Err(packet.message().expect("an error")))),
            Kind::Event => self.events.push((id, packet.message().expect("an event"))),
            Kind::Request | Kind::Log => panic!("the rig neither asks nor logs"),
        }
    }

    /// Puts bytes on the line.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.rig.receive(*byte);
            while self.rig.serve(BoardMicros(self.now)) {}
        }
    }

    /// Sends a request under an id, as it is made for `boot`.
    pub fn send_as(&mut self, id: u32, boot: u32, request: &Request) {
        self.send_bytes(&request_frame(id, boot, SESSION, request));
        self.next_id = self.next_id.max(id + 1);
    }

    /// Asks, and gives the id and the answer.
    pub fn ask(&mut self, request: &Request) -> (u32, Answer) {
        let id = self.next_id;
        (id, self.ask_as(id, self.boot, request))
    }

    pub fn ask_as(&mut self, id: u32, boot: u32, request: &Request) -> Answer {
        let before = self.answers.len();
        self.send_as(id, boot, request);
        self.tick();
        let (of, answer) = self.answers.get(before).cloned().expect("an answer within a tick");
        assert_eq!(of, id);
        answer
    }

    /// Asks for something that must be accepted; gives its id.
    pub fn accepted(&mut self, request: &Request) -> u32 {
        let (id, answer) = self.ask(request);
        assert_eq!(answer, Ok(Response::Accepted), "{request:?}");
        id
    }

    pub fn status(&mut self) -> Status {
        match self.ask(&Request::Status).1 {
            Ok(Response::Status(status)) => status,
            other => panic!("no status: {other:?}"),
        }
    }

    pub fn hello(&mut self) -> Hello {
        match self.ask(&Request::Hello).1 {
            Ok(Response::Hello(hello)) => hello,
            other => panic!("no hello: {other:?}"),
        }
    }

    /// Ticks until long work has ended; gives its terminal event.
    pub fn end_of(&mut self, id: u32) -> EventKind {
        for _ in 0..30 * 5_000 {
            if let Some(end) = self.events.iter().map(|(_, event)| &event.kind).find(|kind| ends(kind, id)) {
                return end.clone();
            }
            self.tick();
        }
        panic!("request {id} did not end within 30 s; events: {:?}", self.events);
    }

    /// Asks for long work and waits for its end.
    pub fn work(&mut self, request: &Request) -> EventKind {
        let id = self.accepted(request);
        self.end_of(id)
    }
}

/// The frame of a request.
pub fn request_frame(id: u32, boot: u32, session: u32, request: &Request) -> Encoded {
    let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id, boot };
    frame::encode(header, &Call { session, request: request.clone() }).expect("every request fits")
}

/// Who the bench's board is.
pub fn identity(boot: u32, reset_cause: ResetCause) -> Identity {
    Identity {
        board: "bench",
        firmware: "0.1.0",
        unique_id: [3; 12],
        boot,
        piezo_code: None,
        reset_cause,
        emulated: true,
        own_clock: false,
        last_words: None,
    }
}

/// Whether an event is the terminal event of a request.
pub fn ends(kind: &EventKind, id: u32) -> bool {
    match kind {
        EventKind::Homed { request, .. }
        | EventKind::MoveDone { request, .. }
        | EventKind::ProgramDone { request, .. }
        | EventKind::ContinuousDone { request, .. }
        | EventKind::Calibrated { request, .. }
        | EventKind::Failed { request, .. } => *request == id,
        _ => false,
    }
}

impl Bench {
    /// Reads an event through the link, which is clean here; `None` if it does not exist.
    pub fn rig_event(&mut self, number: u32) -> Option<EventKind> {
        let deaf = std::mem::replace(&mut self.deaf, false);
        let answer = self.ask(&Request::ReadEvent { number }).1;
        self.deaf = deaf;
        match answer {
            Ok(Response::Event(event)) => Some(event.kind),
            _ => None,
        }
    }
}
