//! Lamp, flash and projector: brightness, and switch-off without requests.

use farnear_protocol::message::{LIGHT_TIME_MAX, LightFault, LightLevels, Shot, ShotLight, TriggerMode};
use farnear_protocol::{BoardMicros, Micros};

use crate::motion::since;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Lights {
    levels: LightLevels,
    set: BoardMicros,
    time: Micros,
    silence: Micros,
    cancel_flash: bool,
}

impl Lights {
    pub(crate) const fn new() -> Self {
        let (time, silence) = (Micros(0), Micros(0));
        Self { levels: LightLevels::OFF, set: BoardMicros(0), time, silence, cancel_flash: false }
    }

    /// The caller has checked `silence`.
    pub(crate) fn set(
        &mut self,
        levels: LightLevels,
        (time, silence): (Micros, Micros),
        now: BoardMicros,
    ) -> Result<(), LightFault> {
        if !levels.is_valid() {
            return Err(LightFault::Level);
        }
        if levels.is_on() && !(Micros(1)..=LIGHT_TIME_MAX).contains(&time) {
            return Err(LightFault::Time);
        }
        (self.levels, self.set, self.time, self.silence) = (levels, now, time, silence);
        Ok(())
    }

    /// Also cancels a flash.
    pub(crate) const fn off(&mut self) {
        (self.levels, self.cancel_flash) = (LightLevels::OFF, true);
    }

    /// Applies both time limits. `silent` is the time since the host's last request.
    pub(crate) fn tick(&mut self, silent: Micros, now: BoardMicros) {
        if self.levels.is_on() && (since(self.set, now) >= self.time || silent >= self.silence) {
            self.levels = LightLevels::OFF;
        }
    }

    pub(crate) const fn levels(&self) -> LightLevels {
        self.levels
    }

    pub(crate) const fn take_cancel(&mut self) -> bool {
        core::mem::replace(&mut self.cancel_flash, false)
    }
}

pub(crate) fn check(light: &ShotLight, shot: &Shot) -> Result<(), LightFault> {
    if !light.levels.is_valid() {
        Err(LightFault::Level)
    } else if shot.mode != TriggerMode::Hardware {
        Err(LightFault::Mode)
    } else if light.length.0 == 0 {
        Err(LightFault::Time)
    } else if light.delay.0.saturating_add(light.length.0) > shot.exposure.0 {
        Err(LightFault::Exposure)
    } else {
        Ok(())
    }
}
