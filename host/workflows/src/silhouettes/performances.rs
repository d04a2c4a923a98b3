//! Performances of capsule bodies, as masks and as training samples.

use std::{
    collections::{BTreeSet, HashMap},
    path::PathBuf,
    time::Instant,
};

use farnear_files::{masks, staging::Staging};
use farnear_silhouettes::silhouette::{
    capsule::Capsule,
    view::{Canvas, View, draw, extent, views_round},
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{MM_PER_PX, SilhouettesError, VIEWS, markers::Performer};
use crate::{context::Context, counter::Counter, error::Result, figures::rounded, parameters::within};

const DURING: &str = "drawing performances";
const MARGIN_PX: usize = 2;

// No doc comment: it would replace the help of the commands.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(default)]
pub struct Drawing {
    /// Views at equal steps round the subject, 1 to 72.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().views))]
    pub views: usize,
    /// Millimetres per pixel, 0.1 to 1000.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().mm_per_px))]
    pub mm_per_px: f64,
    /// Folder for masks and samples.toml; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long))]
    pub out: PathBuf,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { views: 4, mm_per_px: 10.0, out: PathBuf::new() }
    }
}

impl Drawing {
    pub(super) fn check(&self) -> Result<()> {
        within("views", self.views, &VIEWS, "")?;
        within("pixel size", self.mm_per_px, &MM_PER_PX, "mm")
    }
}

pub(super) struct Performance {
    pub subject: String,
    pub activity: String,
    pub bodies: Vec<Vec<Capsule>>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PerformancesFigures {
    pub performances: usize,
    pub subjects: usize,
    pub activities: usize,
    pub views: usize,
    pub masks: usize,
    pub seconds: f64,
}

/// Draws all performances and lists them in `samples.toml`. The first view is at `first_view_deg`.
pub(super) fn write(
    performances: &[Performance],
    first_view_deg: f64,
    drawing: &Drawing,
    context: &Context<'_>,
) -> Result<PerformancesFigures> {
    let start = Instant::now();
    if performances.is_empty() {
        return Err(SilhouettesError::NoPerformance.into());
    }
    let names = names(performances);
    let out = Staging::new_folder(&drawing.out)?;
    let mut views = views_round(drawing.views, 0.0);
    views.iter_mut().for_each(|view| view.gamma_deg += first_view_deg);
    let counter = Counter::new(context, "performances");
    let drawn: Result<Vec<usize>> = performances
        .par_iter()
        .zip(&names)
        .map(|(performance, name)| {
            for (number, view) in (1..).zip(&views) {
                draw_view(performance, name, (number, view), drawing.mm_per_px, &out, &counter)?;
            }
            counter.one(Some(performances.len()));
            Ok(performance.bodies.len() * views.len())
        })
        .collect();
    let masks = drawn?.iter().sum();
    // With more threads than performances, all begin before a cancellation.
    counter.check(DURING)?;
    out.write("samples.toml", samples(performances, &names, views.len()).as_bytes())?;
    out.finish()?;
    context.info(&format!("wrote {}", drawing.out.display()));
    let distinct =
        |of: fn(&Performance) -> &String| performances.iter().map(of).collect::<BTreeSet<_>>().len();
    Ok(PerformancesFigures {
        performances: performances.len(),
        subjects: distinct(|performance| &performance.subject),
        activities: distinct(|performance| &performance.activity),
        views: views.len(),
        masks,
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

/// Names of folders: subject, activity, and its repetition.
fn names(performances: &[Performance]) -> Vec<String> {
    let mut counts: HashMap<(&str, &str), u32> = HashMap::new();
    performances
        .iter()
        .map(|performance| {
            let count = counts.entry((&performance.subject, &performance.activity)).or_default();
            *count += 1;
            format!("{}-{}-{count}", performance.subject, performance.activity.replace(' ', "-"))
        })
        .collect()
}

fn draw_view(
    performance: &Performance,
    name: &str,
    (number, view): (usize, &View),
    mm_per_px: f64,
    out: &Staging,
    counter: &Counter<'_>,
) -> Result<()> {
    let folder = format!("{name}/view{number}");
    out.make_folder(&folder)?;
    let reach: Vec<_> = performance.bodies.iter().flat_map(|body| extent(body, view)).collect();
    let canvas = Canvas::fitting(&reach, mm_per_px, MARGIN_PX)
        .ok_or_else(|| SilhouettesError::too_large(name, &reach, mm_per_px))?;
    for (frame, body) in (1..).zip(&performance.bodies) {
        counter.check(DURING)?;
        let mask = draw(body, view, &canvas);
        out.write(&format!("{folder}/frame_{frame:06}.png"), &masks::png(&mask)?)?;
    }
    Ok(())
}

fn samples(performances: &[Performance], names: &[String], views: usize) -> String {
    let mut samples = String::new();
    for (Performance { subject, activity, .. }, name) in performances.iter().zip(names) {
        let performer = Performer { subject: subject.clone(), activity: activity.clone() };
        for view in 1..=views {
            samples += &samples_entry(&format!("{name}/view{view}"), &performer, view, name);
        }
    }
    samples
}

pub(super) fn samples_entry(masks: &str, performer: &Performer, view: usize, clip: &str) -> String {
    let quoted = |text: &str| toml::Value::String(text.into()).to_string();
    format!(
        "[[sample]]\nmasks = {}\nsubject = {}\nactivity = {}\nview = {view}\nclip = {}\n\n",
        quoted(masks),
        quoted(&performer.subject),
        quoted(&performer.activity),
        quoted(clip)
    )
}
