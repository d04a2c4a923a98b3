//! GigE Vision over the real transport with Aravis' fake camera on loopback. The fake camera draws the frame number:
//! the pixel in column x, row y of frame n is (x + y + n) mod 255 at 10 ms exposure without gain.

use std::{
    io::Write,
    process::{Child, Command, Stdio},
    sync::{Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use aravis::prelude::*;
use farnear_capture::camera::{
    Camera, CameraError, Frame, GenicamCamera, Setting, genicam,
    pairing::{Belongs, Pairing},
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::{BoardMicros, Micros},
};

use super::cameras::shot;

const WAIT: Duration = Duration::from_secs(20);
/// Exposure for full contrast.
const EXPOSURE: Micros = Micros(10_000);
const NUMBERS: u64 = 255;
/// Of the fake camera, for FrameStart.
const TRIGGER_SOURCE: u64 = 0x304;
const ID: &str = "Aravis-Fake-GV01";
/// Scheduling delay: the fake camera stamps frames in its own process.
const SCHEDULING: Duration = Duration::from_secs(15);

/// One camera port per address, so one test at a time.
pub static ALONE: Mutex<()> = Mutex::new(());

struct Fake {
    child: Child,
    _alone: MutexGuard<'static, ()>,
}

impl Fake {
    fn start(lost_per_thousand: u32) -> Self {
        Self::with(&["-r", &lost_per_thousand.to_string()])
    }

    fn with(arguments: &[&str]) -> Self {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let child = Command::new("arv-fake-gv-camera-0.8")
            .args(["-i", "lo", "-s", ID.trim_start_matches("Aravis-Fake-")])
            .args(arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self { child, _alone: alone }
    }

    fn open(&self) -> GenicamCamera {
        let until = Instant::now() + WAIT;
        loop {
            match GenicamCamera::open(ID) {
                Ok(camera) => return camera.with_jitter(SCHEDULING),
                Err(error) => assert!(Instant::now() < until, "{error}"),
            }
        }
    }

    fn signal(&self, signal: &str) {
        let sent = Command::new("kill").args([signal, &self.child.id().to_string()]).status();
        assert!(sent.unwrap().success(), "{signal}");
    }

    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The fake camera with text before some parts of its description, for features of real cameras.
fn described(changes: &[(&str, &str)]) -> (Fake, tempfile::NamedTempFile) {
    static USUAL: OnceLock<String> = OnceLock::new();
    let usual = || {
        let usual = Fake::start(0);
        drop(usual.open());
        let camera = aravis::Camera::new(Some(ID)).unwrap();
        camera.device().unwrap().genicam_xml().0.to_string()
    };
    let mut text = USUAL.get_or_init(usual).clone();
    for (part, before) in changes {
        assert!(text.contains(part), "{part}");
        text = text.replacen(part, &format!("{before}{part}"), 1);
    }
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    let fake = Fake::with(&["-g", file.path().to_str().unwrap()]);
    drop(fake.open()); // waits until it answers
    (fake, file)
}

fn number(name: &str, address: u32, min: f64) -> String {
    format!(
        "<Float Name=\"{name}\"><pValue>{name}Register</pValue><Min>{min}</Min><Max>24</Max></Float>\
         <FloatReg Name=\"{name}Register\"><Address>{address}</Address><Length>4</Length><AccessMode>RW</AccessMode>\
         <pPort>Device</pPort><Endianess>BigEndian</Endianess></FloatReg>"
    )
}

fn values<const N: usize>(camera: &mut GenicamCamera, names: [&str; N]) -> [Option<String>; N] {
    let controls = camera.controls().unwrap();
    names.map(|name| controls.iter().find(|control| control.name == name).map(|c| c.value.clone()))
}

fn drawn(pixels: &ndarray::Array2<u16>) -> u64 {
    u64::from(pixels[[0, 0]])
}

fn shot_at(trigger_number: u32, since: Instant) -> ShotRecord {
    ShotRecord { strobe_start: BoardMicros(since.elapsed().as_micros() as u64), ..shot(trigger_number) }
}

fn next(camera: &mut GenicamCamera) -> Frame {
    camera.newest(WAIT).unwrap().expect("a frame within the wait")
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn discovers_describes_configures_and_watches_the_camera() {
    let fake = Fake::start(0);
    let mut camera = fake.open();
    let found = genicam::devices();
    assert!(found.iter().any(|found| found.id == ID), "{found:?}");
    camera.set(&Setting::ExposureUs(f64::from(EXPOSURE.0))).unwrap();
    camera.set(&Setting::Region([0, 0, 128, 64])).unwrap();
    let controls = camera.controls().unwrap();
    let value = |name: &str| controls.iter().find(|control| control.name == name).map(|c| c.value.as_str());
    assert_eq!((value("exposure_us"), value("region")), (Some("10000"), Some("0,0,128,64")));
    assert_eq!((value("pixel_format"), value("model")), (Some("Mono8"), Some("Fake")));
    for (setting, phrase) in [
        (Setting::ExposureUs(1e12), "us"),
        (Setting::PixelFormat("Mono13".into()), "Mono16"),
        (Setting::Region([0, 0, 5000, 5000]), "sensor's"),
        (Setting::TriggerSource("Line77".into()), "Software"),
        (Setting::Gain(3.7), "made 3 of it"),
    ] {
        let error = camera.set(&setting).unwrap_err();
        assert!(
            matches!(error, CameraError::Setting { .. }) && error.to_string().contains(phrase),
            "{error}"
        );
    }
    // The camera has rounded 3.7 to a gain of 3, which multiplies its pixels.
    camera.set(&Setting::Gain(0.0)).unwrap();
    camera.watch().unwrap();
    let (first, second) = (next(&mut camera), next(&mut camera));
    assert_eq!((first.image.pixels.dim(), first.image.bits), ((64, 128), 8));
    assert!(second.stamp.time > first.stamp.time, "{:?} {:?}", first.stamp, second.stamp);
    assert_eq!(drawn(&second.image.pixels), second.stamp.count.unwrap() % NUMBERS);
    let absent = GenicamCamera::open("Absent-1").err().unwrap().to_string();
    assert!(absent.contains("Absent-1") && absent.contains(ID), "{absent}");
    drop(camera);
    GenicamCamera::open("127.0.0.1").unwrap();
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn arming_ends_automatics_and_gamma_and_keeps_the_falling_edge() {
    let edge = "<EnumEntry Name=\"FallingEdge\"><Value>1</Value></EnumEntry>";
    let (fake, _file) = described(&[
        ("<pValue>TriggerActivationRegister</pValue>", edge),
        ("<Enumeration Name=\"GainAuto\"", &number("Gamma", 0x8000, 0.1)),
    ]);
    let other = with_falling_edge();
    other.set_string("GainAuto", "Continuous").unwrap();
    other.set_float("Gamma", 0.5).unwrap();
    drop(other);
    let mut camera = fake.open();
    let names = ["GainAuto", "Gamma", "TriggerActivation"];
    let all = |values: [&str; 3]| values.map(|value| Some(value.to_owned()));
    assert_eq!(values(&mut camera, names), all(["Continuous", "0.5", "FallingEdge"]));
    camera.arm(TriggerMode::Software, EXPOSURE).unwrap();
    assert_eq!(values(&mut camera, names), all(["Off", "1", "FallingEdge"]));
}

/// The camera as another program opens it, with the falling edge set.
fn with_falling_edge() -> aravis::Camera {
    let other = aravis::Camera::new(Some(ID)).unwrap();
    for (name, entry) in [("TriggerSelector", "FrameStart"), ("TriggerActivation", "FallingEdge")] {
        other.set_string(name, entry).unwrap();
    }
    other
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn a_refused_trigger_source_does_not_change_the_edge() {
    let source = "TriggerSource\"><EnumEntry Name=\"Line0\"><Value>0</Value></EnumEntry>\
                  <pValue>TriggerSourceRegister</pValue></Enumeration><Enumeration Name=\"Old";
    let (fake, _file) = described(&[
        (
            "<pValue>TriggerActivationRegister</pValue>",
            "<EnumEntry Name=\"FallingEdge\"><Value>1</Value></EnumEntry>",
        ),
        ("TriggerSource\" NameSpace=\"Standard\"", source),
    ]);
    drop(with_falling_edge());
    let mut camera = fake.open();
    let error = camera.arm(TriggerMode::Software, EXPOSURE).unwrap_err();
    assert!(matches!(error, CameraError::Unusable { .. }), "{error:?}");
    assert_eq!(values(&mut camera, ["TriggerActivation"]), [Some("FallingEdge".to_owned())]);
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn a_trigger_that_cannot_be_turned_off_and_is_not_on_is_left() {
    let off = "<IntSwissKnife Name=\"OffIsThere\"><pVariable Name=\"SELECTED\">TriggerSelectorInteger</pVariable>\
               <Formula>1 - SELECTED</Formula></IntSwissKnife>";
    let mode = "TriggerMode\"><EnumEntry Name=\"Off\"><pIsAvailable>OffIsThere</pIsAvailable><Value>0</Value></EnumEntry>\
                <EnumEntry Name=\"On\"><Value>1</Value></EnumEntry><pValue>TriggerModeRegister</pValue></Enumeration>\
                <Enumeration Name=\"Old";
    let (fake, _file) = described(&[
        ("<Enumeration Name=\"TriggerMode\"", off),
        ("TriggerMode\" NameSpace=\"Standard\"", mode),
    ]);
    let mut camera = fake.open();
    camera.arm(TriggerMode::Software, EXPOSURE).unwrap();
    camera.trigger(1, EXPOSURE).unwrap();
    camera.image(&shot_at(1, Instant::now()), WAIT).unwrap();
    camera.watch().unwrap();
    next(&mut camera);
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn an_exposure_time_of_whole_microseconds_is_set() {
    let whole = "<Integer Name=\"ExposureTime\"><pValue>ExposureTimeRegister</pValue><Min>20</Min><Max>500000</Max></Integer>\
                 <IntReg Name=\"ExposureTimeRegister\"><Address>0x8020</Address><Length>4</Length><AccessMode>RW</AccessMode>\
                 <pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>";
    let (fake, _file) = described(&[("<Float Name=\"ExposureTimeAbs\"", whole)]);
    let mut camera = fake.open();
    camera.arm(TriggerMode::Software, Micros(7_000)).unwrap();
    assert_eq!(values(&mut camera, ["exposure_us"]), [Some("7000".to_owned())]);
    assert_eq!(aravis::Camera::new(Some(ID)).unwrap().integer("ExposureTime").unwrap(), 7_000);
    let refused = camera.set(&Setting::ExposureUs(10.0)).unwrap_err().to_string();
    assert!(refused.contains("20 to 500000 us"), "{refused}");
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn negative_gains_steps_and_values_without_a_name() {
    let column = "OffsetX\"><pValue>OffsetXRegister</pValue><Min>0</Min><Max>512</Max><Inc>4</Inc></Integer>\
                  <Integer Name=\"Old";
    let (fake, _file) = described(&[
        ("<Enumeration Name=\"GainAuto\"", &number("Gain", 0x8010, -5.0)),
        ("OffsetX\" NameSpace=\"Standard\"", column),
    ]);
    let mut camera = fake.open();
    camera.set(&Setting::Gain(-2.5)).unwrap();
    camera.set(&Setting::Region([4, 0, 128, 64])).unwrap();
    let refused = camera.set(&Setting::Region([3, 0, 128, 64])).unwrap_err().to_string();
    assert!(refused.contains("expected a column from 0 px in steps of 4 px"), "{refused}");
    let names = ["gain", "region", "trigger_source"];
    let [gain, region, source] = values(&mut camera, names);
    assert_eq!((gain.as_deref(), region.as_deref()), (Some("-2.5"), Some("4,0,128,64")));
    assert!(source.is_some());
    drop(camera);
    let other = aravis::Camera::new(Some(ID)).unwrap();
    other.set_string("TriggerSelector", "FrameStart").unwrap();
    other.device().unwrap().write_register(TRIGGER_SOURCE, 99).unwrap();
    drop(other);
    assert_eq!(values(&mut fake.open(), names)[2], None);
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn each_software_trigger_gives_a_frame_and_a_surplus_one_is_an_error() {
    let fake = Fake::start(0);
    let mut camera = fake.open();
    camera.arm(TriggerMode::Software, EXPOSURE).unwrap();
    let begin = Instant::now();
    let mut before = None;
    for number in 7..12 {
        let exposure = shot_at(number, begin);
        camera.trigger(number, EXPOSURE).unwrap();
        let number = drawn(&camera.image(&exposure, WAIT).unwrap().pixels);
        assert!(
            before.is_none_or(|before| (before + 1) % NUMBERS == number % NUMBERS),
            "{before:?} {number}"
        );
        before = Some(number);
    }
    camera.finish(Duration::ZERO).unwrap();
    let late = camera.image(&shot_at(12, begin), Duration::from_millis(50)).unwrap_err();
    assert!(matches!(late, CameraError::Late { trigger_number: 12, .. }), "{late:?}");
    // A strobe at another time belongs to another exposure.
    camera.trigger(12, EXPOSURE).unwrap();
    let elsewhere = ShotRecord { strobe_start: BoardMicros(3_600_000_000), ..shot(12) };
    let mispaired = camera.image(&elsewhere, WAIT).unwrap_err();
    assert!(matches!(mispaired, CameraError::Mispaired { wanted: 12, .. }), "{mispaired:?}");
    let until = Instant::now() + WAIT;
    camera.trigger(13, EXPOSURE).unwrap();
    let surplus = loop {
        match camera.finish(Duration::ZERO) {
            Ok(()) => assert!(Instant::now() < until, "no surplus frame"),
            Err(error) => break error,
        }
    };
    assert!(matches!(surplus, CameraError::Surplus { .. }), "{surplus:?}");
}

/// UDP ports of this process on all interfaces.
fn own_ports() -> Vec<u16> {
    let links = std::fs::read_dir("/proc/self/fd").unwrap();
    let targets = links.filter_map(|link| std::fs::read_link(link.ok()?.path()).ok());
    let open: Vec<String> = targets.map(|target| target.display().to_string()).collect();
    let table = std::fs::read_to_string("/proc/net/udp").unwrap();
    let port = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (_, port) = fields[1].split_once(':')?;
        let inode = format!("socket:[{}]", fields[9]);
        open.contains(&inode).then(|| u16::from_str_radix(port, 16).unwrap())
    };
    table.lines().skip(1).filter_map(port).collect()
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn a_packet_of_another_program_is_no_frame() {
    let fake = Fake::start(0);
    let mut camera = fake.open();
    camera.arm(TriggerMode::Software, EXPOSURE).unwrap();
    // Frame 1, packet 0, of a type that GigE Vision does not have.
    let foreign = [&[0, 0, 0, 1, 0x7f, 0, 0, 0][..], &[0; 56]].concat();
    let sender = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let ports = own_ports();
    assert!(ports.len() > 1, "only the sender's socket was found: {ports:?}");
    for port in ports {
        sender.send_to(&foreign, ("127.0.0.1", port)).unwrap();
    }
    camera.trigger(1, EXPOSURE).unwrap();
    camera.image(&shot_at(1, Instant::now()), WAIT).unwrap();
    camera.finish(Duration::ZERO).unwrap();
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn reports_lost_packets_and_never_returns_another_exposures_frame() {
    // FARNEAR_GIGE_FRAMES=10000 for the long run.
    let frames = std::env::var("FARNEAR_GIGE_FRAMES").ok().and_then(|text| text.parse().ok()).unwrap_or(150);
    let fake = Fake::start(10);
    let mut camera = fake.open();
    camera.set(&Setting::ExposureUs(f64::from(EXPOSURE.0))).unwrap();
    camera.set(&Setting::Region([0, 0, 128, 128])).unwrap(); // a dozen packets a frame
    camera.watch().unwrap();
    // One exposure per period; the first frame's number gives the offset.
    let (mut pairing, mut exposure, mut first) = (Pairing::with_jitter(WAIT * 1000), 0_u32, None);
    let (mut paired, mut incomplete, mut passed_over) = (0, 0, 0);
    while exposure < frames {
        let frame = match camera.newest(WAIT) {
            Ok(frame) => frame.expect("a frame within the wait"),
            Err(CameraError::Incomplete { reason, .. }) => {
                assert!(reason.contains("packets were lost"), "{reason}");
                incomplete += 1;
                continue;
            }
            Err(error) => panic!("{error}"),
        };
        let number = drawn(&frame.image.pixels);
        let first = *first.get_or_insert(number);
        loop {
            match pairing.judge("fake", frame.stamp, &shot(exposure)).unwrap() {
                Belongs::Here => break,
                Belongs::Later(by) => {
                    passed_over += by;
                    exposure += by as u32;
                }
                Belongs::Earlier => panic!("a frame came twice: {:?}", frame.stamp),
            }
        }
        assert_eq!((first + u64::from(exposure)) % NUMBERS, number % NUMBERS, "exposure {exposure}");
        (paired, exposure) = (paired + 1, exposure + 1);
    }
    println!(
        "{frames} exposures: {paired} paired, {incomplete} reported incomplete, {passed_over} passed over"
    );
    assert!(paired > frames / 2 && incomplete > 0, "{paired} {incomplete}");
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn a_frozen_camera_is_left_at_once() {
    let fake = Fake::start(0);
    for watches in [true, false] {
        let mut camera = fake.open();
        if watches {
            camera.watch().unwrap();
            next(&mut camera);
        }
        fake.signal("-STOP");
        let begin = Instant::now();
        drop(camera);
        let took = begin.elapsed();
        fake.signal("-CONT");
        // Aravis alone takes 3 s and more.
        assert!(took < Duration::from_secs(2), "{took:?}, watches: {watches}");
    }
}

#[test]
#[cfg_attr(not(fake_gige_camera), ignore = "needs arv-fake-gv-camera-0.8")]
fn reports_a_dead_camera_and_opens_the_next_one() {
    let mut fake = Fake::start(0);
    let mut camera = fake.open();
    camera.arm(TriggerMode::Software, EXPOSURE).unwrap();
    fake.kill();
    let until = Instant::now() + 3 * WAIT;
    let gone = loop {
        match camera.image(&shot(1), Duration::from_millis(200)) {
            Err(CameraError::Late { .. }) => assert!(Instant::now() < until, "the end was not detected"),
            Err(error) => break error,
            Ok(_) => panic!("an image from nowhere"),
        }
    };
    assert!(matches!(gone, CameraError::Gone { .. }) && gone.to_string().contains("GV01"), "{gone:?}");
    drop(camera);
    drop(fake);
    let fake = Fake::start(0);
    let mut camera = fake.open();
    camera.watch().unwrap();
    next(&mut camera);
}
