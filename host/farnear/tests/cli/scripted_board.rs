//! Faulty boards, played by a scripted board behind a real pseudo-terminal: no simulator is needed.
#![cfg(target_os = "linux")]

use farnear_protocol::message::SettingKey;
use farnear_scripted_board::{Faults, plug_in};

use crate::common::{Folder, fails, farnear, figures, number, rig_optics, succeeds};

#[track_caller]
fn capture_fails(port: &str, phrases: &[&str]) {
    let folder = Folder::new();
    let (out, camera) = (folder.text("out"), format!("folder:{}", folder.text("")));
    let capture = ["rig", "capture", "--port", port, "--camera", &camera, "--optics", rig_optics()];
    fails(farnear(&capture).args(["--out", &out, "--image-wait-s", "1"]), 1, phrases);
    assert_eq!(folder.listing(), Vec::<String>::new());
}

fn rig_at(port: &str, arguments: &[&str]) -> assert_cmd::Command {
    let mut command = farnear(&["rig"]);
    command.args(arguments).args(["--port", port]);
    command
}

#[test]
fn a_board_behind_a_port_is_driven_by_one_program_after_the_other() {
    let (port, peer) = plug_in(Faults::default());
    let rig = |arguments: &[&str]| rig_at(&port, arguments);
    let info = figures(&mut rig(&["info", "--json"]));
    assert_eq!((&info["board"], &info["emulated"]), (&"scripted".into(), &false.into()));
    succeeds(&mut rig(&["home"]));
    let moved = figures(&mut rig(&["move", "--axis", "coarse", "--to-um", "5000", "--json"]));
    assert_eq!(number(&moved, "measured_um"), 5000.375);
    let both = ["move", "--axis", "coarse", "--to-um", "1000", "--axis", "lens", "--to-um", "2000", "--json"];
    let moved = figures(&mut rig(&both));
    assert_eq!(number(&moved["moved"][0], "measured_um"), 1000.375);
    assert_eq!(
        (&moved["moved"][1]["axis"], number(&moved["moved"][1], "measured_um")),
        (&"lens".into(), 2000.125)
    );
    succeeds(&mut rig(&["stop"]));
    let far_off = ["move", "--axis", "coarse", "--to-um", "-5"];
    fails(&mut rig(&far_off), 1, &["-5.000 um is outside the limits", "0.000 to 13000.000 um"]);
    let board = peer.board();
    assert_eq!((board.acts, board.stops), (5, 1));
}

#[test]
fn an_alarm_is_reported_listed_and_cleared_by_number() {
    let (port, peer) = plug_in(Faults::default());
    let rig = |arguments: &[&str]| rig_at(&port, arguments);
    succeeds(&mut rig(&["halt"]));
    fails(
        &mut rig(&["home"]),
        1,
        &["alarm 1 is latched: the host halted the rig", "farnear rig alarms --clear 1"],
    );
    let listed = figures(&mut rig(&["alarms", "--json"]));
    assert_eq!((number(&listed, "latched"), number(&listed["alarms"][0], "number")), (1.0, 1.0));
    fails(&mut rig(&["alarms", "--clear", "2"]), 1, &["the latched alarm is number 1"]);
    let cleared = figures(&mut rig(&["alarms", "--clear", "1", "--json"]));
    assert_eq!(number(&cleared, "latched"), 0.0);
    succeeds(&mut rig(&["home"]));
    assert_eq!(peer.board().halts, 1);
}

#[test]
fn settings_and_counters_are_read_and_changed() {
    let (port, _peer) = plug_in(Faults::default());
    let settings = |arguments: &[&str]| {
        let mut command = farnear(&["rig", "settings"]);
        command.args(arguments).args(["--port", &port, "--json"]);
        command
    };
    let list = figures(&mut settings(&["list"]));
    assert_eq!(list["settings"].as_array().map(Vec::len), Some(SettingKey::ALL.len()), "{list}");
    let set = figures(&mut settings(&["set", "coarse_backlash_nm", "4000"]));
    assert_eq!((number(&set, "value"), number(&set, "default")), (4000.0, 1000.0));
    assert_eq!(number(&figures(&mut settings(&["get", "coarse_backlash_nm"])), "value"), 4000.0);
    fails(&mut settings(&["set", "datum_nm", "-1"]), 1, &["datum_nm must lie between 0 and 20000000"]);
    let counters = figures(&mut farnear(&["rig", "counters", "--port", &port, "--json"]));
    assert_eq!(number(&counters, "boots"), 7.0);
    let reset = figures(&mut farnear(&["rig", "reset", "--port", &port, "--json"]));
    assert_eq!((number(&reset, "boot_before"), number(&reset, "boot")), (7.0, 8.0));
}

#[test]
fn an_unattended_checklist_stops_at_a_failure() {
    let (port, peer) = plug_in(Faults::default());
    peer.board().hello.firmware = env!("CARGO_PKG_VERSION").try_into().expect("a short version");
    // Longer time-outs: on a busy machine this program answers later than a real board.
    peer.board().hello.emulated = true;
    let images = Folder::new();
    let camera = format!("folder:{}", images.text(""));
    let check =
        ["rig", "check", "--port", &port, "--no-actuation", "--resting-only", "--json", "--camera", &camera];
    // The scripted board stores nothing, so its boot counter does not change.
    let output = farnear(&check).output().expect("it starts");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("figures");
    assert_eq!(
        (output.status.code(), number(&found, "passed"), number(&found, "failed")),
        (Some(1), 3.0, 1.0)
    );
    assert_eq!(
        (&found["steps"][3]["step"], &found["steps"][3]["verdict"]),
        (&"memory".into(), &"failed".into())
    );
    assert_eq!(peer.board().acts, 0);
}

#[test]
fn a_port_that_goes_away_between_the_exposures_leaves_nothing() {
    let (port, _board) = plug_in(Faults { gone_at_program: true, ..Faults::default() });
    capture_fails(&port, &["went away while running the exposure program", &port]);
}

#[test]
fn a_board_that_is_reset_in_mid_capture_leaves_nothing() {
    let (port, peer) = plug_in(Faults::default());
    succeeds(&mut farnear(&["rig", "home", "--port", &port]));
    peer.board().faults.reset_at_move = true;
    capture_fails(&port, &["the board was reset while moving", "boot 7 became 8", "watchdog"]);
}

#[test]
fn a_camera_without_images_is_waited_for_no_longer_than_asked_and_the_rig_stops() {
    let (port, peer) = plug_in(Faults::default());
    capture_fails(&port, &["gave no image of exposure 0 within 1s"]);
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn another_schema_key_is_reported_with_both_keys() {
    let (port, peer) = plug_in(Faults::default());
    peer.board().hello.schema_key = 0xabc;
    capture_fails(&port, &["message tables differ", "0000000000000abc", "flash the firmware"]);
}
