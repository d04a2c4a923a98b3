//! Marker templates as TOML: the markers of each rigid part of body or prop (Li 2014, section 7.2.1).
//! ```toml
//! name = "my suit"
//! [[part]]
//! name = "head"
//! markers = ["LFHD", "RFHD", "LBHD", "RBHD"]
//! thickness_mm = 90.0     # optional: grows the part by so much all round, for suits with few markers
//! ```
//! Left and right limbs are separate parts. Markers may belong to several parts, which closes joints.

use super::anatomy::without_prefix;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Name in flags and errors.
    pub name: String,
    pub markers: Vec<String>,
    /// Radius by which the part is grown.
    #[serde(default)]
    pub thickness_mm: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Template {
    pub name: String,
    /// Drawn one over the other.
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TemplateError {
    #[error("template: {0}")]
    Syntax(String),
    #[error("no built-in template `{0}`: there are {names}; or name a TOML file", names = Template::names().collect::<Vec<_>>().join(", "))]
    Name(String),
    #[error("template: part `{part}` {reason}")]
    Part { part: String, reason: String },
    #[error("{}", lacking(.missing, *.of, .template, .parts, .present))]
    UnknownMarkers {
        missing: Box<[String]>,
        of: usize,
        template: String,
        /// Those of which the recording has more than one marker, or all.
        parts: Box<[String]>,
        /// Some markers of the recording.
        present: Box<[String]>,
    },
}

fn lacking(missing: &[String], of: usize, template: &str, parts: &[String], present: &[String]) -> String {
    let (names, count) = (listed(present), missing.len());
    let missing = listed(missing);
    if count == of {
        return format!(
            "none of the recording's names ({names}) is one of the {of} markers of template `{template}` ({missing})"
        );
    }
    let subject = match parts {
        [] => "the recording".to_owned(),
        _ => format!("the recording has only {}, and a part of a body is not drawn; it", parts.join(", ")),
    };
    format!(
        "{subject} lacks {count} of the {of} markers of template `{template}` ({missing}); it has {names}"
    )
}

fn listed(names: &[String]) -> String {
    const SHOWN: usize = 10;
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ") + more
}

impl Template {
    /// Fails for invalid TOML, empty or duplicate parts, negative thickness.
    pub fn parse(text: &str) -> Result<Self, TemplateError> {
        let template: Self =
            toml::from_str(text).map_err(|error| TemplateError::Syntax(error.to_string()))?;
        if template.parts.is_empty() {
            return Err(TemplateError::Syntax("it has no [[part]]".into()));
        }
        for (index, part) in template.parts.iter().enumerate() {
            let bad = |reason: &str| TemplateError::Part { part: part.name.clone(), reason: reason.into() };
            if part.markers.is_empty() {
                return Err(bad("has no markers"));
            }
            if !(0.0..=500.0).contains(&part.thickness_mm) {
                return Err(bad("has a thickness outside 0 to 500 mm"));
            }
            if template.parts[..index].iter().any(|other| other.name == part.name) {
                return Err(bad("occurs twice; give left and right limbs different names"));
            }
        }
        Ok(template)
    }

    /// Markers of the template in a recording, and their total.
    pub fn coverage(&self, names: &[String]) -> (usize, usize) {
        let (missing, of) = self.missing(names);
        (of - missing.len(), of)
    }

    fn missing(&self, names: &[String]) -> (Vec<String>, usize) {
        let has = |marker: &str| names.iter().any(|name| name == marker || without_prefix(name) == marker);
        let mut all: Vec<&String> = self.parts.iter().flat_map(|part| &part.markers).collect();
        all.sort();
        all.dedup();
        (all.iter().filter(|marker| !has(marker)).map(|m| (*m).clone()).collect(), all.len())
    }

    /// Parts with two markers, or with all; one is enough for a part with a thickness if `any`.
    fn drawn(&self, missing: &[String], any: bool) -> Vec<&Part> {
        let there = |part: &&Part| {
            let present = part.markers.iter().filter(|marker| !missing.contains(marker)).count();
            present >= if any && part.thickness_mm > 0.0 { 1 } else { part.markers.len().min(2) }
        };
        self.parts.iter().filter(there).collect()
    }

    /// Requires half of the markers, or enough for four parts in five (templates name many joints).
    pub fn check(&self, names: &[String]) -> Result<(), TemplateError> {
        let (missing, of) = self.missing(names);
        if 2 * missing.len() > of && 5 * self.drawn(&missing, true).len() < 4 * self.parts.len() {
            let parts = self.drawn(&missing, false).into_iter().map(|part| part.name.clone()).collect();
            return Err(TemplateError::UnknownMarkers {
                parts,
                missing: missing.into(),
                of,
                template: self.name.clone(),
                present: names.iter().take(12).cloned().collect(),
            });
        }
        Ok(())
    }

    /// One of [`Template::BUILT_IN`].
    pub fn named(name: &str) -> Result<Self, TemplateError> {
        let found = Self::built_in().iter().find(|template| template.name == name);
        found.cloned().ok_or_else(|| TemplateError::Name(name.to_owned()))
    }

    /// Parsed once, because every recording is compared with all of them.
    pub(super) fn built_in() -> &'static [Self] {
        static PARSED: LazyLock<Vec<Template>> = LazyLock::new(|| {
            Template::BUILT_IN.iter().filter_map(|(_, text)| Template::parse(text).ok()).collect()
        });
        &PARSED
    }

    /// Built-in templates by name, as TOML: Plug-in Gait (and CMU 41), Vicon's 53 markers, OpenCap, Li 2014,
    /// BVH skeletons, Kinect joints, keypoints of pose estimators.
    pub const BUILT_IN: [(&str, &str); 7] = [
        ("plug-in-gait", include_str!("../../templates/plug-in-gait.toml")),
        ("vicon-53", include_str!("../../templates/vicon-53.toml")),
        ("opencap", include_str!("../../templates/opencap.toml")),
        ("thesis", include_str!("../../templates/thesis.toml")),
        ("bvh", include_str!("../../templates/bvh.toml")),
        ("kinect", include_str!("../../templates/kinect.toml")),
        ("keypoints", include_str!("../../templates/keypoints.toml")),
    ];

    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::BUILT_IN.iter().map(|(name, _)| *name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_templates_are_whole() {
        for name in Template::names() {
            let template = Template::named(name).expect("a template");
            assert_eq!(template.name, name);
            let sided = |side: &str| template.parts.iter().filter(|part| part.name.starts_with(side)).count();
            assert!(sided("left ") == sided("right ") && sided("left ") >= 4, "{name}");
        }
        // Li 2014, figures 7.2 and 7.4: jacket 36, trousers 32, head 5, gloves 2 each, props 9 + 10 + 4 + 6.
        let thesis = Template::named("thesis").expect("a template");
        assert_eq!(thesis.parts.iter().map(|part| part.markers.len()).sum::<usize>(), 77 + 29);
        assert!(matches!(Template::named("jacket"), Err(TemplateError::Name(_))));
    }
}
