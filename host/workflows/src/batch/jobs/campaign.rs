//! Job: random scenarios on the emulated rig for a range of seeds.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use serde_json::Value;

use super::{BatchError, Call, Fields, Job};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    simulator::{self, SimulatorError},
};

const LOOK: Duration = Duration::from_millis(50);
const PROGRAM: &str = "farnear-campaign";
const FIGURES: &str = "campaign.json";

struct Seeds {
    program: PathBuf,
    first: u64,
    seeds: u64,
    firmware: Option<PathBuf>,
}

pub(super) fn work(fields: &mut Fields) -> Result<Box<dyn Job>> {
    fields.path("out")?;
    let program = simulator::find_program(PROGRAM)?;
    let settings = Seeds {
        first: fields.or("first", 1)?,
        seeds: fields.optional("seeds")?.ok_or(BatchError::MissingField { name: "seeds" })?,
        firmware: fields.optional_path("firmware")?,
        program: program.clone(),
    };
    // Program and firmware are inputs, because they may change the findings.
    let firmware = settings.firmware.clone().unwrap_or_else(|| simulator::firmware_of(&program));
    let inputs = vec![program, firmware];
    Ok(Box::new(Call { inputs, settings, run: played }))
}

/// Runs the scenarios. A violated property is a result, not a failure.
fn played(settings: &Seeds, out: &Path, context: &Context<'_>) -> Result<Value> {
    let folder = |source| WorkflowError::Folder { folder: out.into(), source };
    fs::create_dir_all(out).map_err(folder)?;
    let figures = out.join(FIGURES);
    let mut command = Command::new(&settings.program);
    command.args(["run", "--json", "--jobs", "1"]);
    command.args(["--first", &settings.first.to_string(), "--seeds", &settings.seeds.to_string()]);
    if let Some(firmware) = &settings.firmware {
        command.arg("--firmware").arg(firmware);
    }
    let started = command
        .arg("--out")
        .arg(out)
        .stdin(Stdio::null())
        .stdout(fs::File::create(&figures).map_err(folder)?)
        .spawn();
    let mut child =
        started.map_err(|source| SimulatorError::Start { program: settings.program.clone(), source })?;
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
