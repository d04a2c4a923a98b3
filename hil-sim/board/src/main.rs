//! `farnear-sim`: the emulated rig for any client.

use std::{
    fs::File,
    io::Write,
    os::{fd::AsFd, unix::fs::FileTypeExt},
    path::{Path, PathBuf},
    process::ExitCode,
    str::FromStr,
};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use farnear_gige::{self as gige, GigeConfig};
use farnear_scene::{Camera, Lens, Noise, OpticsFile, PackedScene, Psf, Scene, SceneError, standard};
use farnear_sim::{Pace, Parts, RigConfig, Scenario, half_mirror::Further, imager::Imager, run::ServedRig};

/// The farnear rig without hardware: the real firmware on an emulated board.
#[derive(Parser)]
#[command(version)]
struct Program {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Start the rig; prints one line of JSON with its serial port and its camera's address, and runs until
    /// it is interrupted or, where its standard input is a pipe, until that is closed.
    #[command(after_help = "Example:\n  \
        farnear-sim run --scene staircase --psf gaussian:k=0.4578 --noise 8bit --seed 1\n  \
        {\"port\": \"/dev/pts/3\", \"camera\": \"127.0.0.1:40123\"}")]
    Run(Box<Run>),
    /// Make a run again from its trace, and say where it departs from it.
    #[command(after_help = "Example:\n  farnear-sim run --trace run.vcd ...\n  farnear-sim replay run.vcd")]
    Replay {
        /// The trace, a VCD file of `farnear-sim run --trace`.
        trace: PathBuf,
        /// The firmware; without it the one that lies beside this program.
        #[arg(long, value_name = "ELF")]
        firmware: Option<PathBuf>,
    },
    /// Count the instructions of the on-board routines: runs the counting firmware and prints its table.
    #[command(after_help = "Example:\n  farnear-sim count farnear-count.elf")]
    Count {
        /// The counting firmware, which `cargo xtask firmware` builds.
        elf: PathBuf,
    },
}

#[derive(Args)]
struct Run {
    /// What stands before the camera: plane:MM, staircase, slant, cone or sphere; or -, a scene file with its maps, packed on the
    /// standard input by `farnear rig ... --port sim` or `farnear serve --rig sim`.
    #[arg(long, default_value = standard::SCENE)]
    scene: SceneSource,
    /// The lens' blur: pillbox, gaussian:k=K or generalised:p=P,k=K.
    #[arg(long, default_value_t = standard::PSF)]
    psf: Psf,
    /// optics.toml of the rig; without it a 50 mm lens with its far focus at 933 mm.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// The camera's noise and bits: none, 8bit or 12bit.
    #[arg(long, default_value_t = standard::NOISE)]
    noise: Noise,
    /// Decides everything random; 1 unless it or the scenario says otherwise.
    #[arg(long)]
    seed: Option<u64>,
    /// The firmware; without it the one that lies beside this program.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// TOML file with what happens to the rig, when and how long (docs/hil.md). `farnear-campaign play` plays one
    /// with [[host]] steps.
    #[arg(long, visible_alias = "faults", value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// TOML file with what the parts are like where they differ from the standard rig's; `parts.toml` in the sources has all of
    /// it, with the source of each number.
    #[arg(long, value_name = "FILE")]
    parts: Option<PathBuf>,
    /// Let the board's time follow the wall clock, for a person who watches; without it time passes only while
    /// the board owes an answer or an event, and a run repeats to the byte.
    #[arg(long)]
    paced: bool,
    /// Keep the board's memory (settings, alarms, counters, programs) in this file between runs; it is made where it is
    /// missing, and written when the rig ends.
    #[arg(long, value_name = "FILE")]
    memory: Option<PathBuf>,
    /// Give the serial port this name too, a link that is removed at the end: a client finds a rig again that was started anew.
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Write what the mechanics really did to this file: CSV, or by the ending .vcd a value change dump that `replay` can
    /// make again.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Be a GigE Vision camera, too, on this network interface: lo, or an IPv4 address of this computer. Its identification stands in
    /// the line of JSON; `farnear camera list` finds it.
    #[arg(long, value_name = "INTERFACE", value_parser = gige::interface)]
    gige: Option<std::net::Ipv4Addr>,
    /// Set a half mirror behind the lens and a second camera in its other path, whose sensor stands so many micrometres further from
    /// the lens; without a number as far as near focus lies behind far focus. Each exposure gives a picture of both cameras, each with
    /// half of the light (`[half_mirror]` of the parts says otherwise). The second one's address stands in the line of JSON.
    #[arg(long, value_name = "UM", num_args = 0..=1, require_equals = true, default_missing_value = "near")]
    half_mirror: Option<Further>,
    /// So many of 1000 packets of the GigE Vision camera are lost.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "gige", value_parser = clap::value_parser!(u32).range(0..=1000))]
    gige_lost: u32,
}

/// Where the scene comes from.
#[derive(Clone)]
enum SceneSource {
    Named(Box<Scene>),
    /// A [`PackedScene`]; what follows it is of no interest, its end is.
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
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("farnear-sim: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn play_again(trace: &Path, firmware: Option<&Path>) -> Result<()> {
    let (end_ns, departure) = farnear_sim::replay::replay(trace, firmware)?;
    if let Some(departure) = departure {
        let line = |line: Option<String>| line.unwrap_or_else(|| "nothing more".into());
        anyhow::bail!(
            "the run departs from the trace at {:.6} s, line {} ({}): the trace has {:?}, the run now {:?}",
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

/// Prints a line per routine: instructions, units, unit, name; separated by tabs.
fn count(elf: &Path) -> Result<()> {
    let mut stdout = std::io::stdout();
    for count in farnear_sim::count::count(elf)? {
        writeln!(stdout, "{}\t{}\t{}\t{}", count.instructions, count.units, count.unit, count.routine)?;
    }
    Ok(())
}

/// The rig that was asked for. The command line's seed and parts go before the scenario's.
fn config(run: &Run) -> Result<RigConfig> {
    let scenario = run.scenario.as_deref().map(Scenario::read).transpose()?.unwrap_or_default();
    let own = scenario.parts().map_err(anyhow::Error::msg)?;
    Ok(RigConfig {
        firmware: run.firmware.clone(),
        seed: run.seed.or(scenario.seed).unwrap_or(standard::SEED),
        parts: run.parts.as_deref().map(Parts::read).transpose()?.unwrap_or(own),
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
    let linked = run.link.clone();
    let renamed = move |port: &str| {
        if let Some(Err(error)) = linked.as_deref().map(|path| Link::point(path, port)) {
            eprintln!("farnear-sim: {error:#}");
        }
        // Whoever read the first line may be gone.
        let _ = writeln!(std::io::stdout(), "{{\"port\": \"{port}\"}}");
    };
    let rig = ServedRig::start(&config, first, second, gige.as_ref(), renamed)?;
    let link = run.link.as_deref().map(|path| Link::new(path, &rig.port)).transpose()?;
    let port = link.as_ref().map_or(rig.port.clone(), |link| link.0.display().to_string());
    ctrlc::set_handler(rig.stopper()).context("cannot listen to signals")?;
    let stop = rig.stopper();
    if stdin_is_a_pipe() {
        std::thread::spawn(move || {
            // Whatever is written to it is of no interest; its end is.
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

/// Another name of the pty, which goes with this value.
struct Link(PathBuf);

impl Link {
    /// Makes the link. One that leads nowhere any more, left by a rig that was killed, is replaced; anything else stays.
    fn new(path: &Path, port: &str) -> Result<Self> {
        if path.is_symlink() && !path.exists() {
            std::fs::remove_file(path).with_context(|| format!("cannot replace {}", path.display()))?;
        }
        std::os::unix::fs::symlink(port, path)
            .with_context(|| format!("cannot make the link {} to {port}", path.display()))?;
        Ok(Self(path.into()))
    }

    /// Lets the link lead to another port; there is no moment without it.
    fn point(path: &Path, port: &str) -> Result<()> {
        let cannot = || format!("cannot let the link {} lead to {port}", path.display());
        let name = path.file_name().with_context(cannot)?.to_string_lossy();
        let other = path.with_file_name(format!(".{name}.{}", std::process::id()));
        std::os::unix::fs::symlink(port, &other).with_context(cannot)?;
        std::fs::rename(&other, path).with_context(cannot)
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0); // somebody may have removed it
    }
}

/// Whether somebody holds the other end of the standard input (a terminal or /dev/null has no such end).
fn stdin_is_a_pipe() -> bool {
    let stdin = std::io::stdin();
    let Ok(handle) = stdin.as_fd().try_clone_to_owned() else { return false };
    File::from(handle).metadata().is_ok_and(|data| {
        let kind = data.file_type();
        kind.is_fifo() || kind.is_socket()
    })
}
