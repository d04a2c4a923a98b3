//! Why a pixel has no depth.

use serde::{Deserialize, Serialize};

/// Why a pixel has no depth; as a number in `reason.png`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum Reason {
    /// At the camera's white level.
    Saturated = 1,
    /// A patch at the camera's black level.
    Dark = 2,
    /// Too little texture above the noise.
    NoTexture = 3,
    /// Beyond the working range.
    OutOfRange = 4,
    /// Visible in one of the images only.
    Edge = 5,
    /// Moved between the exposures.
    Moved = 6,
    /// A bad pixel of the camera, or a wild value in a file of floats.
    BadPixel = 7,
    /// The model does not explain the pair here.
    Misfit = 8,
    /// No finite number in the file.
    NotFinite = 9,
    /// Confidence below the requested one.
    Unsure = 10,
    /// Beyond the range of a correction.
    BeyondCorrection = 11,
}

impl Reason {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Self; 11] = [
        Self::Saturated,
        Self::Dark,
        Self::NoTexture,
        Self::OutOfRange,
        Self::Edge,
        Self::Moved,
        Self::BadPixel,
        Self::Misfit,
        Self::NotFinite,
        Self::Unsure,
        Self::BeyondCorrection,
    ];

    /// Its number; 0 means that the pixel has a depth.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Description.
    pub fn words(self) -> &'static str {
        match self {
            Self::Saturated => "saturated",
            Self::Dark => "black",
            Self::NoTexture => "too little texture above the noise",
            Self::OutOfRange => "outside the working range",
            Self::Edge => "seen in one image only",
            Self::Moved => "moved between the exposures",
            Self::BadPixel => "bad pixel of the camera",
            Self::Misfit => "not explained by the model",
            Self::NotFinite => "no value in the file (NaN or transparent)",
            Self::Unsure => "less confident than asked for",
            Self::BeyondCorrection => "beyond what the correction was taught",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_places_in_the_list() {
        for (index, reason) in Reason::ALL.iter().enumerate() {
            assert_eq!(usize::from(reason.code()), index + 1);
        }
    }

    #[test]
    fn every_reason_has_words_of_its_own() {
        let words: std::collections::BTreeSet<&str> =
            Reason::ALL.iter().map(|reason| reason.words()).collect();
        assert_eq!(words.len(), Reason::ALL.len());
    }
}
