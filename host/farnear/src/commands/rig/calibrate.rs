use anyhow::{Result, bail};
use clap::Subcommand;
use farnear_protocol::message::{Axis, Routine};
use farnear_workflows::rig::{
    correction_fit::FitRequest, lens_stack::RigStackRequest, mechanics, targets::TargetSeriesRequest,
};

use super::{AxisName, Question};
use crate::{
    report::Usage,
    run::{CameraRun, RigRun},
};

#[derive(Subcommand)]
pub enum What {
    /// Measure the distance between a stage's two end switches. This homes the stage.
    #[command(after_help = "Example: farnear rig calibrate travel --port /dev/ttyACM0 --axis lens")]
    Travel {
        /// coarse or lens.
        #[arg(long)]
        axis: AxisName,
        #[command(flatten)]
        question: Question,
    },
    /// Measure a screw's backlash and keep it as a setting: moves compensate for it from then on.
    #[command(after_help = "Example: farnear rig calibrate backlash --port /dev/ttyACM0 --axis coarse")]
    Backlash {
        /// coarse or lens.
        #[arg(long)]
        axis: AxisName,
        #[command(flatten)]
        question: Question,
    },
    /// Measure the piezo's gain, hysteresis and creep against its strain gauge, and keep them as settings.
    #[command(after_help = "Example: farnear rig calibrate piezo --port /dev/ttyACM0 --json")]
    Piezo(Question),
    /// Measure the strain gauge's gain and zero against stage A's encoder, and keep them as settings. This homes the stage.
    #[command(after_help = "Example: farnear rig calibrate gauge --port /dev/ttyACM0 --json")]
    Gauge(Question),
    Targets(CameraRun<TargetSeriesRequest>),
    Stack(CameraRun<RigStackRequest>),
    Fit(RigRun<FitRequest>),
}

pub fn run(what: What) -> Result<()> {
    let measure = |question: Question, routine| {
        question.answer(|rig, context| mechanics::measure(rig, routine, context))
    };
    match what {
        What::Travel { axis, question } => measure(question, Routine::Travel { axis: stepper(axis)? }),
        What::Backlash { axis, question } => measure(question, Routine::Backlash { axis: stepper(axis)? }),
        What::Piezo(question) => measure(question, Routine::Piezo),
        What::Gauge(question) => measure(question, Routine::Gauge),
        What::Targets(task) => task.run(),
        What::Stack(task) => task.run(),
        What::Fit(task) => task.run(),
    }
}

fn stepper(name: AxisName) -> Result<Axis> {
    if name == AxisName::Fine {
        bail!(Usage("--axis fine has no screw: `farnear rig calibrate piezo` measures it".into()));
    }
    Ok(name.into())
}
