//! The board's events in order, and their relation to work.

use std::collections::BTreeMap;

use farnear_protocol::{
    Event,
    frame::Packet,
    message::{EventKind, Status},
};

use crate::error::ClientError;

/// Limit for event numbers ahead of the next one; a board stores fewer.
const AHEAD_MAX: u32 = 4096;

#[derive(Default)]
pub(crate) struct Events {
    pub boot: u32,
    pub due: u32,
    /// Arrived, not delivered.
    pub arrived: BTreeMap<u32, Event>,
}

impl Events {
    /// An event of another boot means a reset.
    pub(crate) fn take(&mut self, packet: &Packet, during: &str) -> Result<(), ClientError> {
        let event = packet.message::<Event>();
        if packet.header.boot != self.boot {
            let cause = match event {
                Some(Event { kind: EventKind::Started { cause }, .. }) => Some(cause),
                _ => None,
            };
            let (was, now) = (self.boot, packet.header.boot);
            return Err(ClientError::Reset { during: during.into(), was, now, cause });
        }
        let event = event.ok_or_else(|| ClientError::Nonsense {
            during: during.into(),
            answer: format!("event {:02x?}", packet.body.as_slice()),
        })?;
        if packet.header.id.wrapping_sub(self.due) < AHEAD_MAX {
            self.arrived.insert(packet.header.id, event);
        }
        Ok(())
    }

    pub(crate) fn pop(&mut self) -> Option<Event> {
        let event = self.arrived.remove(&self.due)?;
        self.due += 1;
        Some(event)
    }
}

/// Whether the board still works on this request; in a program or routine not every axis names it.
pub(crate) fn is_under_way(request: u32, status: &Status) -> bool {
    use farnear_protocol::message::ProgramState::{Paused, Running};
    let axes = [&status.coarse, &status.fine, &status.lens];
    axes.iter().any(|axis| axis.request == Some(request) || axis.moving)
        || matches!(status.program.state, Running | Paused)
}

/// The request of an event, and whether it ends it.
pub(crate) fn request_of(kind: &EventKind) -> Option<(u32, bool)> {
    match *kind {
        EventKind::ShotDone { request, .. }
        | EventKind::FrameTaken { request, .. }
        | EventKind::FrameDropped { request, .. }
        | EventKind::ShotReady { request, .. }
        | EventKind::Flash { request, .. }
        | EventKind::Paused { request, .. }
        | EventKind::StillThere { request } => Some((request, false)),
        _ => kind.ended().map(|request| (request, true)),
    }
}
