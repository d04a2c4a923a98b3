//! The capture workflow against a scripted board and cameras that do and do not deliver.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod peer;

use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::thread;
use std::time::Duration;

use farnear_capture::camera::{Camera, CameraError, FolderCamera, Image, SimCamera};
use farnear_capture::pair::{CaptureError, Exposures, capture_pair};
use farnear_capture::plan::SensorPair;
use farnear_capture::record::{Circumstances, begin_folder, finish_folder, read_record, record_of};
use farnear_capture::{Client, ClientError};
use farnear_files::image_file::encode_png;
use farnear_protocol::camera::FrameHeader;
use farnear_protocol::message::{ShotRecord, TriggerMode};
use farnear_protocol::units::{BoardMicros, Micros, Nanometres};
use ndarray::Array2;
use peer::{Faults, Peer};

const SENSOR: SensorPair = SensorPair { far_mm: 52.8313, near_mm: 52.9875 };

/// Gives each exposure a picture that tells its trigger number.
struct Numbered;

impl Camera for Numbered {
    fn kind(&self) -> &'static str {
        "numbered"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, _: Duration) -> Result<Image, CameraError> {
        Ok(Image { pixels: Array2::from_elem((3, 4), shot.trigger_number as u16), bits: 8 })
    }
}

fn client() -> (Client, Peer) {
    let peer = Peer::new(Faults::default());
    (Client::connect(Box::new(peer.clone()), "scripted").unwrap(), peer)
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
fn a_pair_is_homed_moved_exposed_and_written() {
    let (client, peer) = client();
    let mut said = Vec::new();
    let pair =
        capture_pair(&client, &mut Numbered, &SENSOR, &exposures(), &mut |text| said.push(text.to_string()))
            .unwrap();
    assert!(said[0].contains("homing the sensor's coarse axis (its position is unknown)"), "{said:?}");
    assert_eq!((pair.far.image.pixels[[0, 0]], pair.near.image.pixels[[0, 0]]), (0, 1));
    // The piezo makes up for the 375 nm that the scripted coarse stage is off; its own 2 nm remain.
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

    // The second time it is homed already, and needs no homing.
    let acts = peer.board().acts;
    let mut said = Vec::new();
    capture_pair(&client, &mut Numbered, &SENSOR, &exposures(), &mut |text| said.push(text.to_string()))
        .unwrap();
    assert!(!said.iter().any(|text| text.contains("homing")), "{said:?}");
    assert_eq!(peer.board().acts - acts, 2);
}

#[test]
fn a_port_that_goes_away_leaves_no_folder() {
    let (client, peer) = client();
    peer.board().faults.gone_at_program = true;
    let root = tempfile::tempdir().unwrap();
    let aside = begin_folder(&root.path().join("pair")).unwrap();
    let error = capture_pair(&client, &mut Numbered, &SENSOR, &exposures(), &mut |_| {}).unwrap_err();
    drop(aside);
    assert!(matches!(error, CaptureError::Board(ClientError::Gone { .. })), "{error:?}");
    assert_eq!(names(root.path()), Vec::<String>::new());
}

#[test]
fn a_camera_that_gives_nothing_stops_the_rig() {
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
    let far_away = SensorPair { far_mm: 90.0, near_mm: 90.1 };
    let error = capture_pair(&client, &mut Numbered, &far_away, &exposures(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, CaptureError::Plan(_)), "{error:?}");
    assert_eq!(peer.board().acts, 0);
}

fn shot(trigger_number: u32) -> ShotRecord {
    ShotRecord {
        index: 0,
        repeat: 0,
        trigger_number,
        axis: farnear_protocol::message::Axis::SensorFine,
        asked: Nanometres(0),
        coarse: Nanometres(0),
        fine: Nanometres(0),
        lens: Nanometres(0),
        settle: Micros(0),
        trigger: BoardMicros(0),
        strobe_start: BoardMicros(0),
        strobe_end: BoardMicros(0),
        exposure: Micros(0),
    }
}

#[test]
fn a_folder_gives_its_new_images_in_order_and_waits_for_half_written_ones() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, value: u16| {
        fs::write(folder.path().join(name), encode_png(Array2::from_elem((2, 2), value).view(), 8).unwrap())
            .unwrap();
    };
    write("old.png", 1);
    let mut camera = FolderCamera::watch(folder.path()).unwrap();
    let path = folder.path().to_path_buf();
    let writer = thread::spawn(move || {
        let png = encode_png(Array2::from_elem((2, 2), 2).view(), 8).unwrap();
        fs::write(path.join("b.png"), &png[..20]).unwrap();
        thread::sleep(Duration::from_millis(60));
        fs::write(path.join("b.png"), &png).unwrap();
        fs::write(path.join("notes.txt"), b"no image").unwrap();
    });
    let value = |camera: &mut FolderCamera| {
        camera.image(&shot(0), Duration::from_secs(20)).map(|image| image.pixels[[0, 0]])
    };
    assert_eq!(value(&mut camera).unwrap(), 2);
    writer.join().unwrap();
    write("a.png", 3);
    assert_eq!(value(&mut camera).unwrap(), 3);
    let late = camera.image(&shot(7), Duration::from_millis(30)).unwrap_err();
    assert!(late.to_string().contains("exposure 7"), "{late}");
}

/// A camera endpoint that sends images with these shot ids and then hangs up.
fn endpoint(shots: &'static [u32], trailing: &'static [u8]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        for shot_id in shots {
            let header =
                FrameHeader { shot_id: *shot_id, exposure: BoardMicros(9), width: 2, height: 1, bits: 8 };
            stream.write_all(&header.length().to_le_bytes()).unwrap();
            stream.write_all(&header.to_bytes()).unwrap();
            stream.write_all(&[*shot_id as u8, 0, 255, 0]).unwrap();
        }
        stream.write_all(trailing).unwrap();
        if trailing.is_empty() {
            let _ = stream.read(&mut [0]); // until the client hangs up
        }
    });
    address
}

#[test]
fn the_simulators_images_are_matched_to_their_exposures() {
    let mut camera = SimCamera::connect(&endpoint(&[3, 4, 5, 7], &[])).unwrap();
    let wait = Duration::from_secs(20);
    assert_eq!(camera.image(&shot(4), wait).unwrap().pixels[[0, 0]], 4);
    assert_eq!(camera.image(&shot(5), wait).unwrap().pixels[[0, 1]], 255);
    let skipped = camera.image(&shot(6), wait).unwrap_err();
    assert!(matches!(skipped, CameraError::Skipped { wanted: 6, came: 7 }), "{skipped:?}");
    let late = camera.image(&shot(8), Duration::from_millis(30)).unwrap_err();
    assert!(matches!(late, CameraError::Late { .. }), "{late:?}");
}

#[test]
fn a_camera_that_hangs_up_or_is_none_is_named() {
    let wait = Duration::from_secs(20);
    let mut camera = SimCamera::connect(&endpoint(&[], &[1, 2])).unwrap();
    let gone = camera.image(&shot(0), wait).unwrap_err();
    assert!(matches!(gone, CameraError::Gone { .. }), "{gone:?}");
    let mut camera = SimCamera::connect(&endpoint(&[], b"HTTP/1.1 400 Bad Request\r\n\r\n")).unwrap();
    let nonsense = camera.image(&shot(0), wait).unwrap_err();
    assert!(matches!(nonsense, CameraError::Nonsense { .. }), "{nonsense:?}");
    let absent = SimCamera::connect("127.0.0.1:1").err().unwrap();
    assert!(matches!(absent, CameraError::Connect { .. }), "{absent:?}");
}
