//! Combines slabs of a scene, front to back (see [`crate::blur`]).

use ndarray::{Array2, Zip, s};

/// Light and cover of a rectangle of pixels.
pub(crate) struct Sums {
    /// Row and column of its first pixel.
    pub(crate) first: (usize, usize),
    pub(crate) light: Array2<f32>,
    /// `None` if the slab covers everything.
    pub(crate) cover: Option<Array2<f32>>,
}

pub(crate) struct Composite {
    light: Array2<f32>,
    open: Array2<f32>,
}

impl Composite {
    pub(crate) fn new(size: (usize, usize)) -> Self {
        Self { light: Array2::zeros(size), open: Array2::ones(size) }
    }

    pub(crate) fn add_behind(&mut self, sums: &Sums) {
        let (top, left) = sums.first;
        let (height, width) = sums.light.dim();
        let place = s![top..top + height, left..left + width];
        let pixels = Zip::from(self.light.slice_mut(place)).and(self.open.slice_mut(place)).and(&sums.light);
        let Some(cover) = &sums.cover else {
            return pixels.for_each(|light, open, &new| {
                *light += *open * new;
                *open = 0.0;
            });
        };
        pixels.and(cover).for_each(|light, open, &new, &cover| {
            if cover > 0.0 && *open > 0.0 {
                let taken = cover.min(*open);
                *light += new * (taken / cover);
                *open -= taken;
            }
        });
    }

    /// The image; scales away gaps from rounding or the spread of slopes.
    pub(crate) fn finish(mut self) -> Array2<f32> {
        self.light.zip_mut_with(&self.open, |light, open| *light /= (1.0 - open).max(f32::MIN_POSITIVE));
        self.light
    }
}
