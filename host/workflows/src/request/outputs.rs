//! Places of a request's results. They are compared on disk, not by their spelling.

use std::{
    io,
    path::{Component, Path, PathBuf},
};

use farnear_files::{order::composed, staging::Staging, video::pictures};
use serde_json::Value;

use super::{PathKind, Request};
use crate::error::{Result, WorkflowError};

/// Checks a request before its work. No field may contradict another, no result may be inside another, because each
/// appears when it is complete, and no file may replace an input.
pub fn check<R: Request>(request: &R) -> Result<()> {
    request.check()?;
    let outputs = outputs(request);
    for (index, (name, _, path)) in outputs.iter().enumerate() {
        for (other, _, taken) in &outputs[..index] {
            let current = WorkflowError::read("the current folder", Path::new("."));
            if overlap(path, taken).map_err(current)? {
                let taken = taken.display();
                let expected =
                    format!("expected another place, neither inside {taken} ({other}) nor around it");
                return Err(WorkflowError::parameter(name, path.display(), expected));
            }
        }
    }
    let inputs = request.inputs();
    files(&outputs).try_for_each(|(name, path)| check_inputs(name, path, &inputs))
}

/// Checks that a file written to `path` replaces no input.
pub(crate) fn check_inputs(name: &'static str, path: &Path, inputs: &[PathBuf]) -> Result<()> {
    let current = std::env::current_dir().unwrap_or_default();
    let Some(input) = inputs.iter().find(|input| replaces(&current, path, input)) else { return Ok(()) };
    let expected = format!("it would replace the input {}: name another file", input.display());
    Err(WorkflowError::parameter(name, path.display(), expected))
}

/// Checks before the work of a command that each result file can be written after it. Batch makes folders itself.
pub fn check_folders<R: Request>(request: &R) -> Result<()> {
    files(&outputs(request)).try_for_each(|(name, path)| check_folder(name, path))
}

/// Checks that a file can be written to `path`.
pub(crate) fn check_folder(name: &'static str, path: &Path) -> Result<()> {
    let unusable = |expected: String| Err(WorkflowError::parameter(name, path.display(), expected));
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let folder = parent.unwrap_or(Path::new("."));
    if folder.exists() && !folder.is_dir() {
        return unusable(format!("{} is not a folder: name another place", folder.display()));
    }
    if !folder.is_dir() {
        return unusable(format!(
            "the folder {} does not exist: create it, or name another place",
            folder.display()
        ));
    }
    if path.is_dir() {
        return unusable("it is a folder: name a file".into());
    }
    // A rename would replace the device. In /dev even a link to a file is the system's.
    if path.exists() && !path.is_file() || folder == Path::new("/dev") {
        return unusable("it is a device, a pipe or a socket: name a file".into());
    }
    // Only writing shows that the folder can be written to.
    Staging::into_folder(folder)?;
    Ok(())
}

type Output = (&'static str, PathKind, PathBuf);

/// Field, kind and place of each result.
fn outputs<R: Request>(request: &R) -> Vec<Output> {
    // A path that is not UTF-8 is checked when it is written.
    let Ok(Value::Object(fields)) = serde_json::to_value(request) else { return Vec::new() };
    R::PATHS
        .iter()
        .filter(|(_, kind)| matches!(kind, PathKind::OutputFile | PathKind::OutputFolder))
        .filter_map(|(name, kind)| Some((*name, *kind, fields.get(*name)?.as_str()?.into())))
        .filter(|(.., path): &Output| !path.as_os_str().is_empty())
        .collect()
}

fn files(outputs: &[Output]) -> impl Iterator<Item = (&'static str, &Path)> {
    let files = outputs.iter().filter(|(_, kind, _)| *kind == PathKind::OutputFile);
    files.map(|(name, _, path)| (*name, path.as_path()))
}

/// Whether a file would replace an input, or a picture in a folder of inputs.
fn replaces(current: &Path, output: &Path, input: &Path) -> bool {
    let (is_file, is_dir) = (current.join(output).is_file(), current.join(input).is_dir());
    let [output, input] = [output, input].map(|path| on_disk(current, path));
    let is_picture = |path: &Path| {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        pictures::EXTENSIONS.iter().chain(&["npy"]).any(|picture| ending == *picture)
    };
    output == input || (output.starts_with(&input) && is_dir && is_file && is_picture(&output))
}

/// Whether two paths name one place, or one names a place inside the other.
fn overlap(a: &Path, b: &Path) -> io::Result<bool> {
    let current = std::env::current_dir()?;
    let [a, b] = [a, b].map(|path| on_disk(&current, path));
    Ok(a.starts_with(&b) || b.starts_with(&a))
}

/// `path` from the folder `base` without `.`, `..` and symbolic links, and [`folded`] on systems that ignore case. It need not
/// exist.
pub(crate) fn on_disk(base: &Path, path: &Path) -> PathBuf {
    let mut found = base.to_path_buf();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(found.pop()),
            part => found.push(part),
        }
        if found.is_symlink() {
            found = found.canonicalize().unwrap_or(found);
        }
    }
    if cfg!(any(windows, target_os = "macos")) { folded(&found) } else { found }
}

/// One spelling of the names that Windows and macOS take for the same: small and composed letters, no `\\?\`.
fn folded(path: &Path) -> PathBuf {
    let text = composed(&path.to_string_lossy()).to_lowercase();
    match text.strip_prefix(r"\\?\unc\") {
        Some(share) => format!(r"\\{share}").into(),
        None => text.strip_prefix(r"\\?\").unwrap_or(&text).into(),
    }
}

#[cfg(test)]
mod tests {
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    use super::*;
    use crate::context::Context;

    #[derive(Clone, Default, Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    struct Sample {
        file: PathBuf,
        out: PathBuf,
        plot: Option<PathBuf>,
    }

    impl Request for Sample {
        const NAME: &'static str = "sample";
        const REQUIRED: &'static [&'static str] = &["out"];
        const PATHS: &'static [(&'static str, PathKind)] =
            &[("file", PathKind::Input), ("out", PathKind::OutputFolder), ("plot", PathKind::OutputFile)];
        type Figures = ();

        fn run(&self, _: &Context<'_>) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn results_may_not_be_inside_each_other() {
        let sample = |out: &str, plot: Option<&str>| Sample {
            file: "a".into(),
            out: out.into(),
            plot: plot.map(PathBuf::from),
        };
        for (out, plot) in [("a", "a"), ("a/b", "a"), ("a", "a/b"), ("a/b/../c", "./a/c/")] {
            let error = check(&sample(out, Some(plot))).expect_err("refused");
            assert!(error.is_usage());
            let expected = format!("plot {plot}: expected another place, neither inside {out} (out)");
            assert!(error.to_string().starts_with(&expected), "{error}");
        }
        for (out, plot) in [("b", Some("b2")), ("b/c", Some("b/d")), ("b", Some("")), ("b", None)] {
            assert!(check(&sample(out, plot)).is_ok(), "{out} {plot:?}");
        }
    }

    #[test]
    fn a_file_may_not_replace_an_input() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        std::fs::write(place("far.png"), "").expect("a writable folder");
        std::fs::write(place("note.txt"), "").expect("a writable folder");
        let sample =
            |file: &str, plot: &str| Sample { file: place(file), out: place("out"), plot: Some(place(plot)) };
        for (file, plot) in [("far.png", "far.png"), ("far.png", "gone/../far.png"), (".", "far.png")] {
            let error = check(&sample(file, plot)).expect_err("refused");
            assert!(error.is_usage() && error.to_string().contains("would replace the input"), "{error}");
        }
        for (file, plot) in
            [("far.png", "near.png"), (".", "near.png"), (".", "note.txt"), ("far.png", "far")]
        {
            assert!(check(&sample(file, plot)).is_ok(), "{file} {plot}");
        }
    }

    #[test]
    fn a_file_that_cannot_be_written_is_refused_before_the_work() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        std::fs::create_dir(place("taken")).expect("a writable folder");
        std::fs::write(place("file"), "").expect("a writable folder");
        let sample = |plot: Option<PathBuf>| Sample { plot, ..Sample::default() };
        for (plot, phrase) in [
            ("nodir/x.svg", "nodir does not exist: create it, or name another place"),
            ("file/x.svg", "file is not a folder: name another place"),
            ("taken", "it is a folder: name a file"),
        ] {
            let error = check_folders(&sample(Some(place(plot)))).expect_err("refused");
            assert!(error.is_usage() && error.to_string().contains(phrase), "{error}");
        }
        for plot in [None, Some("x.svg".into()), Some(place("x.svg")), Some(place("file"))] {
            assert!(check_folders(&sample(plot)).is_ok());
        }
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 2, "nothing is left behind");
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_not_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a writable folder");
        for place in [socket, "/dev/null".into(), "/dev/stdout".into()] {
            let error = check_folder("plot", &place).expect_err("refused");
            assert!(error.is_usage() && error.to_string().contains("name a file"), "{error}");
        }
    }

    #[test]
    fn names_that_differ_in_case_are_one_place_where_the_system_ignores_it() {
        for (name, expected) in [
            ("/Users/a/Ho\u{308}he", "/users/a/h\u{f6}he"),
            (r"C:\Data\Far.PNG", r"c:\data\far.png"),
            (r"\\?\C:\Data", r"c:\data"),
            (r"\\?\UNC\server\Share\x", r"\\server\share\x"),
        ] {
            assert_eq!(folded(Path::new(name)), Path::new(expected), "{name}");
        }
    }

    #[test]
    fn a_place_is_found_by_all_its_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let base = folder.path().canonicalize().expect("a folder");
        std::fs::create_dir_all(base.join("real/below")).expect("a writable folder");
        let place = base.join("real/x");
        let absolute = place.to_string_lossy();
        for name in ["real/x", "./real/x", "real//x", "real/x/", "real/./x", "gone/../real/x", &absolute] {
            assert_eq!(on_disk(&base, Path::new(name)), place, "{name}");
        }
        assert_ne!(on_disk(&base, Path::new("real/y")), place);
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("real/below", base.join("link")).expect("a writable folder");
            // The folder above a link is the one above its target.
            for name in ["link/../x", "gone/../link/../x"] {
                assert_eq!(on_disk(&base, Path::new(name)), place, "{name}");
            }
        }
    }
}
