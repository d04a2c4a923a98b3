//! Starting `farnear-sim` beside this program, and ending it again.

use std::{
    io::{BufRead, BufReader},
    path::PathBuf,
    process::{Child, ChildStdin, Command, Stdio},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Deserialize;

/// Name of the program.
const PROGRAM: &str = "farnear-sim";
/// Time to end by itself before it is killed.
const FAREWELL: Duration = Duration::from_secs(3);

/// What the emulated rig sees; used with `--port sim` only.
#[derive(Args, Clone)]
pub struct Scenery {
    /// Scene before the emulated camera: plane:MM, staircase, slant, cone or sphere.
    #[arg(long, default_value = "staircase", help_heading = "Emulated rig (--port sim)")]
    scene: String,
    /// Point spread function of the emulated lens.
    #[arg(long, default_value = "gaussian:k=0.4578", help_heading = "Emulated rig (--port sim)")]
    psf: String,
    /// Noise of the emulated camera: none, 8bit or 12bit.
    #[arg(long, default_value = "8bit", help_heading = "Emulated rig (--port sim)")]
    noise: String,
    /// Decides everything random.
    #[arg(long, default_value_t = 1, help_heading = "Emulated rig (--port sim)")]
    seed: u64,
    /// Faults of the emulated line, a TOML file.
    #[arg(long, value_name = "FILE", help_heading = "Emulated rig (--port sim)")]
    faults: Option<PathBuf>,
}

impl Scenery {
    /// As it stands in a capture's record.
    pub fn record(&self) -> farnear_capture::record::SimulationRecord {
        farnear_capture::record::SimulationRecord {
            scene: self.scene.clone(),
            psf: self.psf.clone(),
            noise: self.noise.clone(),
            seed: self.seed,
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
#[derive(Deserialize)]
struct Address {
    port: String,
    camera: String,
}

impl Simulator {
    /// Starts the simulator and says so.
    pub fn start(scenery: &Scenery, optics: Option<&PathBuf>) -> Result<Self> {
        let program = find()?;
        eprintln!("starting the emulated rig ({PROGRAM}): no hardware is involved");
        let mut command = Command::new(&program);
        command.args(["run", "--scene", &scenery.scene, "--psf", &scenery.psf, "--noise", &scenery.noise]);
        command.args(["--seed", &scenery.seed.to_string()]);
        for (flag, file) in [("--optics", optics), ("--faults", scenery.faults.as_ref())] {
            if let Some(file) = file {
                command.arg(flag).arg(file);
            }
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let stdin = child.stdin.take();
        let stdout = child.stdout.take().context("the simulator has no output")?;
        let mut line = String::new();
        BufReader::new(stdout).read_line(&mut line).context("the simulator's output is no text")?;
        if line.is_empty() {
            let status = child.wait().context("the simulator was lost")?;
            bail!("{PROGRAM} ended at once ({status}); its message stands above");
        }
        let address = serde_json::from_str(&line)
            .with_context(|| format!("{PROGRAM} printed no address but {line:?}"))?;
        Ok(Self { child, stdin, address })
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
