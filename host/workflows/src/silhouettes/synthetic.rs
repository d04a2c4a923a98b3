//! Silhouettes of seeded synthetic people at the ten activities of Li 2014, table 7.1.

use farnear_recognition::synthetic::activities::{ACTIVITIES, performance};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::performances::{self, Drawing, Performance, PerformancesFigures};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    parameters::within,
    request::{PathKind, Request},
};

/// Oblique, so that no view is along the path.
const FIRST_VIEW_DEG: f64 = 45.0;

/// Silhouettes of seeded synthetic people at the ten activities of Li 2014, table 7.1.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`: something to try everything
/// with.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear silhouettes synthetic --subjects 6 --out people/")
)]
#[serde(default)]
pub struct SyntheticRequest {
    /// People, each with a build and habits of their own, 1 to 1000.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().subjects))]
    pub subjects: usize,
    /// Only these activities: walk, drop, crouch, peer, mobile, place, bag, shoot, gun, dig.
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME", value_delimiter = ','))]
    pub activities: Vec<String>,
    /// Frames per second, 1 to 240.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().rate_hz))]
    pub rate_hz: f64,
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub drawing: Drawing,
}

impl Default for SyntheticRequest {
    fn default() -> Self {
        Self { subjects: 6, activities: Vec::new(), rate_hz: 8.0, drawing: Drawing::default() }
    }
}

impl Request for SyntheticRequest {
    const NAME: &'static str = "silhouettes synthetic";
    const REQUIRED: &'static [&'static str] = &["out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("out", PathKind::OutputFolder)];
    type Figures = PerformancesFigures;

    fn check(&self) -> Result<()> {
        within("subjects", self.subjects, &(1..=1000), "")?;
        within("frame rate", self.rate_hz, &(1.0..=240.0), "frames per second")?;
        self.drawing.check()
    }

    fn run(&self, context: &Context<'_>) -> Result<PerformancesFigures> {
        draw(self, context)
    }
}

pub fn draw(settings: &SyntheticRequest, context: &Context<'_>) -> Result<PerformancesFigures> {
    settings.check()?;
    let activities: Vec<usize> = match settings.activities.as_slice() {
        [] => (0..ACTIVITIES.len()).collect(),
        names => names.iter().map(|name| number_of(name)).collect::<Result<_>>()?,
    };
    let performances = (0..settings.subjects).flat_map(|subject| {
        activities.iter().map(move |&activity| Performance {
            subject: format!("p{subject:02}"),
            activity: ACTIVITIES[activity].into(),
            bodies: performance(subject, activity, 0, settings.rate_hz),
        })
    });
    performances::write(&performances.collect::<Vec<_>>(), FIRST_VIEW_DEG, &settings.drawing, context)
}

fn number_of(name: &str) -> Result<usize> {
    let unknown =
        || WorkflowError::parameter("activity", name, format!("expected {}", ACTIVITIES.join(", ")));
    ACTIVITIES.iter().position(|known| *known == name).ok_or_else(unknown)
}
