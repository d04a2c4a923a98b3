use farnear_depth::{
    focus_stack::{StackSettings, depth_from_positions},
    prepare::warp::resample,
};

use super::*;

const COUNT: usize = 11;

fn stack() -> Vec<Array2<f32>> {
    let texture = scene(1);
    (0..COUNT)
        .map(|number| {
            let blur = |at: usize| 1 + 2 * number.abs_diff(at);
            let [near, far] = [blur(3), blur(7)].map(|side| mean(&texture, side));
            Array2::from_shape_fn(texture.dim(), |(y, x)| if x < 48 { near[(y, x)] } else { far[(y, x)] })
        })
        .collect()
}

fn scene(seed: u64) -> Array2<f32> {
    Array2::from_shape_fn((72, 96), |(y, x)| {
        let mixed = ((96 * y + x) as u64 + seed * 1_000_003).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        0.3 + 0.4 * (mixed >> 40) as f32 / (1 << 24) as f32
    })
}

fn mean(image: &Array2<f32>, side: usize) -> Array2<f32> {
    let reach = side / 2;
    let (height, width) = image.dim();
    Array2::from_shape_fn(image.dim(), |(y, x)| {
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
        image.slice(s![rows, columns]).mean().unwrap()
    })
}

fn checked(images: &[Array2<f32>], positions: &[f64], model: Option<Model>) -> Frames {
    let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
    check(&views[..], positions, model, &Context::unattended()).unwrap()
}

fn left_out(images: &[Array2<f32>], model: Option<Model>) -> Vec<usize> {
    let positions: Vec<f64> = (0..images.len()).map(|index| index as f64).collect();
    checked(images, &positions, model).left_out.into_iter().map(|(index, _)| index).collect()
}

#[test]
fn a_good_stack_loses_no_frame() {
    assert_eq!(left_out(&stack(), None), [0; 0]);
    assert_eq!(left_out(&stack(), Some(Model::Similarity)), [0; 0]);
}

#[test]
fn a_patch_without_values_condemns_no_frame() {
    for at in [0, 4, COUNT - 1] {
        let mut images = stack();
        images[at].slice_mut(s![30..40, 50..60]).fill(f32::NAN);
        assert_eq!(left_out(&images, None), [0; 0], "{at}");
    }
}

#[test]
fn warns_of_a_breathing_lens_unless_the_images_are_aligned() {
    let positions: Vec<f64> = (0..COUNT).map(|index| index as f64).collect();
    let still = stack();
    assert!(checked(&still, &positions, None).drift_px < 0.5);
    let breathing: Vec<Array2<f32>> = still
        .iter()
        .enumerate()
        .map(|(index, image)| {
            let magnification = 1.0 + 0.01 * (index as f64 - 5.0);
            let warp = Warp::about_middle(image.dim(), magnification, 0.0, [0.0; 2]);
            resample(image.view(), &warp).mapv(|v| if v.is_nan() { 0.5 } else { v })
        })
        .collect();
    let found = checked(&breathing, &positions, None);
    // A corner lies 59 px from the middle; the first and last images differ from the middle one by 5 %.
    assert!((found.drift_px - 0.05 * 59.0).abs() < 0.6, "{}", found.drift_px);
    assert!(
        found.warnings().iter().any(|text| text.contains("--align similarity")),
        "{:?}",
        found.warnings()
    );
    assert!(found.warps.iter().all(|warp| *warp == Warp::IDENTITY));
    assert_eq!(checked(&breathing, &positions, Some(Model::Similarity)).drift_px, 0.0);
}

/// 6 px a step: in place, neighbours have nothing in common.
#[test]
fn warns_of_a_stack_that_moves_far() {
    let positions: Vec<f64> = (0..COUNT).map(|index| index as f64).collect();
    let moved = |(index, image): (usize, &Array2<f32>)| {
        Array2::from_shape_fn(image.dim(), |(y, x)| image[(y, (x + 96 - 6 * index) % 96)])
    };
    let mut images: Vec<Array2<f32>> = stack().iter().enumerate().map(moved).collect();
    for kind in ["good", "with a foreign frame"] {
        let found = checked(&images, &positions, None);
        assert!(found.usual.unwrap() < TELLING, "{kind}: {:?}", found.usual);
        // From the image in the middle to the ends.
        assert!((found.drift_px - 30.0).abs() < 3.0, "{kind}: {}", found.drift_px);
        let warnings = found.warnings();
        assert!(warnings.iter().any(|text| text.contains("--align similarity")), "{kind}: {warnings:?}");
        images[2] = mean(&scene(2), 3);
    }
}

/// As from a hand: also registered, neighbours have little in common.
#[test]
fn warns_of_a_noisy_stack_that_moves_far() {
    let positions: Vec<f64> = (0..COUNT).map(|index| index as f64).collect();
    let moved = |(index, image): (usize, &Array2<f32>)| {
        let noise = scene(100 + index as u64);
        Array2::from_shape_fn(image.dim(), |(y, x)| {
            image[(y, (x + 96 - 6 * index) % 96)] + 0.35 * (noise[(y, x)] - 0.5)
        })
    };
    let images: Vec<Array2<f32>> = stack().iter().enumerate().map(moved).collect();
    let aligned = checked(&images, &positions, Some(Model::Similarity));
    assert!(aligned.usual.unwrap() < TELLING, "{:?}", aligned.usual);
    let drift_px = checked(&images, &positions, None).drift_px;
    assert!((drift_px - 30.0).abs() < 4.0, "{drift_px}");
    let unrelated: Vec<Array2<f32>> = (0..7).map(|seed| mean(&scene(seed), 3)).collect();
    assert_eq!(checked(&unrelated, &positions[..7], None).drift_px, 0.0);
}

#[test]
fn finds_a_foreign_or_turned_frame_at_any_place() {
    for at in [0, 1, 4, COUNT / 2, COUNT - 2, COUNT - 1] {
        for model in [None, Some(Model::Similarity)] {
            let found = |images: &[Array2<f32>], what: &str| {
                assert_eq!(left_out(images, model), [at], "{what}, {model:?}");
            };
            let mut images = stack();
            images[at] = mean(&scene(2), 3);
            found(&images, "foreign");
            let mut images = stack();
            images[at] = images[at].slice(s![..;-1, ..;-1]).to_owned();
            found(&images, "turned");
        }
    }
}

/// Nothing but coarse texture is left in the last frame, below its noise in detail.
#[test]
fn a_last_frame_far_out_of_focus_is_kept_unless_it_is_foreign() {
    let texture = |seed: u64| {
        let scenes = [seed, seed + 1, seed + 2, seed + 3].map(scene);
        Array2::from_shape_fn((216, 288), |(y, x)| {
            scenes.iter().enumerate().map(|(k, scene)| scene[((y >> k) % 72, (x >> k) % 96)]).sum::<f32>()
                / 4.0
        })
    };
    let image = |texture: &Array2<f32>, number: usize, side: usize| {
        let noise = scene(100 + number as u64);
        let blurred = mean(&mean(texture, side), side);
        Array2::from_shape_fn(texture.dim(), |(y, x)| blurred[(y, x)] + 0.1 * (noise[(y % 72, x % 96)] - 0.5))
    };
    let own = texture(1);
    let mut images: Vec<Array2<f32>> =
        [5, 3, 1, 3, 5, 9, 15].iter().enumerate().map(|(number, side)| image(&own, number, *side)).collect();
    assert_eq!(left_out(&images, None), [0; 0]);
    let longer: Vec<_> = images.iter().cloned().chain([7, 8].map(|number| image(&own, number, 15))).collect();
    assert_eq!(left_out(&longer, None), [0; 0]);
    images[6] = image(&texture(21), 6, 15);
    assert_eq!(left_out(&images, None), [6]);
    // In the round field of a microscope, whose outline all images share.
    let mut in_field: Vec<Array2<f32>> = images[..6].to_vec();
    in_field.push(image(&texture(21), 6, 5));
    for image in &mut in_field {
        for ((y, x), value) in image.indexed_iter_mut() {
            let away = (y as f32 - 108.0).hypot(x as f32 - 144.0);
            *value /= 1.0 + ((away - 90.0) / 8.0).exp();
        }
    }
    assert_eq!(left_out(&in_field, None), [6]);
}

#[test]
fn finds_a_shaken_frame() {
    for at in [2, 5, 8] {
        let mut images = stack();
        let still = images[at].clone();
        images[at] = Array2::from_shape_fn(still.dim(), |(y, x)| {
            let columns = x.saturating_sub(6)..(x + 7).min(96);
            let rows = y.saturating_sub(1)..(y + 2).min(72);
            still.slice(s![rows, columns]).mean().unwrap()
        });
        assert_eq!(left_out(&images, None), [at]);
    }
}

#[test]
fn images_without_texture_are_not_judged() {
    let images: Vec<_> = (0..7).map(|seed| scene(seed).mapv(|v| 0.5 + 0.01 * v)).collect();
    assert_eq!(left_out(&images, None), [0; 0]);
}

/// A tilted plane with a step, in images: 2.5 to 12 in a stack of 15.
fn depth_at(y: usize, x: usize) -> f32 {
    2.5 + 5.0 * x as f32 / 95.0 + 2.0 * y as f32 / 71.0 + if x > 60 { 2.5 } else { 0.0 }
}

const TRUE_COUNT: usize = 15;

/// A stack of a blur that grows by 0.45 px, standard deviation, per position.
fn true_stack(positions: &[f64]) -> Vec<Array2<f32>> {
    rendered(positions, 0.45, 1.0)
}

/// Blurred by passes of (1 2 1) / 4, as many as their variance, half a pixel squared, makes of a blur that grows by `slope` px per
/// position; depths times `scale`.
fn rendered(positions: &[f64], slope: f32, scale: f32) -> Vec<Array2<f32>> {
    let passes = |depth: f32, position: f64| 2.0 * (slope * (scale * depth - position as f32)).powi(2);
    let most = positions.iter().flat_map(|position| [2.5, 12.0].map(|depth| passes(depth, *position)));
    let most = most.fold(0.0, f32::max) as usize;
    let mut blurred = vec![scene(1)];
    while blurred.len() < most + 2 {
        let next = smoothed(&blurred[blurred.len() - 1]);
        blurred.push(next);
    }
    let image = |(index, position): (usize, &f64)| {
        let noise = scene(100 + index as u64);
        Array2::from_shape_fn(noise.dim(), |(y, x)| {
            let passes = passes(depth_at(y, x), *position);
            let below = passes as usize;
            let part = passes - below as f32;
            let value = (1.0 - part) * blurred[below][(y, x)] + part * blurred[below + 1][(y, x)];
            value + 0.01 * (noise[(y, x)] - 0.5)
        })
    };
    positions.iter().enumerate().map(image).collect()
}

fn even_positions() -> Vec<f64> {
    (0..TRUE_COUNT).map(|index| index as f64).collect()
}

fn smoothed(image: &Array2<f32>) -> Array2<f32> {
    let (height, width) = image.dim();
    let row = |y: usize, x: usize| {
        0.25 * image[(y, x.saturating_sub(1))]
            + 0.5 * image[(y, x)]
            + 0.25 * image[(y, (x + 1).min(width - 1))]
    };
    Array2::from_shape_fn(image.dim(), |(y, x)| {
        0.25 * row(y.saturating_sub(1), x) + 0.5 * row(y, x) + 0.25 * row((y + 1).min(height - 1), x)
    })
}

/// Root mean square error in images and the part of the pixels with a depth, without some frames.
fn error(images: &[Array2<f32>], out: Vec<usize>) -> (f64, f64, Vec<usize>) {
    error_at(images, &even_positions(), out)
}

fn error_at(images: &[Array2<f32>], at: &[f64], out: Vec<usize>) -> (f64, f64, Vec<usize>) {
    let kept: Vec<usize> = (0..images.len()).filter(|index| !out.contains(index)).collect();
    let views: Vec<ArrayView2<f32>> = kept.iter().map(|index| images[*index].view()).collect();
    let positions: Vec<f64> = kept.iter().map(|index| at[*index]).collect();
    let map = depth_from_positions(&views[..], &positions, &StackSettings::default()).unwrap();
    let (mut sum, mut known) = (0.0, 0.0);
    for ((y, x), place) in map.place.indexed_iter().filter(|(_, place)| place.is_finite()) {
        let below = (*place as usize).min(kept.len() - 2);
        let depth =
            positions[below] + f64::from(*place - below as f32) * (positions[below + 1] - positions[below]);
        sum += (depth - f64::from(depth_at(y, x))).powi(2);
        known += 1.0;
    }
    ((sum / known).sqrt(), known / map.place.len() as f64, out)
}

#[test]
fn uneven_positions_cost_at_most_a_tenth_of_the_error() {
    let (even, ..) = error(&true_stack(&even_positions()), Vec::new());
    let last = TRUE_COUNT as f64 - 1.0;
    // Steps of 0.4 and 1.6, and steps that grow from 0.5 to 1.5.
    let alternating = |index: f64| index - 0.3 * (1.0 - (std::f64::consts::PI * index).cos());
    let growing = |index: f64| 0.5 * index + 0.5 * index * index / last;
    for uneven in [&alternating as &dyn Fn(f64) -> f64, &growing] {
        let positions: Vec<f64> = (0..TRUE_COUNT).map(|index| uneven(index as f64)).collect();
        let (found, known, _) = error_at(&true_stack(&positions), &positions, Vec::new());
        assert!(found < 1.1 * even && known > 0.98, "{found} {even} {known}");
    }
}

#[test]
fn a_bad_frame_at_any_place_costs_no_more_than_its_absence() {
    let good = true_stack(&even_positions());
    let (clean, known, out) = error(&good, left_out(&good, None));
    assert!(clean < 0.3 && known > 0.98 && out.is_empty(), "{clean} {known} {out:?}");
    for at in 0..TRUE_COUNT {
        let (absent, ..) = error(&good, vec![at]);
        assert!(absent < 1.05 * clean, "{at}: {absent} {clean}");
        for (kind, bad) in bad_frames(&good[at]) {
            let mut images = good.clone();
            images[at] = bad;
            let (found, known, out) = error(&images, left_out(&images, None));
            assert!(found < 1.05 * clean.max(absent) && known > 0.98, "{kind} {at}: {found} {known}");
            assert_eq!(out, [at], "{kind} {at}");
        }
    }
}

fn bad_frames(still: &Array2<f32>) -> [(&'static str, Array2<f32>); 4] {
    let row = |y: usize, x: usize| still.slice(s![y, x.saturating_sub(5)..(x + 6).min(96)]);
    [
        ("foreign", mean(&scene(2), 3)),
        ("turned", still.slice(s![..;-1, ..;-1]).to_owned()),
        ("shaken", Array2::from_shape_fn(still.dim(), |(y, x)| row(y, x).mean().unwrap())),
        ("defocused", (0..40).fold(still.clone(), |image, _| smoothed(&image))),
    ]
}

/// Steps of one and three times the depth of field.
#[test]
fn no_good_frame_of_a_coarse_stack_is_left_out() {
    for (slope, count) in [(1.0, 7), (3.0, 6)] {
        let positions: Vec<f64> = (0..count).map(f64::from).collect();
        let good = rendered(&positions, slope, (count - 1) as f32 / (TRUE_COUNT - 1) as f32);
        let found = checked(&good, &positions, None);
        assert!(found.left_out.is_empty(), "{slope}: {:?}", found.left_out);
        assert_eq!(!found.warnings().is_empty(), slope > 1.0, "{slope}: {:?}", found.warnings());
        for at in 0..good.len() {
            for (kind, bad) in bad_frames(&good[at]) {
                let mut images = good.clone();
                images[at] = bad;
                let out = left_out(&images, None);
                assert!(out.iter().all(|index| *index == at), "{slope} {kind} {at}: {out:?}");
                let certain = slope == 1.0 && ["foreign", "turned"].contains(&kind);
                assert!(!(certain && out.is_empty()), "{slope} {kind} {at}");
            }
        }
    }
}

#[test]
fn flicker_costs_nothing() {
    let good = true_stack(&even_positions());
    let (clean, ..) = error(&good, Vec::new());
    let factors = [1.0, 1.1, 0.85, 1.0, 1.25, 0.9, 1.0, 0.8];
    let flickering = || good.iter().zip(factors.iter().cycle()).map(|(image, factor)| image * *factor);
    let images: Vec<Array2<f32>> = flickering().collect();
    assert_eq!(left_out(&images, None), [0; 0]);
    let (untreated, ..) = error(&images, Vec::new());
    let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
    let uncompared = gains(&views[..]).unwrap();
    assert_eq!(checked(&images, &even_positions(), None).gains, uncompared, "as by --use-all");
    let context = Context::unattended();
    let prepared = super::super::prepare_stack(images, 0.0, even_positions(), None, false, &context).unwrap();
    assert_eq!(prepared.left_out, [0; 0]);
    let (found, known, _) = error(&prepared.images, Vec::new());
    assert!(untreated > 1.1 * clean, "{untreated} {clean}: the factors must matter");
    assert!(found < 1.05 * clean && known > 0.98, "{found} {clean} {known}");
}

/// A bright image, exposures that alternate and a lamp that grows, under the same noise.
#[test]
fn exposures_of_any_factor_cost_nothing() {
    let good = true_stack(&even_positions());
    let (clean, ..) = error(&good, Vec::new());
    let exposures: [fn(usize) -> f32; 3] = [
        |index| if index == 7 { 2.5 } else { 1.0 },
        |index| [1.0, 0.3][index % 2],
        |index| 10.0_f32.powf(index as f32 / 14.0) / 3.0,
    ];
    for (number, exposure) in exposures.iter().enumerate() {
        let exposed = |(index, image): (usize, &Array2<f32>)| {
            let noise = scene(200 + index as u64);
            Array2::from_shape_fn(image.dim(), |at| exposure(index) * image[at] + 0.03 * (noise[at] - 0.5))
        };
        let images: Vec<Array2<f32>> = good.iter().enumerate().map(exposed).collect();
        let context = Context::unattended();
        let prepared =
            super::super::prepare_stack(images, 0.0, even_positions(), None, false, &context).unwrap();
        assert_eq!(prepared.left_out, [0; 0], "{number}: {:?}", prepared.warnings);
        let (found, known, _) = error(&prepared.images, Vec::new());
        assert!(found < 1.05 * clean && known > 0.98, "{number}: {found} {clean} {known}");
    }
}

#[test]
fn exchanged_images_are_named() {
    let good = true_stack(&even_positions());
    assert_eq!(checked(&good, &even_positions(), None).exchanged, [[0; 2]; 0]);
    let mut reasons = Vec::new();
    for pair in [[5, 7], [6, 9], [5, 9], [7, 8]] {
        let mut images = good.clone();
        images.swap(pair[0], pair[1]);
        let found = checked(&images, &even_positions(), None);
        assert_eq!(found.exchanged, [pair]);
        reasons.extend(found.left_out.into_iter().map(|(_, reason)| reason));
        // Numbers count all images.
        images[2] = mean(&scene(2), 3);
        let found = checked(&images, &even_positions(), None);
        assert_eq!(found.exchanged, [pair], "{:?}", found.left_out);
    }
    assert!(!reasons.is_empty() && reasons.iter().all(|reason| reason.contains("exchanged")), "{reasons:?}");
}

#[test]
fn a_moved_frame_is_left_out_as_such_and_kept_if_aligned() {
    for at in [0, COUNT - 1] {
        let mut images = stack();
        let still = images[at].clone();
        images[at] = Array2::from_shape_fn(still.dim(), |(y, x)| still[(y, (x + 8) % 96)]);
        let found = checked(&images, &(0..COUNT).map(|index| index as f64).collect::<Vec<_>>(), None);
        let [(index, reason)] = &found.left_out[..] else { panic!("{at}: {:?}", found.left_out) };
        assert!(*index == at && reason.contains("--align similarity keeps it"), "{at}: {reason}");
        assert_eq!(left_out(&images, Some(Model::Similarity)), [0; 0]);
    }
}

#[test]
fn a_wrapped_stack_is_named_and_loses_no_image() {
    for first in [3, 8, 12] {
        let mut images = true_stack(&even_positions());
        images.rotate_right(first);
        let found = checked(&images, &even_positions(), None);
        assert_eq!((found.wrapped, &found.left_out[..]), (Some(first), &[][..]));
        let remarks = found.remarks(|index| format!("{index}.png"));
        assert!(
            remarks.iter().any(|remark| remark.contains(&format!("begins with {first}.png"))),
            "{remarks:?}"
        );
    }
}

#[test]
fn an_all_in_focus_picture_is_left_out_at_any_place() {
    let good = true_stack(&even_positions());
    let positions: Vec<f64> = (0..=TRUE_COUNT).map(|index| index as f64).collect();
    for at in [0, 7, TRUE_COUNT] {
        let mut images = good.clone();
        images.insert(at, scene(1));
        let found = checked(&images, &positions, None);
        let [(index, reason)] = &found.left_out[..] else { panic!("{at}: {:?}", found.left_out) };
        assert!(*index == at && reason.contains("all-in-focus"), "{at}: {index} {reason}");
        assert_eq!((found.warps.len(), found.gains.len()), (images.len(), images.len()));
    }
}

#[test]
fn numbers_count_all_images_also_an_all_in_focus_picture() {
    let mut images = true_stack(&even_positions());
    images.swap(5, 7);
    images.insert(2, scene(1));
    let positions: Vec<f64> = (0..=TRUE_COUNT).map(|index| index as f64).collect();
    assert_eq!(checked(&images, &positions, None).exchanged, [[6, 8]]);
}
