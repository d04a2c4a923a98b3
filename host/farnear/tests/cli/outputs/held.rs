//! Runs a story and compares it with its recording.

use std::{collections::BTreeMap, env, fs, path::PathBuf};

use assert_cmd::Command;
use serde::{Deserialize, Serialize};

use super::digest::{Digest, hash, machine, numbers_and_rest};
use crate::common::{Folder, farnear, rig_optics};

/// Replaces `SMALL` in a command: a picture that renders fast.
const SMALL: &str = "--optics rig.toml --width 96 --height 72";
const TIMES: [&str; 4] = ["seconds", "seconds_per_frame", "cut_ms_per_frame", "rows_per_second"];
/// Relative and absolute tolerance for numbers in text between kinds of processors.
const TEXT_TOLERANCE: [f64; 2] = [2e-3, 2e-3];

#[derive(Default)]
pub struct Story<'a> {
    pub name: &'a str,
    /// Files in the folder, in addition to the rig's optics as `rig.toml`.
    pub files: &'a [(&'a str, &'a str)],
    /// Commands that run first, whose output is not compared.
    pub before: &'a [&'a str],
    /// Commands whose output is compared; blanks separate arguments.
    pub commands: &'a [&'a str],
}

#[derive(Serialize, Deserialize)]
struct Recording {
    machine: String,
    step: Vec<Step>,
}

#[derive(Serialize, Deserialize)]
struct Step {
    command: String,
    code: i32,
    stdout: String,
    stderr: String,
    #[serde(default)]
    file: Vec<Digest>,
}

impl Story<'_> {
    /// Runs the story; panics with all differences. `FARNEAR_RECORD=PROGRAM` records it with that program instead.
    pub fn is_held(&self) {
        let golden = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("tests/cli/outputs/golden")
            .join(self.name)
            .with_extension("toml");
        let recorder = env::var_os("FARNEAR_RECORD");
        let step = self.run(recorder.as_ref().map(PathBuf::from));
        if recorder.is_some() {
            let recording = Recording { machine: machine(), step };
            fs::write(&golden, toml::to_string_pretty(&recording).unwrap()).unwrap();
            return;
        }
        let text =
            fs::read_to_string(&golden).unwrap_or_else(|error| panic!("{}: {error}", golden.display()));
        let recording: Recording = toml::from_str(&text).unwrap();
        let same_kind =
            recording.machine == machine() && env::var_os("FARNEAR_OUTPUTS").is_none_or(|how| how != "close");
        let mut differences = Vec::new();
        let commands: Vec<&str> = recording.step.iter().map(|step| step.command.as_str()).collect();
        if commands != self.commands {
            differences.push(format!("the recording is of other commands: {commands:?}"));
        }
        for (recorded, found) in recording.step.iter().zip(&step) {
            found.compare(recorded, same_kind, &mut differences);
        }
        assert!(
            differences.is_empty(),
            "outputs differ from {}, which was recorded on {} (this is {}; see the README there):\n{}",
            golden.display(),
            recording.machine,
            machine(),
            differences.join("\n")
        );
    }

    fn run(&self, recorder: Option<PathBuf>) -> Vec<Step> {
        let folder = Folder::new();
        folder.file("rig.toml", fs::read(rig_optics()).unwrap());
        for (name, text) in self.files {
            folder.file(name, text);
        }
        let program = |command: &str| {
            let command = command.replace("SMALL", SMALL);
            let arguments: Vec<&str> = command.split_whitespace().collect();
            let mut started = match &recorder {
                // A cache of its own.
                Some(program) => {
                    let mut other = Command::new(program);
                    other.env("XDG_CACHE_HOME", folder.path(".cache")).args(&arguments);
                    other
                }
                None => farnear(&arguments),
            };
            // Records name the number of threads.
            started.env("RAYON_NUM_THREADS", "2");
            started.current_dir(folder.path("")).output().unwrap()
        };
        for command in self.before {
            let output = program(command);
            assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
        }
        let mut known = contents(&folder);
        let mut steps = Vec::new();
        for command in self.commands {
            let output = program(command);
            let found = contents(&folder);
            let written = found.iter().filter(|(name, hash)| known.get(*name) != Some(*hash));
            let file =
                written.map(|(name, _)| Digest::of(name, &fs::read(folder.path(name)).unwrap())).collect();
            let text = |bytes| without_times(&String::from_utf8(bytes).unwrap());
            steps.push(Step {
                command: (*command).into(),
                code: output.status.code().unwrap_or(-1),
                stdout: text(output.stdout),
                stderr: text(output.stderr),
                file,
            });
            known = found;
        }
        steps
    }
}

/// The files below a folder, without hidden ones, with a hash of each.
fn contents(folder: &Folder) -> BTreeMap<String, u64> {
    let names = folder.listing().into_iter().filter(|name| !name.starts_with('.'));
    names.filter_map(|name| Some((name.clone(), hash(&fs::read(folder.path(&name)).ok()?)))).collect()
}

fn without_times(text: &str) -> String {
    let mut text = text.to_owned();
    for key in TIMES {
        for mark in [format!("\"{key}\":"), format!("{key} = ")] {
            // A key that ends like this one is another.
            let at = text.match_indices(&mark).map(|(at, _)| at).find(|at| !text[..*at].ends_with('_'));
            let Some(from) = at.map(|at| at + mark.len()) else { continue };
            let end = text[from..].find([',', '}', '\n']).map_or(text.len(), |length| from + length);
            text.replace_range(from..end, "_");
        }
    }
    text
}

impl Step {
    fn compare(&self, recorded: &Self, same_kind: bool, differences: &mut Vec<String>) {
        let mut differ = |what: &str, recorded: &dyn std::fmt::Debug, found: &dyn std::fmt::Debug| {
            differences.push(format!("`{}`: {what} was {recorded:?} and is {found:?}", self.command));
        };
        if self.code != recorded.code {
            differ("the exit code", &recorded.code, &self.code);
        }
        for (what, recorded, found) in
            [("stdout", &recorded.stdout, &self.stdout), ("stderr", &recorded.stderr, &self.stderr)]
        {
            let like = if same_kind { found == recorded } else { texts_are_close(recorded, found) };
            if !like {
                differ(what, recorded, found);
            }
        }
        let names = |files: &[Digest]| files.iter().map(|file| file.name.clone()).collect::<Vec<_>>();
        if names(&self.file) != names(&recorded.file) {
            differ("the list of files", &names(&recorded.file), &names(&self.file));
            return;
        }
        for (recorded, found) in recorded.file.iter().zip(&self.file) {
            let like = if same_kind { found == recorded } else { found.is_close_to(recorded) };
            if !like {
                differ(&recorded.name, recorded, found);
            }
        }
    }
}

fn texts_are_close(recorded: &str, found: &str) -> bool {
    let [(numbers, rest), (others, other_rest)] = [recorded, found].map(numbers_and_rest);
    let [relative, absolute] = TEXT_TOLERANCE;
    let mut pairs = numbers.iter().zip(&others);
    rest == other_rest && pairs.all(|(a, b)| (a - b).abs() <= absolute + relative * a.abs())
}

#[test]
fn times_are_left_out_and_numbers_may_differ_a_little() {
    let json = "{\"seconds\":0.0123,\"seconds_per_frame\":5e-4,\"width\":96}\n";
    assert_eq!(without_times(json), "{\"seconds\":_,\"seconds_per_frame\":_,\"width\":96}\n");
    assert_eq!(without_times("seconds = 1.5\nboard_seconds = 2.5\n"), "seconds = _\nboard_seconds = 2.5\n");
    assert!(texts_are_close("median 905.25 mm", "median 905.3 mm"));
    assert!(!texts_are_close("median 905.25 mm", "median 915.3 mm"));
    assert!(!texts_are_close("median 905.25 mm", "mean 905.25 mm"));
}
