//! GigE Vision end to end: the emulated board triggers, Aravis receives, and the TCP endpoint has equal frames.

use std::{
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use super::genicam_camera::ALONE;
use farnear_capture::{
    Client,
    camera::{Camera, CameraError, GenicamCamera, Image, Setting, SimCamera},
    continuous::{Continuous, Loss, Outcome, Pace},
    pair::{CaptureError, Exposures, Pair, capture_pair, reach},
    plan::SensorPair,
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

/// Far and near focus of the default lens.
const SENSOR: SensorPair = SensorPair { far_mm: 52.831_257, near_mm: 52.987_52 };
const WAIT: Duration = Duration::from_secs(60);

/// `farnear-sim` next to this test, built by `cargo xtask test`.
fn simulator() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap_or(Path::new("."));
    folder.join("farnear-sim")
}

struct Rig {
    child: Child,
    port: String,
    camera: String,
    /// Empty for a rig without GigE Vision.
    gige: String,
    _alone: Option<MutexGuard<'static, ()>>,
}

impl Rig {
    fn start(seed: u64, arguments: &[&str]) -> Self {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        Self::run(seed, &[&["--gige", "lo"][..], arguments].concat(), Some(alone))
    }

    /// Runs at the same time as other tests.
    fn without_gige(seed: u64) -> Self {
        Self::run(seed, &[], None)
    }

    fn run(seed: u64, arguments: &[&str], alone: Option<MutexGuard<'static, ()>>) -> Self {
        // Homing from near the switches takes less time.
        let near_home = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/near-home.toml");
        let mut child = Command::new(simulator())
            .args(["run", "--seed", &seed.to_string(), "--scenario", near_home])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let value = |key: &str| {
            let (_, rest) =
                line.split_once(&format!("\"{key}\": \"")).unwrap_or_else(|| panic!("{key}: {line}"));
            rest.split('"').next().unwrap().to_string()
        };
        let gige = if alone.is_some() { value("gige") } else { String::new() };
        let (port, camera) = (value("port"), value("camera"));
        Self { child, port, camera, gige, _alone: alone }
    }

    fn client(&self) -> Client {
        Client::open_emulated(&self.port).unwrap()
    }

    fn gige(&self) -> GenicamCamera {
        let until = Instant::now() + WAIT;
        loop {
            match GenicamCamera::open(&self.gige) {
                Ok(camera) => return camera,
                // A killed client holds it until the heartbeat timeout.
                Err(error) => assert!(Instant::now() < until, "{error}"),
            }
        }
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn pair(client: &Client, camera: &mut dyn Camera) -> Result<Pair, CaptureError> {
    capture_pair(client, camera, &SENSOR, &Exposures::default(), &mut |_| {})
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_pair_over_gige_equals_that_of_the_endpoint() {
    let by_tcp = {
        let rig = Rig::without_gige(5);
        let mut camera = SimCamera::connect(&rig.camera).unwrap();
        pair(&rig.client(), &mut camera).unwrap()
    };
    // One percent packet loss, with resends.
    let rig = Rig::start(5, &["--gige-lost", "10"]);
    let mut camera = rig.gige();
    assert!(!camera.sets_exposure(TriggerMode::Hardware), "its exposure is the trigger's pulse");
    assert!(camera.sets_exposure(TriggerMode::Software), "a software trigger has no width");
    let by_gige = pair(&rig.client(), &mut camera).unwrap();
    assert!(by_gige.far.image == by_tcp.far.image && by_gige.near.image == by_tcp.near.image);
    assert!(by_gige.far.image != by_gige.near.image);
    assert_eq!(by_gige.far.record, by_tcp.far.record);
    // Half the sensor at a quarter of the bits.
    camera.set(&Setting::Region([64, 32, 320, 240])).unwrap();
    let part = pair(&rig.client(), &mut camera).unwrap();
    assert_eq!(part.far.image.pixels.dim(), (240, 320));
    let refused = camera.set(&Setting::Gain(17.0)).unwrap_err().to_string();
    assert!(refused.contains("1 to 16"), "{refused}");
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn reports_a_killed_rig_and_works_with_the_next_one() {
    let mut rig = Rig::start(6, &["--paced"]);
    let (client, mut camera) = (rig.client(), rig.gige());
    let exposing = Arc::new(Mutex::new(false));
    let reported = Arc::clone(&exposing);
    let capture = std::thread::spawn(move || {
        let say = &mut |text: &str| *reported.lock().unwrap() |= text.starts_with("exposing");
        let pairs = std::iter::repeat_with(|| {
            capture_pair(&client, &mut camera, &SENSOR, &Exposures::default(), say)
        });
        pairs.filter_map(Result::err).next().unwrap().to_string()
    });
    let until = Instant::now() + WAIT;
    while !*exposing.lock().unwrap() {
        assert!(Instant::now() < until, "it never exposes");
        std::thread::sleep(Duration::from_millis(1));
    }
    rig.child.kill().unwrap();
    let message = capture.join().unwrap();
    assert!(message.contains("answer") || message.contains("gone") || message.contains("away"), "{message}");
    drop(rig);
    let rig = Rig::start(6, &[]);
    let mut camera = rig.gige();
    pair(&rig.client(), &mut camera).unwrap();
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_camera_silent_while_armed_is_gone() {
    for instant in [150_000, 153_300].map(Duration::from_micros) {
        let mut rig = Rig::start(6, &[]);
        let mut camera = rig.gige();
        let arming = std::thread::spawn(move || {
            loop {
                if let Err(error) = camera.arm(TriggerMode::Hardware, Micros(5_000)) {
                    return error;
                }
            }
        });
        // Arming takes some 60 ms; the result must not depend on when the rig dies.
        std::thread::sleep(instant);
        rig.child.kill().unwrap();
        let error = arming.join().unwrap();
        assert!(matches!(error, CameraError::Gone { .. }), "{error}");
    }
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn software_triggers_give_their_frames_and_a_held_camera_is_reported() {
    let rig = Rig::start(7, &[]);
    let mut camera = rig.gige();
    let held = GenicamCamera::open(&rig.gige).err().unwrap();
    assert!(
        matches!(&held, CameraError::Unusable { .. }) && held.to_string().contains("another program"),
        "{held}"
    );
    camera.watch().unwrap();
    let mut newest = || camera.newest(WAIT).unwrap().expect("a frame within the wait");
    let (first, second) = (newest(), newest());
    // Chunks carry number and rig time.
    let frames = second.stamp.count.unwrap() - first.stamp.count.unwrap();
    let time = second.stamp.time.unwrap() - first.stamp.time.unwrap();
    assert_eq!(time, Duration::from_millis(40) * u32::try_from(frames).unwrap());
}

/// Its first frame comes incomplete.
struct Damaging(SimCamera, bool);

impl Camera for Damaging {
    fn kind(&self) -> &'static str {
        "damaging"
    }
    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError> {
        self.0.arm(mode, exposure)
    }
    fn pairs_by_frames_before(&self) -> bool {
        true
    }
    fn trigger(&mut self, trigger_number: u32, exposure: Micros) -> Result<(), CameraError> {
        self.0.trigger(trigger_number, exposure)
    }
    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let image = self.0.image(shot, wait)?;
        match std::mem::replace(&mut self.1, true) {
            true => Ok(image),
            false => Err(CameraError::Incomplete { camera: "it".into(), frame: 1, reason: "cut".into() }),
        }
    }
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_continuous_run_begins_after_an_incomplete_first_frame() {
    let rig = Rig::without_gige(9);
    let client = rig.client();
    let mut camera = Damaging(SimCamera::connect(&rig.camera).unwrap(), false);
    let shots = reach(&client, &SENSOR, &Exposures::default(), &mut |_| {}).unwrap().shots;
    let pace = Pace { period: Micros(0), exposures: 4 };
    let mut stream = Continuous::start(&client, &mut camera, &shots, pace, WAIT).unwrap();
    let mut whole = 0;
    while let Some(outcome) = stream.outcome().unwrap() {
        whole += usize::from(matches!(outcome, Outcome::Taken(_)));
    }
    assert_eq!(whole, 4);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn frames_of_a_lossy_line_match_their_exposures() {
    // FARNEAR_GIGE_FRAMES=10000 for the long run.
    let frames = std::env::var("FARNEAR_GIGE_FRAMES").ok().and_then(|text| text.parse().ok()).unwrap_or(24);
    let rig = Rig::start(8, &["--gige-lost", "10"]);
    let (client, mut camera) = (rig.client(), rig.gige());
    // The endpoint has the same pictures with trigger numbers.
    let mut endpoint = SimCamera::connect(&rig.camera).unwrap();
    let shots = reach(&client, &SENSOR, &Exposures::default(), &mut |_| {}).unwrap().shots;
    let pace = Pace { period: Micros(0), exposures: frames };
    let mut stream = Continuous::start(&client, &mut camera, &shots, pace, WAIT).unwrap();
    let (mut whole, mut reported) = (0, 0);
    while let Some(outcome) = stream.outcome().unwrap() {
        match outcome {
            Outcome::Taken(frame) => {
                let same = endpoint.image(&frame.record, WAIT).unwrap();
                assert!(
                    frame.image == same,
                    "exposure {} has another's picture",
                    frame.record.trigger_number
                );
                whole += 1;
            }
            Outcome::Dropped { loss: Loss::Image { reason, .. }, .. } => {
                assert!(reason.contains("packets were lost"), "{reason}");
                reported += 1;
            }
            // The board waits for read-out where necessary.
            Outcome::Dropped { .. } => {}
        }
    }
    println!("{frames} exposures: {whole} frames whole, {reported} reported incomplete");
    // Lost packets are resent repeatedly; five losses of one packet in a row practically never occur. On a busy machine a packet
    // that was sent again may come too late.
    assert!(whole > 0 && reported * 5 <= whole, "{whole} whole, {reported} incomplete");
}
