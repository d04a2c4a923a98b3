//! Operators by name, from a file, or designed for the optics and kept in the user's cache.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_depth::{
    operators::{self, Design, Family, Operators, Request},
    optics::Optics,
};
use farnear_files::staging;
use serde::Serialize;

use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::rounded,
    operator_cache as cache,
    operator_plot::{self, Format},
    optics,
    psf::PsfSource,
};

/// What a file of operators holds, as [`WorkflowError::File`] names it.
pub const KIND: &str = "saved operators";

/// What is designed, and where it goes.
#[derive(Clone, PartialEq, Debug)]
pub struct OperatorSettings {
    /// The optics file.
    pub optics: PathBuf,
    /// Point spread function; without it that of the optics.
    pub psf: Option<PsfSource>,
    /// Family; without it the one that belongs to the point spread function.
    pub family: Option<Family>,
    /// Design procedure.
    pub design: Design,
    /// Width and height of the kernels in pixels.
    pub kernel_size: usize,
    /// Where the operators are saved, as TOML.
    pub out: Option<PathBuf>,
    /// Where they are drawn: `.svg` or `.png`.
    pub plot: Option<PathBuf>,
}

/// What there is to say of operators.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OperatorFigures {
    /// Family, design, point spread function and blur.
    pub name: String,
    /// How well the cubic fits the normalised image ratio.
    pub nir_rms: f64,
    /// How long the design took.
    pub seconds: f64,
}

/// Designs operators, and saves and draws them where that is wanted.
///
/// # Errors
/// [`WorkflowError::Parameter`] for a drawing of another kind; optics; [`WorkflowError::Design`]; files.
pub fn design(settings: &OperatorSettings, context: &Context<'_>) -> Result<OperatorFigures> {
    let plot = match &settings.plot {
        Some(file) => Some((file, Format::of(file)?)),
        None => None,
    };
    let optics = optics::read(&settings.optics)?;
    let psf = settings.psf.as_ref().map_or(Ok(optics.psf()), |source| source.read(context))?;
    let request = Request {
        family: settings.family.unwrap_or(Family::of(psf)),
        design: settings.design,
        psf,
        max_blur_px: optics.max_blur_px(),
        kernel_size: settings.kernel_size,
    };
    let start = Instant::now();
    // Not from the cache: how long a design takes is one of the figures.
    let operators = operators::design(&request)?;
    let seconds = start.elapsed().as_secs_f64();
    context.cancel.check("designing the operators")?;
    let write = |file: &Path, bytes: &[u8]| -> Result<()> {
        staging::write_file(file, bytes)?;
        context.say(&format!("wrote {}", file.display()));
        Ok(())
    };
    if let Some(out) = &settings.out {
        write(out, toml::to_string(&operators)?.as_bytes())?;
    }
    if let Some((file, format)) = plot {
        write(file, &operator_plot::plot(&operators, format)?)?;
    }
    Ok(OperatorFigures {
        name: operators.name().into(),
        nir_rms: operators.nir_rms(),
        seconds: rounded(seconds, 6),
    })
}

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
    // Neither a file nor a name such as gro:linear.
    let text = fs::read_to_string(path).map_err(WorkflowError::read(KIND, path))?;
    if text.trim().is_empty() {
        return Err(WorkflowError::file(path, KIND)("it is empty"));
    }
    toml::from_str(&text).map_err(WorkflowError::file(path, KIND))
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
