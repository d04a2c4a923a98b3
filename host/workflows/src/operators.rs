//! Operators by name, from a file, or designed for the optics and kept in the user's cache.

use std::{fs, path::Path};

use farnear_depth::{
    operators::{self, Design, Family, Operators, Request},
    optics::Optics,
};

use crate::{
    error::{About, Result, WorkflowError},
    operator_cache as cache,
};

/// Operators for some optics: those that `asked` names (`family:design` or a family alone, e.g. `gro:linear` or
/// `gro`, or a file saved by `farnear operators`), else the default ones.
///
/// # Errors
/// What is wrong with the name or the file, or why no operators can be designed.
pub fn find(asked: Option<&Path>, optics: &Optics) -> Result<Operators> {
    let default = Request::for_optics(optics);
    let Some(asked) = asked else { return Ok(cache::operators(&default)?) };
    match named(asked) {
        // A file is a file, whatever it is called.
        Some(name) if !asked.exists() => {
            let (family, design) = name.about(|| format!("operators {}", asked.display()))?;
            let request = Request { family, design, ..default };
            cache::operators(&request).about(|| format!("operators {family}:{design}"))
        }
        _ => read(asked),
    }
}

/// The two halves of a name; `None` for what cannot be one.
fn named(asked: &Path) -> Option<Result<(Family, Design), operators::DesignError>> {
    let text = asked.to_str()?;
    let Some((family, design)) = text.split_once(':') else {
        return text.parse().ok().map(|family| Ok((family, Design::default())));
    };
    if family.contains(std::path::is_separator) || family.len() < 2 {
        return None; // a path, or the drive of one
    }
    Some(family.parse().and_then(|family| Ok((family, design.parse()?))))
}

fn read(path: &Path) -> Result<Operators> {
    const EXPECTED: &str = "saved operators";
    // Neither a file nor a name such as gro:linear.
    let text = fs::read_to_string(path).map_err(WorkflowError::read("the operators", path))?;
    if text.trim().is_empty() {
        return Err(WorkflowError::file(path, EXPECTED)("it is empty"));
    }
    toml::from_str(&text).map_err(WorkflowError::file(path, EXPECTED))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_from_paths() {
        let known = named(Path::new("gro:linear")).unwrap().unwrap();
        assert_eq!(known, (Family::Gro, Design::Linear));
        assert_eq!(named(Path::new("gro")).unwrap().unwrap(), known);
        let wrong = named(Path::new("gor:linear")).unwrap().unwrap_err();
        assert!(wrong.to_string().contains("gro"), "{wrong}");
        for path in ["operators.toml", "a/b:c", r"C:\operators.toml", "grow"] {
            assert!(named(Path::new(path)).is_none(), "{path}");
        }
    }
}
