//! Camera trigger and strobe (exposure active) on TIM2, which counts board microseconds. Trigger: channel 3, PB10; both
//! edges are compare matches, exact to the microsecond, prepared by the interrupt. Flash: channels 1 and 2 without
//! pins; their interrupts switch and stamp the light. Strobe: channel 4, PB11, captured in hardware.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri,
    gpio::{OutputType, Pull},
    interrupt,
    interrupt::{Interrupt, Priority},
    pac::{self, timer::vals},
    peripherals::{PB10, PB11, TIM2},
    rcc,
    timer::{Ch3, Ch4, input_capture::CapturePin, simple_pwm::PwmPin},
};
use farnear_protocol::{BoardMicros, message::ShotLight};
use farnear_rig::{
    io::{ExposureEdges, StrobeEdges, Trigger},
    stamp,
};

use crate::{
    clock::{self, APB1_TIMER_HZ},
    light, registers,
};

/// Channels 1 to 4 in the register arrays, which start at 0.
const FLASH_ON: usize = 0;
const FLASH_OFF: usize = 1;
const TRIGGER: usize = 2;
const STROBE: usize = 3;
/// From the order to the rising edge: time to set up the compare match.
const LEAD_US: u32 = 10;
/// The comparator would miss a closer edge.
const MARGIN_US: u32 = 1;

/// TIM2 stamps.
#[derive(Clone, Copy)]
struct Exposure {
    length_us: u32,
    rising: u32,
    pulse_ended: bool,
    strobe_start: Option<u32>,
    strobe_end: Option<u32>,
    flash: Option<Flash>,
}

#[derive(Clone, Copy)]
struct Flash {
    light: ShotLight,
    on: Option<u32>,
    off: Option<u32>,
}

#[derive(Clone, Copy)]
enum Strobe {
    Ignored,
    Triggered(Exposure),
    /// Untriggered exposures: start of the current one, and the last complete one.
    Listening {
        start: Option<u32>,
        ended: Option<(u32, u32)>,
    },
}

impl Strobe {
    fn triggered(&mut self) -> Option<&mut Exposure> {
        match self {
            Self::Triggered(exposure) => Some(exposure),
            _ => None,
        }
    }
}

static EXPOSURE: Mutex<RefCell<Strobe>> = Mutex::new(RefCell::new(Strobe::Ignored));

fn drive(mode: vals::Ocm) {
    pac::TIM2.ccmr_output(1).modify(|w| w.set_ocm(TRIGGER - 2, mode));
}

fn capture_rising(rising: bool) {
    pac::TIM2.ccer().modify(|w| w.set_ccp(STROBE, !rising));
}

#[interrupt]
fn TIM2() {
    let timer = pac::TIM2;
    let flags = timer.sr().read();
    critical_section::with(|cs| {
        let mut exposure = EXPOSURE.borrow_ref_mut(cs);
        if flags.ccif(TRIGGER) {
            // Flags are cleared by writing 0; ones have no effect.
            timer.sr().write(|w| {
                w.0 = u32::MAX;
                w.set_ccif(TRIGGER, false);
            });
            trigger_edge(exposure.triggered());
        }
        flash_edges(exposure.triggered(), [flags.ccif(FLASH_ON), flags.ccif(FLASH_OFF)]);
        if flags.ccif(STROBE) {
            let stamp = timer.ccr(STROBE).read(); // clears the flag
            strobe_edge(&mut exposure, stamp);
        }
    });
}

/// Prepares the falling edge after the rising one.
fn trigger_edge(exposure: Option<&mut Exposure>) {
    let timer = pac::TIM2;
    let Some(exposure) = exposure else { return };
    if timer.ccmr_output(1).read().ocm(TRIGGER - 2) == vals::Ocm::ACTIVE_ON_MATCH {
        let fall = exposure.rising.wrapping_add(exposure.length_us);
        timer.ccr(TRIGGER).write_value(fall);
        drive(vals::Ocm::INACTIVE_ON_MATCH);
        if (fall.wrapping_sub(timer.cnt().read()) as i32) > MARGIN_US as i32 {
            return;
        }
        // Too late for the comparator (the handler was delayed for the whole exposure): end it now.
        drive(vals::Ocm::FORCE_INACTIVE);
    }
    timer.dier().modify(|w| w.set_ccie(TRIGGER, false));
    exposure.pulse_ended = true;
}

/// Switches the light where a compare match of the flash has come.
fn flash_edges(exposure: Option<&mut Exposure>, [on, off]: [bool; 2]) {
    let timer = pac::TIM2;
    let Some(flash) = exposure.and_then(|exposure| exposure.flash.as_mut()) else { return };
    if on && flash.on.is_none() {
        light::begin_flash(flash.light.levels);
        flash.on = Some(timer.cnt().read());
        timer.dier().modify(|w| w.set_ccie(FLASH_ON, false));
    }
    if off && flash.on.is_some() && flash.off.is_none() {
        light::end_flash();
        flash.off = Some(timer.cnt().read());
        timer.dier().modify(|w| w.set_ccie(FLASH_OFF, false));
    }
}

fn strobe_edge(strobe: &mut Strobe, stamp: u32) {
    match strobe {
        Strobe::Triggered(exposure) if exposure.strobe_start.is_none() => {
            exposure.strobe_start = Some(stamp);
            capture_rising(false);
        }
        Strobe::Triggered(exposure) if exposure.strobe_end.is_none() => {
            exposure.strobe_end = Some(stamp);
            capture_rising(true);
        }
        Strobe::Listening { start, ended } => match start.take() {
            None => {
                *start = Some(stamp);
                capture_rising(false);
            }
            Some(began) => {
                *ended = Some((began, stamp));
                capture_rising(true);
            }
        },
        _ => {}
    }
}

pub struct CameraPort {
    _trigger: PwmPin<'static, TIM2, Ch3>,
    _strobe: CapturePin<'static, TIM2, Ch4>,
}

impl CameraPort {
    /// Sets TIM2 to board time; trigger low.
    pub fn new(
        _timer: Peri<'static, TIM2>,
        trigger: Peri<'static, PB10>,
        strobe: Peri<'static, PB11>,
    ) -> Self {
        rcc::enable_and_reset::<TIM2>();
        let timer = pac::TIM2;
        timer.psc().write_value((APB1_TIMER_HZ / 1_000_000 - 1) as u16);
        timer.arr().write_value(u32::MAX);
        timer.cr1().write(|w| w.set_urs(vals::Urs::COUNTER_ONLY));
        timer.egr().write(|w| w.set_ug(true));
        timer.ccmr_output(1).modify(|w| w.set_ocm(TRIGGER - 2, vals::Ocm::FORCE_INACTIVE));
        timer.ccmr_input(1).modify(|w| {
            w.set_ccs(STROBE - 2, vals::CcmrInputCcs::TI4);
            // 4 samples of the 84 MHz clock: suppresses spikes below 48 ns.
            w.set_icf(STROBE - 2, vals::FilterValue::FCK_INT_N4);
        });
        timer.ccer().write(|w| {
            w.set_cce(TRIGGER, true);
            w.set_cce(STROBE, true);
        });
        timer.sr().write(|w| w.0 = 0);
        timer.dier().write(|w| w.set_ccie(STROBE, true));
        let trigger = PwmPin::new(trigger, OutputType::PushPull);
        let strobe = CapturePin::new(strobe, Pull::Down);
        // TIM5 and TIM2 share a crystal: set once, they stay within a microsecond.
        critical_section::with(|_| {
            timer.cnt().write_value(clock::now().0 as u32);
            timer.cr1().modify(|w| w.set_cen(true));
        });
        registers::enable_interrupt(Interrupt::TIM2, Priority::P1);
        Self { _trigger: trigger, _strobe: strobe }
    }

    /// Schedules a trigger pulse, at least a few microseconds ahead, and captures the edges.
    pub fn expose(&mut self, order: Trigger) {
        let timer = pac::TIM2;
        critical_section::with(|cs| {
            capture_rising(true);
            let soonest = timer.cnt().read().wrapping_add(LEAD_US);
            // TIM2 is the lower half of board time; earlier times are past.
            let due = order.at.0 as u32;
            let rising = if due.wrapping_sub(soonest) as i32 > 0 { due } else { soonest };
            *EXPOSURE.borrow_ref_mut(cs) = Strobe::Triggered(Exposure {
                length_us: order.length.0,
                rising,
                pulse_ended: false,
                strobe_start: None,
                strobe_end: None,
                flash: order.flash.map(|light| Flash { light, on: None, off: None }),
            });
            if let Some(light) = order.flash {
                let on = rising.wrapping_add(light.delay.0);
                timer.ccr(FLASH_ON).write_value(on);
                timer.ccr(FLASH_OFF).write_value(on.wrapping_add(light.length.0));
            }
            timer.ccr(TRIGGER).write_value(rising);
            drive(vals::Ocm::ACTIVE_ON_MATCH);
            timer.sr().write(|w| {
                w.0 = u32::MAX;
                w.set_ccif(TRIGGER, false);
                w.set_ccif(STROBE, false);
                w.set_ccif(FLASH_ON, false);
                w.set_ccif(FLASH_OFF, false);
            });
            timer.dier().modify(|w| {
                w.set_ccie(TRIGGER, true);
                w.set_ccie(FLASH_ON, order.flash.is_some());
                w.set_ccie(FLASH_OFF, order.flash.is_some());
            });
        });
    }

    /// Ends the flash, or prevents one that has not begun.
    pub fn cancel_flash(&mut self) {
        critical_section::with(|cs| {
            let mut strobe = EXPOSURE.borrow_ref_mut(cs);
            let Some(exposure) = strobe.triggered() else { return };
            pac::TIM2.dier().modify(|w| {
                w.set_ccie(FLASH_ON, false);
                w.set_ccie(FLASH_OFF, false);
            });
            match &mut exposure.flash {
                Some(flash) if flash.on.is_some() && flash.off.is_none() => {
                    light::end_flash();
                    flash.off = Some(pac::TIM2.cnt().read());
                }
                Some(Flash { on: None, .. }) => exposure.flash = None,
                _ => {}
            }
        });
    }

    pub fn listen(&mut self, listen: bool) {
        critical_section::with(|cs| {
            let mut strobe = EXPOSURE.borrow_ref_mut(cs);
            match (listen, &*strobe) {
                // A triggered exposure without strobe is still there.
                (true, Strobe::Ignored | Strobe::Triggered(Exposure { pulse_ended: true, .. })) => {
                    *strobe = Strobe::Listening { start: None, ended: None };
                    // An earlier edge belongs to an exposure begun before.
                    pac::TIM2.sr().write(|w| {
                        w.0 = u32::MAX;
                        w.set_ccif(STROBE, false);
                    });
                    capture_rising(true);
                }
                (false, Strobe::Listening { .. }) => {
                    *strobe = Strobe::Ignored;
                    capture_rising(true);
                }
                _ => {}
            }
        });
    }

    /// The last complete exposure while listening, once.
    pub fn take_strobe(&mut self, now: BoardMicros) -> Option<StrobeEdges> {
        critical_section::with(|cs| match &mut *EXPOSURE.borrow_ref_mut(cs) {
            Strobe::Listening { ended, .. } => ended.take().map(|(start, end)| StrobeEdges {
                start: stamp::extend(start, now),
                end: stamp::extend(end, now),
            }),
            _ => None,
        })
    }

    /// Edges of the last triggered exposure, once, when complete.
    pub fn take_edges(&mut self, now: BoardMicros) -> Option<ExposureEdges> {
        critical_section::with(|cs| {
            let mut strobe = EXPOSURE.borrow_ref_mut(cs);
            let edges = strobe.triggered().and_then(|exposure| {
                exposure.pulse_ended.then_some(())?;
                let flash = match exposure.flash {
                    None => None,
                    Some(flash) => Some([stamp::extend(flash.on?, now), stamp::extend(flash.off?, now)]),
                };
                Some(ExposureEdges {
                    trigger: stamp::extend(exposure.rising, now),
                    strobe_start: stamp::extend(exposure.strobe_start?, now),
                    strobe_end: stamp::extend(exposure.strobe_end?, now),
                    flash,
                })
            });
            if edges.is_some() {
                *strobe = Strobe::Ignored;
            }
            edges
        })
    }
}
