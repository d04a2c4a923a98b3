//! Coarseness of the texture around each pixel: the logarithm of the mean square difference of pixels 3 px apart relative
//! to neighbours', without noise. White texture has 0, a slope of brightness `ln 9`; blur raises it.

use ndarray::{Array2, Zip};

use crate::adaptive_window::LEARNED_PX;
use crate::prepare::{Prepared, band::box_mean};

const APART_PX: usize = 3;
/// Part of the neighbours' difference that must be texture.
const TELLING: f32 = 0.2;

/// NaN where noise hides the texture.
pub(crate) fn coarseness(pair: &Prepared) -> Array2<f32> {
    let sum = &pair.far + &pair.near;
    let (height, width) = sum.dim();
    let energy = |apart: usize| {
        let squares = Array2::from_shape_fn((height, width), |(y, x)| {
            let other = |i: usize, n: usize| if i + apart < n { i + apart } else { i - apart };
            let here = sum[(y, x)];
            let [down, right] = [sum[(other(y, height), x)] - here, sum[(y, other(x, width))] - here];
            let square = down * down + right * right;
            if square.is_finite() { square } else { 0.0 }
        });
        box_mean(squares.view(), LEARNED_PX[2])
    };
    // Two differences of sums of two images.
    let noise = 8.0 * pair.noise.mean_variance as f32;
    Zip::from(&energy(1)).and(&energy(APART_PX)).map_collect(|near, apart| {
        let [near_texture, apart_texture] = [near - noise, apart - noise];
        let told = near_texture > TELLING * near && apart_texture > 0.0;
        if told { (apart_texture / near_texture).ln() } else { f32::NAN }
    })
}
