//! Parts of `docs/activity.md`: shadows, silhouettes and activities, as in Li 2014, chapters 8 and 9.

mod between;
mod bodies;
mod broken;
pub mod data;
mod embedded;
mod everyday;
mod figures;
mod layout;
mod matrix;
mod recognition;
mod robustness;
mod sets;
mod shadows;
mod skeletons;
mod strips;
mod sun;
pub mod thesis;
mod unsegmented;

use anyhow::Result;

use crate::page::Page;
use data::Data;

type Part = (&'static str, fn(&mut Page, &Data) -> Result<()>);

pub const PARTS: [Part; 12] = [
    ("synthetic-people", |page, _| recognition::measure(page)),
    ("utkinect", |page, data| recognition::measure_real(page, data, sets::utkinect, "UTKinect")),
    ("florence", |page, data| recognition::measure_real(page, data, sets::florence, "Florence")),
    ("weizmann", |page, data| recognition::measure_real(page, data, sets::weizmann, "the Weizmann strips")),
    ("between-sets", between::measure),
    ("unsegmented", unsegmented::measure),
    ("robustness", robustness::measure),
    ("broken-silhouettes", broken::measure),
    ("everyday", everyday::measure),
    ("layout", |page, _| layout::measure(page)),
    ("shadows", shadows::measure),
    ("sun", sun::measure),
];

pub const INTRODUCTION: &str = "# Shadows and activities

Written by `cargo xtask evaluate`; seeds are fixed and no clock enters, so that two runs on one kind of processor write the same bytes. Sets that are not part of this
repository are measured where they are at hand, and said to be skipped where not. *Li 2014* is Ang Li's PhD thesis (University of Warwick, 2014), whose
chapters 8 and 9 these tables redo; its own recordings were never published, so figures cannot be compared set for set.";
