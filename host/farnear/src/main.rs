//! # farnear
//!
//! The command line. One file per command in [`commands`]; [`files`] reads and writes what users have, [`picture`]
//! makes `view.png`, [`report`] prints figures as text or JSON, [`simulator`] starts the emulated rig, [`video`] reads
//! frames.
//!
//! Exit code 0 only on success, 1 for failure, 2 for bad usage. Figures go to stdout, everything else to stderr.

mod commands;
mod files;
mod picture;
mod report;
mod simulator;
mod video;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Depth from defocus: design operators, compute depth, drive the rig.
#[derive(Parser)]
#[command(name = "farnear", version, arg_required_else_help = true, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Optics(commands::optics::Arguments),
    Operators(commands::operators::Arguments),
    Depth(commands::depth::Arguments),
    Compare(commands::compare::Arguments),
    Render(commands::render::Arguments),
    Rig(commands::rig::Arguments),
    Shadow(commands::shadow::Arguments),
    Silhouettes(commands::silhouettes::Arguments),
    Completions(commands::completions::Arguments),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Optics(arguments) => commands::optics::run(arguments),
        Command::Operators(arguments) => commands::operators::run(arguments),
        Command::Depth(arguments) => commands::depth::run(arguments),
        Command::Compare(arguments) => commands::compare::run(arguments),
        Command::Render(arguments) => commands::render::run(arguments),
        Command::Rig(arguments) => commands::rig::run(arguments),
        Command::Shadow(arguments) => commands::shadow::run(arguments),
        Command::Silhouettes(arguments) => commands::silhouettes::run(arguments),
        Command::Completions(arguments) => commands::completions::run::<Arguments>(arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Not returned from main: with RUST_BACKTRACE set that buries the message under a backtrace.
        Err(error) => {
            eprintln!("farnear: {error:#}");
            ExitCode::FAILURE
        }
    }
}
