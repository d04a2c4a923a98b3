//! Depth from focus with a bright, textured object before a dull wall with a blank disc.

use farnear_depth::focus_stack::{StackMap, StackSettings, depth_from_stack};
use ndarray::{Array2, ArrayView2};

const IMAGES: usize = 12;
const SIZE: (usize, usize) = (80, 160);
/// The object ends at this column.
const EDGE: usize = 60;
const THING: f32 = 3.0;
const WALL: f32 = 8.0;
/// Row, column and radius of the disc; its middle is beyond the measure's reach.
const DISC: [usize; 3] = [40, 115, 14];

fn in_disc(y: usize, x: usize) -> bool {
    let [row, column, radius] = DISC;
    y.abs_diff(row).pow(2) + x.abs_diff(column).pow(2) <= radius * radius
}

/// Texture fades with the distance from its sharpest image, as by blur; every image has its own noise.
fn stack() -> Vec<Array2<f32>> {
    let image = |number: usize| {
        Array2::from_shape_fn(SIZE, |(y, x)| {
            let texture = ((x * 7919 + y * 104_729 + x * y * 31) % 97) as f32 / 97.0 - 0.5;
            let fade = |place: f32| texture * (-0.06 * (number as f32 - place).powi(2)).exp();
            let mixed = ((y * SIZE.1 + x) * IMAGES + number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let noise = 0.004 * ((mixed >> 40) as f32 / (1 << 24) as f32 - 0.5);
            noise
                + match (x < EDGE, in_disc(y, x)) {
                    (true, _) => 0.7 + 0.2 * fade(THING),
                    (false, true) => 0.3,
                    (false, false) => 0.3 + 0.02 * fade(WALL),
                }
        })
    };
    (0..IMAGES).map(image).collect()
}

fn measured(images: &[Array2<f32>], guided_px: f32, min_reliability: f32) -> StackMap {
    let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
    let settings = StackSettings { guided_px, min_reliability, ..StackSettings::default() };
    depth_from_stack(&views, &settings).expect("a stack")
}

fn of_the_wall(map: &StackMap, columns: std::ops::Range<usize>) -> f64 {
    let places: Vec<f32> = map.place.slice(ndarray::s![8..72, columns]).iter().copied().collect();
    places.iter().filter(|place| (**place - WALL).abs() < 0.5).count() as f64 / places.len() as f64
}

#[test]
fn a_thing_does_not_grow_over_the_dull_wall_behind_it() {
    let images = stack();
    let [plain, guided] = [0.0, 10.0].map(|reach| measured(&images, reach, 0.0));
    // Uncorrected, the object reaches to column 65, where the median begins to mix places.
    let strip = EDGE..EDGE + 5;
    assert!(of_the_wall(&plain, strip.clone()) < 0.5, "{}", of_the_wall(&plain, strip));
    assert!(of_the_wall(&guided, strip.clone()) > 0.95, "{}", of_the_wall(&guided, strip));
    assert_eq!(of_the_wall(&guided, 8..EDGE - 1), 0.0, "the thing keeps its own");
    // Beyond the edge's reach everything is bit-identical.
    let away = ndarray::s![8..72, 8..EDGE - 16];
    assert_eq!(plain.place.slice(away), guided.place.slice(away));
    assert_eq!(plain.reliability, guided.reliability, "mending makes nothing more reliable");
}

#[test]
fn a_blank_disc_gets_its_surroundings_place_but_stays_marked_as_not_measured() {
    let images = stack();
    let [row, column, _] = DISC;
    let all = measured(&images, 10.0, 0.0);
    assert!((all.place[(row, column)] - WALL).abs() < 0.5, "{}", all.place[(row, column)]);
    assert!(all.reliability[(row, column)] < 0.1, "{}", all.reliability[(row, column)]);
    let usual = measured(&images, 10.0, StackSettings::default().min_reliability);
    assert!(usual.place[(row, column)].is_nan(), "the command gives it no depth");
}
