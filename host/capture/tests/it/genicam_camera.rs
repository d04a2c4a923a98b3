//! GigE Vision over the real transport with Aravis' fake camera on loopback. The fake camera draws the frame number:
//! the pixel in column x, row y of frame n is (x + y + n) mod 255 at 10 ms exposure without gain.

use std::{
    process::{Child, Command, Stdio},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

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
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let child = Command::new("arv-fake-gv-camera-0.8")
            .args(["-i", "lo", "-s", "GV01", "-r", &lost_per_thousand.to_string()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self { child, _alone: alone }
    }

    fn open(&self) -> GenicamCamera {
        let until = Instant::now() + WAIT;
        loop {
            match GenicamCamera::open("Aravis-Fake-GV01") {
                Ok(camera) => return camera.with_jitter(SCHEDULING),
                Err(error) => assert!(Instant::now() < until, "{error}"),
            }
        }
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
    assert!(found.iter().any(|found| found.id == "Aravis-Fake-GV01"), "{found:?}");
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
    ] {
        let error = camera.set(&setting).unwrap_err();
        assert!(
            matches!(error, CameraError::Setting { .. }) && error.to_string().contains(phrase),
            "{error}"
        );
    }
    camera.watch().unwrap();
    let (first, second) = (next(&mut camera), next(&mut camera));
    assert_eq!((first.image.pixels.dim(), first.image.bits), ((64, 128), 8));
    assert!(second.stamp.time > first.stamp.time, "{:?} {:?}", first.stamp, second.stamp);
    assert_eq!(drawn(&second.image.pixels), second.stamp.count.unwrap() % NUMBERS);
    let absent = GenicamCamera::open("Nobody-1").err().unwrap().to_string();
    assert!(absent.contains("Nobody-1") && absent.contains("Aravis-Fake-GV01"), "{absent}");
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
    for port in own_ports() {
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
