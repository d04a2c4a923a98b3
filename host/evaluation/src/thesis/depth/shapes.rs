//! The thesis' four test scenes as height maps with marked flat surfaces. Their sizes are not published (fig.
//! 5.5 shows photographs); ours are within the working range.

use anyhow::Result;
use farnear_scene::{HeightMap, Picture, Scene, Shape, Texture};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: (usize, usize) = (480, 640);
/// Windows reach over edges: excluded distance from an edge.
const EDGE_PX: usize = 9;
/// Sandpaper, and skin.
const CONTRAST: [f32; 2] = [0.2, 0.05];

pub struct TestScene {
    pub name: &'static str,
    pub about: &'static str,
    pub scene: Scene,
    pub flats: Vec<(f64, Array2<bool>)>,
    pub median_px: usize,
}

struct Sketch {
    depth_mm: Array2<f32>,
    flat: Array2<u8>,
    depths: Vec<f64>,
}

impl Sketch {
    fn new(background_mm: f64) -> Self {
        Self {
            depth_mm: Array2::from_elem(SIZE, background_mm as f32),
            flat: Array2::from_elem(SIZE, 1),
            depths: vec![background_mm],
        }
    }

    fn flat(&mut self, depth_mm: f64, inside: impl Fn(f64, f64) -> bool) {
        self.depths.push(depth_mm);
        let label = self.depths.len() as u8;
        self.draw(label, |x, y| inside(x, y).then_some(depth_mm));
    }

    fn shape(&mut self, depth: impl Fn(f64, f64) -> Option<f64>) {
        self.draw(0, depth);
    }

    fn draw(&mut self, label: u8, depth: impl Fn(f64, f64) -> Option<f64>) {
        for ((row, column), value) in self.depth_mm.indexed_iter_mut() {
            if let Some(depth_mm) = depth(column as f64 + 0.5, row as f64 + 0.5) {
                *value = depth_mm as f32;
                self.flat[(row, column)] = label;
            }
        }
    }

    /// Upright cylinder towards the camera.
    fn column(&mut self, x0: f64, [top, bottom]: [f64; 2], radius: f64, [rim_mm, front_mm]: [f64; 2]) {
        self.shape(move |x, y| {
            let across = (x - x0) / radius;
            ((top..bottom).contains(&y) && across.abs() < 1.0)
                .then(|| rim_mm + (front_mm - rim_mm) * (1.0 - across * across).sqrt())
        });
    }

    fn finish(self, name: &'static str, about: &'static str) -> Result<TestScene> {
        let flats = self
            .depths
            .iter()
            .zip(1_u8..)
            .map(|(depth, label)| (*depth, eroded(&self.flat, label)))
            .collect();
        let scene = Scene::new(Shape::HeightMap(HeightMap::new(self.depth_mm)?));
        Ok(TestScene { name, about, scene, flats, median_px: 3 })
    }
}

/// Pixels with the same surface within [`EDGE_PX`].
fn eroded(flat: &Array2<u8>, label: u8) -> Array2<bool> {
    let (height, width) = SIZE;
    // Integral image: four look-ups per window.
    let mut sums = Array2::<u32>::zeros((height + 1, width + 1));
    for ((y, x), found) in flat.indexed_iter() {
        sums[(y + 1, x + 1)] =
            u32::from(*found == label) + sums[(y, x + 1)] + sums[(y + 1, x)] - sums[(y, x)];
    }
    let side = 2 * EDGE_PX + 1;
    Array2::from_shape_fn(SIZE, |(y, x)| {
        let border = 16;
        if y < border || x < border || y + border >= height || x + border >= width {
            return false;
        }
        let [top, left] = [y - EDGE_PX, x - EDGE_PX];
        let [bottom, right] = [top + side, left + side];
        sums[(bottom, right)] + sums[(top, left)] - sums[(top, right)] - sums[(bottom, left)]
            == (side * side) as u32
    })
}

pub fn all() -> Result<[TestScene; 4]> {
    Ok([staircase_and_cone()?, temple()?, hand()?, depression()?])
}

fn staircase_and_cone() -> Result<TestScene> {
    let mut sketch = Sketch::new(931.0);
    for step in 0..5 {
        let left = 60.0 + 60.0 * f64::from(step);
        sketch.flat(925.0 - 8.0 * f64::from(step), move |x, y| {
            (left..left + 60.0).contains(&x) && (80.0..400.0).contains(&y)
        });
    }
    sketch.shape(|x, y| {
        let rho = (x - 490.0).hypot(y - 230.0) / 105.0;
        (rho < 1.0).then_some(890.0 + 38.0 * rho)
    });
    sketch.flat(905.0, |x, y| (60.0..590.0).contains(&x) && (410.0..470.0).contains(&y));
    sketch.finish("SC", "a staircase of five, a cone, a block below")
}

fn temple() -> Result<TestScene> {
    let mut sketch = Sketch::new(928.0);
    sketch.flat(923.0, |x, y| (190.0..450.0).contains(&x) && (190.0..350.0).contains(&y));
    for x in [210.0, 283.0, 357.0, 430.0] {
        sketch.column(x, [190.0, 350.0], 17.0, [922.0, 914.0]);
    }
    // The roof slopes from its ridge towards the camera.
    sketch.shape(|x, y| {
        let down = (y - 90.0) / 100.0;
        ((0.0..1.0).contains(&down) && (x - 320.0).abs() < 165.0 * down).then_some(923.0 - 12.0 * down)
    });
    sketch.flat(915.0, |x, y| (170.0..470.0).contains(&x) && (350.0..390.0).contains(&y));
    sketch.flat(910.0, |x, y| (140.0..500.0).contains(&x) && (390.0..440.0).contains(&y));
    sketch.finish("TP", "a temple with columns and a roof, in the middle of the range")
}

fn hand() -> Result<TestScene> {
    let mut sketch = Sketch::new(930.0);
    for (index, x) in [230.0, 285.0, 340.0, 395.0].into_iter().enumerate() {
        let top = [120.0, 80.0, 90.0, 140.0][index];
        sketch.column(x, [top, 280.0], 24.0, [914.0, 900.0]);
    }
    let palm = |x: f64, y: f64| (205.0..420.0).contains(&x) && (280.0..430.0).contains(&y);
    sketch.flat(908.0, palm);
    let skin = {
        let depth = &sketch.depth_mm;
        depth.mapv(|mm| mm < 925.0)
    };
    let mut scene = sketch.finish("HD", "a hand whose skin has a quarter of the contrast, median 5x5")?;
    scene.scene.texture = Texture::Picture(Picture::new(paint(&skin))?);
    scene.median_px = 5;
    Ok(scene)
}

fn depression() -> Result<TestScene> {
    let mut sketch = Sketch::new(931.0);
    sketch.flat(895.0, |x, y| (130.0..510.0).contains(&x) && (70.0..400.0).contains(&y));
    sketch.shape(|x, y| {
        let rho = (x - 320.0).hypot(y - 235.0) / 120.0;
        (rho < 1.0).then_some(925.0 - 30.0 * rho)
    });
    sketch.flat(911.0, |x, y| (130.0..510.0).contains(&x) && (400.0..455.0).contains(&y));
    sketch.finish("CD", "a block with a conical depression, on a ledge")
}

/// Grain at two samples per pixel: white noise blurred by a binomial of SD 1 sample, less on skin.
fn paint(skin: &Array2<bool>) -> Array2<f32> {
    let (height, width) = (2 * SIZE.0, 2 * SIZE.1);
    let mut random = ChaCha8Rng::seed_from_u64(55);
    let white = Array2::from_shape_fn((height + 4, width + 4), |_| random.random_range(-1.0..1.0_f32));
    const TAPS: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
    let grain = Array2::from_shape_fn((height, width), |(y, x)| {
        let mut sum = 0.0;
        for (i, a) in TAPS.iter().enumerate() {
            for (j, b) in TAPS.iter().enumerate() {
                sum += a * b * white[(y + i, x + j)];
            }
        }
        sum
    });
    let spread = (grain.iter().map(|g| f64::from(g * g)).sum::<f64>() / grain.len() as f64).sqrt() as f32;
    Array2::from_shape_fn((height, width), |(y, x)| {
        let contrast = CONTRAST[usize::from(skin[(y / 2, x / 2)])];
        (1.0 + contrast * grain[(y, x)] / spread).clamp(0.2, 1.8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flat_surface_is_seen_and_lies_at_its_depth() {
        let lens = crate::rig::lens(false).unwrap();
        for scene in all().unwrap() {
            let camera = farnear_scene::Camera::new(SIZE.1, SIZE.0, farnear_scene::Noise::None);
            let truth = farnear_scene::truth(&scene.scene, &lens, &camera);
            for (depth_mm, counts) in &scene.flats {
                let seen: Vec<f32> =
                    counts.indexed_iter().filter(|(_, c)| **c).map(|(at, _)| truth[at]).collect();
                assert!(seen.len() > 500, "{} at {depth_mm}: {}", scene.name, seen.len());
                assert!(seen.iter().all(|mm| (f64::from(*mm) - depth_mm).abs() < 1e-3), "{}", scene.name);
            }
        }
    }
}
