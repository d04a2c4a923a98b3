//! Defective pixels: saturated, black, bad, not finite. The mean of its neighbours replaces a single one: its error is
//! small among the hundreds of pixels for a depth. A clipped highlight is unchanged: its value is a lower bound, and
//! its neighbours are darker. A patch becomes a hole (NaN), which removes all depths that depend on it.

use ndarray::{Array2, ArrayView2, Axis, s};

use crate::confidence;
use crate::reason::Reason;

/// Half the side of the neighbourhood that decides whether a defect is single.
const NEIGHBOURHOOD_PX: isize = 2;
/// Most defects in it, the pixel included.
const ALONE: usize = 6;

/// Least mean of the neighbours of a clipped highlight, relative to a saturated pixel; below it the pixel is defective.
const HIGHLIGHT: f32 = 0.65;

/// Largest part of an image above the level at which it is clipped: hot pixels.
const HOT: f64 = 1e-4;

/// Magnitude that light does not reach in a file of floats, relative to the usual one: in sums of squares, one such pixel
/// outweighs all others.
const WILD: f32 = 1000.0;

/// Magnitude that one of 1000 pixels exceeds; `None` for an image that is black almost everywhere.
pub(crate) fn usual_magnitude(image: ArrayView2<f32>) -> Option<f32> {
    let sample = image.slice(confidence::sample(image.dim()));
    let mut sizes: Vec<f32> = sample.iter().map(|v| v.abs()).filter(|size| size.is_finite()).collect();
    let place = sizes.len().checked_sub(2 + sizes.len() / 1000)?;
    let usual = *sizes.select_nth_unstable_by(place, f32::total_cmp).1;
    (usual > 0.0).then_some(usual)
}

/// Takes the values of wild pixels from an image of floats, single or in small groups: NaN remains. A spot of light on black is larger.
pub fn erase_wild(image: &mut Array2<f32>) {
    let wild = usual_magnitude(image.view()).map_or(f32::INFINITY, |usual| WILD * usual);
    let is_wild = |value: &f32| value.is_finite() && value.abs() >= wild;
    let (height, width) = image.dim();
    let reach = NEIGHBOURHOOD_PX as usize;
    let around = |at: usize, size: usize| at.saturating_sub(reach)..(at + reach + 1).min(size);
    let is_alone = |(y, x): (usize, usize)| {
        let near = image.slice(s![around(y, height), around(x, width)]);
        near.iter().filter(|value| is_wild(value)).count() <= ALONE
    };
    let found: Vec<(usize, usize)> = image
        .indexed_iter()
        .filter(|(at, value)| is_wild(value) && is_alone(*at))
        .map(|(at, _)| at)
        .collect();
    found.iter().for_each(|at| image[*at] = f32::NAN);
}

/// Level at which an image is clipped: the brightest 3x3 patch of one value, if only hot pixels are brighter. A camera
/// may saturate below full scale, and a float file has none. Cost: some ten operations a pixel.
fn clipping_level(image: ArrayView2<f32>) -> Option<f32> {
    let least = |a: f32, b: f32| if a < b { a } else { b };
    let mut columns = vec![0.0_f32; image.ncols()];
    let mut patches = vec![0.0_f32; image.ncols().checked_sub(2)?];
    let (mut level, mut is_flat) = (f32::NEG_INFINITY, false);
    for rows in image.axis_windows(Axis(0), 3) {
        let rows = [0, 1, 2].map(|row| rows.index_axis_move(Axis(0), row));
        let [Some(above), Some(row), Some(below)] = rows.each_ref().map(|row| row.to_slice()) else {
            return None;
        };
        let pixels = above.iter().zip(row).zip(below);
        columns.iter_mut().zip(pixels).for_each(|(to, ((a, b), c))| *to = least(least(*a, *b), *c));
        let three = columns.iter().zip(&columns[1..]).zip(&columns[2..]);
        patches.iter_mut().zip(three).for_each(|(to, ((a, b), c))| *to = least(least(*a, *b), *c));
        let brightest = largest(&patches);
        if brightest < level || brightest == f32::NEG_INFINITY || (brightest == level && is_flat) {
            continue;
        }
        let all =
            |x: usize| rows.iter().all(|row| row.iter().skip(x).take(3).all(|value| *value == brightest));
        is_flat = patches.iter().enumerate().any(|(x, darkest)| *darkest == brightest && all(x));
        level = brightest;
    }
    let count =
        |test: fn(&f32, &f32) -> bool| image.iter().filter(|value| test(value, &level)).count() as f64;
    let pixels = image.len() as f64;
    (is_flat && count(f32::gt) <= (HOT * pixels).max(4.0) && count(f32::eq) < 0.5 * pixels).then_some(level)
}

/// Largest of values, by parallel maxima, which the compiler vectorises.
fn largest(values: &[f32]) -> f32 {
    let most = |a: f32, b: f32| if b > a { b } else { a };
    let (parts, rest) = values.as_chunks::<16>();
    let mut largest = [f32::NEG_INFINITY; 16];
    for part in parts {
        largest.iter_mut().zip(part).for_each(|(to, value)| *to = most(*to, *value));
    }
    largest.iter().chain(rest).copied().fold(f32::NEG_INFINITY, most)
}

/// Marks the defects of an image: code of the [`Reason`], 0 = none. `limits` are the black and the white level of a
/// camera that clips, `bad` its bad pixels. An image that is clipped below its white level is marked there. Without
/// limits, a value of [`WILD`] magnitude is a bad pixel.
pub(super) fn find(
    image: ArrayView2<f32>,
    limits: Option<[f32; 2]>,
    bad: Option<ArrayView2<bool>>,
) -> Option<Array2<u8>> {
    let (height, width) = image.dim();
    // A camera's limits exclude wild values.
    let usual = if limits.is_none() { usual_magnitude(image) } else { None };
    let wild = usual.map_or(f32::INFINITY, |usual| WILD * usual);
    let [black, white] = limits.unwrap_or([f32::NEG_INFINITY, f32::INFINITY]);
    let limits = match clipping_level(image) {
        Some(level) => Some([black, white.min(level)]),
        None => limits,
    };
    let black = |y: isize, x: isize| {
        limits.is_some_and(|[black, _]| {
            image[(y.clamp(0, height as isize - 1) as usize, x.clamp(0, width as isize - 1) as usize)]
                <= black
        })
    };
    // Most rows have no defect; one comparison per pixel excludes them.
    let [low, high] = limits.unwrap_or([f32::NEG_INFINITY, f32::INFINITY]);
    let [low, high] = [low.max(-wild), high.min(wild)];
    let clean = |row: usize| {
        let fine = |value: &f32| u32::from(*value > low && *value < high);
        bad.is_none()
            && image.row(row).as_slice().is_some_and(|row| {
                row.chunks(1 << 16).all(|part| part.iter().map(fine).sum::<u32>() as usize == part.len())
            })
    };
    let suspicious = (0..height).filter(|row| !clean(*row));
    let pixels = suspicious.flat_map(|y| (0..width).map(move |x| (y, x)));
    let mut marks = None;
    for (y, x) in pixels {
        let value = &image[(y, x)];
        let reason = if !value.is_finite() {
            Reason::NotFinite
        } else if value.abs() >= wild || bad.is_some_and(|bad| bad[(y, x)]) {
            Reason::BadPixel
        } else if limits.is_some_and(|[_, white]| *value >= white) {
            Reason::Saturated
        } else if limits.is_some_and(|[dark, _]| *value <= dark) {
            // A single black pixel may be part of the scene; a patch was clipped.
            let (y, x) = (y as isize, x as isize);
            let patch = (-1..=1).all(|dy| (-1..=1).all(|dx| black(y + dy, x + dx)));
            if !patch {
                continue;
            }
            Reason::Dark
        } else {
            continue;
        };
        marks.get_or_insert_with(|| Array2::zeros((height, width)))[(y, x)] = reason.code();
    }
    marks
}

/// Replaces single defects and makes holes of the others.
pub(super) fn mend(image: &mut Array2<f32>, marks: &Array2<u8>) {
    let (height, width) = image.dim();
    // Collected first: no pixel is corrected from a corrected one.
    let mut mended = Vec::new();
    for ((y, x), _) in marks.indexed_iter().filter(|(_, mark)| **mark != 0) {
        let around = |reach: isize| {
            (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| (dy, dx))).filter_map(
                move |(dy, dx)| {
                    let at = (y.checked_add_signed(dy)?, x.checked_add_signed(dx)?);
                    (at.0 < height && at.1 < width).then_some((at, dy * dy + dx * dx))
                },
            )
        };
        let defects = around(NEIGHBOURHOOD_PX).filter(|(at, _)| marks[*at] != 0).count();
        let (mut sum, mut weights) = (0.0_f32, 0.0_f32);
        for (at, square) in around(NEIGHBOURHOOD_PX).filter(|(at, _)| marks[*at] == 0) {
            // The nearest count most: 1, 1/4, 1/16, 1/25 and 1/64.
            let weight = 1.0 / (square * square) as f32;
            sum += weight * image[at];
            weights += weight;
        }
        let clipped = marks[(y, x)] == Reason::Saturated.code() && sum / weights > HIGHLIGHT * image[(y, x)];
        let value = if clipped { image[(y, x)] } else { sum / weights };
        mended.push(((y, x), if defects <= ALONE && weights > 0.5 { value } else { f32::NAN }));
    }
    for (at, value) in mended {
        image[at] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_pixels_are_replaced_and_patches_become_holes() {
        let mut image = Array2::from_shape_fn((30, 40), |(y, x)| 0.2 + 0.01 * (y + x) as f32);
        image[(10, 10)] = 1.0;
        image.slice_mut(ndarray::s![20..26, 20..26]).fill(1.0);
        image[(3, 3)] = 0.0;
        image.slice_mut(ndarray::s![0..6, 30..36]).fill(0.0);
        image[(15, 5)] = f32::NAN;
        let marks = find(image.view(), Some([0.0, 1.0]), None).unwrap();
        assert_eq!(marks[(10, 10)], Reason::Saturated.code());
        assert_eq!(marks[(15, 5)], Reason::NotFinite.code());
        assert_eq!((marks[(3, 3)], marks[(2, 32)]), (0, Reason::Dark.code()));
        mend(&mut image, &marks);
        assert!((image[(10, 10)] - 0.4).abs() < 1e-3 && (image[(15, 5)] - 0.4).abs() < 1e-3);
        assert!(image[(22, 22)].is_nan() && !image[(18, 18)].is_nan());
    }

    #[test]
    fn a_clipped_highlight_stays_at_its_lower_bound() {
        let mut image = Array2::from_shape_fn((30, 40), |(y, x)| 0.7 + 0.003 * (y + x) as f32);
        image[(10, 10)] = 1.0;
        let marks = find(image.view(), Some([0.0, 1.0]), None).unwrap();
        mend(&mut image, &marks);
        assert_eq!(image[(10, 10)], 1.0);
    }

    #[test]
    fn an_image_clipped_below_its_white_level_is_marked_there() {
        let scene = |y: usize, x: usize| 0.3 + 0.5 * ((y * 7 + x * 13) % 29) as f32 / 29.0;
        let mut image = Array2::from_shape_fn((60, 80), |(y, x)| scene(y, x));
        image.slice_mut(ndarray::s![20..30, 40..55]).fill(0.9);
        image[(5, 5)] = 0.97; // a hot pixel
        for limits in [None, Some([0.0, 1.0])] {
            let marks = find(image.view(), limits, None).unwrap();
            let marked = |at| marks[at] == Reason::Saturated.code();
            assert!(marked((20, 40)) && marked((29, 54)) && !marked((19, 40)));
            assert_eq!(marks.iter().filter(|mark| **mark != 0).count(), 151);
        }
        // Bright and even, but with noise: not clipped.
        image.slice_mut(ndarray::s![20..30, 40..55]).indexed_iter_mut().for_each(|((y, x), value)| {
            *value += 0.002 * ((y * 5 + x * 3) % 4) as f32;
        });
        assert!(find(image.view(), Some([0.0, 1.0]), None).is_none());
    }

    #[test]
    fn a_wild_value_of_a_float_file_is_a_bad_pixel() {
        for (wild, scale) in [(1e6, 1.0), (-9999.0, 1.0), (1e38, 1e30), (1e-20, 1e-28)] {
            let scene = |y: usize, x: usize| scale * (0.3 + ((y * 7 + x * 13) % 29) as f32 / 58.0);
            let mut image = Array2::from_shape_fn((60, 80), |(y, x)| scene(y, x));
            assert!(find(image.view(), None, None).is_none());
            // Bright, but light.
            image[(40, 30)] = 100.0 * scale;
            image[(10, 20)] = wild;
            let marks = find(image.view(), None, None).unwrap();
            assert_eq!(marks.iter().filter(|mark| **mark != 0).count(), 1, "{wild}");
            assert_eq!(marks[(10, 20)], Reason::BadPixel.code(), "{wild}");
            mend(&mut image, &marks);
            assert!(image[(10, 20)] < scale, "{wild}");
        }
        // Black with a few bright pixels.
        let sparse = Array2::from_shape_fn((60, 80), |at| if at == (30, 40) { 5000.0 } else { 0.0 });
        assert!(find(sparse.view(), None, None).is_none());
    }

    #[test]
    fn wild_values_lose_their_pixels_and_bright_spots_stay() {
        let scene = |y: usize, x: usize| 0.3 + ((y * 7 + x * 13) % 29) as f32 / 58.0;
        let mut image = Array2::from_shape_fn((60, 80), |(y, x)| scene(y, x));
        image[(10, 20)] = 1e30;
        image[(40, 30)] = -1e4;
        image[(40, 31)] = 1e4;
        image[(50, 50)] = f32::NAN;
        erase_wild(&mut image);
        assert_eq!(image.iter().filter(|value| value.is_nan()).count(), 4);
        let mut spot = Array2::from_elem((100, 100), 1e-4);
        spot.slice_mut(s![20..23, 30..33]).fill(1.0);
        erase_wild(&mut spot);
        assert!(spot.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn a_whole_image_has_no_marks() {
        let image = Array2::from_elem((20, 20), 0.5_f32);
        assert!(find(image.view(), Some([0.0, 1.0]), None).is_none());
        assert!(find(Array2::from_elem((9, 9), 3.0_f32).view(), None, None).is_none());
    }
}
