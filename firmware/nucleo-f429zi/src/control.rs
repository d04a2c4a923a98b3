//! The control loop: every 200 us read the hardware, let the rig decide, carry it out, feed the watchdog.

use cortex_m::peripheral::DWT;
use defmt::{error, info, warn};
use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    peripherals::{IWDG, PB0, TIM1, TIM3, TIM4, TIM8},
    wdg::IndependentWatchdog,
};
use embassy_time::{Duration, Instant, Ticker, Timer};
use farnear_protocol::{
    PROTOCOL_CURRENT,
    frame::{Header, Kind, encode},
};
use farnear_rig::{
    Rig,
    io::{Inputs, Outputs, TICK_US},
};

use crate::{
    axis::Axis,
    camera::CameraPort,
    clock::{self, SYSCLK_HZ},
    link::Link,
    memory::Memory,
    piezo::Piezo,
    registers,
    supply::Supply,
};

/// Without a tick for this long the board is reset (LSI is 17 to 47 kHz, so 68 to 188 ms).
const WATCHDOG_US: u32 = 100_000;
/// The answer to a reboot request takes 1.3 ms at most.
const LAST_WORDS: Duration = Duration::from_millis(10);
/// Half a period of the LED that shows that the loop runs.
const BLINK: Duration = Duration::from_millis(500);
/// A tick this long is worth a line in the log: three quarters of its period.
const LONG_TICK_CYCLES: u32 = SYSCLK_HZ / 1_000_000 * TICK_US * 3 / 4;

/// All hardware that the loop works on.
pub struct Hardware {
    /// Stage A's stepper.
    pub coarse: Axis<TIM1, TIM4>,
    /// Stage B's stepper.
    pub lens: Axis<TIM8, TIM3>,
    /// The fine axis.
    pub piezo: Piezo,
    /// Trigger and strobe.
    pub camera: CameraPort,
    /// Where records survive without power; `None` where no such chip answers.
    pub memory: Option<Memory>,
    /// The watch on the supply.
    pub supply: Supply,
    /// The serial link.
    pub link: Link,
}

impl Hardware {
    fn read(&mut self, link_overflow: bool) -> Inputs {
        let gauge_code = self.piezo.gauge();
        let now = clock::now();
        // Both, for a look forgets.
        let [coarse_stop, lens_stop] =
            [self.coarse.stepper.emergency_stop(), self.lens.stepper.emergency_stop()];
        Inputs {
            now,
            coarse: self.coarse.read(),
            lens: self.lens.read(),
            gauge_code,
            emergency_stop: coarse_stop || lens_stop,
            supply_low: self.supply.is_low(),
            link_overflow,
            exposure: self.camera.take_edges(now),
            strobe: self.camera.take_strobe(now),
        }
    }

    fn apply(&mut self, outputs: &Outputs) {
        self.piezo.set(outputs.piezo_dac);
        self.coarse.apply(&outputs.coarse);
        self.lens.apply(&outputs.lens);
        self.camera.listen(outputs.listen);
        if let Some(length) = outputs.trigger {
            self.camera.expose(length);
        }
        if let (Some(memory), Some(order)) = (&mut self.memory, &outputs.memory) {
            memory.write(order);
        }
    }

    /// Hands the link what there is to say: the rig first, then the log.
    fn speak(&mut self, rig: &mut Rig) {
        while self.link.has_room()
            && let Some(frame) = rig.transmit()
        {
            self.link.send(frame);
        }
        if self.link.has_room()
            && let Some((id, log)) = registers::take_log()
        {
            let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Log, id, boot: rig.boot() };
            if let Some(frame) = encode(header, &log) {
                self.link.send(frame);
            }
        }
    }

    /// Resets the chip when the last frame has left.
    async fn reset(&self) -> ! {
        info!("reset on request");
        let deadline = Instant::now() + LAST_WORDS;
        while !self.link.is_idle() && Instant::now() < deadline {
            Timer::after_micros(50).await;
        }
        cortex_m::peripheral::SCB::sys_reset()
    }
}

/// Runs the rig for ever.
pub async fn run(
    mut hardware: Hardware,
    rig: &mut Rig,
    watchdog: Peri<'static, IWDG>,
    led: Peri<'static, PB0>,
) -> ! {
    let mut watchdog = IndependentWatchdog::new(watchdog, WATCHDOG_US);
    watchdog.unleash();
    let mut led = Output::new(led, Level::High, Speed::Low);
    let mut blink = Instant::now() + BLINK;
    let mut ticker = Ticker::every(Duration::from_micros(u64::from(TICK_US)));
    let mut underrun = false;
    registers::retained::set_boot(rig.boot());
    loop {
        ticker.next().await;
        let begin = DWT::cycle_count();
        let now = clock::now();
        let overflow = hardware.link.drain(|byte| rig.receive(byte, now));
        let inputs = hardware.read(overflow);
        let dry = inputs.coarse.stepper.underrun || inputs.lens.stepper.underrun;
        if dry && !underrun {
            error!("a STEP queue ran dry at {} us", inputs.now.0);
        }
        underrun = dry;
        let outputs = rig.tick(&inputs);
        hardware.apply(&outputs);
        hardware.speak(rig);
        if outputs.reset {
            hardware.reset().await;
        }
        watchdog.pet();
        if Instant::now() >= blink {
            led.toggle();
            blink += BLINK;
        }
        let cycles = DWT::cycle_count().wrapping_sub(begin);
        if registers::note_tick(cycles) && cycles > LONG_TICK_CYCLES {
            warn!("the longest tick so far: {} cycles", cycles);
        }
    }
}
