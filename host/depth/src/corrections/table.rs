//! The trait of a correction, and the table of corrections.

use farnear_maths::clsf::DepthScale;
use ndarray::ArrayViewMut2;

use super::board::BoardForm;
use super::pattern::Series;
use super::{CdcSettings, CorrectionError};

/// A learned correction. Its fields are its stored form.
pub(super) trait Learned: Sized {
    /// Least number of patterns at different depths.
    const PATTERNS_NEEDED: usize;

    /// The board's method; `None` if it has none.
    const BOARD_FORM: Option<BoardForm> = None;

    fn learn(series: &Series<'_>, settings: &CdcSettings) -> Result<Self, CorrectionError>;

    fn prepare(&mut self, dim: (usize, usize)) -> Result<(), CorrectionError>;

    /// Corrects a map in standard layout in place; values beyond the scale become NaN.
    fn apply(&self, depth_mm: ArrayViewMut2<f32>, scale: DepthScale);

    /// Bits of the coefficients in the order of the board's form; empty without one.
    fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
        Ok(Vec::new())
    }
}

/// Generates [`Method`](super::Method), the names, and the stored form `Map`.
macro_rules! corrections {
    ($(#[doc = $summary:literal] $variant:ident = $name:literal: $learned:ty,)+) => {
        /// Name of the correction.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum Method {
            $(
                #[doc = $summary]
                #[serde(rename = $name)]
                $variant,
            )+
        }

        impl Method {
            /// All methods.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// The name as the command line writes it.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)+ }
            }

            /// Description, in a few words.
            pub fn summary(self) -> &'static str {
                match self { $(Self::$variant => $summary.trim_ascii(),)+ }
            }

            /// Least number of patterns at different depths.
            pub fn patterns_needed(self) -> usize {
                match self { $(Self::$variant => <$learned>::PATTERNS_NEEDED,)+ }
            }

            /// The board's method; `None` if it has none.
            pub fn board_form(self) -> Option<BoardForm> {
                match self { $(Self::$variant => <$learned>::BOARD_FORM,)+ }
            }
        }

        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "method")]
        enum Map {
            $(
                #[serde(rename = $name)]
                $variant($learned),
            )+
        }

        impl Map {
            fn learn(
                method: Method,
                series: &Series<'_>,
                settings: &CdcSettings,
            ) -> Result<Self, CorrectionError> {
                Ok(match method {
                    $(Method::$variant => Self::$variant(<$learned>::learn(series, settings)?),)+
                })
            }

            fn method(&self) -> Method {
                match self { $(Self::$variant(_) => Method::$variant,)+ }
            }

            fn prepare(&mut self, dim: (usize, usize)) -> Result<(), CorrectionError> {
                match self { $(Self::$variant(learned) => learned.prepare(dim),)+ }
            }

            fn apply(&self, depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
                match self { $(Self::$variant(learned) => learned.apply(depth_mm, scale),)+ }
            }

            fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
                match self { $(Self::$variant(learned) => learned.quantised(),)+ }
            }
        }
    };
}
pub(super) use corrections;
