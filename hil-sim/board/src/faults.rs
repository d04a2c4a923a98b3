//! What goes wrong with line, port and rig, from a TOML file.
//!
//! ```toml
//! bit_error_rate = 1e-4      # of each bit, in both directions
//! garbage = [1, 255, 0, 66]  # the host hears this before anything else
//! unplug_after_ms = 500      # virtual time after power-on; the port goes away
//!
//! [[happens]]                # in any number and order
//! after_ms = 1500            # virtual time after power-on
//! what = "motor-stalls"      # a name of the table below
//! stage = "lens"             # or "sensor", which is the default
//! ```
//!
//! | `what` | then | with |
//! |---|---|---|
//! | `emergency-stop` | somebody presses the emergency stop, or its wire breaks | |
//! | `emergency-stop-released` | it is released | |
//! | `reset-button` | somebody presses the reset button | |
//! | `power-loss` | the power goes; the volatile memory forgets | |
//! | `power-return` | the power comes back | |
//! | `brown-out` | the supply dips so shortly that only the brown-out reset notices | |
//! | `supply-low` | the supply sinks to 2.8 V, which the chip's detector sees | |
//! | `supply-normal` | the supply is 3.3 V again | |
//! | `driver-fault` | the motor's driver reports a fault on DIAG | `stage` |
//! | `driver-fine` | it takes that back | `stage` |
//! | `motor-stalls` | the motor is held fast | `stage` |
//! | `motor-free` | it is free again | `stage` |
//! | `home-switch-dead` | the home switch says for ever that it is open | `stage` |
//! | `piezo-dead` | the chips of the piezo's amplifier no longer answer | |
//! | `firmware-hangs` | a stray write stops the firmware's clock | |
//! | `memory-bit-flips` | a bit of the FRAM flips | `address` (0 to 32767), `bit` (0 to 7) |
//!
//! A new kind is a constant in one of the files of this module (or in a new one), a line in [`KINDS`], and a row above.

pub mod chips;
mod line;
pub mod motion;
pub mod power;

use std::{fmt, path::Path};

use rigless::chip::fram;
use serde::{Deserialize, Deserializer, de};

pub use self::line::NoisyLine;
use crate::{access::RigAccess, error::SimError, plant::StageName};

/// A kind of thing that may happen to a rig.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Its name in files.
    pub name: &'static str,
    /// Lets it happen.
    pub happen: fn(&mut RigAccess<'_, '_>, &Happening),
}

/// All kinds.
pub const KINDS: [Kind; 16] = [
    motion::EMERGENCY_STOP,
    motion::EMERGENCY_STOP_RELEASED,
    power::RESET_BUTTON,
    power::POWER_LOSS,
    power::POWER_RETURN,
    power::BROWN_OUT,
    power::SUPPLY_LOW,
    power::SUPPLY_NORMAL,
    motion::DRIVER_FAULT,
    motion::DRIVER_FINE,
    motion::MOTOR_STALLS,
    motion::MOTOR_FREE,
    motion::HOME_SWITCH_DEAD,
    chips::PIEZO_DEAD,
    power::FIRMWARE_HANGS,
    chips::MEMORY_BIT_FLIPS,
];

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        KINDS.into_iter().find(|kind| kind.name == name).ok_or_else(|| {
            let names = KINDS.map(|kind| kind.name).join(", ");
            de::Error::custom(format!("what = {name:?} is unknown, expected one of {names}"))
        })
    }
}

/// Something that happens, and to what.
#[derive(Clone, Copy, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Happening {
    /// When, in milliseconds of virtual time after power-on.
    pub after_ms: u64,
    /// The kind of thing that happens.
    pub what: Kind,
    /// The stage concerned, if one is.
    #[serde(default = "sensor")]
    pub stage: StageName,
    /// The address of the memory concerned, if one is.
    #[serde(default)]
    pub address: u16,
    /// The bit there, 0 to 7.
    #[serde(default)]
    pub bit: u8,
}

fn sensor() -> StageName {
    StageName::Sensor
}

impl Happening {
    /// Lets it happen.
    pub fn happen(&self, rig: &mut RigAccess<'_, '_>) {
        (self.what.happen)(rig, self);
    }

    fn check(&self) -> Result<(), String> {
        if usize::from(self.address) >= fram::SIZE {
            return Err(format!("address = {} is not in the memory, 0 to {}", self.address, fram::SIZE - 1));
        }
        if self.bit > 7 {
            return Err(format!("bit = {} is not a bit of a byte, 0 to 7", self.bit));
        }
        Ok(())
    }
}

/// What goes wrong.
#[derive(Clone, PartialEq, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// Probability that a bit on the line is flipped, in each direction.
    pub bit_error_rate: f64,
    /// Bytes that the host receives before anything else.
    pub garbage: Vec<u8>,
    /// The port goes away after this much virtual time since the board's start, in milliseconds.
    pub unplug_after_ms: Option<u64>,
    /// What happens to the rig, in any order.
    pub happens: Vec<Happening>,
}

impl Faults {
    /// Reads the file.
    ///
    /// # Errors
    /// [`SimError::Faults`] where it cannot be read, is not such TOML, or a value is out of its range.
    pub fn read(path: &Path) -> Result<Self, SimError> {
        let wrong = |reason: String| SimError::Faults { path: path.into(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        Self::parse(&text).map_err(wrong)
    }

    fn parse(text: &str) -> Result<Self, String> {
        let faults: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        if !(0.0..=1.0).contains(&faults.bit_error_rate) {
            return Err(format!("bit_error_rate = {} is not in 0..1", faults.bit_error_rate));
        }
        faults.happens.iter().try_for_each(Happening::check)?;
        Ok(faults)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str, expected: &str) {
        let reason = Faults::parse(text).expect_err(text);
        assert!(reason.contains(expected), "{reason}");
    }

    #[test]
    fn a_file_is_read_and_mistakes_are_named() {
        let text = "[[happens]]\nafter_ms = 7\nwhat = \"motor-stalls\"\nstage = \"lens\"";
        let happens = Faults::parse(text).expect("a good file").happens;
        assert_eq!((happens[0].after_ms, happens[0].what), (7, motion::MOTOR_STALLS));
        assert_eq!(happens[0].stage, StageName::Lens);
        refused("bit_error_rate = 2.0", "bit_error_rate = 2");
        refused("bit_eror_rate = 0.1", "bit_eror_rate");
        let happens = |rest| format!("[[happens]]\nafter_ms = 7\nwhat = {rest}");
        refused(
            &happens("\"motor-stals\""),
            "what = \"motor-stals\" is unknown, expected one of emergency-stop, ",
        );
        refused(&happens("\"memory-bit-flips\"\nbit = 99"), "bit = 99");
        refused(&happens("\"memory-bit-flips\"\naddress = 32768"), "address = 32768");
    }

    #[test]
    fn the_table_above_has_every_kind_once() {
        let rows = include_str!("faults.rs")
            .lines()
            .filter_map(|line| line.strip_prefix("//! | `")?.split('`').next());
        let told: Vec<&str> = rows.skip(1).collect();
        assert_eq!(told, KINDS.map(|kind| kind.name));
        let page = include_str!("../../../docs/hil.md");
        for kind in KINDS {
            assert!(
                page.contains(&format!("| `{}` |", kind.name)),
                "docs/hil.md does not tell of {}",
                kind.name
            );
        }
    }
}
