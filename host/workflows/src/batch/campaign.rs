//! Job: random scenarios on the emulated rig for a range of seeds.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Stdio},
    time::Duration,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
    simulator::{self, SimulatorError},
};

const LOOK: Duration = Duration::from_millis(50);
const PROGRAM: &str = "farnear-campaign";
const FIGURES: &str = "campaign.json";

/// Plays random scenarios on the emulated rig.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CampaignRequest {
    /// Seed of the first scenario.
    pub first: u64,
    /// Number of scenarios.
    pub seeds: u64,
    /// The firmware [default: next to the program].
    pub firmware: Option<PathBuf>,
    /// Folder for campaign.json and findings.
    pub out: PathBuf,
}

impl Default for CampaignRequest {
    fn default() -> Self {
        Self { first: 1, seeds: 0, firmware: None, out: PathBuf::new() }
    }
}

impl Request for CampaignRequest {
    const NAME: &'static str = "campaign";
    const REQUIRED: &'static [&'static str] = &["seeds", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("firmware", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = Value;

    fn check(&self) -> Result<()> {
        Ok(simulator::find_program(PROGRAM).map(|_| ())?)
    }

    fn run(&self, context: &Context<'_>) -> Result<Value> {
        played(self, context)
    }

    /// Program and firmware, because they may change the findings.
    fn inputs(&self) -> Vec<PathBuf> {
        let Ok(program) = simulator::find_program(PROGRAM) else { return Vec::new() };
        let firmware = self.firmware.clone().unwrap_or_else(|| simulator::firmware_of(&program));
        vec![program, firmware]
    }
}

/// Runs the scenarios. A violated property is a result, not a failure.
fn played(request: &CampaignRequest, context: &Context<'_>) -> Result<Value> {
    let program = simulator::find_program(PROGRAM)?;
    let out = &request.out;
    let folder = |source| WorkflowError::Folder { folder: out.into(), source };
    fs::create_dir_all(out).map_err(folder)?;
    let figures = out.join(FIGURES);
    let mut command = Command::new(&program);
    command.args(["run", "--json", "--jobs", "1"]);
    command.args(["--first", &request.first.to_string(), "--seeds", &request.seeds.to_string()]);
    if let Some(firmware) = &request.firmware {
        command.arg("--firmware").arg(firmware);
    }
    let started = command
        .arg("--out")
        .arg(out)
        .stdin(Stdio::null())
        .stdout(fs::File::create(&figures).map_err(folder)?)
        .spawn();
    let mut child = started.map_err(|source| SimulatorError::Start { program: program.clone(), source })?;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(folder)? {
            break status;
        }
        if let Err(cancelled) = context.cancel.check("playing scenarios") {
            let _ = child.kill(); // both fail only where it has ended meanwhile
            let _ = child.wait();
            return Err(cancelled);
        }
        std::thread::sleep(LOOK);
    };
    let text = fs::read_to_string(&figures).map_err(folder)?;
    let line = text.trim().to_owned();
    if line.is_empty() {
        return Err(SimulatorError::Ended { status: status.to_string() }.into());
    }
    serde_json::from_str(&text)
        .map_err(|error| SimulatorError::Address { line, reason: error.to_string() }.into())
}
