//! Combines slabs of a scene, front to back (see [`crate::blur`]).

use ndarray::Array2;

pub(crate) struct Sums {
    pub(crate) light: Vec<f32>,
    /// Empty if the slab covers everything.
    pub(crate) cover: Vec<f32>,
    pub(crate) border_px: usize,
    pub(crate) stride: usize,
}

impl Sums {
    pub(crate) fn new(
        (height, width): (usize, usize),
        margin_px: usize,
        lanes: usize,
        needs_cover: bool,
    ) -> Self {
        let border_px = 2 * margin_px;
        let stride = width + 2 * border_px + lanes;
        let count = (height + 2 * border_px) * stride;
        Self {
            light: vec![0.0; count],
            cover: vec![0.0; if needs_cover { count } else { 0 }],
            border_px,
            stride,
        }
    }
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
        let width = self.light.ncols();
        for (row, (mut light, mut open)) in
            self.light.outer_iter_mut().zip(self.open.outer_iter_mut()).enumerate()
        {
            let start = (row + sums.border_px) * sums.stride + sums.border_px;
            let new_light = &sums.light[start..start + width];
            if sums.cover.is_empty() {
                for ((light, open), new) in light.iter_mut().zip(&mut open).zip(new_light) {
                    *light += *open * new;
                    *open = 0.0;
                }
                continue;
            }
            let new_cover = &sums.cover[start..start + width];
            for (((light, open), &new), &cover) in
                light.iter_mut().zip(&mut open).zip(new_light).zip(new_cover)
            {
                if cover <= 0.0 || *open <= 0.0 {
                    continue;
                }
                let taken = cover.min(*open);
                *light += new * (taken / cover);
                *open -= taken;
            }
        }
    }

    /// The image; scales away gaps from rounding or the spread of slopes.
    pub(crate) fn finish(mut self) -> Array2<f32> {
        self.light.zip_mut_with(&self.open, |light, open| *light /= (1.0 - open).max(f32::MIN_POSITIVE));
        self.light
    }
}
