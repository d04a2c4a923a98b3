//! Commands to a running rig from other threads, and its outputs.

use std::sync::{Arc, mpsc::Sender};

use crate::{access::RigAccess, observer::Sight, pictures::Pictures, report::Report, wiring::Shot};

pub type Work = Box<dyn FnOnce(&mut RigAccess<'_, '_>) + Send>;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CameraOrder {
    Expose {
        exposure_us: u64,
        id: u32,
    },
    /// Period 0 stops free running.
    FreeRun {
        period_us: u64,
        exposure_us: u64,
    },
}

impl CameraOrder {
    pub fn give(self, rig: &mut RigAccess<'_, '_>) {
        match self {
            Self::Expose { exposure_us, id } => rig.expose(exposure_us, id),
            Self::FreeRun { period_us, exposure_us } => rig.run_camera_freely(period_us, exposure_us),
        }
    }
}

pub enum Command {
    Bytes(Vec<u8>),
    HostRate(u32),
    Advance {
        nanos: u64,
        /// Receives the report when the time has passed.
        done: Sender<Report>,
    },
    /// Runs until no answer or event is outstanding.
    Settle {
        done: Sender<Report>,
    },
    Access(Work),
    /// Counts as activity of the rig's host.
    Camera(CameraOrder),
    Heal,
    Sights {
        done: Sender<Vec<Sight>>,
    },
    End,
}

/// Replaces the port and returns the sender for its bytes; `None` where that fails.
pub type AnotherPort = Box<dyn FnMut() -> Option<Sender<Vec<u8>>> + Send>;

pub struct Outlets {
    /// Bytes for the host; dropped when the port closes.
    pub bytes: Option<Sender<Vec<u8>>>,
    /// Simulates an adapter that reappears under a new name; `None` without a port.
    pub another_port: Option<AnotherPort>,
    pub shots: Sender<Shot>,
    /// `None` renders on the same thread.
    pub pictures: Option<Arc<Pictures>>,
}
