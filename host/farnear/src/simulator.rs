//! Starting `farnear-sim` beside this program, and ending it again.

use std::{
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc::{RecvTimeoutError, channel},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::record::SimulationRecord;
use farnear_depth::psf::Psf;
use farnear_scene::{Noise, Scene};
use serde::Deserialize;

/// Name of the program.
const PROGRAM: &str = "farnear-sim";
/// Time to end by itself before it is killed.
const FAREWELL: Duration = Duration::from_secs(3);

/// Longest wait for the simulator to say where it listens; it takes about a second.
const START: Duration = Duration::from_secs(60);

/// What the emulated rig sees; goes with `--port sim` only.
#[derive(Args, Clone)]
#[command(next_help_heading = "Emulated rig (--port sim)")]
pub struct Scenery {
    /// Scene before the emulated camera: plane:MM, staircase, slant, cone or sphere [default: staircase].
    #[arg(long, value_parser = checked::<Scene>)]
    scene: Option<String>,
    /// Point spread function of the emulated lens [default: the one of the optics file].
    #[arg(long, value_parser = checked::<Psf>)]
    psf: Option<String>,
    /// Noise of the emulated camera: none, 8bit or 12bit [default: 8bit].
    #[arg(long, value_parser = checked::<Noise>)]
    noise: Option<String>,
    /// Decides everything random [default: 1].
    #[arg(long)]
    seed: Option<u64>,
    /// The firmware; without it the one that lies beside farnear-sim.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Faults of the emulated line, a TOML file.
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Write what the emulated mechanics really did to this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Let the emulated rig's time follow the clock on the wall, to watch it; runs do not repeat then.
    #[arg(long)]
    paced: bool,
}

/// Takes the text if it parses as a `T`; the simulator parses it again.
fn checked<T: std::str::FromStr>(text: &str) -> Result<String, T::Err> {
    text.parse::<T>().map(|_| text.to_owned())
}

impl Scenery {
    /// The first of these flags that was given.
    pub fn given(&self) -> Option<&'static str> {
        [
            ("--scene", self.scene.is_some()),
            ("--psf", self.psf.is_some()),
            ("--noise", self.noise.is_some()),
            ("--seed", self.seed.is_some()),
            ("--firmware", self.firmware.is_some()),
            ("--faults", self.faults.is_some()),
            ("--trace", self.trace.is_some()),
            ("--paced", self.paced),
        ]
        .into_iter()
        .find_map(|(flag, given)| given.then_some(flag))
    }

    /// The same before another scene.
    pub fn with_scene(&self, scene: String) -> Self {
        Self { scene: Some(scene), ..self.clone() }
    }

    /// Everything that was left open, decided; as it stands in a capture's record.
    pub fn decided(&self, psf: Psf) -> SimulationRecord {
        SimulationRecord {
            scene: self.scene.clone().unwrap_or_else(|| "staircase".into()),
            psf: self.psf.clone().unwrap_or_else(|| psf.to_string()),
            noise: self.noise.clone().unwrap_or_else(|| "8bit".into()),
            seed: self.seed.unwrap_or(1),
        }
    }
}

/// A running simulator; it ends with this value.
pub struct Simulator {
    child: Child,
    /// Closing it tells the simulator to end.
    stdin: Option<ChildStdin>,
    address: Address,
}

/// Where the simulator listens, as it prints it.
#[derive(Deserialize, Default)]
struct Address {
    port: String,
    camera: String,
}

impl Simulator {
    /// Starts the simulator and says so. Without optics it has those of a 50 mm lens.
    pub fn start(scenery: &Scenery, optics: Option<(&Path, Psf)>) -> Result<Self> {
        let program = find()?;
        eprintln!("starting the emulated rig ({PROGRAM}): no hardware is involved");
        let mut command = Command::new(&program);
        let record = scenery.decided(optics.map_or(Psf::Gaussian { k: 0.4578 }, |(_, psf)| psf));
        command.args(["run", "--scene", &record.scene, "--psf", &record.psf, "--noise", &record.noise]);
        command.args(["--seed", &record.seed.to_string()]);
        for (flag, file) in [
            ("--optics", optics.map(|(file, _)| file)),
            ("--firmware", scenery.firmware.as_deref()),
            ("--faults", scenery.faults.as_deref()),
            ("--trace", scenery.trace.as_deref()),
        ] {
            if let Some(file) = file {
                command.arg(flag).arg(file);
            }
        }
        if scenery.paced {
            command.arg("--paced");
        }
        // In a group of its own: Ctrl-C reaches this program, which stops what moves and ends the simulator then.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let stdin = child.stdin.take();
        let stdout = child.stdout.take().context("the simulator has no output")?;
        let mut simulator = Self { child, stdin, address: Address::default() };
        let line = first_line(stdout)?;
        if line.is_empty() {
            let status = simulator.child.wait().context("the simulator was lost")?;
            bail!("{PROGRAM} ended at once ({status}); its message stands above");
        }
        simulator.address = serde_json::from_str(&line)
            .with_context(|| format!("{PROGRAM} printed no address but {line:?}"))?;
        Ok(simulator)
    }

    /// The serial port of the emulated board.
    pub fn port(&self) -> &str {
        &self.address.port
    }

    /// Address of the emulated camera.
    pub fn camera(&self) -> &str {
        &self.address.camera
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        drop(self.stdin.take());
        let until = Instant::now() + FAREWELL;
        while Instant::now() < until {
            if let Ok(Some(_)) = self.child.try_wait() {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        // It did not listen; both calls fail only where it has ended meanwhile.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The first line of the simulator's output; empty where there is none.
fn first_line(output: impl Read + Send + 'static) -> Result<String> {
    let (sender, line) = channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = BufReader::new(output).read_line(&mut line);
        let _ = sender.send(read.map(|_| line)); // nobody listens after the deadline
    });
    match line.recv_timeout(START) {
        Ok(line) => line.context("the simulator's output is no text"),
        Err(RecvTimeoutError::Timeout) => bail!("{PROGRAM} did not say where it listens within {START:?}"),
        Err(RecvTimeoutError::Disconnected) => bail!("the output of {PROGRAM} was lost"),
    }
}

/// Beside this program, else on the PATH.
fn find() -> Result<PathBuf> {
    let name = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.join(&name)));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&path).map(|folder| folder.join(&name));
    beside.into_iter().chain(on_path).find(|place| place.is_file()).with_context(|| {
        format!(
            "{PROGRAM} is neither beside this program nor on the PATH; `cargo xtask install` installs both, \
             `cargo xtask demo` builds them"
        )
    })
}
