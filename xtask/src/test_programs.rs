//! The workspace's test programs: built by one cargo call, skipped if nothing they depend on changed since they passed.

use std::{
    collections::hash_map::DefaultHasher,
    fs,
    hash::{Hash, Hasher},
    io::Read,
    path::{Path, PathBuf},
    process::Command,
    time::SystemTime,
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::{
    limited, python,
    run::{ROOT, cargo, features, finish, output, target_folder},
};

/// Its tests read the whole repository.
const SEES_EVERYTHING: &str = "xtask";
/// Their tests run the programs or the firmware.
const RUN_PROGRAMS: [&str; 4] = ["farnear", "farnear-sim", "farnear-campaign", "farnear-capture"];
/// Relative to the repository's root; see `tools/test-data`.
const REAL_DATA: &str = "../shared/data";

#[derive(Default)]
pub struct Total {
    pub passed: u32,
    pub failed: u32,
    pub ignored: u32,
    /// Passed earlier and not run again.
    pub unchanged: u32,
    pub well: bool,
}

struct Program {
    package: String,
    name: String,
    executable: PathBuf,
    folder: PathBuf,
}

pub struct Programs {
    tests: Vec<Program>,
    others: Vec<PathBuf>,
}

impl Programs {
    /// Runs unchanged programs only with `all`.
    pub fn run(&self, elf: &Path, all: bool) -> Result<Total> {
        let mut total = Total { well: true, ..Total::default() };
        let passed = target_folder().join("passed-tests");
        fs::create_dir_all(&passed).with_context(|| format!("cannot create {}", passed.display()))?;
        for test in &self.tests {
            let stamp = passed.join(test.executable.file_name().unwrap_or(test.name.as_ref()));
            // Without git every program runs.
            let depends_on =
                dependencies(test, &self.others, elf).ok().filter(|_| test.package != SEES_EVERYTHING);
            let before = fs::read_to_string(&stamp).ok().filter(|_| !all);
            if let (Some(depends_on), Some(before)) = (&depends_on, before)
                && let Some(result) = before.strip_prefix(depends_on)
            {
                println!("\n{} ({}): unchanged since it passed", test.package, test.name);
                total.count(result);
                total.unchanged += count(result, "passed");
                continue;
            }
            eprintln!("running {} ({})", test.package, test.name);
            let mut command = Command::new(&test.executable);
            command.current_dir(&test.folder).env("CARGO_MANIFEST_DIR", &test.folder);
            let result = watch(environment(&mut command, elf), &mut total)?;
            if let (Some(depends_on), Some(result)) = (depends_on, result) {
                fs::write(&stamp, depends_on + &result)
                    .with_context(|| format!("cannot write {}", stamp.display()))?;
            }
        }
        eprintln!("running the examples in the documentation");
        let mut examples = cargo(["test", "--doc"]);
        watch(environment(examples.args(python::OTHERS).args(features()), elf), &mut total)?;
        Ok(total)
    }

    pub fn build(elf: &Path) -> Result<Self> {
        look_again()?;
        let mut command = cargo(["test", "--no-run"]);
        finish(environment(command.args(python::OTHERS).args(features()), elf))?;
        let text = output(command.arg("--message-format=json-render-diagnostics"))?;
        let (mut tests, mut others) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let message: Value = serde_json::from_str(line).context("cargo's message is not JSON")?;
            if message["fresh"] == false {
                bail!(
                    "{} was compiled twice: has a file just changed, or does a build script watch a missing file?",
                    message["package_id"]
                );
            }
            let Some(executable) = message["executable"].as_str().map(PathBuf::from) else { continue };
            if message["profile"]["test"] == true {
                let manifest = Path::new(message["manifest_path"].as_str().unwrap_or_default());
                let folder = manifest.parent().context("a test program without a package")?.to_owned();
                let package = fs::read_to_string(manifest)?
                    .lines()
                    .find_map(|line| Some(line.strip_prefix("name = \"")?.trim_end_matches('"').to_owned()))
                    .context("a package without a name")?;
                let name = message["target"]["name"].as_str().unwrap_or_default().to_owned();
                tests.push(Program { package, name, executable, folder });
            } else {
                others.push(executable);
            }
        }
        if tests.is_empty() {
            bail!("cargo built no test program");
        }
        tests.sort_by(|a, b| (&a.package, &a.name).cmp(&(&b.package, &b.name)));
        Ok(Self { tests, others })
    }
}

/// Touches build scripts that look for files which appeared or disappeared: cargo does not watch missing ones.
fn look_again() -> Result<()> {
    let record = target_folder().join("at-hand");
    let now = farnear_test_data::at_hand();
    if fs::read_to_string(&record).is_ok_and(|before| before != now) {
        let packages = fs::read_dir(ROOT.join("host"))?.flatten().map(|package| package.path());
        let scripts = packages.chain([ROOT.join("xtask")]).map(|package| package.join("build.rs"));
        for script in scripts.filter(|script| script.is_file()) {
            fs::File::options()
                .append(true)
                .open(&script)
                .and_then(|file| file.set_modified(SystemTime::now()))
                .with_context(|| format!("cannot touch {}", script.display()))?;
        }
    }
    fs::write(&record, now).with_context(|| format!("cannot write {}", record.display()))
}

/// Passes the firmware's path. Another path makes cargo recompile the crates that read it.
pub fn environment<'a>(command: &'a mut Command, elf: &Path) -> &'a mut Command {
    command
        .env("FARNEAR_FIRMWARE", elf)
        .env("FARNEAR_REQUIRE_SIM", "1")
        .env("CARGO_TARGET_DIR", target_folder())
}

/// Text that changes with everything that the result depends on.
fn dependencies(test: &Program, programs: &[PathBuf], elf: &Path) -> Result<String> {
    let mut hasher = DefaultHasher::new();
    hash_file(&test.executable, &mut hasher)?;
    if RUN_PROGRAMS.contains(&test.package.as_str()) {
        for program in programs.iter().map(PathBuf::as_path).chain([elf]) {
            hash_file(program, &mut hasher)?;
        }
    }
    let mut files = files(&test.folder)?;
    files.extend(self::files(&ROOT.join("examples"))?);
    if test.package == "farnear" {
        // Its tests run the commands of the documents.
        files.extend(self::files(&ROOT.join("docs"))?);
        files.extend(self::files(&ROOT.join("README.md"))?);
    }
    for file in files.iter().filter(|file| !file.ends_with(".rs") && ROOT.join(file).is_file()) {
        file.hash(&mut hasher);
        hash_file(&ROOT.join(file), &mut hasher)?;
    }
    let mut given: Vec<_> = std::env::vars()
        .filter(|(name, _)| name.starts_with("FARNEAR_") || name.starts_with("PROPTEST_"))
        .collect();
    given.sort();
    given.hash(&mut hasher);
    listing(&ROOT.join(REAL_DATA), &mut hasher);
    Ok(format!("{:016x} ", hasher.finish()))
}

/// Files below a folder that git tracks or would add.
fn files(folder: &Path) -> Result<Vec<String>> {
    let mut git = Command::new("git");
    git.args(["ls-files", "--cached", "--others", "--exclude-standard", "--full-name", "--"]).arg(folder);
    Ok(output(git.current_dir(&*ROOT))?.lines().map(str::to_owned).collect())
}

fn hash_file(path: &Path, hasher: &mut DefaultHasher) -> Result<()> {
    let mut file = fs::File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    let mut block = vec![0; 1 << 20];
    loop {
        let length = file.read(&mut block).with_context(|| format!("cannot read {}", path.display()))?;
        if length == 0 {
            return Ok(());
        }
        hasher.write(&block[..length]);
    }
}

/// Names, lengths and times of the files; the folder may be missing.
fn listing(folder: &Path, hasher: &mut DefaultHasher) {
    let mut entries: Vec<_> = fs::read_dir(folder).into_iter().flatten().flatten().collect();
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        entry.file_name().hash(hasher);
        match entry.metadata() {
            Ok(about) if about.is_dir() => listing(&entry.path(), hasher),
            Ok(about) => (about.len(), about.modified().ok()).hash(hasher),
            Err(_) => {}
        }
    }
}

/// Adds the results of a test run; returns the summary if all passed.
pub fn watch(command: &mut Command, total: &mut Total) -> Result<Option<String>> {
    let ended = limited::run(command)?;
    let mut result = None;
    for counts in ended.text.lines().filter_map(|line| line.strip_prefix("test result: ")) {
        total.count(counts);
        result = Some(counts.to_owned());
    }
    // A killed program has counted nothing.
    total.failed += u32::from(!ended.well && result.is_none());
    total.well &= ended.well;
    Ok(result.filter(|_| ended.well))
}

impl Total {
    pub fn add(&mut self, other: &Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.ignored += other.ignored;
        self.unchanged += other.unchanged;
        self.well &= other.well;
    }

    fn count(&mut self, counts: &str) {
        self.passed += count(counts, "passed");
        self.failed += count(counts, "failed");
        self.ignored += count(counts, "ignored");
    }
}

/// The number before `word` in "ok. 12 passed; 0 failed; ...".
pub fn count(counts: &str, word: &str) -> u32 {
    let words = counts.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let words: Vec<&str> = words.collect();
    let before = words.windows(2).find(|pair| pair[1] == word).map(|pair| pair[0]);
    before.and_then(|number| number.parse().ok()).unwrap_or(0)
}

/// Tests in a file, or in all files of a folder: lines that begin with `opening`. Tests in a loop count once.
pub fn written(place: &Path, opening: &str) -> Result<u32> {
    let seen = || format!("cannot read {}", place.display());
    if place.is_dir() {
        let entries = fs::read_dir(place).with_context(seen)?;
        return entries.map(|entry| written(&entry.with_context(seen)?.path(), opening)).sum();
    }
    let bytes = fs::read(place).with_context(seen)?;
    let text = String::from_utf8_lossy(&bytes);
    Ok(text.lines().filter(|line| line.trim_start().starts_with(opening)).count() as u32)
}

#[cfg(test)]
mod tests {
    use super::count;

    #[test]
    fn packages_with_tests_on_the_emulated_rig_are_known_to_run_programs() {
        let packages = std::fs::read_dir(super::ROOT.join("host")).unwrap().flatten();
        let mut found = 0;
        for package in packages.map(|package| package.path()) {
            let read = |name: &str| std::fs::read_to_string(package.join(name)).unwrap_or_default();
            if read("build.rs").contains("declare_emulated_rig") {
                let manifest = read("Cargo.toml");
                let name = manifest.lines().find_map(|line| line.strip_prefix("name = ")).unwrap();
                assert!(super::RUN_PROGRAMS.contains(&name.trim_matches('"')), "{name}");
                found += 1;
            }
        }
        assert!(found > 0);
    }

    #[test]
    fn reads_the_test_runners_summary() {
        let line = "ok. 12 passed; 3 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.01s";
        assert_eq!([count(line, "passed"), count(line, "failed"), count(line, "ignored")], [12, 3, 1]);
    }
}
