//! `farnear rig`: drives a rig, real or emulated.

mod alarms;
mod board;
mod calibrate;
mod camera;
mod capture;
mod check;
mod correct;
mod focus;
mod info;
mod log;
mod motion;
mod sequence;
mod settings;
mod sun;

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand, ValueEnum};
use farnear_capture::Client;
use farnear_depth::psf::Psf;
use farnear_protocol::message::Axis;

use crate::{
    report::Usage,
    simulator::{Scenery, Simulator},
};

/// Drive a rig: home, move, focus, capture, calibrate, and everything else the board can do.
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
    Halt(motion::HaltArguments),
    Focus(focus::Arguments),
    Capture(capture::Arguments),
    Sequence(sequence::Arguments),
    Calibrate(calibrate::Arguments),
    Sun(sun::Arguments),
    Correct(correct::Arguments),
    Alarms(alarms::Arguments),
    Settings(settings::Arguments),
    Counters(board::CountersArguments),
    Reset(board::ResetArguments),
    Log(log::Arguments),
    Check(check::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Info(arguments) => info::run(arguments),
        Job::Home(arguments) => motion::home(arguments),
        Job::Move(arguments) => motion::go(arguments),
        Job::Stop(arguments) => motion::stop(arguments),
        Job::Halt(arguments) => motion::halt(arguments),
        Job::Focus(arguments) => focus::run(arguments),
        Job::Capture(arguments) => capture::run(arguments),
        Job::Sequence(arguments) => sequence::run(arguments),
        Job::Calibrate(arguments) => calibrate::run(arguments),
        Job::Sun(arguments) => sun::run(arguments),
        Job::Correct(arguments) => correct::run(arguments),
        Job::Alarms(arguments) => alarms::run(arguments),
        Job::Settings(arguments) => settings::run(arguments),
        Job::Counters(arguments) => board::counters(arguments),
        Job::Reset(arguments) => board::reset(arguments),
        Job::Log(arguments) => log::run(arguments),
        Job::Check(arguments) => check::run(arguments),
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
        let mut connected = self.connect_uninterrupted(optics)?;
        connected.client.interrupt_by(listen_for_interruption()?);
        Ok(connected)
    }

    /// As [`Target::connect`], for a command that connects several times: a program can listen for an interruption
    /// only once.
    fn connect_uninterrupted(&self, optics: Option<(&Path, Psf)>) -> Result<Connected> {
        let emulated = self.is_emulated();
        if let Some(flag) = self.scenery.given().filter(|_| !emulated) {
            bail!(Usage(format!("{flag} goes with --port sim only; {} has a world of its own", self.port)));
        }
        let simulator = emulated.then(|| Simulator::start(&self.scenery, optics)).transpose()?;
        let client = match &simulator {
            Some(simulator) => Client::open_emulated(simulator.port())?,
            None => Client::open(&self.port)?,
        };
        if let Some(note) = client.firmware_note() {
            eprintln!("{note}");
        }
        Ok(Connected { client, simulator })
    }

    fn is_emulated(&self) -> bool {
        self.port == "sim"
    }

    /// The same rig before another scene; for the emulated one only.
    fn with_scene(&self, scene: String) -> Self {
        Self { port: self.port.clone(), scenery: self.scenery.with_scene(scene) }
    }
}

/// A flag that the user's interruption (Ctrl-C) sets; to be called once in a program.
fn listen_for_interruption() -> Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
        .context("cannot listen for an interruption")?;
    Ok(interrupted)
}

/// An axis as users name it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum AxisName {
    /// Stage A's stepper and screw.
    Coarse,
    /// Stage A's piezo.
    Fine,
    /// Stage B's stepper and screw, which carry the lens.
    Lens,
}

impl AxisName {
    fn axis(self) -> Axis {
        match self {
            Self::Coarse => Axis::SensorCoarse,
            Self::Fine => Axis::SensorFine,
            Self::Lens => Axis::Lens,
        }
    }
}

/// A position in micrometres as the wire carries it.
fn nanometres(position_um: f64) -> Result<farnear_protocol::Nanometres> {
    farnear_capture::sequence::nanometres(position_um).with_context(|| {
        format!("{position_um} um is no position: expected a number between -2147483 and 2147483 um")
    })
}
