//! `farnear rig`: drives a rig, real or emulated.

mod capture;
mod info;
mod motion;

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use farnear_capture::Client;
use farnear_depth::psf::Psf;

use crate::{
    report::Usage,
    simulator::{Scenery, Simulator},
};

/// Drive a rig: who is there, home, move, stop, capture a pair.
#[derive(Args)]
#[command(after_help = "Example: farnear rig capture --port sim --optics optics.toml --out pair1/")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    Info(info::Arguments),
    Home(motion::HomeArguments),
    Move(motion::MoveArguments),
    Stop(motion::StopArguments),
    Capture(capture::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Info(arguments) => info::run(arguments),
        Job::Home(arguments) => motion::home(arguments),
        Job::Move(arguments) => motion::go(arguments),
        Job::Stop(arguments) => motion::stop(arguments),
        Job::Capture(arguments) => capture::run(arguments),
    }
}

/// Which rig.
#[derive(Args, Clone)]
pub struct Target {
    /// Serial port of the board, e.g. /dev/ttyACM0; or sim, to start the emulated rig.
    #[arg(long, value_name = "PORT|sim")]
    pub port: String,
    #[command(flatten)]
    scenery: Scenery,
}

/// A connected rig. The simulator, where there is one, ends after the client.
struct Connected {
    client: Client,
    simulator: Option<Simulator>,
}

impl Target {
    /// Connects; an interruption by the user (Ctrl-C) stops what moves.
    fn connect(&self, optics: Option<(&Path, Psf)>) -> Result<Connected> {
        let emulated = self.port == "sim";
        if let Some(flag) = self.scenery.given().filter(|_| !emulated) {
            bail!(Usage(format!("{flag} goes with --port sim only; {} has a world of its own", self.port)));
        }
        let simulator = emulated.then(|| Simulator::start(&self.scenery, optics)).transpose()?;
        let mut client = match &simulator {
            Some(simulator) => Client::open_emulated(simulator.port())?,
            None => Client::open(&self.port)?,
        };
        let interrupted = Arc::new(AtomicBool::new(false));
        client.interrupt_by(Arc::clone(&interrupted));
        ctrlc::set_handler(move || interrupted.store(true, Ordering::Relaxed))
            .context("cannot listen for an interruption")?;
        Ok(Connected { client, simulator })
    }
}
