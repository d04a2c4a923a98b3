//! Printable flat target: a random texture as fine as the optics can use, true to scale.

mod page;

use std::{fmt, path::PathBuf, str::FromStr};

use farnear_files::staging;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    optics::GivenOptics,
    parameters::within,
    request::{PathKind, Request},
};

const INCH_MM: f64 = 25.4;
/// Target side of a cell, image pixels: of 1 to 6 px it gave the least depth noise (`docs/bench.md`).
const CELL_PX: f64 = 2.5;
/// Finer cells turn grey, because ink spreads.
const LEAST_DOTS: f64 = 2.0;
/// Cells of this many pixels give 50 % more noise.
const COARSE_PX: f64 = 4.0;
/// Unprinted border of a page.
const MARGIN_MM: f64 = 10.0;
/// Height of the 100 mm line with its label.
const FOOT_MM: f64 = 18.0;
/// Limit of the page in memory: 16 MB.
const MOST_CELLS: usize = 1 << 27;
/// Half length of the central cross, in cells.
const CROSS_CELLS: usize = 12;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Paper {
    pub width_mm: f64,
    pub height_mm: f64,
}

/// Paper sizes of ISO 216 and North America.
const PAPERS: [(&str, [f64; 2]); 6] = [
    ("a4", [210.0, 297.0]),
    ("a3", [297.0, 420.0]),
    ("a2", [420.0, 594.0]),
    ("a1", [594.0, 841.0]),
    ("a0", [841.0, 1189.0]),
    ("letter", [215.9, 279.4]),
];

impl FromStr for Paper {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = PAPERS.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)).map(|(_, size)| *size);
        let written = || {
            let (width, height) = text.trim_end_matches("mm").split_once('x')?;
            Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
        };
        match named.or_else(written) {
            Some([width_mm, height_mm])
                if [width_mm, height_mm].iter().all(|mm| (130.0..=2000.0).contains(mm)) =>
            {
                Ok(Self { width_mm, height_mm })
            }
            Some(_) => Err(format!("paper {text}: expected sides of 130 to 2000 mm")),
            None => {
                let names: Vec<&str> = PAPERS.iter().map(|(name, _)| *name).collect();
                Err(format!("unknown paper `{text}`: expected {}, or WIDTHxHEIGHT in mm", names.join(", ")))
            }
        }
    }
}

impl fmt::Display for Paper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{} mm", self.width_mm, self.height_mm)
    }
}

/// Write a textured target as a PDF page, true to scale, as fine as the optics can use.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear target --optics optics.toml --paper a3 --out target.pdf

Print it in black, at its actual size (100 %), and glue it to something flat: the line at its foot is 100 mm long then.")
)]
#[serde(default)]
pub struct TargetRequest {
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Distance of the target from the lens in mm [default: the far focus].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub distance_mm: Option<f64>,
    /// The sheet: a4, a3, a2, a1, a0, letter, or WIDTHxHEIGHT in mm.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().paper))]
    #[serde_as(as = "DisplayFromStr")]
    pub paper: Paper,
    /// The printer's dots per inch.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().dpi))]
    pub dpi: u32,
    /// Seed of the texture.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().seed))]
    pub seed: u64,
    /// The PDF file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl Default for TargetRequest {
    fn default() -> Self {
        let [width_mm, height_mm] = PAPERS[0].1;
        Self {
            optics: PathBuf::new(),
            distance_mm: None,
            paper: Paper { width_mm, height_mm },
            dpi: 600,
            seed: 1,
            out: PathBuf::new(),
        }
    }
}

impl Request for TargetRequest {
    const NAME: &'static str = "target";
    const REQUIRED: &'static [&'static str] = &["optics", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = TargetFigures;

    fn run(&self, context: &Context<'_>) -> Result<TargetFigures> {
        print(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TargetFigures {
    pub pixel_on_target_mm: f64,
    pub cell_mm: f64,
    /// Side of a cell in camera pixels.
    pub cell_px: f64,
    /// Side of a cell in printer dots.
    pub cell_dots: u32,
    pub columns: usize,
    pub rows: usize,
}

/// Black (`true`) and white cells, row by row from the top, with a cross in the centre.
struct Texture {
    columns: usize,
    rows: usize,
    black: Vec<bool>,
}

impl Texture {
    /// Random black and white cells, independent of each other, so that the printer does not add a visible screen.
    fn drawn(columns: usize, rows: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (middle_column, middle_row) = (columns / 2, rows / 2);
        let cell = |index: usize| {
            let noise = rng.random::<bool>();
            let across = (index % columns).abs_diff(middle_column);
            let down = (index / columns).abs_diff(middle_row);
            match (across.min(down), across.max(down)) {
                (0, far) if far <= CROSS_CELLS => true,
                (1, far) if far <= CROSS_CELLS => false,
                _ => noise,
            }
        };
        Self { columns, rows, black: (0..columns * rows).map(cell).collect() }
    }
}

pub fn print(settings: &TargetRequest, context: &Context<'_>) -> Result<TargetFigures> {
    within("dpi", settings.dpi, &(150..=4800), "")?;
    let optics = GivenOptics::read(&settings.optics)?.optics;
    let focal_mm = optics.focal_length_mm();
    let distance_mm = settings.distance_mm.unwrap_or(optics.working_range().far_mm);
    if !(distance_mm.is_finite() && distance_mm > focal_mm) {
        let expected = format!("expected more than the focal length, {focal_mm} mm");
        return Err(WorkflowError::parameter("distance", distance_mm, expected));
    }
    let pixel_mm = optics.pixel_at_object_mm(distance_mm);
    let dot_mm = INCH_MM / f64::from(settings.dpi);
    let dots = (CELL_PX * pixel_mm / dot_mm).round().max(LEAST_DOTS);
    let cell_mm = dots * dot_mm;
    let cell_px = cell_mm / pixel_mm;
    let cells = |mm: f64| (mm / cell_mm) as usize;
    let columns = cells(settings.paper.width_mm - 2.0 * MARGIN_MM);
    let rows = cells(settings.paper.height_mm - 2.0 * MARGIN_MM - FOOT_MM);
    if columns.min(rows) < 4 * CROSS_CELLS {
        let expected = format!("expected room for {} cells of {cell_mm:.3} mm either way", 4 * CROSS_CELLS);
        return Err(WorkflowError::parameter("paper", settings.paper, expected));
    }
    if columns * rows > MOST_CELLS {
        let expected = format!(
            "expected at most {MOST_CELLS} cells, and these are {columns} x {rows} of {cell_mm:.3} mm"
        );
        return Err(WorkflowError::parameter("paper", settings.paper, expected));
    }
    if cell_px > COARSE_PX {
        context.info(&format!(
            "the printer's dots make cells of {cell_px:.1} px, and depth wants some {CELL_PX}: more dots per inch, or a larger distance, give finer ones"
        ));
    }
    let texture = Texture::drawn(columns, rows, settings.seed);
    let label = format!("farnear target, cells of {cell_mm:.3} mm, seed {}", settings.seed);
    let bytes = page::pdf(&texture, settings.paper, cell_mm, &label);
    staging::write_file(&settings.out, &bytes)?;
    context.info(&format!("wrote {}; print it at its actual size", settings.out.display()));
    Ok(TargetFigures {
        pixel_on_target_mm: rounded_for(pixel_mm, pixel_mm, 4),
        cell_mm: rounded(cell_mm, 4),
        cell_px: rounded(cell_px, 3),
        cell_dots: dots as u32,
        columns,
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn papers_have_names_or_sides() {
        assert_eq!("A4".parse(), Ok(Paper { width_mm: 210.0, height_mm: 297.0 }));
        assert_eq!("300x400.5".parse(), Ok(Paper { width_mm: 300.0, height_mm: 400.5 }));
        for (text, expected) in
            [("b5", "expected a4, a3"), ("1x1", "130 to 2000 mm"), ("NaNxinf", "130 to 2000 mm")]
        {
            assert!(text.parse::<Paper>().expect_err(text).contains(expected), "{text}");
        }
    }

    #[test]
    fn a_pixel_of_a_macro_lens_keeps_its_digits() {
        let folder = tempfile::tempdir().unwrap();
        let optics = folder.path().join("optics.toml");
        let text = "[lens]\nfocal_length_mm = 50.0\nf_number = 2.8\n[sensor]\npixel_um = 3.45\n\
                    [focus]\nfar_mm = 60.0\nnear_mm = 59.995\n";
        std::fs::write(&optics, text).unwrap();
        let request =
            TargetRequest { optics, out: folder.path().join("target.pdf"), ..TargetRequest::default() };
        let found = print(&request, &Context::unattended()).unwrap();
        assert!((found.pixel_on_target_mm - 6.9e-4).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn half_of_the_cells_are_black_and_neighbours_know_nothing_of_each_other() {
        let texture = Texture::drawn(301, 401, 3);
        let sign = |black: bool| if black { 1.0 } else { -1.0 };
        let n = texture.black.len() as f64;
        // Sums of n signs and of neighbours' products: five standard deviations of sqrt(n).
        let sum: f64 = texture.black.iter().map(|black| sign(*black)).sum();
        let together: f64 = texture.black.windows(2).map(|pair| sign(pair[0]) * sign(pair[1])).sum();
        assert!(sum.abs() < 5.0 * n.sqrt() && together.abs() < 5.0 * n.sqrt(), "{sum} {together}");
        let middle = 200 * 301 + 150;
        assert!(texture.black[middle] && texture.black[middle + CROSS_CELLS]);
        assert!(!texture.black[middle + 301 + 2] && !texture.black[middle - 301 - 2]);
        assert_eq!(texture.black, Texture::drawn(301, 401, 3).black);
        assert_ne!(texture.black, Texture::drawn(301, 401, 4).black);
    }
}
