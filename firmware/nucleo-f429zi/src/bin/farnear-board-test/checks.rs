//! One check for each driver.

use cortex_m::peripheral::DWT;
use embassy_stm32::pac::{self, timer::vals};
use embassy_time::{Duration, Instant, block_for};
use farnear_nucleo_f429zi::{board::Nucleo, clock, memory::Memory, option_bytes, stepper::Stepper};
use farnear_protocol::{Micros, message::ResetCause};
use farnear_rig::{
    Identity, Rig,
    control::{Board, Control},
    io::{MEMORY_BYTES, MemoryWrite, MotorOutputs, Segment, TICK_US, Trigger},
};
use heapless::Vec;
use static_cell::StaticCell;

use crate::{Report, Verdict, tell};

/// At 40 kHz, the fastest rate, and 10 pulses each.
const FAST: Segment = Segment { pulses: 10, period_ticks: 1_050, last: false };
/// One millisecond at 10 kHz.
const LONG: Segment = Segment { pulses: 10, period_ticks: 4_200, last: false };
const EXPOSURES_US: [u32; 4] = [50, 333, 5_000, 20_000];
/// 70 % of a tick at 168 MHz.
const TICK_CYCLES: u32 = 33_600 * 7 / 10;
const WORDS: [u16; 4] = [0x0000, 0xffff, 0xa5c3, 0x1234];

pub fn run(board: &mut Nucleo, report: &mut Report, own_clock: bool, emulated: bool) {
    let kind = if emulated { "emulated" } else { "real" };
    tell(report, "board", true, format_args!("{kind}"));
    tell(report, "external clock", !own_clock, format_args!("8 MHz of the ST-LINK at HSE"));
    let level = option_bytes::has_brown_out_reset();
    let verdict = if level { Verdict::Pass } else { Verdict::Skip };
    tell(report, "brown-out reset", verdict, format_args!("level 2 or 3 in the option bytes: {level}"));
    time(report);
    tick(board, report);
    steps(&mut board.coarse.stepper, report);
    emergency_stop(&mut board.coarse.stepper, report);
    exposures(board, report);
    converter(report);
    fram(board.memory.as_mut(), report);
}

/// Core cycles in 10 ms of the time base.
fn time(report: &mut Report) {
    let (begin, cycles) = (Instant::now(), DWT::cycle_count());
    while begin.elapsed() < Duration::from_millis(10) {}
    let cycles = DWT::cycle_count().wrapping_sub(cycles);
    tell(report, "time base", cycles.abs_diff(1_680_000) < 2_000, format_args!("{cycles} cycles in 10 ms"));
}

/// The control loop of a rig at rest, at full rate.
fn tick(board: &mut Nucleo, report: &mut Report) {
    static RIG: StaticCell<Rig> = StaticCell::new();
    let identity = Identity {
        board: "nucleo-f429zi",
        firmware: env!("CARGO_PKG_VERSION"),
        unique_id: embassy_stm32::uid::uid(),
        boot: 1,
        piezo_code: Some(0),
        reset_cause: ResetCause::PowerOn,
        own_clock: false,
        emulated: false,
        last_words: None,
    };
    let rig = RIG.init_with(|| Rig::new(identity, None, clock::now()));
    let mut control = Control::new(rig);
    let mut longest = 0;
    for _ in 0..500 {
        let (begin, cycles) = (Instant::now(), DWT::cycle_count());
        control.tick(board);
        longest = longest.max(DWT::cycle_count().wrapping_sub(cycles));
        while begin.elapsed() < Duration::from_micros(u64::from(TICK_US)) {}
    }
    tell(
        report,
        "control tick",
        longest < TICK_CYCLES,
        format_args!("{longest} cycles, allowed {TICK_CYCLES}"),
    );
}

/// STEP (PE9) at TIM4's first channel (PD12), which counts its rising edges.
fn count_edges() {
    let timer = pac::TIM4;
    timer.cr1().modify(|w| w.set_cen(false));
    timer.smcr().write(|w| w.0 = 0);
    timer.ccer().write(|w| w.0 = 0);
    timer.ccmr_input(0).write(|w| w.set_ccs(0, vals::CcmrInputCcs::TI4));
    timer.smcr().write(|w| {
        w.set_ts(vals::Ts::TI1FP1);
        w.set_sms(vals::Sms::EXT_CLOCK_MODE);
    });
    timer.cnt().write(|w| w.set_cnt(0));
    timer.cr1().modify(|w| w.set_cen(true));
}

fn edges() -> u16 {
    pac::TIM4.cnt().read().cnt()
}

fn play<T: farnear_nucleo_f429zi::stepper::StepInstance>(
    stepper: &mut Stepper<T>,
    segments: &[Segment],
    enable: bool,
) {
    let segments = Vec::from_slice(segments).unwrap_or_default();
    stepper.apply(&MotorOutputs { enable, segments, ..MotorOutputs::default() });
}

fn steps<T: farnear_nucleo_f429zi::stepper::StepInstance>(stepper: &mut Stepper<T>, report: &mut Report) {
    // EN (PF14) closes the circuit of the break input (PE15).
    play(stepper, &[], true);
    block_for(Duration::from_millis(2));
    let _ = stepper.emergency_stop();
    stepper.apply(&MotorOutputs { enable: true, abort_steps: true, ..MotorOutputs::default() });
    count_edges();
    let before = stepper.state().pulses;
    let begin = DWT::cycle_count();
    play(stepper, &[FAST, FAST, LONG, Segment { last: true, ..FAST }], true);
    while !stepper.state().idle && DWT::cycle_count().wrapping_sub(begin) < 1_680_000 {}
    let us = DWT::cycle_count().wrapping_sub(begin) / 168;
    let counted = stepper.state().pulses.wrapping_sub(before);
    // 30 pulses of 25 us and 10 of 100 us.
    let passed = edges() == 40 && counted == 40 && us.abs_diff(1_750) < 20;
    tell(
        report,
        "steps",
        passed,
        format_args!("{} edges at PD12 of 40, {counted} counted, {us} us of 1750", edges()),
    );
}

fn emergency_stop<T: farnear_nucleo_f429zi::stepper::StepInstance>(
    stepper: &mut Stepper<T>,
    report: &mut Report,
) {
    count_edges();
    play(stepper, &[LONG, LONG, LONG, Segment { last: true, ..LONG }], true);
    block_for(Duration::from_micros(1_550));
    play(stepper, &[], false);
    block_for(Duration::from_micros(20));
    let at_the_stop = edges();
    block_for(Duration::from_millis(5));
    let (after, told) = (edges(), stepper.emergency_stop());
    let passed = told && at_the_stop == after && (14..=17).contains(&after);
    tell(
        report,
        "emergency stop",
        passed,
        format_args!("{after} of 40 steps, {at_the_stop} at the stop; told: {told}"),
    );
}

/// Trigger (PB10) at the strobe input (PB11).
fn exposures(board: &mut Nucleo, report: &mut Report) {
    let (mut worst_us, mut missed) = (0, 0);
    for length in EXPOSURES_US {
        board.expose(Trigger { at: clock::now(), length: Micros(length), flash: None });
        block_for(Duration::from_micros(u64::from(length) + 200));
        let Some(edges) = board.exposure(clock::now()) else {
            missed += 1;
            continue;
        };
        let strobe = edges.strobe_end.0.wrapping_sub(edges.strobe_start.0);
        let late = edges.strobe_start.0.wrapping_sub(edges.trigger.0);
        worst_us = worst_us.max(strobe.abs_diff(u64::from(length))).max(late);
    }
    let passed = missed == 0 && worst_us <= 1;
    tell(report, "exposures", passed, format_args!("{missed} of 4 missed, stamps off by {worst_us} us"));
}

/// Data out (PC12) at data in (PC11).
fn converter(report: &mut Report) {
    let mut wrong = 0;
    for word in WORDS {
        pac::SPI3.dr().write(|w| w.set_dr(word));
        block_for(Duration::from_micros(5));
        wrong += u32::from(pac::SPI3.dr().read().dr() != word);
    }
    tell(report, "converter bus", wrong == 0, format_args!("{wrong} of 4 words wrong at 10.5 MHz"));
}

/// The last bytes of the records' area, which are put back.
fn fram(memory: Option<&mut Memory>, report: &mut Report) {
    static CONTENTS: StaticCell<[u8; MEMORY_BYTES]> = StaticCell::new();
    let Some(memory) = memory else { return };
    if !memory.is_there() {
        return tell(report, "FRAM", Verdict::Skip, format_args!("none answers on SPI4"));
    }
    let contents = CONTENTS.init([0; MEMORY_BYTES]);
    const AT: usize = MEMORY_BYTES - 16;
    let mut wrong = !memory.read(contents);
    let kept: Vec<u8, 64> = Vec::from_slice(&contents[AT..]).unwrap_or_default();
    let pattern: Vec<u8, 64> = (0..16).map(|i| 0x5a ^ (i * 17)).collect();
    memory.write(&MemoryWrite { address: AT as u16, bytes: pattern.clone() });
    wrong |= !memory.read(contents) || contents[AT..] != pattern[..];
    memory.write(&MemoryWrite { address: AT as u16, bytes: kept.clone() });
    wrong |= !memory.read(contents) || contents[AT..] != kept[..] || memory.take_failure();
    tell(report, "FRAM", !wrong, format_args!("16 bytes written at 21 MHz, read back and restored"));
}
