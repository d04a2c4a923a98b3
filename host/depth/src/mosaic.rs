//! Recognises the raw mosaic of a colour sensor that was saved as grey.
//!
//! The colour filters alternate every pixel: their spectrum is a line at the Nyquist frequency, far above what a scene
//! has at frequencies close by. Over 700 images in grey have a ratio of up to 5, mosaics of colour images 470 and more.

use ndarray::ArrayView2;

/// Side of a block, px.
const BLOCK_PX: usize = 32;
/// Most blocks along each axis.
const BLOCKS: usize = 8;
/// Distances from the Nyquist frequency that are compared, in periods per block: beyond the window's main lobe.
const CLOSE_BY: [f64; 3] = [3.0, 4.0, 5.0];
/// Least power at the Nyquist frequency relative to that close by.
const LINE: f64 = 30.0;
/// Weights of a row: the Nyquist frequency, the mean, and both phases of the frequencies close by.
const WEIGHTS: usize = 2 + 2 * CLOSE_BY.len();

/// What a user should know of a mosaic.
pub const WORDS: &str = "the images look like the raw mosaic of a colour sensor, in which pixels of other colours \
                         alternate: average 2x2 pixels, or save them in colour or grey";

/// Whether an image in grey seems to be the raw mosaic of a colour sensor. Averaging 2x2 pixels makes it grey. Cost:
/// at most some 600,000 operations, for any size.
pub fn is_mosaic(image: ArrayView2<f32>) -> bool {
    let weights = weights();
    let starts = |n: usize| (0..=n.saturating_sub(BLOCK_PX)).step_by((n / BLOCKS).max(BLOCK_PX));
    if image.nrows() < BLOCK_PX || image.ncols() < BLOCK_PX {
        return false;
    }
    // Along both axes at once, across columns, across rows: power of the line, and close by.
    let mut powers = [const { [const { Vec::new() }; 2] }; 3];
    for (top, left) in
        starts(image.nrows()).flat_map(|top| starts(image.ncols()).map(move |left| (top, left)))
    {
        let amplitude = amplitudes(image, [top, left], &weights);
        let power = |rows: usize, columns: usize| amplitude[rows][columns].powi(2);
        let close =
            |power: &dyn Fn(usize) -> f64| (2..WEIGHTS).map(power).sum::<f64>() / CLOSE_BY.len() as f64;
        let both = close(&|i| 0.5 * (power(0, i) + power(i, 0)));
        let found = [
            [power(0, 0), both],
            [power(1, 0), close(&|i| power(1, i))],
            [power(0, 1), close(&|i| power(i, 1))],
        ];
        for (powers, found) in powers.iter_mut().flatten().zip(found.into_iter().flatten()) {
            powers.push(found);
        }
    }
    let is_line = powers.map(|[line, close]| median(line) > LINE * median(close).max(f64::MIN_POSITIVE));
    // Red and blue alike leave no line along a single axis; one along one axis only is of the rows or columns.
    is_line[0] || (is_line[1] && is_line[2])
}

/// Of each pixel: Hann's window times each frequency; orthogonal to each other's main lobes.
fn weights() -> [[f64; WEIGHTS]; BLOCK_PX] {
    use std::f64::consts::TAU;
    std::array::from_fn(|x| {
        std::array::from_fn(|i| {
            let phase = (x as f64 + 0.5) / BLOCK_PX as f64;
            let window = 0.5 - 0.5 * (TAU * phase).cos();
            let alternating = if x % 2 == 0 { 1.0 } else { -1.0 };
            let value = match i {
                0 => alternating,
                1 => 1.0,
                i if i % 2 == 0 => alternating * (TAU * CLOSE_BY[i / 2 - 1] * phase).cos(),
                i => alternating * (TAU * CLOSE_BY[i / 2 - 1] * phase).sin(),
            };
            window * value
        })
    })
}

/// Amplitude of each pair of weights, of rows and of columns; NaN with a pixel without a value.
fn amplitudes(
    image: ArrayView2<f32>,
    [top, left]: [usize; 2],
    weights: &[[f64; WEIGHTS]; BLOCK_PX],
) -> [[f64; WEIGHTS]; WEIGHTS] {
    let mut amplitude = [[0.0_f64; WEIGHTS]; WEIGHTS];
    for (y, down) in weights.iter().enumerate() {
        let row = image.slice(ndarray::s![top + y, left..left + BLOCK_PX]);
        let mut of_row = [0.0_f64; WEIGHTS];
        for (value, across) in row.iter().zip(weights) {
            of_row.iter_mut().zip(across).for_each(|(sum, weight)| *sum += f64::from(*value) * weight);
        }
        for (amplitude, weight) in amplitude.iter_mut().zip(down) {
            amplitude.iter_mut().zip(of_row).for_each(|(sum, of_row)| *sum += weight * of_row);
        }
    }
    amplitude
}

/// Median of the finite values; 0 without any.
fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|value| value.is_finite());
    crate::median::median(values, f64::total_cmp).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::measure::binned;

    /// Smooth detail with noise; `colours` are the brightness of red, green and blue.
    fn scene(colours: [f32; 3]) -> Array2<f32> {
        let mut state = 1_u32;
        Array2::from_shape_fn((150, 200), |(y, x)| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (state >> 8) as f32 / (1 << 24) as f32;
            let detail = (0.31 * x as f32).sin() + (0.23 * y as f32 + 0.1 * x as f32).cos();
            (100.0 + 20.0 * detail) * colours[[0, 1, 1, 2][2 * (y % 2) + x % 2]] + 4.0 * noise
        })
    }

    #[test]
    fn a_mosaic_is_recognised_whichever_colours_differ() {
        for colours in [[0.5, 1.0, 0.6], [0.8, 1.0, 0.8], [0.9, 1.0, 1.1], [0.97, 1.0, 0.98]] {
            assert!(is_mosaic(scene(colours).view()), "{colours:?}");
        }
    }

    #[test]
    fn grey_is_none_nor_is_a_mosaic_after_averaging() {
        assert!(!is_mosaic(scene([1.0; 3]).view()));
        assert!(!is_mosaic(binned(scene([0.5, 1.0, 0.6]), 2).view()));
        assert!(!is_mosaic(Array2::zeros((150, 200)).view()), "no detail at all");
        assert!(!is_mosaic(scene([0.5, 1.0, 0.6]).slice(ndarray::s![..20, ..])), "smaller than a block");
    }

    #[test]
    fn rows_that_alternate_are_none() {
        let mut interlaced = scene([1.0; 3]);
        interlaced.indexed_iter_mut().for_each(|((y, _), value)| *value += 10.0 * (y % 2) as f32);
        assert!(!is_mosaic(interlaced.view()));
    }
}
