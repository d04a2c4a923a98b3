//! Black borders, which programs that register images leave where an image does not show the scene. Their edge would be the
//! sharpest place of the image. JPEG adds some codes to their zeros.

use ndarray::{Array2, ArrayBase, ArrayView1, ArrayView2, Axis, Ix2, RawData, s};

/// Least length of a border along an image's side, relative to the side.
const LENGTH: usize = 16;
const LENGTH_PX: usize = 16;
/// A stretch of dark pixels of at most this depth always ends in a straight line: a border is then half as long as the side.
const SHALLOW_PX: f64 = 3.0;
/// A border ends in a straight line: part of its rows or columns that are so close to it. In the borders of eight stacks it was
/// 0.76 or more, in dark scenes 0.24 or less.
const STRAIGHT: f64 = 0.7;
const CLOSE_PX: f64 = 1.5;
/// Largest code of a border of 8 bits: JPEG of usual quality left up to 5 in public stacks.
const BLACK: f32 = 8.0;
/// Largest step of the codes that count.
const CODE_STEP: f32 = 1.0 / 255.0;

/// Next to the border of a registration the second pixel has at least half of the brightness of those behind it. The edge of an
/// object in front of black is defocused in most images.
const HALF: f32 = 0.5;
const BEYOND_PX: usize = 12;
/// Borders of a registration move from image to image by more than this. The edge of an object in focus moved by at most 1 px: a
/// little defocus lights the pixels in front of it.
const STILL_PX: usize = 3;

/// Above, below, left and right.
pub(super) type Sides = [bool; 4];

/// Black borders of an image.
pub(super) type Borders = [Option<Border>; 4];

#[derive(Clone, Copy, Debug)]
pub(super) struct Border {
    deepest_px: usize,
    /// Whether the image has its brightness next to the border.
    is_abrupt: bool,
}

const SIDES: [(bool, bool); 4] = [(false, false), (false, true), (true, false), (true, true)];

/// The image as seen from a side: its border is above.
fn from_side<S: RawData>(
    mut image: ArrayBase<S, Ix2>,
    (transposed, reversed): (bool, bool),
) -> ArrayBase<S, Ix2> {
    if transposed {
        image = image.reversed_axes();
    }
    if reversed {
        image.invert_axis(Axis(0));
    }
    image
}

/// Sides on which black borders come from registration, from those of each image. One that all images have is the scene's if
/// it is gradual in most, or in the same place where it is not.
pub(super) fn of_registration(images: &[Borders]) -> Sides {
    std::array::from_fn(|side| {
        let abrupt = images.iter().filter_map(|sides| sides[side]).filter(|border| border.is_abrupt);
        let depths: Vec<usize> = abrupt.map(|border| border.deepest_px).collect();
        let moves =
            depths.iter().max().zip(depths.iter().min()).is_some_and(|(most, least)| most - least > STILL_PX);
        images.iter().any(|sides| sides[side].is_none()) || (moves && 2 * depths.len() > images.len())
    })
}

/// Black borders. `code_step` is that of integers from 0 to 1, and 0 for floats, whose borders are zeros.
pub(super) fn of_image(image: &Array2<f32>, code_step: f32) -> Borders {
    SIDES.map(|side| {
        let image = from_side(image.view(), side);
        let borders = borders(image, code_step);
        let abrupt = borders.iter().filter(|(column, depth)| {
            let column = image.column(*column);
            let mut beyond = column.iter().skip(depth + 1).take(BEYOND_PX);
            beyond.next().is_some_and(|second| *second >= HALF * beyond.sum::<f32>() / (BEYOND_PX - 1) as f32)
        });
        let is_abrupt = 2 * abrupt.count() > borders.len();
        let deepest_px = borders.iter().map(|(_, depth)| *depth).max();
        deepest_px.map(|deepest_px| Border { deepest_px, is_abrupt })
    })
}

/// Makes black borders on these sides NaN. Returns whether there are any.
pub(super) fn erase(image: &mut Array2<f32>, code_step: f32, sides: Sides) -> bool {
    let mut found = false;
    for (side, _) in SIDES.into_iter().zip(sides).filter(|(_, erased)| *erased) {
        let mut image = from_side(image.view_mut(), side);
        for (column, depth) in borders(image.view(), code_step) {
            let mut border = image.slice_mut(s![..depth, column]);
            found |= border.iter().any(|value| value.is_finite());
            border.fill(f32::NAN);
        }
    }
    found
}

/// Columns with a black border above, and how far it reaches.
fn borders(image: ArrayView2<f32>, code_step: f32) -> Vec<(usize, usize)> {
    // Half a code for rounding.
    let darkest = (BLACK + 0.5) * code_step.min(CODE_STEP);
    let is_black = |value: &f32| value.abs() <= darkest || value.is_nan();
    let height = image.nrows();
    let black = |column: ArrayView1<f32>| column.iter().take_while(|value| is_black(value)).count();
    let depths: Vec<usize> = image.columns().into_iter().map(black).collect();
    let (mut begin, mut found) = (0, Vec::new());
    for stretch in depths.chunk_by(|a, b| (*a > 0) == (*b > 0)) {
        let is_long = |line: &dyn Fn(usize) -> f64| {
            let deepest = line(0).max(line(stretch.len() - 1));
            let part = if deepest > SHALLOW_PX { LENGTH } else { 2 };
            stretch.len() >= (depths.len() / part).max(LENGTH_PX)
        };
        if let Some(line) = end_of(stretch, height).filter(|line| stretch[0] > 0 && is_long(line)) {
            // A deeper column is in a border of another side, or black in the scene, too.
            let reach = |at: usize, depth: usize| depth.min(line(at).round() as usize + 1);
            found.extend(stretch.iter().enumerate().map(|(at, depth)| (begin + at, reach(at, *depth))));
        }
        begin += stretch.len();
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

    /// Black is 0 to 8 codes, as JPEG leaves it; without codes it is 0.
    fn erased(black: impl Fn(usize, usize) -> bool, code_step: f32) -> (bool, Array2<bool>) {
        let dark = |y: usize, x: usize| ((y * 31 + x * 17 + y * x) % 9) as f32 * code_step;
        let mut image =
            Array2::from_shape_fn((120, 160), |(y, x)| if black(y, x) { dark(y, x) } else { 0.5 });
        let expected = of_image(&image, code_step);
        let found = erase(&mut image, code_step, [true; 4]);
        assert_eq!(found, expected.iter().any(Option::is_some));
        (found, image.mapv(f32::is_nan))
    }

    const CODE_STEPS: [f32; 3] = [0.0, 1.0 / 65535.0, CODE_STEP];

    #[test]
    fn borders_of_a_shift_or_a_rotation_are_not_seen() {
        let shifted = |y: usize, x: usize| y < 6 || x >= 130;
        let turned = |y: usize, x: usize| (y as f64) < 9.0 - 0.05 * x as f64 || x < y / 20;
        for (black, code_step) in [&shifted as &dyn Fn(usize, usize) -> bool, &turned]
            .into_iter()
            .flat_map(|black| CODE_STEPS.map(|code_step| (black, code_step)))
        {
            let (found, seen) = erased(black, code_step);
            assert!(found, "{code_step}");
            let differ = seen.indexed_iter().filter(|((y, x), erased)| black(*y, *x) != **erased).count();
            assert!(differ <= 30, "{code_step}: {differ}");
        }
    }

    /// The rows at the ends of the right border lie in those above and below.
    #[test]
    fn borders_on_all_sides_of_a_turned_image_are_not_seen() {
        let turned = |y: usize, x: usize| {
            let (right, down) = (x as f64 + 0.1 * y as f64, y as f64 - 0.1 * x as f64);
            !(16.0..=150.0).contains(&right) || !(2.0..=104.0).contains(&down)
        };
        let (found, seen) = erased(turned, CODE_STEP);
        let missed = seen.indexed_iter().filter(|((y, x), erased)| turned(*y, *x) && !**erased).count();
        assert!(found && missed <= 30, "{missed}");
    }

    /// The border of a scene that is black next to it.
    #[test]
    fn only_the_border_of_a_black_part_is_not_seen() {
        let black = |y: usize, x: usize| y < 6 || (x / 10 == 7 && y < 60);
        let (found, seen) = erased(black, CODE_STEP);
        assert!(found && seen[(5, 75)] && !seen[(9, 75)]);
    }

    #[test]
    fn dark_scenes_and_black_images_are_seen() {
        let noise = |y: usize, x: usize| !(y * 97 + x * 57 + y * x).is_multiple_of(5);
        let blob = |y: usize, x: usize| y < 20 + (x * x * 13 + x) % 17;
        for code_step in CODE_STEPS {
            for black in [&noise as &dyn Fn(usize, usize) -> bool, &blob, &|_, _| true, &|_, _| false] {
                let (found, seen) = erased(black, code_step);
                assert!(!found && !seen.iter().any(|erased| *erased), "{code_step}");
            }
        }
    }

    /// Noise about black at the edges of a microscope's image; a border of one pixel.
    #[test]
    fn dark_stretches_of_few_pixels_are_seen_and_narrow_borders_are_not() {
        let stretches = |y: usize, x: usize| y < 1 + x % 2 && x % 60 < 40;
        let narrow = |y: usize, _: usize| y < 1;
        assert_eq!([erased(stretches, CODE_STEP).0, erased(narrow, CODE_STEP).0], [false, true]);
    }

    /// A straight object on a black background, and registered images none of which is whole.
    #[test]
    fn a_gradual_or_still_border_that_all_images_have_is_the_scenes() {
        let image = |left: usize, right: usize, blur: f32| {
            let ramp = |x: usize| (0.5 * (x as f32 - left as f32) / blur).clamp(0.0, 0.5);
            Array2::from_shape_fn((120, 160), |(_, x)| if x < 160 - right { ramp(x + 1) } else { 0.0 })
        };
        let of = |images: &[Array2<f32>]| {
            let found: Vec<Borders> = images.iter().map(|image| of_image(image, CODE_STEP)).collect();
            (of_registration(&found), found)
        };
        let mut images = [image(20, 0, 25.0), image(25, 7, 1.0), image(22, 0, 40.0)];
        let (erased, found) = of(&images);
        assert!(!erased[2] && erased[3], "{found:?}");
        let bordered: Vec<bool> = images.iter_mut().map(|image| erase(image, CODE_STEP, erased)).collect();
        assert_eq!(bordered, [false, true, false]);
        assert!(images[1][(50, 5)] == 0.0 && images[1][(50, 155)].is_nan());
        let registered = [image(20, 0, 1.0), image(25, 0, 1.0), image(22, 0, 2.0)];
        assert!(of(&registered).0[2]);
        let focused = [image(20, 0, 1.0), image(19, 0, 2.0), image(20, 0, 1.0), image(12, 0, 40.0)];
        assert!(!of(&focused).0[2], "an object in focus in most images");
    }
}
