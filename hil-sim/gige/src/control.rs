//! Control channel (GVCP): commands and acknowledgements.

use crate::{
    features::{ACQUISITION, START},
    registers::{DISCOVERY_BYTES, Refusal, Registers},
};

/// Longest packet: 540 bytes of payload after a header of 8.
pub const PACKET_MAX: usize = 548;
/// Longest read of the standard.
const READ_MAX: usize = 536;
const HEADER: usize = 8;
const KEY: u8 = 0x42;
/// Flag: acknowledgement required.
const WANTS_ANSWER: u8 = 1;

const DISCOVERY: u16 = 0x0002;
const RESEND: u16 = 0x0040;
const READ_REGISTERS: u16 = 0x0080;
const WRITE_REGISTERS: u16 = 0x0082;
const READ_MEMORY: u16 = 0x0084;
const WRITE_MEMORY: u16 = 0x0086;

#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Ask {
    Discovery,
    Resend {
        frame: u16,
        first: u32,
        last: u32,
    },
    Registers(Vec<u32>),
    Write(Vec<(u32, u32)>),
    /// Read memory: address and length.
    Memory(u32, usize),
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Command {
    pub ask: Result<Ask, Refusal>,
    wants_answer: bool,
    code: u16,
    number: u16,
}

fn word(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(..4)?.try_into().ok()?))
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).filter_map(word).collect()
}

impl Command {
    /// Parses a packet; `None` if it is not a command.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let &[KEY, flags, c0, c1, l0, l1, n0, n1] = bytes.get(..HEADER)? else { return None };
        let (code, number) = (u16::from_be_bytes([c0, c1]), u16::from_be_bytes([n0, n1]));
        let payload = bytes.get(HEADER..HEADER + usize::from(u16::from_be_bytes([l0, l1])))?;
        let ask = Self::ask(code, payload);
        Some(Self { ask, wants_answer: flags & WANTS_ANSWER != 0, code, number })
    }

    fn ask(code: u16, payload: &[u8]) -> Result<Ask, Refusal> {
        let all = words(payload);
        let bad = Refusal::InvalidParameter;
        match code {
            DISCOVERY => Ok(Ask::Discovery),
            RESEND => match all[..] {
                [frame, first, last, ..] => {
                    let (first, last) = (first & 0x00ff_ffff, last & 0x00ff_ffff);
                    Ok(Ask::Resend { frame: frame as u16, first, last })
                }
                _ => Err(bad),
            },
            READ_REGISTERS if !all.is_empty() => Ok(Ask::Registers(all)),
            WRITE_REGISTERS if !all.is_empty() && all.len().is_multiple_of(2) => {
                Ok(Ask::Write(all.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()))
            }
            READ_MEMORY => match all[..] {
                [address, length, ..] if (length as usize) <= READ_MAX => {
                    Ok(Ask::Memory(address, length as usize))
                }
                _ => Err(bad),
            },
            // Only registers are writable.
            WRITE_MEMORY if all.len() >= 2 => {
                let writes =
                    (0..).zip(&all[1..]).map(|(index, value)| (all[0].wrapping_add(4 * index), *value));
                Ok(Ask::Write(writes.collect()))
            }
            READ_REGISTERS | WRITE_REGISTERS | WRITE_MEMORY => Err(bad),
            _ => Err(Refusal::NotImplemented),
        }
    }

    /// Acknowledgement with payload or refusal; `None` if none is required.
    pub fn answer(&self, result: Result<&[u8], Refusal>) -> Option<Vec<u8>> {
        // A resend is answered by the packets themselves.
        if !self.wants_answer || self.code == RESEND {
            return None;
        }
        let (status, payload) = match result {
            Ok(payload) => (0, payload),
            Err(refusal) => (refusal as u16, &[][..]),
        };
        let mut bytes = status.to_be_bytes().to_vec();
        bytes.extend((self.code + 1).to_be_bytes());
        bytes.extend((payload.len() as u16).to_be_bytes());
        bytes.extend(self.number.to_be_bytes());
        bytes.extend(payload);
        Some(bytes)
    }

    /// First four bytes of a write acknowledgement: the last address, or the number of writes.
    pub fn written(&self, writes: &[(u32, u32)]) -> [u8; 4] {
        match self.code {
            WRITE_MEMORY => writes.first().map_or(0, |(address, _)| *address).to_be_bytes(),
            _ => (writes.len() as u32).to_be_bytes(),
        }
    }
}

/// Discovery acknowledgement; `None` for any other packet.
pub fn discovery(bytes: &[u8], registers: &Registers) -> Option<Vec<u8>> {
    let mut command = Command::read(bytes)?;
    if command.ask != Ok(Ask::Discovery) {
        return None;
    }
    command.wants_answer = true;
    command.answer(registers.read(0, DISCOVERY_BYTES))
}

pub fn starts_acquisition(bytes: &[u8]) -> bool {
    match Command::read(bytes).map(|command| command.ask) {
        Some(Ok(Ask::Write(writes))) => writes.contains(&(ACQUISITION, START)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packet(code: u16, payload: &[u8]) -> Vec<u8> {
        let mut bytes = vec![KEY, 1];
        bytes.extend(code.to_be_bytes());
        bytes.extend((payload.len() as u16).to_be_bytes());
        bytes.extend([0x12, 0x34]);
        bytes.extend(payload);
        bytes
    }

    #[test]
    fn parses_and_answers_commands() {
        let command = Command::read(&packet(READ_REGISTERS, &[0, 0, 0x0a, 0])).expect("a command");
        assert_eq!(command.ask, Ok(Ask::Registers(vec![0x0a00])));
        assert_eq!(
            command.answer(Ok(&[1, 2, 3, 4])),
            Some(vec![0, 0, 0, 0x81, 0, 4, 0x12, 0x34, 1, 2, 3, 4])
        );
        let denied = command.answer(Err(Refusal::AccessDenied));
        assert_eq!(denied, Some(vec![0x80, 0x06, 0, 0x81, 0, 0, 0x12, 0x34]));
        let memory =
            Command::read(&packet(WRITE_MEMORY, &[0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 2])).expect("a command");
        assert_eq!(memory.ask, Ok(Ask::Write(vec![(8, 1), (12, 2)])));
        let unknown = Command::read(&packet(0x0100, &[])).expect("a command");
        assert_eq!(unknown.ask, Err(Refusal::NotImplemented));
        assert_eq!(Command::read(&[0; 8]), None);
        assert!(starts_acquisition(&packet(WRITE_REGISTERS, &[0, 0, 0xa0, 0x24, 0, 0, 0, 1])));
    }

    proptest! {
        // Any packet is answered or ignored.
        #[test]
        fn answers_or_ignores_any_packet(mut bytes in prop::collection::vec(any::<u8>(), 0..64), as_command: bool) {
            if as_command && !bytes.is_empty() {
                bytes[0] = KEY;
            }
            if let Some(command) = Command::read(&bytes) {
                let answer = command.answer(Err(Refusal::NotImplemented));
                prop_assert!(answer.is_none_or(|answer| answer.len() == HEADER));
            }
        }
    }
}
