//! Contradictory optics: the message names the value and the one that would agree.

use crate::common::{Folder, fails, farnear};

const GOOD: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                    [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n";

#[test]
fn optics_that_make_no_sense_are_refused_by_every_command() {
    let folder = Folder::new();
    for (wrong, right, phrases) in [
        ("max_blur_px = 2.703", "near_mm = 950.0", vec!["near_mm = 950", "not nearer than far_mm = 933"]),
        ("aperture_mm = 12.8", "f_number = 0.0", vec!["f_number = 0", "positive"]),
        ("aperture_mm = 12.8", "f_number = -4.0", vec!["f_number = -4", "positive"]),
        ("aperture_mm = 12.8", "f_number = nan", vec!["f_number = NaN", "positive"]),
        ("aperture_mm = 12.8\n", "", vec!["aperture_mm or f_number"]),
        // 2 Fe = 50 / 6.4: the value that would agree is 3.90625.
        ("aperture_mm = 12.8", "aperture_mm = 12.8\nf_number = 4.5", vec!["f_number = 4.5", "3.90625"]),
        // A blur of 2.703 px belongs to 886.81 mm, 900 mm to 1.8 px or so.
        (
            "max_blur_px = 2.703",
            "max_blur_px = 2.703\nnear_mm = 900.0",
            vec!["disagree", "near_mm = 886.81", "max_blur_px = 1.9"],
        ),
        ("max_blur_px = 2.703\n", "", vec!["max_blur_px or near_mm"]),
        ("far_mm = 933.0", "far_mm = 40.0", vec!["far_mm = 40", "focal length of 50 mm"]),
        ("pixel_um = 7.4", "pixel_um = 0", vec!["pixel_um = 0", "positive"]),
        ("pixel_um = 7.4", "pixel_um = \"7.4\"", vec!["pixel_um", "invalid type"]),
        ("pixel_um = 7.4", "pixel_mm = 7.4", vec!["pixel_mm", "pixel_um"]),
        ("[sensor]", "[sensors]", vec!["sensors"]),
        ("[sensor]", "[sensor", vec!["line 4"]),
    ] {
        assert!(GOOD.contains(wrong), "{wrong}");
        let optics = folder.file("optics.toml", GOOD.replace(wrong, right));
        let mut phrases = phrases.clone();
        phrases.push("optics.toml");
        let before = folder.listing();
        let out = folder.text("out");
        for command in [
            vec!["optics", "--optics", &optics],
            vec!["operators", "--optics", &optics, "--out", &out],
            vec!["render", "--optics", &optics, "--out", &out],
            vec!["depth", "far.png", "near.png", "--optics", &optics, "--out", &out],
            vec!["rig", "capture", "--port", "/dev/absent", "--optics", &optics, "--out", &out],
        ] {
            fails(&mut farnear(&command), 1, &phrases);
            assert_eq!(folder.listing(), before);
        }
    }
}

#[test]
fn invalid_optics_files_are_named_in_the_error() {
    let folder = Folder::new();
    let empty = folder.file("empty.toml", "");
    let bytes = folder.file("bytes.toml", [0xff, 0xfe, 0, 9]);
    for (file, phrases) in [
        (&empty, ["empty.toml", "lens"]),
        (&bytes, ["bytes.toml", "UTF-8; expected a TOML file"]),
        (&folder.text("absent.toml"), ["absent.toml", "No such file"]),
        (&folder.text(""), ["cannot read the optics file", "; expected a TOML file"]),
    ] {
        fails(&mut farnear(&["optics", "--optics", file]), 1, &phrases);
    }
}
