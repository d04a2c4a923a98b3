//! Memory of the control channel: bootstrap registers of GigE Vision 1.2, features and description.

use std::net::Ipv4Addr;

use crate::{
    GigeConfig,
    description::{CHUNKS, FILE, MODEL, TICKS_PER_SECOND, VENDOR, description},
    features::{
        CHUNK_ENABLE, CHUNK_MODE, CHUNK_SELECTOR, Feature, HEIGHT, MONO_8, OFFSET_X, OFFSET_Y, PAYLOAD_SIZE,
        PIXEL_FORMAT, SENSOR_HEIGHT, SENSOR_WIDTH, Value, WIDTH, table,
    },
    stream,
};

pub const PRIVILEGE: u32 = 0x0A00;
/// Exclusive access, or control with read access for others.
pub const PRIVILEGE_CONTROL: u32 = 0b11;
pub const HEARTBEAT_MS: u32 = 0x0938;
pub const STREAM_PORT: u32 = 0x0D00;
/// Packet size including IP and UDP headers, with flags.
pub const PACKET_SIZE: u32 = 0x0D04;
/// Minimum gap of packets, in clock ticks, which are ns.
pub const PACKET_DELAY_NS: u32 = 0x0D08;
pub const STREAM_ADDRESS: u32 = 0x0D18;
pub const DISCOVERY_BYTES: usize = 0xF8;
/// Flag: send one test packet of this size.
pub const FIRE_TEST: u32 = 1 << 31;

const DESCRIPTION: u32 = 0x0001_0000;
/// Default packet size: Ethernet's.
const USUAL_PACKET_BYTES: u32 = 1500;
const USUAL_HEARTBEAT_MS: u32 = 3000;
/// Packet resend, register for a name, serial number.
const CAPABILITIES: u32 = 1 << 2 | 1 << 1 | 1 | 1 << 30;
const WRITABLE: [(u32, u32, u32); 9] = [
    (PRIVILEGE, 0, u32::MAX),
    (HEARTBEAT_MS, 500, 600_000),
    (STREAM_PORT, 0, 65_535),
    (PACKET_SIZE, 0, u32::MAX),
    (PACKET_DELAY_NS, 0, 10_000_000),
    (STREAM_ADDRESS, 0, u32::MAX),
    (CHUNK_MODE, 0, 1),
    (CHUNK_SELECTOR, 0, CHUNKS.len() as u32 - 1),
    (0x0D24, 0, u32::MAX), // stream configuration: not supported, reads as 0
];

/// Status codes of the standard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u16)]
pub enum Refusal {
    NotImplemented = 0x8001,
    /// Value out of range, or invalid packet.
    InvalidParameter = 0x8002,
    InvalidAddress = 0x8003,
    WriteProtect = 0x8004,
    BadAlignment = 0x8005,
    /// Another client has control.
    AccessDenied = 0x8006,
}

pub struct Registers {
    bytes: Vec<u8>,
    features: Vec<Feature>,
}

impl Registers {
    pub fn new(config: &GigeConfig) -> Self {
        let features = table(config.sensor_px, config.bits);
        let text = description(&features);
        let mut bytes = vec![0; DESCRIPTION as usize];
        bytes.extend(text.as_bytes());
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let mut registers = Self { bytes, features };
        let serial = format!("S{}", config.seed % 1_000_000_000_000);
        for (at, room, text) in [
            (0x48, 32, VENDOR),
            (0x68, 32, MODEL),
            (0x88, 32, env!("CARGO_PKG_VERSION")),
            (0xA8, 48, "emulated rig: no hardware is involved"),
            (0xD8, 16, &serial),
            (0x200, 512, &format!("Local:{FILE};{DESCRIPTION:X};{:X}", text.len())),
        ] {
            let text = &text.as_bytes()[..text.len().min(room - 1)];
            registers.bytes[at..at + text.len()].copy_from_slice(text);
        }
        // Locally administered address, unique per seed.
        let mac = config.seed as u32;
        for (register, value) in [
            (0x00, 0x0001_0002), // version 1.2
            (0x04, 1 << 31 | 1), // big endian, UTF-8
            (0x08, 0x0200),      // MAC
            (0x0C, mac),
            (0x10, 0b101), // link-local and persistent addresses
            (0x14, 0b100),
            (0x24, config.address.to_bits()),
            (0x34, 0xFF00_0000),
            (0x600, 1), // network interfaces
            (0x904, 1), // streams
            (0x934, CAPABILITIES),
            (HEARTBEAT_MS, USUAL_HEARTBEAT_MS),
            (0x940, TICKS_PER_SECOND),
            (PACKET_SIZE, USUAL_PACKET_BYTES),
        ] {
            registers.put(register, value);
        }
        for feature in registers.features.clone() {
            registers.put(feature.register, feature.initial);
        }
        registers.settle();
        registers
    }

    /// Vendor, model and serial number, joined as clients do.
    pub fn id(&self) -> String {
        let text = |at: usize, room: usize| {
            let bytes = &self.bytes[at..at + room];
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(room);
            String::from_utf8_lossy(&bytes[..end]).into_owned()
        };
        format!("{}-{}-{}", text(0x48, 32), text(0x68, 32), text(0xD8, 16))
    }

    pub fn get(&self, register: u32) -> u32 {
        let at = register as usize;
        let bytes = self.bytes.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        bytes.map_or(0, u32::from_be_bytes)
    }

    pub fn put(&mut self, register: u32, value: u32) {
        let at = register as usize;
        if let Some(bytes) = self.bytes.get_mut(at..at + 4) {
            bytes.copy_from_slice(&value.to_be_bytes());
        }
    }

    /// Fails unless all bytes are in the memory.
    pub fn read(&self, address: u32, length: usize) -> Result<&[u8], Refusal> {
        if !address.is_multiple_of(4) || !length.is_multiple_of(4) {
            return Err(Refusal::BadAlignment);
        }
        let end = (address as usize).checked_add(length).ok_or(Refusal::InvalidAddress)?;
        self.bytes.get(address as usize..end).ok_or(Refusal::InvalidAddress)
    }

    /// Values are never clamped silently.
    pub fn write(&mut self, register: u32, value: u32) -> Result<(), Refusal> {
        if !register.is_multiple_of(4) {
            return Err(Refusal::BadAlignment);
        }
        let chunk = (CHUNK_ENABLE..CHUNK_ENABLE + 4 * CHUNKS.len() as u32).contains(&register);
        let bootstrap = WRITABLE.iter().find(|(at, ..)| *at == register).map(|(_, min, max)| (*min, *max));
        let allowed = match bootstrap.or(chunk.then_some((0, 1))) {
            Some((min, max)) => (min..=max).contains(&value),
            None => self.feature_allows(register, value)?,
        };
        if !allowed || !self.region_fits(register, value) {
            return Err(Refusal::InvalidParameter);
        }
        self.put(register, value);
        self.settle();
        Ok(())
    }

    fn feature_allows(&self, register: u32, value: u32) -> Result<bool, Refusal> {
        let mut known = self.features.iter().filter(|feature| feature.register == register).peekable();
        if known.peek().is_none() {
            let inside = (register as usize) < self.bytes.len();
            return Err(if inside { Refusal::WriteProtect } else { Refusal::InvalidAddress });
        }
        let mut may_write = false;
        for feature in known {
            let allowed = match &feature.value {
                Value::Constant => continue,
                Value::Integer { min, max } | Value::Number { min, max, .. } => {
                    (*min..=*max).contains(&value)
                }
                Value::Choice(choices) => choices.iter().any(|(_, choice)| *choice == value),
                Value::Command(written) => *written == value,
            };
            if allowed {
                return Ok(true);
            }
            may_write = true;
        }
        if may_write { Ok(false) } else { Err(Refusal::WriteProtect) }
    }

    /// Whether the region is still within the sensor after this write.
    fn region_fits(&self, register: u32, value: u32) -> bool {
        let (other, sensor) = match register {
            WIDTH => (OFFSET_X, SENSOR_WIDTH),
            OFFSET_X => (WIDTH, SENSOR_WIDTH),
            HEIGHT => (OFFSET_Y, SENSOR_HEIGHT),
            OFFSET_Y => (HEIGHT, SENSOR_HEIGHT),
            _ => return true,
        };
        value.saturating_add(self.get(other)) <= self.get(sensor)
    }

    fn settle(&mut self) {
        let pixel = if self.get(PIXEL_FORMAT) == MONO_8 { 1 } else { 2 };
        let image = self.get(WIDTH) * self.get(HEIGHT) * pixel;
        let chunks = stream::chunk_bytes(self.get(CHUNK_MODE) == 1, self.chunk_flags());
        self.put(PAYLOAD_SIZE, image + chunks);
    }

    pub fn chunk_flags(&self) -> [bool; CHUNKS.len()] {
        let mut index = 0;
        [(); CHUNKS.len()].map(|()| {
            let on = self.get(CHUNK_ENABLE + index) == 1;
            index += 4;
            on
        })
    }

    /// Where frames are sent; `None` until it is set.
    pub fn destination(&self) -> Option<std::net::SocketAddr> {
        let port = u16::try_from(self.get(STREAM_PORT)).ok().filter(|port| *port > 0)?;
        Some((Ipv4Addr::from_bits(self.get(STREAM_ADDRESS)), port).into())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn config() -> GigeConfig {
        GigeConfig {
            address: Ipv4Addr::LOCALHOST,
            seed: 7,
            lost_per_thousand: 0,
            sensor_px: (640, 480),
            bits: 12,
        }
    }

    #[test]
    fn rejects_register_values_out_of_range() {
        let mut registers = Registers::new(&config());
        assert_eq!(registers.id(), "farnear-emulated-S7");
        assert_eq!(registers.get(PAYLOAD_SIZE), 640 * 480 * 2);
        assert_eq!(registers.write(WIDTH, 320), Ok(()));
        assert_eq!(registers.write(PIXEL_FORMAT, MONO_8), Ok(()));
        assert_eq!(registers.get(PAYLOAD_SIZE), 320 * 480);
        for (register, value, refusal) in [
            (WIDTH, 641, Refusal::InvalidParameter),
            (WIDTH + 2, 10, Refusal::BadAlignment),
            (PIXEL_FORMAT, 5, Refusal::InvalidParameter),
            (PAYLOAD_SIZE, 5, Refusal::WriteProtect),
            (0x48, 5, Refusal::WriteProtect),
            (0xFFFF_FFF0, 5, Refusal::InvalidAddress),
        ] {
            assert_eq!(registers.write(register, value), Err(refusal), "{register:x}");
        }
        assert_eq!(registers.read(0xFFFF_FFFC, 8), Err(Refusal::InvalidAddress));
        assert_eq!(registers.read(0, DISCOVERY_BYTES).map(<[u8]>::len), Ok(DISCOVERY_BYTES));
    }

    #[test]
    fn a_region_beyond_the_sensor_is_rejected() {
        let mut registers = Registers::new(&config());
        assert_eq!(registers.write(OFFSET_X, 16), Err(Refusal::InvalidParameter), "the width is still 640");
        for (register, value) in [(WIDTH, 600), (OFFSET_X, 40), (HEIGHT, 80), (OFFSET_Y, 400)] {
            assert_eq!(registers.write(register, value), Ok(()), "{register:x}");
        }
        for (register, value) in [(WIDTH, 601), (OFFSET_X, 41), (HEIGHT, 81), (OFFSET_Y, 401)] {
            assert_eq!(registers.write(register, value), Err(Refusal::InvalidParameter), "{register:x}");
        }
    }

    #[test]
    fn chunks_are_part_of_the_payload() {
        let mut registers = Registers::new(&config());
        let bare = registers.get(PAYLOAD_SIZE);
        for (register, value) in [(CHUNK_MODE, 1), (CHUNK_ENABLE, 1), (CHUNK_ENABLE + 4, 1)] {
            registers.write(register, value).expect("may be written");
        }
        // The trailer of the image, and two numbers of 8 bytes with theirs.
        assert_eq!(registers.get(PAYLOAD_SIZE), bare + 8 + 2 * 16);
        assert!(registers.write(CHUNK_ENABLE + 8, 1).is_err());
    }
}
