//! `farnear silhouettes video` on small synthetic videos.

use std::{
    fs,
    path::{Path, PathBuf},
};

use assert_cmd::Command;
use image::{GrayImage, Luma, Rgb, RgbImage};

const SIZE: (u32, u32) = (160, 120);
const EMPTY_FRAMES: usize = 30;
const FRAMES: usize = 40;

fn farnear() -> Command {
    crate::common::farnear(&[])
}

/// The left edge of the moving block, in frames that contain it.
fn block(frame: usize) -> Option<u32> {
    frame.checked_sub(EMPTY_FRAMES).map(|step| 20 + 10 * step as u32)
}

/// A static, speckled scene and, from some frame on, a moving block of 20x60 pixels.
fn picture(frame: usize) -> RgbImage {
    RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let noise = ((frame as u32 * 7919 + y * 104_729 + x * 1_299_709) % 7) as u8;
        let inside = block(frame).is_some_and(|left| (left..left + 20).contains(&x) && (30..90).contains(&y));
        if inside { Rgb([220 - noise, 60, 40 + noise]) } else { Rgb([90 + noise, 100 + noise, 80 + noise]) }
    })
}

fn folder(root: &Path) -> PathBuf {
    let video = root.join("video");
    fs::create_dir(&video).unwrap();
    for frame in 0..FRAMES {
        picture(frame).save(video.join(format!("in{frame:04}.png"))).unwrap();
    }
    video
}

/// The same video as full-range 4:4:4 Y4M, by the BT.601 matrix.
fn y4m() -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W{} H{} F25:1 C444 XCOLORRANGE=FULL\n", SIZE.0, SIZE.1).into_bytes();
    for frame in 0..FRAMES {
        bytes.extend(b"FRAME\n");
        let picture = picture(frame);
        let rows = [
            ([0.299, 0.587, 0.114], 0.0),
            ([-0.168_736, -0.331_264, 0.5], 128.0),
            ([0.5, -0.418_688, -0.081_312], 128.0),
        ];
        for (weights, offset) in rows {
            bytes.extend(picture.pixels().map(|pixel| {
                let sum: f64 = weights.iter().zip(pixel.0).map(|(w, level)| w * f64::from(level)).sum();
                (sum + offset).round() as u8
            }));
        }
    }
    bytes
}

/// Rows and columns that are set, half open.
fn bounds(mask: &GrayImage) -> Option<[u32; 4]> {
    let set = mask.enumerate_pixels().filter(|(_, _, level)| level.0[0] == 255);
    set.fold(None, |bounds: Option<[u32; 4]>, (x, y, _)| {
        let [top, left, bottom, right] = bounds.unwrap_or([y, x, y + 1, x + 1]);
        Some([top.min(y), left.min(x), bottom.max(y + 1), right.max(x + 1)])
    })
}

fn mask(folder: &Path, name: &str) -> GrayImage {
    image::open(folder.join(name)).unwrap().into_luma8()
}

fn figures(command: &mut Command) -> serde_json::Value {
    crate::common::figures(command.arg("--json"))
}

#[track_caller]
fn fails(command: &mut Command, out: &Path, expected: &[&str]) {
    crate::common::fails(command, 1, expected);
    assert!(!out.exists(), "{} was left behind", out.display());
}

#[test]
fn a_folder_of_pictures_gives_a_mask_per_frame_and_an_index() {
    let root = tempfile::tempdir().unwrap();
    let (video, out, labels) = (folder(root.path()), root.path().join("masks"), root.path().join("labels"));
    let found = figures(
        farnear()
            .args(["silhouettes", "video"])
            .arg(&video)
            .arg("--out")
            .arg(&out)
            .arg("--labels")
            .arg(&labels),
    );
    assert_eq!((&found["frames"], &found["silhouettes"]), (&FRAMES.into(), &(FRAMES - EMPTY_FRAMES).into()));
    assert_eq!((&found["learning"], &found["empty"]), (&10.into(), &20.into()));
    for frame in 0..FRAMES {
        let expected = block(frame).map(|left| [30, left, 90, left + 20]);
        assert_eq!(bounds(&mask(&out, &format!("in{frame:04}.png"))), expected, "frame {frame}");
    }
    let index: toml::Table = fs::read_to_string(out.join("silhouettes.toml")).unwrap().parse().unwrap();
    let entries = index["frame"].as_array().unwrap();
    assert_eq!(entries.len(), FRAMES);
    assert_eq!(entries[0]["flags"].as_array().unwrap()[0].as_str(), Some("learning"));
    assert_eq!(entries[35]["file"].as_str(), Some("in0035.png"));
    assert_eq!(entries[35]["top_left_bottom_right"].as_array().unwrap()[1].as_integer(), Some(70));
    assert!(mask(&labels, "in0035.png").pixels().any(|level| level.0[0] == 255));
}

#[test]
fn y4m_gives_the_same_masks_and_learning_first_leaves_no_frame_out() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (root.path().join("walk.y4m"), root.path().join("masks"));
    fs::write(&video, y4m()).unwrap();
    let found =
        figures(farnear().args(["silhouettes", "video", "--learn-first", "--out"]).arg(&out).arg(&video));
    assert_eq!((&found["learning"], &found["silhouettes"]), (&0.into(), &(FRAMES - EMPTY_FRAMES).into()));
    assert_eq!(bounds(&mask(&out, "frame_000036.png")), Some([30, 70, 90, 90]));
    assert_eq!(bounds(&mask(&out, "frame_000001.png")), None);
}

#[test]
fn a_video_without_a_usable_frame_says_why() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (folder(root.path()), root.path().join("masks"));
    let learning = ["silhouettes", "video", "--learning-frames", "500", "--out"];
    let found = figures(farnear().args(learning).arg(&out).arg(&video));
    assert_eq!(found["silhouettes"], 0);
    assert!(found["remarks"].to_string().contains("lower learning-frames"), "{found}");
    let (still, out) = (root.path().join("still"), root.path().join("none"));
    fs::create_dir(&still).unwrap();
    for frame in 0..40 {
        picture(FRAMES - 1).save(still.join(format!("{frame:03}.png"))).unwrap();
    }
    let found = figures(farnear().args(["silhouettes", "video", "--out"]).arg(&out).arg(&still));
    assert!(found["remarks"].to_string().contains("motionless throughout are background"), "{found}");
}

#[test]
fn learning_decides_what_becomes_background() {
    let root = tempfile::tempdir().unwrap();
    let video = root.path().join("video");
    fs::create_dir(&video).unwrap();
    // The block stops after four steps.
    for frame in 0..130 {
        picture(frame.min(EMPTY_FRAMES + 4)).save(video.join(format!("in{frame:04}.png"))).unwrap();
    }
    let masked = |learning: &[&str], out: &str| {
        let out = root.path().join(out);
        let options = ["silhouettes", "video", "--history-frames", "50"];
        farnear().args(options).args(learning).arg("--out").arg(&out).arg(&video).assert().success();
        bounds(&mask(&out, "in0129.png")).is_some()
    };
    assert!(masked(&[], "usual") && masked(&["--learning", "never"], "never"));
    assert!(!masked(&["--learning", "always"], "always"));
}

#[test]
fn centred_masks_are_100x100_and_filled_to_the_height() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (folder(root.path()), root.path().join("masks"));
    farnear()
        .args(["silhouettes", "video", "--centred", "--grey", "--out"])
        .arg(&out)
        .arg(&video)
        .assert()
        .success();
    let centred = mask(&out, "in0038.png");
    assert_eq!(centred.dimensions(), (100, 100));
    // 60 x 20 pixels scaled by 5/3: 100 x 33.3, in the middle.
    assert_eq!(bounds(&centred), Some([0, 33, 100, 67]));
    assert_eq!(mask(&out, "in0005.png").dimensions(), (100, 100));
}

#[test]
fn a_shadow_detector_needs_colour() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (folder(root.path()), root.path().join("masks"));
    let mut command = farnear();
    command
        .args(["silhouettes", "video", "--shadow-detector", "chromaticity", "--out"])
        .arg(&out)
        .arg(&video);
    command.assert().success();
    assert_eq!(bounds(&mask(&out, "in0036.png")), Some([30, 80, 90, 100]));
    let grey = root.path().join("grey");
    command.arg("--grey").arg("--out").arg(&grey);
    assert_eq!(command.output().unwrap().status.code(), Some(2), "--out twice is bad usage");
    let mut command = farnear();
    command
        .args(["silhouettes", "video", "--grey", "--shadow-detector", "physical", "--out"])
        .arg(&grey)
        .arg(&video);
    fails(&mut command, &grey, &["physical", "grey"]);
}

#[test]
fn bad_input_is_named_and_leaves_nothing_behind() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("masks");
    let run = |video: &Path| {
        let mut command = farnear();
        command.args(["silhouettes", "video", "--out"]).arg(&out).arg(video);
        command
    };
    fails(&mut run(&root.path().join("none")), &out, &["none"]);

    let empty = root.path().join("empty");
    fs::create_dir(&empty).unwrap();
    fails(&mut run(&empty), &out, &["no picture"]);

    let mixed = folder(root.path());
    GrayImage::from_pixel(33, 22, Luma([9])).save(mixed.join("in0020b.png")).unwrap();
    fails(&mut run(&mixed), &out, &["in0020b", "33x22", "160x120"]);
    fs::write(mixed.join("in0003b.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    fails(&mut run(&mixed), &out, &["in0003b.png"]);

    let broken = root.path().join("broken.y4m");
    let whole = y4m();
    fs::write(&broken, &whole[..whole.len() / 2]).unwrap();
    fails(&mut run(&broken), &out, &["broken.y4m", "breaks off"]);
    fs::write(&broken, b"").unwrap();
    fails(&mut run(&broken), &out, &["broken.y4m", "header"]);
    fs::write(&broken, b"YUV4MPEG2 W4 H4 F25:1\n").unwrap();
    fails(&mut run(&broken), &out, &["no frame"]);
}

#[test]
fn labels_in_the_place_of_the_masks_are_refused_before_the_work() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (folder(root.path()), root.path().join("masks"));
    for labels in [out.clone(), out.join("labels"), video.join("../masks")] {
        let mut command = farnear();
        command.args(["silhouettes", "video", "--out"]).arg(&out).arg("--labels").arg(&labels).arg(&video);
        let expected = format!("labels {}: expected another place", labels.display());
        crate::common::fails(&mut command, 2, &[&expected]);
        assert!(!out.exists());
    }
}

#[test]
fn a_full_folder_is_not_overwritten() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (folder(root.path()), root.path().join("masks"));
    fs::create_dir(&out).unwrap();
    fs::write(out.join("precious"), "x").unwrap();
    let output = farnear().args(["silhouettes", "video", "--out"]).arg(&out).arg(&video).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
}

#[test]
fn without_an_ffmpeg_other_videos_are_a_clear_error() {
    let root = tempfile::tempdir().unwrap();
    let (video, out) = (root.path().join("walk.mp4"), root.path().join("masks"));
    fs::write(&video, "no real video").unwrap();
    let mut command = farnear();
    command.env("PATH", root.path()).args(["silhouettes", "video", "--out"]).arg(&out).arg(&video);
    fails(&mut command, &out, &["walk.mp4", "ffmpeg", "PATH"]);
}

/// A stand-in for ffmpeg: writes a Y4M stream, or an error and exit code 1.
#[cfg(unix)]
fn stand_in(root: &Path, script: &str) {
    use std::os::unix::fs::PermissionsExt;
    let program = root.join("ffmpeg");
    fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
}

#[cfg(unix)]
#[test]
fn other_videos_go_through_ffmpeg() {
    let root = tempfile::tempdir().unwrap();
    let (video, out, stream) =
        (root.path().join("walk.mp4"), root.path().join("masks"), root.path().join("stream.y4m"));
    fs::write(&video, "stands for a video").unwrap();
    fs::write(&stream, y4m()).unwrap();
    let run = |out: &Path| {
        let mut command = farnear();
        let path = format!("{}:/usr/bin:/bin", root.path().display());
        command.env("PATH", path).args(["silhouettes", "video", "--out"]).arg(out).arg(&video);
        command
    };
    // Writes the stream only if Y4M of this video on standard output is requested.
    let check = format!(
        "case \"$*\" in *'-i {}'*yuv4mpegpipe*' -') cat {};; *) exit 3;; esac",
        video.display(),
        stream.display()
    );
    stand_in(root.path(), &check);
    assert_eq!(figures(&mut run(&out))["silhouettes"], FRAMES - EMPTY_FRAMES);
    assert_eq!(bounds(&mask(&out, "frame_000036.png")), Some([30, 70, 90, 90]));

    let other = root.path().join("other");
    stand_in(root.path(), "echo 'moov atom not found' >&2; exit 1");
    fails(&mut run(&other), &other, &["walk.mp4", "moov atom not found"]);
    // Ends in the middle of a frame.
    stand_in(
        root.path(),
        &format!("head -c 200000 {}; echo 'corrupt packet' >&2; exit 69", stream.display()),
    );
    fails(&mut run(&other), &other, &["corrupt packet", "69"]);
}
