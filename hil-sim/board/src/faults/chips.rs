//! The chips on the board.

use super::Kind;
use crate::board::SpiChip;

/// The chips of the piezo's amplifier no longer answer.
pub const PIEZO_DEAD: Kind = Kind {
    name: "piezo-dead",
    happen: |rig, _| {
        rig.disconnect(SpiChip::Dac, true);
        rig.disconnect(SpiChip::Gauge, true);
    },
};
/// A bit of the FRAM flips.
pub const MEMORY_BIT_FLIPS: Kind = Kind {
    name: "memory-bit-flips",
    happen: |rig, at| {
        rig.change_memory(|contents| {
            // Both were checked when the file was read.
            if let Some(byte) = contents.get_mut(usize::from(at.address)) {
                *byte ^= 1u8.rotate_left(at.bit.into());
            }
        });
    },
};
