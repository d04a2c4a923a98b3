//! `farnear rig check`: the bring-up checklist, step by step.
//!
//! Before each step with somebody's hands in it the user is asked; what the board can tell by itself is measured. On an
//! emulated rig nobody has hands: those steps are passed over and say what shows the same thing later.

mod hands;
mod moving;
mod resting;

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::Client;
use serde::Serialize;

use super::{
    Connected, Target,
    camera::{self, CameraArguments},
};
use crate::{prompt, report};

/// Walk through the bring-up of a rig: link, identity, memory, switches, emergency stop, encoders, first move, homing,
/// piezo, camera.
///
/// The order is that of docs/rig.md: the first half is done with the motors disconnected. Ends with 1 if a step failed.
#[derive(Args)]
#[command(after_help = "Example: farnear rig check --port /dev/ttyACM0 --camera folder:incoming/")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// Only the steps with the motors disconnected: nothing moves.
    #[arg(long)]
    resting_only: bool,
    /// Ask nothing: pass over what needs hands.
    #[arg(long)]
    no_hands: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// How a step ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Verdict {
    Passed,
    Failed,
    PassedOver,
}

#[derive(Serialize)]
struct Outcome {
    step: &'static str,
    verdict: Verdict,
    detail: String,
}

#[derive(Serialize)]
struct Figures {
    passed: usize,
    failed: usize,
    passed_over: usize,
    steps: Vec<Outcome>,
}

/// What a step found: how it ended, and what to say of it.
type Found = Result<(Verdict, String)>;

/// The rig while it is checked.
struct Checkup<'a> {
    rig: Connected,
    arguments: &'a Arguments,
    /// Whether somebody can press switches.
    hands: bool,
    outcomes: Vec<Outcome>,
}

impl Checkup<'_> {
    fn client(&self) -> &Client {
        &self.rig.client
    }

    /// Carries out a step. An interruption by the user ends the checklist; any other error is the step's failure.
    fn step(&mut self, name: &'static str, check: impl FnOnce(&mut Self) -> Found) -> Result<bool> {
        eprintln!("\n{}. {name}", self.outcomes.len() + 1);
        let (verdict, detail) = match check(self) {
            Ok(found) => found,
            Err(error) if self.client().interrupted() => return Err(error),
            Err(error) => (Verdict::Failed, format!("{error:#}")),
        };
        let said = match verdict {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::PassedOver => "passed over",
        };
        eprintln!("   {said}: {detail}");
        self.outcomes.push(Outcome { step: name, verdict, detail });
        Ok(verdict != Verdict::Failed)
    }

    /// Asks the user to do something and waits for Enter.
    fn ask(&self, what: &str) -> Result<()> {
        self.answer(&format!("   {what}, then press Enter: ")).map(|_| ())
    }

    /// Asks a question and takes everything but an n for yes.
    fn yes(&self, question: &str) -> Result<bool> {
        let answer = self.answer(&format!("   {question} [Y/n] "))?;
        Ok(!answer.trim().to_lowercase().starts_with('n'))
    }

    fn answer(&self, question: &str) -> Result<String> {
        prompt::ask(question, "use --no-hands to pass over what needs hands", || self.client().interrupted())
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

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let early = arguments.camera.open_early(&arguments.target)?;
    let rig = arguments.target.connect(None)?;
    let mut camera = camera::of_rig(early, &rig)?;
    let hands = !(arguments.no_hands || rig.client.hello().emulated);
    let mut checkup = Checkup { rig, arguments: &arguments, hands, outcomes: Vec::new() };
    let go_on = checkup.step("the link", resting::link)?
        && checkup.step("who the board is", resting::identity)?
        && checkup.step("alarms", resting::alarms)?
        && checkup.step("memory", resting::memory)?;
    if go_on {
        // With the motors disconnected; each of these may fail without harm to the next.
        let mut sound = checkup.step("end switches by hand", hands::switches)?;
        sound &= checkup.step("emergency stop", hands::emergency_stop)?;
        sound &= checkup.step("encoder direction", hands::encoders)?;
        if sound && !arguments.resting_only {
            move_it(&mut checkup, camera.as_mut())?;
        }
    }
    let count = |verdict| checkup.outcomes.iter().filter(|outcome| outcome.verdict == verdict).count();
    let (passed, failed, passed_over) =
        (count(Verdict::Passed), count(Verdict::Failed), count(Verdict::PassedOver));
    eprintln!();
    report::print(&Figures { passed, failed, passed_over, steps: checkup.outcomes }, arguments.json)?;
    if failed > 0 {
        bail!("{failed} of the steps failed; put that right before anything moves further (docs/rig.md)");
    }
    Ok(())
}

/// The second half: the motors are connected, each step rests on the one before.
fn move_it(checkup: &mut Checkup<'_>, camera: &mut dyn farnear_capture::camera::Camera) -> Result<()> {
    let _ = checkup.step("motors on", hands::connect_motors)?
        && checkup.step("first slow homing", moving::slow_homing)?
        && checkup.step("homing repeats", moving::homing_repeats)?
        && checkup.step("a move at full speed", moving::full_speed)?
        && checkup.step("halt and its alarm", moving::halt)?
        && checkup.step("piezo sweep", moving::piezo)?
        && checkup.step("far and near by piezo", moving::toggle)?
        && checkup.step("camera and strobe", |checkup| moving::strobe(checkup, camera))?;
    Ok(())
}
