//! Template parts that cannot be drawn, because they were not recorded or are hidden.

use std::collections::HashMap;

use farnear_silhouettes::readers::recording::Recording;
use farnear_silhouettes::silhouette::{capsule::Point3, template::Template};

use super::Flagged;

pub struct MissingParts {
    /// Parts for which the recording has no point.
    pub always: Vec<String>,
    per_frame: Vec<Vec<String>>,
}

impl MissingParts {
    pub fn of(template: &Template, recording: &Recording, frames: &[HashMap<&str, Point3>]) -> Self {
        let short = |name: &str| name.rsplit_once(':').map_or(name, |(_, short)| short).to_owned();
        let names = recording.known_names();
        let recorded = |marker: &String| names.iter().any(|name| name == marker || short(name) == *marker);
        let (drawn, never): (Vec<_>, Vec<_>) =
            template.parts.iter().partition(|part| part.markers.iter().any(recorded));
        let flags = |points: &HashMap<&str, Point3>| {
            if points.is_empty() {
                return vec!["empty".to_owned()];
            }
            let hidden =
                drawn.iter().filter(|part| !part.markers.iter().any(|m| points.contains_key(m.as_str())));
            hidden.map(|part| format!("missing:{}", part.name)).collect()
        };
        Self {
            always: never.into_iter().map(|part| part.name.clone()).collect(),
            per_frame: frames.iter().map(flags).collect(),
        }
    }

    pub fn flagged<'a>(&'a self, names: &'a [String]) -> Vec<Flagged<'a>> {
        let all = names.iter().zip(&self.per_frame);
        all.filter(|(_, flags)| !flags.is_empty()).map(|(frame, flags)| Flagged { frame, flags }).collect()
    }
}
