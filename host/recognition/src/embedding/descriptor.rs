//! Centroid distance function: 360 distances from a silhouette's centroid to its outermost pixels (Li 2014).
//!
//! The silhouette is scaled to 100 x 100 pixels. A ray per degree is marched inwards until it meets a set
//! pixel, so no angle is empty and holes have no effect (section 9.3.1). Distances are in units of the
//! frame's side: [0, 0.7072] for a central centroid. Angle 0 points right, anticlockwise. About 20 us.
//!
//! The coarse silhouette counts set pixels per cell of that frame ("zoning": Trier, Jain and Taxt, Pattern
//! Recognition 29, 1996). It describes the inside of the outermost contour.

use farnear_silhouettes::mask::BoundingBox;
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// Angles of the descriptor.
pub const ANGLES: usize = 360;
/// Side of the normalised silhouette.
pub const SIDE: usize = 100;
/// Cells of the coarse silhouette per side.
pub const CELLS_ACROSS: usize = 20;
/// Cells of the coarse silhouette.
pub const CELLS: usize = CELLS_ACROSS * CELLS_ACROSS;
const CELL_SIDE: usize = SIDE / CELLS_ACROSS;
/// Pixels in a cell of the coarse silhouette.
pub const CELL_PIXELS: usize = CELL_SIDE * CELL_SIDE;
/// Descriptor version, stored in models.
pub const DESCRIPTOR_VERSION: u32 = 1;

/// Scaling of a silhouette to the 100 x 100 frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// Stretches the bounding box.
    Stretch,
    /// The longer side fills the frame, the shorter is centred.
    #[default]
    KeepAspect,
}

/// An empty silhouette has no descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the mask is empty: a frame without a subject has no descriptor")]
pub struct EmptyMask;

/// Descriptor of a frame.
pub type CentroidDistance = [f32; ANGLES];

/// Set pixels of each cell, 0 to [`CELL_PIXELS`], by rows.
pub type CoarseSilhouette = [u8; CELLS];

/// March step; half of it bounds the error.
const STEP_PX: f64 = 0.5;
const MARGIN: usize = 2;
const PADDED: usize = SIDE + 2 * MARGIN;

/// The centroid distance of the subject in a mask of any size; fails for an empty mask.
pub fn centroid_distance(mask: ArrayView2<bool>, scaling: Scaling) -> Result<CentroidDistance, EmptyMask> {
    let bounds = BoundingBox::of(mask).ok_or(EmptyMask)?;
    let (frame, inner) = normalise(mask, bounds, scaling);
    Ok(march(&frame, inner))
}

/// Centroid distance, coarse silhouette and bounds of the subject in a mask; fails for an empty mask.
pub fn described(
    mask: ArrayView2<bool>,
    scaling: Scaling,
) -> Result<(CentroidDistance, CoarseSilhouette, BoundingBox), EmptyMask> {
    let bounds = BoundingBox::of(mask).ok_or(EmptyMask)?;
    let (frame, inner) = normalise(mask, bounds, scaling);
    Ok((march(&frame, inner), coarse(&frame), bounds))
}

fn coarse(frame: &[bool]) -> CoarseSilhouette {
    let mut cells = [0_u8; CELLS];
    for y in 0..SIDE {
        let line = &frame[(MARGIN + y) * PADDED + MARGIN..][..SIDE];
        for (cell, pixels) in
            cells[y / CELL_SIDE * CELLS_ACROSS..].iter_mut().zip(line.chunks_exact(CELL_SIDE))
        {
            *cell += pixels.iter().map(|&set| u8::from(set)).sum::<u8>();
        }
    }
    cells
}

/// Scales the box into the padded frame by nearest neighbour; returns its position there.
fn normalise(mask: ArrayView2<bool>, bounds: BoundingBox, scaling: Scaling) -> (Vec<bool>, BoundingBox) {
    let (height, width) = (bounds.height(), bounds.width());
    let longest = height.max(width);
    let (rows, columns) = match scaling {
        Scaling::Stretch => (SIDE, SIDE),
        Scaling::KeepAspect => (
            ((SIDE * height + longest / 2) / longest).max(1),
            ((SIDE * width + longest / 2) / longest).max(1),
        ),
    };
    let (top, left) = (MARGIN + (SIDE - rows) / 2, MARGIN + (SIDE - columns) / 2);
    let source: Vec<usize> =
        (0..columns).map(|x| bounds.left + (2 * x + 1) * width / (2 * columns)).collect();
    let mut frame = vec![false; PADDED * PADDED];
    for y in 0..rows {
        let line = mask.row(bounds.top + (2 * y + 1) * height / (2 * rows));
        let start = (top + y) * PADDED + left;
        let out = &mut frame[start..start + columns];
        match line.as_slice() {
            Some(line) => out.iter_mut().zip(&source).for_each(|(pixel, &x)| *pixel = line[x]),
            None => out.iter_mut().zip(&source).for_each(|(pixel, &x)| *pixel = line[x]),
        }
    }
    (frame, BoundingBox { top, left, bottom: top + rows, right: left + columns })
}

fn centroid(frame: &[bool]) -> (f64, f64) {
    let (mut count, mut sum_x, mut sum_y) = (0_u64, 0_u64, 0_u64);
    for (y, row) in frame.chunks_exact(PADDED).enumerate() {
        let (mut in_row, mut x_row) = (0_u32, 0_u32);
        for (x, &set) in row.iter().enumerate() {
            in_row += u32::from(set);
            x_row += u32::from(set) * x as u32;
        }
        count += u64::from(in_row);
        sum_x += u64::from(x_row);
        sum_y += u64::from(in_row) * y as u64;
    }
    (sum_x as f64 / count.max(1) as f64, sum_y as f64 / count.max(1) as f64)
}

fn march(frame: &[bool], inner: BoundingBox) -> CentroidDistance {
    const FRACTION: u32 = 16;
    let (cx, cy) = centroid(frame);
    let scale = f64::from(1_u32 << FRACTION);
    // Relative to pixel corners, so that truncation finds the pixel.
    let start = (((cx + 0.5) * scale) as i32, ((cy + 0.5) * scale) as i32);
    static DIRECTIONS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| (0..ANGLES).map(direction).collect());
    let mut distance = [0.0_f32; ANGLES];
    // Nothing is set outside the scaled box, so the march starts at its faces.
    let (left_face, right_face) = (inner.left as f64 - 0.5, inner.right as f64 - 0.5);
    let (top_face, bottom_face) = (inner.top as f64 - 0.5, inner.bottom as f64 - 0.5);
    let along = |low: f64, high: f64, slope: f64| match slope {
        s if s > 0.0 => high / s,
        s if s < 0.0 => low / s,
        _ => f64::INFINITY,
    };
    for (out, &(sin, cos)) in distance.iter_mut().zip(DIRECTIONS.iter()) {
        // Where the ray leaves the box.
        let along_x = along(left_face - cx, right_face - cx, cos);
        let along_y = along(top_face - cy, bottom_face - cy, sin);
        let steps = (along_x.min(along_y) / STEP_PX).ceil() as i32;
        let (dx, dy) = ((cos * STEP_PX * scale).round() as i32, (sin * STEP_PX * scale).round() as i32);
        let (mut x, mut y) = (start.0 + steps * dx, start.1 + steps * dy);
        let mut left = steps;
        while left >= 0 {
            let index = (y >> FRACTION) as usize * PADDED + (x >> FRACTION) as usize;
            if frame.get(index).copied().unwrap_or(false) {
                break;
            }
            x -= dx;
            y -= dy;
            left -= 1;
        }
        // The edge is between this sample and the previous one, half a step further out on average.
        *out = if left < 0 { 0.0 } else { ((f64::from(left) + 0.5) * STEP_PX / SIDE as f64) as f32 };
    }
    distance
}

/// (sin, cos) of a whole degree, y down, anticlockwise from the right; exact on the axes.
fn direction(angle: usize) -> (f64, f64) {
    match angle {
        0 => (0.0, 1.0),
        90 => (-1.0, 0.0),
        180 => (0.0, -1.0),
        270 => (1.0, 0.0),
        _ => {
            let (sin, cos) = (angle as f64).to_radians().sin_cos();
            (-sin, cos)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_silhouettes::mask::Mask;

    fn worst(mask: &Mask, scaling: Scaling, known: impl Fn(f64) -> f64) -> f64 {
        let found = centroid_distance(mask.view(), scaling).expect("not empty");
        (0..ANGLES).map(|a| (f64::from(found[a]) - known((a as f64).to_radians())).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn disc_square_and_ellipse_have_their_known_curves() {
        let disc =
            Mask::from_shape_fn((400, 400), |(y, x)| (x as f64 - 199.5).hypot(y as f64 - 199.5) < 180.0);
        // 100 pixels across: a pixel is 0.01 of the side.
        assert!(worst(&disc, Scaling::Stretch, |_| 0.5) < 0.012);
        let square =
            Mask::from_shape_fn((300, 300), |(y, x)| (50..250).contains(&x) && (50..250).contains(&y));
        let edge = |a: f64| 0.5 / a.cos().abs().max(a.sin().abs());
        assert!(worst(&square, Scaling::KeepAspect, edge) < 0.012);
        let ellipse = Mask::from_shape_fn((400, 400), |(y, x)| {
            ((x as f64 - 199.5) / 80.0).hypot((y as f64 - 199.5) / 160.0) < 1.0
        });
        let radius = |a: f64| 1.0 / (a.cos() / 0.25).hypot(a.sin() / 0.5);
        assert!(worst(&ellipse, Scaling::KeepAspect, radius) < 0.015);
        assert!(worst(&ellipse, Scaling::Stretch, |_| 0.5) < 0.015);
    }

    #[test]
    fn an_l_shape_has_its_arms_where_they_are() {
        // An upright bar of 20 x 100 and a foot of 80 x 20 to the right; the centroid is outside both boxes.
        let mask = Mask::from_shape_fn((100, 100), |(y, x)| x < 20 || y >= 80);
        let found = centroid_distance(mask.view(), Scaling::Stretch).expect("not empty");
        // Area 2000 + 1600; centroid x = (2000 * 9.5 + 1600 * 59.5) / 3600, y likewise mirrored.
        let c = (2000.0 * 9.5 + 1600.0 * 59.5) / 3600.0;
        let (right, down) = (99.5 - c, c + 0.5);
        assert!(
            (f64::from(found[180]) - (c + 0.5) / 100.0).abs() < 0.012,
            "left reaches the bar's outer face"
        );
        assert!((f64::from(found[270]) - down / 100.0).abs() < 0.012, "down reaches the foot's lower face");
        // Lower corner of the toe; angles are anticlockwise with y down.
        let toe = (-down).atan2(right);
        let degrees = toe.to_degrees().rem_euclid(360.0).round() as usize;
        assert!((f64::from(found[degrees]) - right.hypot(down) / 100.0).abs() < 0.03);
        assert_eq!(found[45], 0.0, "nothing lies up and to the right");
    }

    #[test]
    fn a_coarse_silhouette_counts_the_pixels_of_its_cells() {
        // The L of above; a cell is 5 pixels wide, so the bar is 4 cells wide and the foot 4 high.
        let mask = Mask::from_shape_fn((100, 100), |(y, x)| x < 20 || y >= 82);
        let (distances, cells, bounds) = described(mask.view(), Scaling::Stretch).expect("not empty");
        assert_eq!(distances, centroid_distance(mask.view(), Scaling::Stretch).expect("not empty"));
        assert_eq!((bounds.height(), bounds.width()), (100, 100));
        for (at, &found) in cells.iter().enumerate() {
            let (row, column) = (at / CELLS_ACROSS, at % CELLS_ACROSS);
            let expected = match (row, column) {
                (_, 0..4) | (17.., _) => 25,
                (16, _) => 15,
                _ => 0,
            };
            assert_eq!(found, expected, "row {row}, column {column}");
        }
        assert!(described(Mask::default((5, 5)).view(), Scaling::Stretch).is_err());
    }

    #[test]
    fn holes_change_only_what_the_centroid_shift_changes() {
        let whole = Mask::from_shape_fn((200, 200), |(y, x)| (x as f64 - 99.5).hypot(y as f64 - 99.5) < 90.0);
        let holed = Mask::from_shape_fn((200, 200), |(y, x)| {
            let r = (x as f64 - 99.5).hypot(y as f64 - 99.5);
            r < 90.0 && !(30.0..60.0).contains(&r)
        });
        let a = centroid_distance(whole.view(), Scaling::Stretch).expect("not empty");
        let b = centroid_distance(holed.view(), Scaling::Stretch).expect("not empty");
        assert!(a.iter().zip(&b).all(|(p, q)| (p - q).abs() < 1e-6));
        assert_eq!(centroid_distance(Mask::default((5, 5)).view(), Scaling::Stretch), Err(EmptyMask));
        let dot = Mask::from_elem((1, 1), true);
        assert!(centroid_distance(dot.view(), Scaling::KeepAspect).is_ok());
    }
}
