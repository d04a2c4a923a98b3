//! `cargo xtask demo` and `test` share a compiled package, and all above it, only if both enable the same features.

use std::{collections::BTreeMap, process::Command};

/// Features of each build of each package, for a selection of packages and edges.
fn features(arguments: &[&str]) -> BTreeMap<String, Vec<String>> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--prefix", "none", "--format", "{p}\t{f}"])
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let (package, features) = line.split_once('\t').unwrap_or((line, ""));
        let features = features.trim_end_matches(" (*)").to_owned();
        let builds = found.entry(package.trim_end_matches(" (proc-macro)").to_owned()).or_default();
        if !builds.contains(&features) {
            builds.push(features);
        }
    }
    found
}

/// No package of the demo is compiled with other features for another selection.
fn shares_with_the_demo(other: &BTreeMap<String, Vec<String>>) {
    let demo = features(&[&DEMO[..], &["--edges", "normal,build"]].concat());
    assert!(demo.len() > 100, "cargo tree found {} packages only", demo.len());
    let differs = |(package, builds): &(&String, &Vec<String>)| {
        !builds.iter().all(|build| other.get(*package).is_some_and(|all| all.contains(build)))
    };
    let said = |(package, builds): (&String, &Vec<String>)| {
        format!("{package}: the demo with {builds:?}, the others with {:?}", other.get(package))
    };
    let twice: Vec<String> = demo.iter().filter(differs).map(said).collect();
    assert!(
        twice.is_empty(),
        "compiled twice; turn the feature on in host/farnear/Cargo.toml too:\n{}",
        twice.join("\n")
    );
}

const DEMO: [&str; 6] = ["--package", "farnear", "--package", "farnear-sim", "--package", "farnear-campaign"];

#[test]
fn the_demo_and_the_tests_compile_the_same_packages() {
    let tests = ["--workspace", "--exclude", "farnear-python", "--edges", "normal,build,dev"];
    shares_with_the_demo(&features(&tests));
}

#[test]
fn the_python_module_shares_what_the_programs_compile() {
    let module = [&DEMO[..], &["--package", "farnear-python", "--edges", "normal,build"]].concat();
    shares_with_the_demo(&features(&module));
}
