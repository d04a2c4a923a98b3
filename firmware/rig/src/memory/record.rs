//! Format and addresses of the records.
//!
//! A copy is a header and the record's blocks, 32 bytes each, little-endian:
//! ```text
//! header: magic "fnR1" | record u8 | version u8 | blocks u8 | values u8 | sequence u32 | CRC-32 | 0...
//! ```
//! The CRC (ISO-HDLC) covers the header's first twelve bytes and all blocks. Each record has two adjacent copies at a
//! fixed address. The copy with the newer sequence number is valid; the other is overwritten, its header last, so a
//! torn write leaves a wrong CRC and an intact older copy. The first write of a record writes both copies.
//!
//! Older versions are read as defined then, and the next write uses the present one, over the other copy: a firmware
//! change loses nothing, even with a power loss. A new version may change the meaning of blocks but not their place; a
//! record that outgrows its place moves behind all others. Version 2 added the number of values, so that newer settings
//! get their default instead of 0. A copy of an unknown version (older firmware restored) is invalid.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use farnear_protocol::message::RecordName;

use crate::correction::COEFFICIENTS;
use crate::io::MEMORY_BYTES;
use crate::program::SHOTS_MAX;
use crate::settings::KEYS;

pub(crate) const BLOCK: usize = 32;
pub(crate) const VALUES: usize = BLOCK / 4;
pub(crate) type Block = [u8; BLOCK];
pub(crate) const RECORDS: usize = 5;
/// Older versions are read too.
const VERSION: u8 = 2;
const SETTINGS_OF_VERSION_1: usize = 25;
const MAGIC: [u8; 4] = *b"fnR1";
const COVERED: usize = 12;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

pub(crate) const ALL: [RecordName; RECORDS] = [
    RecordName::Counters,
    RecordName::Alarms,
    RecordName::Settings,
    RecordName::Program,
    RecordName::Correction,
];

/// Alarms precede the counters, which also store the moving axes: a start turns these into alarms first.
pub(crate) const URGENCY: [RecordName; RECORDS] = [
    RecordName::Alarms,
    RecordName::Counters,
    RecordName::Settings,
    RecordName::Program,
    RecordName::Correction,
];

pub(crate) const fn index(record: RecordName) -> usize {
    match record {
        RecordName::Counters => 0,
        RecordName::Alarms => 1,
        RecordName::Settings => 2,
        RecordName::Program => 3,
        RecordName::Correction => 4,
    }
}

/// Without the header.
pub(crate) const fn blocks(record: RecordName) -> usize {
    match record {
        RecordName::Counters => 2,
        RecordName::Alarms => 1 + crate::alarms::RETAINED,
        RecordName::Settings => 4, // 32 values, more than there are: a new one keeps the form
        RecordName::Program => SHOTS_MAX,
        RecordName::Correction => 1 + COEFFICIENTS.div_ceil(VALUES),
    }
}

pub(crate) const fn address(record: RecordName, copy: usize) -> usize {
    let mut address = 0;
    let mut i = 0;
    while i < index(record) {
        address += 2 * (1 + blocks(ALL[i])) * BLOCK;
        i += 1;
    }
    address + copy * (1 + blocks(record)) * BLOCK
}

const _: () = assert!(address(RecordName::Correction, 2) <= MEMORY_BYTES);

#[derive(Clone)]
pub(crate) struct Checksum(Digest<'static, u32, Table<1>>);

impl Checksum {
    pub(crate) fn new(header: &Block) -> Self {
        let mut digest = CRC.digest();
        digest.update(&header[..COVERED]);
        Self(digest)
    }

    pub(crate) fn push(&mut self, block: &Block) {
        self.0.update(block);
    }

    pub(crate) fn finish(self, mut header: Block) -> Block {
        header[COVERED..COVERED + 4].copy_from_slice(&self.0.finalize().to_le_bytes());
        header
    }
}

impl core::fmt::Debug for Checksum {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Checksum")
    }
}

pub(crate) fn header(record: RecordName, sequence: u32) -> Block {
    let mut header = [0; BLOCK];
    header[..4].copy_from_slice(&MAGIC);
    let values = match record {
        RecordName::Settings => KEYS,
        _ => 0,
    };
    header[4..8].copy_from_slice(&[index(record) as u8, VERSION, blocks(record) as u8, values as u8]);
    header[8..COVERED].copy_from_slice(&sequence.to_le_bytes());
    header
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Copy {
    Blank,
    Good { sequence: u32 },
    Bad,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Found {
    /// Never written: defaults.
    Blank,
    /// The newer valid copy, and whether the other was damaged.
    Good {
        copy: usize,
        sequence: u32,
        repaired: bool,
    },
    Lost,
}

pub(crate) fn find(memory: &[u8; MEMORY_BYTES], record: RecordName) -> Found {
    match [look(memory, record, 0), look(memory, record, 1)] {
        [Copy::Good { sequence: first }, Copy::Good { sequence: second }] => {
            let newer = (second.wrapping_sub(first) as i32) > 0;
            let (copy, sequence) = if newer { (1, second) } else { (0, first) };
            Found::Good { copy, sequence, repaired: false }
        }
        [Copy::Good { sequence }, other] => Found::Good { copy: 0, sequence, repaired: other == Copy::Bad },
        [other, Copy::Good { sequence }] => Found::Good { copy: 1, sequence, repaired: other == Copy::Bad },
        // The first write covers both copies, so a blank one means that it was torn: nothing is lost.
        [Copy::Blank, _] | [_, Copy::Blank] => Found::Blank,
        [Copy::Bad, Copy::Bad] => Found::Lost,
    }
}

pub(crate) fn find_all(memory: &[u8; MEMORY_BYTES]) -> [Found; RECORDS] {
    ALL.map(|record| find(memory, record))
}

pub(crate) fn block(memory: &[u8; MEMORY_BYTES], record: RecordName, copy: usize, block: usize) -> Block {
    at(memory, address(record, copy) + (1 + block) * BLOCK)
}

pub(crate) fn values(memory: &[u8; MEMORY_BYTES], record: RecordName, copy: usize) -> usize {
    let [.., version, _, values] = *at(memory, address(record, copy)).first_chunk::<8>().unwrap_or(&[0; 8]);
    if version == 1 { SETTINGS_OF_VERSION_1 } else { usize::from(values) }
}

fn at(memory: &[u8; MEMORY_BYTES], address: usize) -> Block {
    let mut block = [0; BLOCK];
    if let Some(bytes) = memory.get(address..address + BLOCK) {
        block.copy_from_slice(bytes);
    }
    block
}

fn look(memory: &[u8; MEMORY_BYTES], record: RecordName, copy: usize) -> Copy {
    let found = at(memory, address(record, copy));
    if found == [0; BLOCK] || found == [0xFF; BLOCK] {
        return Copy::Blank;
    }
    let sequence = u32::from_le_bytes([found[8], found[9], found[10], found[11]]);
    let mut expected = header(record, sequence);
    if (1..=VERSION).contains(&found[5]) {
        // The checksum covers both values of that version.
        (expected[5], expected[7]) = (found[5], found[7]);
    }
    let mut checksum = Checksum::new(&expected);
    for index in 0..blocks(record) {
        checksum.push(&block(memory, record, copy, index));
    }
    if checksum.finish(expected) == found { Copy::Good { sequence } } else { Copy::Bad }
}
