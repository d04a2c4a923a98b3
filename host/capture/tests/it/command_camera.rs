//! Programs as cameras: ffmpeg and shell scripts.
#![cfg(unix)]

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use farnear_capture::camera::{Camera, CameraError, CommandCamera};
use farnear_protocol::{message::TriggerMode, units::Micros};

use super::cameras::shot;

/// On a busy machine ffmpeg has needed more than 20 s to its first picture.
const WAIT: Duration = Duration::from_secs(120);

fn start(line: &str) -> Result<CommandCamera, CameraError> {
    CommandCamera::start(&line.parse().unwrap())
}

fn script(text: &str) -> Result<CommandCamera, CameraError> {
    assert!(!text.contains('"'));
    start(&format!("sh -c \"{text}\""))
}

/// Error of the start or of the first image.
fn failure(camera: Result<CommandCamera, CameraError>) -> String {
    let failed = |mut camera: CommandCamera| camera.image(&shot(1), WAIT).map(|_| ());
    camera.and_then(failed).unwrap_err().to_string()
}

/// Triggered camera: each file `go-N` in the folder releases a Y4M frame of 2x1 px; `gone-N` follows it.
fn triggered(folder: &Path) -> Result<CommandCamera, CameraError> {
    script(&format!(
        "printf 'YUV4MPEG2 W2 H1 F25:1 Cmono\\n'; n=1; while sleep 0.02; do \
         if [ -e {0}/go-$n ]; then printf 'FRAME\\nA'; printf $n; : > {0}/gone-$n; n=$((n+1)); fi; done",
        folder.display()
    ))
}

#[test]
fn each_trigger_gives_a_picture_and_a_surplus_one_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = triggered(folder.path()).unwrap();
    let trigger = |number: u32| fs::write(folder.path().join(format!("go-{number}")), "").unwrap();
    trigger(1);
    camera.image(&shot(0), WAIT).unwrap();
    // Arming drops earlier frames.
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    for number in [2, 3] {
        trigger(number);
        let image = camera.image(&shot(number), WAIT).unwrap();
        assert_eq!((image.pixels[[0, 0]], image.pixels[[0, 1]], image.bits), (65, 48 + number as u16, 8));
    }
    camera.finish(Duration::from_millis(200)).unwrap();
    let late = camera.image(&shot(4), Duration::from_millis(30)).unwrap_err();
    assert!(matches!(late, CameraError::Late { trigger_number: 4, .. }), "{late:?}");
    trigger(4);
    let surplus = camera.finish(Duration::from_millis(200)).unwrap_err();
    assert!(matches!(surplus, CameraError::Surplus { .. }), "{surplus:?}");
}

#[test]
fn detects_a_free_running_program() {
    let mut camera =
        script("printf 'YUV4MPEG2 W1 H1 Cmono\\n'; while sleep 0.02; do printf 'FRAME\\nA'; done").unwrap();
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    camera.image(&shot(1), WAIT).unwrap();
    assert!(matches!(camera.finish(Duration::from_millis(200)).unwrap_err(), CameraError::Surplus { .. }));
    let free = camera.arm(TriggerMode::FreeRunning, Micros(1)).unwrap_err();
    assert!(matches!(free, CameraError::Trigger { camera: "command", .. }), "{free:?}");
    // Accepted for a live view.
    camera.watch().unwrap();
    assert_eq!(camera.newest(WAIT).unwrap().unwrap().image.pixels[[0, 0]], 65);
}

#[test]
fn invalid_programs_are_rejected_with_a_reason() {
    let absent = failure(start("farnear-no-such-program --x"));
    assert!(absent.contains("farnear-no-such-program") && absent.contains("no such program"), "{absent}");
    let dies = failure(script("echo the lens cap is on >&2; exit 3"));
    assert!(dies.contains("exit status: 3") && dies.contains("the lens cap is on"), "{dies}");
    let garbage = failure(script("echo GIF89a; sleep 30"));
    assert!(garbage.contains("not Y4M") && garbage.contains("GIF89a"), "{garbage}");
    let cut = failure(script("printf 'YUV4MPEG2 W4 H4 Cmono\\nFRAME\\nABC'"));
    assert!(cut.contains("ended") || cut.contains("frame 1"), "{cut}");
    let colours = failure(script("printf 'YUV4MPEG2 W4 H4 C411\\n'"));
    assert!(colours.contains("colour space"), "{colours}");
}

#[test]
fn raw_frames_have_the_given_size() {
    let mut camera = start("2x1:gray12le:printf '\\001\\000\\377\\017'").unwrap();
    // The frame came before arming, and the program has ended.
    let image = camera.image(&shot(1), Duration::from_millis(10));
    assert!(image.is_err() || image.unwrap().bits == 12);
    let mut camera = start("2x1:gray12le:sh -c \"sleep 0.5; printf '\\001\\000\\377\\017'\"").unwrap();
    let image = camera.image(&shot(1), WAIT).unwrap();
    assert_eq!((image.pixels[[0, 0]], image.pixels[[0, 1]], image.bits), (1, 4095, 12));
    let size = failure(start("4x4:gray:sh -c 'sleep 0.5; printf ABC'"));
    assert!(size.contains("3 of 16 bytes") && size.contains("4x4 px"), "{size}");
    let bright = failure(start("1x1:gray10le:sh -c 'sleep 0.5; printf ABC'"));
    assert!(bright.contains("a pixel of") && bright.contains("10 bits"), "{bright}");
}

#[test]
fn ends_child_and_grandchild_processes() {
    let folder = tempfile::tempdir().unwrap();
    let pids = folder.path().join("pids");
    let camera = script(&format!(
        "sleep 600 & echo $$ $! > {0}.new; mv {0}.new {0}; printf 'YUV4MPEG2 W1 H1 Cmono\\n'; wait",
        pids.display()
    ))
    .unwrap();
    let until = Instant::now() + WAIT;
    while !pids.exists() {
        assert!(Instant::now() < until);
        std::thread::sleep(Duration::from_millis(10));
    }
    let pids = fs::read_to_string(pids).unwrap();
    let pids: Vec<&str> = pids.split_whitespace().collect();
    drop(camera);
    // The child is reaped; the grandchild was killed and adopted by another process.
    assert!(!Path::new("/proc").join(pids[0]).exists());
    let until = Instant::now() + WAIT;
    loop {
        let status = fs::read_to_string(Path::new("/proc").join(pids[1]).join("status")).unwrap_or_default();
        let state = status.lines().find(|line| line.starts_with("State:")).unwrap_or("gone");
        if state == "gone" || state.contains('Z') || state.contains('X') {
            break;
        }
        assert!(Instant::now() < until, "{state}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
#[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
fn reads_ffmpegs_test_picture_as_y4m_and_raw() {
    let source = "ffmpeg -v error -re -f lavfi -i testsrc=size=64x48:rate=25";
    let mut camera = start(&format!("{source} -pix_fmt gray -f yuv4mpegpipe -")).unwrap();
    camera.watch().unwrap();
    let y4m = camera.newest(WAIT).unwrap().unwrap().image;
    assert_eq!((y4m.pixels.dim(), y4m.bits), ((48, 64), 8));
    let mut camera = start(&format!("64x48:gray16le:{source} -pix_fmt gray16le -f rawvideo -")).unwrap();
    camera.watch().unwrap();
    let raw = camera.newest(WAIT).unwrap().unwrap().image;
    assert_eq!((raw.pixels.dim(), raw.bits), ((48, 64), 16));
    // Equal colour bars in 8 and 16 bits: ffmpeg's grey has full range in both. The moving ramp and counter
    // are below the upper third. Different YUV conversions agree to a few 8-bit steps.
    for column in (4..64).step_by(8) {
        let (eight, sixteen) =
            (f64::from(y4m.pixels[[2, column]]), f64::from(raw.pixels[[2, column]]) / 257.0);
        assert!((eight - sixteen).abs() <= 3.0, "column {column}: {eight} and {sixteen}");
    }
}

#[test]
fn rejects_a_late_surplus_picture_before_the_next_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = triggered(folder.path()).unwrap();
    let trigger = |number: u32| fs::write(folder.path().join(format!("go-{number}")), "").unwrap();
    let exposure = |number: u32, strobe_us: u64| {
        let mut shot = shot(number);
        shot.trigger.0 = strobe_us;
        (shot.strobe_start.0, shot.strobe_end.0) = (strobe_us, strobe_us);
        shot
    };
    let sent = |number: u32| {
        trigger(number);
        let until = Instant::now() + WAIT;
        while !folder.path().join(format!("gone-{number}")).exists() {
            assert!(Instant::now() < until, "picture {number}");
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    let armed = Instant::now();
    sent(1);
    let first = exposure(1, 0);
    camera.reported(&first, Instant::now());
    camera.image(&first, WAIT).unwrap();
    sent(2);
    // The surplus picture is half a second old when the second exposure begins.
    std::thread::sleep(Duration::from_millis(500));
    let second = exposure(2, armed.elapsed().as_micros() as u64);
    camera.reported(&second, Instant::now());
    trigger(3);
    let error = camera.image(&second, WAIT).unwrap_err();
    assert!(matches!(error, CameraError::Stale { wanted: 2, .. }), "{error:?}");
}

#[test]
fn waits_for_surplus_pictures_as_long_as_the_longest_interval() {
    let folder = tempfile::tempdir().unwrap();
    let mut camera = triggered(folder.path()).unwrap();
    camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
    for (number, strobe_us) in [(1, 0), (2, 1_500_000)] {
        fs::write(folder.path().join(format!("go-{number}")), "").unwrap();
        let mut shot = shot(number);
        (shot.trigger.0, shot.strobe_start.0, shot.strobe_end.0) = (strobe_us, strobe_us, strobe_us);
        shot.repeat = number as u16;
        camera.image(&shot, WAIT).unwrap();
    }
    assert_eq!(camera.quiet_time(), Duration::from_millis(1_500));
}

#[test]
fn explains_padded_rows_and_reads_them_with_a_stride() {
    // Rows of 3 px, padded to 64 bytes: two frames of 2 rows.
    let bytes = "printf '\\001\\002\\003%061d\\004\\005\\006%061d' 0 0";
    let mut camera = start(&format!("3x2/64:gray:sh -c \"sleep 0.5; {bytes}; sleep 30\"")).unwrap();
    let image = camera.image(&shot(1), WAIT).unwrap();
    assert_eq!(image.pixels, ndarray::array![[1, 2, 3], [4, 5, 6]]);
    let mut camera = start(&format!("3x2:gray:sh -c \"sleep 0.5; {bytes}; sleep 30\"")).unwrap();
    camera.image(&shot(1), WAIT).unwrap();
    let error = camera.finish(Duration::from_millis(200)).unwrap_err();
    assert!(matches!(error, CameraError::Surplus { .. }), "whole frames are left over: {error}");
    let mut camera = start(&format!("60x2:gray:sh -c \"sleep 0.5; {bytes}; sleep 30\"")).unwrap();
    camera.image(&shot(1), WAIT).unwrap();
    let error = camera.finish(Duration::from_millis(200)).unwrap_err().to_string();
    assert!(error.contains("8 bytes are left over") && error.contains("60x2/64"), "{error}");
}

#[test]
fn repeated_ffmpeg_pictures_give_a_hint() {
    let error = CameraError::Doubled { camera: "`ffmpeg`".into(), earlier: 1, wanted: 2 }.to_string();
    assert!(error.contains("-fps_mode passthrough"), "{error}");
}
