//! A client connected to the scripted board.

use std::time::Duration;

use farnear_capture::{Client, ClientError, Timing};
use farnear_protocol::{
    message::{Axis, EventKind, Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};
use farnear_scripted_board::{Board, Faults, Peer};

/// Short timeouts for a board that answers immediately or never. Work tolerates scheduling.
pub const SHORT: Timing = Timing {
    reply: Duration::from_millis(20),
    retries: 3,
    poll: Duration::from_millis(10),
    work_factor: 0,
    work_slack: Duration::from_secs(20),
    keep_alive: Duration::from_secs(2),
};

/// As [`SHORT`], for work that never ends.
pub const OVERDUE_SOON: Timing = Timing { work_slack: Duration::from_millis(80), ..SHORT };

pub const SHOT: Shot = Shot {
    axis: Axis::SensorFine,
    target: Nanometres(10_000),
    exposure: Micros(1_000),
    settle_window: Nanometres(50),
    settle_dwell: Micros(1_000),
    repeat: 1,
    mode: TriggerMode::Hardware,
};

pub fn connect(faults: Faults) -> (Client, Peer) {
    let peer = Peer::new(faults);
    let client = Client::connect(peer.connect(), "scripted").unwrap();
    client.set_timing(SHORT);
    (client, peer)
}

pub fn connect_error(faults: Faults, change: impl FnOnce(&mut Board)) -> ClientError {
    let peer = Peer::new(faults);
    change(&mut peer.board());
    Client::connect(peer.connect(), "scripted").err().unwrap()
}

pub fn run_shots(
    client: &Client,
    shots: &[Shot],
    mut on_shot: impl FnMut(&ShotRecord) -> Result<(), ClientError>,
) -> Result<u16, ClientError> {
    client.run_program(shots, |kind| match kind {
        EventKind::ShotDone { shot, .. } => on_shot(shot),
        _ => Ok(()),
    })
}
