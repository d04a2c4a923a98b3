//! A rig that is held open between jobs, for a face that stays: status, stop and job share one port.
//!
//! [`RigAddress::Open`] represents it where a workflow takes a rig. Requests of several threads come one after the other at
//! the port's owner, so a stop does not wait for a job that is under way.

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

/// A connected rig that several threads share; the last one that lets go closes it.
#[derive(Clone)]
pub struct OpenRig(Arc<Held>);

struct Held {
    name: String,
    client: Mutex<Client>,
    // Ends after the client.
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
    /// Connects and stays connected. An emulated rig has the lens of `optics`.
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

    /// Whether it is emulated, by this program.
    pub fn is_emulated(&self) -> bool {
        self.0.emulation.is_some()
    }

    /// What the emulated rig was made of.
    pub fn scenery(&self) -> Option<&Scenery> {
        self.0.emulation.as_ref().map(|(_, scenery)| scenery)
    }

    fn client(&self) -> MutexGuard<'_, Client> {
        self.0.client.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A handle for a job, which `context` can cancel.
    pub(super) fn connect(&self, context: &Context<'_>) -> Rig {
        let mut client = self.client().clone();
        client.interrupt_by(context.cancel.flag());
        if let Some(note) = client.port_note() {
            context.info(&note);
        }
        Rig { client, emulation: self.0.emulation.clone() }
    }

    /// Stops all motion along the ramps and ends a running program immediately, during any job.
    pub fn stop(&self) -> Result<()> {
        let client = self.client().clone(); // the lock is not held while the board answers
        Ok(client.stop()?)
    }

    /// Emergency stop, now: what moved has lost its position, and the alarm has to be cleared.
    pub fn halt(&self) -> Result<()> {
        let client = self.client().clone();
        Ok(client.halt()?)
    }

    /// Continues with a board that was reset or unplugged: it may have lost its position.
    pub fn reopen(&self) -> Result<()> {
        let mut client = self.client().clone();
        client.reopen()?;
        *self.client() = client;
        Ok(())
    }
}
