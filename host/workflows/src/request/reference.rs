//! The reference page of all options, generated from the schemas of the requests.

use std::fmt::Write;

use serde_json::Value;

use super::{TASKS, Task};

const HEAD: &str = "# All options\n\n\
    Generated from the requests of the tasks. A name is the same as an option of the command line (`--min-confidence`), as a field of \
    a batch job and of the page's interface, and as a keyword in Python (`min_confidence`).\n";

/// The page in Markdown.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    for task in TASKS {
        section(&mut page, task);
    }
    page
}

fn section(page: &mut String, task: &Task) {
    let schema = (task.schema)();
    let about = schema["description"].as_str().unwrap_or_default();
    let _ = writeln!(page, "\n## {}\n\n{about}\n\n| option | default | meaning |\n|---|---|---|", task.name);
    for (name, field) in schema["properties"].as_object().into_iter().flatten() {
        let default = match &field["default"] {
            _ if task.required.contains(&name.as_str()) => "required".to_owned(),
            Value::Null => String::new(),
            Value::String(text) => format!("`{text}`"),
            Value::Array(list) if list.is_empty() => String::new(),
            other => format!("`{other}`"),
        };
        let meaning = field["description"].as_str().unwrap_or_default();
        let meaning = meaning.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|");
        let _ = writeln!(page, "| `{name}` | {default} | {meaning} |");
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;

    #[test]
    fn the_reference_page_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/options.md");
        if std::env::var_os("FARNEAR_WRITE_OPTIONS").is_some() {
            fs::write(&path, page()).expect("docs/options.md can be written");
        }
        let found = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            found == page(),
            "docs/options.md is out of date: FARNEAR_WRITE_OPTIONS=1 cargo test -p farnear-workflows --lib reference"
        );
    }
}
