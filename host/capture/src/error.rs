//! What can go wrong between this program and the rig, each with what was seen and what to do.

use std::{sync::Arc, time::Duration};

use farnear_protocol::{
    RequestError,
    message::{AlarmRecord, Axis, Failure, LinkRate, ResetCause},
};

use crate::describe::{axis_name, cause_name, failure_text, refusal_text};

/// The port could not be opened.
#[derive(Clone, Debug, thiserror::Error)]
pub enum PortError {
    /// There is no such port.
    #[error("there is no port {port}; {}", present_ports(present))]
    Absent {
        port: String,
        /// What the system lists.
        present: Vec<String>,
    },
    /// The board was there and has not come back under this name.
    #[error(
        "the board has not come back as {port}; if it has another name now, start again with that one, or with one that stays: on \
         Linux its link in /dev/serial/by-id, for farnear-sim that of --link; {}",
        present_ports(present)
    )]
    NotBack {
        /// The name that it had.
        port: String,
        /// What the system lists.
        present: Vec<String>,
    },
    /// No port was named, and none belongs to a board.
    #[error("no board was found: no ST-LINK has a serial port; {}", present_ports(present))]
    NoBoard {
        /// What the system lists.
        present: Vec<String>,
    },
    /// No port was named, and more than one belongs to a board.
    #[error("several boards are plugged in: {}", ports.join(", "))]
    SeveralBoards { ports: Vec<String> },
    /// The link does not have the rate that was asked for.
    #[error("{port} is asked for {rate} baud, but the link has {} baud", rates())]
    Rate { port: String, rate: String },
    /// The path leads to something else.
    #[error("{port} is not a serial port")]
    NoPort { port: String },
    /// Another program holds it.
    #[error(
        "port {port} is busy: another program holds it; end that program (a terminal, another farnear) first"
    )]
    Busy { port: String },
    /// The user may not open it.
    #[error(
        "no permission to open {port}; on Linux, add yourself to its group (often `dialout`) and log in again"
    )]
    Denied { port: String },
    #[error("cannot open port {port}: {reason}")]
    Open {
        port: String,
        /// What the system says.
        reason: String,
    },
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

fn unique_id_text(id: &[u8; 12]) -> String {
    id.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A conversation with a board failed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ClientError {
    /// The port could not be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The port broke off: unplugged, or the program behind it ended.
    #[error(
        "port {port} went away while {during}; plug the board in again and check its cable ({source}); what was moving is \
         stopped by the board's keep-alive timeout"
    )]
    Gone {
        port: String,
        during: String,
        /// What the system says.
        source: Arc<std::io::Error>,
    },
    /// Another host has opened a session with this board: what this one had begun there was stopped.
    #[error(
        "another program has taken the board on {port} over while {during}; what was moving has stopped; end that program, or \
         connect again"
    )]
    TakenOver { port: String, during: String },
    /// The line is there again, and another board is at its end.
    #[error(
        "another board is on {port} now (unique id {}) than before ({}): nothing was asked of it; plug the first one in again, or \
         start this program anew for the other",
        unique_id_text(now),
        unique_id_text(was)
    )]
    OtherBoard {
        port: String,
        /// The board that was there.
        was: [u8; 12],
        /// The board that is there.
        now: [u8; 12],
    },
    /// No answer came in time, however often it was asked.
    #[error(
        "no answer from {port} while {during}: asked {attempts} times within {waited:?}, the last time after the port was opened anew{}",
        what_came(*bad_frames, *bytes)
    )]
    Silent {
        port: String,
        during: String,
        /// How often it was asked.
        attempts: u32,
        /// How long it took altogether.
        waited: Duration,
        /// Broken frames that came instead.
        bad_frames: u64,
        /// Bytes that came instead.
        bytes: u64,
    },
    /// Board and host share no protocol version.
    #[error(
        "the board speaks protocol {board_min} to {board_current}, this program {host_min} to {host_current}; {}",
        if board_min > host_current { "use a newer farnear" } else { "flash the firmware that belongs to this farnear" }
    )]
    Version {
        /// Oldest version of the board.
        board_min: u8,
        /// Newest version of the board.
        board_current: u8,
        /// Oldest version of this program.
        host_min: u8,
        /// Newest version of this program.
        host_current: u8,
    },
    /// Same protocol number, other message table: one of the two is a development build.
    #[error(
        "board (firmware {firmware}) and this program (farnear {host}) both say protocol {version}, but their message tables \
         differ (schema key {board_key:016x} against {host_key:016x}); flash the firmware built from the same sources"
    )]
    Schema {
        /// The version both claim.
        version: u8,
        /// Firmware version of the board.
        firmware: String,
        /// Version of this program.
        host: &'static str,
        /// The board's key.
        board_key: u64,
        /// This program's key.
        host_key: u64,
    },
    /// The answer is none that fits the request.
    #[error("the board's answer while {during} makes no sense: {answer}")]
    Nonsense { during: String, answer: String },
    /// The board refused; nothing has changed.
    #[error("the board refused {during}: {}", refusal_text(error))]
    Refused {
        during: String,
        /// The board's reason.
        error: RequestError,
    },
    /// The board started anew in mid-session.
    #[error(
        "the board was reset while {during} (boot {was} became {now}{}); what was under way is interrupted, and positions \
         are unknown until it is homed again",
        cause.map(|cause| format!(", cause: {}", cause_name(cause))).unwrap_or_default()
    )]
    Reset {
        during: String,
        /// Boot number of the session.
        was: u32,
        now: u32,
        /// Why, as far as the board said.
        cause: Option<ResetCause>,
    },
    /// Long work ended early.
    #[error("{during} failed{}: {}", axis.map(|axis| format!(" on the {}", axis_name(axis))).unwrap_or_default(), failure_text(*reason, alarm.as_ref()))]
    Failed {
        during: String,
        axis: Option<Axis>,
        /// The board's reason.
        reason: Failure,
        /// The alarm that it names.
        alarm: Option<AlarmRecord>,
    },
    /// The work took longer than it possibly should; the board was told to stop.
    #[error("{during} did not end within {allowed:?}; the rig was told to stop")]
    Overdue { during: String, allowed: Duration },
    /// Events were lost and the board no longer remembers them.
    #[error("events {from} to {to} of the board were lost while {during} and it no longer remembers them")]
    EventsLost { during: String, from: u32, to: u32 },
    /// The board says that it is not working on the request, yet no event said how it ended.
    #[error("the board is no longer {during}, but never said how it ended")]
    NoEnd { during: String },
    /// More shots than the board's program can hold.
    #[error("a program of {shots} shots, the board can hold {max}; use repeats, or run it in parts")]
    TooManyShots {
        shots: usize,
        /// What the board can hold.
        max: u8,
    },
    /// No program was armed.
    #[error("no exposure program is armed")]
    NotArmed,
    /// The user interrupted; the board was told to stop.
    #[error("interrupted while {during}; the rig was stopped")]
    Interrupted { during: String },
}

fn what_came(bad_frames: u64, bytes: u64) -> String {
    match (bad_frames, bytes) {
        (_, 0) => "; nothing at all came: is it the right port, and is the board powered?".into(),
        (0, bytes) => format!("; {bytes} bytes came, but no frame: is it the right port?"),
        (frames, bytes) => {
            format!(
                "; {bytes} bytes with {frames} broken frames came: is it the right port, is the line disturbed?"
            )
        }
    }
}
