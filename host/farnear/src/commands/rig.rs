mod calibrate;
mod log;
mod settings;
pub mod target;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::{
    Context,
    rig::{
        AxisName, RigAddress, alarms, board,
        check::CheckRequest,
        continuous::ContinuousRequest,
        correct::BoardCorrectRequest,
        focus::FocusRequest,
        info,
        motion::{self, HomeRequest, MoveRequest},
        pair::CaptureRequest,
        quality::QualityRequest,
        sequence::SequenceRequest,
        sun::SunRequest,
    },
};
use serde::Serialize;

use crate::{
    report,
    run::{CameraRun, RigRun},
    terminal,
};
use target::Target;

#[derive(Subcommand)]
pub enum Job {
    /// Print the board's identity, its limits and where it is.
    #[command(after_help = "Example: farnear rig info --port /dev/ttyACM0")]
    Info(Question),
    Home(RigRun<HomeRequest>),
    Move(RigRun<MoveRequest>),
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
    /// Measure the rig's mechanics, or drive a series of flat targets that teaches the depth correction.
    #[command(
        subcommand,
        after_help = "Example: farnear rig calibrate backlash --port /dev/ttyACM0 --axis coarse"
    )]
    Calibrate(calibrate::What),
    Quality(CameraRun<QualityRequest>),
    Sun(RigRun<SunRequest>),
    Correct(RigRun<BoardCorrectRequest>),
    /// List the last alarms, or clear the latched one by its number. While an alarm is latched nothing moves.
    #[command(after_help = "Example: farnear rig alarms --port /dev/ttyACM0 --clear 3")]
    Alarms {
        #[command(flatten)]
        question: Question,
        /// Clear the latched alarm; refused while its cause is there.
        #[arg(long, value_name = "NUMBER")]
        clear: Option<u32>,
    },
    /// List, read or change the settings in the board's memory.
    #[command(subcommand, after_help = "Example: farnear rig settings list --port /dev/ttyACM0")]
    Settings(settings::Job),
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
#[derive(Args)]
pub struct Question {
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

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::Info(question) => question.answer(info::info),
        Job::Home(task) => task.run(),
        Job::Move(task) => task.run(),
        Job::Stop { target } => Ok(motion::stop(&target.address()?, &terminal::context()?)?),
        Job::Halt { target } => Ok(motion::halt(&target.address()?, &terminal::context()?)?),
        Job::Focus(task) => task.run(),
        Job::Capture(task) => task.run(),
        Job::Continuous(task) => task.run(),
        Job::Sequence(task) => task.run(),
        Job::Calibrate(arguments) => calibrate::run(arguments),
        Job::Quality(task) => task.run(),
        Job::Sun(task) => task.run(),
        Job::Correct(task) => task.run(),
        Job::Alarms { question, clear } => {
            question.answer(|rig, context| alarms::alarms(rig, clear, context))
        }
        Job::Settings(arguments) => settings::run(arguments),
        Job::Counters(question) => question.answer(board::counters),
        Job::Reset(question) => question.answer(board::reset),
        Job::Log(arguments) => log::run(arguments),
        Job::Check(task) => task.run(),
    }
}
