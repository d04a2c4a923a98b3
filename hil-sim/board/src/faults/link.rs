//! Faults of the serial link. All act in both directions unless stated.

use super::{Kind, Takes};

pub const LINK_BIT_ERRORS: Kind = Kind {
    name: "link-bit-errors",
    takes: Takes::amount(0.0, 1.0, 1e-4),
    happen: |rig, at| rig.lines().each(|line| line.set_rates(|rates| rates.flipped = at.amount)),
    revert: Some(|rig, _| rig.lines().each(|line| line.set_rates(|rates| rates.flipped = 0.0))),
};
pub const LINK_LOSES_BYTES: Kind = Kind {
    name: "link-loses-bytes",
    takes: Takes::amount(0.0, 1.0, 1e-3),
    happen: |rig, at| rig.lines().each(|line| line.set_rates(|rates| rates.lost = at.amount)),
    revert: Some(|rig, _| rig.lines().each(|line| line.set_rates(|rates| rates.lost = 0.0))),
};
pub const LINK_INSERTS_BYTES: Kind = Kind {
    name: "link-inserts-bytes",
    takes: Takes::amount(0.0, 1.0, 1e-3),
    happen: |rig, at| rig.lines().each(|line| line.set_rates(|rates| rates.inserted = at.amount)),
    revert: Some(|rig, _| rig.lines().each(|line| line.set_rates(|rates| rates.inserted = 0.0))),
};
/// From board to host, as with USB adapters.
pub const LINK_LATENCY: Kind = Kind {
    name: "link-latency",
    takes: Takes::amount(0.0, 100.0, 16.0),
    happen: |rig, at| rig.lines().latency_ns = (at.amount * 1e6) as u64,
    revert: Some(|rig, _| rig.lines().latency_ns = 0),
};
pub const LINK_CUT: Kind = Kind {
    name: "link-cut",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.lines().each(|line| line.set_rates(|rates| rates.cut = true)),
    revert: Some(|rig, _| rig.lines().each(|line| line.set_rates(|rates| rates.cut = false))),
};
pub const LINK_NOISE: Kind = Kind {
    name: "link-noise",
    takes: Takes::amount(1.0, 100_000.0, 300.0),
    happen: |rig, at| rig.send_noise(at.amount as usize), // the range fits
    revert: None,
};
/// Framing errors per million bytes that the board receives.
pub const LINK_FRAMING_ERRORS: Kind = Kind {
    name: "link-framing-errors",
    takes: Takes::amount(0.0, 1e6, 1_000.0),
    happen: |rig, at| rig.set_framing_errors(at.amount as u32), // the range fits
    revert: Some(|rig, _| rig.set_framing_errors(0)),
};
/// The adapter is unplugged and reappears under another name; bytes in flight are lost.
pub const LINK_RENAMED: Kind = Kind {
    name: "link-renamed",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.lines().renamed = true,
    revert: None,
};
