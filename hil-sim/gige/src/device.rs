//! The camera's state: control, acquisition, and frames for pictures.

use std::{
    collections::VecDeque,
    net::SocketAddr,
    time::{Duration, Instant},
};

use farnear_protocol::{
    camera::{Control, FREE_RUNNING},
    units::Micros,
};
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{RngCore, SeedableRng},
};

use crate::{
    GigeConfig, Picture,
    control::{Ask, Command},
    description::CHUNKS,
    features::{
        ACQUISITION, BLACK_LEVEL, CHUNK_ENABLE, CHUNK_MODE, EXPOSURE_US, FRAME_RATE, GAIN, HEIGHT, MONO_8,
        OFFSET_X, OFFSET_Y, PIXEL_FORMAT, SOFTWARE, START, STOP, TRIGGER_MODE, TRIGGER_SOFTWARE,
        TRIGGER_SOURCE, WIDTH,
    },
    registers::{
        FIRE_TEST, HEARTBEAT_MS, PACKET_DELAY_NS, PACKET_SIZE, PRIVILEGE, PRIVILEGE_CONTROL, Refusal,
        Registers,
    },
    stream::{Frame, HEADERS_BYTES, UDP_HEADERS_BYTES},
};

/// Frames kept for resends.
const FRAMES_RETAINED: usize = 8;
const PACKET_BYTES_MAX: usize = 65_507;
/// Mask of the packet size in its register.
const PACKET_BYTES: u32 = 0xFFFF;
/// Minimum time between free-running exposures: read-out and a margin.
pub(super) const BETWEEN_EXPOSURES_US: u32 = 15_000;
/// Features that may not change during an acquisition, because they change the size of a frame.
const LOCKED: [u32; 8] =
    [OFFSET_X, OFFSET_Y, WIDTH, HEIGHT, PIXEL_FORMAT, CHUNK_MODE, CHUNK_ENABLE, CHUNK_ENABLE + 4];
/// First id of software-triggered pictures, far from the board's numbers.
const SOFTWARE_SHOTS: u32 = 0x4000_0000;

#[derive(Default)]
pub struct Done {
    pub answer: Option<Vec<u8>>,
    /// Requests to the rig.
    pub asks: Vec<Control>,
    /// Packets to send (again).
    pub again: Option<Sending>,
}

pub struct Sending {
    pub to: SocketAddr,
    pub packets: Vec<Vec<u8>>,
    /// Minimum gap requested by the client.
    pub gap: Duration,
}

pub struct Device {
    registers: Registers,
    bits: u8,
    lost_per_thousand: u32,
    losses: ChaCha8Rng,
    /// Controlling client, and time of its last command.
    controller: Option<(SocketAddr, Instant)>,
    /// Rig time at which the acquisition began.
    acquires_since_ns: Option<u64>,
    frames: u64,
    triggers: u32,
    sent_frames: VecDeque<(u16, Vec<Vec<u8>>)>,
    /// Period and exposure of the requested free run.
    free_run: Option<(Micros, Micros)>,
}

impl Device {
    pub fn new(config: &GigeConfig) -> Self {
        Self {
            registers: Registers::new(config),
            bits: config.bits,
            lost_per_thousand: config.lost_per_thousand,
            losses: ChaCha8Rng::seed_from_u64(config.seed),
            controller: None,
            acquires_since_ns: None,
            frames: 0,
            triggers: 0,
            sent_frames: VecDeque::new(),
            free_run: None,
        }
    }

    pub fn id(&self) -> String {
        self.registers.id()
    }

    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Executes a packet; `now_ns` is rig time, `now` the wall clock.
    pub fn obey(&mut self, bytes: &[u8], from: SocketAddr, now: Instant, now_ns: u64) -> Done {
        let Some(command) = Command::read(bytes) else { return Done::default() };
        let controls = self.controller.is_some_and(|(controller, _)| controller == from);
        if controls {
            self.controller = Some((from, now));
        }
        let mut done = Done::default();
        let result = match &command.ask {
            Err(refusal) => Err(*refusal),
            Ok(Ask::Discovery) => {
                self.registers.read(0, super::registers::DISCOVERY_BYTES).map(<[u8]>::to_vec)
            }
            Ok(Ask::Registers(all)) => {
                let values: Result<Vec<&[u8]>, _> =
                    all.iter().map(|at| self.registers.read(*at, 4)).collect();
                values.map(|values| values.concat())
            }
            Ok(Ask::Memory(address, length)) => {
                let read = self.registers.read(*address, *length);
                read.map(|bytes| [&address.to_be_bytes(), bytes].concat())
            }
            Ok(Ask::Resend { frame, first, last }) => {
                // Resends come from the stream's own port.
                let of_client = self.controller.is_some_and(|(controller, _)| controller.ip() == from.ip());
                done.again = self.again(*frame, *first, *last).filter(|_| of_client);
                Ok(Vec::new())
            }
            Ok(Ask::Write(writes)) => {
                let each = writes.iter().try_for_each(|(register, value)| {
                    self.write(*register, *value, from, now, now_ns, &mut done)
                });
                each.map(|()| command.written(writes).to_vec())
            }
        };
        done.answer = command.answer(result.as_deref().map_err(|refusal| *refusal));
        done
    }

    fn write(
        &mut self,
        register: u32,
        value: u32,
        from: SocketAddr,
        now: Instant,
        now_ns: u64,
        done: &mut Done,
    ) -> Result<(), Refusal> {
        if self.controller.is_some_and(|(controller, _)| controller != from) {
            return Err(Refusal::AccessDenied);
        }
        if register != PRIVILEGE && self.controller.is_none() {
            return Err(Refusal::AccessDenied);
        }
        if LOCKED.contains(&register) && self.acquires_since_ns.is_some() {
            return Err(Refusal::WriteProtect);
        }
        self.registers.write(register, value)?;
        match register {
            PRIVILEGE if value & PRIVILEGE_CONTROL != 0 => self.controller = Some((from, now)),
            PRIVILEGE => done.asks.extend(self.release()),
            PACKET_SIZE if value & FIRE_TEST != 0 => {
                self.registers.put(PACKET_SIZE, value & !FIRE_TEST);
                let test = vec![0; self.packet_bytes() - UDP_HEADERS_BYTES];
                done.again = self.sending(vec![test]);
            }
            ACQUISITION if value == START => {
                self.acquires_since_ns = Some(now_ns);
                self.frames = 0;
                self.sent_frames.clear();
            }
            ACQUISITION => self.acquires_since_ns = None,
            TRIGGER_SOFTWARE if self.is_triggered_by_software() => {
                let exposure = Micros(self.registers.get(EXPOSURE_US));
                let shot_id = SOFTWARE_SHOTS + self.triggers % SOFTWARE_SHOTS;
                self.triggers += 1;
                done.asks.push(Control::Expose { shot_id, exposure });
                // Time is stopped in an idle rig; this much passes.
                done.asks
                    .push(Control::AdvanceMicros(u64::from(exposure.0.saturating_add(BETWEEN_EXPOSURES_US))));
            }
            _ => {}
        }
        done.asks.extend(self.change_free_run());
        Ok(())
    }

    fn is_triggered_by_software(&self) -> bool {
        let on = self.registers.get(TRIGGER_MODE) == 1 && self.registers.get(TRIGGER_SOURCE) == SOFTWARE;
        on && self.acquires_since_ns.is_some()
    }

    pub fn free_period(&self) -> Option<Micros> {
        let free = self.acquires_since_ns.is_some() && self.registers.get(TRIGGER_MODE) == 0;
        let exposure = self.registers.get(EXPOSURE_US);
        let by_rate = (1e9 / f64::from(self.registers.get(FRAME_RATE).max(1))) as u32;
        free.then(|| Micros(by_rate.max(exposure.saturating_add(BETWEEN_EXPOSURES_US))))
    }

    /// Request to start, change or stop free running, if it differs from the last one.
    fn change_free_run(&mut self) -> Option<Control> {
        let exposure = Micros(self.registers.get(EXPOSURE_US));
        let wanted = self.free_period().map(|period| (period, exposure));
        let last = std::mem::replace(&mut self.free_run, wanted);
        match (last, wanted) {
            (last, wanted) if last == wanted => None,
            (_, Some((period, exposure))) => Some(Control::FreeRun { period, exposure }),
            // The last exposure may still be running.
            (Some((_, exposure)), None) => Some(Control::FreeRun { period: Micros(0), exposure }),
            (None, None) => None,
        }
    }

    fn release(&mut self) -> Option<Control> {
        self.controller = None;
        self.acquires_since_ns = None;
        self.registers.put(PRIVILEGE, 0);
        self.registers.put(ACQUISITION, STOP);
        self.change_free_run()
    }

    /// Ends the control of a client that missed its heartbeat; `from` has just sent a packet.
    pub fn look_for_controller(&mut self, now: Instant, from: Option<SocketAddr>) -> Option<Control> {
        let allowed = Duration::from_millis(u64::from(self.registers.get(HEARTBEAT_MS)));
        let (controller, heard) = self.controller?;
        if Some(controller) == from || now.saturating_duration_since(heard) <= allowed {
            return None;
        }
        self.release()
    }

    fn packet_bytes(&self) -> usize {
        let asked = (self.registers.get(PACKET_SIZE) & PACKET_BYTES) as usize;
        asked.clamp(HEADERS_BYTES + 64, PACKET_BYTES_MAX)
    }

    /// `None` without an acquisition, if exposed before it began, or with another trigger source.
    pub fn frame(&mut self, picture: &Picture) -> Option<Sending> {
        let since_ns = self.acquires_since_ns?;
        let free = picture.header.shot_id == FREE_RUNNING;
        let software = picture.header.shot_id & SOFTWARE_SHOTS != 0 && !free;
        let wanted = match (self.registers.get(TRIGGER_MODE), self.registers.get(TRIGGER_SOURCE)) {
            (0, _) => free,
            (_, SOFTWARE) => software,
            _ => !free && !software,
        };
        if !wanted || picture.begin_ns < since_ns {
            return None;
        }
        self.registers.destination()?;
        self.frames += 1;
        let frame = self.picture(picture)?;
        let packets = frame.packets(self.packet_bytes());
        let sent = packets
            .iter()
            .filter(|_| self.losses.next_u32() % 1000 >= self.lost_per_thousand)
            .cloned()
            .collect();
        self.sent_frames.push_back((frame.short_number(), packets));
        if self.sent_frames.len() > FRAMES_RETAINED {
            self.sent_frames.pop_front();
        }
        self.sending(sent)
    }

    /// `None` before the client has set the destination.
    fn sending(&self, packets: Vec<Vec<u8>>) -> Option<Sending> {
        let gap = Duration::from_nanos(u64::from(self.registers.get(PACKET_DELAY_NS)));
        self.registers.destination().map(|to| Sending { to, packets, gap })
    }

    /// Some of the packets are lost again.
    fn again(&mut self, frame: u16, first: u32, last: u32) -> Option<Sending> {
        let (_, packets) = self.sent_frames.iter().find(|(number, _)| *number == frame)?;
        let (first, last) = (first as usize, (last as usize).min(packets.len().saturating_sub(1)));
        let asked = packets.get(first..=last)?;
        let lost = self.lost_per_thousand;
        let sent = asked.iter().filter(|_| self.losses.next_u32() % 1000 >= lost).cloned().collect();
        self.sending(sent)
    }

    /// Applies region, gain, black level and pixel format.
    fn picture(&self, picture: &Picture) -> Option<Frame> {
        let get = |register| self.registers.get(register) as usize;
        let (sensor_width, sensor_height) =
            (usize::from(picture.header.width), usize::from(picture.header.height));
        let (left, top) = (get(OFFSET_X).min(sensor_width), get(OFFSET_Y).min(sensor_height));
        // The registers keep the region within the sensor; this also keeps it within a smaller picture.
        let (width, height) = (get(WIDTH).min(sensor_width - left), get(HEIGHT).min(sensor_height - top));
        let format = self.registers.get(PIXEL_FORMAT);
        let (gain, black) = (self.registers.get(GAIN), self.registers.get(BLACK_LEVEL));
        let max = (1_u32 << self.bits) - 1;
        // Rounds half up.
        let developed = |code: u16| ((u32::from(code) * gain + 50) / 100 + black).min(max);
        let pixels = &picture.pixels;
        let mut bytes = Vec::with_capacity(2 * width * height);
        for row in pixels.chunks_exact(2 * sensor_width).skip(top).take(height) {
            for pixel in row[2 * left..2 * (left + width)].chunks_exact(2) {
                let code = developed(u16::from_le_bytes([pixel[0], pixel[1]]));
                match format {
                    MONO_8 => bytes.push((code >> (self.bits - 8)) as u8),
                    _ => bytes.extend((code as u16).to_le_bytes()),
                }
            }
        }
        let chunks: Option<[bool; CHUNKS.len()]> =
            (self.registers.get(CHUNK_MODE) == 1).then(|| self.registers.chunk_flags());
        Some(Frame {
            number: self.frames,
            time_ns: picture.begin_ns,
            pixel_format: format,
            size_px: (width as u32, height as u32),
            offset_px: (left as u32, top as u32),
            pixels: bytes,
            chunks,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::*;

    /// A device with a controlling client, and what its rig is asked at each write.
    struct Client(Device);

    impl Client {
        fn new() -> Self {
            let mut client = Self(Device::new(&crate::registers::tests::config()));
            assert_eq!(client.write(PRIVILEGE, 2), Ok(vec![]));
            client
        }

        fn write(&mut self, register: u32, value: u32) -> Result<Vec<Control>, Refusal> {
            let mut done = Done::default();
            let from = (Ipv4Addr::LOCALHOST, 7_000).into();
            self.0.write(register, value, from, Instant::now(), 0, &mut done)?;
            Ok(done.asks)
        }
    }

    #[test]
    fn exposure_and_rate_change_a_running_acquisition() {
        let run = |period, exposure| -> Result<Vec<Control>, Refusal> {
            Ok(vec![Control::FreeRun { period: Micros(period), exposure: Micros(exposure) }])
        };
        let mut client = Client::new();
        assert_eq!(client.write(EXPOSURE_US, 4_000), Ok(vec![]), "nothing runs yet");
        assert_eq!(client.write(ACQUISITION, START), run(40_000, 4_000));
        assert_eq!(client.write(GAIN, 200), Ok(vec![]));
        assert_eq!(client.write(EXPOSURE_US, 6_000), run(40_000, 6_000));
        assert_eq!(client.write(FRAME_RATE, 10_000), run(100_000, 6_000));
        assert_eq!(client.write(EXPOSURE_US, 200_000), run(200_000 + BETWEEN_EXPOSURES_US, 200_000));
        assert_eq!(client.write(ACQUISITION, STOP), run(0, 200_000));
    }

    #[test]
    fn the_size_of_a_frame_is_locked_during_an_acquisition() {
        let mut client = Client::new();
        assert!(client.write(ACQUISITION, START).is_ok());
        let size = [(WIDTH, 320), (HEIGHT, 240), (OFFSET_X, 0), (PIXEL_FORMAT, MONO_8)];
        for (register, value) in size.into_iter().chain([(CHUNK_MODE, 1), (CHUNK_ENABLE + 4, 1)]) {
            assert_eq!(client.write(register, value), Err(Refusal::WriteProtect), "{register:x}");
        }
        assert!(client.write(ACQUISITION, STOP).is_ok());
        assert_eq!(client.write(WIDTH, 320), Ok(vec![]));
    }
}
