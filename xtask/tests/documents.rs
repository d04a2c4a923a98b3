//! The documents are true where a machine can tell: every file that they name is there.

#![allow(clippy::unwrap_used)] // what cannot be read must stop the test

use std::{
    fs,
    path::{Path, PathBuf},
};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().into()
}

fn pages(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            pages(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "md") {
            found.push(path);
        }
    }
}

/// All texts between two marks.
fn between<'a>(text: &'a str, begin: &'a str, end: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(begin).skip(1).filter_map(move |rest| rest.split_once(end).map(|(inside, _)| inside))
}

#[test]
fn links_lead_to_files() {
    let mut all = vec![root().join("README.md"), root().join("CHANGELOG.md")];
    pages(&root().join("docs"), &mut all);
    for page in all {
        let text = fs::read_to_string(&page).unwrap();
        for link in between(&text, "](", ")").filter(|link| !link.contains("://") && !link.starts_with('#')) {
            let file = page.parent().unwrap().join(link.split('#').next().unwrap());
            assert!(file.exists(), "{} links to {link}, which is not there", page.display());
        }
    }
}

/// On pages through the code, a code word with a slash is a path from the root; `FOO/` and `<name>` are placeholders.
#[test]
fn paths_in_the_signposts_exist() {
    let mut checked = 0;
    for page in ["docs/extending.md", "docs/architecture.md"] {
        let text = fs::read_to_string(root().join(page)).unwrap();
        // Blocks of code are not prose.
        let prose: String = text.split("```").step_by(2).collect();
        for path in prose.split('`').skip(1).step_by(2) {
            let looks_like_a_path = path.contains('/') && !path.contains(|c: char| " <>*(){}$=:".contains(c));
            if looks_like_a_path {
                assert!(root().join(path).exists(), "{page} names {path}, which is not there");
                checked += 1;
            }
        }
    }
    assert!(checked > 60, "only {checked} paths were found: have the pages changed their style?");
}
