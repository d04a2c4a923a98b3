//! The program as a client sees it: JSON line, pty or TCP port, camera endpoint, exit.

use std::{
    collections::VecDeque,
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::Path,
    process::{Child, Command, Stdio},
    sync::LazyLock,
    time::{Duration, Instant},
};

use crate::bench::{Answer, SILENCE, answer_in, fine_shot, go, request_frame};
use farnear_protocol::{
    Event, EventKind, Request, Response,
    camera::{Control, FRAME_HEADER, FrameHeader},
    frame::{Decoder, Kind},
    message::Axis,
};
/// Turns a hang into a failure.
const PATIENCE: Duration = Duration::from_secs(60);
pub const NEAR_HOME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/near-home.toml");
const USUAL: [&str; 8] = ["--scene", "staircase", "--noise", "8bit", "--seed", "3", "--scenario", NEAR_HOME];

/// Both frames of a rig with the options [`USUAL`].
static CAPTURED: LazyLock<Vec<(FrameHeader, Vec<u8>)>> = LazyLock::new(|| {
    let program = Program::start(&USUAL);
    let frames = capture(&program);
    assert!(program.end().success());
    frames
});

pub struct Program {
    child: Child,
    pub port: String,
    camera: String,
    second_camera: Option<String>,
    pub gige: Option<String>,
}

impl Program {
    pub fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_farnear-sim"));
        command.arg("run").args(arguments);
        Self::launch(command)
    }

    fn launch(mut command: Command) -> Self {
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("farnear-sim starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("text");
        let value = |key: &str| {
            let (_, rest) =
                line.split_once(&format!("\"{key}\": \"")).unwrap_or_else(|| panic!("no {key}: {line}"));
            rest.split('"').next().expect("a value").to_string()
        };
        let (port, camera) = (value("port"), value("camera"));
        let gige = line.contains("\"gige\"").then(|| value("gige"));
        let second_camera = line.contains("\"second_camera\"").then(|| value("second_camera"));
        Self { child, port, camera, second_camera, gige }
    }

    /// Closes standard input and waits for the exit.
    pub fn end(mut self) -> std::process::ExitStatus {
        drop(self.child.stdin.take());
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().expect("can be waited for") {
                return status;
            }
            if Instant::now() > deadline {
                self.child.kill().expect("can be killed");
                panic!("farnear-sim did not end when its standard input closed");
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

trait Line: Read + Write {}
impl<T: Read + Write + ?Sized> Line for T {}

fn open_line(name: &str) -> Box<dyn Line> {
    let wait = Duration::from_millis(100);
    match name.strip_prefix("tcp:") {
        None => Box::new(serialport::new(name, 2_000_000).timeout(wait).open().expect("the pty opens")),
        Some(address) => {
            let stream = TcpStream::connect(address).expect("the port listens");
            stream.set_read_timeout(Some(wait)).expect("a timeout");
            Box::new(stream)
        }
    }
}

fn is_timeout(error: &std::io::Error) -> bool {
    matches!(error.kind(), std::io::ErrorKind::TimedOut | std::io::ErrorKind::WouldBlock)
}

struct Client {
    port: Box<dyn Line>,
    decoder: Decoder,
    /// Bytes received after the last match.
    rest: VecDeque<u8>,
    boot: u32,
    next: u32,
}

impl Client {
    fn open(name: &str) -> Self {
        let port = open_line(name);
        let mut client = Self { port, decoder: Decoder::new(), rest: VecDeque::new(), boot: 0, next: 0 };
        match client.ask(&Request::Hello) {
            Ok(Response::Hello(hello)) => (client.boot, client.next) = (hello.boot, hello.last_id),
            other => panic!("no hello but {other:?}"),
        }
        assert_eq!(client.ask(&Request::OpenSession), Ok(Response::Accepted));
        client
    }

    fn wait<T>(&mut self, wanted: impl Fn(&farnear_protocol::frame::Packet) -> Option<T>) -> T {
        let deadline = Instant::now() + PATIENCE;
        let mut bytes = [0; 256];
        while Instant::now() < deadline {
            let read = if self.rest.is_empty() { self.port.read(&mut bytes) } else { Ok(0) };
            let count = match read {
                Ok(count) => count,
                Err(error) if is_timeout(&error) => 0,
                Err(error) => panic!("the port failed: {error}"),
            };
            self.rest.extend(&bytes[..count]);
            while let Some(byte) = self.rest.pop_front() {
                if let Some(Ok(packet)) = self.decoder.push(byte)
                    && let Some(found) = wanted(&packet)
                {
                    return found;
                }
            }
        }
        panic!("nothing came");
    }

    fn ask(&mut self, request: &Request) -> Answer {
        self.next += 1;
        let id = self.next;
        self.port.write_all(&request_frame(id, self.boot, request)).expect("the port takes bytes");
        self.wait(|packet| {
            answer_in(packet).filter(|(answered, _)| *answered == id).map(|(_, answer)| answer)
        })
    }

    fn time_us(&mut self) -> u64 {
        match self.ask(&Request::Status) {
            Ok(Response::Status(status)) => status.time.0,
            other => panic!("expected Status, got {other:?}"),
        }
    }

    fn carry_out(&mut self, request: &Request) -> EventKind {
        assert_eq!(self.ask(request), Ok(Response::Accepted));
        self.wait(|packet| {
            let event: Event = (packet.header.kind == Kind::Event).then(|| packet.message())??;
            let ended = !matches!(event.kind, EventKind::Started { .. } | EventKind::ShotDone { .. });
            ended.then_some(event.kind)
        })
    }
}

fn receive_frame(camera: &mut TcpStream) -> (FrameHeader, Vec<u8>) {
    let mut length = [0; 4];
    camera.read_exact(&mut length).expect("a frame");
    let mut header = [0; FRAME_HEADER];
    camera.read_exact(&mut header).expect("a header");
    let mut pixels = vec![0; u32::from_le_bytes(length) as usize - FRAME_HEADER];
    camera.read_exact(&mut pixels).expect("pixels");
    (FrameHeader::from_bytes(&header).expect("a valid header"), pixels)
}

/// Homes, moves to far focus, captures a pair; returns both frames.
pub fn capture(program: &Program) -> Vec<(FrameHeader, Vec<u8>)> {
    let mut client = Client::open(&program.port);
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        let homed = client.carry_out(&Request::Home { axis, silence: SILENCE });
        assert!(matches!(homed, EventKind::Homed { .. }), "{homed:?}");
    }
    for (axis, target) in [(Axis::SensorCoarse, 5_821_300), (Axis::Lens, 1_000)] {
        let moved = client.carry_out(&go(axis, target));
        assert!(matches!(moved, EventKind::MoveDone { .. }), "{moved:?}");
    }
    for (index, target) in [(0, 10_000), (1, 166_270)] {
        let shot = fine_shot(target, 5_000, 50, 2_000);
        assert_eq!(client.ask(&Request::LoadShot { index, shot }), Ok(Response::Accepted));
    }
    assert_eq!(client.ask(&Request::ArmProgram { shots: 2 }), Ok(Response::Accepted));
    let done = client.carry_out(&Request::RunProgram { silence: SILENCE });
    assert!(matches!(done, EventKind::ProgramDone { exposures: 2, .. }), "{done:?}");
    // The frames were queued.
    frames_at(&program.camera)
}

fn frames_at(address: &str) -> Vec<(FrameHeader, Vec<u8>)> {
    let mut camera = TcpStream::connect(address).expect("the endpoint is open");
    camera.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    (0..2).map(|_| receive_frame(&mut camera)).collect()
}

#[cfg(target_os = "linux")]
#[test]
fn nohup_lets_it_outlive_its_terminal() {
    let mut command = Command::new("nohup");
    command.args([env!("CARGO_BIN_EXE_farnear-sim"), "run"]);
    let mut program = Program::launch(command);
    let hung_up = Command::new("kill").args(["-HUP", &program.child.id().to_string()]).status();
    assert!(hung_up.expect("kill runs").success());
    for _ in 0..50 {
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(program.child.try_wait().expect("can be waited for"), None, "SIGHUP ended it");
    }
    assert!(program.end().success());
}

#[test]
fn a_capture_through_pty_and_camera_repeats_to_the_byte() {
    let first = &*CAPTURED;
    assert_eq!((first[0].0.width, first[0].0.height, first[0].0.bits), (640, 480, 8));
    assert_eq!([first[0].0.shot_id, first[1].0.shot_id], [0, 1]);
    assert_ne!(first[0].1, first[1].1, "far and near look alike");
    let program = Program::start(&USUAL);
    let second = capture(&program);
    assert!(program.end().success());
    assert!(*first == second, "two programs with one seed differ");
    let program = Program::start(&[&USUAL[..], &["--tcp"]].concat());
    assert!(program.port.starts_with("tcp:127.0.0.1:"), "{}", program.port);
    let third = capture(&program);
    assert!(program.end().success());
    assert!(*first == third, "the kind of port changes the run");
}

#[test]
fn a_tcp_port_serves_one_client_after_the_other() {
    let program = Program::start(&["--tcp"]);
    let mut client = Client::open(&program.port);
    let mut other = open_line(&program.port);
    let deadline = Instant::now() + PATIENCE;
    loop {
        assert!(Instant::now() < deadline, "a second client is kept waiting");
        match other.read(&mut [0; 8]) {
            Err(error) if is_timeout(&error) => {}
            ended => break assert!(!matches!(ended, Ok(1..)), "the second client receives bytes"),
        }
    }
    let time_us = client.time_us();
    drop(client);
    assert!(Client::open(&program.port).time_us() >= time_us, "the board did not restart");
    assert!(program.end().success());
}

#[test]
fn a_half_mirror_gives_a_picture_of_both_cameras_per_trigger() {
    let program = Program::start(&[&USUAL[..], &["--half-mirror"]].concat());
    let first = capture(&program);
    let second = frames_at(program.second_camera.as_ref().expect("a second address"));
    assert!(program.end().success());
    for (first, second) in first.iter().zip(&second) {
        assert_eq!(first.0, second.0, "trigger, moment, size and bits");
        assert_ne!(first.1, second.1, "both sensors are at the same place");
    }
    assert_eq!([second[0].0.shot_id, second[1].0.shot_id], [0, 1]);
    // Half of 45 % of the full well. 3 codes exceed the texture's deviation and are far below the other half.
    for (_, pixels) in first.iter().chain(&second) {
        let mean = pixels.chunks(2).map(|code| f64::from(code[0])).sum::<f64>() / (640.0 * 480.0);
        assert!((mean - 0.225 * 255.0).abs() < 3.0, "{mean}");
    }
    // The first exposure at the further sensor resembles a single camera's near image more than its own far
    // image.
    let single = &*CAPTURED;
    let unlike = |pixels: &[u8]| {
        let bright = second[0].1.chunks(2).map(|code| 2.0 * f64::from(code[0]));
        bright.zip(pixels.chunks(2)).map(|(a, b)| (a - f64::from(b[0])).powi(2)).sum::<f64>()
    };
    assert!(unlike(&single[1].1) < unlike(&single[0].1));
}

#[test]
fn time_passes_only_on_request() {
    let program = Program::start(&[]);
    let mut client = Client::open(&program.port);
    let before = client.time_us();
    std::thread::sleep(Duration::from_millis(300));
    let asked_us = client.time_us() - before;
    assert!(asked_us < 50_000, "{asked_us} us passed without a request");

    let mut camera = TcpStream::connect(&program.camera).expect("the endpoint is open");
    let mut body = [0; 16];
    let body = postcard::to_slice(&Control::AdvanceMicros(2_000_000), &mut body).expect("fits");
    camera.write_all(&(body.len() as u32).to_le_bytes()).expect("open");
    camera.write_all(body).expect("open");
    let deadline = Instant::now() + PATIENCE;
    while client.time_us() < before + 2_000_000 {
        assert!(Instant::now() < deadline, "time does not pass");
    }
    assert!(program.end().success());
}

#[test]
fn a_paced_rig_answers() {
    let program = Program::start(&["--paced"]);
    let mut client = Client::open(&program.port);
    let before = client.time_us();
    while client.time_us() < before + 100_000 {}
    assert!(program.end().success());
}

#[test]
fn garbage_comes_first_and_the_port_goes_away_in_mid_move() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let faults = folder.path().join("faults.toml");
    std::fs::write(&faults, "garbage = [1, 255, 0, 66, 7]\nunplug_after_ms = 1000\n").expect("can write");
    let program = Program::start(&["--faults", faults.to_str().expect("text")]);
    let mut client = Client::open(&program.port);
    assert_eq!(
        client.ask(&Request::Home { axis: Axis::SensorCoarse, silence: SILENCE }),
        Ok(Response::Accepted)
    );
    let deadline = Instant::now() + PATIENCE;
    let mut bytes = [0; 64];
    let gone = loop {
        assert!(Instant::now() < deadline, "the port is still there");
        match client.port.read(&mut bytes) {
            Err(error) if !is_timeout(&error) => break error,
            _ => {}
        }
    };
    println!("the client sees: {gone}");
    assert!(!Path::new(&program.port).exists(), "its name is removed, too");
    assert!(program.end().success());
}

#[test]
fn a_missing_firmware_names_the_command_that_builds_it() {
    let output = Command::new(env!("CARGO_BIN_EXE_farnear-sim"))
        .args(["run", "--firmware", "no/such.elf"])
        .output()
        .expect("starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && output.stdout.is_empty());
    assert!(message.contains("no/such.elf") && message.contains("cargo xtask firmware"), "{message}");
}

#[test]
fn refuses_an_output_in_a_missing_folder_before_it_starts_and_names_the_cause_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for option in ["--memory", "--trace"] {
        let output = Command::new(env!("CARGO_BIN_EXE_farnear-sim"))
            .args(["run", option])
            .arg(folder.path().join("absent/file"))
            .stdin(Stdio::piped()) // closed: a rig that starts ends
            .output()
            .expect("starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && output.stdout.is_empty(), "{option}: {message}");
        assert!(message.contains("absent") && message.matches("os error").count() == 1, "{message}");
    }
}

#[test]
fn refuses_a_file_that_is_not_firmware() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let elf = folder.path().join("no.elf");
    for content in [&b"not an ELF file"[..], b""] {
        std::fs::write(&elf, content).expect("can write");
        let output = Command::new(env!("CARGO_BIN_EXE_farnear-sim"))
            .args(["run", "--firmware", elf.to_str().expect("text")])
            .output()
            .expect("starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{message}");
        assert!(message.contains("no.elf"), "{message}");
    }
}

#[test]
fn the_link_follows_an_adapter_that_reappears_under_another_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let (link, scenario) = (folder.path().join("rig"), folder.path().join("scenario.toml"));
    std::fs::write(&scenario, "[[happens]]\non = \"answer\"\nnth = 4\nwhat = \"link-renamed\"\n")
        .expect("writable");
    let name = |path: &Path| path.to_str().expect("text").to_string();
    let program = Program::start(&["--link", &name(&link), "--scenario", &name(&scenario)]);
    let leads_to = || std::fs::read_link(&link).expect("the link is always there");
    let before = leads_to();
    let mut client = Client::open(&name(&link));
    // Hello, session, a request: the fourth answer is the last through the old port, and may be lost with it.
    assert!(matches!(client.ask(&Request::Status), Ok(Response::Status(_))));
    let last = request_frame(client.next + 1, client.boot, &Request::Status);
    client.port.write_all(&last).expect("the port takes bytes");
    let deadline = Instant::now() + PATIENCE;
    while leads_to() == before {
        assert!(Instant::now() < deadline, "the link still points to {}", before.display());
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut bytes = [0; 64];
    while !client.port.read(&mut bytes).is_err_and(|error| !is_timeout(&error)) {
        assert!(Instant::now() < deadline, "the old port is still open");
    }
    // The board has not restarted.
    let boot = client.boot;
    let mut client = Client::open(&name(&link));
    assert_eq!(client.boot, boot);
    assert!(matches!(client.ask(&Request::Status), Ok(Response::Status(_))));
    drop(client);
    assert!(program.end().success());
    assert!(!link.is_symlink(), "the link is removed with the rig");
}
