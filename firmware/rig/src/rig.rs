//! The rig as a whole: link and control tick.

use farnear_protocol::BoardMicros;
use farnear_protocol::frame::Encoded;
use heapless::Vec;

use crate::identity::Identity;
use crate::io::{Inputs, Outputs};

/// Everything the board does, without its hardware.
pub struct Rig {
    identity: Identity,
}

impl Rig {
    /// A rig that has just been reset, at `now`.
    pub const fn new(identity: Identity, _now: BoardMicros) -> Self {
        Self { identity }
    }

    /// Who it is.
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Takes one byte from the link.
    pub fn receive(&mut self, _byte: u8, _now: BoardMicros) {}

    /// The next frame for the link; the binary calls it until it gives `None`.
    pub fn transmit(&mut self) -> Option<Encoded> {
        None
    }

    /// One control tick; call it [`crate::io::TICK_HZ`] times a second.
    pub fn tick(&mut self, _inputs: &Inputs) -> Outputs {
        Outputs {
            piezo_dac: 0,
            enable: false,
            direction_away: false,
            abort_steps: false,
            segments: Vec::new(),
            trigger: None,
            reset: false,
        }
    }
}
