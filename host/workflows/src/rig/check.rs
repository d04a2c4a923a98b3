//! Bring-up checklist. Prompts the user before each manual step and measures the rest. An emulated rig skips manual
//! steps; their detail names the later step that covers the same fault.

mod actuation;
mod moving;
mod resting;

use farnear_capture::Client;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
};

struct Step {
    name: &'static str,
    check: fn(&mut Checkup<'_>) -> Found,
}

/// Related steps. A phase with a failure is the last one.
struct Phase {
    moves: bool,
    /// Whether the first failure ends the phase, because each step depends on the one before.
    in_turn: bool,
    steps: &'static [Step],
}

/// In the order of docs/bring-up.md: the first half is done with the motors disconnected.
const PHASES: [Phase; 3] = [
    Phase {
        moves: false,
        in_turn: true,
        steps: &[
            Step { name: "the link", check: resting::link },
            Step { name: "who the board is", check: resting::identity },
            Step { name: "alarms", check: resting::alarms },
            Step { name: "memory", check: resting::memory },
        ],
    },
    Phase {
        moves: false,
        in_turn: false, // each may fail without harm to the next
        steps: &[
            Step { name: "end switches by hand", check: actuation::switches },
            Step { name: "emergency stop", check: actuation::emergency_stop },
            Step { name: "encoder direction", check: actuation::encoders },
        ],
    },
    Phase {
        moves: true,
        in_turn: true,
        steps: &[
            Step { name: "piezo ready", check: actuation::piezo_ready },
            Step { name: "motors on", check: actuation::connect_motors },
            Step { name: "first slow homing", check: moving::slow_homing },
            Step { name: "homing repeats", check: moving::homing_repeats },
            Step { name: "a move at full speed", check: moving::full_speed },
            Step { name: "halt and its alarm", check: moving::halt },
            Step { name: "piezo sweep", check: moving::piezo },
            Step { name: "far and near by piezo", check: moving::toggle },
            Step { name: "camera and strobe", check: moving::strobe },
        ],
    },
];

/// Walk through the bring-up of a rig: link, identity, memory, switches, emergency stop, encoders, first move, homing, piezo, camera.
///
/// The order is that of docs/bring-up.md: the first half is done with the motors disconnected. Exits with 1 if a step failed.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear rig check --port /dev/ttyACM0 --camera folder:incoming/")
)]
#[serde(default)]
pub struct CheckRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// Only the steps with the motors disconnected: nothing moves.
    #[cfg_attr(feature = "clap", arg(long))]
    pub resting_only: bool,
    /// Skip the steps that a person actuates (switches, shafts). An emulated rig never has them.
    #[cfg_attr(feature = "clap", arg(long))]
    pub no_actuation: bool,
}

impl Request for CheckRequest {
    const NAME: &'static str = "rig check";
    const REQUIRED: &'static [&'static str] = &[];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = Checklist;

    fn run(&self, context: &Context<'_>) -> Result<Checklist> {
        check(self, context)
    }

    fn verdict(figures: &Checklist) -> Result<()> {
        figures.check()
    }
}

crate::request::camera_request!(CheckRequest);

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    Passed,
    Failed,
    /// Skipped; the detail gives the reason.
    PassedOver,
}

impl Verdict {
    fn text(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::PassedOver => "passed over",
        }
    }
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Outcome {
    pub step: &'static str,
    pub verdict: Verdict,
    pub detail: String,
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Checklist {
    pub passed: usize,
    pub failed: usize,
    pub passed_over: usize,
    pub steps: Vec<Outcome>,
    #[serde(skip)]
    pub alarm: Option<u32>,
}

impl Checklist {
    pub fn check(&self) -> Result<()> {
        match self.failed {
            0 => Ok(()),
            failed => Err(WorkflowError::StepsFailed { failed, alarm: self.alarm }),
        }
    }
}

type Found = Result<(Verdict, String)>;

struct Checkup<'a> {
    equipped: EquippedRig,
    settings: &'a CheckRequest,
    context: &'a Context<'a>,
    actuation: bool,
    outcomes: Vec<Outcome>,
}

/// Fails for a missing camera or rig and when cancelled. Any other error is a failed step.
pub fn check(settings: &CheckRequest, context: &Context<'_>) -> Result<Checklist> {
    let equipped = settings.camera.connect(&settings.rig, None, context)?;
    let actuation = !settings.no_actuation && !equipped.rig.client.hello().emulated;
    let mut checkup = Checkup { equipped, settings, context, actuation, outcomes: Vec::new() };
    for phase in PHASES.iter().filter(|phase| !(settings.resting_only && phase.moves)) {
        if !checkup.go_through(phase)? {
            break;
        }
    }
    context.info("");
    let count = |verdict| checkup.outcomes.iter().filter(|outcome| outcome.verdict == verdict).count();
    let failed = count(Verdict::Failed);
    let latched = || checkup.client().status().ok()?.alarm.map(|record| record.number);
    Ok(Checklist {
        passed: count(Verdict::Passed),
        failed,
        passed_over: count(Verdict::PassedOver),
        alarm: if failed > 0 { latched() } else { None },
        steps: checkup.outcomes,
    })
}

impl Checkup<'_> {
    fn client(&self) -> &Client {
        &self.equipped.rig.client
    }

    /// Returns whether all steps of the phase passed or were skipped.
    fn go_through(&mut self, phase: &Phase) -> Result<bool> {
        let mut sound = true;
        for step in phase.steps {
            sound &= self.take(step)?;
            if phase.in_turn && !sound {
                break;
            }
        }
        Ok(sound)
    }

    /// Returns whether the step passed or was skipped.
    fn take(&mut self, step: &Step) -> Result<bool> {
        self.context.info(&format!("\n{}. {}", self.outcomes.len() + 1, step.name));
        let (verdict, detail) = match (step.check)(self) {
            Ok(found) => found,
            Err(error) if self.context.cancel.is_cancelled() => return Err(error),
            Err(error) => (Verdict::Failed, error.to_string()),
        };
        self.context.info(&format!("   {}: {detail}", verdict.text()));
        self.outcomes.push(Outcome { step: step.name, verdict, detail });
        Ok(verdict != Verdict::Failed)
    }

    /// Tells the user what to actuate while the board is polled.
    fn info(&self, what: &str) {
        self.context.info(&format!("   {what}"));
    }

    fn ask(&self, what: &str) -> Result<()> {
        self.answer(&format!("   {what}, then press Enter: ")).map(|_| ())
    }

    /// Takes every answer but "n" as yes.
    fn yes(&self, question: &str) -> Result<bool> {
        let answer = self.answer(&format!("   {question} [Y/n] "))?;
        Ok(!answer.trim().to_lowercase().starts_with('n'))
    }

    fn answer(&self, question: &str) -> Result<String> {
        self.context.questions.ask(question, &self.context.cancel)
    }
}

fn passed(detail: impl Into<String>) -> Found {
    Ok((Verdict::Passed, detail.into()))
}

fn failed(detail: impl Into<String>) -> Found {
    Ok((Verdict::Failed, detail.into()))
}

fn passed_over(detail: impl Into<String>) -> Found {
    Ok((Verdict::PassedOver, detail.into()))
}
