//! Link frames and the rig's control tick.

use core::hint::black_box;

use farnear_protocol::{
    BoardMicros, Call, Event, EventKind, Micros, Nanometres, PROTOCOL_CURRENT, Request,
    frame::{Decoder, Header, Kind, encode},
    message::{Axis, ResetCause},
};
use farnear_rig::{
    Identity, Rig,
    io::{
        GAUGE_CODE_ZERO, Inputs, MotorInputs, MotorOutputs, STEP_TIMER_HZ, Segment, StepperState, TICK_HZ,
        TICK_US,
    },
    settings::Settings,
};

use crate::{cycles, fail};

fn event() -> Event {
    let (axis, asked) = (Axis::SensorFine, Nanometres(156_270));
    let kind = EventKind::MoveDone { request: 7, axis, asked, measured: Nanometres(156_268) };
    Event { time: BoardMicros(123_456_789), kind }
}

const HEADER: Header = Header { version: PROTOCOL_CURRENT, kind: Kind::Event, id: 12, boot: 3 };

pub fn frame_encoded() -> u32 {
    let event = black_box(event());
    cycles(|| encode(HEADER, &event))
}

/// Per byte: the total divided by the length.
pub fn frame_received() -> u32 {
    let Some(bytes) = encode(HEADER, &event()) else { fail() };
    let mut decoder = Decoder::new();
    let all = cycles(|| {
        bytes
            .iter()
            .filter_map(|byte| decoder.push(*byte)?.ok())
            .last()
            .and_then(|packet| packet.message::<Event>())
    });
    all / bytes.len() as u32
}

fn identity() -> Identity {
    Identity {
        board: "count",
        firmware: env!("CARGO_PKG_VERSION"),
        unique_id: [0; 12],
        boot: 1,
        piezo_code: None,
        reset_cause: ResetCause::PowerOn,
        emulated: true,
        own_clock: false,
        last_words: None,
    }
}

/// Without memory writes.
const WITHOUT_MEMORY: Settings = Settings { memory: false, ..Settings::DEFAULT };

pub fn tick_at_rest() -> u32 {
    let mut rig = Rig::with_parts(identity(), WITHOUT_MEMORY, None, BoardMicros(0));
    let mut now = 0;
    for _ in 0..100 {
        now += u64::from(TICK_US);
        black_box(rig.tick(&Inputs::idle(BoardMicros(now))));
        while rig.transmit().is_some() {}
    }
    let inputs = black_box(Inputs::idle(BoardMicros(now + u64::from(TICK_US))));
    cycles(|| rig.tick(&inputs))
}

#[derive(Clone, Copy, PartialEq)]
pub enum Work {
    Coarse,
    Lens,
    Fine,
}

/// A motor that follows its pulses, with its home switch at 0.
struct Motor {
    queue: heapless::Deque<Segment, 8>,
    left: u32,
    pulses: u32,
    away: bool,
    position: i32,
}

impl Motor {
    const fn new() -> Self {
        Self { queue: heapless::Deque::new(), left: 0, pulses: 0, away: true, position: 600 }
    }

    fn inputs(&self) -> MotorInputs {
        let room = (8 - self.queue.len()) as u8;
        let (pulses, idle) = (self.pulses, self.queue.is_empty());
        MotorInputs {
            encoder_counts: self.position * 5 / 4,
            home_switch: self.position <= 0,
            stepper: StepperState { pulses, idle, room, ..StepperState::IDLE },
            ..MotorInputs::IDLE
        }
    }

    fn run(&mut self, outputs: &MotorOutputs) {
        self.away = outputs.direction_away;
        if outputs.abort_steps && !self.queue.is_empty() {
            fail();
        }
        for segment in &outputs.segments {
            if self.queue.is_empty() {
                self.left = u32::from(segment.pulses) * u32::from(segment.period_ticks);
            }
            if self.queue.push_back(*segment).is_err() {
                fail();
            }
        }
        let mut time = STEP_TIMER_HZ / TICK_HZ;
        while let Some(segment) = self.queue.front().copied() {
            if time < self.left {
                self.left -= time;
                return;
            }
            time -= self.left;
            let pulses = u32::from(segment.pulses);
            self.pulses = self.pulses.wrapping_add(pulses);
            self.position += if self.away { pulses as i32 } else { -(pulses as i32) };
            let _ = self.queue.pop_front();
            self.left =
                self.queue.front().map_or(0, |next| u32::from(next.pulses) * u32::from(next.period_ticks));
        }
    }
}

/// A piezo with its 200 Hz resonance, damping 0.03; otherwise the rig would open its loop.
#[derive(Default)]
struct Piezo {
    /// Nanometres.
    position: f32,
    speed: f32,
}

impl Piezo {
    fn run(&mut self, code: u16) {
        // A tick of 0.2 ms is 0.2513 rad; the damping factor is 0.9925.
        const COS: f32 = 0.9925 * 0.9686;
        const SIN: f32 = 0.9925 * 0.2487;
        let drive = f32::from(code) * 3.052;
        let off = self.position - drive;
        (self.position, self.speed) = (drive + COS * off + SIN * self.speed, COS * self.speed - SIN * off);
    }
}

struct Bench {
    rig: Rig,
    now: u64,
    id: u32,
    coarse: Motor,
    lens: Motor,
    piezo: Piezo,
    longest: u32,
}

impl Bench {
    fn new() -> Self {
        let rig = Rig::with_parts(identity(), WITHOUT_MEMORY, None, BoardMicros(0));
        let (coarse, lens) = (Motor::new(), Motor::new());
        let mut bench = Self { rig, now: 0, id: 0, coarse, lens, piezo: Piezo::default(), longest: 0 };
        bench.ask(&Request::OpenSession);
        bench
    }

    fn tick(&mut self) {
        self.now += u64::from(TICK_US);
        let inputs = black_box(Inputs {
            coarse: self.coarse.inputs(),
            lens: self.lens.inputs(),
            gauge_code: Some(GAUGE_CODE_ZERO.saturating_add_signed(self.piezo.position as i32)),
            ..Inputs::idle(BoardMicros(self.now))
        });
        let mut outputs = None;
        let rig = &mut self.rig;
        let count = cycles(|| outputs = Some(rig.tick(&inputs)));
        self.longest = self.longest.max(count);
        let Some(outputs) = outputs else { fail() };
        self.coarse.run(&outputs.coarse);
        self.lens.run(&outputs.lens);
        self.piezo.run(outputs.piezo_dac.unwrap_or(0));
        while self.rig.transmit().is_some() {}
    }

    /// Cycles of a request's last byte, its execution, and its answer's frame.
    fn ask(&mut self, request: &Request) -> [u32; 3] {
        self.id += 1;
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: self.id, boot: 1 };
        let Some(bytes) = encode(header, &Call { session: 1, request: request.clone() }) else { fail() };
        let now = BoardMicros(self.now);
        let mut last = 0;
        let rig = &mut self.rig;
        for byte in bytes {
            last = cycles(|| rig.receive(byte));
        }
        [last, cycles(|| rig.serve(now)), cycles(|| rig.serve(now))]
    }

    fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    fn home(&mut self, axis: Axis) {
        self.ask(&Request::Home { axis, silence: SILENCE });
        self.run(4 * TICK_HZ);
    }
}

const SILENCE: Micros = Micros(60_000_000);

fn go(axis: Axis, nm: i32) -> Request {
    Request::Move { axis, target: Nanometres(nm), silence: SILENCE }
}

/// The longest tick of half a second of moves with all ramp phases.
pub fn longest_tick(works: &[Work]) -> u32 {
    let mut bench = Bench::new();
    for work in works {
        match work {
            Work::Coarse => bench.home(Axis::SensorCoarse),
            Work::Lens => bench.home(Axis::Lens),
            Work::Fine => {
                bench.ask(&go(Axis::SensorFine, 20_000));
                bench.run(TICK_HZ / 10);
            }
        }
    }
    for (work, axis, nm) in [
        (Work::Coarse, Axis::SensorCoarse, 3_000_000),
        (Work::Lens, Axis::Lens, 3_000_000),
        (Work::Fine, Axis::SensorFine, 176_270),
    ] {
        if works.contains(&work) {
            bench.ask(&go(axis, nm));
        }
    }
    bench.longest = 0;
    bench.run(TICK_HZ);
    if works.contains(&Work::Coarse) && bench.coarse.position < 10_000 {
        fail(); // it did not move
    }
    bench.longest
}

/// Step of a move request: last byte, execution, or answer's frame.
pub fn move_request(step: usize) -> u32 {
    let mut bench = Bench::new();
    bench.home(Axis::SensorCoarse);
    bench.ask(&go(Axis::SensorCoarse, 3_000_000))[step]
}

pub fn start() -> u32 {
    static BLANK: [u8; farnear_rig::io::MEMORY_BYTES] = [0; farnear_rig::io::MEMORY_BYTES];
    let identity = black_box(identity());
    cycles(|| Rig::new(identity, Some(&BLANK), BoardMicros(0)))
}
