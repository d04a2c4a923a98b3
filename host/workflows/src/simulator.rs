//! Runs `farnear-sim` as a child process.

use std::{
    io::{BufRead, BufReader, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::{
        Arc,
        mpsc::{RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use farnear_capture::record::SimulationRecord;
use farnear_depth::psf::Psf;
use serde::Deserialize;

use crate::{
    context::{Cancel, Context},
    error::Result,
    request::outputs::check_inputs,
};

const PROGRAM: &str = "farnear-sim";
pub(crate) const FIRMWARE: &str = "farnear-nucleo-f429zi.elf";
/// Time to exit before it is killed.
const FAREWELL: Duration = Duration::from_secs(3);

/// Longest wait for the simulator's address; it takes about 1 s.
const START: Duration = Duration::from_secs(60);
/// Polling interval for cancellation.
const LOOK: Duration = Duration::from_millis(50);

/// Default point spread function: the thesis' 50 mm lens.
pub const USUAL_PSF: Psf = Psf::Gaussian { k: 0.4578 };

/// Options of the emulated rig; unset ones have the simulator's defaults. The simulator checks them.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Scenery {
    /// `plane:MM`, `staircase`, `slant`, `cone`, `sphere`, or the scene file's name in `packed_scene`.
    pub scene: Option<String>,
    /// A scene file with its maps, passed to the simulator's standard input.
    pub packed_scene: Option<Arc<[u8]>>,
    /// Point spread function of the emulated lens; default: that of the optics.
    pub psf: Option<String>,
    /// Camera noise: `none`, `8bit` or `12bit`.
    pub noise: Option<String>,
    pub seed: Option<u64>,
    /// Default: the file next to farnear-sim.
    pub firmware: Option<PathBuf>,
    /// Faults of the emulated line, TOML.
    pub faults: Option<PathBuf>,
    /// Output file for the true state of the mechanics, CSV.
    pub trace: Option<PathBuf>,
    /// Whether emulated time follows wall-clock time; runs are then not repeatable.
    pub paced: bool,
    /// Adds a half mirror; distance of the second camera's sensor relative to the first.
    pub half_mirror_um: Option<f64>,
}

#[derive(Debug, thiserror::Error)]
pub enum SimulatorError {
    #[error("{program} is neither next to this program nor on the PATH")]
    Missing { program: &'static str },
    #[error("cannot start {}: {source}", program.display())]
    Start { program: PathBuf, source: std::io::Error },
    #[error("{PROGRAM} ended at once ({status}); its message stands above")]
    Ended { status: String },
    #[error("{PROGRAM} printed no address but {line:?}: {reason}")]
    Address { line: String, reason: String },
    #[error("{PROGRAM} did not say where it listens within {START:?}")]
    Silent,
    #[error("the output of {PROGRAM} was lost: {reason}")]
    Lost { reason: String },
}

impl Scenery {
    pub fn with_scene(&self, scene: String) -> Self {
        Self { scene: Some(scene), packed_scene: None, ..self.clone() }
    }

    pub fn scene(&self) -> String {
        self.scene.clone().unwrap_or_else(|| "staircase".into())
    }

    /// All options with their values, for a capture's record.
    pub fn decided(&self, psf: Psf) -> SimulationRecord {
        SimulationRecord {
            scene: self.scene(),
            psf: self.psf.clone().unwrap_or_else(|| psf.to_string()),
            noise: self.noise.clone().unwrap_or_else(|| "8bit".into()),
            seed: self.seed.unwrap_or(1),
        }
    }
}

/// A running simulator, stopped when dropped.
pub struct Simulator {
    child: Child,
    /// Closing it stops the simulator.
    stdin: Option<ChildStdin>,
    address: Address,
}

/// Addresses printed by the simulator.
#[derive(Deserialize, Default)]
struct Address {
    port: String,
    camera: String,
    second_camera: Option<String>,
}

impl Simulator {
    /// Starts the simulator and reports it. Default optics: a 50 mm lens.
    pub fn start(scenery: &Scenery, optics: Option<(&Path, Psf)>, context: &Context<'_>) -> Result<Self> {
        let files = [optics.map(|(file, _)| file), scenery.firmware.as_deref(), scenery.faults.as_deref()];
        if let Some(trace) = &scenery.trace {
            let inputs: Vec<PathBuf> = files.into_iter().flatten().map(Path::to_path_buf).collect();
            check_inputs("trace", trace, &inputs)?;
        }
        let program = find()?;
        context.info(&format!("starting the emulated rig ({PROGRAM}): no hardware is involved"));
        let mut command = Command::new(&program);
        let record = scenery.decided(optics.map_or(USUAL_PSF, |(_, psf)| psf));
        let scene = if scenery.packed_scene.is_some() { "-" } else { record.scene.as_str() };
        command.args(["run", "--scene", scene, "--psf", &record.psf, "--noise", &record.noise]);
        command.args(["--seed", &record.seed.to_string()]);
        let [optics, firmware, faults] = files;
        for (flag, file) in [
            ("--optics", optics),
            ("--firmware", firmware),
            ("--faults", faults),
            ("--trace", scenery.trace.as_deref()),
        ] {
            if let Some(file) = file {
                command.arg(flag).arg(file);
            }
        }
        if let Some(further_um) = scenery.half_mirror_um {
            command.arg(format!("--half-mirror={further_um}"));
        }
        if scenery.paced {
            command.arg("--paced");
        }
        // In its own process group, so that Ctrl-C first stops all motion and then the simulator.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        #[cfg(windows)] // CREATE_NEW_PROCESS_GROUP
        std::os::windows::process::CommandExt::creation_flags(&mut command, 0x200);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|source| SimulatorError::Start { program, source })?;
        let mut stdin = child.stdin.take();
        if let (Some(stdin), Some(packed)) = (&mut stdin, &scenery.packed_scene)
            && let Err(error) = stdin.write_all(packed)
            && error.kind() != ErrorKind::BrokenPipe
        {
            return Err(SimulatorError::Lost { reason: error.to_string() }.into());
        }
        let stdout = child.stdout.take();
        let mut simulator = Self { child, stdin, address: Address::default() };
        let lost = |reason: String| SimulatorError::Lost { reason };
        let line = first_line(stdout.ok_or_else(|| lost("it has none".into()))?, &context.cancel)?;
        if line.is_empty() {
            let status = simulator.child.wait().map_err(|error| lost(error.to_string()))?;
            return Err(SimulatorError::Ended { status: status.to_string() }.into());
        }
        simulator.address = serde_json::from_str(&line)
            .map_err(|error| SimulatorError::Address { line, reason: error.to_string() })?;
        Ok(simulator)
    }

    /// Serial port of the emulated board.
    pub fn port(&self) -> &str {
        &self.address.port
    }

    pub fn camera(&self) -> &str {
        &self.address.camera
    }

    /// Second emulated camera, with a half mirror.
    pub fn second_camera(&self) -> Option<&str> {
        self.address.second_camera.as_deref()
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        drop(self.stdin.take());
        // One that has not yet said where it is has nothing to leave in order.
        let farewell = if self.address.port.is_empty() { Duration::ZERO } else { FAREWELL };
        let until = Instant::now() + farewell;
        while Instant::now() < until {
            if let Ok(Some(_)) = self.child.try_wait() {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // Fails only if the process has already exited.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// First line of the output; empty if there is none.
fn first_line(output: impl Read + Send + 'static, cancel: &Cancel) -> Result<String> {
    let (sender, line) = channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = BufReader::new(output).read_line(&mut line);
        let _ = sender.send(read.map(|_| line)); // the receiver is closed after the deadline
    });
    let until = Instant::now() + START;
    loop {
        let lost = |reason: String| SimulatorError::Lost { reason };
        match line.recv_timeout(LOOK) {
            Ok(line) => return Ok(line.map_err(|error| lost(error.to_string()))?),
            Err(RecvTimeoutError::Disconnected) => return Err(lost("its reader ended".into()).into()),
            Err(RecvTimeoutError::Timeout) if Instant::now() >= until => {
                return Err(SimulatorError::Silent.into());
            }
            Err(RecvTimeoutError::Timeout) => cancel.check("starting the emulated rig")?,
        }
    }
}

pub(crate) fn find() -> Result<PathBuf, SimulatorError> {
    find_program(PROGRAM)
}

/// A program of the emulated board, next to this one or on the PATH.
pub(crate) fn find_program(program: &'static str) -> Result<PathBuf, SimulatorError> {
    let name = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.join(&name)));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&path).map(|folder| folder.join(&name));
    beside.into_iter().chain(on_path).find(|place| place.is_file()).ok_or(SimulatorError::Missing { program })
}

/// The simulator's default firmware: FARNEAR_FIRMWARE, else the file next to it.
pub(crate) fn firmware_of(program: &Path) -> PathBuf {
    std::env::var_os("FARNEAR_FIRMWARE").map_or_else(|| program.with_file_name(FIRMWARE), PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_does_not_replace_the_optics() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("rig.toml");
        std::fs::write(&file, "").expect("a writable folder");
        let trace = Some(folder.path().join("./rig.toml"));
        for (optics, faults) in [(Some((file.as_path(), USUAL_PSF)), None), (None, Some(file.clone()))] {
            let scenery = Scenery { faults, trace: trace.clone(), ..Scenery::default() };
            let started = Simulator::start(&scenery, optics, &Context::unattended());
            let error = started.err().expect("refused");
            assert!(error.is_usage() && error.to_string().contains("would replace the input"), "{error}");
        }
    }
}
