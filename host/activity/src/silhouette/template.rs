//! Marker templates: which markers make which rigid part of the body or prop (Li 2014, section 7.2.1), as TOML.
//!
//! ```toml
//! name = "my suit"
//! [[part]]
//! name = "head"
//! markers = ["LFHD", "RFHD", "LBHD", "RBHD"]
//! thickness_mm = 90.0     # optional: grows the part by so much all round, for suits with few markers
//! ```
//!
//! Left and right limbs are parts of their own. Markers may stand in several parts, which closes joints.

use serde::{Deserialize, Serialize};

/// A rigid part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Markers on it.
    pub markers: Vec<String>,
    /// Grown by so many millimetres all round.
    #[serde(default)]
    pub thickness_mm: f64,
}

/// All parts of a body and its props.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Template {
    /// Its name.
    pub name: String,
    /// The parts.
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
}

/// What is wrong with a template.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// Not the TOML that is expected.
    #[error("template: {0}")]
    Syntax(String),
    /// A part that cannot be drawn.
    #[error("template: part `{part}` {reason}")]
    Part {
        /// The part.
        part: String,
        /// What is wrong.
        reason: String,
    },
    /// The recording lacks markers.
    #[error(
        "the recording has no markers named {missing:?} (of {of} in template `{template}`); it has {present:?}"
    )]
    UnknownMarkers {
        /// Markers of the template that the recording lacks.
        missing: Vec<String>,
        /// Markers in the template.
        of: usize,
        /// The template.
        template: String,
        /// Some markers of the recording.
        present: Vec<String>,
    },
}

impl Template {
    /// Reads and checks a template.
    ///
    /// # Errors
    /// TOML errors, empty or doubled parts, negative thickness.
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
                return Err(bad("stands twice; left and right limbs need names of their own"));
            }
        }
        Ok(template)
    }

    /// Checks that a recording's markers fit: at least half of the template's must be there by name (a suit may lack a few).
    ///
    /// # Errors
    /// [`TemplateError::UnknownMarkers`].
    pub fn check(&self, names: &[String]) -> Result<(), TemplateError> {
        let has = |marker: &str| {
            names
                .iter()
                .any(|name| name == marker || name.rsplit_once(':').is_some_and(|(_, short)| short == marker))
        };
        let mut all: Vec<&String> = self.parts.iter().flat_map(|part| &part.markers).collect();
        all.sort();
        all.dedup();
        let missing: Vec<String> = all.iter().filter(|marker| !has(marker)).map(|m| (*m).clone()).collect();
        if 2 * missing.len() > all.len() {
            return Err(TemplateError::UnknownMarkers {
                missing,
                of: all.len(),
                template: self.name.clone(),
                present: names.iter().take(12).cloned().collect(),
            });
        }
        Ok(())
    }

    /// Vicon's Plug-in Gait / CMU's 41 markers, with the thickness that flesh has over few markers.
    pub fn plug_in_gait() -> Self {
        let part = |name: &str, thickness_mm: f64, markers: &[&str]| Part {
            name: name.into(),
            markers: markers.iter().map(|m| (*m).to_owned()).collect(),
            thickness_mm,
        };
        Self {
            name: "plug-in-gait".into(),
            parts: vec![
                part("head", 60.0, &["LFHD", "RFHD", "LBHD", "RBHD"]),
                part("neck", 50.0, &["LBHD", "RBHD", "C7", "CLAV"]),
                part("upper torso", 30.0, &["C7", "CLAV", "STRN", "T10", "LSHO", "RSHO", "RBAC"]),
                part(
                    "lower torso",
                    30.0,
                    &["STRN", "T10", "LFWT", "RFWT", "LBWT", "RBWT", "LASI", "RASI", "LPSI", "RPSI"],
                ),
                part("left arm", 45.0, &["LSHO", "LUPA", "LELB"]),
                part("right arm", 45.0, &["RSHO", "RUPA", "RELB"]),
                part("left forearm and hand", 38.0, &["LELB", "LFRM", "LWRA", "LWRB", "LFIN"]),
                part("right forearm and hand", 38.0, &["RELB", "RFRM", "RWRA", "RWRB", "RFIN"]),
                part("left thigh", 65.0, &["LFWT", "LBWT", "LASI", "LPSI", "LTHI", "LKNE"]),
                part("right thigh", 65.0, &["RFWT", "RBWT", "RASI", "RPSI", "RTHI", "RKNE"]),
                part("left leg and foot", 40.0, &["LKNE", "LSHN", "LTIB", "LANK", "LHEE", "LMT5", "LTOE"]),
                part("right leg and foot", 40.0, &["RKNE", "RSHN", "RTIB", "RANK", "RHEE", "RMT5", "RTOE"]),
            ],
        }
    }

    /// The suit and props of Li 2014, figures 7.2 and 7.4, by the counts printed there: jacket 36, trousers 32, head cover 5, gloves
    /// 2 each; bag 9, spade 10, short gun 4, long gun 6. The thesis prints no names, so markers are numbered per part, e.g. `LTHI1`.
    pub fn thesis() -> Self {
        let numbered = |name: &str, prefix: &str, count: usize| Part {
            name: name.into(),
            markers: (1..=count).map(|i| format!("{prefix}{i}")).collect(),
            thickness_mm: 0.0,
        };
        Self {
            name: "thesis".into(),
            parts: vec![
                numbered("head", "HEAD", 5),
                numbered("upper torso", "UTOR", 12),
                numbered("lower torso", "LTOR", 8),
                numbered("left arm", "LARM", 4),
                numbered("right arm", "RARM", 4),
                numbered("left forearm and hand", "LFOR", 6),
                numbered("right forearm and hand", "RFOR", 6),
                numbered("left thigh", "LTHI", 8),
                numbered("right thigh", "RTHI", 8),
                numbered("left leg and foot", "LLEG", 8),
                numbered("right leg and foot", "RLEG", 8),
                numbered("bag", "BAG", 9),
                numbered("spade", "SPAD", 10),
                numbered("short gun", "SGUN", 4),
                numbered("long gun", "LGUN", 6),
            ],
        }
    }
}
