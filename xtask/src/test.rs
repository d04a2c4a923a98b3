//! Everything CI runs, in the order in which a mistake shows soonest.

use std::{process::Stdio, time::Instant};

use anyhow::{Result, bail};

use crate::{
    boards::BOARDS,
    browser, firmware, instructions,
    run::{cargo, finish, step},
    sizes, test_programs,
    thumb::Way,
};

/// What `cargo xtask test` can be told.
#[derive(clap::Args)]
pub struct Arguments {
    /// Run the test programs too that are unchanged since they passed.
    #[arg(long)]
    all: bool,
}

/// Runs all checks; ends with one line that sums up the tests.
pub fn run(arguments: &Arguments) -> Result<()> {
    let start = Instant::now();
    step("format");
    finish(cargo(["fmt", "--all", "--check"]).stdout(Stdio::null()))?;
    for board in &BOARDS {
        finish(cargo(["fmt", "--check"]).current_dir(board.folder()).stdout(Stdio::null()))?;
    }

    step("firmware");
    let way = Way::find()?;
    let elf = firmware::build_with(way)?;
    sizes::check(&elf)?;
    instructions::run(false)?;

    step("lints");
    finish(&mut cargo(["clippy", "--workspace", "--all-targets", "--locked", "--", "--deny", "warnings"]))?;
    if way.has_clippy() {
        let arguments = ["--release", "--locked", "--", "--deny", "warnings"];
        for board in &BOARDS {
            finish(way.cargo(&board.folder(), "clippy").args(arguments))?;
        }
    } else {
        eprintln!("skipped: clippy for the firmware (Debian's rust-web-clippy is not installed)");
    }
    step("documentation");
    finish(
        cargo(["doc", "--workspace", "--no-deps", "--locked", "--quiet"])
            .env("RUSTDOCFLAGS", "--deny warnings"),
    )?;

    step("tests on the host and on the emulated board");
    let mut total = test_programs::run(&elf, arguments.all)?;
    step("the page in a browser");
    let page = browser::run()?;
    total.passed += page.passed;
    total.failed += page.failed;
    total.ignored += page.skipped;
    total.well &= page.ended_well;
    eprintln!("\nall of it took {} s", start.elapsed().as_secs());
    if total.unchanged > 0 {
        eprintln!(
            "{} of the passed were not run again: nothing they depend on has changed (--all runs them)",
            total.unchanged
        );
    }
    println!("{} passed, {} failed, {} skipped", total.passed, total.failed, total.ignored);
    if !total.well {
        bail!("tests failed");
    }
    Ok(())
}
