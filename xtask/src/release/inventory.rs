//! Bill of materials (CycloneDX) and licences from cargo's metadata; one outside [`ACCEPTED`] stops the release.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};

use super::Release;
use crate::{
    boards::BOARDS,
    run::{ROOT, cargo, output},
};

const LIST: &str = "farnear.cdx.json";
const NOTICES: &str = "THIRD-PARTY.txt";
const PAGE: &str = "host/serve/page/vendor/LICENSES.txt";
/// Each dependency must offer one. All allow binaries; MPL-2.0 requires available sources, as on crates.io.
const ACCEPTED: [&str; 9] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "MPL-2.0",
    "Unicode-3.0",
    "Zlib",
];

struct Part {
    name: String,
    version: String,
    licence: String,
    folder: PathBuf,
}

pub fn write(release: &Release) -> Result<PathBuf> {
    let mut parts = BTreeMap::new();
    parts_of(&ROOT, &crate::host::PROGRAMS, &mut parts)?;
    for board in &BOARDS {
        parts_of(&board.folder(), &[&board.program()], &mut parts)?;
    }
    let refused: Vec<_> = parts.values().filter(|part| !accepted(&part.licence)).map(described).collect();
    if !refused.is_empty() {
        bail!("licences that are not accepted: {} (see ACCEPTED)", refused.join(", "));
    }
    let components: Vec<_> = parts
        .values()
        .map(|part| {
            json!({
                "type": "library", "name": part.name, "version": part.version,
                "purl": format!("pkg:cargo/{}@{}", part.name, part.version),
                "licenses": [{"expression": expression(&part.licence)}],
            })
        })
        .collect();
    let list = json!({
        "bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
        "metadata": {"component": {"type": "application", "name": "farnear", "version": release.version,
            "licenses": [{"expression": "MIT OR Apache-2.0"}]}},
        "components": components,
    });
    fs::write(release.out.join(LIST), serde_json::to_string_pretty(&list)? + "\n")
        .with_context(|| format!("cannot write {LIST}"))?;

    let notices = release.out.join(NOTICES);
    fs::write(&notices, texts(parts.values())?).with_context(|| format!("cannot write {NOTICES}"))?;
    println!("{} dependencies, all under accepted licences", parts.len());
    Ok(notices)
}

fn described(part: &Part) -> String {
    format!("{} {} ({})", part.name, part.version, part.licence)
}

/// Packages linked into `roots` on Linux, without build and test dependencies.
fn parts_of(workspace: &Path, roots: &[&str], parts: &mut BTreeMap<(String, String), Part>) -> Result<()> {
    let mut call = if workspace == *ROOT { cargo(["metadata"]) } else { Command::new("cargo") };
    if workspace != *ROOT {
        call.arg("metadata").current_dir(workspace);
    }
    let metadata: Value = serde_json::from_str(&output(call.args(["--format-version", "1", "--locked"]))?)
        .context("cargo metadata printed no JSON")?;
    let packages: BTreeMap<&str, &Value> =
        list(&metadata["packages"]).filter_map(|package| Some((package["id"].as_str()?, package))).collect();
    let nodes: BTreeMap<&str, &Value> =
        list(&metadata["resolve"]["nodes"]).filter_map(|node| Some((node["id"].as_str()?, node))).collect();
    let mut open: Vec<&str> = packages
        .iter()
        .filter(|(_, package)| package["name"].as_str().is_some_and(|name| roots.contains(&name)))
        .map(|(id, _)| *id)
        .collect();
    let mut seen = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !seen.insert(id) {
            continue;
        }
        for dependency in nodes.get(id).into_iter().flat_map(|node| list(&node["deps"])) {
            // A linked dependency has kind null.
            if list(&dependency["dep_kinds"]).any(|kind| kind["kind"].is_null() && linux(&kind["target"])) {
                open.extend(dependency["pkg"].as_str());
            }
        }
        let package = packages.get(id).with_context(|| format!("cargo metadata lacks {id}"))?;
        // The project's own packages have no source.
        if package["source"].is_null() {
            continue;
        }
        let text = |key: &str| package[key].as_str().unwrap_or_default().to_owned();
        let manifest = PathBuf::from(text("manifest_path"));
        let part = Part {
            name: text("name"),
            version: text("version"),
            licence: text("license"),
            folder: manifest.parent().unwrap_or(&manifest).into(),
        };
        parts.insert((part.name.clone(), part.version.clone()), part);
    }
    Ok(())
}

/// Whether a dependency may be part of a program for Linux; yes in doubt.
fn linux(platform: &Value) -> bool {
    platform.as_str().is_none_or(|platform| {
        !["windows", "macos", "apple", "wasm", "hermit", "wasi"].iter().any(|other| platform.contains(other))
            || platform.contains("not(")
    })
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// As SPDX; older manifests use a stroke for OR.
fn expression(licence: &str) -> String {
    licence.split('/').map(str::trim).collect::<Vec<_>>().join(" OR ")
}

/// Whether each part of an AND offers an accepted licence. Manifests nest at most one pair of brackets.
fn accepted(licence: &str) -> bool {
    !licence.is_empty()
        && expression(licence).split(" AND ").all(|choice| {
            choice.trim_matches(['(', ')']).split(" OR ").any(|one| ACCEPTED.contains(&one.trim()))
        })
}

/// Each licence text once, with the names of its parts.
fn texts<'a>(parts: impl Iterator<Item = &'a Part>) -> Result<String> {
    let mut bearers: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut bare = Vec::new();
    for part in parts {
        let mut found = false;
        let mut files: Vec<_> = fs::read_dir(&part.folder)
            .with_context(|| format!("cannot read {}", part.folder.display()))?
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.is_file() && is_licence(path))
            .collect();
        files.sort();
        for file in files {
            // Some are not UTF-8.
            let text = fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            let text = String::from_utf8_lossy(&text).replace("\r\n", "\n").trim().to_owned();
            bearers.entry(text).or_default().push(described(part));
            found = true;
        }
        if !found {
            bare.push(described(part));
        }
    }
    let mut all = String::from("What farnear is linked from, and under which licences.\n");
    if !bare.is_empty() {
        write!(all, "\nWithout a text of their own, under the licence named: {}.\n", bare.join(", "))?;
    }
    for (text, names) in bearers {
        write!(all, "\n{}\n{}\n\n{text}\n", "=".repeat(80), names.join(", "))?;
    }
    let page = fs::read_to_string(ROOT.join(PAGE)).with_context(|| format!("cannot read {PAGE}"))?;
    write!(all, "\n{}\nOn the page in the browser\n\n{page}", "=".repeat(80))?;
    Ok(all)
}

fn is_licence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
    ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE"]
        .iter()
        .any(|start| name.starts_with(start))
}

#[cfg(test)]
mod tests {
    use super::{accepted, expression};

    #[test]
    fn a_choice_needs_one_accepted_licence_and_a_sum_all() {
        for licence in ["MIT", "MIT/Apache-2.0", "MIT OR GPL-3.0-only", "(MIT OR Apache-2.0) AND Unicode-3.0"]
        {
            assert!(accepted(licence), "{licence}");
        }
        for licence in ["", "GPL-3.0-only", "MIT AND GPL-3.0-only", "LGPL-2.1-or-later OR GPL-2.0"] {
            assert!(!accepted(licence), "{licence}");
        }
        assert_eq!(expression("Apache-2.0 / MIT"), "Apache-2.0 OR MIT");
    }
}
