//! The camera: when it may be triggered, and what its strobe says.
//!
//! The read-out of an exposure overlaps the next move, but the camera must not be triggered before it is over:
//! [`CameraSettings::readout`] after the end of the exposure. Known from the strobe; until that is in, from the
//! length of the trigger pulse and the longest answer a camera may take.

use farnear_protocol::{BoardMicros, Micros};

use crate::io::ExposureEdges;
use crate::settings::CameraSettings;

/// An ordered exposure whose edges are not in yet.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Pending {
    number: u32,
    deadline: BoardMicros,
}

/// The camera as the board knows it.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    settings: CameraSettings,
    ready_at: BoardMicros,
    triggers: u32,
    pending: Option<Pending>,
    order: Option<Micros>,
    edges: Option<(u32, ExposureEdges)>,
}

impl Camera {
    pub(crate) const fn new(settings: CameraSettings) -> Self {
        Self { settings, ready_at: BoardMicros(0), triggers: 0, pending: None, order: None, edges: None }
    }

    /// Triggers given since the reset.
    pub(crate) const fn triggers(&self) -> u32 {
        self.triggers
    }

    /// Whether it may be triggered.
    pub(crate) fn is_ready(&self, now: BoardMicros) -> bool {
        self.pending.is_none() && now >= self.ready_at
    }

    /// Orders an exposure; gives its number, from 0. The camera is ready.
    pub(crate) fn trigger(&mut self, exposure: Micros, now: BoardMicros) -> u32 {
        let number = self.triggers;
        self.triggers = self.triggers.wrapping_add(1);
        let end = now.0 + u64::from(exposure.0) + u64::from(self.settings.strobe_deadline.0);
        self.ready_at = BoardMicros(end + u64::from(self.settings.readout.0));
        self.pending = Some(Pending { number, deadline: BoardMicros(end) });
        self.order = Some(exposure);
        number
    }

    /// The exposure ordered in this tick, for the board.
    pub(crate) const fn take_order(&mut self) -> Option<Micros> {
        self.order.take()
    }

    /// Reads the board. Edges that nobody waits for are dropped.
    pub(crate) fn sense(&mut self, edges: Option<ExposureEdges>, now: BoardMicros) {
        self.edges = None;
        let Some(pending) = self.pending else { return };
        if let Some(edges) = edges {
            self.edges = Some((pending.number, edges));
            self.ready_at =
                BoardMicros(edges.strobe_end.0.saturating_add(u64::from(self.settings.readout.0)));
            self.pending = None;
        } else if now > pending.deadline {
            self.pending = None;
        }
    }

    /// The edges of an exposure, in the tick they came; an error once they should have come.
    pub(crate) fn result(&self, number: u32) -> Option<Result<ExposureEdges, NoAnswer>> {
        match self.edges {
            Some((of, edges)) if of == number => Some(Ok(edges)),
            _ if self.pending.is_some_and(|pending| pending.number == number) => None,
            _ => Some(Err(NoAnswer)),
        }
    }
}

/// The camera's exposure-active signal did not come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct NoAnswer;
