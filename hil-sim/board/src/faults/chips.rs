use super::{Kind, Takes};
use crate::board::SpiChip;

pub const PIEZO_DEAD: Kind = Kind {
    name: "piezo-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| {
        rig.disconnect(SpiChip::Dac, true);
        rig.disconnect(SpiChip::Gauge, true);
    },
    revert: Some(|rig, _| {
        rig.disconnect(SpiChip::Dac, false);
        rig.disconnect(SpiChip::Gauge, false);
    }),
};
pub const GAUGE_DEAD: Kind = Kind {
    name: "gauge-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Gauge, true),
    revert: Some(|rig, _| rig.disconnect(SpiChip::Gauge, false)),
};
/// Gauge zero drift, nm/s, as during warm-up.
pub const GAUGE_DRIFTS: Kind = Kind {
    name: "gauge-drifts",
    takes: Takes::amount(-1000.0, 1000.0, 20.0),
    happen: |rig, at| {
        let now_ns = rig.now_ns();
        rig.plant(|plant| plant.drift_gauge(now_ns, 1e-3 * at.amount));
    },
    revert: Some(|rig, _| {
        let now_ns = rig.now_ns();
        rig.plant(|plant| plant.drift_gauge(now_ns, 0.0));
    }),
};
pub const DAC_DEAD: Kind = Kind {
    name: "dac-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Dac, true),
    revert: Some(|rig, _| rig.disconnect(SpiChip::Dac, false)),
};
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
    revert: None,
};
pub const MEMORY_DEAD: Kind = Kind {
    name: "memory-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.disconnect(SpiChip::Memory, true),
    revert: Some(|rig, _| rig.disconnect(SpiChip::Memory, false)),
};
/// A flipped bit in each of the next `amount` FRAM reads, and one in its name.
pub const MEMORY_MISREAD: Kind = Kind {
    name: "memory-misread",
    takes: Takes::amount(1.0, 1_000.0, 1.0),
    happen: |rig, at| rig.spoil_memory_answers(1, at.amount as u32), // the range fits
    revert: Some(|rig, _| rig.spoil_memory_answers(0, 0)),
};
pub const CAMERA_DEAF: Kind = Kind {
    name: "camera-deaf",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_camera_ignores_triggers(true),
    revert: Some(|rig, _| rig.set_camera_ignores_triggers(false)),
};
pub const STROBE_DEAD: Kind = Kind {
    name: "strobe-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.cut_strobe(true),
    revert: Some(|rig, _| rig.cut_strobe(false)),
};
/// Extra read-out time per frame, ms.
pub const CAMERA_SLOW: Kind = Kind {
    name: "camera-slow",
    takes: Takes::amount(0.0, 1_000.0, 50.0),
    happen: |rig, at| rig.set_camera_delay_ns((at.amount * 1e6) as u64), // the range fits
    revert: Some(|rig, _| rig.set_camera_delay_ns(0)),
};
