//! Fault kinds with action and repair. A new kind is a constant here, a line in [`KINDS`] and a row in `docs/hil.md`.

pub mod chips;
mod happening;
mod line;
pub mod link;
mod moment;
pub mod motion;
pub mod power;
mod schedule;

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use self::{
    happening::{Amount, Happening, Takes, When},
    line::{Lines, NoisyLine, Rates},
    moment::Moment,
    schedule::{Due, Schedule},
};
use crate::access::RigAccess;

pub type Deed = fn(&mut RigAccess<'_, '_>, &Happening);

#[derive(Clone, Copy)]
pub struct Kind {
    pub name: &'static str,
    /// Fields other than the time.
    pub takes: Takes,
    pub happen: Deed,
    /// Reverts the fault; `None` if that is impossible.
    pub revert: Option<Deed>,
}

pub const KINDS: [Kind; 41] = [
    motion::EMERGENCY_STOP,
    motion::EMERGENCY_STOP_RELEASED,
    power::RESET_BUTTON,
    power::POWER_LOSS,
    power::POWER_RETURN,
    power::POWER_LOSS_IN_A_WRITE,
    power::BROWN_OUT,
    power::SUPPLY_LOW,
    power::SUPPLY_NORMAL,
    power::FIRMWARE_HANGS,
    power::CLOCK_DEAD,
    motion::DRIVER_FAULT,
    motion::DRIVER_FINE,
    motion::DRIVER_RESETS,
    motion::MOTOR_STALLS,
    motion::MOTOR_FREE,
    motion::MOTOR_WEAK,
    motion::ENCODER_SLIPS,
    motion::ENCODER_DEAD,
    motion::HOME_SWITCH_DEAD,
    motion::HOME_SWITCH_BROKEN,
    motion::FAR_SWITCH_BROKEN,
    motion::SWITCH_NOISE,
    chips::PIEZO_DEAD,
    chips::GAUGE_DEAD,
    chips::GAUGE_DRIFTS,
    chips::DAC_DEAD,
    chips::MEMORY_BIT_FLIPS,
    chips::MEMORY_DEAD,
    chips::MEMORY_MISREAD,
    chips::CAMERA_DEAF,
    chips::CAMERA_SLOW,
    chips::STROBE_DEAD,
    link::LINK_BIT_ERRORS,
    link::LINK_LOSES_BYTES,
    link::LINK_INSERTS_BYTES,
    link::LINK_LATENCY,
    link::LINK_CUT,
    link::LINK_NOISE,
    link::LINK_FRAMING_ERRORS,
    link::LINK_RENAMED,
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

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name)
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

impl Due {
    pub fn happen(&self, rig: &mut RigAccess<'_, '_>) {
        let Self { happening, reverts } = self;
        match (reverts, happening.what.revert) {
            (false, _) => (happening.what.happen)(rig, happening),
            (true, Some(revert)) => revert(rig, happening),
            (true, None) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn docs_describe_each_fault_kind_and_moment_once() {
        let page = include_str!("../../../docs/hil.md");
        let rows = |name: &str| -> Vec<&str> {
            page.lines().filter(|line| line.starts_with(&format!("| `{name}` |"))).collect()
        };
        for kind in KINDS {
            let rows = rows(kind.name);
            assert_eq!(rows.len(), 1, "docs/hil.md and {}", kind.name);
            if let Some(Amount { min, max, usual }) = kind.takes.amount {
                let amount = format!("`amount` ({min} to {max}, default {usual})");
                assert!(rows[0].contains(&amount), "docs/hil.md and {}: {amount}", kind.name);
            }
        }
        for moment in Moment::ALL {
            let name = toml::Value::try_from(moment).expect("a name");
            let name = name.as_str().expect("a string").to_string();
            assert_eq!(rows(&name).len(), 1, "docs/hil.md and {name}");
        }
    }
}
