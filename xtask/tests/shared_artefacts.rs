//! `cargo xtask demo` builds two programs, `cargo xtask test` the whole workspace. A package is compiled once for both only while
//! both turn on the same of its features; one feature more, deep below, doubles everything above it.

use std::{collections::BTreeMap, process::Command};

/// The features of each package, of all its builds, under a selection of packages and edges.
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

#[test]
fn the_demo_and_the_tests_compile_the_same_packages() {
    let demo = features(&["--package", "farnear", "--package", "farnear-sim", "--edges", "normal,build"]);
    let tests = features(&["--workspace", "--edges", "normal,build,dev"]);
    assert!(demo.len() > 100, "cargo tree found {} packages only", demo.len());
    let twice: Vec<String> = demo
        .iter()
        .filter(|(package, builds)| {
            !builds.iter().all(|build| tests.get(*package).is_some_and(|all| all.contains(build)))
        })
        .map(|(package, builds)| {
            format!("{package}: the demo with {builds:?}, the tests with {:?}", tests.get(package))
        })
        .collect();
    assert!(
        twice.is_empty(),
        "compiled for the demo and again for the tests; turn the feature on in host/farnear/Cargo.toml too:\n{}",
        twice.join("\n")
    );
}
