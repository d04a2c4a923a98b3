//! Finds operators by name, in a file or in the user's cache, or designs them.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_depth::{
    operators::{self, Design, Family, Operators},
    optics::Optics,
};
use farnear_files::staging;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::rounded,
    operator_cache as cache, operator_plot, optics,
    plot::Format,
    psf::PsfSource,
    request::{PathKind, Request},
};

pub const KIND: &str = "saved operators";

/// Design rational operators and report how well they fit.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear operators --psf gaussian:k=0.4578 --optics optics.toml --out operators.toml --json"
    )
)]
#[serde(default)]
pub struct OperatorRequest {
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Point spread function: pillbox, gaussian:k=K, generalised:p=P,k=K, ring:inner=I, or an image of the PSF or of the aperture
    /// (FILE.png, .tiff or .npy; FILE,radius=PX if the blur radius is not half its shorter side) [default: that of the optics file].
    #[cfg_attr(feature = "clap", arg(long, value_name = "PSF|FILE"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub psf: Option<PsfSource>,
    /// Family: watanabe, raj, ro, gro or ggro [default: the one that fits the point spread function].
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub family: Option<Family>,
    /// Design procedure: linear or thesis.
    #[cfg_attr(feature = "clap", arg(long, default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub design: Design,
    /// Width and height of the kernels in pixels: 5, 7, 9, 11 or 13.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().kernel_size_px))]
    pub kernel_size_px: usize,
    /// File for the operators, TOML.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    /// File for a plot of the fit and of the kernels' responses: .svg or .png.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub plot: Option<PathBuf>,
}

impl Default for OperatorRequest {
    fn default() -> Self {
        Self {
            optics: PathBuf::new(),
            psf: None,
            family: None,
            design: Design::default(),
            kernel_size_px: 7,
            out: None,
            plot: None,
        }
    }
}

impl Request for OperatorRequest {
    const NAME: &'static str = "operators";
    const REQUIRED: &'static [&'static str] = &["optics"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("optics", PathKind::Input),
        ("psf", PathKind::InputOrName),
        ("out", PathKind::OutputFile),
        ("plot", PathKind::OutputFile),
    ];
    type Figures = OperatorFigures;

    fn run(&self, context: &Context<'_>) -> Result<OperatorFigures> {
        design(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OperatorFigures {
    /// Family, design, point spread function and blur.
    pub name: String,
    /// Residual of the cubic fit to the normalised image ratio.
    pub nir_rms: f64,
    pub seconds: f64,
}

pub fn design(settings: &OperatorRequest, context: &Context<'_>) -> Result<OperatorFigures> {
    let plot = match &settings.plot {
        Some(file) => Some((file, Format::of(file)?)),
        None => None,
    };
    let optics = optics::read(&settings.optics)?;
    let psf = settings.psf.as_ref().map_or(Ok(optics.psf()), |source| source.read(context))?;
    let request = operators::Request {
        family: settings.family.unwrap_or(Family::of(psf)),
        design: settings.design,
        psf,
        max_blur_px: optics.max_blur_px(),
        kernel_size: settings.kernel_size_px,
    };
    let start = Instant::now();
    // Not from the cache, because the duration is one of the figures.
    let operators = operators::design(&request)?;
    let seconds = start.elapsed().as_secs_f64();
    context.cancel.check("designing the operators")?;
    let write = |file: &Path, bytes: &[u8]| -> Result<()> {
        staging::write_file(file, bytes)?;
        context.info(&format!("wrote {}", file.display()));
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

/// `asked` is `family:design`, a family alone (`gro:linear`, `gro`), or a file saved by `farnear operators`.
pub fn find(asked: Option<&Path>, optics: &Optics) -> Result<Operators> {
    let default = operators::Request::for_optics(optics);
    let Some(asked) = asked else { return Ok(cache::operators(&default)?) };
    match named(asked) {
        // A file takes precedence over a name.
        Some(name) if !asked.exists() => {
            let (family, design) = name.about(|| format!("operators {}", asked.display()))?;
            let request = operators::Request { family, design, ..default };
            cache::operators(&request).about(|| format!("operators {family}:{design}"))
        }
        _ => read(asked),
    }
}

/// Splits `family:design`; `None` if it is not a name.
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
    fn names_are_distinguished_from_paths() {
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
