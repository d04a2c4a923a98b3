//! Checks this computer and suggests remedies. Opens no port unless one is named; moves nothing.

mod folders;
mod ports;

use std::path::PathBuf;

use farnear_capture::Client;
use farnear_depth::pipeline::Backend;
use serde::Serialize;

use crate::{camera, context::Context, error::Result, simulator};

#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct DoctorSettings {
    /// Port of a board whose firmware version is checked.
    pub port: Option<String>,
    /// Result folders to check, besides the current one.
    pub folders: Vec<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Health {
    Ok,
    /// Missing, and only needed for some tasks.
    Optional,
    Missing,
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Finding {
    pub what: String,
    pub health: Health,
    pub found: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub remedy: String,
}

impl Finding {
    fn ok(what: impl Into<String>, found: impl Into<String>) -> Self {
        Self { what: what.into(), health: Health::Ok, found: found.into(), remedy: String::new() }
    }

    fn bad(
        health: Health,
        what: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { what: what.into(), health, found: found.into(), remedy: remedy.into() }
    }
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct DoctorFigures {
    pub findings: Vec<Finding>,
}

impl DoctorFigures {
    pub fn missing(&self) -> usize {
        self.findings.iter().filter(|finding| finding.health == Health::Missing).count()
    }
}

/// Takes some milliseconds, with a port as long as the board's answer. Problems are findings, not errors.
pub fn examine(settings: &DoctorSettings, context: &Context<'_>) -> Result<DoctorFigures> {
    let mut findings = vec![processor()];
    findings.extend(folders::findings(&settings.folders));
    findings.push(emulated_rig());
    findings.extend(ports::findings());
    findings.push(cameras());
    findings.push(ffmpeg());
    context.cancel.check("looking at the computer")?;
    findings.push(firmware(settings.port.as_deref()));
    Ok(DoctorFigures { findings })
}

fn processor() -> Finding {
    const WHAT: &str = "processor";
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let cores = if cores == 1 { "1 core".into() } else { format!("{cores} cores") };
    match Backend::best() {
        Backend::Avx512 => Finding::ok(WHAT, format!("{cores}, AVX-512")),
        Backend::Avx2 => Finding::ok(WHAT, format!("{cores}, AVX2")),
        Backend::Neon => Finding::ok(WHAT, format!("{cores}, NEON")),
        Backend::Portable => {
            let remedy =
                "depth is right and some times slower than on a processor with AVX2 or NEON (docs/speed.md)";
            Finding::bad(Health::Optional, WHAT, format!("{cores}, neither AVX2, AVX-512 nor NEON"), remedy)
        }
    }
}

fn emulated_rig() -> Finding {
    const WHAT: &str = "emulated rig";
    let Ok(program) = simulator::find() else {
        let remedy = "`cargo xtask install` in a clone installs it; without it there is no --port sim";
        return Finding::bad(
            Health::Optional,
            WHAT,
            "farnear-sim is neither next to this program nor on the PATH",
            remedy,
        );
    };
    if simulator::firmware_of(&program).is_file() {
        return Finding::ok(WHAT, program.display().to_string());
    }
    let found = format!("{} without {} next to it", program.display(), simulator::FIRMWARE);
    Finding::bad(
        Health::Missing,
        WHAT,
        found,
        "`cargo xtask firmware` builds it, `cargo xtask install` lays it there",
    )
}

fn cameras() -> Finding {
    let listed = camera::list();
    let found: Vec<String> =
        listed.found.iter().map(|camera| format!("{} ({})", camera.address, camera.about)).collect();
    if !found.is_empty() {
        return Finding::ok("cameras", found.join(", "));
    }
    let absent: Vec<&str> = listed.kinds.iter().filter(|kind| !kind.built_in).map(|kind| kind.kind).collect();
    let built = if absent.is_empty() {
        String::new()
    } else {
        format!("; this program was built without {}", absent.join(" and "))
    };
    let remedy =
        "a folder in which images appear or a program that takes them is a camera too (docs/cameras.md)";
    Finding::bad(Health::Optional, "cameras", format!("none was found{built}"), remedy)
}

fn ffmpeg() -> Finding {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let name = format!("ffmpeg{}", std::env::consts::EXE_SUFFIX);
    match std::env::split_paths(&path).map(|folder| folder.join(&name)).find(|place| place.is_file()) {
        Some(program) => Finding::ok("video", program.display().to_string()),
        None => {
            let remedy = "Debian's package is ffmpeg; without it videos are Y4M files or folders of pictures";
            Finding::bad(Health::Optional, "video", "ffmpeg is not on the PATH", remedy)
        }
    }
}

fn firmware(port: Option<&str>) -> Finding {
    const WHAT: &str = "firmware";
    let Some(port) = port else {
        let remedy = "--port /dev/ttyACM0 asks the board there for its version";
        return Finding::bad(Health::Optional, WHAT, "no board was asked", remedy);
    };
    match Client::open(port) {
        Ok(client) => match client.firmware_note() {
            None => {
                Finding::ok(WHAT, format!("version {} on {port}, as this program", client.hello().firmware))
            }
            Some(note) => {
                let remedy =
                    "`cargo xtask firmware` builds the one that belongs to this program (docs/bring-up.md)";
                Finding::bad(Health::Missing, WHAT, note, remedy)
            }
        },
        Err(error) => {
            let remedy = "docs/bring-up.md: how to connect and flash the board";
            Finding::bad(Health::Missing, WHAT, error.to_string(), remedy)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_that_is_not_well_says_what_to_do() {
        let folder = tempfile::tempdir().expect("a folder");
        let gone = folder.path().join("gone");
        let settings = DoctorSettings { port: Some("/dev/does-not-exist".into()), folders: vec![gone] };
        let figures = examine(&settings, &Context::unattended()).expect("it looks only");
        for finding in &figures.findings {
            assert_eq!(finding.health == Health::Ok, finding.remedy.is_empty(), "{finding:?}");
        }
        let missing: Vec<&str> = figures
            .findings
            .iter()
            .filter(|finding| finding.health == Health::Missing && finding.what != "emulated rig")
            .map(|finding| finding.what.as_str())
            .collect();
        assert!(missing.contains(&"folder") && missing.contains(&"firmware"), "{missing:?}");
        assert!(figures.findings.iter().any(|finding| finding.found.contains("/dev/does-not-exist")));
    }
}
