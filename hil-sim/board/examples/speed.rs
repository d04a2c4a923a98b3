//! Speed of the emulated rig in board seconds per CPU second; Linux only. "Cold" includes translating the firmware.
//!
//! `cargo run --release --ignore-rust-version -p farnear-sim --example speed` after `cargo xtask firmware`.

mod common;

use std::time::Duration;

use farnear_protocol::{
    Call, EventKind, Micros, Nanometres, PROTOCOL_CURRENT, Request,
    frame::{Header, Kind, encode},
    message::Axis,
};
use farnear_sim::{EmulatedRig, RigConfig, SimError, cpu_time::cpu_time as cpu};

const SESSION: u32 = 1;
const SILENCE: Micros = Micros(60_000_000);

struct Host {
    rig: EmulatedRig,
    id: u32,
}

impl Host {
    fn send(&mut self, request: Request) -> Result<(), SimError> {
        self.id += 1;
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: self.id, boot: 1 };
        let frame = encode(header, &Call { session: SESSION, request });
        self.rig.send(&frame.unwrap_or_default())
    }

    fn measure(
        &mut self,
        what: &str,
        work: impl FnOnce(&mut Self) -> Result<(), SimError>,
    ) -> Result<(), SimError> {
        let (begin, begin_ns) = (cpu(), self.rig.report()?.now_ns);
        work(self)?;
        let (cpu, board_ns) = (cpu().saturating_sub(begin), self.rig.report()?.now_ns - begin_ns);
        let board = Duration::from_nanos(board_ns);
        println!(
            "{what:12} {:7.2} s of the board in {:6.2} s of CPU: {:.2}",
            board.as_secs_f64(),
            cpu.as_secs_f64(),
            board.as_secs_f64() / cpu.as_secs_f64()
        );
        let ends = self.rig.take_frames();
        let failed = ends.iter().filter_map(|packet| packet.message::<farnear_protocol::Event>());
        for event in failed.filter(|event| matches!(event.kind, EventKind::Failed { .. })) {
            println!("  {event:?}");
        }
        Ok(())
    }

    fn settle(&mut self) -> Result<(), SimError> {
        self.rig.settle().map(|_| ())
    }
}

fn moves(host: &mut Host) -> Result<(), SimError> {
    for target in [9_000_000, 2_000_000] {
        for axis in [Axis::SensorCoarse, Axis::Lens] {
            host.send(Request::Move { axis, target: Nanometres(target), silence: SILENCE })?;
        }
        host.settle()?;
    }
    Ok(())
}

fn captures(host: &mut Host) -> Result<(), SimError> {
    for (index, shot) in (0..).zip(common::far_and_near()) {
        host.send(Request::LoadShot { index, shot })?;
    }
    host.send(Request::ArmProgram { shots: 2 })?;
    for _ in 0..10 {
        host.send(Request::RunProgram { silence: SILENCE })?;
        host.settle()?;
    }
    Ok(())
}

fn main() -> Result<(), SimError> {
    let mut host = Host { rig: EmulatedRig::new(&RigConfig::default())?, id: 0 };
    println!("start      {:.2} s of CPU", cpu().as_secs_f64());
    host.send(Request::OpenSession)?;
    host.settle()?;
    println!("answer     {:.2} s of CPU", cpu().as_secs_f64());
    host.measure("idle, cold", |host| host.rig.advance_us(1_000_000).map(|_| ()))?;
    host.measure("idle", |host| host.rig.advance_us(5_000_000).map(|_| ()))?;
    host.measure("homing", |host| {
        for axis in [Axis::SensorCoarse, Axis::Lens] {
            host.send(Request::Home { axis, silence: SILENCE })?;
        }
        host.settle()
    })?;
    host.measure("moves, cold", moves)?;
    host.measure("moves", moves)?;
    host.measure("captures", captures)?;
    host.measure("held", |host| host.rig.advance_us(10_000_000).map(|_| ()))
}
