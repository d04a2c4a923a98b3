use std::{
    env, fs,
    path::{Path, PathBuf},
};

use super::{Finding, Health};
use crate::operator_cache;

pub(super) fn findings(named: &[PathBuf]) -> Vec<Finding> {
    let mut findings = vec![env::current_dir().map_or_else(
        |error| {
            Finding::bad(Health::Missing, "folder", error.to_string(), "change into a folder that is there")
        },
        |folder| writable("folder", &folder, Health::Missing, "results go elsewhere with --out"),
    )];
    findings.extend(named.iter().map(|folder| {
        writable("folder", folder, Health::Missing, "make it, or give yourself the right to write to it")
    }));
    let cache = operator_cache::folder();
    findings.push(match cache {
        Some(folder) => {
            // Created on first use, so check its parent.
            let there = folder.ancestors().find(|folder| folder.is_dir()).unwrap_or(&folder).to_path_buf();
            let remedy =
                "XDG_CACHE_HOME names another; without one operators are designed again each time (some ms)";
            writable("cache", &there, Health::Optional, remedy)
        }
        None => Finding::bad(
            Health::Optional,
            "cache",
            "neither XDG_CACHE_HOME nor HOME is set",
            "without one operators are designed again each time (some ms)",
        ),
    });
    findings
}

/// Writes a file: permissions do not show a full or read-only disk.
fn writable(what: &str, folder: &Path, health: Health, remedy: &str) -> Finding {
    let trial = folder.join(format!(".farnear-doctor-{}", std::process::id()));
    let tried = fs::write(&trial, b"?");
    let _ = fs::remove_file(&trial); // not there where it could not be written
    match tried {
        Ok(()) => Finding::ok(what, format!("{} can be written to", folder.display())),
        Err(error) => {
            Finding::bad(health, what, format!("{} cannot be written to: {error}", folder.display()), remedy)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_tried_and_left_as_it_was() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(writable("folder", folder.path(), Health::Missing, "x").health, Health::Ok);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
        let gone = writable("folder", &folder.path().join("gone"), Health::Missing, "x");
        assert!(gone.health == Health::Missing && gone.found.contains("gone"), "{gone:?}");
    }
}
