//! `farnear doctor`: report and exit code.

use crate::common::{Folder, built, farnear};

#[test]
fn each_line_has_a_state_and_a_remedy() {
    let folder = Folder::new();
    let gone = folder.text("gone");
    let output = farnear(&["doctor", &gone, "--port", "/dev/does-not-exist"])
        .current_dir(folder.path(""))
        .output()
        .expect("the program starts");
    let (stdout, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{stdout}{error}");
    for line in stdout.lines() {
        let (health, rest) = line.split_once(' ').expect("a word");
        assert!(["ok", "optional", "missing"].contains(&health), "{line}");
        assert!(health == "ok" || rest.contains("; "), "nothing to do: {line}");
    }
    for phrase in ["AVX", "can be written to", "does-not-exist"] {
        assert!(stdout.contains(phrase), "{phrase}: {stdout}");
    }
    let of_gone = stdout.lines().find(|line| line.contains(&gone)).expect("a line about the folder");
    assert!(of_gone.starts_with("missing"), "{of_gone}");
    assert!(error.contains("missing"), "{error}");
    assert_eq!(folder.listing(), Vec::<String>::new(), "it has left something behind");
}

#[test]
fn a_computer_that_has_all_is_well() {
    let folder = Folder::new();
    let output =
        farnear(&["doctor", "--json"]).current_dir(folder.path("")).output().expect("the program starts");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let findings = found["findings"].as_array().expect("findings");
    let missing = findings.iter().filter(|finding| finding["health"] == "missing").count();
    assert_eq!(output.status.code(), Some(i32::from(missing > 0)), "{found}");
    let rig = findings.iter().find(|finding| finding["what"] == "emulated rig").expect("the emulated rig");
    assert_eq!(
        rig["health"] == "optional",
        !built("farnear-sim").is_file() && !on_path("farnear-sim"),
        "{rig}"
    );
}

fn on_path(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}
