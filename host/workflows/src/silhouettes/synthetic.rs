//! Silhouettes of seeded synthetic people at the ten activities of Li 2014, table 7.1.

use farnear_recognition::synthetic::activities::{ACTIVITIES, performance};

use super::performances::{self, Drawing, Performance, PerformancesFigures};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    parameters::within,
};

/// Starting obliquely, so that no view looks exactly along the path.
const FIRST_VIEW_DEG: f64 = 45.0;

/// Who is drawn doing what, how, and where to.
#[derive(Clone, PartialEq, Debug)]
pub struct SyntheticSettings {
    /// People, each with a build and habits of their own, 1 to 1000.
    pub subjects: usize,
    /// Names of the activities; all by default.
    pub activities: Vec<String>,
    /// Frames per second, 1 to 240.
    pub rate_hz: f64,
    /// How bodies are drawn.
    pub drawing: Drawing,
}

/// Draws every person at every activity.
pub fn draw(settings: &SyntheticSettings, context: &Context<'_>) -> Result<PerformancesFigures> {
    within("subjects", settings.subjects, &(1..=1000), "")?;
    within("frame rate", settings.rate_hz, &(1.0..=240.0), "frames per second")?;
    settings.drawing.check()?;
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
