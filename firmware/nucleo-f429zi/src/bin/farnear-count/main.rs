//! # farnear-count
//! Counts the cycles of on-board routines with interrupts off. Built like the firmware for the emulated board, where an
//! instruction takes one cycle(a real board has wait states). `farnear-sim count` runs it and reads [`FARNEAR_COUNTS`].
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

use self::maths::{FIRST_ROW, Form, PIXELS, SAMPLES};
use self::rig::Work;

mod maths;
mod rig;

/// A routine, and its units per run.
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

#[path = "../../clock_tree.rs"]
mod clock_tree;

const ROUTINES: usize = 21;

// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
pub static FARNEAR_ROUTINES: [Routine; ROUTINES] = [
    Routine::new("CLSF, ten terms in 3x3 regions", "pixel", PIXELS, || {
        maths::of_rows(Form::Regions, FIRST_ROW)
    }),
    Routine::new("the same with its table (the first row of a region)", "pixel", PIXELS, || {
        maths::of_rows(Form::Regions, 0)
    }),
    Routine::new("CLSF, blended", "pixel", PIXELS, || maths::of_rows(Form::Blend, FIRST_ROW)),
    Routine::new("CLSF, twenty terms", "pixel", PIXELS, || maths::of_rows(Form::Full, FIRST_ROW)),
    Routine::new("fit of the regions, a sample", "pixel", SAMPLES, maths::samples_of_regions),
    Routine::new("fit of the regions, solved", "fit", 1, maths::solve_regions),
    Routine::new("fit of twenty terms, a sample", "pixel", SAMPLES, maths::samples_of_all),
    Routine::new("fit of twenty terms, solved", "fit", 1, maths::solve_all),
    Routine::new("sun: direction, elevation, azimuth", "call", 1, maths::sun),
    Routine::new("sun and shadow angle", "call", 1, maths::sun_and_shadow),
    Routine::new("sun, shadow angle and its standard deviation", "call", 1, maths::sun_shadow_deviation),
    Routine::new("an event encoded as a frame", "frame", 1, rig::frame_encoded),
    Routine::new("a frame received and decoded", "byte", 1, rig::frame_received),
    Routine::new("control tick, all at rest", "tick", 1, rig::tick_at_rest),
    Routine::new("control tick, piezo loop closed, the longest", "tick", 1, || {
        rig::longest_tick(&[Work::Fine])
    }),
    Routine::new("control tick, a stepper at 40 kHz, the longest", "tick", 1, || {
        rig::longest_tick(&[Work::Coarse])
    }),
    Routine::new("control tick, both steppers at 40 kHz and the piezo, the longest", "tick", 1, || {
        rig::longest_tick(&[Work::Coarse, Work::Lens, Work::Fine])
    }),
    Routine::new("a move request, its last byte", "request", 1, || rig::move_request(0)),
    Routine::new("a move request carried out", "request", 1, || rig::move_request(1)),
    Routine::new("a move request's answer as a frame", "request", 1, || rig::move_request(2)),
    Routine::new("start of the rig from its memory", "start", 1, rig::start),
];

/// Cycles of each routine for all units, written as each ends: a non-zero last entry means that all are done.
// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
pub static FARNEAR_COUNTS: [AtomicU32; ROUTINES] = [const { AtomicU32::new(0) }; ROUTINES];

#[entry]
fn main() -> ! {
    // The firmware's clock; emulated instructions run at that rate in any case.
    let _peripherals = embassy_stm32::init(clock_tree::config(false));
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

/// Cycles of `work` without the counting overhead.
#[inline(never)]
fn cycles<T>(mut work: impl FnMut() -> T) -> u32 {
    let begin = DWT::cycle_count();
    let nothing = DWT::cycle_count().wrapping_sub(begin);
    let begin = DWT::cycle_count();
    black_box(work());
    DWT::cycle_count().wrapping_sub(begin).saturating_sub(nothing)
}

fn fail() -> ! {
    // The counts stay 0, which the reader reports.
    loop {
        cortex_m::asm::wfi();
    }
}

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
