//! `farnear silhouettes skeletons` and `synthetic`: performances of bodies made of capsules, as masks and samples to train on.

use std::{collections::HashMap, fs, path::PathBuf, time::Instant};

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use farnear_activity::{
    readers::skeletons::{
        FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, UTKINECT_ACTIVITIES, dress, read_cells,
    },
    silhouette::{
        capsule::Capsule,
        view::{Canvas, draw, extent, views_round},
    },
    synthetic::activities::{ACTIVITIES, performance},
};
use farnear_capture::aside::Aside;
use rayon::prelude::*;
use serde::Serialize;

use crate::{masks, report};

/// Silhouettes of a data set that has body joints only: joints are dressed with capsules and drawn from views all round.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`.
#[derive(Args)]
#[command(
    after_help = "Example: farnear silhouettes skeletons UTKinect_Skeletons.mat --set utkinect --out people/"
)]
pub struct Skeletons {
    /// The joints, a MATLAB 5 file of cells.
    file: PathBuf,
    /// Which data set it is.
    #[arg(long)]
    set: Set,
    #[command(flatten)]
    drawing: Drawing,
}

/// Silhouettes of seeded synthetic people at the ten activities of Li 2014, table 7.1.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`: something to try everything with.
#[derive(Args)]
#[command(after_help = "Example: farnear silhouettes synthetic --subjects 6 --out people/")]
pub struct Synthetic {
    /// People, each with a build and habits of their own.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=1000))]
    subjects: u16,
    /// Only these activities: walk, drop, crouch, peer, mobile, place, bag, shoot, gun, dig.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = activity)]
    activities: Vec<usize>,
    /// Frames per second.
    #[arg(long, default_value_t = 8.0, value_parser = rate)]
    rate_hz: f64,
    #[command(flatten)]
    drawing: Drawing,
}

/// How bodies are drawn and where to.
#[derive(Args)]
struct Drawing {
    /// Views at equal steps round the subject.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=72))]
    views: u8,
    /// Millimetres per pixel.
    #[arg(long, default_value_t = 10.0, value_parser = super::markers::positive)]
    mm_per_px: f64,
    /// Folder for masks and samples.toml; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Set {
    /// UTKinect-Action3D: 20 joints of a Kinect.
    Utkinect,
    /// Florence 3D Actions: 15 joints.
    Florence,
}

/// One performance.
struct Performance {
    subject: String,
    activity: String,
    bodies: Vec<Vec<Capsule>>,
}

#[derive(Serialize)]
struct Figures {
    performances: usize,
    subjects: usize,
    activities: usize,
    views: usize,
    masks: usize,
    seconds: f64,
}

/// Runs `skeletons`.
///
/// # Errors
/// A file that is not of the set, masks that cannot be written; then `--out` is left as it was.
pub fn skeletons(arguments: &Skeletons) -> Result<()> {
    let shown = arguments.file.display();
    let bytes = fs::read(&arguments.file).with_context(|| format!("cannot read {shown}"))?;
    let (layout, names): (Layout, &[&str]) = match arguments.set {
        Set::Utkinect => (KINECT_20, &UTKINECT_ACTIVITIES),
        Set::Florence => (FLORENCE_15, &FLORENCE_ACTIVITIES),
    };
    let clips = read_cells(&bytes, &layout).with_context(|| format!("{shown}"))?;
    let performances = clips.iter().map(|clip| Performance {
        subject: format!("s{:02}", clip.subject + 1),
        activity: names.get(clip.activity).map_or_else(|| clip.activity.to_string(), ToString::to_string),
        bodies: clip.frames.iter().map(|joints| dress(joints, &layout)).collect(),
    });
    write(performances.collect(), 0.0, &arguments.drawing)
}

/// Runs `synthetic`.
///
/// # Errors
/// Masks that cannot be written; then `--out` is left as it was.
pub fn synthetic(arguments: &Synthetic) -> Result<()> {
    let chosen: Vec<usize> = match arguments.activities.as_slice() {
        [] => (0..ACTIVITIES.len()).collect(),
        some => some.to_vec(),
    };
    let subjects = 0..usize::from(arguments.subjects);
    let performances = subjects.flat_map(|subject| {
        chosen.iter().map(move |&activity| Performance {
            subject: format!("p{subject:02}"),
            activity: ACTIVITIES[activity].into(),
            bodies: performance(subject, activity, 0, arguments.rate_hz),
        })
    });
    // Starting obliquely, so that no view looks exactly along the path.
    write(performances.collect(), 45.0, &arguments.drawing)
}

/// Draws all performances and lists them.
fn write(performances: Vec<Performance>, first_view_deg: f64, drawing: &Drawing) -> Result<()> {
    let start = Instant::now();
    ensure!(!performances.is_empty(), "there is no performance to draw");
    let mut counts: HashMap<(&str, &str), u32> = HashMap::new();
    let names: Vec<String> = performances
        .iter()
        .map(|performance| {
            let count = counts.entry((&performance.subject, &performance.activity)).or_default();
            *count += 1;
            format!("{}-{}-{count}", performance.subject, performance.activity.replace(' ', "-"))
        })
        .collect();
    let out = Aside::new_folder(&drawing.out)?;
    let mut views = views_round(usize::from(drawing.views), 0.0);
    views.iter_mut().for_each(|view| view.gamma_deg += first_view_deg);
    let drawn: Result<Vec<usize>> = performances
        .par_iter()
        .zip(&names)
        .map(|(performance, name)| {
            for (number, view) in (1..).zip(&views) {
                let folder = format!("{name}/view{number}");
                fs::create_dir_all(out.path(&folder)).with_context(|| format!("cannot make {folder}"))?;
                let reach: Vec<_> = performance.bodies.iter().flat_map(|body| extent(body, view)).collect();
                let canvas = Canvas::fitting(&reach, drawing.mm_per_px, 2).with_context(|| {
                    format!(
                        "{name}: the body moves too far for a picture at {} mm per pixel",
                        drawing.mm_per_px
                    )
                })?;
                for (frame, body) in (1..).zip(&performance.bodies) {
                    let mask = draw(body, view, &canvas);
                    out.write(&format!("{folder}/frame_{frame:06}.png"), &masks::png(&mask)?)?;
                }
            }
            Ok(performance.bodies.len() * views.len())
        })
        .collect();
    let masks = drawn?.iter().sum();
    let mut samples = String::new();
    for (performance, name) in performances.iter().zip(&names) {
        for view in 1..=views.len() {
            samples += &format!(
                "[[sample]]\nmasks = \"{name}/view{view}\"\nsubject = \"{}\"\nactivity = \"{}\"\nview = {view}\nclip = \"{name}\"\n\n",
                performance.subject, performance.activity
            );
        }
    }
    out.write("samples.toml", samples.as_bytes())?;
    out.finish()?;
    eprintln!("wrote {}", drawing.out.display());
    let distinct = |of: fn(&Performance) -> &String| {
        let mut all: Vec<&String> = performances.iter().map(of).collect();
        all.sort();
        all.dedup();
        all.len()
    };
    let figures = Figures {
        performances: performances.len(),
        subjects: distinct(|performance| &performance.subject),
        activities: distinct(|performance| &performance.activity),
        views: views.len(),
        masks,
        seconds: report::rounded(start.elapsed().as_secs_f64(), 3),
    };
    report::print(&figures, drawing.json)
}

fn activity(text: &str) -> Result<usize, String> {
    ACTIVITIES
        .iter()
        .position(|name| *name == text)
        .ok_or_else(|| format!("no such activity; there are {}", ACTIVITIES.join(", ")))
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (1.0..=240.0).contains(&value) => Ok(value),
        _ => Err("expected frames per second from 1 to 240".into()),
    }
}
