//! The program accepts every command line in the documents.

use std::{fs, path::PathBuf};

use crate::common::{farnear, succeeds};

fn pages() -> Vec<PathBuf> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let docs = fs::read_dir(root.join("docs")).expect("docs/ is there").flatten().map(|entry| entry.path());
    let mut pages: Vec<PathBuf> = docs.filter(|path| path.extension().is_some_and(|it| it == "md")).collect();
    pages.push(root.join("README.md"));
    pages.sort();
    pages
}

/// Splits a line like a shell, up to a pipe, a redirection or a comment.
fn arguments(line: &str) -> Vec<String> {
    let words = shlex::split(line).unwrap_or_else(|| panic!("a shell would not take `{line}`"));
    words.into_iter().take_while(|word| !["|", ">", "<", "&&", "&", "#"].contains(&word.as_str())).collect()
}

#[test]
fn every_command_of_the_documents_is_understood() {
    let mut lines = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a readable page");
        for line in text.lines().filter_map(|line| line.trim().strip_prefix("$ farnear ")) {
            // Flags and values before --help are checked before it.
            let words = arguments(line);
            let words: Vec<&str> = words.iter().map(String::as_str).chain(["--help"]).collect();
            println!("{}: farnear {line}", page.display());
            succeeds(&mut farnear(&words));
            lines += 1;
        }
    }
    assert!(lines > 30, "only {lines} lines were found");
}
