//! Translations that survive a reset and a rig.
//!
//! The emulator drops translations at each reset and rig: more than half of a short scenario's CPU time. An idle twin
//! computes the reset state, and the next rig with the program reuses the processor. Runs stay identical to the bit.

use std::{
    collections::BTreeSet,
    ops::{Deref, DerefMut},
    sync::{Mutex, PoisonError},
};

use rigless::emulator::{Error, Processor, Queued};

use crate::board::RAM;

/// Each cached processor holds some ten megabytes.
const WAITING: usize = 8;

static ENDED: Mutex<Vec<Waiting>> = Mutex::new(Vec::new());

struct Waiting {
    program: u64,
    processor: Box<dyn Processor>,
    fresh: Vec<u8>,
}

#[derive(Debug)]
pub struct Translated {
    running: Box<dyn Processor>,
    /// Idle twin without memory or translations; always present until the end.
    twin: Option<Box<dyn Processor>>,
    program: u64,
    fresh: Vec<u8>,
    /// Pages with watched accesses.
    routed: BTreeSet<u64>,
    /// Changed in a way that its state does not contain.
    altered: bool,
}

impl Translated {
    /// A processor for this program, before its first instruction.
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

    /// As [`Processor::reset`]; keeps the translations. The run reports each byte that it writes.
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
        self.running.take_reset_request(); // drops a request from before the reset
    }

    pub fn ask(&mut self, queued: Queued) {
        match queued {
            Queued::Route(address) => drop(self.routed.insert(address)),
            Queued::Unroute(address) => drop(self.routed.remove(&address)),
            // The run loads the program that is translated already.
            Queued::Invalidate(begin, _) if self.running.retired() == 0 && !is_ram(begin) => return,
            Queued::Line(..) | Queued::Invalidate(..) | Queued::Return => {}
        }
        self.running.ask(queued);
    }

    /// Access for a debugger; prevents reuse by another rig.
    pub fn altered(&mut self) -> &mut dyn Processor {
        self.altered = true;
        self.running.as_mut()
    }
}

fn is_ram(address: u64) -> bool {
    RAM.iter().any(|(begin, length)| (*begin..begin + length).contains(&address))
}

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
        // Translations of RAM belong to this rig only.
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
