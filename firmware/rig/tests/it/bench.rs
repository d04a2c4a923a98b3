//! A rig on the bench: behaviour, host, and simple hardware (resonant piezo without hysteresis, screw with play).

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

pub const BOOT: u32 = 7;

pub const SESSION: u32 = 0x5e55_1001;

/// Longer than any of the bench's work.
pub const SILENCE: Micros = Micros(60_000_000);

pub fn go(axis: Axis, nm: i32) -> Request {
    Request::Move { axis, target: Nanometres(nm), silence: SILENCE }
}

pub fn home(axis: Axis) -> Request {
    Request::Home { axis, silence: SILENCE }
}

pub fn failure(end: &EventKind) -> Failure {
    match end {
        EventKind::Failed { reason, .. } => *reason,
        other => panic!("did not fail: {other:?}"),
    }
}

pub type Answer = Result<Response, RequestError>;

/// After a start the piezo waits so long for the end of a swing.
pub const AFTER_START_MS: u64 = 200;

pub struct Bench {
    pub rig: Rig,
    pub hardware: Hardware,
    pub memory: Box<[u8; MEMORY_BYTES]>,
    boot: u32,
    /// The next write to the FRAM ends after this many bytes; whether one has.
    pub tear: Option<usize>,
    pub torn: bool,
    /// Power fails when this many more bytes have been written to the FRAM.
    pub cut_after: Option<usize>,
    pub now: u64,
    pub next_id: u32,
    decoder: Decoder,
    pub answers: Vec<(u32, Answer)>,
    pub events: Vec<(u32, Event)>,
    pub reset_at: Option<u64>,
    /// Leave frames in the rig.
    pub deaf: bool,
}

impl Bench {
    /// Stage A at `position_um` from its home switch, with a blank memory.
    pub fn new(position_um: f64) -> Self {
        Self::with_memory(position_um, Box::new([0; MEMORY_BYTES]))
    }

    /// As [`Self::new`] with memory contents.
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

    /// Power cycle: `boot` is the number in retained RAM, 1 if lost.
    pub fn restart(&mut self, boot: u32, cause: ResetCause) {
        self.hardware.power_off();
        self.begin(identity(boot, cause));
    }

    /// Reset over which the piezo's DAC keeps its code; `piezo_code` is that in retained RAM.
    pub fn reset(&mut self, piezo_code: Option<u16>) {
        let dac = self.hardware.dac;
        self.hardware.power_off();
        self.hardware.dac = dac;
        self.begin(Identity { piezo_code, ..identity(self.boot + 1, ResetCause::Software) });
    }

    fn begin(&mut self, identity: Identity) {
        self.rig = Rig::new(identity, Some(&self.memory), BoardMicros(0));
        (self.boot, self.now, self.reset_at) = (self.rig.boot(), 0, None);
        self.events.clear();
        self.answers.clear();
        self.keep_boot();
        self.open_session();
    }

    fn keep_boot(&mut self) {
        while let Some(write) = self.rig.keep_boot() {
            self.write(&write);
        }
    }

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

    pub fn homed() -> Self {
        let mut bench = Self::new(800.0);
        let end = bench.work(&home(Axis::SensorCoarse));
        assert!(matches!(end, EventKind::Homed { .. }), "{end:?}");
        bench
    }

    pub fn both_homed() -> Self {
        let mut bench = Self::homed();
        let end = bench.work(&home(Axis::Lens));
        assert!(matches!(end, EventKind::Homed { .. }), "{end:?}");
        bench
    }

    pub fn alarm(&mut self) -> Option<Alarm> {
        self.status().alarm.map(|record| record.alarm)
    }

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

    /// Ticks delayed by a calculation follow 5 us apart.
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

    pub fn send_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.rig.receive(*byte);
            while self.rig.serve(BoardMicros(self.now)) {}
        }
    }

    /// `boot` is the request's boot number.
    pub fn send_as(&mut self, id: u32, boot: u32, request: &Request) {
        self.send_bytes(&request_frame(id, boot, SESSION, request));
        self.next_id = self.next_id.max(id + 1);
    }

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

    /// Ticks until long work has ended; returns its terminal event.
    pub fn end_of(&mut self, id: u32) -> EventKind {
        for _ in 0..30 * 5_000 {
            if let Some(end) = self.events.iter().map(|(_, event)| &event.kind).find(|kind| ends(kind, id)) {
                return end.clone();
            }
            self.tick();
        }
        panic!("request {id} did not end within 30 s; events: {:?}", self.events);
    }

    /// Requests long work and waits for its end.
    pub fn work(&mut self, request: &Request) -> EventKind {
        let id = self.accepted(request);
        self.end_of(id)
    }
}

pub fn request_frame(id: u32, boot: u32, session: u32, request: &Request) -> Encoded {
    let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id, boot };
    frame::encode(header, &Call { session, request: request.clone() }).expect("every request fits")
}

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
