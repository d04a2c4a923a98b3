//! `farnear rig`: drives a rig, real or emulated.

mod alarms;
mod calibrate;
mod log;
mod motion;
mod settings;
pub mod target;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::{
    Context,
    rig::{
        AxisName, RigAddress, board, check::CheckRequest, continuous::ContinuousRequest,
        correct::BoardCorrectRequest, focus::FocusRequest, info, motion as moving, pair::CaptureRequest,
        sequence::SequenceRequest, sun::SunRequest,
    },
};
use serde::Serialize;

use crate::{
    report,
    run::{CameraRun, RigRun},
    terminal,
};
use target::Target;

/// Drive a rig: home, move, focus, capture, calibrate, and everything else the board can do.
#[derive(Args)]
#[command(after_help = "Example: farnear rig capture --port sim --optics optics.toml --out pair1/")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Print the board's identity, its limits and where it is.
    #[command(after_help = "Example: farnear rig info --port /dev/ttyACM0")]
    Info(Question),
    Home(motion::HomeArguments),
    Move(motion::MoveArguments),
    /// Stop all motion along the ramps and end a running program; positions stay known.
    #[command(after_help = "Example: farnear rig stop --port /dev/ttyACM0")]
    Stop {
        #[command(flatten)]
        target: Target,
    },
    /// Emergency stop: the last step comes within a millisecond; what moved has lost its position, and the alarm has to be
    /// cleared (farnear rig alarms).
    #[command(after_help = "Example: farnear rig halt --port /dev/ttyACM0")]
    Halt {
        #[command(flatten)]
        target: Target,
    },
    Focus(CameraRun<FocusRequest>),
    Capture(CameraRun<CaptureRequest>),
    Continuous(CameraRun<ContinuousRequest>),
    Sequence(CameraRun<SequenceRequest>),
    Calibrate(calibrate::Arguments),
    Sun(RigRun<SunRequest>),
    Correct(RigRun<BoardCorrectRequest>),
    Alarms(alarms::Arguments),
    Settings(settings::Arguments),
    /// Print what the board has counted in its life.
    #[command(after_help = "Example: farnear rig counters --port /dev/ttyACM0 --json")]
    Counters(Question),
    /// Reset the board; the stages have to be homed again afterwards.
    #[command(after_help = "Example: farnear rig reset --port /dev/ttyACM0")]
    Reset(Question),
    Log(log::Arguments),
    Check(CameraRun<CheckRequest>),
}

// No doc comment: the help text is that of the command.
#[allow(missing_docs)]
#[derive(Args)]
struct Question {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Question {
    fn answer<T: Serialize>(
        &self,
        ask: impl FnOnce(&RigAddress, &Context<'_>) -> farnear_workflows::Result<T>,
    ) -> Result<()> {
        report::print(&ask(&self.target.address()?, &terminal::context()?)?, self.json)
    }
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Info(question) => question.answer(info::info),
        Job::Home(arguments) => motion::home(arguments),
        Job::Move(arguments) => motion::go(arguments),
        Job::Stop { target } => Ok(moving::stop(&target.address()?, &terminal::context()?)?),
        Job::Halt { target } => Ok(moving::halt(&target.address()?, &terminal::context()?)?),
        Job::Focus(task) => task.run(),
        Job::Capture(task) => task.run(),
        Job::Continuous(task) => task.run(),
        Job::Sequence(task) => task.run(),
        Job::Calibrate(arguments) => calibrate::run(arguments),
        Job::Sun(task) => task.run(),
        Job::Correct(task) => task.run(),
        Job::Alarms(arguments) => alarms::run(arguments),
        Job::Settings(arguments) => settings::run(arguments),
        Job::Counters(question) => question.answer(board::counters),
        Job::Reset(question) => question.answer(board::reset),
        Job::Log(arguments) => log::run(arguments),
        Job::Check(task) => task.run(),
    }
}
