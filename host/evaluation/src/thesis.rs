//! Li's thesis (University of Warwick, 2014) redone by chapters: the page `docs/thesis.md`.

mod depth;

use anyhow::Result;

use crate::{
    page::Page,
    people::{self, data::Data},
};

type Part = (&'static str, fn(&mut Page, &Data) -> Result<()>);

pub const PARTS: [Part; 2] =
    [("chapters-4-to-6", |page, _| depth::measure(page)), ("chapters-7-to-9", people::thesis::measure)];

pub const INTRODUCTION: &str = "# The thesis, redone

Written by `cargo xtask evaluate --page thesis`. Ang Li's PhD thesis (University of Warwick, 2014) is where this project comes from; its images were never published, so its figures could not be checked. This page repeats each experiment with reproducible images. The thesis' figures are in brackets or under *Li 2014*. Seeds are fixed, so that two runs on one kind of processor write the same bytes, except for the table of times.";
