//! `farnear camera`: cameras without a rig.

use crate::common::{Folder, fails, farnear, figures, succeeds};

/// A free-running program that writes grey frames of 2x1 px with a saturated first pixel.
#[cfg(unix)]
const PROGRAM: &str = "command:2x1:gray:sh -c \"while sleep 0.02; do printf '\\377A'; done\"";

#[test]
fn the_kinds_are_listed_with_how_they_are_named() {
    let listed = figures(&mut farnear(&["camera", "list", "--json"]));
    let kinds: Vec<&str> =
        listed["kinds"].as_array().unwrap().iter().map(|kind| kind["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["sim", "folder", "command", "v4l", "genicam"]);
    assert!(listed["found"].is_array());
}

#[test]
#[cfg(unix)]
fn pictures_are_kept_with_their_record() {
    let folder = Folder::new();
    for (format, ending) in [("png", "png"), ("tiff", "tiff")] {
        let out = folder.text(format);
        let arguments = ["camera", "grab", "--camera", PROGRAM, "--frames", "2", "--format", format];
        let grabbed = figures(farnear(&arguments).args(["--out", &out, "--json"]));
        assert_eq!(
            (&grabbed["frames"], &grabbed["width"], &grabbed["bits"]),
            (&2.into(), &2.into(), &8.into())
        );
        for number in 0..2 {
            let path = folder.path(format).join(format!("frame-{number:04}.{ending}"));
            let picture = image::ImageReader::open(&path).unwrap().with_guessed_format().unwrap();
            // The tests cannot read TIFF, only PNG.
            if format == "png" {
                assert_eq!(picture.decode().unwrap().to_luma8().as_raw(), &[255, 65]);
            }
        }
        let record = std::fs::read_to_string(folder.path(format).join("grab.toml")).unwrap();
        assert!(record.contains("camera = \"command\"") && record.contains("frame-0001"), "{record}");
    }
    let again = ["camera", "grab", "--camera", PROGRAM, "--out", &folder.text("png")];
    fails(&mut farnear(&again), 1, &["exists already"]);
}

#[test]
#[cfg(unix)]
fn looking_gives_a_line_at_a_time() {
    let arguments =
        ["camera", "live", "--camera", PROGRAM, "--seconds", "1.5", "--every-ms", "500", "--json"];
    let output = farnear(&arguments).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let lines: Vec<serde_json::Value> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert!(!lines.is_empty());
    assert_eq!((&lines[0]["saturated_percent"], &lines[0]["width"]), (&50.0.into(), &2.into()));
    // 2x1 px have no focus.
    assert!(lines[0].get("focus").is_none() && lines[0]["frames_per_s"].as_f64().unwrap() > 0.0);
}

#[test]
fn camera_errors_are_reported_and_leave_no_files() {
    let folder = Folder::new();
    let out = folder.text("out");
    for (camera, code, phrase) in [
        ("nothing", 2, "genicam:ID"),
        ("sim", 2, "HOST:PORT"),
        ("command:farnear-no-such-program", 1, "no such program"),
        ("command:a 'b", 2, "quotes"),
        ("folder:/nonexistent", 1, "/nonexistent"),
        ("127.0.0.1:1", 1, "127.0.0.1:1"),
    ] {
        fails(&mut farnear(&["camera", "grab", "--camera", camera, "--out", &out]), code, &[phrase]);
        assert_eq!(folder.listing(), Vec::<String>::new());
    }
    fails(&mut farnear(&["camera", "show", "--camera", "sim", "--set", "gian=3"]), 2, &["black_level"]);
    let camera = format!("folder:{}", folder.text(""));
    let nothing_to_set = ["camera", "show", "--camera", &camera, "--set", "gain=3"];
    fails(&mut farnear(&nothing_to_set), 1, &["nothing to set"]);
    succeeds(&mut farnear(&["camera", "show", "--camera", &camera]));
}
