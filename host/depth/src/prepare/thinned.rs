//! A pair at the size for registration and agreement, halved to few enough pixels, with its common band.

use ndarray::{Array2, ArrayView2};

use super::band::{band, halved, without_holes};

/// Most pixels of the small images.
const FINEST_PX: usize = 800_000;

pub(crate) struct Thinned {
    pub(crate) far: Small,
    pub(crate) near: Small,
    /// Number of halvings.
    pub(crate) halvings: usize,
}

/// A small image without holes, and its band.
pub(crate) struct Small {
    pub(crate) image: Array2<f32>,
    pub(crate) band: Array2<f32>,
}

impl Thinned {
    /// Images of one size.
    pub(crate) fn new(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Self {
        let (far, halvings) = Small::new(far);
        Self { far, near: Small::new(near).0, halvings }
    }

    /// Replaces the near image.
    pub(crate) fn replace_near(&mut self, near: ArrayView2<f32>) {
        self.near = Small::new(near).0;
    }
}

impl Small {
    fn new(image: ArrayView2<f32>) -> (Self, usize) {
        let mut small = without_holes(image);
        let mut halvings = 0;
        while small.len() > FINEST_PX {
            small = halved(small.view()).into();
            halvings += 1;
        }
        let image = small.into_owned();
        let band = band(image.view());
        (Self { image, band }, halvings)
    }
}
