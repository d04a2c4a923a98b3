//! Writes records, one chunk per tick, over the most urgent one's older copy: blocks first, header last. A change
//! during the write restarts it, so that no copy mixes two states. Cost: 700 instructions per tick.

use farnear_protocol::message::RecordName;
use heapless::Vec;

use crate::io::{MEMORY_BYTES, MEMORY_CHUNK, MemoryWrite};
use crate::memory::record::{self, ALL, BLOCK, Block, Checksum, Found, RECORDS, URGENCY};

#[derive(Clone, Copy, Debug)]
struct Slot {
    sequence: u32,
    copy: usize,
    changed: bool,
    /// No copy is valid: the first write covers both.
    fresh: bool,
}

#[derive(Clone, Debug)]
struct Job {
    record: RecordName,
    header: Block,
    checksum: Checksum,
    next: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct Store {
    fitted: bool,
    slots: [Slot; RECORDS],
    job: Option<Job>,
}

impl Store {
    /// No memory: nothing is written.
    pub(crate) const fn absent() -> Self {
        let slot = Slot { sequence: 0, copy: 0, changed: false, fresh: true };
        Self { fitted: false, slots: [slot; RECORDS], job: None }
    }

    pub(crate) fn new(memory: &[u8; MEMORY_BYTES]) -> Self {
        let mut store = Self { fitted: true, ..Self::absent() };
        for (slot, record) in store.slots.iter_mut().zip(ALL) {
            if let Found::Good { copy, sequence, repaired } = record::find(memory, record) {
                let sequence = sequence.wrapping_add(1);
                *slot = Slot { sequence, copy: 1 - copy, changed: repaired, fresh: false };
            }
        }
        store
    }

    pub(crate) const fn is_fitted(&self) -> bool {
        self.fitted
    }

    pub(crate) fn mark(&mut self, record: RecordName) {
        if self.fitted {
            self.slots[record::index(record)].changed = true;
            if self.job.as_ref().is_some_and(|job| job.record == record) {
                self.job = None;
            }
        }
    }

    pub(crate) const fn is_marked(&self, record: RecordName) -> bool {
        self.slots[record::index(record)].changed
    }

    pub(crate) fn is_idle(&self) -> bool {
        self.job.is_none() && self.slots.iter().all(|slot| !slot.changed)
    }

    /// The next bytes to write, and the record that they complete. `contents` returns a record's blocks.
    pub(crate) fn tick(
        &mut self,
        contents: impl Fn(RecordName, usize) -> Block,
    ) -> Option<(MemoryWrite, Option<RecordName>)> {
        let record = URGENCY.into_iter().find(|record| self.slots[record::index(*record)].changed)?;
        let slot = &mut self.slots[record::index(record)];
        let mut job = match self.job.take() {
            Some(job) if job.record == record => job,
            // A more urgent record first; this one restarts.
            _ => {
                let header = record::header(record, slot.sequence);
                Job { record, header, checksum: Checksum::new(&header), next: 0 }
            }
        };
        let address = record::address(record, slot.copy);
        let mut bytes = Vec::new();
        if job.next == record::blocks(record) {
            let _ = bytes.extend_from_slice(&job.checksum.finish(job.header)); // a block fits a chunk
            let sequence = slot.sequence.wrapping_add(1);
            *slot = Slot { sequence, copy: 1 - slot.copy, changed: slot.fresh, fresh: false };
            return Some((write(address, bytes), Some(record)));
        }
        let first = job.next;
        while job.next < record::blocks(record) && bytes.len() + BLOCK <= MEMORY_CHUNK {
            let block = contents(record, job.next);
            job.checksum.push(&block);
            let _ = bytes.extend_from_slice(&block); // just looked
            job.next += 1;
        }
        self.job = Some(job);
        Some((write(address + (1 + first) * BLOCK, bytes), None))
    }
}

/// Addresses are below [`MEMORY_BYTES`], which fits.
fn write(address: usize, bytes: Vec<u8, MEMORY_CHUNK>) -> MemoryWrite {
    MemoryWrite { address: address as u16, bytes }
}

#[cfg(test)]
mod tests;
