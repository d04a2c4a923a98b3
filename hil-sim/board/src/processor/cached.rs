//! Translations that outlast a reset and a rig.
//!
//! The emulator translates the firmware's instructions into the host's when they first run, and drops all of that at each reset and
//! with each rig: more than half of a short scenario's processor time. Here a reset is worked out on an idle twin, whose state the
//! processor then takes over, and the processor of a rig that has ended waits for the next rig with the same program. What a
//! processor does and when does not depend on what it has translated before, so runs stay the same to the bit.

use std::{
    collections::BTreeSet,
    ops::{Deref, DerefMut},
    sync::{Mutex, PoisonError},
};

use rigless::emulator::{Error, Processor, Queued};

use crate::board::RAM;

/// So many wait at most: each keeps some ten megabytes of translations.
const WAITING: usize = 8;

/// Processors whose rig has ended.
static ENDED: Mutex<Vec<Waiting>> = Mutex::new(Vec::new());

struct Waiting {
    program: u64,
    processor: Box<dyn Processor>,
    /// Its state before the first instruction.
    fresh: Vec<u8>,
}

/// A processor with its translations.
#[derive(Debug)]
pub struct Translated {
    running: Box<dyn Processor>,
    /// Of the same make, without memory or translations. There until the end.
    twin: Option<Box<dyn Processor>>,
    program: u64,
    fresh: Vec<u8>,
    /// Pages whose accesses the run wants to see.
    routed: BTreeSet<u64>,
    /// Whether something was done to it that no state holds.
    altered: bool,
}

impl Translated {
    /// A processor for this program, as before its first instruction.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn new(program: u64, make: impl Fn() -> Result<Box<dyn Processor>, Error>) -> Result<Self, Error> {
        let twin = Some(make()?);
        let (running, fresh) = match take(program) {
            Some(ended) => ended,
            None => {
                let made = make()?;
                let fresh = made.save();
                (made, fresh)
            }
        };
        Ok(Self { running, twin, program, fresh, routed: BTreeSet::new(), altered: false })
    }

    /// As [`Processor::reset`]; the translations stay. The run tells of each byte that it writes on the way.
    pub fn reset(&mut self) {
        let state = self.running.save();
        let reset = self.twin.as_mut().and_then(|twin| {
            twin.load(&state).ok()?;
            twin.reset();
            Some(twin.save())
        });
        if reset.is_none_or(|reset| self.running.load(&reset).is_err()) {
            self.running.reset();
        }
        self.running.take_reset_request(); // a request that came before the reset is no other one
    }

    /// As [`Processor::ask`].
    pub fn ask(&mut self, queued: Queued) {
        match queued {
            Queued::Route(address) => drop(self.routed.insert(address)),
            Queued::Unroute(address) => drop(self.routed.remove(&address)),
            // The run lays the program into the flash: the same that is translated already.
            Queued::Invalidate(begin, _) if self.running.retired() == 0 && !is_ram(begin) => return,
            Queued::Line(..) | Queued::Invalidate(..) | Queued::Return => {}
        }
        self.running.ask(queued);
    }

    /// The processor, for what a debugger does to it: no other rig gets it then.
    pub fn altered(&mut self) -> &mut dyn Processor {
        self.altered = true;
        self.running.as_mut()
    }
}

fn is_ram(address: u64) -> bool {
    RAM.iter().any(|(begin, length)| (*begin..begin + length).contains(&address))
}

/// The processor of a rig with this program that has ended.
fn take(program: u64) -> Option<(Box<dyn Processor>, Vec<u8>)> {
    let mut ended = ENDED.lock().unwrap_or_else(PoisonError::into_inner);
    let at = ended.iter().position(|waiting| waiting.program == program)?;
    let Waiting { mut processor, fresh, .. } = ended.swap_remove(at);
    drop(ended);
    processor.load(&fresh).ok()?;
    Some((processor, fresh))
}

impl Deref for Translated {
    type Target = dyn Processor;

    fn deref(&self) -> &Self::Target {
        self.running.as_ref()
    }
}

impl DerefMut for Translated {
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.running.as_mut()
    }
}

impl Drop for Translated {
    fn drop(&mut self) {
        let Some(twin) = self.twin.take().filter(|_| !self.altered && !std::thread::panicking()) else {
            return;
        };
        for page in std::mem::take(&mut self.routed) {
            self.running.ask(Queued::Unroute(page));
        }
        // What was translated from memory that programs write is this rig's.
        for (begin, length) in RAM {
            self.running.ask(Queued::Invalidate(begin, begin + length));
        }
        let processor = std::mem::replace(&mut self.running, twin);
        let mut ended = ENDED.lock().unwrap_or_else(PoisonError::into_inner);
        if ended.len() < WAITING {
            ended.push(Waiting { program: self.program, processor, fresh: std::mem::take(&mut self.fresh) });
        }
    }
}

#[cfg(test)]
mod tests;
