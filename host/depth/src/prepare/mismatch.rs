//! Why a pair does not correlate: images of cameras behind a beam splitter are mirrored, others
//! come from cameras that are mounted upside down.

use ndarray::{Array2, ArrayView2, s};

use super::{PrepareSettings, finish, noise::Blocks};
use crate::optics::Optics;

/// How one image of a pair was changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mismatch {
    /// Mirrored left to right, as by a beam splitter.
    Mirrored,
    /// Mirrored top to bottom.
    UpsideDown,
    /// Turned by 180 degrees.
    HalfTurn,
    /// Brightness inverted.
    Negative,
}

impl Mismatch {
    const TURNS: [Self; 3] = [Self::Mirrored, Self::UpsideDown, Self::HalfTurn];

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Mirrored => "; one is mirrored left to right: flip it before",
            Self::UpsideDown => "; one is mirrored top to bottom: flip it before",
            Self::HalfTurn => "; one is turned by 180 degrees: turn it before",
            Self::Negative => "; one is the negative of the other",
        }
    }

    fn undone(self, image: ArrayView2<f32>) -> Array2<f32> {
        match self {
            Self::Mirrored => image.slice(s![.., ..;-1]),
            Self::UpsideDown => image.slice(s![..;-1, ..]),
            Self::HalfTurn => image.slice(s![..;-1, ..;-1]),
            Self::Negative => image,
        }
        .as_standard_layout()
        .into_owned()
    }

    /// Finds the turn after which a pair of correlation `before` is one.
    pub(super) fn of(
        far: &Array2<f32>,
        near: &Array2<f32>,
        before: f64,
        optics: &Optics,
        settings: &PrepareSettings,
    ) -> Option<Self> {
        /// Correlation of a certain pair.
        const RELATED: f64 = 0.6;
        if before < -RELATED {
            return Some(Self::Negative);
        }
        let settings = PrepareSettings { trust: true, ..*settings };
        Self::TURNS.into_iter().find(|turn| {
            let pair = [far.clone(), turn.undone(near.view())];
            let blocks = Blocks::of(pair[0].view(), pair[1].view());
            let found = finish(&mut None, pair, None, [None, None], &blocks, optics, &settings);
            found.is_ok_and(|found| found.report.correlation.is_some_and(|after| after > RELATED))
        })
    }
}
