//! Large-region texture: over a region, gradients keep their direction in shadow (Sanin, Sanderson and
//! Lovell, "Improved shadow removal for robust person tracking in surveillance scenarios", ICPR 2010).
//! Candidates pass a loose chromaticity test; edges missing in the background split them into regions. Over a
//! region's n pixels with sufficient gradient,
//! ```text
//! c = (1 / n) sum H(largest angle - angle between the frame's and the background's gradient)
//! ```
//! and the region is shadow if c reaches a threshold (H is the unit step). With too few such pixels colour
//! alone decides. Linear cost.

use ndarray::Array2;

use super::{
    chromaticity,
    images::{Images, gradient, intensity},
};
use farnear_silhouettes::mask::{
    Mask,
    bits::BitMask,
    regions::{Connectivity, regions},
};

const CANDIDATES: chromaticity::Limits =
    chromaticity::Limits { saturation: 0.3, hue_deg: 76.0, least_saturation: 0.2 };
/// Smallest compared gradient, grey levels per pixel, in frame or background.
const LEAST_GRADIENT: f32 = 4.0;
/// Largest angle between gradients of equal direction.
const LARGEST_ANGLE_DEG: f32 = 30.0;
/// Smallest share c of matching gradients.
const LEAST_SHARE: f32 = 0.45;
/// Excess gradient over the shaded background that splits regions, grey levels per pixel.
const EDGE_GRADIENT: f32 = 12.0;
const FEWEST_GRADIENTS: usize = 12;

pub(super) fn detect(images: &Images<'_>) -> Mask {
    let candidates = chromaticity::detect(images, &CANDIDATES);
    let (frame, background) = (intensity(images.frame), intensity(images.background));
    let (frame_slope, background_slope) = (gradient(&frame), gradient(&background));
    let shade = |at: (usize, usize)| frame[at] / background[at].max(1.0);
    let size = |slope: [f32; 2]| slope[0].hypot(slope[1]);
    let edges = Array2::from_shape_fn(images.size(), |at| {
        candidates[at] && size(frame_slope[at]) - shade(at) * size(background_slope[at]) > EDGE_GRADIENT
    });
    let parted = Array2::from_shape_fn(images.size(), |at| candidates[at] && !edges[at]);

    // At the foreground's outline the difference is the outline itself.
    let inside = BitMask::pack(images.foreground).eroded(1).unpack();
    let least_cosine = LARGEST_ANGLE_DEG.to_radians().cos();
    let mut shadow = Mask::from_elem(images.size(), false);
    for region in regions(parted.view(), true, Connectivity::Four) {
        let (mut worthy, mut alike) = (0_usize, 0_usize);
        for at in region.runs.iter().flat_map(|run| (run.start..run.end).map(|column| (run.row, column))) {
            let (f, b) = (frame_slope[at], background_slope[at]);
            // The background's gradient is scaled to this shade, so that darkness does not hide texture.
            if !inside[at] || size(f).max(shade(at) * size(b)) < LEAST_GRADIENT * shade(at) {
                continue;
            }
            worthy += 1;
            let cosine = (f[0] * b[0] + f[1] * b[1]) / (size(f) * size(b)).max(f32::MIN_POSITIVE);
            alike += usize::from(cosine >= least_cosine);
        }
        if worthy < FEWEST_GRADIENTS || alike as f32 >= LEAST_SHARE * worthy as f32 {
            region.paint(&mut shadow, true);
        }
    }
    // Edges next to shadow belong to it.
    let near = BitMask::pack(shadow.view()).dilated(1).unpack();
    shadow.zip_mut_with(&Array2::from_shape_fn(images.size(), |at| edges[at] && near[at]), |set, &edge| {
        *set |= edge
    });
    shadow
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, s};

    fn paving(row: usize, column: usize) -> f32 {
        120.0 + 25.0 * ((row as f32 * 0.9).sin() + (column as f32 * 0.7).cos())
    }

    #[test]
    fn removes_a_shaded_region_and_keeps_a_textured_garment() {
        let colour = [1.0, 0.9, 0.8];
        let background = Array3::from_shape_fn((60, 80, 3), |(row, column, channel)| {
            (colour[channel] * paving(row, column)) as u8
        });
        let mut frame = background.clone();
        for ((row, column, channel), level) in frame.indexed_iter_mut() {
            let shirt = 70.0 + 20.0 * ((row as f32 * 0.4 + column as f32 * 1.1).sin());
            match (row, column) {
                (10..50, 5..30) => *level = (0.55 * colour[channel] * paving(row, column)) as u8,
                (10..50, 45..70) => *level = (colour[channel] * shirt) as u8,
                _ => {}
            }
        }
        let mut mask = Mask::from_elem((60, 80), false);
        mask.slice_mut(s![10..50, 5..30]).fill(true);
        mask.slice_mut(s![10..50, 45..70]).fill(true);
        let images = Images::new(frame.view(), background.view(), mask.view()).unwrap();
        let found = detect(&images);
        let count =
            |columns: std::ops::Range<usize>| found.slice(s![.., columns]).iter().filter(|&&set| set).count();
        assert!(count(5..30) > 900, "{} of 1000 shadow pixels", count(5..30));
        assert!(count(45..70) < 200, "{} of 1000 garment pixels", count(45..70));
    }
}
