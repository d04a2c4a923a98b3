//! Everything CI runs, in the order in which a mistake shows soonest.

use std::{
    io::{BufRead, BufReader},
    process::Stdio,
    time::Instant,
};

use anyhow::{Context, Result, bail};

use crate::{
    browser, firmware, instructions,
    run::{cargo, finish, step, target_folder},
    sizes,
    thumb::Way,
};

/// Runs all checks; ends with one line that sums up the tests.
pub fn run() -> Result<()> {
    let start = Instant::now();
    step("format");
    finish(cargo(["fmt", "--all", "--check"]).stdout(Stdio::null()))?;
    let firmware_fmt = &mut cargo(["fmt", "--check"]);
    finish(firmware_fmt.current_dir(firmware::folder()).stdout(Stdio::null()))?;

    step("firmware for the NUCLEO-F429ZI");
    let way = Way::find()?;
    let elf = firmware::build_with(way)?;
    sizes::check(&elf)?;
    instructions::run(false)?;

    step("lints");
    finish(&mut cargo(["clippy", "--workspace", "--all-targets", "--locked", "--", "--deny", "warnings"]))?;
    if way.has_clippy() {
        let arguments = ["--release", "--locked", "--", "--deny", "warnings"];
        finish(way.cargo(&firmware::folder(), "clippy").args(arguments))?;
    } else {
        eprintln!("skipped: clippy for the firmware (Debian's rust-web-clippy is not installed)");
    }
    step("documentation");
    finish(
        cargo(["doc", "--workspace", "--no-deps", "--locked", "--quiet"])
            .env("RUSTDOCFLAGS", "--deny warnings"),
    )?;

    step("tests on the host and on the emulated board");
    let mut total = tests(&elf)?;
    step("the page in a browser");
    let page = browser::run()?;
    total.passed += page.passed;
    total.failed += page.failed;
    total.ignored += page.skipped;
    total.ended_well &= page.ended_well;
    eprintln!("\nall of it took {} s", start.elapsed().as_secs());
    println!("{} passed, {} failed, {} skipped", total.passed, total.failed, total.ignored);
    if total.failed > 0 || !total.ended_well {
        bail!("tests failed");
    }
    Ok(())
}

#[derive(Default)]
struct Total {
    passed: u32,
    failed: u32,
    ignored: u32,
    ended_well: bool,
}

fn tests(elf: &std::path::Path) -> Result<Total> {
    let mut child = cargo(["test", "--workspace", "--locked", "--no-fail-fast"])
        .env("FARNEAR_FIRMWARE", elf)
        .env("FARNEAR_REQUIRE_SIM", "1")
        .env("CARGO_TARGET_DIR", target_folder())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot start cargo test")?;
    let mut total = Total::default();
    let stdout = child.stdout.take().context("cargo test has no output")?;
    for line in BufReader::new(stdout).lines() {
        let line = line.context("cargo test's output is no text")?;
        println!("{line}");
        if let Some(counts) = line.strip_prefix("test result: ") {
            total.passed += count(counts, "passed");
            total.failed += count(counts, "failed");
            total.ignored += count(counts, "ignored");
        }
    }
    total.ended_well = child.wait().context("cargo test was lost")?.success();
    Ok(total)
}

/// The number before `word` in "ok. 12 passed; 0 failed; ...".
fn count(counts: &str, word: &str) -> u32 {
    let mut words = counts.split([' ', ';']).filter(|part| !part.is_empty());
    let mut before = "";
    words
        .find_map(|part| {
            let found = part == word;
            let number = found.then(|| before.parse().ok()).flatten();
            before = part;
            number
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::count;

    #[test]
    fn reads_the_test_runners_summary() {
        let line = "ok. 12 passed; 3 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.01s";
        assert_eq!([count(line, "passed"), count(line, "failed"), count(line, "ignored")], [12, 3, 1]);
    }
}
