//! Camera effects on a pair, alone and combined at random: the page `docs/robustness.md`.

pub mod disturb;
mod planes;
mod random;
mod registration;
mod table;

use anyhow::Result;

use crate::page::Page;

type Part = (&'static str, fn(&mut Page) -> Result<()>);

pub const PARTS: [Part; 4] = [
    ("disturbances", table::measure),
    ("outside", planes::measure),
    ("random", random::measure),
    ("registration", registration::measure),
];

pub const INTRODUCTION: &str = "# Robustness

Written by `cargo xtask evaluate`; two runs on one kind of processor write the same bytes. All depths and errors are in mm.

Pairs are rendered as for [accuracy](accuracy.md) (Li's rig: 50 mm, 12.8 mm aperture, 7.4 um, 933 to 886.81 mm, Gaussian PSF k 0.4578, 8 bit), then
disturbed: geometry and object motion before the blur, brightness before the noise, pixels and files after it. *Before* is the run time alone
(`--align none --balance none`, nothing withheld); *after* is what `farnear depth` does by itself. Errors are root mean squares over the
pixels that have a depth, 16 px of rim and 8 px around steps left out; *valid* is the part of these pixels that has a depth.";
