//! `farnear activity train`: samples to a model.

use std::{path::PathBuf, time::Instant};

use anyhow::{Context, Result};
use clap::Args;
use farnear_activity::recognition::{
    choice::names,
    clip::Clip,
    model::Recogniser,
    space::{Map, PatternKind},
};
use farnear_capture::aside;
use serde::Serialize;

use super::{
    method::Method,
    samples::{SCALING, Samples},
};
use crate::report;

/// Trains a model on samples of masks.
///
/// SAMPLES.toml lists `[[sample]] masks = "dir" subject = "s01" activity = "walk" view = 1` with folders relative to itself.
/// Masks are full frames (the box's motion is learned too) or 100x100 (shapes only). Samples of one performance from several
/// views are fused; give them a common `clip = "name"` where a subject does an activity more than once and the order does not tell.
/// With two or more subjects the settings are chosen by cross-validation over them.
#[derive(Args)]
#[command(after_help = "Example: farnear activity train samples.toml --out model.fnm --mode ordered")]
pub struct Arguments {
    /// The samples, TOML.
    samples: PathBuf,
    /// The model to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    method: Method,
    /// Cut clips into windows of so many frames first: for recognition in recordings that nobody cut.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(5..))]
    window: Option<u32>,
    /// Take every view as a clip of its own, so that the model recognises from one view, whichever it is.
    #[arg(long)]
    any_view: bool,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    clips: usize,
    subjects: usize,
    activities: usize,
    views: usize,
    frames: usize,
    empty_frames: usize,
    full_frames: bool,
    mode: &'static str,
    layout: String,
    pattern: String,
    /// Of the Gaussians of the RBF map.
    gamma: Option<f32>,
    /// Of the RBF map's system.
    condition_number: Option<f64>,
    /// Over the folds in which the settings were chosen, 0 to 1.
    inner_accuracy: Option<f64>,
    seconds: f64,
}

/// Runs the command.
///
/// # Errors
/// Samples that cannot be read or used, a model that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let start = Instant::now();
    let samples = Samples::read(&arguments.samples)?;
    let shown = arguments.samples.display();
    let (frames, empty_frames, full_frames) = (samples.frames, samples.empty_frames, samples.full_frames);
    let clips: Vec<Clip> =
        if arguments.any_view { samples.split() } else { fused(samples, &shown.to_string())? };
    let clips: Vec<Clip> = match arguments.window {
        Some(length) => clips.iter().flat_map(|clip| clip.windows(length as usize)).collect(),
        None => clips,
    };
    arguments.method.announce();
    let experiment = arguments.method.experiment();
    let (model, inner_accuracy) =
        Recogniser::train_searched(&clips, &experiment, SCALING).with_context(|| format!("{shown}"))?;
    aside::write_file(&arguments.out, &model.to_bytes()?)?;
    eprintln!("wrote {}", arguments.out.display());
    let (gamma, condition_number) = match &model.space.map {
        Map::Rbf(rbf) => (Some(rbf.gamma), Some(rbf.condition)),
        Map::Pca(_) => (None, None),
    };
    let settings = &model.settings.space;
    let figures = Figures {
        clips: clips.len(),
        subjects: names(clips.iter().map(|clip| &clip.subject)).len(),
        activities: model.activities.len(),
        views: model.views,
        frames,
        empty_frames,
        full_frames,
        mode: arguments.method.name(),
        layout: match model.space.neighbours {
            0 => format!("pca:{}", settings.dimensions),
            k => format!("isomap:{},k={k}", settings.dimensions),
        },
        pattern: match &settings.pattern {
            PatternKind::Thesis(bins) => {
                format!("grid:{}", bins.iter().map(ToString::to_string).collect::<Vec<_>>().join("x"))
            }
            PatternKind::Codebook(size) => format!("codebook:{size}"),
        },
        gamma,
        condition_number: condition_number.map(|value| report::rounded(value, 0)),
        inner_accuracy: inner_accuracy.map(|value| report::rounded(value, 4)),
        seconds: report::rounded(start.elapsed().as_secs_f64(), 3),
    };
    report::print(&figures, arguments.json)
}

/// Clips that all have the same views.
pub fn fused(samples: Samples, shown: &str) -> Result<Vec<Clip>> {
    let counts: Vec<usize> = samples.clips.iter().map(|clip| clip.views.len()).collect();
    anyhow::ensure!(
        samples.views.is_some(),
        "{shown}: clips differ in their views (from {} to {} of them): fused views must be the same in all clips; \
         `--any-view` (train) or `--views each` (evaluate) take every view by itself",
        counts.iter().min().unwrap_or(&0),
        counts.iter().max().unwrap_or(&0)
    );
    Ok(samples.clips)
}
