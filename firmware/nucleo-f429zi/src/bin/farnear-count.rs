//! # farnear-count
//!
//! Counts the cycles of the on-board routines, one after the other, with interrupts off. It is built like the firmware
//! (same profile, same target) and made for the emulated board, where one instruction takes one cycle; on a real board it
//! counts the flash's wait states too. `farnear-sim count` runs it and reads [`FARNEAR_COUNTS`].
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "the names of two statics, by which the emulated board's side finds them")]

use core::{
    hint::black_box,
    panic::PanicInfo,
    sync::atomic::{AtomicU32, Ordering},
};

use cortex_m::{Peripherals, peripheral::DWT};
use cortex_m_rt::entry;
use farnear_maths::{
    angle::BinaryAngle,
    clsf::{
        Blend, Coefficient, Columns, Frame, Full, FullCoefficients, FullFit, RegionCoefficients, RegionFit,
        Regions,
    },
    shadow::{Deviations, Geometry, Shadow},
    sun::{Place, Sun},
};
use farnear_protocol::{
    BoardMicros, Event, EventKind, Micros, Nanometres, PROTOCOL_CURRENT, Request,
    frame::{Decoder, Header, Kind, encode},
    message::{Axis, ResetCause},
};
use farnear_rig::{
    Identity, Rig,
    io::{
        GAUGE_CODE_ZERO, Inputs, MotorInputs, MotorOutputs, STEP_TIMER_HZ, Segment, StepperState, TICK_HZ,
        TICK_US,
    },
};

/// A routine, and how many of its units a run of it does.
#[repr(C)]
pub struct Routine {
    name: *const u8,
    name_length: u32,
    unit: *const u8,
    unit_length: u32,
    units: u32,
    run: fn() -> u32,
}

// SAFETY: all its pointers are to constants.
unsafe impl Sync for Routine {}

impl Routine {
    const fn new(name: &'static str, unit: &'static str, units: u32, run: fn() -> u32) -> Self {
        let (name_length, unit_length) = (name.len() as u32, unit.len() as u32);
        Self { name: name.as_ptr(), name_length, unit: unit.as_ptr(), unit_length, units, run }
    }
}

#[path = "../clock_tree.rs"]
mod clock_tree;

const ROUTINES: usize = 19;

/// What is counted.
// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
pub static FARNEAR_ROUTINES: [Routine; ROUTINES] = [
    Routine::new("CLSF, ten terms in 3x3 regions", "pixel", PIXELS, || of_rows(Form::Regions, FIRST_ROW)),
    Routine::new("the same with its table (the first row of a region)", "pixel", PIXELS, || {
        of_rows(Form::Regions, 0)
    }),
    Routine::new("CLSF, blended", "pixel", PIXELS, || of_rows(Form::Blend, FIRST_ROW)),
    Routine::new("CLSF, twenty terms", "pixel", PIXELS, || of_rows(Form::Full, FIRST_ROW)),
    Routine::new("fit of the regions, a sample", "pixel", SAMPLES, samples_of_regions),
    Routine::new("fit of the regions, solved", "fit", 1, solve_regions),
    Routine::new("fit of twenty terms, a sample", "pixel", SAMPLES, samples_of_all),
    Routine::new("fit of twenty terms, solved", "fit", 1, solve_all),
    Routine::new("sun: direction, elevation, azimuth", "call", 1, sun),
    Routine::new("sun and shadow angle", "call", 1, sun_and_shadow),
    Routine::new("sun, shadow angle and its standard deviation", "call", 1, sun_shadow_deviation),
    Routine::new("an event encoded as a frame", "frame", 1, frame_encoded),
    Routine::new("a frame received and decoded", "byte", 1, frame_received),
    Routine::new("control tick, all at rest", "tick", 1, tick_at_rest),
    Routine::new("control tick, piezo loop closed, the longest", "tick", 1, || longest_tick(&[Work::Fine])),
    Routine::new("control tick, a stepper at 40 kHz, the longest", "tick", 1, || {
        longest_tick(&[Work::Coarse])
    }),
    Routine::new("control tick, both steppers at 40 kHz and the piezo, the longest", "tick", 1, || {
        longest_tick(&[Work::Coarse, Work::Lens, Work::Fine])
    }),
    Routine::new("a move request carried out, its last byte", "request", 1, move_request),
    Routine::new("start of the rig from its memory", "start", 1, start),
];

/// Cycles of each, for all its units; written as each ends, so the last is not 0 when all are done.
// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
pub static FARNEAR_COUNTS: [AtomicU32; ROUTINES] = [const { AtomicU32::new(0) }; ROUTINES];

/// A row of the camera.
const WIDTH: usize = 640;
const HEIGHT: u16 = 480;
const PIXELS: u32 = WIDTH as u32;
/// A row in the middle of a region, so that tables are made already.
const FIRST_ROW: u16 = 100;
/// Pixels of a fit's row.
const SAMPLES: u32 = 80;

#[entry]
fn main() -> ! {
    // At the firmware's clock: the emulated core's instructions come at that rate, whatever the clock.
    let _peripherals = embassy_stm32::init(clock_tree::config());
    if let Some(mut core) = Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
    cortex_m::interrupt::disable();
    for (routine, count) in FARNEAR_ROUTINES.iter().zip(&FARNEAR_COUNTS) {
        // 0 means "not yet".
        count.store((routine.run)().max(1), Ordering::Relaxed);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// Cycles that `work` takes, less what counting takes.
#[inline(never)]
fn cycles<T>(mut work: impl FnMut() -> T) -> u32 {
    let begin = DWT::cycle_count();
    let nothing = DWT::cycle_count().wrapping_sub(begin);
    let begin = DWT::cycle_count();
    black_box(work());
    DWT::cycle_count().wrapping_sub(begin).saturating_sub(nothing)
}

/// A small generator of repeatable numbers (Marsaglia, xorshift, 2003).
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// A depth code well inside the scale.
    fn code(&mut self) -> i16 {
        (self.next() >> 16) as i16 / 2
    }

    /// A small coefficient, as a correction has.
    fn coefficient(&mut self) -> Coefficient {
        Coefficient::from_bits(self.next() as i32 >> 8).unwrap_or_default()
    }
}

fn frame() -> Frame {
    match Frame::new(WIDTH as u16, HEIGHT) {
        Ok(frame) => frame,
        Err(_) => fail(),
    }
}

fn fail() -> ! {
    // The counts stay 0, and whoever waits for them says so.
    loop {
        cortex_m::asm::wfi();
    }
}

fn region_coefficients() -> RegionCoefficients {
    let mut numbers = Numbers(7);
    let mut all = RegionCoefficients::default();
    all.as_flattened_mut().as_flattened_mut().fill_with(|| numbers.coefficient());
    all
}

fn full_coefficients() -> FullCoefficients {
    let mut numbers = Numbers(9);
    let mut all = FullCoefficients::default();
    all.fill_with(|| numbers.coefficient());
    all
}

enum Form {
    Regions,
    Blend,
    Full,
}

/// Two rows; counts the second.
fn of_rows(form: Form, first: u16) -> u32 {
    let mut numbers = Numbers(1);
    let mut row: [i16; WIDTH] = core::array::from_fn(|_| numbers.code());
    let mut table = [0; 3 * WIDTH];
    let second = if first == 0 { HEIGHT / 2 } else { first + 1 };
    let table = black_box(&mut table[..]);
    match form {
        Form::Regions => {
            let Ok(mut form) = Regions::new(region_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
        Form::Blend => {
            let Ok(mut form) = Blend::new(region_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
        Form::Full => {
            let Ok(mut form) = Full::new(full_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
    }
}

/// Rows of flat targets at six depths, with a little noise, all over the frame.
fn targets(mut add: impl FnMut(u16, Columns, &[i16], i16)) {
    let mut numbers = Numbers(3);
    for depth in 0..6 {
        let truth = depth * 8_000 - 20_000;
        for row in (0..HEIGHT).step_by(16) {
            let codes: [i16; SAMPLES as usize] = core::array::from_fn(|_| truth + numbers.code() / 64);
            add(row, Columns { first: 0, step: 8 }, &codes, truth);
        }
    }
}

fn sample_row() -> [i16; SAMPLES as usize] {
    let mut numbers = Numbers(5);
    core::array::from_fn(|_| numbers.code())
}

fn samples_of_regions() -> u32 {
    let mut fit = RegionFit::new(frame());
    let row = sample_row();
    cycles(|| fit.add_row(FIRST_ROW, Columns { first: 0, step: 8 }, black_box(&row), 100))
}

fn solve_regions() -> u32 {
    let mut fit = RegionFit::new(frame());
    targets(|row, columns, codes, truth| {
        let _ = fit.add_row(row, columns, codes, truth);
    });
    if fit.solve().is_err() {
        fail();
    }
    cycles(|| fit.solve())
}

fn samples_of_all() -> u32 {
    let mut fit = FullFit::new(frame());
    let row = sample_row();
    cycles(|| fit.add_row(FIRST_ROW, Columns { first: 0, step: 8 }, black_box(&row), 100))
}

fn solve_all() -> u32 {
    let mut fit = FullFit::new(frame());
    targets(|row, columns, codes, truth| {
        let _ = fit.add_row(row, columns, codes, truth);
    });
    if fit.solve().is_err() {
        fail();
    }
    cycles(|| fit.solve())
}

/// A summer afternoon in Coventry.
const MOMENT: i64 = 1_403_794_800;

fn place() -> Place {
    Place { latitude: BinaryAngle::from_degrees(52.4), longitude: BinaryAngle::from_degrees(-1.56) }
}

fn geometry() -> Geometry {
    Geometry {
        azimuth: BinaryAngle::from_degrees(20.0),
        camera_height_m: 1.5,
        distance_m: 8.0,
        lateral_m: 0.3,
        height_m: 1.75,
    }
}

fn sun() -> u32 {
    let (moment, place) = (black_box(MOMENT), black_box(place()));
    cycles(|| {
        let sun = Sun::at(moment, &place);
        (sun.elevation_deg(), sun.azimuth_deg())
    })
}

fn sun_and_shadow() -> u32 {
    let (moment, place, geometry) = (black_box(MOMENT), black_box(place()), black_box(geometry()));
    cycles(|| Shadow::at(moment, &place, &geometry))
}

fn sun_shadow_deviation() -> u32 {
    let (moment, place, geometry) = (black_box(MOMENT), black_box(place()), black_box(geometry()));
    let given = black_box(Deviations {
        day: 0.0,
        time_h: 0.01,
        latitude_deg: 0.01,
        longitude_deg: 0.01,
        azimuth_deg: 1.0,
        camera_height_m: 0.02,
        height_m: 0.05,
        distance_m: 0.1,
    });
    cycles(|| {
        let Ok(shadow) = Shadow::at(moment, &place, &geometry) else { fail() };
        (shadow, shadow.deviation(moment, &place, &geometry, &given))
    })
}

fn event() -> Event {
    let (axis, asked) = (Axis::SensorFine, Nanometres(156_270));
    let kind = EventKind::MoveDone { request: 7, axis, asked, measured: Nanometres(156_268) };
    Event { time: BoardMicros(123_456_789), kind }
}

const HEADER: Header = Header { version: PROTOCOL_CURRENT, kind: Kind::Event, id: 12, boot: 3 };

fn frame_encoded() -> u32 {
    let event = black_box(event());
    cycles(|| encode(HEADER, &event))
}

/// Per byte: the whole of it divided by its length.
fn frame_received() -> u32 {
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
        reset_cause: ResetCause::PowerOn,
        emulated: true,
        last_words: None,
    }
}

fn inputs(now: u64) -> Inputs {
    let stepper = StepperState { pulses: 0, idle: true, underrun: false, room: 8 };
    let motor = MotorInputs {
        encoder_counts: 0,
        home_switch: false,
        far_switch: false,
        driver_fault: false,
        stepper,
    };
    Inputs {
        now: BoardMicros(now),
        coarse: motor,
        lens: motor,
        gauge_code: Some(GAUGE_CODE_ZERO),
        emergency_stop: false,
        supply_low: false,
        link_overflow: false,
        exposure: None,
        strobe: None,
    }
}

fn tick_at_rest() -> u32 {
    let mut rig = Rig::new(identity(), None, BoardMicros(0));
    let mut now = 0;
    for _ in 0..100 {
        now += u64::from(TICK_US);
        black_box(rig.tick(&inputs(now)));
        while rig.transmit().is_some() {}
    }
    let inputs = black_box(inputs(now + u64::from(TICK_US)));
    cycles(|| rig.tick(&inputs))
}

/// What moves.
#[derive(Clone, Copy, PartialEq)]
enum Work {
    Coarse,
    Lens,
    Fine,
}

/// A motor that is where its pulses take it, with its home switch at 0.
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
        let stepper =
            StepperState { pulses: self.pulses, idle: self.queue.is_empty(), underrun: false, room };
        MotorInputs {
            encoder_counts: self.position * 5 / 4,
            home_switch: self.position <= 0,
            far_switch: false,
            driver_fault: false,
            stepper,
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

/// A rig with hardware that does what it is told.
struct Bench {
    rig: Rig,
    now: u64,
    id: u32,
    coarse: Motor,
    lens: Motor,
    piezo: u32,
    longest: u32,
}

impl Bench {
    fn new() -> Self {
        let rig = Rig::new(identity(), None, BoardMicros(0));
        Self { rig, now: 0, id: 0, coarse: Motor::new(), lens: Motor::new(), piezo: 0, longest: 0 }
    }

    fn tick(&mut self) {
        self.now += u64::from(TICK_US);
        let mut inputs = inputs(self.now);
        (inputs.coarse, inputs.lens) = (self.coarse.inputs(), self.lens.inputs());
        inputs.gauge_code = Some(GAUGE_CODE_ZERO + self.piezo);
        let inputs = black_box(inputs);
        let mut outputs = None;
        let rig = &mut self.rig;
        let count = cycles(|| outputs = Some(rig.tick(&inputs)));
        self.longest = self.longest.max(count);
        let Some(outputs) = outputs else { fail() };
        self.coarse.run(&outputs.coarse);
        self.lens.run(&outputs.lens);
        self.piezo = u32::from(outputs.piezo_dac) * 3_052 / 1_000;
        while self.rig.transmit().is_some() {}
    }

    /// Sends a request; gives the cycles of its last byte.
    fn ask(&mut self, request: &Request) -> u32 {
        self.id += 1;
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: self.id, boot: 1 };
        let Some(bytes) = encode(header, request) else { fail() };
        let now = BoardMicros(self.now);
        let mut last = 0;
        for byte in bytes {
            let rig = &mut self.rig;
            last = cycles(|| rig.receive(byte, now));
        }
        last
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

/// The longest tick of half a second of moves, which take all phases of the ramps.
fn longest_tick(works: &[Work]) -> u32 {
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

fn move_request() -> u32 {
    let mut bench = Bench::new();
    bench.home(Axis::SensorCoarse);
    bench.ask(&go(Axis::SensorCoarse, 3_000_000))
}

fn start() -> u32 {
    static BLANK: [u8; farnear_rig::io::MEMORY_BYTES] = [0; farnear_rig::io::MEMORY_BYTES];
    let identity = black_box(identity());
    cycles(|| Rig::new(identity, Some(&BLANK), BoardMicros(0)))
}

/// Nobody reads a log here, but embassy writes one.
#[defmt::global_logger]
struct Silence;

// SAFETY: it does nothing.
unsafe impl defmt::Logger for Silence {
    fn acquire() {}
    unsafe fn flush() {}
    unsafe fn release() {}
    unsafe fn write(_: &[u8]) {}
}

defmt::timestamp!("{=u32}", DWT::cycle_count());

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    fail()
}
