//! `farnear rig capture --half-mirror`: both images of one trigger, on the emulated rig.

use std::{
    io::Write,
    net::TcpListener,
    thread::{self, JoinHandle},
    time::Duration,
};

use farnear_protocol::{camera::FrameHeader, units::BoardMicros};

use crate::common::{
    Folder, NEAR_HOME, fails, farnear, figures, number, rig_optics, succeeds, true_staircase,
};

fn capture(arguments: &[&str]) -> assert_cmd::Command {
    let mut command = farnear(&["rig", "capture", "--half-mirror", "--optics", rig_optics()]);
    command.args(arguments);
    command
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn one_trigger_gives_a_pair_and_its_depth() {
    let folder = Folder::new();
    // The second camera is rotated and shifted within the range of the alignment.
    let faults = folder.file(
        "mirror.toml",
        "start_um = [60.0, 80.0]\n[parts.half_mirror]\nsecond_mirrored = true\nsecond_shift_px = [1.5, -0.75]\nsecond_rotation_deg = 0.05\n",
    );
    let pair = folder.text("pair");
    let arguments = ["--port", "sim", "--faults", &faults, "--second-mirrored", "--out", &pair, "--json"];
    let taken = figures(&mut capture(&arguments));
    assert_eq!(taken["near_settle_ms"], 0.0, "{taken}");
    let apart_um = 1e3 * (number(&taken, "sensor_near_mm") - number(&taken, "sensor_far_mm"));
    // 2.703 px of blur on either side are 2 * 2.703 px * 7.4 um * 50 / 12.8.
    assert!((apart_um - 156.27).abs() < 0.01, "{taken}");

    let record = std::fs::read_to_string(folder.path("pair/capture.toml")).expect("a record");
    let record: toml::Table = record.parse().expect("TOML");
    let mirror = &record["half_mirror"];
    assert!((mirror["second_further_um"].as_float().expect("a number") - apart_um).abs() < 1e-6, "{mirror}");
    assert_eq!(mirror["second_mirrored"].as_bool(), Some(true));
    let exposures = record["exposure"].as_array().expect("two exposures");
    for key in ["trigger_number", "trigger_us", "strobe_start_us", "fine_measured_um"] {
        assert_eq!(exposures[0][key], exposures[1][key], "{key}");
    }

    let [far, near] = ["far.png", "near.png"].map(|file| format!("{pair}/{file}"));
    succeeds(&mut farnear(&["depth", &far, &near, "--median-px", "5"]));
    let (map, truth) = (format!("{pair}/depth.npy"), true_staircase());
    let compared = figures(&mut farnear(&["compare", &map, truth, "--away-from-edges", "8", "--json"]));
    // Half of the light is root 2 of the noise: the promise for one camera is 0.75 mm.
    assert!(number(&compared, "rmse_mm") <= 1.06, "{compared}");
}

/// A camera that gives one picture again and again, of this trigger and time.
fn camera_of(shot_id: u32, exposure: BoardMicros) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("loopback");
    let address = listener.local_addr().expect("an address").to_string();
    let served = thread::spawn(move || {
        let (mut client, _) = listener.accept().expect("a client");
        let header = FrameHeader { shot_id, exposure, width: 640, height: 480, bits: 8 };
        let mut frame = header.length().to_le_bytes().to_vec();
        frame.extend(header.to_bytes());
        frame.extend(vec![0; 2 * 640 * 480]);
        // Until the client disconnects. Pictures that come before the capture are dropped.
        while client.write_all(&frame).is_ok() {
            thread::sleep(Duration::from_millis(100));
        }
    });
    (address, served)
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn an_image_of_another_trigger_is_rejected_with_both_numbers() {
    let folder = Folder::new();
    // The board's first exposure is 0: a later one, and one from before the counter wrapped.
    for (came, at, phrases) in [
        (5, 60_000_000, ["camera 2 of 2", "skipped exposure 0", "the image of exposure 5"]),
        (u32::MAX - 2, 5, ["camera 2 of 2", "no image of exposure 0", "that of exposure 4294967293"]),
    ] {
        let (address, served) = camera_of(came, BoardMicros(at));
        let out = folder.text("out");
        let arguments = ["--port", "sim", "--second-camera", &address, "--image-wait-s", "2", "--out", &out];
        fails(capture(&arguments).args(["--faults", NEAR_HOME]), 1, &phrases);
        served.join().expect("served");
        assert_eq!(folder.listing(), Vec::<String>::new());
    }
}

#[test]
fn a_missing_second_camera_is_reported_with_a_remedy() {
    let folder = Folder::new();
    let out = folder.text("out");
    let port = ["--port", "/dev/none", "--out", &out];
    let needs = ["second-camera none", "name one of", "the emulated rig has two"];
    fails(&mut capture(&port), 2, &needs);
    fails(capture(&port).args(["--camera", "127.0.0.1:9"]), 2, &needs);
    let same = ["--camera", "127.0.0.1:9", "--second-camera", "127.0.0.1:9"];
    fails(capture(&port).args(same), 2, &["second-camera", "name another one"]);
    let frames = ["--camera", "127.0.0.1:9", "--second-camera", "127.0.0.1:8", "--camera-frames", "frames"];
    fails(capture(&port).args(frames), 2, &["camera-frames frames", "not the other's"]);
    fails(capture(&port).args(["--second-further-um", "0"]), 2, &["second-further-um 0", "0.1 to 10000 um"]);
    let alone = ["rig", "capture", "--second-camera", "127.0.0.1:9", "--optics", rig_optics(), "--out", &out];
    fails(&mut farnear(&alone), 2, &["--half-mirror"]);
    assert_eq!(folder.listing(), Vec::<String>::new());
}
