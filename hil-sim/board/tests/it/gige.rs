//! GigE Vision camera tested with a minimal client, without a library.

use std::{
    collections::BTreeMap,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    time::{Duration, Instant},
};

use farnear_gige::{
    features::{
        ACQUISITION, CHUNK_ENABLE, CHUNK_MODE, EXPOSURE_US, FRAME_RATE, GAIN, HEIGHT, OFFSET_X, OFFSET_Y,
        PAYLOAD_SIZE, SOFTWARE, START, STOP, TRIGGER_MODE, TRIGGER_SOFTWARE, TRIGGER_SOURCE, WIDTH,
    },
    registers::{HEARTBEAT_MS, PRIVILEGE, STREAM_ADDRESS, STREAM_PORT},
};

use crate::pty::{NEAR_HOME, Program, capture};

/// The stages home while a frame is awaited, which takes long on a busy computer.
const PATIENCE: Duration = Duration::from_secs(600);
/// Timeout before a packet is requested again.
const GAP: Duration = Duration::from_millis(300);
/// Frames of which a camera can send packets again.
const FRAMES_RETAINED: usize = 8;
const WRITE_PROTECT: u16 = 0x8004;
const ACCESS_DENIED: u16 = 0x8006;

struct Client {
    control: UdpSocket,
    stream: UdpSocket,
    number: u16,
    /// Incomplete frames by number: the next may begin before a resend completes the last.
    begun: BTreeMap<u16, Packets>,
    given: u16,
}

#[derive(Default)]
struct Packets {
    packets: BTreeMap<u32, Vec<u8>>,
    last: Option<u32>,
}

impl Packets {
    fn are_all(&self) -> bool {
        self.last.is_some_and(|last| self.packets.len() as u32 == last + 1)
    }

    fn missing(&self) -> (u32, u32) {
        // The end is unknown if the trailer was lost, too.
        let end = self.last.unwrap_or_else(|| self.packets.keys().next_back().map_or(0, |last| last + 1000));
        let is_there = |packet: &u32| self.packets.contains_key(packet);
        let missing = (0..=end).find(|packet| !is_there(packet)).expect("something is");
        (missing, (missing..=end).find(is_there).map_or(end, |packet| packet - 1))
    }
}

#[derive(Debug)]
struct Frame {
    number: u16,
    time_ns: u64,
    payload: Vec<u8>,
}

impl Client {
    fn new(camera: Ipv4Addr) -> Self {
        let control = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket");
        control.connect((camera, 3956)).expect("an address");
        control.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let stream = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket");
        stream.set_read_timeout(Some(GAP)).expect("a timeout");
        Self { control, stream, number: 0, begun: BTreeMap::new(), given: 0 }
    }

    fn controlling(camera: Ipv4Addr) -> Self {
        let mut client = Self::new(camera);
        let Ok(SocketAddr::V4(to)) = client.stream.local_addr() else { panic!("expected an IPv4 address") };
        for (register, value) in [
            (PRIVILEGE, 2),
            // This client sends no heartbeat.
            (HEARTBEAT_MS, 600_000),
            (STREAM_ADDRESS, to.ip().to_bits()),
            (STREAM_PORT, u32::from(to.port())),
        ] {
            assert_eq!(client.write(register, value), 0);
        }
        client
    }

    fn ask(&mut self, code: u16, payload: &[u8]) -> (u16, Vec<u8>) {
        self.number += 1;
        let mut bytes = vec![0x42, 1];
        bytes.extend(code.to_be_bytes());
        bytes.extend((payload.len() as u16).to_be_bytes());
        bytes.extend(self.number.to_be_bytes());
        bytes.extend(payload);
        self.control.send(&bytes).expect("sent");
        let mut answer = [0; 1024];
        let length = self.control.recv(&mut answer).expect("an answer");
        assert_eq!(answer[6..8], self.number.to_be_bytes());
        (u16::from_be_bytes([answer[0], answer[1]]), answer[8..length].to_vec())
    }

    fn write(&mut self, register: u32, value: u32) -> u16 {
        self.ask(0x0082, &[register.to_be_bytes(), value.to_be_bytes()].concat()).0
    }

    fn read(&mut self, register: u32) -> u32 {
        let (status, value) = self.ask(0x0080, &register.to_be_bytes());
        assert_eq!(status, 0);
        u32::from_be_bytes(value.try_into().expect("a word"))
    }

    fn description(&mut self) -> String {
        let url = self.ask(0x0084, &[0x200_u32.to_be_bytes(), 512_u32.to_be_bytes()].concat()).1;
        let url = String::from_utf8_lossy(&url[4..]).trim_end_matches('\0').to_string();
        let parts: Vec<&str> = url.split(';').collect();
        let [at, length] = [1, 2].map(|part| u32::from_str_radix(parts[part], 16).expect("a number"));
        let mut text = Vec::new();
        for from in (at..at + length).step_by(512) {
            let part = (at + length - from).min(512).next_multiple_of(4);
            text.extend(&self.ask(0x0084, &[from.to_be_bytes(), part.to_be_bytes()].concat()).1[4..]);
        }
        String::from_utf8(text[..length as usize].to_vec()).expect("text")
    }

    /// The next acquisition restarts the numbers.
    fn drain(&mut self) {
        while self.stream.recv(&mut [0; 2048]).is_ok() {}
        (self.begun, self.given) = (BTreeMap::new(), 0);
    }

    fn frame(&mut self) -> Frame {
        let deadline = Instant::now() + PATIENCE;
        let mut bytes = [0; 2048];
        loop {
            assert!(Instant::now() < deadline, "no frame; begun are {:?}", self.begun.keys());
            // The camera keeps few frames: packets of older ones cannot be sent again.
            while self.begun.len() > FRAMES_RETAINED {
                self.begun.pop_first();
            }
            if let Some((&number, found)) = self.begun.first_key_value()
                && found.are_all()
            {
                let Packets { packets, last } = self.begun.remove(&number).unwrap_or_default();
                self.given = number;
                let time_ns = u64::from_be_bytes(packets[&0][4..12].try_into().expect("8 bytes"));
                let payload = (1..last.unwrap_or(1)).flat_map(|packet| packets[&packet].clone()).collect();
                return Frame { number, time_ns, payload };
            }
            match self.stream.recv(&mut bytes) {
                Ok(length) => {
                    let id = u16::from_be_bytes([bytes[2], bytes[3]]);
                    if id <= self.given {
                        continue; // requested and received twice
                    }
                    let frame = self.begun.entry(id).or_default();
                    let packet = u32::from_be_bytes([0, bytes[5], bytes[6], bytes[7]]);
                    if bytes[4] == 2 {
                        frame.last = Some(packet);
                    }
                    frame.packets.insert(packet, bytes[8..length].to_vec());
                }
                Err(_) => {
                    let Some((id, frame)) = self.begun.first_key_value() else { continue };
                    let (from, until) = frame.missing();
                    let again = [u32::from(*id), from, until].map(u32::to_be_bytes).concat();
                    self.number += 1;
                    let head = [0x42, 0, 0, 0x40, 0, 12, 0, self.number as u8];
                    // As in Aravis, the stream requests resends from its own port.
                    let camera = self.control.peer_addr().expect("connected");
                    self.stream.send_to(&[&head[..], &again].concat(), camera).expect("sent");
                }
            }
        }
    }
}

/// A unique loopback address: each has one port for cameras.
fn address(last: u8) -> (Ipv4Addr, String) {
    let address = Ipv4Addr::new(127, 0, 77, last);
    (address, address.to_string())
}

#[test]
fn frames_over_lossy_gige_equal_those_of_the_endpoint() {
    let (camera, text) = address(1);
    let program =
        Program::start(&["--seed", "3", "--gige", &text, "--gige-lost", "30", "--scenario", NEAR_HOME]);
    assert_eq!(program.gige.as_deref(), Some("farnear-emulated-S3"));
    let mut client = Client::controlling(camera);
    for (register, value) in [(TRIGGER_MODE, 1), (CHUNK_MODE, 1), (CHUNK_ENABLE + 4, 1), (ACQUISITION, START)]
    {
        assert_eq!(client.write(register, value), 0);
    }
    assert_eq!(client.read(PAYLOAD_SIZE), 640 * 480 + 8 + 16);
    let receiver = std::thread::spawn(move || {
        let frames = [client.frame(), client.frame()];
        (client, frames)
    });
    let by_endpoint = capture(&program);
    let (mut client, frames) = receiver.join().expect("both frames");
    for ((frame, (header, pixels)), number) in frames.iter().zip(&by_endpoint).zip(1..) {
        assert_eq!(frame.number, number);
        let grey: Vec<u8> = pixels.chunks(2).map(|pixel| pixel[0]).collect();
        assert!(frame.payload[..640 * 480] == grey, "frame {number} differs from the endpoint's");
        // The frame id as a chunk: 8 bytes before its trailer.
        assert_eq!(frame.payload[frame.payload.len() - 16..][..8], u64::from(number).to_be_bytes());
        // Board time starts at its reset, camera time at power-on; their rates agree within 50 ppm and a
        // microsecond.
        let apart = (frame.time_ns / 1000).abs_diff(header.exposure.0);
        assert!(apart < 2_000_000, "{apart} us");
    }
    let apart_ns = frames[1].time_ns - frames[0].time_ns;
    let apart_us = by_endpoint[1].0.exposure.0 - by_endpoint[0].0.exposure.0;
    assert!((apart_ns / 1000).abs_diff(apart_us) <= 5, "{apart_ns} ns, {apart_us} us");
    assert_eq!(client.write(ACQUISITION, STOP), 0);
    assert!(program.end().success());
}

#[test]
fn discovery_settings_and_exclusive_control_until_the_heartbeat_ends() {
    let (camera, text) = address(2);
    let program = Program::start(&["--noise", "12bit", "--gige", &text]);
    let mut client = Client::controlling(camera);
    let (status, about) = client.ask(2, &[]);
    assert_eq!((status, about.len()), (0, 0xF8));
    assert_eq!(about[0x48..0x4F], *b"farnear");
    let description = client.description();
    for name in ["\"Width\"", "\"TriggerSource\"", "\"Mono12\"", "ChunkFrameID", "</RegisterDescription>"] {
        assert!(description.contains(name), "{name} is not in the description");
    }
    assert_eq!(client.write(WIDTH, 4000), 0x8002);
    assert_eq!(client.ask(0x0100, &[]).0, 0x8001);
    let mut other = Client::new(camera);
    assert_eq!((other.write(PRIVILEGE, 2), other.write(GAIN, 200)), (ACCESS_DENIED, ACCESS_DENIED));
    assert_eq!(other.read(PRIVILEGE), 2, "a client without control may read");
    assert_eq!(client.write(HEARTBEAT_MS, 500), 0);
    let until = Instant::now() + PATIENCE;
    while other.write(PRIVILEGE, 2) == ACCESS_DENIED {
        assert!(Instant::now() < until, "a silent client keeps control");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(client.write(GAIN, 200), ACCESS_DENIED);
    // A second camera at the same address reports the conflict.
    let second = std::process::Command::new(env!("CARGO_BIN_EXE_farnear-sim"))
        .args(["run", "--gige", &text])
        .stdin(std::process::Stdio::piped())
        .output()
        .expect("starts");
    let stderr = String::from_utf8_lossy(&second.stderr);
    assert!(!second.status.success() && stderr.contains("3956 is taken"), "{stderr}");
    assert!(program.end().success());
}

#[test]
fn free_running_and_software_trigger_with_region_gain_and_format() {
    let (camera, text) = address(3);
    let program = Program::start(&["--scene", "plane:900", "--noise", "12bit", "--gige", &text]);
    let mut client = Client::controlling(camera);
    for (register, value) in [(WIDTH, 64), (HEIGHT, 32), (OFFSET_X, 16), (OFFSET_Y, 8), (ACQUISITION, START)]
    {
        assert_eq!(client.write(register, value), 0);
    }
    let (first, second) = (client.frame(), client.frame());
    assert_eq!((first.payload.len(), first.number, second.number), (64 * 32 * 2, 1, 2));
    // 25 frames a second of rig time, independent of the computer's speed.
    assert_eq!(second.time_ns - first.time_ns, 40_000_000);
    // Another rate takes effect while it runs; the size of a frame is locked.
    assert_eq!((client.write(FRAME_RATE, 10_000), client.write(WIDTH, 32)), (0, WRITE_PROTECT));
    let mut last_ns = second.time_ns;
    let is_slower = (0..20).any(|_| {
        let at_ns = client.frame().time_ns;
        at_ns - std::mem::replace(&mut last_ns, at_ns) == 100_000_000
    });
    assert!(is_slower, "10 frames a second after the change");
    assert_eq!(client.write(ACQUISITION, STOP), 0);
    client.drain();
    let mean = |frame: &Frame| {
        let codes = frame.payload.chunks(2).map(|code| f64::from(u16::from_le_bytes([code[0], code[1]])));
        codes.sum::<f64>() / (frame.payload.len() / 2) as f64
    };
    // One frame per software trigger; brightness follows the factor.
    let settings = [
        (TRIGGER_MODE, 1),
        (TRIGGER_SOURCE, SOFTWARE),
        (EXPOSURE_US, 5_000),
        (GAIN, 150),
        (ACQUISITION, START),
    ];
    for (register, value) in settings {
        assert_eq!(client.write(register, value), 0);
    }
    assert_eq!(client.write(TRIGGER_SOFTWARE, 1), 0);
    let bright = client.frame();
    assert_eq!(bright.number, 1);
    let factor = mean(&bright) / mean(&first);
    // Noise of a few codes on 2048 pixels, and saturation.
    assert!((factor - 1.5).abs() < 0.03, "{factor}");
    assert!(program.end().success());
}

#[test]
fn every_free_running_client_of_a_paced_rig_gets_frames_immediately() {
    let (camera, text) = address(4);
    let program = Program::start(&["--paced", "--scene", "plane:900", "--gige", &text]);
    for number in 0..3 {
        let mut client = Client::controlling(camera);
        assert_eq!(client.write(ACQUISITION, START), 0);
        let begin = Instant::now();
        let frame = client.frame();
        // Numbers restart for each client; a busy computer may lose the first frames.
        assert!(frame.number < 50, "client {number}: {}", frame.number);
        // A picture takes a fraction of a second, hundreds of old ones a minute.
        assert!(begin.elapsed() < Duration::from_secs(20), "client {number} waited {:?}", begin.elapsed());
        // The rig continues to expose without a reader, faster than it renders.
        if number < 2 {
            std::thread::sleep(Duration::from_secs(2));
        }
        assert_eq!(client.write(PRIVILEGE, 0), 0);
    }
    assert!(program.end().success());
}
