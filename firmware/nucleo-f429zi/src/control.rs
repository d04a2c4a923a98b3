//! The control loop: every 200 us read the hardware, let the rig decide, carry it out, feed the watchdog.

use defmt::{error, info};
use embassy_stm32::{
    Peri,
    gpio::{Input, Level, Output, Pull, Speed},
    peripherals::{IWDG, PB0, PG0, PG1},
    wdg::IndependentWatchdog,
};
use embassy_time::{Duration, Instant, Ticker, Timer};
use farnear_rig::{
    Rig,
    io::{Inputs, Outputs, TICK_US},
};

use crate::{camera::CameraPort, clock, encoder::Encoder, link::Link, piezo::Piezo, stepper::Stepper};

/// Without a tick for this long the board is reset (LSI is 17 to 47 kHz, so 68 to 188 ms).
const WATCHDOG_US: u32 = 100_000;
/// The answer to a reboot request takes 1.3 ms at most.
const LAST_WORDS: Duration = Duration::from_millis(10);
/// Half a period of the LED that shows that the loop runs.
const BLINK: Duration = Duration::from_millis(500);

/// The end switches: normally closed to ground with a pull-up, so that a broken wire reads "closed switch" and
/// stops the axis.
pub struct Switches {
    home: Input<'static>,
    far: Input<'static>,
}

impl Switches {
    /// Sets the pins up.
    pub fn new(home: Peri<'static, PG0>, far: Peri<'static, PG1>) -> Self {
        Self { home: Input::new(home, Pull::Up), far: Input::new(far, Pull::Up) }
    }
}

/// All hardware that the loop works on.
pub struct Hardware {
    /// The coarse axis' motor.
    pub stepper: Stepper,
    /// The coarse axis' encoder.
    pub encoder: Encoder,
    /// Both ends of the coarse axis.
    pub switches: Switches,
    /// The fine axis.
    pub piezo: Piezo,
    /// Trigger and strobe.
    pub camera: CameraPort,
    /// The serial link.
    pub link: Link,
}

impl Hardware {
    fn read(&mut self) -> Inputs {
        let gauge_code = self.piezo.gauge();
        let now = clock::now();
        Inputs {
            now,
            encoder_coarse_counts: self.encoder.counts(),
            gauge_code,
            home_switch: self.switches.home.is_high(),
            far_switch: self.switches.far.is_high(),
            driver_fault: self.stepper.fault(),
            stepper: self.stepper.state(),
            exposure: self.camera.take_edges(now),
        }
    }

    fn apply(&mut self, outputs: &Outputs) {
        self.piezo.set(outputs.piezo_dac);
        self.stepper.apply(outputs);
        if let Some(length) = outputs.trigger {
            self.camera.expose(length);
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
    mut rig: Rig,
    watchdog: Peri<'static, IWDG>,
    led: Peri<'static, PB0>,
) -> ! {
    let mut watchdog = IndependentWatchdog::new(watchdog, WATCHDOG_US);
    watchdog.unleash();
    let mut led = Output::new(led, Level::High, Speed::Low);
    let mut blink = Instant::now() + BLINK;
    let mut ticker = Ticker::every(Duration::from_micros(u64::from(TICK_US)));
    let mut underrun = false;
    loop {
        ticker.next().await;
        let now = clock::now();
        hardware.link.drain(|byte| rig.receive(byte, now));
        let inputs = hardware.read();
        if inputs.stepper.underrun && !underrun {
            error!("STEP queue ran dry at {} us", inputs.now.0);
        }
        underrun = inputs.stepper.underrun;
        let outputs = rig.tick(&inputs);
        hardware.apply(&outputs);
        while hardware.link.has_room()
            && let Some(frame) = rig.transmit()
        {
            hardware.link.send(frame);
        }
        if outputs.reset {
            hardware.reset().await;
        }
        watchdog.pet();
        if Instant::now() >= blink {
            led.toggle();
            blink += BLINK;
        }
    }
}
