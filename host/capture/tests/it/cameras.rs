//! Cameras: image folder and simulator endpoint.

use std::{
    fs,
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use farnear_capture::camera::{Camera, CameraError, FolderCamera, Image, SimCamera};
use farnear_files::image_file::encode_png;
use farnear_protocol::{
    camera::FrameHeader,
    message::{Axis, ShotRecord, TriggerMode},
    units::{BoardMicros, Micros, Nanometres},
};
use ndarray::Array2;

pub fn shot(trigger_number: u32) -> ShotRecord {
    ShotRecord {
        index: 0,
        repeat: 0,
        trigger_number,
        axis: Axis::SensorFine,
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
fn reads_new_images_in_order_and_waits_for_incomplete_ones() {
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
    let mut number = 0;
    let mut value = |camera: &mut FolderCamera| {
        number += 1;
        camera.image(&shot(number), Duration::from_secs(20)).map(|image| image.pixels[[0, 0]])
    };
    assert_eq!(value(&mut camera).unwrap(), 2);
    writer.join().unwrap();
    write("a.png", 3);
    assert_eq!(value(&mut camera).unwrap(), 3);
    let late = camera.image(&shot(7), Duration::from_millis(30)).unwrap_err();
    assert!(late.to_string().contains("exposure 7"), "{late}");
}

fn send(stream: &mut TcpStream, shot_id: u32) {
    send_at(stream, shot_id, exposed(shot_id).strobe_start.0);
}

/// At the moment of [`send`]'s image.
fn exposed(trigger_number: u32) -> ShotRecord {
    ShotRecord { strobe_start: BoardMicros(20_000 * u64::from(trigger_number)), ..shot(trigger_number) }
}

fn send_at(stream: &mut TcpStream, shot_id: u32, board_us: u64) {
    let header = FrameHeader { shot_id, exposure: BoardMicros(board_us), width: 2, height: 1, bits: 8 };
    stream.write_all(&header.length().to_le_bytes()).unwrap();
    stream.write_all(&header.to_bytes()).unwrap();
    stream.write_all(&[shot_id as u8, 0, 255, 0]).unwrap();
}

/// Sends images with these shot ids and disconnects.
fn endpoint(shots: &'static [u32], trailing: &'static [u8]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        shots.iter().for_each(|shot_id| send(&mut stream, *shot_id));
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
    assert_eq!(camera.image(&exposed(4), wait).unwrap().pixels[[0, 0]], 4);
    assert_eq!(camera.image(&exposed(5), wait).unwrap().pixels[[0, 1]], 255);
    let skipped = camera.image(&exposed(6), wait).unwrap_err();
    assert!(matches!(skipped, CameraError::Skipped { wanted: 6, came: 7 }), "{skipped:?}");
    let late = camera.image(&exposed(8), Duration::from_millis(30)).unwrap_err();
    assert!(matches!(late, CameraError::Late { .. }), "{late:?}");
}

#[test]
fn a_simulator_that_stands_still_is_left_at_once() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let camera = SimCamera::connect(&listener.local_addr().unwrap().to_string()).unwrap();
    let begin = Instant::now();
    drop(camera);
    assert!(begin.elapsed() < Duration::from_millis(900), "{:?}", begin.elapsed());
}

#[test]
fn arming_drops_images_from_before_a_reset_of_the_board() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut camera = SimCamera::connect(&listener.local_addr().unwrap().to_string()).unwrap();
    let (mut simulator, _) = listener.accept().unwrap();
    let wait = Duration::from_secs(20);
    send(&mut simulator, 7);
    let skipped = camera.image(&exposed(6), wait).unwrap_err();
    assert!(matches!(skipped, CameraError::Skipped { wanted: 6, came: 7 }), "{skipped:?}");
    // Its triggers count from 0 again.
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    send(&mut simulator, 0);
    assert_eq!(camera.image(&exposed(0), wait).unwrap().pixels[[0, 0]], 0);
}

#[test]
fn an_image_of_the_same_number_from_before_a_reset_is_passed_over() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut camera = SimCamera::connect(&listener.local_addr().unwrap().to_string()).unwrap();
    let (mut simulator, _) = listener.accept().unwrap();
    send_at(&mut simulator, 2, 7_000_000);
    let late = camera.image(&exposed(2), Duration::from_millis(300)).unwrap_err();
    assert!(matches!(late, CameraError::Late { .. }), "{late:?}");
    send(&mut simulator, 2);
    camera.image(&exposed(2), Duration::from_secs(20)).unwrap();
}

#[test]
fn an_image_of_the_exposures_moment_is_its_image() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut camera = SimCamera::connect(&listener.local_addr().unwrap().to_string()).unwrap();
    let (mut simulator, _) = listener.accept().unwrap();
    // Six software triggers came first, which the board numbers, too.
    for (shot_id, board_us) in [(0, 10_000), (1, 30_000)] {
        send_at(&mut simulator, shot_id, board_us);
        let taken = ShotRecord { strobe_start: BoardMicros(board_us + 1), ..shot(6 + shot_id) };
        let image = camera.image(&taken, Duration::from_secs(20)).unwrap();
        assert_eq!(u32::from(image.pixels[[0, 0]]), shot_id);
    }
}

#[test]
fn disconnects_from_the_simulator_before_the_next_client() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let knows = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&knows);
    let simulator = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        assert_eq!(stream.read(&mut [0]).unwrap(), 0, "it hangs up");
        // On a busy computer the endpoint notices the disconnection late.
        thread::sleep(Duration::from_millis(200));
        flag.store(true, Ordering::Relaxed);
    });
    drop(SimCamera::connect(&address).unwrap());
    assert!(knows.load(Ordering::Relaxed));
    simulator.join().unwrap();
}

#[test]
fn names_a_camera_that_disconnects_or_is_invalid() {
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

fn picture(value: u16) -> Vec<u8> {
    encode_png(Array2::from_shape_fn((4, 4), |(row, column)| value + (row + column) as u16).view(), 8)
        .unwrap()
}

/// An armed folder camera after its first picture.
fn used_folder(first: &str) -> (tempfile::TempDir, FolderCamera) {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = FolderCamera::watch(folder.path()).unwrap();
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    fs::write(folder.path().join(first), picture(10)).unwrap();
    camera.image(&shot(0), Duration::from_secs(20)).unwrap();
    (folder, camera)
}

#[test]
fn a_folder_is_armed_for_hardware_triggers_only() {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = FolderCamera::watch(folder.path()).unwrap();
    for mode in [TriggerMode::Software, TriggerMode::FreeRunning] {
        let error = camera.arm(mode, Micros(1)).unwrap_err();
        assert!(matches!(error, CameraError::Trigger { camera: "folder", .. }), "{error:?}");
    }
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
}

fn second_picture(camera: &mut FolderCamera) -> Result<Image, CameraError> {
    camera.image(&shot(1), Duration::from_secs(5))
}

#[test]
fn a_copy_of_a_picture_is_refused() {
    let (folder, mut camera) = used_folder("a.png");
    fs::copy(folder.path().join("a.png"), folder.path().join("b.png")).unwrap();
    let error = second_picture(&mut camera).unwrap_err();
    assert!(matches!(error, CameraError::Doubled { earlier: 0, wanted: 1, .. }), "{error:?}");
}

#[test]
fn one_picture_in_two_formats_is_refused() {
    let (folder, mut camera) = used_folder("a.png");
    fs::write(folder.path().join("a.tif"), picture(10)).unwrap();
    let error = second_picture(&mut camera).unwrap_err().to_string();
    assert!(error.contains("a.png is the same picture in another format"), "{error}");
}

#[test]
fn a_surplus_file_is_refused_after_the_last_exposure() {
    let (folder, mut camera) = used_folder("a.png");
    camera.finish(Duration::from_millis(10)).unwrap();
    assert!(camera.quiet_time() >= Duration::from_millis(200));
    fs::write(folder.path().join("b.png"), picture(20)).unwrap();
    let error = camera.finish(Duration::from_millis(10)).unwrap_err();
    assert!(matches!(error, CameraError::Surplus { .. }) && error.to_string().contains("b.png"), "{error}");
}

#[test]
fn an_older_picture_after_a_newer_one_is_refused() {
    let (folder, mut camera) = used_folder("b.png");
    let path = folder.path().join("a.png");
    fs::write(&path, picture(20)).unwrap();
    let earlier = std::time::SystemTime::now() - Duration::from_secs(30);
    fs::File::options().write(true).open(&path).unwrap().set_modified(earlier).unwrap();
    let error = second_picture(&mut camera).unwrap_err();
    assert!(matches!(error, CameraError::Reordered { .. }), "{error:?}");
}

/// Synchronised files have the order of their arrival; EXIF has that of the exposures.
#[test]
fn times_of_exposure_come_before_those_of_the_files() {
    for (second, refused) in [(11, false), (10, false), (9, true)] {
        let folder = tempfile::tempdir().unwrap();
        let mut camera = FolderCamera::watch(folder.path()).unwrap();
        camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
        fs::write(folder.path().join("a.png"), exposed_at(10, 10)).unwrap();
        camera.image(&shot(0), Duration::from_secs(20)).unwrap();
        fs::write(folder.path().join("b.png"), exposed_at(20, second)).unwrap();
        let result = second_picture(&mut camera);
        assert_eq!(matches!(result, Err(CameraError::Reordered { .. })), refused, "{second}: {result:?}");
        assert_eq!(result.is_ok(), !refused);
    }
}

/// A PNG exposed at this second of a minute.
fn exposed_at(value: u16, second: u8) -> Vec<u8> {
    use image::ImageEncoder;
    let entry = b"II*\0\x08\0\0\0\x01\0\x32\x01\x02\0\x14\0\0\0\x1a\0\0\0\0\0\0\0";
    let exif = [&entry[..], format!("2026:11:25 20:00:{second:02}\0").as_bytes()].concat();
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder.set_exif_metadata(exif).unwrap();
    let pixels: Vec<u8> = (0..64).map(|at| value as u8 + at).collect();
    encoder.write_image(&pixels, 8, 8, image::ExtendedColorType::L8).unwrap();
    bytes
}

#[test]
fn names_a_rewritten_file() {
    let (folder, mut camera) = used_folder("capt0000.png");
    fs::write(folder.path().join("capt0000.png"), picture(200)).unwrap();
    let later = std::time::SystemTime::now() + Duration::from_secs(1);
    let file = fs::File::options().write(true).open(folder.path().join("capt0000.png")).unwrap();
    file.set_modified(later).unwrap();
    let error = second_picture(&mut camera).unwrap_err();
    assert!(matches!(error, CameraError::Overwritten { .. }), "{error:?}");
    assert!(error.to_string().contains("capt0000.png"), "{error}");
}

#[test]
fn names_a_new_file_that_is_not_a_picture_if_none_comes() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("IMG_0001.CR2"), "raw").unwrap();
    let mut camera = FolderCamera::watch(folder.path()).unwrap();
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    let mut late = || camera.image(&shot(1), Duration::from_millis(10)).unwrap_err().to_string();
    assert!(!late().contains("CR2"), "it was there before");
    fs::write(folder.path().join("IMG_0002.CR2"), "raw").unwrap();
    let text = late();
    assert!(text.contains("IMG_0002.CR2 came; expected a file of png, tif"), "{text}");
}

/// Copies and transfers set the time after the last byte.
#[test]
fn accepts_a_changed_time_of_a_used_file() {
    let (folder, mut camera) = used_folder("a.png");
    let file = fs::File::options().write(true).open(folder.path().join("a.png")).unwrap();
    file.set_modified(std::time::SystemTime::now() - Duration::from_secs(3_600)).unwrap();
    fs::write(folder.path().join("b.png"), picture(200)).unwrap();
    second_picture(&mut camera).unwrap();
    camera.finish(Duration::from_millis(10)).unwrap();
}

#[test]
fn waits_for_and_rejects_a_truncated_jpeg() {
    let (folder, mut camera) = used_folder("a.png");
    let mut jpeg = Vec::new();
    let pixels: Vec<u8> = (0..64 * 64).map(|at| (at * 7 % 251) as u8).collect();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 90)
        .encode(&pixels, 64, 64, image::ExtendedColorType::L8)
        .unwrap();
    let path = folder.path().join("b.jpg");
    fs::write(&path, &jpeg[..jpeg.len() / 2]).unwrap();
    let error = second_picture(&mut camera).unwrap_err().to_string();
    assert!(error.contains("b.jpg") && error.contains("incomplete"), "{error}");
    fs::write(&path, &jpeg).unwrap();
    let image = second_picture(&mut camera).unwrap();
    assert!(image.coding_variance > 0.0, "compression is known");
}
