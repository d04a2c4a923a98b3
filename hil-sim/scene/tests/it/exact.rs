//! The renderer compared with independent ray casting. Differences are relative to the mean radiance; one
//! 8-bit code is 8.7e-3. The ray caster's own error is 1e-4 RMS on planes and 3 to 6e-4 on slopes.

#![allow(clippy::unwrap_used, reason = "a test's helpers fail by panicking, as the tests do")]

use crate::{
    ray_caster::{RayCaster, radial_quantiles, scene_blur},
    thesis_lens,
};
use farnear_scene::{Camera, EllipticalDistortion, Lens, Noise, Picture, Psf, Renderer, Scene, Texture};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The hardest texture: mean 1, SD 0.2, uncorrelated.
fn noise(camera: &Camera) -> Array2<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let half_width = 0.2 * 3f32.sqrt();
    let mut texture = Array2::from_shape_fn((2 * camera.height_px, 2 * camera.width_px), |_| {
        random.random_range(1.0 - half_width..1.0 + half_width)
    });
    let mean = texture.mean().unwrap();
    texture.mapv_inplace(|value| value / mean);
    texture
}

struct Check<'a> {
    scene: &'a str,
    psf: &'a str,
    lens: &'a Lens,
    camera: &'a Camera,
    sensor_mm: f64,
}

impl Check<'_> {
    fn difference(&self, pixels: &[(usize, usize)], rays: u32) -> (f64, f64) {
        let Self { lens, camera, sensor_mm, .. } = *self;
        let texture = noise(camera);
        let mut scene: Scene = self.scene.parse().unwrap();
        scene.texture = Texture::Picture(Picture::new(texture.clone()).unwrap());
        let psf: Psf = self.psf.parse().unwrap();
        let image = Renderer::new(&scene, lens, &psf, camera, 0).unwrap().radiance(sensor_mm).unwrap();

        let blur_px = scene_blur(&scene, lens, camera, sensor_mm);
        // All cells that a ray can reach.
        let (rows, columns) = (camera.height_px as i64, camera.width_px as i64);
        let places = (-40..rows + 40).flat_map(|y| (-40..columns + 40).map(move |x| (x as f64, y as f64)));
        let range_px = places.fold((f64::MAX, f64::MIN), |(low, high), (x, y)| {
            let blur = blur_px(x, y);
            (low.min(blur), high.max(blur))
        });
        let caster =
            RayCaster { blur_px, range_px, texture: &texture, radial_quantiles: radial_quantiles(&psf) };
        let differences: Vec<f64> = pixels
            .iter()
            .map(|&(row, column)| f64::from(image[[row, column]]) - caster.pixel(row, column, rays))
            .collect();
        let rms = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
        let largest = differences.iter().fold(0.0, |largest: f64, d| largest.max(d.abs()));
        println!("{} {psf} sensor {sensor_mm:.4}: rms {rms:.2e} largest {largest:.2e}", self.scene);
        (rms, largest)
    }
}

const PSFS: [&str; 3] = ["pillbox", "gaussian:k=0.4578", "generalised:p=1.8,k=0.4802"];

/// Low-discrepancy pixels over the image, corners first.
fn spread(camera: &Camera, count: usize) -> Vec<(usize, usize)> {
    let (last_row, last_column) = (camera.height_px - 1, camera.width_px - 1);
    let mut pixels = vec![(0, 0), (0, last_column), (last_row, 0), (last_row, last_column)];
    pixels.extend((1..=count - 4).map(|i| {
        let (u, v) = ((i as f64 * 0.754_877_666).fract(), (i as f64 * 0.569_840_291).fract());
        ((u * camera.height_px as f64) as usize, (v * camera.width_px as f64) as usize)
    }));
    pixels
}

#[test]
fn planes_are_exact_at_any_sensor_position_up_to_the_border() {
    let (lens, camera) = (thesis_lens(), Camera::new(24, 16, Noise::None));
    for psf in PSFS {
        // In focus, at the other setting, in between, and six pixels of blur before near focus.
        for (depth, beyond_far_mm) in [(933.0, 0.0), (933.0, 0.15627), (902.3, 0.1), (886.81, -0.2)] {
            let sensor_mm = lens.sensor_far_mm + beyond_far_mm;
            let check =
                Check { scene: &format!("plane:{depth}"), psf, lens: &lens, camera: &camera, sensor_mm };
            let (rms, _) = check.difference(&spread(&camera, 8), 400_000);
            assert!(rms < 2e-4, "{rms}");
        }
    }
}

#[test]
fn slopes_are_exact_to_a_thousandth() {
    let (lens, camera) = (thesis_lens(), Camera::default());
    for psf in PSFS {
        for (scene, sensor_mm) in
            [("slant", lens.sensor_far_mm), ("cone", lens.sensor_near_mm), ("sphere", lens.sensor_near_mm)]
        {
            let (rms, _) = Check { scene, psf, lens: &lens, camera: &camera, sensor_mm }
                .difference(&spread(&camera, 12), 30_000);
            assert!(rms < 8e-4, "{rms}");
        }
    }
}

#[test]
fn the_distorted_field_is_exact_to_a_thousandth() {
    let lens = thesis_lens().with_distortion(EllipticalDistortion::default());
    let camera = Camera::default();
    let check = Check {
        scene: "plane:909.29",
        psf: PSFS[1],
        lens: &lens,
        camera: &camera,
        sensor_mm: lens.sensor_far_mm,
    };
    let (rms, _) = check.difference(&spread(&camera, 12), 30_000);
    assert!(rms < 8e-4, "{rms}");
}

#[test]
fn a_steep_cone_stays_within_half_a_percent() {
    // The whole range within twelve pixels, 0.11 px of blur per pixel: forty times steeper than in a full
    // image.
    let (lens, camera) = (thesis_lens(), Camera::new(48, 32, Noise::None));
    for psf in PSFS {
        let check = Check { scene: "cone", psf, lens: &lens, camera: &camera, sensor_mm: lens.sensor_far_mm };
        let (rms, largest) = check.difference(&spread(&camera, 20), 20_000);
        assert!(rms < 2e-3 && largest < 6e-3, "{rms} {largest}");
    }
}

#[test]
fn depth_steps_are_exact_away_from_the_edge_and_close_at_it() {
    // The whole range in one step: one side sharp, the other blurred by 2.7 px.
    let (lens, camera) = (thesis_lens(), Camera::new(40, 16, Noise::None));
    for psf in PSFS {
        for sensor_mm in
            [lens.sensor_far_mm, 0.5 * (lens.sensor_far_mm + lens.sensor_near_mm), lens.sensor_near_mm]
        {
            let check = Check { scene: "staircase,steps=2", psf, lens: &lens, camera: &camera, sensor_mm };
            let away: Vec<_> =
                (0..12).map(|i| (4 + i / 2, if i % 2 == 0 { 4 + i } else { 25 + i })).collect();
            let (rms, _) = check.difference(&away, 30_000);
            assert!(rms < 1e-3, "away from the edge {rms}");
            let at_edge: Vec<_> = (0..24).map(|i| (5 + i / 8, 16 + i % 8)).collect();
            let (rms, largest) = check.difference(&at_edge, 10_000);
            assert!(rms < 0.022 && largest < 0.09, "at the edge {rms} {largest}");
        }
    }
}

#[test]
fn blur_wider_than_the_direct_kernel_is_exact_to_a_thousandth() {
    let (lens, camera) = (thesis_lens(), Camera::new(32, 24, Noise::None));
    for (scene, beyond_far_mm) in [("plane:900", 2.0), ("cone", -1.5), ("staircase,steps=4", 1.5)] {
        let sensor_mm = lens.sensor_far_mm + beyond_far_mm;
        let check = Check { scene, psf: PSFS[0], lens: &lens, camera: &camera, sensor_mm };
        let (rms, _) = check.difference(&spread(&camera, 12), 30_000);
        assert!(rms < 1.5e-3, "{rms}");
    }
}
