//! Borders of zeros, which programs that register images leave where an image does not show the scene. Their edge would be the
//! sharpest place of the image.

use ndarray::{Array2, ArrayView1, Axis, s};

/// Least length of a border along an image's side, relative to the side.
const LENGTH: usize = 16;
const LENGTH_PX: usize = 16;
/// A border ends in a straight line: part of its rows or columns that are so close to it. Dark scenes have other outlines.
const STRAIGHT: f64 = 0.9;
const CLOSE_PX: f64 = 1.5;

/// Makes borders of zeros NaN. Returns whether there are any.
pub(super) fn erase(image: &mut Array2<f32>) -> bool {
    let mut found = false;
    for (transposed, reversed) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut image = image.view_mut();
        if transposed {
            image = image.reversed_axes();
        }
        if reversed {
            image.invert_axis(Axis(0));
        }
        let height = image.nrows();
        let zeros = |column: ArrayView1<f32>| {
            column.iter().take_while(|value| **value == 0.0 || value.is_nan()).count()
        };
        let depths: Vec<usize> = image.columns().into_iter().map(zeros).collect();
        let least = (depths.len() / LENGTH).max(LENGTH_PX);
        let mut begin = 0;
        for stretch in depths.chunk_by(|a, b| (*a > 0) == (*b > 0)) {
            if let Some(line) = end_of(stretch, height).filter(|_| stretch[0] > 0 && stretch.len() >= least) {
                for (at, depth) in stretch.iter().enumerate() {
                    // A column of zeros alone is in a border of another side, too.
                    let depth = if *depth < height { *depth } else { line(at).round() as usize };
                    let mut border = image.slice_mut(s![..depth.min(height), begin + at]);
                    found |= border.iter().any(|value| *value == 0.0);
                    border.fill(f32::NAN);
                }
            }
            begin += stretch.len();
        }
    }
    found
}

/// The line on which most of the depths below `height` are, through the medians of their first and last third.
fn end_of(depths: &[usize], height: usize) -> Option<impl Fn(usize) -> f64 + use<>> {
    let ends: Vec<[f64; 2]> = depths
        .iter()
        .enumerate()
        .filter(|(_, depth)| **depth < height)
        .map(|(at, depth)| [at, *depth].map(|value| value as f64))
        .collect();
    if ends.len() < LENGTH_PX {
        return None;
    }
    let third = ends.len() / 3;
    let [from, to] = [&ends[..third], &ends[ends.len() - third..]].map(|part| {
        [0, 1].map(|which| {
            let mut values: Vec<f64> = part.iter().map(|end| end[which]).collect();
            values.sort_by(f64::total_cmp);
            values[third / 2]
        })
    });
    let line = move |at: usize| from[1] + (to[1] - from[1]) * (at as f64 - from[0]) / (to[0] - from[0]);
    let close = ends.iter().filter(|[at, depth]| (depth - line(*at as usize)).abs() <= CLOSE_PX).count();
    (close as f64 >= STRAIGHT * ends.len() as f64).then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn erased(black: impl Fn(usize, usize) -> bool) -> (bool, Array2<bool>) {
        let mut image = Array2::from_shape_fn((120, 160), |(y, x)| if black(y, x) { 0.0 } else { 0.5 });
        (erase(&mut image), image.mapv(f32::is_nan))
    }

    #[test]
    fn borders_of_a_shift_or_a_rotation_are_not_seen() {
        let shifted = |y: usize, x: usize| y < 6 || x >= 130;
        let turned = |y: usize, x: usize| (y as f64) < 9.0 - 0.05 * x as f64 || x < y / 20;
        for black in [&shifted as &dyn Fn(usize, usize) -> bool, &turned] {
            let (found, seen) = erased(black);
            assert!(found);
            let differ = seen.indexed_iter().filter(|((y, x), erased)| black(*y, *x) != **erased).count();
            assert!(differ <= 30, "{differ}");
        }
    }

    #[test]
    fn dark_scenes_and_black_images_are_seen() {
        let noise = |y: usize, x: usize| !(y * 97 + x * 57 + y * x).is_multiple_of(5);
        let blob = |y: usize, x: usize| y < 20 + (x * x * 13 + x) % 17;
        for black in [&noise as &dyn Fn(usize, usize) -> bool, &blob, &|_, _| true, &|_, _| false] {
            let (found, seen) = erased(black);
            assert!(!found && !seen.iter().any(|erased| *erased));
        }
    }
}
