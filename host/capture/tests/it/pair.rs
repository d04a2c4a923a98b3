//! Pairs with a scripted board and various cameras.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use farnear_capture::{
    Client, ClientError, Timing,
    camera::{Camera, CameraError, FolderCamera, Image},
    expose::{check_shots, expose_in_parts},
    half_mirror::capture_behind_mirror,
    pair::{CaptureError, Exposures, capture_pair},
    plan::SensorPair,
    record::{Circumstances, begin_folder, finish_folder, read_record, record_of},
};
use farnear_protocol::{
    message::{Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};
use farnear_scripted_board::{Faults, Peer};
use ndarray::Array2;

use crate::scripted::SHOT;

const SENSOR: SensorPair = SensorPair { far_mm: 52.8313, near_mm: 52.9875 };

struct Answering<F>(F);

impl<F: FnMut(&ShotRecord) -> Result<Image, CameraError>> Camera for Answering<F> {
    fn kind(&self) -> &'static str {
        "answering"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, _: Duration) -> Result<Image, CameraError> {
        self.0(shot)
    }
}

fn numbered() -> impl Camera {
    Answering(|shot: &ShotRecord| Ok(Image::new(Array2::from_elem((3, 4), shot.trigger_number as u16), 8)))
}

fn one_ahead() -> impl Camera {
    Answering(|shot: &ShotRecord| {
        Err(CameraError::Skipped { wanted: shot.trigger_number, came: shot.trigger_number + 1 })
    })
}

fn client() -> (Client, Peer) {
    let peer = Peer::new(Faults::default());
    (Client::connect(peer.connect(), "scripted").unwrap(), peer)
}

fn exposures() -> Exposures {
    Exposures { image_wait: Duration::from_millis(200), ..Exposures::default() }
}

fn circumstances() -> Circumstances {
    Circumstances {
        made_by: "test".into(),
        time: None,
        camera: "numbered",
        simulation: None,
        optics: "[lens]\nfocal_length_mm = 50.0".parse().unwrap(),
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_camera_that_changes_its_size_during_a_program_is_refused() {
    let (client, _peer) = client();
    let mut camera = Answering(|shot: &ShotRecord| {
        let width = if shot.trigger_number == 0 { 4 } else { 2 };
        Ok(Image::new(Array2::zeros((3, width)), 8))
    });
    // The second image is the dark one of the first.
    let ambient = Exposures { subtract_ambient: true, ..exposures() };
    let error = capture_pair(&client, &mut camera, &SENSOR, &ambient, &mut |_| {}).unwrap_err();
    let CaptureError::Camera(error) = error else { panic!("{error:?}") };
    let refused =
        matches!(error, CameraError::Reformatted { trigger_number: 1, width: 2, first_width: 4, .. });
    assert!(refused, "{error:?}");
}

#[test]
fn homes_moves_exposes_and_writes_a_pair() {
    let (client, peer) = client();
    let mut messages = Vec::new();
    let pair = capture_pair(&client, &mut numbered(), &SENSOR, &exposures(), &mut |text| {
        messages.push(text.to_string())
    })
    .unwrap();
    assert!(
        messages[0].contains("homing the sensor's coarse axis (its position is unknown)"),
        "{messages:?}"
    );
    assert_eq!((pair.far.image.pixels[[0, 0]], pair.near.image.pixels[[0, 0]]), (0, 1));
    // The piezo compensates the coarse stage's error of 375 nm; its own 2 nm remain.
    for taken in [&pair.far, &pair.near] {
        assert!((taken.sensor_measured_mm - taken.sensor_asked_mm + 2e-6).abs() < 1.5e-6, "{taken:?}");
    }
    assert_eq!(pair.near.record.asked.0 - pair.far.record.asked.0, 156_200);

    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("pair");
    let record = record_of(&pair, &client, circumstances());
    finish_folder(begin_folder(&folder).unwrap(), &pair, &record).unwrap();
    assert_eq!(names(&folder), ["capture.toml", "far.png", "near.png"]);
    assert_eq!(read_record(&folder).unwrap().unwrap(), record);
    assert_eq!(names(root.path()), ["pair"]);

    // Already homed the second time.
    let acts = peer.board().acts;
    let mut messages = Vec::new();
    client.set_timing(Timing::EMULATED);
    let begin = Instant::now();
    capture_pair(&client, &mut numbered(), &SENSOR, &exposures(), &mut |text| {
        messages.push(text.to_string())
    })
    .unwrap();
    assert!(!messages.iter().any(|text| text.contains("homing")), "{messages:?}");
    assert_eq!(peer.board().acts - acts, 2);
    assert!(begin.elapsed() < Duration::from_secs(2), "a homed rig waits for nothing: {:?}", begin.elapsed());
}

#[test]
fn behind_a_half_mirror_one_trigger_gives_both_images() {
    let (client, peer) = client();
    let take = |exposures: &Exposures| {
        let cameras: [&mut dyn Camera; 2] = [&mut numbered(), &mut numbered()];
        capture_behind_mirror(&client, cameras, &SENSOR, 0.15, exposures, &mut |_| {}).unwrap()
    };
    let pair = take(&exposures());
    assert_eq!((pair.far.image.pixels[[0, 0]], pair.near.image.pixels[[0, 0]]), (0, 0));
    assert_eq!(pair.far.record, pair.near.record);
    // The second sensor's position is the given one, independent of the optics.
    let apart_mm = pair.near.sensor_measured_mm - pair.far.sensor_measured_mm;
    assert!((apart_mm - 0.15).abs() < 1e-9 && pair.further_mm == Some(0.15), "{apart_mm}");
    assert_eq!(pair.near.sensor_asked_mm, SENSOR.near_mm);
    let acts = peer.board().acts;
    // One exposure, which does not count as motion.
    let record = &pair.far.record;
    let until_end = record.strobe_end.0 - record.trigger.0 + u64::from(record.settle.0);
    assert_eq!(pair.moving_us(), until_end - u64::from(record.exposure.0));

    let averaged = take(&Exposures { averaged: 3, ..exposures() });
    let more = peer.board().acts - acts;
    assert_eq!(more, 2, "the coarse stage moved, one program ran");
    // Triggers 1 to 3 with two more bits: 2 of 255 is 8 of 1023.
    for taken in [&averaged.far, &averaged.near] {
        assert_eq!((taken.image.bits, taken.image.pixels[[0, 0]]), (10, 8));
    }
}

#[test]
fn a_picture_of_another_trigger_is_an_error_with_both_numbers() {
    for which in [1, 2] {
        let (client, peer) = client();
        let (mut good, mut bad) = (numbered(), one_ahead());
        let cameras: [&mut dyn Camera; 2] =
            if which == 1 { [&mut bad, &mut good] } else { [&mut good, &mut bad] };
        let taken = capture_behind_mirror(&client, cameras, &SENSOR, 0.15, &exposures(), &mut |_| {});
        let error = taken.unwrap_err();
        assert!(
            matches!(error, CaptureError::OneCamera { number, cameras: 2, .. } if number == which),
            "{error:?}"
        );
        let message = error.to_string();
        let expected =
            format!("camera {which} of 2: the camera skipped exposure 0: it sent the image of exposure 1");
        assert_eq!(message, expected);
        assert_eq!(peer.board().stops, 1);
    }
}

#[test]
fn a_port_that_goes_away_leaves_no_folder() {
    let (client, peer) = client();
    peer.board().faults.gone_at_program = true;
    let root = tempfile::tempdir().unwrap();
    let staging = begin_folder(&root.path().join("pair")).unwrap();
    let error = capture_pair(&client, &mut numbered(), &SENSOR, &exposures(), &mut |_| {}).unwrap_err();
    drop(staging);
    assert!(matches!(error, CaptureError::Board(ClientError::Gone { .. })), "{error:?}");
    assert_eq!(names(root.path()), Vec::<String>::new());
}

/// Delivers a surplus picture at the end.
struct OneTooMany;

impl Camera for OneTooMany {
    fn kind(&self) -> &'static str {
        "one too many"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        numbered().image(shot, wait)
    }
    fn finish(&mut self, _: Duration) -> Result<(), CameraError> {
        Err(CameraError::Surplus { camera: self.kind().into() })
    }
}

#[test]
fn a_surplus_picture_fails_the_pair() {
    let (client, _peer) = client();
    let error = capture_pair(&client, &mut OneTooMany, &SENSOR, &exposures(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, CaptureError::Camera(CameraError::Surplus { .. })), "{error:?}");
}

#[test]
fn the_automatic_exposure_time_is_one_that_was_tried() {
    let (client, _peer) = client();
    let (mut exposures_us, mut messages) = (Vec::new(), String::new());
    let mut half_of_white = Answering(|shot: &ShotRecord| {
        exposures_us.push(shot.exposure.0);
        Ok(Image::new(Array2::from_elem((3, 4), 128), 8))
    });
    let auto = Exposures { auto: true, ..exposures() };
    let pair =
        capture_pair(&client, &mut half_of_white, &SENSOR, &auto, &mut |text| messages += text).unwrap();
    let (tried, pair_us) = exposures_us.split_at(exposures_us.len() - 2);
    assert_eq!(tried.len(), 8, "none is good");
    assert_eq!(pair_us, [pair.far.record.exposure.0; 2]);
    assert!(tried.contains(&pair_us[0]), "{pair_us:?} of {tried:?}");
    assert!(messages.contains("the brightest pixels have 50 % of white"), "{messages}");
}

#[test]
fn a_silent_camera_stops_the_rig() {
    let (client, peer) = client();
    let folder = tempfile::tempdir().unwrap();
    let mut camera = FolderCamera::watch(folder.path()).unwrap();
    let error = capture_pair(&client, &mut camera, &SENSOR, &exposures(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, CaptureError::Camera(CameraError::Late { .. })), "{error:?}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn optics_out_of_reach_move_nothing() {
    let (client, peer) = client();
    let long = Exposures { exposure: Micros(3_600_000_000), ..exposures() };
    let error = capture_pair(&client, &mut numbered(), &SENSOR, &long, &mut |_| {}).unwrap_err().to_string();
    let max = client.hello().limits.exposure_max.0;
    assert!(error.contains("3600000000 us") && error.contains(&max.to_string()), "{error}");
    assert_eq!(peer.board().acts, 0);
    let far_away = SensorPair { far_mm: 90.0, near_mm: 90.1 };
    let error = capture_pair(&client, &mut numbered(), &far_away, &exposures(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, CaptureError::Plan(_)), "{error:?}");
    assert_eq!(peer.board().acts, 0);
}

#[test]
fn more_shots_than_the_board_can_hold_run_as_several_programs() {
    let (client, peer) = client();
    assert_eq!(client.hello().limits.shots_max, 16);
    let shots: Vec<Shot> = (0..40).map(|step| Shot { target: Nanometres(1_000 * step), ..SHOT }).collect();
    let mut taken = Vec::new();
    let on_image = |index, record: ShotRecord, image: Image| -> Result<(), CaptureError> {
        taken.push((index, record.asked, image.pixels[[0, 0]]));
        Ok(())
    };
    expose_in_parts(&client, &mut numbered(), &shots, Duration::from_secs(1), on_image).unwrap();
    let expected = (0_u16..).zip(&shots).map(|(number, shot)| (usize::from(number), shot.target, number));
    assert_eq!(taken, expected.collect::<Vec<_>>());
    assert_eq!(peer.board().acts, 3);
    let cycle = check_shots(&client, &shots).unwrap_err().to_string();
    assert!(
        cycle.contains("1 to 16 shots") && cycle.contains("has 40") && cycle.contains("--runs"),
        "{cycle}"
    );
}
