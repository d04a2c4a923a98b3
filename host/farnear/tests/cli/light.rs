//! Light of the board and of the room, on the emulated rig.

use crate::common::{Folder, SharedRig, farnear, figures, number, rig_optics, succeeds, true_staircase};

/// Emulated light: of the room, its share that flickers at 100 Hz, of the second lamp; and whether only lamps show texture.
struct Light {
    room: f64,
    flicker: f64,
    lamp: f64,
    blank_walls: bool,
}

/// A rig in this light.
fn lit(folder: &Folder, light: &Light) -> SharedRig {
    let Light { room, flicker, lamp, blank_walls } = light;
    let parts = format!(
        "start_um = [60.0, 80.0]\n[parts.imaging]\nlight = {{ exposure_ms = 5.0, room = {room:?}, flicker = {flicker:?}, flicker_hz = 100.0, \
         lamps = [0.0, {lamp:?}], blank_walls = {blank_walls} }}\n"
    );
    SharedRig::start(&folder.file("light.toml", parts))
}

/// Captures a pair; returns its warnings.
fn capture(rig: &SharedRig, folder: &Folder, name: &str, arguments: &[&str]) -> String {
    let out = folder.text(name);
    let mut command = rig.with_camera(&["capture", "--optics", rig_optics(), "--out", &out]);
    succeeds(command.args(arguments)).1
}

/// Computes depth; returns the figures of the map, and its error in mm.
fn depth(folder: &Folder, name: &str) -> (serde_json::Value, f64) {
    let [far, near] = ["far.png", "near.png"].map(|file| folder.text(&format!("{name}/{file}")));
    let mut command = farnear(&["depth", &far, &near, "--optics", rig_optics()]);
    let found = figures(command.args(["--median-px", "5", "--json"]));
    let map = folder.text(&format!("{name}/depth.npy"));
    let compare = ["compare", &map, true_staircase(), "--away-from-edges", "8", "--json"];
    let error = match number(&found, "valid_fraction") > 0.5 {
        true => number(&figures(&mut farnear(&compare)), "rmse_mm"),
        false => f64::INFINITY,
    };
    (found, error)
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_projected_texture_gives_a_blank_wall_its_depth() {
    let folder = Folder::new();
    let textured = Light { room: 1.0, flicker: 0.0, lamp: 0.0, blank_walls: false };
    capture(&lit(&folder, &textured), &folder, "textured", &[]);
    let blank = lit(&folder, &Light { room: 0.3, flicker: 0.0, lamp: 1.0, blank_walls: true });
    capture(&blank, &folder, "lit", &["--light", "0,100"]);
    capture(&blank, &folder, "subtracted", &["--light", "0,100", "--subtract-ambient"]);
    capture(&blank, &folder, "dark", &[]);
    let (found, error) = depth(&folder, "dark");
    assert!(error.is_infinite() && found.to_string().contains("too little texture"), "{found}");
    let [textured, lit, subtracted] = ["textured", "lit", "subtracted"].map(|name| depth(&folder, name).1);
    // The room's light lowers the pattern's contrast. A second exposure doubles the dark pixels' noise.
    assert!(lit < 1.2 * textured && subtracted < 1.3 * textured, "{textured} {lit} {subtracted}");
}

/// The emulated camera begins 20 us after the trigger.
#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn an_exposure_shorter_than_the_cameras_delay_misses_the_light() {
    let folder = Folder::new();
    let lamp = Light { room: 0.0, flicker: 0.0, lamp: 100.0, blank_walls: false };
    let arguments = ["--light", "0,100", "--exposure-us", "40"];
    let said = capture(&lit(&folder, &lamp), &folder, "short", &arguments);
    assert!(said.contains("was dark for") && !said.contains("10 ms"), "{said}");
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn flicker_is_reported_and_averages_out_over_whole_periods() {
    let folder = Folder::new();
    let steady = Light { room: 0.5, flicker: 0.0, lamp: 0.0, blank_walls: false };
    let flickering = lit(&folder, &Light { flicker: 0.9, ..steady });
    let whole = capture(&flickering, &folder, "whole", &["--exposure-us", "10000"]);
    let short = capture(&flickering, &folder, "short", &["--exposure-us", "5000"]);
    assert!(short.contains("brighter") && short.contains("multiples of 10 ms"), "{short}");
    let without = capture(&lit(&folder, &steady), &folder, "without", &["--exposure-us", "10000"]);
    assert!(![&whole, &without].iter().any(|said| said.contains("warning")), "{whole} {without}");
    let [whole, without] = ["whole", "without"].map(|name| depth(&folder, name).1);
    assert!((whole / without - 1.0).abs() < 0.05, "{whole} {without}");
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn ambient_light_is_subtracted_with_a_lamp_only() {
    let folder = Folder::new();
    let mut command = farnear(&["rig", "capture", "--port", "sim", "--optics", rig_optics()]);
    command.args(["--subtract-ambient", "--out", &folder.text("pair")]);
    crate::common::fails(&mut command, 2, &["--light 100"]);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn the_exposure_time_is_found_for_dark_and_bright_rooms() {
    let folder = Folder::new();
    for (name, room) in [("dark", 0.04), ("bright", 12.0)] {
        let light = Light { room, flicker: 0.0, lamp: 0.0, blank_walls: false };
        capture(&lit(&folder, &light), &folder, name, &["--auto-exposure"]);
        let image = image::open(folder.path(&format!("{name}/far.png"))).expect("an image").into_luma8();
        let mut codes: Vec<u8> = image.pixels().map(|pixel| pixel.0[0]).collect();
        codes.sort_unstable();
        let brightest = f64::from(codes[codes.len() * 995 / 1000]) / 255.0;
        assert!((0.7..0.9).contains(&brightest), "{name}: {brightest}");
    }
}
