//! Documents, comments and messages use plain words. A short list of phrases is counted per set of files; a set's ceiling may
//! only be lowered. `typos` checks the spelling; `_typos.toml` has the names that are none of its words.

#![allow(clippy::unwrap_used)] // an unreadable file must fail the test

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Phrases with a plainer equivalent: "nobody" is mostly "no client", "beside" is "next to", "is told" is "receives".
const PHRASES: [&str; 24] = [
    "nobody",
    "somebody",
    "whoever",
    "whatever",
    "whichever",
    "beside",
    "anew",
    "is told",
    "are told",
    "is said",
    "are said",
    "is asked for",
    "looked at",
    "at ease",
    "of its own",
    "all the same",
    "as it is",
    "stands in",
    "stands for",
    "in place of",
    "has to say",
    "knows it not",
    "mended",
    "owes",
];

/// Folders or files, and the number of phrases that they may have.
const CEILINGS: [(&[&str], usize); 6] = [
    (&["docs", "README.md", "CONTRIBUTING.md", "SECURITY.md", "examples", "cluster"], 3),
    (&["host", "python", "tools"], 300),
    (&["firmware"], 40),
    (&["hil-sim"], 10),
    (&["protocol"], 0),
    (&["xtask/src"], 4),
];

fn files(path: &Path, found: &mut Vec<PathBuf>) {
    let name = path.file_name().unwrap().to_string_lossy();
    if path.is_dir() {
        if !["target", "vendor", "node_modules"].contains(&&*name) && !name.starts_with('.') {
            fs::read_dir(path).unwrap().for_each(|entry| files(&entry.unwrap().path(), found));
        }
    } else if path
        .extension()
        .is_some_and(|ending| ["md", "rs", "py", "js", "html"].iter().any(|it| ending == *it))
    {
        found.push(path.into());
    }
}

/// The part of a line that people read: all of a document, and comments and strings of code.
fn prose<'a>(line: &'a str, ending: &str) -> &'a str {
    let begin = match ending {
        "md" | "html" => Some(0),
        "py" => line.find(['#', '"', '\'']),
        _ => line.find("//").into_iter().chain(line.find(['"', '\''])).min(),
    };
    begin.map_or("", |begin| &line[begin..])
}

fn count(line: &str) -> usize {
    // Every run of other characters becomes one blank, so that a phrase matches whole words only.
    let words = line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
    let line = format!(" {} ", words.collect::<Vec<_>>().join("  ").to_lowercase());
    PHRASES.iter().map(|phrase| line.matches(&format!(" {} ", phrase.replace(' ', "  "))).count()).sum()
}

#[test]
fn phrases_are_counted_as_whole_words() {
    assert_eq!(count("Nobody stands in the way; whatever, beside `whatever`."), 5);
    assert_eq!(count("besides, a somebody_else"), 0);
    assert_eq!(prose("let beside = 1; // anew", "rs"), "// anew");
}

#[test]
fn documents_comments_and_messages_use_plain_words() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut failures = Vec::new();
    for (paths, ceiling) in CEILINGS {
        let mut all = Vec::new();
        paths.iter().for_each(|path| files(&root.join(path), &mut all));
        assert!(!all.is_empty(), "no files in {paths:?}");
        let (mut total, mut hits) = (0, Vec::new());
        for file in all {
            let ending = file.extension().unwrap().to_string_lossy();
            for (number, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
                let found = count(prose(line, &ending));
                total += found;
                if found > 0 {
                    hits.push(format!(
                        "{}:{}: {}",
                        file.strip_prefix(root).unwrap().display(),
                        number + 1,
                        line.trim()
                    ));
                }
            }
        }
        println!("{paths:?}: {total}, ceiling {ceiling}");
        if total > ceiling {
            failures.push(format!(
                "{}\n{paths:?}: {total} phrases, ceiling {ceiling}; see PHRASES",
                hits.join("\n")
            ));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
#[cfg_attr(not(typos), ignore = "needs typos: pip install typos")]
fn spelling_is_british_and_correct() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let run = Command::new("typos").args(["--format", "brief"]).current_dir(root).output().unwrap();
    let (found, errors) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success(), "correct these, or add a name to _typos.toml:\n{found}{errors}");
}
