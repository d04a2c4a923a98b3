//! # farnear-nucleo-f429zi
//!
//! The firmware on a NUCLEO-F429ZI. Thin on purpose: what the board does lives in `farnear-rig`; here are
//! clocks, pins and registers. One file per driver; [`control`] joins them, 5000 times a second.
//!
//! | pin | function | signal |
//! |---|---|---|
//! | PE9 | TIM1_CH1 (AF1) | STEP |
//! | PF13, PF14, PF15 | GPIO | DIR (high = away from the lens), EN (low = on), DIAG (high = fault) |
//! | PD12, PD13 | TIM4_CH1, CH2 (AF2) | encoder A, B |
//! | PG0, PG1 | GPIO, pull-up | home and far switch, normally closed to ground |
//! | PC10, PC11, PC12 | SPI3 (AF6) | clock, data in, data out |
//! | PD0, PD1 | GPIO | select of the piezo's DAC, CNV of the gauge's converter |
//! | PB10 | TIM2_CH3 (AF1) | camera trigger |
//! | PB11 | TIM2_CH4 (AF1) | camera strobe (exposure active) |
//! | PD8, PD9 | USART3 (AF7) | link, on the ST-LINK's virtual COM port |
//! | PD15 | GPIO, pull-down | strap: high only on the emulated board |
//! | PB0 | GPIO | LED: blinks while the control loop runs |
//!
//! Interrupts: TIM1 update (steps) above TIM2 (camera) above USART3 above TIM5 (time); the loop runs in thread
//! mode below them all.
#![no_std]
#![no_main]

mod camera;
mod clock;
mod control;
mod encoder;
mod link;
mod piezo;
mod registers;
mod stepper;

use defmt::{error, info};
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::{
    gpio::{Input, Pull},
    interrupt::{Interrupt, InterruptExt, Priority},
    uid,
};
use farnear_rig::{Identity, Rig};
use panic_probe as _;

use crate::{
    camera::CameraPort,
    control::{Hardware, Switches},
    encoder::Encoder,
    piezo::Piezo,
    stepper::Stepper,
};

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let reset_cause = registers::take_reset_cause();
    let p = clock::start();
    Interrupt::USART3.set_priority(Priority::P2);
    Interrupt::TIM5.set_priority(Priority::P3);

    let identity = Identity {
        board: "nucleo-f429zi",
        firmware: env!("CARGO_PKG_VERSION"),
        unique_id: uid::uid(),
        boot: registers::next_boot_number(),
        reset_cause,
        emulated: Input::new(p.PD15, Pull::Down).is_high(),
    };
    info!("boot {}, emulated: {}", identity.boot, identity.emulated);

    let (link, sender) = match link::open(p.USART3, p.PD8, p.PD9) {
        Ok(ends) => ends,
        Err(fault) => {
            // Nobody can be told; the log is all there is.
            error!("the serial port cannot be set up: {}", fault);
            return;
        }
    };
    match link::send(sender) {
        Ok(task) => spawner.spawn(task),
        Err(fault) => error!("no place for the sending task: {}", defmt::Debug2Format(&fault)),
    }
    let hardware = Hardware {
        stepper: Stepper::new(p.TIM1, p.PE9, p.PF13, p.PF14, p.PF15),
        encoder: Encoder::new(p.TIM4, p.PD12, p.PD13),
        switches: Switches::new(p.PG0, p.PG1),
        piezo: Piezo::new(p.SPI3, p.PC10, p.PC11, p.PC12, p.PD0, p.PD1),
        camera: CameraPort::new(p.TIM2, p.PB10, p.PB11),
        link,
    };
    control::run(hardware, Rig::new(identity, clock::now()), p.IWDG, p.PB0).await
}
