//! What a running rig can be asked from other threads, and where it puts what comes out of it.

use std::sync::{Arc, mpsc::Sender};

use crate::{access::RigAccess, observer::Sight, pictures::Pictures, report::Report, wiring::Shot};

/// Work to be done on a rig between two instructions.
pub type Work = Box<dyn FnOnce(&mut RigAccess<'_, '_>) + Send>;

/// What the camera's host can ask of the camera.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CameraOrder {
    Expose {
        exposure_us: u64,
        /// The image's name.
        id: u32,
    },
    /// Run freely, or (period 0) stop that.
    FreeRun {
        /// From one exposure to the next.
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

/// What the rig can be asked.
pub enum Command {
    /// Put bytes on the line to the board.
    Bytes(Vec<u8>),
    /// The host's end of the line has this rate from now on, in baud.
    HostRate(u32),
    /// Let this much time pass.
    Advance {
        nanos: u64,
        /// Told when it has passed.
        done: Sender<Report>,
    },
    /// Let time pass until the board owes nothing.
    Settle {
        done: Sender<Report>,
    },
    /// Do something with the rig between two instructions.
    Access(Work),
    /// Something that the camera's host asks of the camera; the host of the rig has spoken.
    Camera(CameraOrder),
    /// Take back what the scenario did to the rig; nothing more of it happens.
    Heal,
    /// Give what was seen since the last time.
    Sights {
        done: Sender<Vec<Sight>>,
    },
    End,
}

/// Opens another port in place of the one that there is, and gives where its bytes go; `None` where it cannot be.
pub type AnotherPort = Box<dyn FnMut() -> Option<Sender<Vec<u8>>> + Send>;

/// Where bytes and exposures go that come out of the rig.
pub struct Outlets {
    /// Bytes for the host, as the line delivers them; dropped when the port goes away.
    pub bytes: Option<Sender<Vec<u8>>>,
    /// For an adapter that comes back under another name; `None` where there is no port.
    pub another_port: Option<AnotherPort>,
    /// Exposures, when they end.
    pub shots: Sender<Shot>,
    /// What becomes of their pictures, where these are rendered beside the board.
    pub pictures: Option<Arc<Pictures>>,
}
