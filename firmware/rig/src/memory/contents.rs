//! Contents of the records: little-endian numbers at fixed places; shots and alarms in postcard, one per block.

use farnear_protocol::message::{AlarmRecord, CorrectionForm, CorrectionInfo, Counters, RecordName, Shot};
use serde::{Serialize, de::DeserializeOwned};

use crate::alarms::{Alarms, RETAINED};
use crate::correction::StoredCorrection;
use crate::io::MEMORY_BYTES;
use crate::memory::record::{self, BLOCK, Block, Found, VALUES};
use crate::program::{SHOTS_MAX, Shots};
use crate::settings::{KEYS, Settings, Values};

#[derive(Debug)]
pub(crate) struct Contents<'r> {
    pub(crate) counters: Counters,
    /// Bit per axis that may be moving: 1 = stage A, 2 = stage B.
    pub(crate) in_motion: u8,
    pub(crate) alarms: &'r Alarms,
    pub(crate) values: &'r Values,
    pub(crate) shots: &'r Shots,
    pub(crate) correction: Option<&'r StoredCorrection>,
}

impl Contents<'_> {
    pub(crate) fn block(&self, record: RecordName, index: usize) -> Block {
        match record {
            RecordName::Counters => self.counters(index),
            RecordName::Alarms => match index.checked_sub(1) {
                None => {
                    let mut block = [0; BLOCK];
                    block[..4].copy_from_slice(&self.alarms.count().to_le_bytes());
                    block[4] = self.alarms.latched_count();
                    block
                }
                Some(index) => item(self.alarms.kept().get(index).and_then(Option::as_ref)),
            },
            RecordName::Settings => values(self.values.raw(), index),
            RecordName::Program => item(self.shots.get(index as u8)), // an index is below SHOTS_MAX
            RecordName::Correction => self.correction.map_or([0; BLOCK], |kept| correction(kept, index)),
        }
    }

    fn counters(&self, index: usize) -> Block {
        let Counters { boots, alarms, triggers, coarse_steps, lens_steps, homings, repaired } = self.counters;
        let mut block = [0; BLOCK];
        if index == 0 {
            block[..4].copy_from_slice(&boots.to_le_bytes());
            block[4..8].copy_from_slice(&alarms.to_le_bytes());
            block[8..12].copy_from_slice(&homings.to_le_bytes());
            block[12..16].copy_from_slice(&repaired.to_le_bytes());
            block[16] = self.in_motion;
        } else {
            block[..8].copy_from_slice(&triggers.to_le_bytes());
            block[8..16].copy_from_slice(&coarse_steps.to_le_bytes());
            block[16..24].copy_from_slice(&lens_steps.to_le_bytes());
        }
        block
    }
}

#[derive(Debug)]
pub(crate) struct Restored {
    pub(crate) counters: Counters,
    pub(crate) in_motion: u8,
    pub(crate) alarms: Alarms,
    pub(crate) values: Values,
    pub(crate) shots: Shots,
    pub(crate) correction: Option<StoredCorrection>,
}

impl Restored {
    pub(crate) fn nothing() -> Self {
        Self {
            counters: Counters::default(),
            in_motion: 0,
            alarms: Alarms::new(),
            values: Values::DEFAULT,
            shots: Shots::new(),
            correction: None,
        }
    }

    /// `parts` are the settings that are not stored.
    pub(crate) fn from(memory: &[u8; MEMORY_BYTES], parts: &Settings) -> Self {
        let mut restored = Self::nothing();
        let copy = |record| match record::find(memory, record) {
            Found::Good { copy, .. } => Some(copy),
            Found::Blank | Found::Lost => None,
        };
        if let Some(copy) = copy(RecordName::Counters) {
            let [first, second] = [0, 1].map(|i| record::block(memory, RecordName::Counters, copy, i));
            restored.counters = Counters {
                boots: u32_at(&first, 0),
                alarms: u32_at(&first, 4),
                homings: u32_at(&first, 8),
                repaired: u32_at(&first, 12),
                triggers: u64_at(&second, 0),
                coarse_steps: u64_at(&second, 8),
                lens_steps: u64_at(&second, 16),
            };
            restored.in_motion = first[16];
        }
        if let Some(copy) = copy(RecordName::Alarms) {
            let block = |i| record::block(memory, RecordName::Alarms, copy, i);
            let head = block(0);
            let records = (1..=RETAINED).filter_map(|i| from_item::<AlarmRecord>(&block(i)));
            restored.alarms = Alarms::restored(u32_at(&head, 0), head[4], records);
        }
        if let Some(copy) = copy(RecordName::Settings) {
            let kept = record::values(memory, RecordName::Settings, copy);
            let values = core::array::from_fn::<i32, KEYS, _>(|i| {
                if i >= kept {
                    return Values::DEFAULT.raw()[i];
                }
                let block = record::block(memory, RecordName::Settings, copy, i / VALUES);
                u32_at(&block, i % VALUES * 4) as i32
            });
            restored.values = Values::restored(values);
        }
        if let Some(copy) = copy(RecordName::Program) {
            let settings = parts.with(&restored.values);
            for index in 0..SHOTS_MAX {
                let block = record::block(memory, RecordName::Program, copy, index);
                if let Some(shot) = from_item::<Shot>(&block) {
                    restored.shots.restore(index, shot, &settings);
                }
            }
        }
        if let Some(copy) = copy(RecordName::Correction) {
            let block = |i| record::block(memory, RecordName::Correction, copy, i);
            restored.correction = kept_correction(block);
        }
        restored
    }
}

/// The first block has the form, the others coefficients.
fn correction(kept: &StoredCorrection, index: usize) -> Block {
    let Some(index) = index.checked_sub(1) else {
        let CorrectionInfo { form, width, height, centre_um, half_span_um } = *kept.info();
        let form = match form {
            CorrectionForm::Regions => 1,
            CorrectionForm::Blend => 2,
            CorrectionForm::Full => 3,
        };
        return values(&[form, i32::from(width), i32::from(height), centre_um, half_span_um], 0);
    };
    values(kept.bits(), index)
}

/// Inverse of [`correction`]; `None` if none was stored.
fn kept_correction(block: impl Fn(usize) -> Block) -> Option<StoredCorrection> {
    let head = block(0);
    let form = match u32_at(&head, 0) {
        1 => CorrectionForm::Regions,
        2 => CorrectionForm::Blend,
        3 => CorrectionForm::Full,
        _ => return None,
    };
    let info = CorrectionInfo {
        form,
        width: u32_at(&head, 4) as u16,
        height: u32_at(&head, 8) as u16,
        centre_um: u32_at(&head, 12) as i32,
        half_span_um: u32_at(&head, 16) as i32,
    };
    let bits = core::array::from_fn(|i| u32_at(&block(1 + i / VALUES), i % VALUES * 4) as i32);
    StoredCorrection::restored(info, bits)
}

/// Eight values; 0 beyond the list's end.
fn values(list: &[i32], index: usize) -> Block {
    let mut block = [0; BLOCK];
    for (bytes, value) in block.chunks_exact_mut(4).zip(list.iter().skip(index * VALUES)) {
        bytes.copy_from_slice(&value.to_le_bytes());
    }
    block
}

/// 0 beyond the block's end.
fn u32_at(block: &Block, at: usize) -> u32 {
    block.get(at..at + 4).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
}

fn u64_at(block: &Block, at: usize) -> u64 {
    block.get(at..at + 8).and_then(|bytes| bytes.try_into().ok()).map_or(0, u64::from_le_bytes)
}

/// Length, then a message; length 0 = none.
fn item<T: Serialize>(item: Option<&T>) -> Block {
    let mut block = [0; BLOCK];
    let (length, bytes) = block.split_at_mut(1);
    if let Some(written) = item.and_then(|item| postcard::to_slice(item, bytes).ok()) {
        length[0] = written.len() as u8; // below BLOCK
    }
    block
}

fn from_item<T: DeserializeOwned>(block: &Block) -> Option<T> {
    match block[0] {
        0 => None,
        length => postcard::from_bytes(block.get(1..=usize::from(length))?).ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::message::{Alarm, Axis, TriggerMode};
    use farnear_protocol::{BoardMicros, Micros, Nanometres};

    /// A memory with settings written by a firmware of this version with this number of values.
    fn of_version(version: u8, kept: usize, write: [i32; KEYS]) -> std::boxed::Box<[u8; MEMORY_BYTES]> {
        let mut memory = std::boxed::Box::new([0; MEMORY_BYTES]);
        let mut header = record::header(RecordName::Settings, 9);
        header[5] = version;
        header[7] = if version == 1 { 0 } else { kept as u8 };
        let mut checksum = record::Checksum::new(&header);
        let at = record::address(RecordName::Settings, 1);
        for index in 0..record::blocks(RecordName::Settings) {
            let block = values(&write[..kept], index);
            checksum.push(&block);
            memory[at + (1 + index) * BLOCK..][..BLOCK].copy_from_slice(&block);
        }
        memory[at..at + BLOCK].copy_from_slice(&checksum.finish(header));
        memory
    }

    #[test]
    fn settings_of_an_older_firmware_are_taken_over_and_those_it_did_not_have_are_at_their_defaults() {
        let mut write = *Values::DEFAULT.raw();
        write[0] = 48_000_000;
        // A stored backlash of 0 is valid, unlike one unknown to the older firmware.
        let backlash = farnear_protocol::message::SettingKey::CoarseBacklashNm as usize;
        write[backlash] = 7_000;
        // The last of the 25 of version 1.
        write[24] = -500;
        for (version, kept) in [(1, KEYS), (2, KEYS), (2, backlash)] {
            let memory = of_version(version, kept, write);
            assert!(matches!(record::find(&memory, RecordName::Settings), Found::Good { sequence: 9, .. }));
            let restored = Restored::from(&memory, &Settings::DEFAULT).values;
            let default = *Values::DEFAULT.raw();
            let expected = |index: usize, value| if index < kept { value } else { default[index] };
            assert_eq!(
                [0, backlash, 24].map(|index| restored.raw()[index]),
                [48_000_000, expected(backlash, 7_000), expected(24, -500)],
                "{version} {kept}"
            );
        }
        // A future version is not interpreted.
        let memory = of_version(3, KEYS, write);
        assert_eq!(record::find(&memory, RecordName::Settings), Found::Blank, "the other copy is blank");
    }

    #[test]
    fn the_longest_messages_fit_a_block() {
        let shot = Shot {
            axis: Axis::Lens,
            target: Nanometres(i32::MIN),
            exposure: Micros(u32::MAX),
            settle_window: Nanometres(i32::MIN),
            settle_dwell: Micros(u32::MAX),
            repeat: u16::MAX,
            mode: TriggerMode::FreeRunning,
        };
        assert_eq!(from_item(&item(Some(&shot))), Some(shot));
        let alarm = Alarm::Following { axis: Axis::Lens, error: Nanometres(i32::MIN) };
        let record = AlarmRecord { number: u32::MAX, boot: u32::MAX, time: BoardMicros(u64::MAX), alarm };
        assert_eq!(from_item(&item(Some(&record))), Some(record));
        assert_eq!(from_item::<Shot>(&item::<Shot>(None)), None);
    }

    /// A newer firmware reads what this one wrote: the places must not change.
    #[test]
    fn counters_and_moving_axes_have_their_places_in_the_memory() {
        let counters = Counters {
            boots: 0x0403_0201,
            alarms: 0x0807_0605,
            triggers: 0x1817_1615_1413_1211,
            coarse_steps: 0x2827_2625_2423_2221,
            lens_steps: 0x3837_3635_3433_3231,
            homings: 0x0c0b_0a09,
            repaired: 0x100f_0e0d,
        };
        let contents = Contents {
            counters,
            in_motion: 2,
            alarms: &Alarms::new(),
            values: &Values::DEFAULT,
            shots: &Shots::new(),
            correction: None,
        };
        let [first, second] = [0, 1].map(|index| contents.block(RecordName::Counters, index));
        assert!(first[..16].iter().copied().eq(1u8..=16) && first[16] == 2 && first[17..] == [0u8; 15]);
        let places = (0x11u8..=0x18).chain(0x21..=0x28).chain(0x31..=0x38).chain([0; 8]);
        assert!(second.iter().copied().eq(places), "{second:x?}");
        let mut memory = std::boxed::Box::new([0u8; MEMORY_BYTES]);
        let header = record::header(RecordName::Counters, 9);
        let mut checksum = record::Checksum::new(&header);
        checksum.push(&first);
        checksum.push(&second);
        let at = record::address(RecordName::Counters, 1);
        for (index, block) in [checksum.finish(header), first, second].iter().enumerate() {
            memory[at + index * BLOCK..][..BLOCK].copy_from_slice(block);
        }
        let restored = Restored::from(&memory, &Settings::DEFAULT);
        assert_eq!((restored.counters, restored.in_motion), (counters, 2));
    }
}
