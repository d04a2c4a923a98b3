//! `cargo xtask`: set-up, demo, tests, measurements, with Rust only; one file per job. Failures name the next command.

mod arm;
mod bench;
mod board_test;
mod boards;
mod browser;
mod campaign;
mod demo;
mod evaluate;
mod firmware;
mod fuzz;
mod host;
mod install;
mod instructions;
mod limited;
mod portable;
mod python;
mod release;
mod run;
mod site;
mod sizes;
mod test;
mod test_programs;
mod thumb;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Set-up, demo, tests and measurements of farnear.
#[derive(Parser)]
#[command(name = "cargo xtask", after_help = "Example: cargo xtask demo")]
struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Build everything, capture a pair on the emulated rig, compute its depth, write out/demo/.
    Demo,
    /// Run everything that CI runs: format, lints, firmware build and budgets, host tests, tests on the emulated board.
    Test(test::Arguments),
    /// Build the firmware and copy its ELF next to the host programs.
    Firmware,
    /// Compare the firmware's flash and static RAM with their budgets, and its routines' instructions with
    /// docs/instructions.md.
    Sizes {
        /// Rewrite docs/instructions.md.
        #[arg(long)]
        write: bool,
    },
    /// Test a NUCLEO-F429ZI with jumper wires and no rig (docs/bring-up.md), and write a report; without --port the emulated one.
    BoardTest(board_test::Arguments),
    /// Play random scenarios on the emulated board, check their invariants and shrink failures. Then run the long tests on
    /// each rig: a million steps, thousands of moves, a fuzzed link.
    Campaign(campaign::Arguments),
    /// Run the property tests with many more cases, seed after seed.
    Fuzz {
        /// Approximate duration; the last round is completed.
        #[arg(long, default_value_t = 60)]
        seconds: u64,
    },
    /// Time the mathematics; --peers compares it with the same chain on OpenCV.
    Bench(bench::Arguments),
    /// Measure the accuracy on rendered (and, where present, real) scenes and write the accuracy pages.
    Evaluate(evaluate::Arguments),
    /// Check that all but the emulated board compiles for Windows and macOS (four minutes the first time on two idle cores).
    Portable,
    /// Build the documents with all help texts as a searchable site in out/site/html.
    Site,
    /// Build and try the release files: programs for two processors, Debian packages, the wheel.
    Release(release::Arguments),
    /// Install farnear and farnear-sim (with the firmware's ELF) into cargo's bin folder.
    Install,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().job {
        Job::Demo => demo::run(),
        Job::Test(arguments) => test::run(&arguments),
        Job::Firmware => firmware::build().map(|elf| println!("{}", elf.display())),
        Job::Sizes { write } => firmware::build().and_then(|elf| {
            sizes::check(&elf)?;
            instructions::run(write)
        }),
        Job::BoardTest(arguments) => board_test::run(&arguments),
        Job::Campaign(arguments) => campaign::run(&arguments),
        Job::Fuzz { seconds } => fuzz::run(seconds),
        Job::Bench(arguments) => bench::run(&arguments),
        Job::Evaluate(arguments) => evaluate::run(&arguments),
        Job::Portable => portable::run(),
        Job::Site => site::run(),
        Job::Release(arguments) => release::run(&arguments),
        Job::Install => install::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Not returned from main: RUST_BACKTRACE would add a backtrace to the message.
        Err(error) => {
            eprintln!("\nxtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}
