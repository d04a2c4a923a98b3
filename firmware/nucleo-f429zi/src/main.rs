//! # farnear-nucleo-f429zi
//!
//! Firmware of a NUCLEO-F429ZI: clocks, pins and registers; behaviour is in `farnear-rig`. One file per driver;
//! `board` combines them, and `control` ticks 5000 times a second, 500 times at rest.
//!
//! | pin | function | signal |
//! |---|---|---|
//! | PE9, PC6 | TIM1_CH1 (AF1), TIM8_CH1 (AF3) | STEP of stage A, of stage B |
//! | PF13, PF14, PF15 | GPIO | stage A: DIR (high = away from the lens), EN (low = on), DIAG (high = fault) |
//! | PF0, PF1, PF2 | GPIO | stage B: DIR (high = away from the sensor), EN, DIAG |
//! | PD12, PD13 | TIM4_CH1, CH2 (AF2) | stage A: encoder A, B |
//! | PB4, PB5 | TIM3_CH1, CH2 (AF2) | stage B: encoder A, B |
//! | PG0, PG1, PG2, PG3 | GPIO, pull-up | home and far switch of stage A, of stage B, normally closed to ground |
//! | PE15, PA6 | TIM1_BKIN (AF1), TIM8_BKIN (AF3), pull-up | emergency stop, normally closed to ground, on both |
//! | PC10, PC11, PC12 | SPI3 (AF6) | clock, data from the converter, data to the DAC |
//! | PD0, PD1 | GPIO | select of the piezo's DAC, CNV of the gauge's converter |
//! | PE2, PE5, PE6 | SPI4 (AF5) | clock, data from the FRAM, data to it |
//! | PE4 | GPIO | select of the FRAM |
//! | PB10 | TIM2_CH3 (AF1) | camera trigger |
//! | PB11 | TIM2_CH4 (AF1) | camera strobe (exposure active) |
//! | PD8, PD9 | USART3 (AF7) | link, on the ST-LINK's virtual COM port |
//! | PD15 | GPIO, pull-down | strap: high only on the emulated board |
//! | PB0 | GPIO | LED: blinks while the control loop runs |
//!
//! Interrupts: step timers' update and break above TIM2 (camera) above TIM5 (time); the link uses DMA only; the loop is
//! in thread mode.
#![no_std]
#![no_main]

use defmt::{error, info};
use embassy_executor::Spawner;
use embassy_stm32::{
    interrupt::{Interrupt, InterruptExt, Priority},
    uid,
};
use embassy_time::{Duration, block_for};
use farnear_nucleo_f429zi::{
    board::{Nucleo, Parts},
    clock, control,
    memory::Memory,
    option_bytes,
    registers::{
        self,
        retained::{self, Last},
    },
};
use farnear_protocol::message::ResetCause;
use farnear_rig::{Identity, Rig, io::MEMORY_BYTES};
use static_cell::StaticCell;

/// From power-on to the FRAM's first answer (FM25V02, t_PU).
const MEMORY_STARTS: Duration = Duration::from_micros(250);

/// The rig with its memory's contents; a silent memory is removed. A separate function, to free its variables' stack.
#[inline(never)]
fn start(identity: Identity, fitted: &mut Option<Memory>) -> &'static mut Rig {
    static RIG: StaticCell<Rig> = StaticCell::new();
    block_for(MEMORY_STARTS);
    let mut records = [0; MEMORY_BYTES];
    fitted.take_if(|memory| !(memory.is_there() && memory.read(&mut records)));
    let rig = RIG.init_with(|| Rig::new(identity, fitted.is_some().then_some(&records), clock::now()));
    if let Some(memory) = fitted {
        while let Some(order) = rig.keep_boot() {
            memory.write(&order);
        }
    }
    rig
}

fn count_cycles() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
}

/// Code of the piezo's DAC: a DAC8830 starts at 0 with its supply; after a supply dip the code is uncertain.
fn kept_piezo_code(cause: ResetCause) -> Option<u16> {
    match cause {
        ResetCause::PowerOn => Some(0),
        ResetCause::Pin | ResetCause::Software | ResetCause::Watchdog => retained::piezo_code(),
        ResetCause::BrownOut | ResetCause::LowPower | ResetCause::Unknown => None,
    }
}

fn tell_of(last: Option<Last>) {
    match last {
        Some(Last::Panic { file, line }) => error!("panicked at {}:{}", file.unwrap_or("?"), line),
        Some(Last::Fault { program_counter, status }) => {
            error!("a fault at {:#010x}, CFSR {:#010x}", program_counter, status);
        }
        Some(Last::StackOverflow) => error!("the stack overflowed"),
        Some(Last::ClockLost) => error!("the external clock stopped"),
        None => {}
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let reset_cause = registers::take_reset_cause();
    let piezo_code = kept_piezo_code(reset_cause);
    // Memory may outlast the DAC, and a failing clock must not return to its code.
    retained::set_piezo_code(piezo_code);
    let (boot, last) = retained::take();
    count_cycles();
    let (peripherals, own_clock) = clock::start(last == Some(Last::ClockLost));
    Interrupt::TIM5.set_priority(Priority::P3);
    tell_of(last);
    if own_clock {
        error!("no external clock: the internal oscillator is used");
    }
    if !option_bytes::has_brown_out_reset() {
        error!("the brown-out reset is off or below level 2: set BOR_LEV with the probe (docs/bring-up.md)");
    }
    let Parts { mut board, led, emulated } = match Nucleo::set_up(peripherals) {
        Ok(parts) => parts,
        Err(fault) => {
            // Only the log can report this.
            error!("the serial port cannot be set up: {}", fault);
            return;
        }
    };
    let identity = Identity {
        board: "nucleo-f429zi",
        firmware: env!("CARGO_PKG_VERSION"),
        unique_id: uid::uid(),
        boot,
        piezo_code,
        reset_cause,
        own_clock,
        emulated,
        last_words: last.and_then(Last::words),
    };
    let rig = start(identity, &mut board.memory);
    info!("boot {}, emulated: {}, memory: {}", rig.boot(), emulated, board.memory.is_some());
    control::run(board, rig, led).await
}
