//! `farnear rig`: drives a rig, real or emulated.

mod alarms;
mod board;
mod calibrate;
mod capture;
mod check;
mod continuous;
mod correct;
mod focus;
mod info;
mod log;
mod motion;
mod sequence;
mod settings;
mod sun;
mod target;

use anyhow::Result;
use clap::{Args, Subcommand, ValueEnum};
use farnear_protocol::message::Axis;

use target::{CameraArguments, Target};

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
    Continuous(continuous::Arguments),
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
        Job::Continuous(arguments) => continuous::run(arguments),
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
