//! A client connected to the scripted board.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::Duration,
};

use farnear_capture::{Client, ClientError, Connect, Timing, Transport};
use farnear_protocol::{
    Call, Request,
    frame::Decoder,
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

/// A line that loses the next `left` requests of a kind.
struct Gap {
    line: Box<dyn Transport>,
    loses: fn(&Request) -> bool,
    left: Arc<AtomicU32>,
}

impl Transport for Gap {
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.line.receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8], wait: Duration) -> io::Result<()> {
        let mut decoder = Decoder::new();
        let mut calls = bytes
            .iter()
            .filter_map(|byte| decoder.push(*byte)?.ok())
            .filter_map(|packet| packet.message::<Call>());
        let left = self.left.load(Ordering::SeqCst);
        if left > 0 && calls.any(|call| (self.loses)(&call.request)) {
            self.left.store(left - 1, Ordering::SeqCst);
            return Ok(());
        }
        self.line.send(bytes, wait)
    }

    fn discard_input(&mut self) -> io::Result<()> {
        self.line.discard_input()
    }
}

/// Connects over lines that lose requests of a kind, as many as are stored in the number that is returned.
pub fn connect_with_gaps(peer: &Peer, loses: fn(&Request) -> bool) -> (Client, Arc<AtomicU32>) {
    let (mut connect, left) = (peer.connect(), Arc::new(AtomicU32::new(0)));
    let of_lines = Arc::clone(&left);
    let connect: Connect = Box::new(move || {
        let gap = Gap { line: connect()?, loses, left: Arc::clone(&of_lines) };
        Ok(Box::new(gap) as Box<dyn Transport>)
    });
    let client = Client::connect(connect, "scripted").unwrap();
    client.set_timing(SHORT);
    (client, left)
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
