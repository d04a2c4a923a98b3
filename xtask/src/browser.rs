//! Tests of the page in a real browser, if Node, its packages and a Chromium are installed.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::Result;

use crate::{
    limited,
    run::{ROOT, has, target_folder},
    test_programs::{Total, written},
};

/// Used if `CHROMIUM` is not set.
const BROWSERS: [&str; 3] = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

const TESTS: [&str; 4] = ["page.test.mjs", "rows.test.mjs", "results.test.mjs", "access.test.mjs"];

/// Counts the tests as skipped if tools are missing.
pub fn run() -> Result<Total> {
    let folder = &ROOT.join("host/serve/tests-browser");
    if let Some(missing) = missing(folder) {
        eprintln!("skipped: the page in a browser ({missing})");
        let ignored = TESTS.iter().map(|name| written(&folder.join(name), "test(")).sum::<Result<u32>>()?;
        return Ok(Total { ignored, well: true, ..Total::default() });
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
    if !has("node") {
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

/// The number after "# pass " in the runner's output.
fn number(text: &str, name: &str) -> u32 {
    let line =
        text.lines().rev().find_map(|line| line.strip_prefix("# ")?.strip_prefix(name)?.strip_prefix(' '));
    line.and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::{ROOT, TESTS, number, written};

    #[test]
    fn counts_are_read() {
        let text = "ok 1 - a\n# pass is a word\n# tests 14\n# pass 12\n# fail 1\n# skipped 1\n";
        assert_eq!([number(text, "pass"), number(text, "fail"), number(text, "skipped")], [12, 1, 1]);
        let page = ROOT.join("host/serve/tests-browser").join(TESTS[0]);
        assert!(written(&page, "test(").is_ok_and(|tests| tests > 5));
    }
}
