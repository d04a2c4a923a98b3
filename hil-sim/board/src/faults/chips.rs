//! The chips on the board.

use super::{Kind, Takes};
use crate::board::SpiChip;

/// The chips of the piezo's amplifier no longer answer.
pub const PIEZO_DEAD: Kind = Kind {
    name: "piezo-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| {
        rig.disconnect(SpiChip::Dac, true);
        rig.disconnect(SpiChip::Gauge, true);
    },
    mend: Some(|rig, _| {
        rig.disconnect(SpiChip::Dac, false);
        rig.disconnect(SpiChip::Gauge, false);
    }),
};
/// The gauge's converter no longer answers.
pub const GAUGE_DEAD: Kind = Kind {
    name: "gauge-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Gauge, true),
    mend: Some(|rig, _| rig.disconnect(SpiChip::Gauge, false)),
};
/// The gauge's zero drifts by so many nanometres a second, as it does while it warms up.
pub const GAUGE_DRIFTS: Kind = Kind {
    name: "gauge-drifts",
    takes: Takes::amount(-1000.0, 1000.0, 20.0),
    happen: |rig, at| {
        let now_ns = rig.now_ns();
        rig.plant(|plant| plant.drift_gauge(now_ns, 1e-3 * at.amount));
    },
    mend: Some(|rig, _| {
        let now_ns = rig.now_ns();
        rig.plant(|plant| plant.drift_gauge(now_ns, 0.0));
    }),
};
/// The piezo's DAC no longer hears anything, and keeps its output.
pub const DAC_DEAD: Kind = Kind {
    name: "dac-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Dac, true),
    mend: Some(|rig, _| rig.disconnect(SpiChip::Dac, false)),
};
/// A bit of the FRAM flips.
pub const MEMORY_BIT_FLIPS: Kind = Kind {
    name: "memory-bit-flips",
    takes: Takes::PLACE,
    happen: |rig, at| {
        rig.change_memory(|contents| {
            // Both were checked when the file was read.
            if let Some(byte) = contents.get_mut(usize::from(at.address)) {
                *byte ^= 1u8.rotate_left(at.bit.into());
            }
        });
    },
    mend: None,
};
/// The FRAM no longer answers.
pub const MEMORY_DEAD: Kind = Kind {
    name: "memory-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Memory, true),
    mend: Some(|rig, _| rig.disconnect(SpiChip::Memory, false)),
};
/// Each of so many reads of the FRAM comes with a flipped bit, and its name once.
pub const MEMORY_MISREAD: Kind = Kind {
    name: "memory-misread",
    takes: Takes::amount(1.0, 1_000.0, 1.0),
    happen: |rig, at| rig.spoil_memory_answers(1, at.amount as u32), // the range fits
    mend: Some(|rig, _| rig.spoil_memory_answers(0, 0)),
};
/// The camera hears no trigger.
pub const CAMERA_DEAF: Kind = Kind {
    name: "camera-deaf",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_camera_deaf(true),
    mend: Some(|rig, _| rig.set_camera_deaf(false)),
};
/// The wire of the strobe is cut: the camera exposes, and the board does not see it.
pub const STROBE_DEAD: Kind = Kind {
    name: "strobe-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.cut_strobe(true),
    mend: Some(|rig, _| rig.cut_strobe(false)),
};
/// The camera takes so much longer to read a frame out, milliseconds.
pub const CAMERA_SLOW: Kind = Kind {
    name: "camera-slow",
    takes: Takes::amount(0.0, 1_000.0, 50.0),
    happen: |rig, at| rig.set_camera_delay_ns((at.amount * 1e6) as u64), // the range fits
    mend: Some(|rig, _| rig.set_camera_delay_ns(0)),
};
