//! A protocol host for the rig in this process.

use farnear_protocol::{
    Call, Event, EventKind, Log, Micros, Nanometres, PROTOCOL_CURRENT, Request, RequestError, Response,
    frame::{Header, Kind, Packet, encode},
    message::{Alarm, AlarmRecord, Axis, Hello, NO_SESSION, Shot, Status, TriggerMode},
};
use farnear_sim::{EmulatedRig, Report, RigAccess, RigConfig, Scenario};
use object::{Object, ObjectSymbol, Symbol, SymbolKind};

/// Longer than any test's pause, unless the test is about silence.
pub const SILENCE: Micros = Micros(60_000_000);

pub const SESSION: u32 = 0x1234_5678;

pub struct Bench {
    pub rig: EmulatedRig,
    pub boot: u32,
    next: u32,
    pub events: Vec<Event>,
    pub log: Vec<u8>,
}

pub type Answer = Result<Response, RequestError>;

pub fn request_frame(id: u32, boot: u32, request: &Request) -> Vec<u8> {
    let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id, boot };
    let session = if *request == Request::Hello { NO_SESSION } else { SESSION };
    encode(header, &Call { session, request: request.clone() }).expect("requests fit").to_vec()
}

pub fn answer_in(packet: &Packet) -> Option<(u32, Answer)> {
    let answer = match packet.header.kind {
        Kind::Response => Ok(packet.message().expect("a response of this version")),
        Kind::Error => Err(packet.message().expect("an error of this version")),
        _ => return None,
    };
    Some((packet.header.id, answer))
}

impl Bench {
    /// A rig that has answered hello.
    pub fn new(seed: u64) -> Self {
        Self::with(&RigConfig { seed, ..RigConfig::default() })
    }

    /// As [`Bench::new`] with both stages near their home switches: homing takes less time.
    pub fn near_home(seed: u64) -> Self {
        Self::with(&RigConfig { seed, scenario: start_near_home(), ..RigConfig::default() })
    }

    pub fn with(config: &RigConfig) -> Self {
        let rig = EmulatedRig::new(config).unwrap_or_else(|error| panic!("{error}"));
        let mut bench = Self { rig, boot: 0, next: 0, events: Vec::new(), log: Vec::new() };
        bench.say_hello();
        bench
    }

    /// Sends hello and opens a session; later requests carry the board's boot number.
    pub fn say_hello(&mut self) -> Hello {
        self.boot = 0;
        match self.ask(&Request::Hello) {
            Ok(Response::Hello(hello)) => {
                self.boot = hello.boot;
                self.next = self.next.max(hello.last_id);
                assert_eq!(self.ask(&Request::OpenSession), Ok(Response::Accepted));
                hello
            }
            other => panic!("expected Hello, got {other:?}"),
        }
    }

    /// Skips ids that a test used directly.
    pub fn skip_to(&mut self, id: u32) {
        self.next = self.next.max(id);
    }

    pub fn send(&mut self, request: &Request) -> u32 {
        self.next += 1;
        let id = self.next;
        self.put(id, request);
        id
    }

    fn put(&mut self, id: u32, request: &Request) {
        let frame = request_frame(id, self.boot, request);
        self.rig.send(&[&[0], frame.as_slice()].concat()).expect("the rig runs");
    }

    /// Received answers; events go to [`Bench::events`].
    pub fn answers(&mut self) -> Vec<(u32, Answer)> {
        let mut answers = Vec::new();
        for packet in self.rig.take_frames() {
            match answer_in(&packet) {
                Some(answer) => answers.push(answer),
                None if packet.header.kind == Kind::Log => {
                    self.log.extend(packet.message::<Log>().expect("a log frame of this version").bytes);
                }
                None => self.events.push(packet.message().expect("an event of this version")),
            }
        }
        answers
    }

    /// Waits for the answer with up to three repeats. Hosts wait 50 ms; the board answers within 2 ms.
    pub fn try_ask(&mut self, request: &Request) -> Option<Answer> {
        let id = self.send(request);
        for attempt in 0..4 {
            if attempt > 0 {
                self.put(id, request);
            }
            for _ in 0..50 {
                self.rig.advance_us(200).expect("the rig runs");
                if let Some((_, answer)) = self.answers().into_iter().find(|(answered, _)| *answered == id) {
                    return Some(answer);
                }
            }
        }
        None
    }

    /// [`Bench::try_ask`] that panics without an answer.
    pub fn ask(&mut self, request: &Request) -> Answer {
        self.try_ask(request).unwrap_or_else(|| panic!("no answer to {request:?}"))
    }

    /// Returns the terminal event of long work.
    pub fn carry_out(&mut self, request: &Request) -> EventKind {
        assert_eq!(self.ask(request), Ok(Response::Accepted), "{request:?}");
        self.settle()
    }

    /// Runs until idle; returns the last event.
    pub fn settle(&mut self) -> EventKind {
        self.rig.settle().expect("the rig runs");
        self.answers();
        self.events.last().expect("a terminal event").kind.clone()
    }

    pub fn home_axis(&mut self, axis: Axis) {
        let end = self.carry_out(&Request::Home { axis, silence: SILENCE });
        assert!(matches!(end, EventKind::Homed { .. }), "{end:?}");
    }

    /// Homes both stages at once.
    pub fn home(&mut self) {
        let before = self.events.len();
        for axis in [Axis::SensorCoarse, Axis::Lens] {
            assert_eq!(self.ask(&Request::Home { axis, silence: SILENCE }), Ok(Response::Accepted));
        }
        self.settle();
        let events = &self.events[before..];
        let homed = events.iter().filter(|event| matches!(event.kind, EventKind::Homed { .. }));
        assert_eq!(homed.count(), 2, "{events:?}");
    }

    pub fn move_to(&mut self, axis: Axis, target: Nanometres) -> EventKind {
        self.carry_out(&go(axis, target.0))
    }

    pub fn access(&mut self, work: impl FnOnce(&mut RigAccess<'_, '_>) + Send + 'static) {
        self.rig.access(work).expect("the rig runs");
    }

    pub fn peek<T: Send + 'static>(
        &mut self,
        look: impl FnOnce(&mut RigAccess<'_, '_>) -> T + Send + 'static,
    ) -> T {
        let (send, receive) = std::sync::mpsc::channel();
        self.access(move |rig| send.send(look(rig)).expect("the receiver waits"));
        receive.recv().expect("the rig runs")
    }

    /// Address and length of a firmware variable, by a part of its name.
    pub fn variable(&mut self, part: &str) -> (u64, u64) {
        let found = symbols(|symbol| {
            let named =
                symbol.kind() == SymbolKind::Data && symbol.name().is_ok_and(|name| name.contains(part));
            named && symbol.address() >= 0x2000_0000
        });
        *found.first().unwrap_or_else(|| panic!("the firmware has no {part}"))
    }

    /// Longest control tick since reset, cycles.
    pub fn longest_tick(&mut self) -> u32 {
        let (at, _) = self.variable("FARNEAR_LONGEST_TICK_CYCLES");
        self.peek(move |rig| rig.read_word(at)).expect("RAM")
    }

    pub fn forget_longest_tick(&mut self) {
        let (at, _) = self.variable("FARNEAR_LONGEST_TICK_CYCLES");
        self.access(move |rig| rig.write_word(at, 0));
    }

    pub fn alarm(&mut self) -> Option<AlarmRecord> {
        self.status().alarm
    }

    pub fn clear(&mut self, expected: impl FnOnce(&Alarm) -> bool) {
        let latched = self.alarm().expect("an alarm is latched");
        assert!(expected(&latched.alarm), "{latched:?}");
        let cleared = self.ask(&Request::ClearAlarm { number: latched.number });
        assert_eq!(cleared, Ok(Response::Accepted), "{latched:?}");
        assert_eq!(self.alarm(), None);
    }

    pub fn arm(&mut self, shots: &[Shot]) {
        for (index, shot) in (0..).zip(shots) {
            assert_eq!(self.ask(&Request::LoadShot { index, shot: *shot }), Ok(Response::Accepted));
        }
        let shots = u8::try_from(shots.len()).expect("a program's length");
        assert_eq!(self.ask(&Request::ArmProgram { shots }), Ok(Response::Accepted));
    }

    /// Runs the armed program; returns its last event.
    pub fn run(&mut self) -> EventKind {
        self.carry_out(&Request::RunProgram { silence: SILENCE })
    }

    pub fn status(&mut self) -> Status {
        match self.ask(&Request::Status) {
            Ok(Response::Status(status)) => status,
            other => panic!("expected Status, got {other:?}"),
        }
    }

    pub fn report(&mut self) -> Report {
        self.rig.report().expect("the rig runs")
    }
}

pub fn start_near_home() -> Scenario {
    Scenario::parse(include_str!("near-home.toml")).expect("a good file")
}

pub fn go(axis: Axis, target_nm: i32) -> Request {
    Request::Move { axis, target: Nanometres(target_nm), silence: SILENCE }
}

pub fn fine_shot(target_nm: i32, exposure_us: u32, window_nm: i32, dwell_us: u32) -> Shot {
    Shot {
        axis: Axis::SensorFine,
        target: Nanometres(target_nm),
        exposure: Micros(exposure_us),
        settle_window: Nanometres(window_nm),
        settle_dwell: Micros(dwell_us),
        repeat: 1,
        mode: TriggerMode::Hardware,
    }
}

pub fn amount<T: std::str::FromStr>(variable: &str, else_this: T) -> T {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(else_this)
}

pub fn symbols(wanted: impl Fn(&Symbol<'_, '_>) -> bool) -> Vec<(u64, u64)> {
    let elf = farnear_sim::firmware::find(None).expect("a firmware");
    let bytes = std::fs::read(elf).expect("readable");
    let elf = object::File::parse(&*bytes).expect("an ELF");
    let found = elf.symbols().filter(|symbol| wanted(symbol));
    found.map(|symbol| (symbol.address(), symbol.size())).collect()
}
