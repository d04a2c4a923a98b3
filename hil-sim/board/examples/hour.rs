//! Measures run time and memory of one hour of board time with a far/near pair every ten seconds.
//!
//! `cargo run --release --ignore-rust-version -p farnear-sim --example hour [PAIRS]` after `cargo xtask
//! firmware`; Linux only, because of the memory figure.

mod common;

use std::time::Instant;

use anyhow::{Context, Result, ensure};
use farnear_protocol::{
    Call, Event, EventKind, Micros, Nanometres, PROTOCOL_CURRENT, Request,
    frame::{Header, Kind, encode},
    message::Axis,
};
use farnear_scene::{Camera, Lens, OpticsFile, standard};
use farnear_sim::{EmulatedRig, RigConfig, cpu_time::cpu_time, imager::Imager};

const SESSION: u32 = 1;
const SILENCE: Micros = Micros(60_000_000);
const EVERY_NS: u64 = 10_000_000_000;

struct Host {
    rig: EmulatedRig,
    id: u32,
}

impl Host {
    /// Sends a request and runs until the rig is idle.
    fn ask(&mut self, request: Request) -> Result<()> {
        self.id += 1;
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: self.id, boot: 1 };
        let frame = encode(header, &Call { session: SESSION, request });
        self.rig.send(&frame.context("the request has no frame")?)?;
        self.rig.settle()?;
        Ok(())
    }

    fn programs(&mut self) -> Result<u32> {
        let mut ended = 0;
        for packet in self.rig.take_frames() {
            match packet.message::<Event>().map(|event| event.kind) {
                Some(EventKind::ProgramDone { exposures: 2, .. }) => ended += 1,
                Some(kind @ (EventKind::Failed { .. } | EventKind::Alarm(_))) => anyhow::bail!("{kind:?}"),
                _ => {}
            }
        }
        Ok(ended)
    }
}

fn memory_mib() -> Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS")?;
    Ok(line.trim().trim_end_matches(" kB").parse::<f64>()? / 1024.0)
}

fn main() -> Result<()> {
    let pairs: u64 = std::env::args().nth(1).map_or(Ok(360), |text| text.parse())?;
    let begin = Instant::now();
    let lens = Lens::from_optics(&OpticsFile::parse(standard::OPTICS)?)?;
    let scene = "staircase".parse()?;
    let mut imager = Imager::new(&scene, &lens, &standard::PSF, Camera::default(), 1)?;
    let mut host = Host { rig: EmulatedRig::new(&RigConfig::default())?, id: 0 };
    host.ask(Request::OpenSession)?;
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        host.ask(Request::Home { axis, silence: SILENCE })?;
    }
    for (index, shot) in (0..).zip(common::far_and_near()) {
        host.ask(Request::LoadShot { index, shot })?;
    }
    host.ask(Request::ArmProgram { shots: 2 })?;
    // The position at the first exposure gives the offset of the stage from far focus.
    host.ask(Request::RunProgram { silence: SILENCE })?;
    let first = host.rig.take_shots().into_iter().next().context("nothing was exposed")?;
    let target = Nanometres((1e6 * (lens.sensor_far_mm - first.truth.sensor_mm)).round() as i32);
    host.ask(Request::Move { axis: Axis::SensorCoarse, target, silence: SILENCE })?;
    host.programs()?;
    let (first_ns, mut pictures) = (host.rig.report()?.now_ns, 0);
    println!("{:>6} {:>8} {:>8} {:>8} {:>8}", "pair", "board s", "wall s", "CPU s", "MiB");
    for pair in 0..pairs {
        host.ask(Request::RunProgram { silence: SILENCE })?;
        ensure!(host.programs()? == 1, "pair {pair} was not taken");
        for shot in host.rig.take_shots() {
            imager.frame(&shot)?;
            pictures += 1;
        }
        let (now_ns, next_ns) = (host.rig.report()?.now_ns, first_ns + (pair + 1) * EVERY_NS);
        host.rig.advance_us(next_ns.saturating_sub(now_ns) / 1_000)?;
        if pair % 30 == 0 || pair + 1 == pairs {
            let board_s = 1e-9 * (host.rig.report()?.now_ns - first_ns) as f64;
            let (wall_s, cpu_s) = (begin.elapsed().as_secs_f64(), cpu_time().as_secs_f64());
            println!("{:>6} {board_s:>8.1} {wall_s:>8.1} {cpu_s:>8.1} {:>8.1}", pair + 1, memory_mib()?);
        }
    }
    println!("{pictures} pictures");
    Ok(())
}
