//! Long tasks on the emulated rig: focusing, programs, calibration, mathematics, the checklist.

use std::{fs, path::Path};

use farnear_files::{image_file::read_grey, map, npy};
use ndarray::Array2;

use crate::common::{
    Folder, NEAR_HOME, SharedRig, fails, farnear, figures, number, on_the_rig, rig_optics, succeeds,
};

/// True sensor position at the end of a trace, in mm from the lens.
fn true_sensor_mm(trace: &str) -> f64 {
    let last = trace.lines().last().expect("lines");
    let columns: Vec<&str> = trace.lines().next().expect("a header").split(',').collect();
    let values: Vec<&str> = last.split(',').collect();
    let um = |name: &str| -> f64 {
        let at = columns.iter().position(|column| *column == name).expect("a column");
        values[at].parse().expect("a number")
    };
    47.0 + (um("coarse_um") + um("lens_um") + um("piezo_um")) / 1e3
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn focusing_from_a_millimetre_off_is_quick_and_lands_where_the_image_is_sharpest() {
    // The image of a plane at 900 mm from the 50 mm lens.
    let best_mm = 50.0 * 900.0 / 850.0;
    for start_mm in [best_mm - 0.99, best_mm + 0.6] {
        let folder = Folder::new();
        let (trace, start) = (folder.text("trace.csv"), start_mm.to_string());
        let mut command = on_the_rig(&["focus", "--scene", "plane:900", "--optics", rig_optics(), "--json"]);
        let found = figures(command.args(["--start-mm", &start, "--trace", &trace]));
        assert!(number(&found, "board_ms") <= 1_500.0, "{found}");
        // By the plant's own truth, screw errors included.
        let stands = true_sensor_mm(&fs::read_to_string(&trace).expect("a trace"));
        assert!((stands - best_mm).abs() <= 0.002, "{stands} where {best_mm} is best: {found}");
        let (m1, m2) = (number(&found, "m1_mm"), number(&found, "m2_mm"));
        // 2 Fe Rmax = 2 * 3.90625 * 2.703 * 7.4 um (Li 2014, eqs. 4.3 and 4.4).
        assert!(
            (m2 - m1 - 0.156267).abs() < 2e-6 && (number(&found, "far_mm") - 900.0).abs() < 1.0,
            "{found}"
        );
    }
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_focus_beyond_the_range_is_not_found_at_its_end() {
    // The image of a plane at 500 mm is 2.7 mm behind that at 933 mm, where the search begins.
    let focus = ["focus", "--scene", "plane:500", "--optics", rig_optics()];
    fails(&mut on_the_rig(&focus), 1, &["no focus within 1 mm", "range"]);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_stack_and_a_program_leave_their_images_and_what_was_measured() {
    let (folder, rig) = (Folder::new(), SharedRig::start(NEAR_HOME));
    // Near the focus: the simulator takes long to draw strong blur.
    let out = folder.text("stack");
    let stack =
        ["sequence", "--axis", "coarse", "--from", "5790", "--to", "5830", "--steps", "3", "--out", &out];
    let found = figures(rig.with_camera(&stack).args(["--optics", rig_optics(), "--json"]));
    assert_eq!(number(&found, "exposures"), 3.0);
    assert!(number(&found, "largest_error_um") <= 1.0, "{found}");
    assert_eq!(folder.listing().iter().filter(|name| name.ends_with(".png")).count(), 3);
    let record: toml::Table =
        fs::read_to_string(folder.path("stack/capture.toml")).expect("a record").parse().expect("TOML");
    let shots = record["exposure"].as_array().expect("exposures");
    let asked: Vec<_> = shots.iter().filter_map(|shot| shot["asked_um"].as_float()).collect();
    assert_eq!(asked, [5790.0, 5810.0, 5830.0]);

    // The same armed program twice; the host triggers its exposures.
    let program = "trigger = \"software\"\n[[shot]]\naxis = \"coarse\"\nto_um = 5810.0\n\
                   [[shot]]\naxis = \"fine\"\nto_um = 150.0\nrepeat = 2\n\
                   [[shot]]\naxis = \"fine\"\nto_um = 20.0\n";
    let (file, out) = (folder.file("program.toml", program), folder.text("program"));
    let run = ["sequence", "--program", &file, "--runs", "2", "--out", &out, "--json"];
    assert_eq!(number(&figures(&mut rig.with_camera(&run)), "exposures"), 8.0);
    let bad = folder.file("bad.toml", "[[shot]]\naxis = \"fine\"\nto_um = 300.0\n");
    let run = ["sequence", "--program", &bad, "--out", &folder.text("bad")];
    fails(&mut rig.with_camera(&run), 1, &["outside the limits", "300.000 um", "195.000 um"]);
    assert!(!folder.path("bad").exists());
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_map_before_the_emulated_camera_is_seen_as_the_plane_that_it_is() {
    let folder = Folder::new();
    folder.file("wall.npy", npy::write(Array2::from_elem((3, 4), 905_f32).view()));
    let file = folder.file("wall.toml", "depth = \"wall.npy\"\ntexture = \"fractal\"\n");
    let images = |out: &str, scene: &str| {
        let out = folder.text(out);
        let capture =
            ["capture", "--optics", rig_optics(), "--noise", "none", "--scene", scene, "--out", &out];
        succeeds(&mut on_the_rig(&capture));
        ["far.png", "near.png"].map(|name| read_grey(&Path::new(&out).join(name)).expect("an image").pixels)
    };
    let (of_map, of_plane) = (images("map", &file), images("plane", "plane:905,texture=fractal"));
    // Sixteen bits of a plane, drawn by another way than a map: at most one code apart.
    for (map, plane) in of_map.iter().zip(&of_plane) {
        let off = (map - plane).fold(0.0_f32, |most, off| most.max(off.abs()));
        assert!(off <= 1.01 / 65_535.0, "{off}");
    }
    // Refused before the simulator starts.
    let missing = folder.file("missing.toml", "depth = \"missing.npy\"");
    let capture =
        ["capture", "--optics", rig_optics(), "--scene", &missing, "--out", &folder.text("missing")];
    fails(&mut on_the_rig(&capture), 1, &["missing.toml", "missing.npy"]);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_continuous_capture_leaves_pairs_and_a_row_for_each_frame() {
    let (folder, rig) = (Folder::new(), SharedRig::start(NEAR_HOME));
    let out = folder.text("run");
    let run =
        ["continuous", "--optics", rig_optics(), "--rate", "40", "--frames", "7", "--out", &out, "--json"];
    let found = figures(&mut rig.with_camera(&run));
    assert_eq!((number(&found, "exposures"), number(&found, "cycles")), (7.0, 3.0), "{found}");
    assert_eq!((number(&found, "jitter_us"), number(&found, "rate_hz")), (0.0, 40.0), "{found}");
    assert_eq!(number(&found, "exposures_outside_window"), 0.0, "{found}");
    let table = fs::read_to_string(folder.path("run/frames.csv")).expect("a table");
    assert_eq!(table.lines().count(), 1 + 7, "{table}");
    for pair in 0..3 {
        let record = folder.path(&format!("run/pair-{pair:05}/capture.toml"));
        let record: toml::Table = fs::read_to_string(record).expect("a record").parse().expect("TOML");
        assert_eq!(record["exposure"].as_array().map(Vec::len), Some(2));
    }
    // A rate above the camera's is refused with the highest possible one.
    let out = folder.text("refused");
    let run = ["continuous", "--optics", rig_optics(), "--rate", "100", "--frames", "7", "--out", &out];
    fails(&mut rig.with_camera(&run), 1, &["refused", "15500 us"]);
    assert!(!folder.path("refused").exists());
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn flat_targets_are_captured_listed_and_not_captured_twice() {
    let folder = Folder::new();
    let out = folder.text("series");
    let targets = |distances: &str| {
        let series =
            ["calibrate", "targets", "--optics", rig_optics(), "--distances", distances, "--out", &out];
        figures(on_the_rig(&series).arg("--json"))
    };
    assert_eq!(number(&targets("900"), "captured"), 1.0);
    let both = targets("900,920");
    assert_eq!((number(&both, "captured"), number(&both, "targets")), (1.0, 2.0));
    assert!(number(&both, "rmse_mm") < 2.0, "{both}");
    let map = map::read(&folder.path("series/target-920.000/depth.npy")).expect("a map");
    assert_eq!(map.dim(), (480, 640));
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn the_board_corrects_and_fits_with_the_hosts_bits() {
    let (folder, rig) = (Folder::new(), SharedRig::start(NEAR_HOME));
    let mut list = String::new();
    for (number, true_mm) in [890.0, 900.0, 910.0, 920.0, 930.0].into_iter().enumerate() {
        // A bowl whose height depends on the depth.
        let map = Array2::from_shape_fn((18, 24), |(row, column)| {
            let (x, y) = (column as f32 / 11.5 - 1.0, row as f32 / 8.5 - 1.0);
            true_mm + (0.8 + 0.01 * (true_mm - 910.0)) * (x * x + y * y)
        });
        folder.file(&format!("{number}.npy"), npy::write(map.view()));
        list += &format!("[[pattern]]\ndepth = \"{number}.npy\"\ntrue_mm = {true_mm:.1}\n");
    }
    let (list, correction) = (folder.file("PATTERNS.toml", list), folder.text("correction.toml"));
    let fitted = ["calibrate", "fit", &list, "--method", "clsf", "--step", "1", "--store", "--json"];
    let fitted = figures(&mut rig.command(&fitted));
    assert_eq!((number(&fitted, "coefficients"), number(&fitted, "different")), (90.0, 0.0));
    for method in ["clsf-blend", "clsf-full"] {
        let learn = ["calibrate", "correction", &list, "--method", method, "--out", &correction];
        succeeds(&mut farnear(&learn));
        let (map, out) = (folder.text("4.npy"), folder.text("corrected.npy"));
        let correct = ["correct", &map, "--correction", &correction, "--out", &out, "--json"];
        let corrected = figures(&mut rig.command(&correct));
        assert_eq!((&corrected["method"], number(&corrected, "different_pixels")), (&method.into(), 0.0));
    }
    let sun = ["sun", "--lat", "52.38", "--lon=-1.56", "--time", "2012-07-17T12:00:00Z", "--azimuth", "135"];
    assert_eq!(figures(rig.command(&sun).arg("--json"))["same_bits"], true);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn the_checklist_passes_and_the_mechanics_are_measured() {
    let rig = SharedRig::start(NEAR_HOME);
    let checked = figures(&mut rig.with_camera(&["check", "--json"]));
    assert_eq!((number(&checked, "failed"), number(&checked, "passed")), (0.0, 12.0), "{checked}");
    // The plant's screw has 4 um of backlash.
    let backlash = ["calibrate", "backlash", "--axis", "coarse", "--json"];
    let backlash = figures(&mut rig.command(&backlash));
    assert!((number(&backlash, "backlash_um") - 4.0).abs() < 1.0, "{backlash}");
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn the_firmwares_log_is_decoded_with_its_elf() {
    let elf = std::env::var_os("FARNEAR_FIRMWARE")
        .map_or_else(|| crate::common::built("farnear-nucleo-f429zi.elf"), Into::into);
    let elf = elf.to_str().expect("a plain path");
    let (text, _) = succeeds(&mut on_the_rig(&["log", "--elf", elf, "--reset", "--seconds", "4"]));
    assert!(text.contains("boot 2, emulated: true"), "{text}");
    let folder = Folder::new();
    let wrong = folder.file("wrong.elf", "no program");
    fails(&mut on_the_rig(&["log", "--elf", &wrong]), 1, &["wrong.elf", "is not the firmware's ELF file"]);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn campaigns_are_jobs_of_a_batch() {
    let folder = Folder::new();
    let manifest = folder
        .file("seeds.csv", "do,first,seeds,out\ncampaign,1,1,one\ncampaign,2,1,two\ncampaign,,,three\n");
    let run = || {
        let output = farnear(&["batch", &manifest]).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(1), "the third has no number of seeds");
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        let mut states: Vec<(u64, String)> = text
            .lines()
            .map(|line| {
                let line: serde_json::Value = serde_json::from_str(line).expect(line);
                (line["job"].as_u64().expect("a number"), line["state"].as_str().expect("a state").into())
            })
            .collect();
        states.sort();
        states.into_iter().map(|(_, state)| state).collect::<Vec<_>>()
    };
    assert_eq!(run(), ["done", "done", "failed"]);
    for place in ["one", "two"] {
        let summary = std::fs::read(folder.path(&format!("{place}/campaign.json"))).expect("figures");
        let summary: serde_json::Value = serde_json::from_slice(&summary).expect("JSON");
        assert_eq!(
            (&summary["scenarios"], &summary["broken"]),
            (&1.into(), &serde_json::json!([])),
            "{summary}"
        );
    }
    assert_eq!(run(), ["already", "already", "failed"]);
}
