//! Table of `docs/instructions.md`, written from an emulated count or compared with one, to detect slower routines.

use std::{fmt::Write, process::Command};

use anyhow::{Context, Result, bail};

use crate::{
    firmware, host,
    run::{ROOT, output, step},
};

const PAGE: &str = "docs/instructions.md";
/// Relative tolerance: Rust 1.95 and Debian's 1.96 differ by up to 17 %.
const TOLERANCE: f64 = 0.20;
/// Absolute tolerance: short routines change by whole instructions.
const SLACK: f64 = 4.0;
/// Limits per unit on any compiler: rows keep up with the camera, and a control tick fits its period.
const CEILINGS: [(&str, f64); 5] = [
    ("CLSF, ten terms in 3x3 regions", 16.0),
    ("CLSF, blended", 24.0),
    ("CLSF, twenty terms", 24.0),
    ("sun, shadow angle and its standard deviation", 25_000.0),
    ("control tick, both steppers at 40 kHz and the piezo, the longest", 33_600.0),
];
const MHZ: f64 = 168.0;

struct Counted {
    routine: String,
    unit: String,
    units: f64,
    instructions: f64,
}

impl Counted {
    fn parse(line: &str) -> Option<Self> {
        let mut fields = line.split('\t');
        let mut number = || fields.next()?.parse().ok();
        let (instructions, units) = (number()?, number()?);
        let (unit, routine) = (fields.next()?.into(), fields.next()?.into());
        Some(Self { routine, unit, units, instructions })
    }

    fn per_unit(&self) -> f64 {
        self.instructions / self.units
    }

    fn row(&self) -> String {
        let each = self.per_unit();
        let digits = if each < 100.0 { 1 } else { 0 };
        let us = self.instructions / MHZ;
        format!("| {} | {each:.digits$} | {} | {:.0} | {us:.1} |", self.routine, self.unit, self.instructions)
    }
}

fn count() -> Result<Vec<Counted>> {
    let programs = host::build()?;
    step("instructions of the on-board routines");
    let text = output(Command::new(programs.join("farnear-sim")).arg("count").arg(firmware::counter()?))?;
    let lines: Option<Vec<Counted>> = text.lines().map(Counted::parse).collect();
    lines.filter(|lines| !lines.is_empty()).context("farnear-sim count printed no table")
}

fn page(counts: &[Counted]) -> String {
    let mut page = String::from(
        "# Instructions\n\n\
         Counted on the emulated board by `cargo xtask sizes --write`; `cargo xtask test` holds each to this page within \
         20 %, for compilers differ by that. The times are a lower bound: the counts at one instruction per cycle of 168 MHz, as if there were no \
         flash wait states, no taken branches and no long divisions. A control tick comes every 33,600 cycles.\n\n\
         | routine | instructions | per | one run | us |\n|---|--:|---|--:|--:|\n",
    );
    for counted in counts {
        // Writing to a string cannot fail.
        let _ = writeln!(page, "{}", counted.row());
    }
    page
}

fn on_page(page: &str, routine: &str) -> Option<f64> {
    let row = page.lines().find(|line| line.starts_with(&format!("| {routine} |")))?;
    row.split('|').nth(4)?.trim().parse().ok()
}

pub fn run(write: bool) -> Result<()> {
    let counts = count()?;
    let path = ROOT.join(PAGE);
    if write {
        std::fs::write(&path, page(&counts)).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let page = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read {}: `cargo xtask sizes --write` creates it", path.display()))?;
    let mut wrong = Vec::new();
    for counted in &counts {
        println!("{}", counted.row());
        let ceiling = CEILINGS.iter().find(|(routine, _)| *routine == counted.routine);
        if let Some((_, ceiling)) = ceiling.filter(|(_, ceiling)| counted.per_unit() > *ceiling) {
            wrong.push(format!(
                "{}: {:.1} per {}, at most {ceiling} are allowed",
                counted.routine,
                counted.per_unit(),
                counted.unit
            ));
        }
        let Some(known) = on_page(&page, &counted.routine) else {
            wrong.push(format!("{} is not in it", counted.routine));
            continue;
        };
        if (counted.instructions - known).abs() > TOLERANCE * known + SLACK {
            wrong.push(format!(
                "{}: {:.0} instructions, {known:.0} there",
                counted.routine, counted.instructions
            ));
        }
    }
    if !wrong.is_empty() {
        bail!(
            "{PAGE} differs from the count; `cargo xtask sizes --write` rewrites it\n  {}",
            wrong.join("\n  ")
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_table_is_read_back() {
        let counted = Counted::parse("8655\t640\tpixel\tCLSF, ten terms").expect("a line");
        assert_eq!(on_page(&page(&[counted]), "CLSF, ten terms"), Some(8655.0));
    }
}
