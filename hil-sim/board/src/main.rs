//! `farnear-sim`: the emulated rig for any client.

mod hang_up;

use std::{
    io::Write,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::ExitCode,
    str::FromStr,
};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use farnear_gige::{self as gige, GigeConfig};
use farnear_scene::{Camera, Lens, Noise, OpticsFile, PackedScene, Psf, Scene, SceneError, standard};
use farnear_sim::{
    Pace, Parts, RigConfig, Scenario, half_mirror::Further, imager::Imager, port::PortKind, run::ServedRig,
};

/// The farnear rig without hardware: the real firmware on an emulated board.
#[derive(Parser)]
#[command(version)]
struct Program {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Start the rig. Prints one line of JSON with its serial port and its camera's address. Runs until
    /// interrupted or, if standard input is a pipe, until that closes.
    #[command(after_help = "Example:\n  \
        farnear-sim run --scene staircase --psf gaussian:k=0.4578 --noise 8bit --seed 1\n  \
        {\"port\": \"/dev/pts/3\", \"camera\": \"127.0.0.1:40123\"}")]
    Run(Box<Run>),
    /// Replay a recorded run and report the first difference.
    #[command(after_help = "Example:\n  farnear-sim run --trace run.vcd ...\n  farnear-sim replay run.vcd")]
    Replay {
        /// Trace of `farnear-sim run --trace FILE.vcd`.
        trace: PathBuf,
        /// Firmware ELF; default: the one next to this program.
        #[arg(long, value_name = "ELF")]
        firmware: Option<PathBuf>,
    },
    /// Count the instructions of the on-board routines and print a table.
    #[command(after_help = "Example:\n  farnear-sim count farnear-count.elf")]
    Count {
        /// Counting firmware, built by `cargo xtask firmware`.
        elf: PathBuf,
    },
    /// Run the test of a real board on the emulated one, with jumper wires instead of the rig, and print its report.
    #[command(hide = true)]
    BoardTest {
        /// Test firmware, built by `cargo xtask firmware`.
        elf: PathBuf,
    },
}

#[derive(Args)]
struct Run {
    /// Scene: plane:MM, staircase, slant, cone or sphere; or - for a packed scene file on standard input
    /// (sent by `farnear rig ... --port sim` and `farnear serve --rig sim`).
    #[arg(long, default_value = standard::SCENE)]
    scene: SceneSource,
    /// Blur of the lens: pillbox, gaussian:k=K or generalised:p=P,k=K.
    #[arg(long, default_value_t = standard::PSF)]
    psf: Psf,
    /// optics.toml of the rig; default: a 50 mm lens with far focus at 933 mm.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// Noise and bit depth of the camera: none, 8bit or 12bit.
    #[arg(long, default_value_t = standard::NOISE)]
    noise: Noise,
    /// Random seed; default: the scenario's, else 1.
    #[arg(long)]
    seed: Option<u64>,
    /// Firmware ELF; default: the one next to this program.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// TOML file with faults and their times (docs/hil.md). `farnear-campaign play` also runs its [[host]]
    /// steps.
    #[arg(long, visible_alias = "faults", value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// TOML file with part properties that differ from the standard rig and from the scenario's; `parts.toml`
    /// in the sources lists all of them with their origin.
    #[arg(long, value_name = "FILE")]
    parts: Option<PathBuf>,
    /// Follow the wall clock. By default time passes only while the board has an answer or event outstanding,
    /// and runs repeat to the byte.
    #[arg(long)]
    paced: bool,
    /// File for the board's memory (settings, alarms, counters, programs); created if missing, written when
    /// the rig ends.
    #[arg(long, value_name = "FILE")]
    memory: Option<PathBuf>,
    /// Listen on TCP instead of a serial port: a free port of this computer, or ADDRESS:PORT. Clients open
    /// tcp:ADDRESS:PORT, one at a time. It has no password: an address beyond this computer lets everybody on
    /// the network move the rig.
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:0")]
    tcp: Option<SocketAddr>,
    /// Link to the serial port, removed at the end. A client finds a restarted rig by this name.
    #[cfg(unix)]
    #[arg(long, value_name = "PATH", conflicts_with = "tcp")]
    link: Option<PathBuf>,
    /// File for the true motion of the mechanics: CSV, or VCD (ending .vcd), which `replay` can run again.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Also serve a GigE Vision camera on this interface: lo, or an IPv4 address of this computer. The JSON
    /// line has its identification; `farnear camera list` finds it.
    #[arg(long, value_name = "INTERFACE", value_parser = gige::interface)]
    gige: Option<std::net::Ipv4Addr>,
    /// Add a half mirror and a second camera whose sensor is this many micrometres further from the lens;
    /// default: the distance between far and near focus. Both cameras deliver each exposure and share the
    /// light equally (see `[half_mirror]` of the parts). The JSON line has the second address.
    #[arg(long, value_name = "UM", num_args = 0..=1, require_equals = true, default_missing_value = "near")]
    half_mirror: Option<Further>,
    /// Lost packets per 1000 of the GigE Vision camera.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "gige", value_parser = clap::value_parser!(u32).range(0..=1000))]
    gige_lost: u32,
}

#[derive(Clone)]
enum SceneSource {
    Named(Box<Scene>),
    /// A [`PackedScene`]; input after it is ignored until its end.
    StandardInput,
}

impl FromStr for SceneSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "-" {
            return Ok(Self::StandardInput);
        }
        if Path::new(text).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
            return Err("scene files are read by `farnear rig ... --port sim --scene FILE` and `farnear serve --rig sim --scene FILE`".into());
        }
        text.parse().map(|scene| Self::Named(Box::new(scene))).map_err(|error: SceneError| error.to_string())
    }
}

fn main() -> ExitCode {
    let done = match Program::parse().job {
        Job::Run(run) => serve(&run),
        Job::Replay { trace, firmware } => play_again(&trace, firmware.as_deref()),
        Job::Count { elf } => count(&elf),
        Job::BoardTest { elf } => board_test(&elf),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("farnear-sim: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn board_test(elf: &Path) -> Result<()> {
    let report = farnear_sim::board_test::report(elf, true)?;
    Ok(std::io::stdout().write_all(report.as_bytes())?)
}

fn play_again(trace: &Path, firmware: Option<&Path>) -> Result<()> {
    let (end_ns, departure) = farnear_sim::replay::replay(trace, firmware)?;
    if let Some(departure) = departure {
        let line = |line: Option<String>| line.unwrap_or_else(|| "nothing more".into());
        anyhow::bail!(
            "the run differs from the trace at {:.6} s, line {} ({}): the trace has {:?}, the run now {:?}",
            departure.at_ns as f64 * 1e-9,
            departure.line,
            departure.signal,
            line(departure.recorded),
            line(departure.now)
        );
    }
    let mut stdout = std::io::stdout();
    writeln!(stdout, "the same run to its end, {:.6} s of the board's time", end_ns as f64 * 1e-9)?;
    Ok(())
}

/// Tab-separated: instructions, units, unit, name.
fn count(elf: &Path) -> Result<()> {
    let mut stdout = std::io::stdout();
    for count in farnear_sim::count::count(elf)? {
        writeln!(stdout, "{}\t{}\t{}\t{}", count.instructions, count.units, count.unit, count.routine)?;
    }
    Ok(())
}

/// The command line overrides the scenario.
fn config(run: &Run) -> Result<RigConfig> {
    let scenario = run.scenario.as_deref().map(Scenario::read).transpose()?.unwrap_or_default();
    let parts = match run.parts.as_deref() {
        Some(path) => Parts::read(path, &scenario.parts)?,
        None => scenario.parts().map_err(anyhow::Error::msg)?,
    };
    Ok(RigConfig {
        firmware: run.firmware.clone(),
        seed: run.seed.or(scenario.seed).unwrap_or(standard::SEED),
        parts,
        costs_by_kind: false,
        pace: if run.paced { Pace::Realtime } else { Pace::Lockstep },
        scenario,
        memory: run.memory.clone(),
        observe: false,
        trace: run.trace.clone(),
    })
}

fn serve(run: &Run) -> Result<()> {
    let config = config(run)?;
    if !config.scenario.host.is_empty() {
        anyhow::bail!("the scenario has its own host: play it with `farnear-campaign play FILE`");
    }
    let optics = match &run.optics {
        Some(path) => {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            OpticsFile::parse(&text).with_context(|| path.display().to_string())?
        }
        None => OpticsFile::parse(standard::OPTICS)?,
    };
    let imaging = &config.parts.imaging;
    let lens = imaging.lens(Lens::from_optics(&optics)?);
    let defects = imaging.defects();
    let camera = Camera { defects, ..Camera::new(standard::SIZE_PX.0, standard::SIZE_PX.1, run.noise) };
    let scene = match &run.scene {
        SceneSource::Named(scene) => (**scene).clone(),
        SceneSource::StandardInput => PackedScene::read(&mut std::io::stdin().lock())?.into_scene()?,
    };
    let imager = |light: f64| -> Result<Imager> {
        let camera = Camera { exposure_level: camera.exposure_level * light, ..camera.clone() };
        let imager = Imager::new(&scene, &lens, &run.psf, camera, config.seed)?;
        Ok(imager.moving(imaging.scene_px_per_s).lit_by(imaging.light))
    };
    let mirror = &config.parts.half_mirror;
    let (first, second) = match run.half_mirror {
        None => (imager(1.0)?, None),
        Some(further) => {
            let [first, second] = mirror.light;
            let second = imager(second)?.as_second(further.mm(&lens), mirror, config.seed);
            (imager(first)?, Some(second))
        }
    };
    let gige = run.gige.map(|address| GigeConfig {
        address,
        seed: config.seed,
        lost_per_thousand: run.gige_lost,
        sensor_px: (standard::SIZE_PX.0 as u16, standard::SIZE_PX.1 as u16),
        bits: run.noise.bits(),
    });
    #[cfg(unix)]
    let linked = run.link.clone();
    let renamed = move |port: &str| {
        #[cfg(unix)]
        if let Some(Err(error)) = linked.as_deref().map(|path| Link::point(path, port)) {
            eprintln!("farnear-sim: {error:#}");
        }
        // The reader of the first line may have closed the pipe.
        let _ = writeln!(std::io::stdout(), "{{\"port\": \"{port}\"}}");
    };
    let rig = ServedRig::start(&config, port_kind(run.tcp), first, second, gige.as_ref(), renamed)?;
    #[cfg(unix)]
    let link = run.link.as_deref().map(|path| Link::new(path, &rig.port)).transpose()?;
    #[cfg(unix)]
    let port = link.as_ref().map_or(rig.port.clone(), |link| link.0.display().to_string());
    #[cfg(not(unix))]
    let port = rig.port.clone();
    hang_up::keep_ignored(|| ctrlc::set_handler(rig.stopper())).context("cannot listen to signals")?;
    let stop = rig.stopper();
    if stdin_is_a_pipe() {
        std::thread::spawn(move || {
            // Input is ignored; its end stops the program.
            let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
            stop();
        });
    }
    let mut stdout = std::io::stdout();
    let gige = rig.gige.as_ref().map_or_else(String::new, |id| format!(", \"gige\": \"{id}\""));
    let second =
        rig.second_camera.map_or_else(String::new, |address| format!(", \"second_camera\": \"{address}\""));
    writeln!(stdout, "{{\"port\": \"{port}\", \"camera\": \"{}\"{second}{gige}}}", rig.camera)?;
    stdout.flush()?;
    rig.wait()?;
    Ok(())
}

#[cfg(unix)]
fn port_kind(tcp: Option<SocketAddr>) -> PortKind {
    tcp.map_or(PortKind::Pty, PortKind::Tcp)
}

/// Without pseudo-terminals TCP is the only kind.
#[cfg(not(unix))]
fn port_kind(tcp: Option<SocketAddr>) -> PortKind {
    PortKind::Tcp(tcp.unwrap_or((std::net::Ipv4Addr::LOCALHOST, 0).into()))
}

#[cfg(unix)]
struct Link(PathBuf);

#[cfg(unix)]
impl Link {
    /// Replaces a dangling link of a killed rig; keeps other files.
    fn new(path: &Path, port: &str) -> Result<Self> {
        if path.is_symlink() && !path.exists() {
            std::fs::remove_file(path).with_context(|| format!("cannot replace {}", path.display()))?;
        }
        std::os::unix::fs::symlink(port, path)
            .with_context(|| format!("cannot create the link {} to {port}", path.display()))?;
        Ok(Self(path.into()))
    }

    fn point(path: &Path, port: &str) -> Result<()> {
        let cannot = || format!("cannot point the link {} to {port}", path.display());
        let name = path.file_name().with_context(cannot)?.to_string_lossy();
        let other = path.with_file_name(format!(".{name}.{}", std::process::id()));
        std::os::unix::fs::symlink(port, &other).with_context(cannot)?;
        std::fs::rename(&other, path).with_context(cannot)
    }
}

#[cfg(unix)]
impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0); // it may have been removed
    }
}

#[cfg(not(unix))]
fn stdin_is_a_pipe() -> bool {
    !std::io::IsTerminal::is_terminal(&std::io::stdin())
}

#[cfg(unix)]
fn stdin_is_a_pipe() -> bool {
    use std::os::{fd::AsFd, unix::fs::FileTypeExt};
    let stdin = std::io::stdin();
    let Ok(handle) = stdin.as_fd().try_clone_to_owned() else { return false };
    std::fs::File::from(handle).metadata().is_ok_and(|data| {
        let kind = data.file_type();
        kind.is_fifo() || kind.is_socket()
    })
}
