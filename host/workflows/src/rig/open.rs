//! A rig that stays open between jobs ([`RigAddress::Open`]): status, stop and job share one port, whose owner
//! serialises requests of several threads. A stop does not wait for the running job.

use std::{
    fmt,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use farnear_capture::Client;

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::Result,
    optics::GivenOptics,
    simulator::{Scenery, Simulator},
};

/// A connected rig shared by several threads. The last owner closes it.
#[derive(Clone)]
pub struct OpenRig(Arc<Held>);

struct Held {
    name: String,
    client: Mutex<Client>,
    // Dropped after the client.
    emulation: Option<(Arc<Simulator>, Scenery)>,
}

impl fmt::Debug for OpenRig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("OpenRig").field(&self.0.name).finish()
    }
}

impl PartialEq for OpenRig {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl OpenRig {
    /// Connects and stays connected. An emulated rig uses the lens of `optics`.
    pub fn open(address: &RigAddress, optics: &GivenOptics, context: &Context<'_>) -> Result<Self> {
        if let RigAddress::Open(open) = address {
            return Ok(open.clone());
        }
        let Rig { client, emulation } = Rig::connect(address, Some(optics.for_emulation()), context)?;
        let name = match address {
            RigAddress::Port(port) => port.clone(),
            RigAddress::Attached => "the board".into(),
            RigAddress::Emulated(_) | RigAddress::Open(_) => "the emulated rig".into(),
        };
        Ok(Self(Arc::new(Held { name, client: Mutex::new(client), emulation })))
    }

    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Whether this program started it as an emulated rig.
    pub fn is_emulated(&self) -> bool {
        self.0.emulation.is_some()
    }

    pub fn scenery(&self) -> Option<&Scenery> {
        self.0.emulation.as_ref().map(|(_, scenery)| scenery)
    }

    fn client(&self) -> MutexGuard<'_, Client> {
        self.0.client.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn connect(&self, context: &Context<'_>) -> Rig {
        let mut client = self.client().clone();
        client.interrupt_by(context.cancel.flag());
        if let Some(note) = client.port_note() {
            context.info(&note);
        }
        Rig { client, emulation: self.0.emulation.clone() }
    }

    /// Stops all motion along the ramps and ends a running program, during any job.
    pub fn stop(&self) -> Result<()> {
        let client = self.client().clone(); // the lock is not held while the board answers
        Ok(client.stop()?)
    }

    /// Emergency stop: moving axes lose their positions, and the alarm must be cleared.
    pub fn halt(&self) -> Result<()> {
        let client = self.client().clone();
        Ok(client.halt()?)
    }

    /// Resumes after a reset or reconnection of the board. Its position may be lost.
    pub fn reopen(&self) -> Result<()> {
        let mut client = self.client().clone();
        client.reopen()?;
        *self.client() = client;
        Ok(())
    }
}
