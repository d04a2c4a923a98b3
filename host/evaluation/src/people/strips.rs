//! Silhouettes from strips of 64x64 frames before a plain wall, where a still person would become background.
//! The wall's colours in a row are those of the columns at both edges over the whole strip, as one Gaussian;
//! pixels far from it are the person. Moving pixels need less evidence.

use anyhow::{Result, ensure};
use farnear_silhouettes::mask::{
    Mask,
    bits::BitMask,
    regions::{Connectivity, regions},
};
use image::RgbImage;
use std::path::Path;

use super::data::picture;
use crate::page::median;

pub const SIDE: usize = 64;
/// Columns of wall at either edge.
const WALL_COLUMNS: usize = 9;
/// Rows above and below that a row's wall is learned from.
const REACH_ROWS: usize = 6;
/// Samples this far from the row's median (largest channel, grey levels) are an arm in front of the wall.
const NOT_WALL: f64 = 45.0;
const CAMERA_VARIANCE: f64 = 6.0;
/// Smallest distance of the person from the wall, standard deviations.
const FAR: f64 = 4.0;
/// For pixels that differ from their temporal median by more than [`MOVING`] (Euclidean, grey levels).
const FAR_MOVING: f64 = 2.5;
const MOVING: f64 = 40.0;

/// Frames in a row; the file extension is ignored.
pub fn read(path: &Path) -> Result<Vec<RgbImage>> {
    let strip = picture(path)?;
    let (width, height) = (strip.width() as usize, strip.height() as usize);
    ensure!(
        height == SIDE && width >= SIDE && width % SIDE == 0,
        "{} is {width} x {height}; a strip is {SIDE} pixels high and a multiple of that wide",
        path.display()
    );
    let strip = strip.to_rgb8();
    let side = SIDE as u32;
    Ok((0..width as u32 / side)
        .map(|n| image::imageops::crop_imm(&strip, n * side, 0, side, side).to_image())
        .collect())
}

type Colour = [f64; 3];

struct Wall {
    mean: Colour,
    inverse: [Colour; 3],
}

impl Wall {
    fn learn(mut samples: Vec<Colour>) -> Self {
        let median: Colour = std::array::from_fn(|k| median(samples.iter().map(|c| c[k]).collect()));
        samples.retain(|c| (0..3).all(|k| (c[k] - median[k]).abs() < NOT_WALL));
        let n = samples.len().max(1) as f64;
        let mean: Colour = std::array::from_fn(|k| samples.iter().map(|c| c[k]).sum::<f64>() / n);
        let covariance: [Colour; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let sum: f64 = samples.iter().map(|c| (c[i] - mean[i]) * (c[j] - mean[j])).sum();
                sum / n + if i == j { CAMERA_VARIANCE } else { 0.0 }
            })
        });
        Self { mean, inverse: inverse(&covariance) }
    }

    fn distance(&self, colour: Colour) -> f64 {
        let off: Colour = std::array::from_fn(|k| colour[k] - self.mean[k]);
        let square: f64 =
            (0..3).map(|i| off[i] * (0..3).map(|j| self.inverse[i][j] * off[j]).sum::<f64>()).sum();
        square.max(0.0).sqrt()
    }
}

fn inverse(m: &[Colour; 3]) -> [Colour; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}

pub fn masks(frames: &[RgbImage]) -> Vec<Mask> {
    let colour =
        |n: usize, y: usize, x: usize| -> Colour { frames[n].get_pixel(x as u32, y as u32).0.map(f64::from) };
    let walls: Vec<Wall> = (0..SIDE)
        .map(|row| {
            let near = row.saturating_sub(REACH_ROWS)..(row + REACH_ROWS + 1).min(SIDE);
            let columns = || (0..WALL_COLUMNS).chain(SIDE - WALL_COLUMNS..SIDE);
            let places = near.flat_map(|y| columns().map(move |x| (y, x)));
            let samples = places.flat_map(|(y, x)| (0..frames.len()).map(move |n| (n, y, x)));
            Wall::learn(samples.map(|(n, y, x)| colour(n, y, x)).collect())
        })
        .collect();
    let still: Vec<Colour> = (0..SIDE * SIDE)
        .map(|at| {
            std::array::from_fn(|k| {
                median((0..frames.len()).map(|n| colour(n, at / SIDE, at % SIDE)[k]).collect())
            })
        })
        .collect();
    (0..frames.len())
        .map(|n| {
            let person = Mask::from_shape_fn((SIDE, SIDE), |(y, x)| {
                let (here, usual) = (colour(n, y, x), still[y * SIDE + x]);
                let far = walls[y].distance(here);
                let moved = (0..3).map(|k| (here[k] - usual[k]).powi(2)).sum::<f64>().sqrt();
                far > FAR || (moved > MOVING && far > FAR_MOVING)
            });
            largest(BitMask::pack(person.view()).closed(1).unpack())
        })
        .collect()
}

fn largest(mask: Mask) -> Mask {
    let mut alone = Mask::default(mask.dim());
    let found = regions(mask.view(), true, Connectivity::Eight);
    if let Some(region) = found.iter().max_by_key(|region| region.area) {
        region.paint(&mut alone, true);
    }
    alone
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn a_dark_body_and_its_waving_arm_are_separated_from_a_blotchy_wall() {
        // A motionless body with an arm raised in every other frame; the wall varies by +-8 grey levels.
        let arm = |n: usize, y: usize, x: usize| {
            n.is_multiple_of(2) && (20..24).contains(&y) && (36..50).contains(&x)
        };
        let body = |y: usize, x: usize| y >= 14 && (26..36).contains(&x);
        let frames: Vec<RgbImage> = (0..12)
            .map(|n| {
                RgbImage::from_fn(64, 64, |x, y| {
                    let (x, y) = (x as usize, y as usize);
                    let blotch = ((x * 7 + y * 13) % 17) as u8;
                    if body(y, x) || arm(n, y, x) {
                        Rgb([50, 45, 60])
                    } else {
                        Rgb([160 + blotch, 150 + blotch, 145 + blotch])
                    }
                })
            })
            .collect();
        for (n, mask) in masks(&frames).iter().enumerate() {
            let wrong =
                mask.indexed_iter().filter(|&((y, x), &set)| set != (body(y, x) || arm(n, y, x))).count();
            assert!(wrong < 12, "{wrong} pixels of frame {n}");
        }
    }

    #[test]
    fn inverses_are_inverses() {
        let m = [[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 5.0]];
        let inverse = inverse(&m);
        for (i, row) in m.iter().enumerate() {
            let product = |j: usize| row.iter().zip(&inverse).map(|(a, column)| a * column[j]).sum::<f64>();
            assert!((0..3).all(|j| (product(j) - f64::from(u8::from(i == j))).abs() < 1e-12));
        }
    }
}
