//! Flags of masks whose cut is doubtful.

use std::path::Path;

use farnear_shadow::cut::SIDEWAYS;
use farnear_shadow::{CutReport, Light, Method};

use super::LightSource;

/// The shadow is not where the light casts it.
pub(super) const POOR_FIT: &str = "poor-fit";

/// Largest removed share of a silhouette.
const MUCH: f64 = 0.6;
/// Largest share of the expected shadow that a mask lacks. Of 202 rendered people in any light, also bent and with noise, half
/// lack 0.14 and 5 % more than 0.5; with the opposite azimuth half lack 0.97 and 5 % less than 0.5. The unexplained share
/// separates them less: it grows with the shadow.
const MISSING: f64 = 0.5;
/// Up to this unexplained share a fit is good: most of a small shadow may be missing.
const EXPLAINED: f64 = 0.05;
/// Below this, small errors change the long shadow's direction too much.
const LOW_DEG: f64 = 8.0;

pub(super) fn doubts(cut: &CutReport, light: Light, method: Method) -> Vec<&'static str> {
    let expects_fit = method == Method::Hybrid && !matches!(light, Light::Direction { .. });
    let is_poor = match (cut.missing, cut.unexplained) {
        (Some(missing), Some(unexplained)) => missing > MISSING && unexplained > EXPLAINED,
        _ => expects_fit,
    };
    let found = [
        (cut.shadow.eta_rad.sin() < -SIDEWAYS, "shadow-behind"),
        (cut.shadow.shortened, "shadow-leaves-picture"),
        (cut.removed_fraction > MUCH, "much-removed"),
        (matches!(light, Light::Sun(sun) if sun.elevation_deg < LOW_DEG), "low-sun"),
        (is_poor, POOR_FIT),
    ];
    found.into_iter().filter_map(|(holds, name)| holds.then_some(name)).collect()
}

impl LightSource {
    /// Notice where most of the cut masks have a poor fit.
    pub(super) fn of_poor_fits(&self, poor: usize, cut: usize, masks: &Path) -> String {
        let check = match self {
            Self::Lamp(_) => "the lamp's place",
            _ => {
                "azimuth_deg in the camera file (anticlockwise from north; a compass and the sun's azimuth go clockwise), \
                 time and place"
            }
        };
        format!(
            "{}: in {poor} of {cut} masks the shadow is not where the light casts it ({POOR_FIT}): check {check}, and that the \
             masks have their shadow",
            masks.display()
        )
    }
}
