//! `farnear focus-stack`: depth from many images at different focus.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::{
    focus_stack::{Sharpness, StackSettings, USUAL_RELIABILITY},
    prepare::align::Model,
};
use farnear_workflows::focus_stack::{self, FocusStackSettings, Places};

use crate::{report, terminal};

/// Compute depth from a stack of images at different focus, and the image that is sharp everywhere.
#[derive(Args)]
#[command(after_help = "Example: farnear focus-stack stack/ --out stack/depth\n\
                        \x20        farnear focus-stack photos/ --align similarity --distances 300,310,320,330,340 --out depth/")]
pub struct Arguments {
    /// The folder: of `farnear rig sequence`, or images in the order of their names.
    stack: PathBuf,
    /// The new folder for depth.npy, confidence.npy, all-in-focus.png, view.png and stack.toml.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Distances from lens to object at which the images are focused, in mm; without any the folder's capture.toml knows, else
    /// depth is the number of the image.
    #[arg(long, value_name = "MM,...", value_parser = focus_stack::numbers)]
    distances: Option<std::vec::Vec<f64>>,
    /// The same by the distances from lens to sensor.
    #[arg(long, value_name = "MM,...", conflicts_with = "distances", value_parser = focus_stack::numbers)]
    sensor: Option<std::vec::Vec<f64>>,
    /// Optics file; without it the folder's capture.toml or optics.toml.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// Focus measure (a wrong name lists all).
    #[arg(long, value_name = "NAME", default_value_t = Sharpness::ModifiedLaplacian)]
    measure: Sharpness,
    /// Blur the images by a Gaussian of this standard deviation before their sharpness is measured, in pixels, 0 to 10: what is
    /// finer is mostly noise.
    #[arg(long, value_name = "PX", default_value_t = 1.0)]
    smooth: f32,
    /// Side of the median over the depths found, in pixels: odd, 1 (none) to 31.
    #[arg(long, value_name = "PX", default_value_t = 9)]
    median: usize,
    /// Mend the depths along the edges of the sharp image, so that things do not grow over what is dull behind them: standard deviation
    /// of the window in pixels, 1 to 100; 0 = do not.
    #[arg(long, value_name = "PX", default_value_t = 10.0)]
    guided: f32,
    /// Side of the window over which sharpness is measured, in pixels: odd, 3 to 101.
    #[arg(long, value_name = "PX", default_value_t = 9)]
    window: usize,
    /// Images that the tip of a pixel's sharpness is fitted to, at most: odd, 3 to 31.
    #[arg(long, value_name = "N", default_value_t = 11)]
    points: usize,
    /// Lay the images on each other first: none, shift, similarity (breathing lenses, hand-held cameras) or affine.
    #[arg(long, value_name = "MODEL", default_value = "none", value_parser = model)]
    align: Alignment,
    /// Pixels below this reliability (0 to 1) get no depth; 0 keeps all.
    #[arg(long, value_name = "R", default_value_t = USUAL_RELIABILITY)]
    min_reliability: f32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What may differ between the images; in a type of its own, for clap takes an `Option` for a flag that may be missing.
#[derive(Clone, Copy)]
struct Alignment(Option<Model>);

fn model(text: &str) -> Result<Alignment, &'static str> {
    match text {
        "none" => Ok(Alignment(None)),
        "shift" => Ok(Alignment(Some(Model::Shift))),
        "similarity" => Ok(Alignment(Some(Model::Similarity))),
        "affine" => Ok(Alignment(Some(Model::Affine))),
        _ => Err("expected none, shift, similarity or affine"),
    }
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments {
        stack,
        out,
        distances,
        sensor,
        optics,
        measure,
        smooth,
        median,
        guided,
        window,
        points,
        align,
        min_reliability,
        json,
    } = arguments;
    let settings = FocusStackSettings {
        stack,
        places: distances.map(Places::ObjectMm).or(sensor.map(Places::SensorMm)),
        optics,
        computation: StackSettings {
            measure,
            smoothing_px: smooth,
            window_px: window,
            fit_points: points,
            median_px: median,
            guided_px: guided,
            min_reliability,
        },
        align: align.0,
        out,
    };
    report::print(&focus_stack::focus_stack(&settings, &terminal::context()?)?, json)
}
