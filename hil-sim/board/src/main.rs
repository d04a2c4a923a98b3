//! `farnear-sim`: the emulated rig for any client.

use std::{
    fs::File,
    io::Write,
    os::{fd::AsFd, unix::fs::FileTypeExt},
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use farnear_scene::{Camera, Lens, Noise, OpticsFile, Psf, Scene, standard};
use farnear_sim::{
    Pace, Parts, RigConfig,
    faults::Faults,
    gige::{self, GigeConfig},
    imager::Imager,
    run::ServedRig,
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
    /// Start the rig; prints one line of JSON with its serial port and its camera's address, and runs until
    /// it is interrupted or, where its standard input is a pipe, until that is closed.
    #[command(after_help = "Example:\n  \
        farnear-sim run --scene staircase --psf gaussian:k=0.4578 --noise 8bit --seed 1\n  \
        {\"port\": \"/dev/pts/3\", \"camera\": \"127.0.0.1:40123\"}")]
    Run(Box<Run>),
    /// Count the instructions of the on-board routines: runs the counting firmware and prints its table.
    #[command(after_help = "Example:\n  farnear-sim count farnear-count.elf")]
    Count {
        /// The counting firmware, which `cargo xtask firmware` builds.
        elf: PathBuf,
    },
}

#[derive(Args)]
struct Run {
    /// What stands before the camera: plane:MM, staircase, slant, cone or sphere.
    #[arg(long, default_value = standard::SCENE)]
    scene: Scene,
    /// The lens' blur: pillbox, gaussian:k=K or generalised:p=P,k=K.
    #[arg(long, default_value_t = standard::PSF)]
    psf: Psf,
    /// optics.toml of the rig; without it a 50 mm lens with its far focus at 933 mm.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// The camera's noise and bits: none, 8bit or 12bit.
    #[arg(long, default_value_t = standard::NOISE)]
    noise: Noise,
    /// Decides everything random.
    #[arg(long, default_value_t = standard::SEED)]
    seed: u64,
    /// The firmware; without it the one that lies beside this program.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// TOML file with faults: bit_error_rate, garbage, unplug_after_ms, and [[happens]] tables (after_ms, what, stage), e.g.
    /// what = "emergency-stop", "power-loss" or "motor-stalls"; a wrong one is answered with all of them.
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
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
    /// Write what the mechanics really did to this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Be a GigE Vision camera, too, on this network interface: lo, or an IPv4 address of this computer. Its identification stands in
    /// the line of JSON; `farnear camera list` finds it.
    #[arg(long, value_name = "INTERFACE", value_parser = gige::interface)]
    gige: Option<std::net::Ipv4Addr>,
    /// So many of 1000 packets of the GigE Vision camera are lost.
    #[arg(long, value_name = "N", default_value_t = 0, requires = "gige", value_parser = clap::value_parser!(u32).range(0..=1000))]
    gige_lost: u32,
}

fn main() -> ExitCode {
    let done = match Program::parse().job {
        Job::Run(run) => serve(&run),
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

/// Prints a line per routine: instructions, units, unit, name; separated by tabs.
fn count(elf: &Path) -> Result<()> {
    let mut stdout = std::io::stdout();
    for count in farnear_sim::count::count(elf)? {
        writeln!(stdout, "{}\t{}\t{}\t{}", count.instructions, count.units, count.unit, count.routine)?;
    }
    Ok(())
}

fn serve(run: &Run) -> Result<()> {
    let optics = match &run.optics {
        Some(path) => {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            OpticsFile::parse(&text).with_context(|| path.display().to_string())?
        }
        None => OpticsFile::parse(standard::OPTICS)?,
    };
    let lens = Lens::from_optics(&optics)?;
    let camera = Camera::new(standard::SIZE_PX.0, standard::SIZE_PX.1, run.noise);
    let imager = Imager::new(&run.scene, &lens, &run.psf, camera, run.seed)?;
    let config = RigConfig {
        firmware: run.firmware.clone(),
        seed: run.seed,
        parts: run.parts.as_deref().map(Parts::read).transpose()?.unwrap_or_default(),
        costs_by_kind: false,
        faults: run.faults.as_deref().map(Faults::read).transpose()?.unwrap_or_default(),
        pace: if run.paced { Pace::Realtime } else { Pace::Lockstep },
        memory: run.memory.clone(),
        trace: run.trace.clone(),
    };
    let gige = run.gige.map(|address| GigeConfig {
        address,
        seed: run.seed,
        lost_per_thousand: run.gige_lost,
        sensor_px: (standard::SIZE_PX.0 as u16, standard::SIZE_PX.1 as u16),
        bits: run.noise.bits(),
    });
    let rig = ServedRig::start(&config, imager, gige.as_ref())?;
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
    writeln!(stdout, "{{\"port\": \"{port}\", \"camera\": \"{}\"{gige}}}", rig.camera)?;
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
