//! The run time stage by stage over whole images: reference of the fast one.

use ndarray::{Array2, ArrayView2};

use super::Settings;
use super::check::Input;
use crate::border::reflect;
use crate::cubic;
use crate::kernel::Kernel;
use crate::operators::Operators;

pub(crate) struct Maps {
    pub alpha: Array2<f32>,
    pub texture: Array2<f32>,
    pub misfit: Array2<f32>,
}

/// The kernels are symmetric; borders are reflected.
pub(crate) fn convolve(image: ArrayView2<f32>, kernel: &Kernel) -> Array2<f32> {
    let (height, width) = image.dim();
    let r = (kernel.size() / 2) as isize;
    let taps: Vec<(isize, isize, f32)> = (-r..=r)
        .flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)))
        .map(|(dx, dy)| (dx, dy, kernel.at(dx, dy) as f32))
        .collect();
    Array2::from_shape_fn((height, width), |(y, x)| {
        taps.iter()
            .map(|(dx, dy, tap)| {
                tap * image[(reflect(y as isize + dy, height), reflect(x as isize + dx, width))]
            })
            .sum()
    })
}

/// Window sums with reflected borders, rows first.
fn box_sum(image: &Array2<f32>, size: usize) -> Array2<f32> {
    let (height, width) = image.dim();
    let r = (size / 2) as isize;
    let rows = Array2::from_shape_fn((height, width), |(y, x)| {
        (-r..=r).map(|d| image[(y, reflect(x as isize + d, width))]).sum::<f32>()
    });
    Array2::from_shape_fn((height, width), |(y, x)| {
        (-r..=r).map(|d| rows[(reflect(y as isize + d, height), x)]).sum::<f32>()
    })
}

pub(crate) fn maps(input: &Input, operators: &Operators, settings: &Settings) -> Maps {
    let size = (input.height, input.width);
    let [difference, sum] = [0, 1].map(|i| Array2::from_shape_fn(size, |(y, x)| input.normalised(y, x)[i]));
    let [m, p] = [difference, sum].map(|i| convolve(i.view(), operators.prefilter()));
    let m = convolve(m.view(), operators.gm1());
    let [p1, p2] = [operators.gp1(), operators.gp2()].map(|k| convolve(p.view(), k));
    let smooth = |a: &Array2<f32>, b: &Array2<f32>| box_sum(&(a * b), settings.smoothing_px);
    let [texture, c3, c0, energy] = [smooth(&p1, &p1), smooth(&p1, &p2), smooth(&p1, &m), smooth(&m, &m)];
    let mut alpha = Array2::from_elem(texture.dim(), f32::NAN);
    let mut misfit = Array2::zeros(texture.dim());
    for (at, c1) in texture.indexed_iter() {
        let c1 = c1.max(1e-30);
        alpha[at] = cubic::root(c0[at], c1, c3[at]);
        misfit[at] = ((energy[at] - c0[at] * c0[at] / c1) / c1).max(0.0);
    }
    let median = Array2::from_shape_fn(size, |at| median_at(&alpha, settings.median_px, at));
    Maps { alpha: median, texture, misfit }
}

/// Median of the values around (y, x) that are not NaN, with reflected borders; NaN without any.
fn median_at(image: &Array2<f32>, size: usize, (y, x): (usize, usize)) -> f32 {
    let (height, width) = image.dim();
    let r = (size / 2) as isize;
    let mut window = Vec::with_capacity(size * size);
    for dy in -r..=r {
        let row = reflect(y as isize + dy, height);
        window
            .extend((-r..=r).map(|dx| image[(row, reflect(x as isize + dx, width))]).filter(|v| !v.is_nan()));
    }
    if window.is_empty() {
        return f32::NAN;
    }
    let middle = window.len() / 2;
    *window.select_nth_unstable_by(middle, f32::total_cmp).1
}
