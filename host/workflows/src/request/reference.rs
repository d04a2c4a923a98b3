//! Generates the reference page of all options from the requests' schemas.

use std::fmt::Write;

use serde_json::Value;

use super::{DEVICE_TASKS, TASKS, Task};

const HEAD: &str = "# All options\n\n\
    Generated from the requests of the tasks. A name is the same as an option of the command line (`--min-confidence`), as a field of \
    a batch job and of the page's interface, and as a keyword in Python (`min_confidence`). `farnear TASK --help` says more.\n";

pub fn page() -> String {
    let mut page = HEAD.to_owned();
    for task in TASKS.iter().chain(DEVICE_TASKS) {
        section(&mut page, task);
    }
    page
}

fn section(page: &mut String, task: &Task) {
    let schema = (task.schema)();
    // `--help` has the rest.
    let about = schema["description"].as_str().and_then(|text| text.split("\n\n").next()).unwrap_or_default();
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
    use std::{collections::BTreeMap, fs, path::Path};

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

    /// Options of `depth` that differ in Python, with the reason.
    const DIFFERENT: [(&str, &str); 10] = [
        ("bin", "means of array blocks with numpy"),
        ("camera_frames", "Python corrects images with numpy before the call"),
        ("correction", "`Correction.apply` corrects the map"),
        ("grey", "an array has one channel"),
        ("out", "the map is returned"),
        ("psf", "part of `Optics`"),
        ("region", "slices of arrays"),
        ("uncertainty", "always in `DepthMap`"),
        ("write", "the map is returned"),
        ("threads", "1 in Python, where callers run several at a time"),
    ];

    #[test]
    fn keywords_of_python_are_the_options_of_depth() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../python/farnear/_farnear.pyi");
        let types = fs::read_to_string(path).expect("the .pyi file");
        let (_, rest) = types.split_once("\ndef depth(\n").expect("depth");
        let (parameters, _) = rest.split_once("\n)").expect("its parameters");
        let parameters: BTreeMap<&str, Option<&str>> = parameters
            .lines()
            .filter_map(|line| line.trim().trim_end_matches(',').split_once(": "))
            .map(|(name, rest)| (name, rest.rsplit_once(" = ").map(|(_, default)| default)))
            .collect();
        let schema = crate::request::schema::<crate::depth::DepthRequest>();
        let fields = schema["properties"].as_object().expect("a struct");
        let known = |name: &str| DIFFERENT.iter().any(|(known, _)| *known == name);
        for name in fields.keys().filter(|name| !known(name)) {
            assert!(parameters.contains_key(name.as_str()), "Python's depth has no keyword {name}");
        }
        for (name, default) in parameters.into_iter().filter(|(name, _)| !known(name)) {
            let field = fields.get(name).unwrap_or_else(|| panic!("`farnear depth` has no option {name}"));
            let same = match (default, &field["default"]) {
                (None, _) | (Some("None" | "False"), Value::Null) => true,
                (Some(default), Value::String(text)) => default.trim_matches('"') == text,
                (Some(default), Value::Number(number)) => default.parse().ok() == number.as_f64(),
                _ => false,
            };
            assert!(same, "{name}: {default:?} in Python, {} elsewhere", field["default"]);
        }
    }
}
