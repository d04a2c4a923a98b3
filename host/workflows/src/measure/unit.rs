//! Units of depth maps.

use farnear_depth::metrics::is_depth;
use serde::{Deserialize, Serialize, ser::SerializeMap};

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    #[default]
    Mm,
    Um,
    /// Image numbers in a stack, from 1.
    Image,
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mm => "mm",
            Self::Um => "um",
            Self::Image => "image",
        })
    }
}

impl Unit {
    /// Positions may have any sign; otherwise 0, negative values, NaN and infinity are holes.
    pub fn is_depth(self, value: f32) -> bool {
        if self == Self::Um { value.is_finite() } else { is_depth(value) }
    }

    /// In a sentence: depths in millimetres, in numbers of images.
    pub(super) fn words(self) -> &'static str {
        if self == Self::Image { "numbers of images" } else { self.suffix() }
    }

    /// Suffix of lengths along the axis: `mean_mm`, `mean_um`, `mean_images`.
    fn suffix(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Um => "um",
            Self::Image => "images",
        }
    }
}

/// Serialises figures of a map; names of lengths end with its unit.
pub(crate) struct Entries<M> {
    to: M,
    unit: Unit,
}

impl<M: SerializeMap> Entries<M> {
    pub fn new(to: M, unit: Unit) -> Self {
        Self { to, unit }
    }

    pub fn field(&mut self, name: &str, value: &(impl Serialize + ?Sized)) -> Result<(), M::Error> {
        self.to.serialize_entry(name, value)
    }

    pub fn length(&mut self, name: &str, value: Option<impl Serialize>) -> Result<(), M::Error> {
        value.map_or(Ok(()), |value| self.field(&format!("{name}_{}", self.unit.suffix()), &value))
    }

    pub fn per_pixel(&mut self, name: &str, value: Option<f64>) -> Result<(), M::Error> {
        value.map_or(Ok(()), |value| self.field(&format!("{name}_{}_per_px", self.unit.suffix()), &value))
    }

    pub fn end(self) -> Result<M::Ok, M::Error> {
        self.to.end()
    }
}
