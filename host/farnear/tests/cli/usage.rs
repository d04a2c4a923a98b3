//! Help, bad usage and where figures go.

use std::{fs, fs::File, process::Stdio};

use crate::common::{Folder, fails, farnear, figures, rig_optics, succeeds};

/// Checks the help of a command and of those below it; returns their number.
fn helped(command: &[&str]) -> usize {
    let (help, _) = succeeds(farnear(command).arg("--help"));
    assert!(help.contains("Example: farnear ") && help.contains(&command.join(" ")), "{help}");
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let listed = listed.take_while(|line| !line.is_empty());
    let names = listed.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    1 + names.map(|name| helped(&[command, &[name]].concat())).sum::<usize>()
}

#[test]
fn every_command_has_help_with_an_example() {
    let commands = helped(&[]);
    assert_eq!(commands, 76, "a command is new or gone");
}

#[test]
fn bad_usage_ends_with_2() {
    let optics = rig_optics();
    for (arguments, phrases) in [
        (vec![], vec!["Usage: farnear"]),
        (vec!["rig"], vec!["Usage: farnear rig"]),
        (vec!["dept"], vec!["dept", "depth"]),
        (vec!["stack", "a"], vec!["tip: similar commands: `farnear focus-stack`, `farnear calibrate stack`"]),
        (vec!["measure", "pair1"], vec!["follows `farnear measure`: region, plane, profile, difference"]),
        (
            vec!["focus-stack", "a/1.jpg", "a/2.jpg", "--out", "x"],
            vec!["'a/2.jpg'", "tip: give the folder of the pictures: a\n"],
        ),
        (vec!["optics"], vec!["an optics file, or --distance-mm"]),
        (vec!["optics", "far.png"], vec!["tip: a file is given by an option: --optics far.png"]),
        (vec!["depth", "a.png", "--optics", optics], vec!["<NEAR>"]),
        (
            vec!["depth", "a.png", "b.png", "--optics", optics, "--window", "4"],
            vec!["--window", "'4'", "odd", "63"],
        ),
        (
            vec!["depth", "a.png", "b.png", "--optics", optics, "--median-px", "9"],
            vec!["median-px", "9", "7"],
        ),
        (vec!["depth", "a.png", "b.png", "--optics", optics, "--window", "-3"], vec!["'-3'"]),
        (
            vec!["depth", "--fill", "surface", "a.png", "b.png", "--optics", optics],
            vec!["tip: the value of --fill follows an equals sign: --fill=surface"],
        ),
        (vec!["operators", "--optics", optics, "--psf", "airy"], vec!["airy", "gaussian"]),
        (vec!["operators", "--optics", optics, "--family", "grow"], vec!["grow", "ggro"]),
        (vec!["operators", "--optics", optics, "--design", "cubic"], vec!["cubic", "linear"]),
        (vec!["render", "--optics", optics, "--out", "x", "--scene", "cube"], vec!["cube", "staircase"]),
        (vec!["render", "--optics", optics, "--out", "x", "--noise", "9bit"], vec!["9bit", "12bit"]),
        (vec!["rig", "info", "--port", "sim", "--scene", "cube"], vec!["cube", "staircase"]),
        (vec!["rig", "info", "--port", "sim", "--noise", "9bit"], vec!["9bit", "12bit"]),
        (vec!["rig", "info", "--port", "/dev/x", "--seed", "2"], vec!["--seed goes with --port sim only"]),
        (vec!["sun", "--lat", "95", "--lon", "0", "--time", "2014-06-23T11:30:00Z"], vec!["95", "-90 to 90"]),
        (vec!["sun", "--lat", "9", "--lon", "-181", "--time", "2014-06-23T11:30:00Z"], vec!["-181", "360"]),
        (vec!["sun", "--lat", "52", "--lon", "0", "--time", "noon"], vec!["noon", "RFC 3339"]),
        (
            vec!["sun", "--lat", "52", "--lon", "0", "--time", "2014-06-23T11:30:00Z", "--model", "noaa"],
            vec!["noaa", "psa", "board"],
        ),
        (
            vec!["silhouettes", "markers", "a.c3d", "--template", "x", "--out", "y", "--views", "0"],
            vec!["72"],
        ),
        (vec!["silhouettes", "synthetic", "--out", "x", "--activities", "sing"], vec!["sing", "walk, drop"]),
        (vec!["rig", "move", "--port", "sim", "--axis", "z", "--to-um", "1"], vec!["'z'", "coarse", "lens"]),
        (
            vec!["rig", "move", "--port", "x", "--axis", "lens", "--axis", "fine", "--to-um", "1"],
            vec!["to-um 1: expected 2 positions, one for each axis"],
        ),
        (
            vec![
                "rig", "move", "--port", "x", "--axis", "fine", "--to-um", "1", "--axis", "fine", "--to-um",
                "2",
            ],
            vec!["axis fine: expected each axis once"],
        ),
        (vec!["rig", "settings", "get", "speed", "--port", "x"], vec!["setting speed", "datum_nm"]),
        (vec!["rig", "calibrate", "backlash", "--port", "x", "--axis", "fine"], vec!["fine", "piezo"]),
        (vec!["rig", "sequence", "--port", "sim", "--out", "x"], vec!["expected a program", "steps"]),
        (vec!["rig", "sequence", "--port", "sim", "--out", "x", "--steps", "3"], vec!["--axis"]),
        (
            "rig sequence --port sim --out x --axis fine --from 20 --to 180 --steps 1".split(' ').collect(),
            vec!["steps 1", "20 um to 180 um"],
        ),
        (vec!["rig", "focus", "--port", "sim", "--optics", optics, "--region", "1,2"], vec!["--region"]),
        (
            vec!["rig", "sun", "--port", "x", "--lat", "91", "--lon", "0", "--time", "2012-07-17T12:00:00Z"],
            vec!["lat 91", "90"],
        ),
        (
            vec!["rig", "sun", "--port", "x", "--lat", "1", "--lon", "0", "--time", "noon"],
            vec!["noon", "RFC 3339"],
        ),
        (
            vec!["rig", "correct", "a.npy", "--port", "x", "--correction", "c", "--out", "a.png"],
            vec!["a.png", ".npy"],
        ),
        (vec!["completions", "cmd"], vec!["cmd", "bash"]),
    ] {
        fails(&mut farnear(&arguments), 2, &phrases);
    }
}

#[test]
fn figures_are_json_on_stdout_and_text_without_the_flag() {
    let optics = ["optics", "--optics", rig_optics()];
    let json = figures(farnear(&optics).arg("--json"));
    let (text, _) = succeeds(&mut farnear(&optics));
    let keys: Vec<_> = json.as_object().expect("an object").keys().collect();
    assert_eq!(text.lines().count(), keys.len());
    assert!(keys.iter().all(|key| text.contains(&format!("{key} = "))), "{text}");
}

/// Of several options for files the right one is unknown, and a number is not a file.
#[test]
fn no_option_is_named_by_chance() {
    for arguments in [["rig", "capture", "optics.toml"], ["rig", "move", "0.5"]] {
        let error = fails(&mut farnear(&arguments), 2, &["unexpected argument"]);
        assert!(!error.contains("a file is given"), "{error}");
    }
}

#[test]
fn completions_name_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let (script, _) = succeeds(&mut farnear(&["completions", shell]));
        assert!(script.contains("farnear") && script.contains("capture"), "{shell}: {script}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_is_a_failure() {
    for arguments in
        [vec!["optics", "--optics", rig_optics()], vec!["completions", "bash"], vec!["depth", "--help"]]
    {
        let full = File::options().write(true).open("/dev/full").expect("Linux has /dev/full");
        let child = std::process::Command::new(env!("CARGO_BIN_EXE_farnear"))
            .args(&arguments)
            .stdout(full)
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let output = child.wait_with_output().expect("it ends");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(stderr.contains("cannot write to the standard output"), "{stderr}");
    }
}

#[test]
fn a_closed_stdout_ends_the_program_without_a_message() {
    for arguments in
        [vec!["optics", "--optics", rig_optics()], vec!["activity", "models", "--sheet"], vec!["--help"]]
    {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_farnear"));
        let output = command.args(&arguments).stdout(writer).stderr(Stdio::piped()).spawn();
        let output = output.expect("the program starts").wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(141), "{arguments:?}");
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn a_closed_stderr_changes_no_exit_code() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_farnear"));
    let status = command.args(["optics", "--optics", "absent.toml"]).stderr(writer).status();
    assert_eq!(status.expect("the program starts").code(), Some(1));
}

#[test]
fn operators_are_named_or_read_or_refused() {
    let folder = Folder::new();
    let saved = folder.text("operators.toml");
    let design = ["operators", "--optics", rig_optics(), "--psf", "gaussian:k=0.4578", "--family", "gro"];
    let json = figures(farnear(&design).args(["--design", "linear", "--out", &saved, "--json"]));
    assert!(json["nir_rms"].as_f64() < Some(0.1) && json["seconds"].is_number(), "{json}");

    let wrong = ["operators", "--optics", rig_optics(), "--family", "watanabe"];
    fails(&mut farnear(&wrong), 1, &["watanabe", "pillbox", "gaussian"]);
    let [far, near] = ["far.png", "near.png"].map(|name| folder.text(name));
    crate::common::render(&folder, "cone", "cone");
    for name in ["far.png", "near.png"] {
        fs::copy(folder.path(&format!("cone/{name}")), folder.path(name)).expect("a copy");
    }
    let depth = |choice: [&str; 2], out: &str| {
        let mut command = farnear(&["depth", &far, &near, "--optics", rig_optics()]);
        command.args(choice).args(["--out", &folder.text(out)]);
        command
    };
    succeeds(&mut depth(["--operators", &saved], "saved"));
    succeeds(&mut depth(["--operators", "gro:linear"], "named"));
    succeeds(&mut depth(["--method", "ro"], "default"));
    let map = |name: &str| fs::read(folder.path(&format!("{name}/depth.npy"))).expect("a map");
    assert!(map("saved") == map("named") && map("named") == map("default"));

    let before = folder.listing();
    let empty = folder.file("empty.toml", "");
    for (operators, phrases) in [
        ("gro:cubic", ["cubic", "linear"]),
        ("watanabe:linear", ["watanabe", "pillbox"]),
        ("absent.toml", ["absent.toml", "gro:linear"]),
        (&empty, ["empty.toml", "is empty"]),
        (rig_optics(), ["rig.toml", "does not hold saved operators"]),
    ] {
        fails(&mut depth(["--operators", operators], "new"), 1, &phrases);
    }
    fs::remove_file(empty).expect("the file");
    assert_eq!(folder.listing(), before);
}
