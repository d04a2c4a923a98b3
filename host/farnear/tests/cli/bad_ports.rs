//! Ports without a rig: absent, busy, not a port, silent, garbage, another protocol version.

use std::{
    io::{Read, Write},
    time::Duration,
};

use farnear_protocol::{
    RequestError,
    frame::{Decoder, Header, Kind, encode},
};
use serialport::{SerialPort, TTYPort};

use crate::common::{Folder, fails, farnear, rig_optics};

#[track_caller]
fn capture_fails(port: &str, phrases: &[&str]) {
    let folder = Folder::new();
    let images = folder.path("images");
    std::fs::create_dir(&images).expect("a writable folder");
    let (out, camera) = (folder.text("out"), format!("folder:{}", folder.text("images")));
    let capture =
        ["rig", "capture", "--port", port, "--camera", &camera, "--optics", rig_optics(), "--out", &out];
    fails(&mut farnear(&capture), 1, phrases);
    assert_eq!(folder.listing(), ["images"]);
}

#[test]
fn an_absent_port_is_named_with_those_that_are_there() {
    capture_fails("/dev/farnear-absent", &["port /dev/farnear-absent does not exist", "present"]);
    for job in [
        vec!["info"],
        vec!["home"],
        vec!["stop"],
        vec!["halt"],
        vec!["move", "--axis", "fine", "--to-um", "50"],
        vec!["settings", "list"],
        vec!["alarms"],
        vec!["log"],
    ] {
        let port = ["--port", "/dev/farnear-absent"];
        fails(farnear(&["rig"]).args(job).args(port), 1, &["port /dev/farnear-absent does not exist"]);
    }
}

#[test]
fn the_environment_names_the_port_where_no_flag_does() {
    let absent = |name: &str| format!("port {name} does not exist");
    let named = |args: &[&str]| {
        let mut command = farnear(args);
        command.env("FARNEAR_PORT", "/dev/farnear-absent");
        command
    };
    fails(&mut named(&["rig", "info"]), 1, &[&absent("/dev/farnear-absent")]);
    fails(&mut named(&["rig", "info", "--port", "/dev/farnear-other"]), 1, &[&absent("/dev/farnear-other")]);
    fails(&mut named(&["rig", "info", "--seed", "3"]), 2, &["--seed goes with --port sim only"]);
}

#[test]
fn files_and_folders_are_rejected_as_ports() {
    capture_fails(rig_optics(), &["rig.toml is not a serial port"]);
    capture_fails(env!("CARGO_TARGET_TMPDIR"), &["is not a serial port"]);
}

/// The far end of a line and the name under which the program opens it. Both ends stay open while this lives.
struct Line {
    far_end: TTYPort,
    near_end: TTYPort,
}

impl Line {
    fn new() -> Self {
        let (mut far_end, near_end) = TTYPort::pair().expect("a pty");
        far_end.set_timeout(Duration::from_millis(20)).expect("a timeout");
        Self { far_end, near_end }
    }

    fn name(&self) -> String {
        self.near_end.name().expect("a pty's name")
    }
}

#[test]
fn busy_and_absent_ports_have_different_errors() {
    let line = Line::new();
    let held = serialport::new(line.name(), 115_200).open_native().expect("a free port");
    capture_fails(&line.name(), &["is busy", &line.name(), "end that program"]);
    drop(held);
}

#[test]
fn a_silent_port_is_named_in_the_error() {
    let line = Line::new();
    capture_fails(&line.name(), &["no answer", &line.name(), "nothing at all came", "powered"]);
}

#[test]
fn noise_and_silence_have_different_errors() {
    let mut line = Line::new();
    let name = line.name();
    std::thread::spawn(move || {
        // Until the program ends: a repeating pattern that contains the frame delimiter.
        for byte in (0..=255u8).cycle() {
            std::thread::sleep(Duration::from_millis(2));
            if line.far_end.write_all(&[byte, byte.wrapping_mul(7), 0]).is_err() {
                return;
            }
        }
    });
    capture_fails(&name, &["no answer", &name, "broken frames came", "right port"]);
}

/// Answers every request like a board that supports protocols 4 to 5 only.
fn board_of_the_future(mut line: Line) {
    let mut decoder = Decoder::new();
    let mut bytes = [0; 64];
    while let Ok(count) = line.far_end.read(&mut bytes).or_else(|error| match error.kind() {
        std::io::ErrorKind::TimedOut => Ok(0),
        _ => Err(error),
    }) {
        for byte in &bytes[..count] {
            let Some(Ok(packet)) = decoder.push(*byte) else { continue };
            let header = Header { kind: Kind::Error, ..packet.header };
            let answer = encode(header, &RequestError::Version { min: 4, current: 5 }).expect("it fits");
            line.far_end.write_all(&answer).expect("a line");
        }
    }
}

#[test]
fn another_protocol_version_is_reported_with_both_versions() {
    let line = Line::new();
    let name = line.name();
    std::thread::spawn(move || board_of_the_future(line));
    let phrases = ["the board speaks protocol 4 to 5, this program 3 to 3", "use a newer farnear"];
    fails(&mut farnear(&["rig", "info", "--port", &name]), 1, &phrases);
    capture_fails(&name, &phrases);
}

#[test]
fn an_invalid_camera_is_reported_before_any_motion() {
    let folder = Folder::new();
    let out = folder.text("out");
    for (camera, code, phrases) in [
        ("webcam", 2, vec!["camera webcam", "folder:DIR"]),
        ("folder:/farnear-absent", 1, vec!["/farnear-absent", "No such file"]),
        (
            "sim",
            2,
            vec![
                "camera sim: it belongs to the emulated rig and is the default",
                "name the camera of /dev/farnear-absent: HOST:PORT, folder:DIR",
            ],
        ),
        ("127.0.0.1:1", 1, vec!["127.0.0.1:1", "refused"]),
    ] {
        // The camera is checked first: the absent port would give another message.
        let capture = ["rig", "capture", "--port", "/dev/farnear-absent", "--camera", camera];
        fails(farnear(&capture).args(["--optics", rig_optics(), "--out", &out]), code, &phrases);
        assert_eq!(folder.listing(), Vec::<String>::new());
    }
}
