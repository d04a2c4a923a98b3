//! A wave-optics lens, which no model of this crate contains, calibrated by its z-stack and tested on other scenes.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use std::{f64::consts::PI, sync::OnceLock};

use crate::common::eight_bit;
use farnear_depth::adaptive_window::Window;
use farnear_depth::calibrate::stack::{Moved, StackLens, StackSettings, calibrate_stack};
use farnear_depth::measure::{DepthMethod, MeasureSettings, measure_pair};
use farnear_depth::pipeline::Settings;
use farnear_scene::wave::{WaveLens, random_texture};
use ndarray::{Array2, s};

const SIZE: [usize; 2] = [208, 160];
/// Defocus on the image side per step of the stage: 0.6 px of blur.
const STEP_UM: f64 = 29.0;
const STEP_MM: f64 = 0.1;
const SLICES: usize = 15;
/// Variance of the noise relative to the mean brightness ([`eight_bit`]).
const NOISE: f64 = 1.19e-4;
const CONTRAST: f64 = 0.2;

fn lens(spherical_waves: f64, astigmatism_waves: f64) -> WaveLens {
    let light = vec![[0.54, 0.5], [0.47, 0.25], [0.61, 0.25]];
    WaveLens { f_number: 4.0, pixel_um: 6.0, light, spherical_waves, astigmatism_waves }
}

/// The slice in focus in the middle, and its change over width and height.
#[derive(Clone, Copy)]
struct Plane([f64; 3]);

impl Plane {
    fn at(self, y: usize, x: usize) -> f64 {
        let [middle, across, down] = self.0;
        middle + across * (x as f64 / SIZE[0] as f64 - 0.5) + down * (y as f64 / SIZE[1] as f64 - 0.5)
    }
}

/// Slice `index` of a surface that is in focus at the slice `focus`, 8 bit, values 0 to 1.
fn slice(
    lens: &WaveLens,
    cells: &Array2<f32>,
    focus: &dyn Fn(usize, usize) -> f64,
    index: usize,
    seed: u64,
) -> Array2<f32> {
    let image = lens.image(cells, &|y, x| best_um(lens) + STEP_UM * (index as f64 - focus(y, x)));
    let part = image.slice(s![..SIZE[1], ..SIZE[0]]).to_owned();
    eight_bit(&part, seed * 1000 + index as u64) / 255.0
}

/// Defocus of the sharpest image: spherical aberration is balanced by defocus of about as many waves.
fn best_um(lens: &WaveLens) -> f64 {
    -lens.spherical_waves * 8.0 * lens.f_number * lens.f_number * lens.light[0][0]
}

const TARGET: Plane = Plane([7.1, 0.7, -0.3]);

/// Stacks and calibrations that several tests take, made once: they take most of the time.
static STACKS: [OnceLock<Vec<Array2<f32>>>; 2] = [const { OnceLock::new() }; 2];
static CALIBRATED: [OnceLock<StackLens>; 2] = [const { OnceLock::new() }; 2];

/// The index of a shared lens: without aberration, or with one wave of spherical aberration.
fn shared(taken: &WaveLens) -> Option<usize> {
    [0.0, 1.0].into_iter().position(|spherical_waves| *taken == lens(spherical_waves, 0.0))
}

fn stack(lens: &WaveLens) -> Vec<Array2<f32>> {
    match shared(lens) {
        Some(index) => STACKS[index].get_or_init(|| drawn(lens)).clone(),
        None => drawn(lens),
    }
}

fn drawn(lens: &WaveLens) -> Vec<Array2<f32>> {
    let cells = random_texture(true, SIZE[0], SIZE[1], CONTRAST, 11);
    (0..SLICES).map(|index| slice(lens, &cells, &|y, x| TARGET.at(y, x), index, 1)).collect()
}

fn settings() -> StackSettings {
    let moved = Moved::Target { object_pixel_um: None, far_mm: None };
    StackSettings { step_mm: STEP_MM, moved, pair_step: None, bin: None, coding: 0.0 }
}

fn calibrated(lens: &WaveLens) -> StackLens {
    let calibrate = || calibrate_stack(&stack(lens), &settings(), &|_| true).unwrap();
    match shared(lens) {
        Some(index) => CALIBRATED[index].get_or_init(calibrate).clone(),
        None => calibrate(),
    }
}

/// A factor on a whole slice changes neither the plane of best focus nor depth: flicker, one bright slice, two exposures.
#[test]
fn the_brightness_of_whole_slices_moves_no_depth() {
    let good = stack(&lens(0.0, 0.0));
    let flicker = [0.8_f32, 0.72, 0.9, 0.8, 0.68, 0.84, 0.92, 0.76, 0.7, 0.8];
    let one_bright = [0.4_f32, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 1.0, 0.4, 0.4, 0.4, 0.4, 0.4];
    for factors in [&flicker[..], &one_bright, &[0.9, 0.36]] {
        unmoved(good.iter().zip(factors.iter().cycle()).map(|(slice, factor)| slice * *factor).collect());
    }
}

/// Without the blocks' brightness the plane is 0.2 slices off.
#[test]
fn vignetting_that_changes_with_focus_moves_no_depth() {
    let mut stack = stack(&lens(0.0, 0.0));
    for (index, slice) in stack.iter_mut().enumerate() {
        let darkening = 0.3 * index as f32 / SLICES as f32;
        for ((y, x), value) in slice.indexed_iter_mut() {
            let [across, down] = [x as f32 / SIZE[0] as f32 - 0.5, y as f32 / SIZE[1] as f32 - 0.5];
            *value *= 1.0 - darkening * 4.0 * (across * across + down * down);
        }
    }
    unmoved(stack);
}

fn unmoved(stack: Vec<Array2<f32>>) {
    let found = calibrate_stack(&stack, &settings(), &|_| true).unwrap();
    let middle = found.plane.at(SIZE[1] as f64 / 2.0, SIZE[0] as f64 / 2.0);
    // As of an even stack; otherwise the plane is 0.55 slices off.
    assert!((middle - TARGET.0[0]).abs() < 0.1, "{middle}");
    assert!((found.held_out.slope - 1.0).abs() < 0.02, "{:?}", found.held_out);
    assert_eq!(found.exchanged, [[0; 2]; 0]);
    assert_eq!((found.wrapped, found.fixed_pattern), (None, None));
}

#[test]
fn exchanged_slices_are_named() {
    for pair in [[5, 6], [5, 7], [4, 7]] {
        let mut stack = stack(&lens(0.0, 0.0));
        stack.swap(pair[0], pair[1]);
        let found = calibrate_stack(&stack, &settings(), &|_| true);
        assert!(
            found.as_ref().is_ok_and(|found| found.exchanged == [pair]),
            "{pair:?}: {:?}",
            found.map(|f| f.exchanged)
        );
    }
}

#[derive(Debug)]
struct Judged {
    rms_mm: f64,
    bound_mm: f64,
    within_three: f64,
    scatter: f64,
    fill: f64,
}

/// Standard deviation of depth at the noise limit in the largest windows of lenses without calibration, 21 px, mm.
fn bound_mm(lens: &WaveLens, [far_um, near_um]: [f64; 2], pair_step: usize, sand: bool) -> f64 {
    const SIDE: usize = 12;
    let frequency = |i: usize| (i as f64 + 0.5) / (2 * SIDE) as f64;
    let cycles: Vec<[f64; 2]> =
        (0..SIDE * SIDE).map(|i| [frequency(i % SIDE), frequency(i / SIDE)]).collect();
    // Alpha changes by 2 over the pair's separation; a nearer surface is in focus at a later slice.
    let per_alpha_um = 0.5 * STEP_UM * pair_step as f64;
    let h = |um: f64| lens.transfer(um, &cycles);
    let delta = 0.02;
    let [far, near] = [h(far_um), h(near_um)];
    let [far_after, near_after] = [far_um, near_um].map(|um| h(um - delta * per_alpha_um));
    let grain = |f: f64| (-(PI * f).powi(2)).exp();
    let fractal = |f: f64| f.max(1.0 / 64.0).powi(-2);
    // Densities over frequencies up to one cycle per pixel.
    let total = |density: &dyn Fn(f64) -> f64| {
        const N: usize = 128;
        let at = |i: usize| (i as f64 + 0.5) / N as f64;
        4.0 * (0..N * N).map(|i| density(at(i % N).hypot(at(i / N)))).sum::<f64>() / (N * N) as f64
    };
    let [of_grain, of_fractal] = [total(&grain), total(&fractal)];
    let power = |f: f64| {
        let parts = if sand { [0.954_f64.powi(2), 0.3_f64.powi(2)] } else { [0.0, 1.0] };
        CONTRAST * CONTRAST * (parts[0] * grain(f) / of_grain + parts[1] * fractal(f) / of_fractal)
    };
    let j: f64 = (0..cycles.len())
        .map(|i| {
            let [h1, h2] = [far[i], near[i]];
            let [d1, d2] = [(far_after[i] - h1) / delta, (near_after[i] - h2) / delta];
            let turn = h1 * d2 - h2 * d1;
            power(cycles[i][0].hypot(cycles[i][1])) * turn * turn / (NOISE * (h1 * h1 + h2 * h2))
        })
        .sum::<f64>()
        / cycles.len() as f64;
    0.5 * STEP_MM * pair_step as f64 / (21.0 * j.sqrt())
}

/// Period of a wavy surface: at its crests a window of 41 px is off by 0.1 of the range.
const WAVE_PX: f64 = 104.0;

#[derive(Clone, Copy)]
struct Surface {
    sand: bool,
    /// Rather than slanted.
    waves: bool,
}

fn judged(lens: &WaveLens, found: &StackLens, scene: Surface) -> Judged {
    let stage = *found.optics.stage().unwrap();
    let (step, bin) = (stage.pair_step, stage.bin);
    assert_eq!(bin, 1, "the lens blurs by 0.6 px per slice");
    let settings = MeasureSettings {
        window: Window::Adaptive,
        run: Settings { median_px: 3, ..Settings::default() },
        ..MeasureSettings::default()
    };
    // Depth is relative: the sharpest slice is a convention of the calibration.
    let zero = found.plane.at(SIZE[1] as f64 / 2.0, SIZE[0] as f64 / 2.0) - TARGET.0[0];
    let half_mm = 0.5 * STEP_MM * step as f64;
    let far_mm = found.optics.working_range().far_mm;
    let [mut squares, mut relative, mut within, mut valid, mut all] = [0.0; 5];
    let mut bounds = Vec::new();
    for (number, alpha) in [-0.6, -0.2, 0.15, 0.55_f64].into_iter().enumerate() {
        let middle = 4.0 + 0.5 * (1.0 + alpha) * step as f64 - zero;
        let plane = Plane([middle, -0.4, 0.5]);
        let waves = |x: usize| {
            let place = 2.0 * PI * x as f64 / WAVE_PX;
            4.0 - zero + 0.5 * step as f64 * (1.0 + 0.7 * (place + 6.0 * alpha).sin())
        };
        let focus = |y: usize, x: usize| if scene.waves { waves(x) } else { plane.at(y, x) };
        let cells = random_texture(scene.sand, SIZE[0], SIZE[1], CONTRAST, 50 + number as u64);
        let pair = [4, 4 + step].map(|index| slice(lens, &cells, &focus, index, 60 + number as u64));
        let map = measure_pair(pair, &found.optics, DepthMethod::Whitened, None, &settings).unwrap();
        let at = |index: usize| best_um(lens) + STEP_UM * (index as f64 - middle);
        bounds.push(bound_mm(lens, [at(4), at(4 + step)], step, scene.sand).powi(2));
        for y in 12..SIZE[1] - 12 {
            for x in 12..SIZE[0] - 12 {
                all += 1.0;
                let depth = f64::from(map.map.depth_mm[(y, x)]);
                if !depth.is_finite() {
                    continue;
                }
                let truth = far_mm - 2.0 * half_mm * (focus(y, x) + zero - 4.0) / step as f64;
                let (error, sd) = (depth - truth, f64::from(map.validity.deviation_mm[(y, x)]));
                valid += 1.0;
                squares += error * error;
                relative += (error / sd).powi(2);
                within += f64::from(u8::from(error.abs() <= 3.0 * sd));
            }
        }
    }
    Judged {
        rms_mm: (squares / valid).sqrt(),
        bound_mm: (bounds.iter().sum::<f64>() / bounds.len() as f64).sqrt(),
        within_three: within / valid,
        scatter: (relative / valid).sqrt(),
        fill: valid / all,
    }
}

/// The target is flat, so that it cannot tell which windows blur relief.
#[test]
fn a_curved_surface_is_measured_honestly_by_a_lens_learned_on_a_flat_one() {
    for (spherical_waves, largest_tolerance, fill) in [(0.0, 0.0, 0.95), (1.0, 0.02, 0.5)] {
        let lens = lens(spherical_waves, 0.0);
        let found = calibrated(&lens);
        // In units of true depth it is 0.038, with which the largest window is taken everywhere.
        let tolerance = found.optics.stage().unwrap().window_tolerance;
        assert!(tolerance <= largest_tolerance, "{tolerance}");
        let judged = judged(&lens, &found, Surface { sand: true, waves: true });
        println!("{spherical_waves} waves: tolerance {tolerance:.4}, {judged:.4?}");
        assert!(judged.within_three > 0.97 && judged.scatter < 1.3 && judged.fill > fill, "{judged:?}");
    }
}

/// Without a correction, windows of 41 px that are cut by the border are off by 2.5 deviations.
#[test]
fn a_slope_reaches_to_the_border() {
    let lens = lens(0.0, 0.0);
    let found = calibrated(&lens);
    let step = found.optics.stage().unwrap().pair_step;
    let plane = Plane([4.0 + 0.5 * step as f64, 0.7 * step as f64, 0.0]);
    let cells = random_texture(true, SIZE[0], SIZE[1], CONTRAST, 50);
    let pair = [4, 4 + step].map(|index| slice(&lens, &cells, &|y, x| plane.at(y, x), index, 60));
    let settings = MeasureSettings { window: Window::Adaptive, ..MeasureSettings::default() };
    let map = measure_pair(pair, &found.optics, DepthMethod::Whitened, None, &settings).unwrap();
    let middle = map.map.depth_mm[(SIZE[1] / 2, SIZE[0] / 2)];
    for columns in [4..12, SIZE[0] - 12..SIZE[0] - 4] {
        let (mut within, mut all) = (0, 0);
        for (y, x) in (20..SIZE[1] - 20).flat_map(|y| columns.clone().map(move |x| (y, x))) {
            let nearer_mm = STEP_MM * (plane.at(y, x) - plane.0[0]);
            let error = f64::from(map.map.depth_mm[(y, x)] - middle) + nearer_mm;
            within += usize::from(error.abs() <= 3.0 * f64::from(map.validity.deviation_mm[(y, x)]));
            all += 1;
        }
        println!("{columns:?}: {within} of {all}");
        assert!(within as f64 > 0.97 * f64::from(all), "{columns:?}: {within} of {all}");
    }
}

/// Steps of the target are equal in depth, also where the range is large against the distance.
#[test]
fn a_near_target_is_measured_in_the_steps_of_the_stage() {
    let lens = lens(0.0, 0.0);
    let moved = Moved::Target { object_pixel_um: None, far_mm: Some(2.0) };
    let found = calibrate_stack(&stack(&lens), &StackSettings { moved, ..settings() }, &|_| true).unwrap();
    let judged = judged(&lens, &found, Surface { sand: true, waves: false });
    // Thin-lens depth of evenly spaced normalised depths would be off by 0.02 mm.
    assert!(judged.rms_mm < 0.003 && judged.within_three > 0.97, "{judged:?}");
}

/// Prints the figures of docs/calibrate-stack.md. `FARNEAR_WAVE_LENSES=all` adds half a wave with astigmatism.
#[test]
fn a_lens_by_wave_optics_is_calibrated_by_its_stack_and_measures_other_scenes_honestly() {
    // Spherical aberration and astigmatism, waves, and the largest RMSE relative to the bound.
    let mut lenses = vec![(0.0, 0.0, 1.2), (1.0, 0.0, 1.8)];
    if std::env::var("FARNEAR_WAVE_LENSES").is_ok_and(|text| text == "all") {
        lenses.push((0.5, 0.15, 1.5));
    }
    for (spherical, astigmatism, largest) in lenses {
        let lens = lens(spherical, astigmatism);
        let found = calibrated(&lens);
        println!(
            "spherical {spherical}, astigmatism {astigmatism}: {} blur {:.2} px, step {}, {:.4?}",
            found.optics.psf(),
            found.optics.max_blur_px(),
            found.optics.stage().unwrap().pair_step,
            found.held_out
        );
        for sand in [true, false] {
            let judged = judged(&lens, &found, Surface { sand, waves: false });
            let of_bound = judged.rms_mm / judged.bound_mm;
            println!("  {} {judged:.4?}, {of_bound:.2} of the bound", if sand { "sand" } else { "fractal" });
            assert!(judged.fill > 0.95 && of_bound < largest, "{spherical} {of_bound} {judged:?}");
            assert!(
                judged.within_three > 0.97 && (0.65..1.3).contains(&judged.scatter),
                "{spherical} {judged:?}"
            );
        }
    }
}
