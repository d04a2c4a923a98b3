//! Seeded fault campaigns on the emulated board: draws scenarios, plays them on all cores with a protocol
//! client ([`host_model`]), checks [`invariants`] and shrinks the scenarios that violate one.

mod draw;
pub mod host_model;
pub mod invariants;
mod shrink;

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    str::FromStr,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    time::Duration,
};

pub use self::{draw::draw, shrink::shrink};
use farnear_sim::{RigConfig, Scenario, SimError};

use host_model::{Counts, Outcome, play};
use invariants::Broken;

/// Part `index` of `count` of the seeds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    pub index: u64,
    pub count: u64,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err(format!(
                "{text:?} is not a shard: expected INDEX/COUNT, e.g. 2/8 for the second of eight"
            )),
        }
    }
}

#[derive(Clone, Debug)]
pub struct Campaign {
    pub seeds: std::ops::Range<u64>,
    pub shard: Shard,
    pub jobs: usize,
    /// `None`: next to the program.
    pub firmware: Option<PathBuf>,
    /// Folder for the shrunk scenarios.
    pub out: PathBuf,
}

impl Campaign {
    /// The seeds of this shard.
    pub fn own_seeds(&self) -> Vec<u64> {
        let Shard { index, count } = self.shard;
        self.seeds.clone().filter(|seed| seed % count == index - 1).collect()
    }
}

#[derive(Clone, Default, Debug)]
pub struct Summary {
    pub played: u64,
    /// Violations: seed, first violated property, file.
    pub broken: Vec<(u64, Broken, PathBuf)>,
    pub board_s: f64,
    /// Answered requests, work done and failed, alarms, exposures, resets.
    pub counts: [u64; 6],
}

impl Summary {
    fn add(&mut self, outcome: &Outcome) {
        self.played += 1;
        self.board_s += outcome.board_ns as f64 * 1e-9;
        let Counts { answered, done, failed, alarms, exposures } = outcome.counts;
        let [done, failed, alarms, exposures] = [done, failed, alarms, exposures].map(u64::from);
        let seen = [answered, done, failed, alarms, exposures, outcome.resets as u64];
        self.counts.iter_mut().zip(seen).for_each(|(sum, one)| *sum += one);
    }

    /// JSON with repeatable content only; files by name.
    pub fn json(&self) -> serde_json::Value {
        let [answered, done, failed, alarms, exposures, resets] = self.counts;
        let broken = self.broken.iter().map(|(seed, broken, file)| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let at_s = broken.at_ns as f64 * 1e-9;
            serde_json::json!({
                "seed": seed, "property": broken.property, "at_s": at_s, "what": broken.what, "file": name,
            })
        });
        serde_json::json!({
            "scenarios": self.played, "board_s": self.board_s, "answered": answered, "done": done, "failed": failed,
            "alarms": alarms, "exposures": exposures, "resets": resets, "broken": broken.collect::<Vec<_>>(),
        })
    }

    /// Table for the terminal. `cpu`: CPU time used.
    pub fn table(&self, cpu: Duration) -> String {
        let [answered, done, failed, alarms, exposures, resets] = self.counts;
        let per = cpu.as_secs_f64() / (self.played.max(1) as f64);
        let mut text = String::from("| what | |\n|---|---|\n");
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "| scenarios | {} |\n| broken | {} |\n| board time | {:.0} s |\n| CPU time | {:.0} s, {per:.2} s a scenario |\n\
             | requests answered | {answered} |\n| work done, failed | {done}, {failed} |\n| alarms | {alarms} |\n\
             | exposures | {exposures} |\n| resets | {resets} |\n",
            self.played,
            self.broken.len(),
            self.board_s,
            cpu.as_secs_f64(),
        );
        for (seed, broken, file) in &self.broken {
            let _ = writeln!(
                text,
                "| seed {seed}: {} at {:.3} s | {}; {} |",
                broken.property,
                broken.at_ns as f64 * 1e-9,
                broken.what,
                file.display()
            );
        }
        text
    }
}

/// Plays a scenario with its own seed and parts.
pub fn play_alone(scenario: &Scenario, firmware: Option<&Path>) -> Result<Outcome, SimError> {
    let config =
        RigConfig::of(scenario).map_err(|reason| SimError::Scenario { path: "scenario".into(), reason })?;
    play(scenario, &RigConfig { firmware: firmware.map(Into::into), ..config })
}

/// `progress` is called when a scenario ends. Violations are not errors.
pub fn run(campaign: &Campaign, mut progress: impl FnMut(u64, &Outcome)) -> Result<Summary, SimError> {
    // Before hours of scenarios.
    let probe = campaign.out.join(format!(".probe-{}", std::process::id()));
    let writable = fs::create_dir_all(&campaign.out).and_then(|()| fs::write(&probe, []));
    writable.and_then(|()| fs::remove_file(&probe)).map_err(|source| {
        let what = format!("cannot write to the folder {}", campaign.out.display());
        SimError::Io { what, source }
    })?;
    let seeds = campaign.own_seeds();
    let next = AtomicU64::new(0);
    let stopped = Mutex::new(None);
    let mut summary = Summary::default();
    std::thread::scope(|scope| {
        let (tell, results) = mpsc::channel();
        for _ in 0..campaign.jobs.max(1) {
            let (tell, next, seeds, stopped) = (tell.clone(), &next, &seeds, &stopped);
            scope.spawn(move || {
                while let Some(seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed) as usize) {
                    let play = |scenario: &Scenario| play_alone(scenario, campaign.firmware.as_deref());
                    match one(campaign, *seed, play) {
                        Ok(result) => drop(tell.send((*seed, result))), // the receiver may have gone
                        Err(error) => {
                            *stopped.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                            next.store(u64::MAX / 2, Ordering::Relaxed);
                        }
                    }
                }
            });
        }
        drop(tell);
        for (seed, (outcome, file)) in results {
            summary.add(&outcome);
            progress(seed, &outcome);
            if let (Some(broken), Some(file)) = (outcome.broken.first(), file) {
                summary.broken.push((seed, broken.clone(), file));
            }
        }
    });
    summary.broken.sort_by_key(|(seed, ..)| *seed);
    let stopped = stopped.into_inner().unwrap_or_else(PoisonError::into_inner);
    stopped.map_or(Ok(summary), Err)
}

/// `play` runs a scenario.
fn one(
    campaign: &Campaign,
    seed: u64,
    play: impl Fn(&Scenario) -> Result<Outcome, SimError>,
) -> Result<(Outcome, Option<PathBuf>), SimError> {
    let scenario = draw(seed);
    let play = |scenario: &Scenario| play(scenario).or_else(as_violation);
    let outcome = play(&scenario)?;
    let Some(broken) = outcome.broken.first() else { return Ok((outcome, None)) };
    let small = shrink(&scenario, broken.property, play)?;
    let path = campaign.out.join(format!("{}-{seed}.toml", broken.property));
    let io = |source| SimError::Io { what: format!("cannot write {}", path.display()), source };
    let what = broken.what.replace('\n', " "); // a comment ends with its line
    let text = format!("# Breaks \"{}\": {what}\n\n{}", broken.property, small.text());
    fs::write(&path, text).map_err(io)?;
    Ok((outcome, Some(path)))
}

/// A run that ends with an error violates `runs`, unless every scenario would fail for the same reason.
fn as_violation(error: SimError) -> Result<Outcome, SimError> {
    match error {
        SimError::NoFirmware(_) | SimError::Firmware { .. } | SimError::Io { .. } => Err(error),
        error => {
            let broken = vec![Broken { property: "runs", at_ns: 0, what: error.to_string() }];
            Ok(Outcome { broken, ..Outcome::default() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_a_shard_and_rejects_an_invalid_one() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, count: 8 }));
        for text in ["", "2", "0/8", "9/8", "a/b", "1/0"] {
            let refused = text.parse::<Shard>().expect_err(text);
            assert!(refused.contains("second of eight"), "{refused}");
        }
    }

    #[test]
    fn each_seed_gives_a_distinct_scenario_that_a_file_can_hold() {
        let mut kinds = std::collections::BTreeSet::new();
        for seed in 0..2_000 {
            let scenario = draw(seed);
            assert_eq!(scenario, draw(seed));
            assert_eq!(Scenario::parse(&scenario.text()).as_ref(), Ok(&scenario), "{}", scenario.text());
            kinds.extend(scenario.happens.iter().map(|happening| happening.what.name));
        }
        assert_ne!(draw(1), draw(2));
        // All but those that only revert another one, gauge drift, and a renamed port.
        assert!(!kinds.contains("gauge-drifts") && !kinds.contains("link-renamed"));
        assert_eq!(kinds.len(), farnear_sim::faults::KINDS.len() - 7, "{kinds:?}");
    }

    #[test]
    fn a_folder_that_cannot_be_written_ends_a_campaign_before_its_first_scenario() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, []).expect("writable");
        let error = run(&campaign(&file.join("broken")), |seed, _| panic!("seed {seed} was played"));
        let error = error.expect_err("a file cannot hold a folder").to_string();
        assert!(error.contains("cannot write to the folder"), "{error}");
    }

    fn campaign(out: &Path) -> Campaign {
        let shard = Shard { index: 1, count: 1 };
        Campaign { seeds: 7..8, shard, jobs: 1, firmware: None, out: out.into() }
    }

    #[test]
    fn an_error_of_the_emulator_is_a_violation_with_a_scenario_file() {
        let out = tempfile::tempdir().expect("a folder");
        let fails = |_: &Scenario| Err(SimError::Emulator("unmapped read\nat 0x0".into()));
        let (outcome, file) = one(&campaign(out.path()), 7, fails).expect("a violation");
        assert_eq!(outcome.broken[0].property, "runs");
        let file = file.expect("a file");
        assert_eq!(file, out.path().join("runs-7.toml"));
        let text = fs::read_to_string(file).expect("readable");
        assert!(text.contains("unmapped read at 0x0") && Scenario::parse(&text).is_ok(), "{text}");

        let missing = |_: &Scenario| Err(SimError::NoFirmware("farnear-board".into()));
        let error = one(&campaign(out.path()), 7, missing).expect_err("no scenario can be played");
        assert!(matches!(error, SimError::NoFirmware(_)), "{error}");
    }

    #[test]
    fn an_error_while_shrinking_keeps_the_violation() {
        let out = tempfile::tempdir().expect("a folder");
        let whole = draw(7);
        let play = |scenario: &Scenario| {
            if *scenario != whole {
                return Err(SimError::Stopped);
            }
            let broken = vec![Broken { property: "position", at_ns: 0, what: String::new() }];
            Ok(Outcome { broken, ..Outcome::default() })
        };
        let (_, file) = one(&campaign(out.path()), 7, play).expect("a violation");
        let file = file.expect("a file");
        assert_eq!(file, out.path().join("position-7.toml"));
        let text = fs::read_to_string(file).expect("readable");
        assert_eq!(Scenario::parse(&text), Ok(whole));
    }

    #[test]
    fn shrinks_a_scenario_to_what_violates_the_property() {
        let text = "seed = 1\n[[happens]]\nafter_ms = 123.456\nwhat = \"motor-stalls\"\nfor_ms = 7\n\
                    [[happens]]\non = \"alarm\"\nnth = 3\ndelay_ms = 2\nwhat = \"reset-button\"\n\
                    [[host]]\ndoes = \"home\"\n[[host]]\ndoes = \"halt\"\n[[host]]\ndoes = \"stop\"\n";
        let scenario = Scenario::parse(text).expect("a scenario");
        // Violates the property while it resets and halts.
        let breaks = |scenario: &Scenario| {
            let text = scenario.text();
            let broken = text.contains("reset-button") && text.contains("halt");
            let broken = broken.then(|| Broken { property: "position", at_ns: 0, what: String::new() });
            Ok(Outcome { broken: broken.into_iter().collect(), ..Outcome::default() })
        };
        let small = shrink(&scenario, "position", breaks).expect("it runs");
        let expected = "[[happens]]\non = \"alarm\"\nwhat = \"reset-button\"\n\n[[host]]\ndoes = \"halt\"\n";
        assert_eq!(small.text(), format!("seed = 1\n\n{expected}"));
    }
}
