//! Scenarios that once violated a property, or show the file format: every property holds.

use std::{fs, path::PathBuf, process::Command, sync::Mutex};

use farnear_campaign::play_alone;
use farnear_sim::Scenario;

fn files() -> Vec<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/scenarios");
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    files
}

#[test]
fn every_property_holds_in_each_recorded_scenario() {
    let files = files();
    assert!(files.len() >= 4, "{files:?}");
    let (next, failures) = (Mutex::new(files.iter()), Mutex::new(Vec::new()));
    // Two in parallel: other tests run at the same time.
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some(file) = next.lock().expect("not poisoned").next() else { return };
                    let scenario = Scenario::read(file).unwrap_or_else(|error| panic!("{error}"));
                    let outcome = play_alone(&scenario, None).unwrap_or_else(|error| panic!("{error}"));
                    assert!(outcome.counts.answered > 10, "{} plays nothing: {outcome:?}", file.display());
                    failures.lock().expect("not poisoned").extend(
                        outcome.broken.iter().map(|broken| format!("{}: {broken:?}", file.display())),
                    );
                }
            });
        }
    });
    let failures = failures.into_inner().expect("not poisoned");
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_shard_without_a_seed_is_an_error() {
    let program = Command::new(env!("CARGO_BIN_EXE_farnear-campaign"))
        .args(["run", "--seeds", "3", "--shard", "8/8"])
        .output()
        .expect("farnear-campaign starts");
    let stderr = String::from_utf8_lossy(&program.stderr);
    assert!(
        !program.status.success() && stderr.contains("shard 8/8 has none of the 3 seeds from 1"),
        "{stderr}"
    );
}

#[test]
fn plays_a_scenario_and_rejects_an_invalid_one_with_line_and_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |text: &str| {
        let file = folder.path().join("scenario.toml");
        fs::write(&file, text).expect("writable");
        let program = Command::new(env!("CARGO_BIN_EXE_farnear-campaign"))
            .args(["play"])
            .arg(&file)
            .output()
            .expect("farnear-campaign starts");
        let text = String::from_utf8_lossy(&program.stdout) + String::from_utf8_lossy(&program.stderr);
        (program.status.success(), text.into_owned())
    };
    let good = "[[host]]\ndoes = \"move\"\naxis = \"fine\"\nto_um = 50.0\n\
                [[happens]]\non = \"move-done\"\nwhat = \"reset-button\"";
    let (well, output) = run(&format!("start_um = [100.0, 200.0]\n{good}"));
    assert!(well && output.contains("1 resets") && output.contains("every property holds"), "{output}");
    let (well, output) = run("[[happens]]\nafter_ms = 3\nwhat = \"motor-weak\"\namount = 7");
    let named = ["line 1", "amount = 7", "0 to 1"].iter().all(|part| output.contains(part));
    assert!(!well && named && output.contains("scenario.toml"), "{output}");
}
