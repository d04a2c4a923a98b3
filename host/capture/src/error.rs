//! Errors between this program and the rig, with values and remedies.

use std::{sync::Arc, time::Duration};

use farnear_protocol::{
    RequestError,
    message::{AlarmRecord, Axis, Failure, LinkRate, ResetCause},
};

use crate::{
    describe::{axis_name, cause_name, failure_text, refusal_text},
    transport::SCHEME,
};

#[derive(Clone, Debug, thiserror::Error)]
pub enum PortError {
    #[error(
        "the name of the port is empty: give one, or leave it out for the only board; {}",
        present_ports(present)
    )]
    Nameless { present: Vec<String> },
    #[error("port {port} does not exist{}; {}", tcp_hint(port), present_ports(present))]
    Absent { port: String, present: Vec<String> },
    #[error(
        "the board has not come back as {port}; if it has another name now, start again with that one, or with one that stays: on \
         Linux its link in /dev/serial/by-id, for farnear-sim that of --link; {}",
        present_ports(present)
    )]
    NotBack { port: String, present: Vec<String> },
    #[error("no board was found: no ST-LINK has a serial port; {}", present_ports(present))]
    NoBoard { present: Vec<String> },
    #[error("several boards are plugged in: {}", ports.join(", "))]
    SeveralBoards { ports: Vec<String> },
    #[error("{port}: {rate} baud requested, but the link supports {} baud", rates())]
    Rate { port: String, rate: String },
    #[error("TCP has no baud rate: set that of {port} at the serial server and omit it here")]
    TcpRate { port: String },
    #[error(
        "cannot connect to {port}: {reason}; expected tcp:HOST:PORT of a running farnear-sim or serial server"
    )]
    Connect { port: String, reason: String },
    #[error("{port} is not a serial port; expected one such as /dev/ttyACM0, or tcp:HOST:PORT")]
    NoPort { port: String },
    #[error("port {port} is busy: another program (a terminal, another farnear) holds it; end that program")]
    Busy { port: String },
    #[error(
        "no permission to open {port}; on Linux, add yourself to its group (often `dialout`) and log in again"
    )]
    Denied { port: String },
    #[error(
        "cannot open port {port}: {reason}; expected a serial port such as /dev/ttyACM0, or tcp:HOST:PORT"
    )]
    Open { port: String, reason: String },
}

fn rates() -> String {
    LinkRate::ALL.map(|rate| rate.baud().to_string()).join(" or ")
}

fn present_ports(present: &[String]) -> String {
    match present {
        [] => "no serial port is present at all: is the board plugged in?".into(),
        ports => format!("present are: {}", ports.join(", ")),
    }
}

/// For an address without its scheme.
fn tcp_hint(port: &str) -> String {
    let is_address = |(host, number): (&str, &str)| !host.contains('/') && number.parse::<u16>().is_ok();
    match port.rsplit_once(':').is_some_and(is_address) {
        true => format!(" (expected tcp:{port} for a TCP port)"),
        false => String::new(),
    }
}

fn what_to_check(port: &str) -> &'static str {
    match port.starts_with(SCHEME) {
        true => {
            "check that a farnear-sim or serial server listens there, and that no other program is connected to it"
        }
        false => "plug the board in again and check its cable",
    }
}

fn unique_id_text(id: &[u8; 12]) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[derive(Clone, Debug, thiserror::Error)]
pub enum ClientError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(
        "port {port} went away while {during}; {} ({source}); motion is stopped by the board's keep-alive timeout",
        what_to_check(port)
    )]
    Gone { port: String, during: String, source: Arc<std::io::Error> },
    #[error(
        "another program took over the board on {port} while {during}; any motion has stopped; end that program, or \
         connect again"
    )]
    TakenOver { port: String, during: String },
    #[error(
        "another board is on {port} now (unique id {}) than before ({}): nothing was asked of it; plug the first one in again, or \
         start this program anew for the other",
        unique_id_text(now),
        unique_id_text(was)
    )]
    OtherBoard { port: String, was: [u8; 12], now: [u8; 12] },
    #[error(
        "no answer from {port} while {during}: asked {attempts} times within {waited:?}, the last time after reopening the port{}",
        what_came(*bad_frames, *bytes)
    )]
    Silent { port: String, during: String, attempts: u32, waited: Duration, bad_frames: u64, bytes: u64 },
    #[error(
        "the board speaks protocol {board_min} to {board_current}, this program {host_min} to {host_current}; {}",
        if board_min > host_current { "use a newer farnear" } else { "flash the firmware that belongs to this farnear" }
    )]
    Version { board_min: u8, board_current: u8, host_min: u8, host_current: u8 },
    /// Equal version numbers with different message tables: one is a development build.
    #[error(
        "board (firmware {firmware}) and this program (farnear {host}) both say protocol {version}, but their message tables \
         differ (schema key {board_key:016x} against {host_key:016x}); flash the firmware built from the same sources"
    )]
    Schema { version: u8, firmware: String, host: &'static str, board_key: u64, host_key: u64 },
    #[error("the board's answer while {during} makes no sense: {answer}")]
    Nonsense { during: String, answer: String },
    #[error("the board refused {during}: {}", refusal_text(error))]
    Refused { during: String, error: RequestError },
    #[error(
        "the board was reset while {during} (boot {was} became {now}{}); its work was interrupted, and positions \
         are unknown until it is homed again",
        cause.map(|cause| format!(", cause: {}", cause_name(cause))).unwrap_or_default()
    )]
    Reset { during: String, was: u32, now: u32, cause: Option<ResetCause> },
    #[error("{during} failed{}: {}", axis.map(|axis| format!(" on the {}", axis_name(axis))).unwrap_or_default(), failure_text(*reason, alarm.as_ref()))]
    Failed { during: String, axis: Option<Axis>, reason: Failure, alarm: Option<AlarmRecord> },
    #[error("{during} did not end within {allowed:?}; the rig was stopped")]
    Overdue { during: String, allowed: Duration },
    #[error("events {from} to {to} of the board were lost while {during} and it no longer remembers them")]
    EventsLost { during: String, from: u32, to: u32 },
    #[error("the board is no longer {during}, but no event reported the end")]
    NoEnd { during: String },
    #[error("a program of {shots} shots, the board can hold {max}; use repeats, or run it in parts")]
    TooManyShots { shots: usize, max: u8 },
    #[error("no exposure program is armed")]
    NotArmed,
    #[error(
        "interrupted while {during}{}",
        if *stopped { "; the rig was stopped" } else { ", without an answer of the board: its keep-alive timeout ends any motion" }
    )]
    Interrupted {
        during: String,
        /// Whether the board has answered since.
        stopped: bool,
    },
}

fn what_came(bad_frames: u64, bytes: u64) -> String {
    match (bad_frames, bytes) {
        (_, 0) => "; nothing at all came: is it the right port, and is the board powered? An emulated one may be stopped (Ctrl-Z) or \
                   its computer too busy"
            .into(),
        (0, bytes) => format!("; {bytes} bytes came, but no frame: is it the right port?"),
        (frames, bytes) => {
            format!(
                "; {bytes} bytes with {frames} broken frames came: is it the right port, is the line disturbed?"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remedy_suits_the_kind_of_port() {
        let absent = |port: &str| PortError::Absent { port: port.into(), present: Vec::new() }.to_string();
        assert!(absent("127.0.0.1:5000").contains("expected tcp:127.0.0.1:5000"));
        assert!(!absent("/dev/serial/by-path/pci-0:1").contains("tcp:"));
        let gone = |port: &str| {
            let source = Arc::new(std::io::ErrorKind::UnexpectedEof.into());
            ClientError::Gone { port: port.into(), during: "homing".into(), source }.to_string()
        };
        assert!(gone("/dev/ttyACM0").contains("check its cable"));
        let closed = gone("tcp:localhost:5000");
        assert!(
            closed.contains("a farnear-sim or serial server listens there") && !closed.contains("cable"),
            "{closed}"
        );
    }
}
