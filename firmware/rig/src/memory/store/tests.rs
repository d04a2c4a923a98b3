//! Records with torn writes, flipped bits and a worn-out cell.

use std::boxed::Box;
use std::vec::Vec as List;

use super::*;
use proptest::prelude::*;

type Memory = Box<[u8; MEMORY_BYTES]>;

fn blank() -> Memory {
    Box::new([0; MEMORY_BYTES])
}

fn state(version: u8) -> impl Fn(RecordName, usize) -> Block {
    move |record, index| {
        let mut block = [version; BLOCK];
        block[0] = record::index(record) as u8;
        block[1] = index as u8;
        block
    }
}

fn writes(store: &mut Store, record: RecordName, version: u8) -> List<MemoryWrite> {
    store.mark(record);
    let mut writes = List::new();
    while let Some((write, _)) = store.tick(state(version)) {
        assert!(write.bytes.len() <= MEMORY_CHUNK);
        writes.push(write);
    }
    assert!(store.is_idle());
    writes
}

fn apply(memory: &mut Memory, writes: &[MemoryWrite]) {
    for write in writes {
        let at = usize::from(write.address);
        memory[at..at + write.bytes.len()].copy_from_slice(&write.bytes);
    }
}

/// The version read back, and whether a damaged copy was found.
fn read(memory: &Memory, record: RecordName) -> Option<(u8, bool)> {
    match record::find(memory, record) {
        Found::Good { copy, repaired, .. } => {
            let blocks: List<Block> =
                (0..record::blocks(record)).map(|index| record::block(memory, record, copy, index)).collect();
            let version = blocks[0][2];
            let whole =
                blocks.iter().enumerate().all(|(index, block)| *block == state(version)(record, index));
            assert!(whole, "a mixture was taken for good");
            Some((version, repaired))
        }
        Found::Blank => Some((0, false)),
        Found::Lost => None,
    }
}

#[test]
fn the_newest_is_read_and_the_copies_take_turns() {
    for record in ALL {
        let mut memory = blank();
        assert_eq!(record::find(&memory, record), Found::Blank);
        for version in 1..6 {
            // A new store each time, as after a reset.
            let mut store = Store::new(&memory);
            let writes = writes(&mut store, record, version);
            let first = |copy| usize::from(writes[0].address) >= record::address(record, copy);
            assert_eq!(
                first(1),
                version > 1 && version % 2 == 1,
                "the first write is of both, then they take turns"
            );
            apply(&mut memory, &writes);
            assert_eq!(read(&memory, record), Some((version, false)));
        }
    }
}

#[test]
fn places_do_not_overlap() {
    let mut memory = blank();
    let mut store = Store::new(&memory);
    for version in [1, 2, 3] {
        for record in ALL {
            apply(&mut memory, &writes(&mut store, record, version));
        }
    }
    for record in ALL {
        assert_eq!(read(&memory, record), Some((3, false)));
    }
}

#[test]
fn a_write_torn_at_any_byte_leaves_the_copy_before() {
    for record in [RecordName::Counters, RecordName::Alarms, RecordName::Settings] {
        let mut memory = blank();
        let mut store = Store::new(&memory);
        let mut versions = Vec::<_, 3>::new();
        for version in 1..=3 {
            let written = writes(&mut store, record, version);
            let _ = versions.push(written.clone());
            if version < 3 {
                apply(&mut memory, &written);
            }
        }
        let bytes: List<(usize, u8)> = versions[2]
            .iter()
            .flat_map(|write| {
                write.bytes.iter().enumerate().map(|(i, byte)| (usize::from(write.address) + i, *byte))
            })
            .collect();
        let mut torn = memory.clone();
        for (count, (address, byte)) in bytes.iter().enumerate() {
            let found = read(&torn, record);
            assert!(
                matches!(found, Some((2, _) | (3, false))),
                "after {count} of {} bytes: {found:?}",
                bytes.len()
            );
            if found == Some((2, true)) {
                // Rewritten after the reset and valid again.
                let mut store = Store::new(&torn);
                assert!(!store.is_idle());
                let mut mended = torn.clone();
                apply(&mut mended, &writes(&mut store, record, 2));
                assert_eq!(read(&mended, record), Some((2, false)));
            }
            torn[*address] = *byte;
        }
        assert_eq!(read(&torn, record), Some((3, false)));
    }
}

#[test]
fn a_first_write_torn_at_any_byte_lost_nothing() {
    let record = RecordName::Alarms;
    let mut memory = blank();
    let written = writes(&mut Store::new(&memory), record, 1);
    for write in &written {
        for (i, byte) in write.bytes.iter().enumerate() {
            let found = read(&memory, record);
            assert!(matches!(found, Some((0, false) | (1, _))), "{found:?}");
            memory[usize::from(write.address) + i] = *byte;
        }
    }
    assert_eq!(read(&memory, record), Some((1, false)));
}

#[test]
fn any_flipped_bit_is_found_and_the_older_copy_used() {
    for record in [RecordName::Counters, RecordName::Correction] {
        let mut memory = blank();
        let mut store = Store::new(&memory);
        for version in [1, 2] {
            apply(&mut memory, &writes(&mut store, record, version));
        }
        let size = (1 + record::blocks(record)) * BLOCK;
        for bit in 0..size * 8 {
            let mut flipped = memory.clone();
            flipped[record::address(record, 0) + bit / 8] ^= 1 << (bit % 8);
            assert_eq!(read(&flipped, record), Some((1, true)), "bit {bit} of the newer copy");
            flipped[record::address(record, 1) + bit / 8] ^= 1 << (bit % 8);
            assert_eq!(read(&flipped, record), None, "bit {bit} of both: lost, and said so");
        }
    }
}

#[test]
fn a_change_in_between_begins_the_record_again_and_the_urgent_goes_first() {
    let mut memory = blank();
    let mut store = Store::new(&memory);
    store.mark(RecordName::Program);
    for _ in 0..10 {
        let (write, done) = store.tick(state(1)).expect("there is more");
        assert_eq!(done, None);
        apply(&mut memory, &[write]);
    }
    store.mark(RecordName::Counters);
    let mut order = List::new();
    while let Some((write, done)) = store.tick(state(2)) {
        apply(&mut memory, &[write]);
        order.extend(done);
    }
    let (counters, program) = (RecordName::Counters, RecordName::Program);
    assert_eq!(order, [counters, counters, program, program], "both copies at first");
    assert_eq!(read(&memory, RecordName::Program), Some((2, false)), "nothing of the first state");
}

#[test]
fn without_a_memory_nothing_is_written() {
    let mut store = Store::absent();
    store.mark(RecordName::Settings);
    assert!(store.is_idle() && store.tick(state(1)).is_none());
}

proptest! {
    #[test]
    fn sequence_numbers_may_wrap(start in prop_oneof![any::<u32>(), u32::MAX - 3..=u32::MAX]) {
        let record = RecordName::Settings;
        let mut memory = blank();
        let mut store = Store::new(&memory);
        store.slots[record::index(record)].sequence = start;
        for version in 1..7 {
            apply(&mut memory, &writes(&mut store, record, version));
            prop_assert_eq!(read(&memory, record), Some((version, false)));
            store = Store::new(&memory);
        }
    }
}
