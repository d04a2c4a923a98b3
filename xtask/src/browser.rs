//! Tests of the page in a real browser, if Node, its packages and a Chromium are installed.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result};

use crate::{
    limited,
    run::{ROOT, target_folder},
    test_programs::Total,
};

/// Used if `CHROMIUM` is not set.
const BROWSERS: [&str; 3] = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

const TESTS: [&str; 4] = ["page.test.mjs", "rows.test.mjs", "results.test.mjs", "access.test.mjs"];

/// Counts the tests as skipped if tools are missing.
pub fn run() -> Result<Total> {
    let folder = &ROOT.join("host/serve/tests-browser");
    if let Some(missing) = missing(folder) {
        let read =
            |name: &str| std::fs::read_to_string(folder.join(name)).context("the page's tests are not there");
        let text = TESTS.into_iter().map(read).collect::<Result<String>>()?;
        eprintln!("skipped: the page in a browser ({missing})");
        return Ok(Total { ignored: written(&text), well: true, ..Total::default() });
    }
    let mut total = Total { well: true, ..Total::default() };
    // One by one: each has the time limit for itself, and is counted even if another one is killed.
    for file in TESTS {
        let ended = limited::run(
            Command::new("node")
                .args(["--test", "--test-reporter=tap", file])
                .current_dir(folder)
                .env("FARNEAR", target_folder().join("debug/farnear")),
        )?;
        let count = |name| number(&ended.text, name);
        total.add(&Total {
            passed: count("pass"),
            // A killed file has no counts.
            failed: count("fail").max(u32::from(!ended.well)),
            ignored: count("skipped"),
            well: ended.well,
            ..Total::default()
        });
    }
    Ok(total)
}

fn missing(folder: &Path) -> Option<&'static str> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let browser = BROWSERS.into_iter().map(PathBuf::from).chain(named).any(|path| path.is_file());
    let node = Command::new("node").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !node.is_ok_and(|status| status.success()) {
        Some("node is missing; Debian's package is nodejs")
    } else if !["playwright-core", "typescript"]
        .iter()
        .all(|name| folder.join("node_modules").join(name).is_dir())
    {
        Some("run `npm ci` in host/serve/tests-browser")
    } else if !browser {
        Some("Chromium is missing; Debian's package is chromium, and CHROMIUM names another")
    } else {
        None
    }
}

/// Tests in the file; those in the loop over sizes and schemes count once.
fn written(text: &str) -> u32 {
    text.lines().filter(|line| line.trim_start().starts_with("test(")).count() as u32
}

/// The number after "# pass " in the runner's output.
fn number(text: &str, name: &str) -> u32 {
    let line =
        text.lines().rev().find_map(|line| line.strip_prefix("# ")?.strip_prefix(name)?.strip_prefix(' '));
    line.and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::{number, written};

    #[test]
    fn counts_are_read() {
        let text = "ok 1 - a\n# pass is a word\n# tests 14\n# pass 12\n# fail 1\n# skipped 1\n";
        assert_eq!([number(text, "pass"), number(text, "fail"), number(text, "skipped")], [12, 1, 1]);
        assert_eq!(written("test(\"a\")\n  test(`b`)\nconst test = 1;\n"), 2);
    }
}
