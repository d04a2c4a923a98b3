//! Everything CI runs, fastest detection of mistakes first.

use std::{panic::resume_unwind, process::Stdio, thread, time::Instant};

use anyhow::{Result, bail};

use crate::{
    arm,
    boards::BOARDS,
    browser, firmware, instructions, python,
    run::{cargo, features, finish, step},
    sizes,
    test_programs::{Programs, Total},
    thumb::Way,
};

/// Options of `cargo xtask test`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Also run test programs that are unchanged since they passed.
    #[arg(long)]
    all: bool,
}

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
    let workspace = [&python::OTHERS[..], features()].concat();
    finish(cargo(["clippy", "--all-targets"]).args(&workspace).args(["--", "--deny", "warnings"]))?;
    if way.has_clippy() {
        let arguments = ["--release", "--locked", "--", "--deny", "warnings"];
        for board in &BOARDS {
            finish(way.cargo(&board.folder(), "clippy").args(arguments))?;
        }
    } else {
        eprintln!("skipped: clippy for the firmware (Debian's rust-web-clippy is not installed)");
    }
    step("documentation");
    finish(cargo(["doc", "--no-deps", "--quiet"]).args(&workspace).env("RUSTDOCFLAGS", "--deny warnings"))?;

    step("compiling the tests on the host and on the emulated board");
    // Build before running: a cargo call during the tests could replace their programs.
    if features().is_empty() {
        eprintln!("skipped: cameras through Aravis (libaravis-dev 0.8.25 or newer is missing)");
    }
    let programs = Programs::build(&elf)?;
    python::build(&elf)?;
    step(
        "two lanes side by side: the tests' programs; the page in a browser, the vectors of 64-bit ARM, the Python package",
    );
    // Each spends half of its time waiting. Output is printed at the end.
    let beside = || -> Result<Total> {
        let mut total = Total { well: true, ..Total::default() };
        total.add(&browser::run()?);
        arm::run(&mut total)?;
        total.add(&python::run(&elf)?);
        Ok(total)
    };
    let (programs, beside) = thread::scope(|scope| {
        let beside = scope.spawn(beside);
        let programs = programs.run(&elf, arguments.all);
        (programs, beside.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    let mut total = programs?;
    total.add(&beside?);
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
