//! Slopes at the border. A window that is cut there has its middle off the pixel and finds the depth of its middle, so that a
//! slope looks half as steep. The whole windows next to it tell the slope.

use ndarray::{Array2, ArrayViewMut1, Axis, Zip};

/// Largest distance from what a plane would look like, in standard deviations. From 1 to 2 it hardly changes rendered planes and
/// waves.
const PLANE: f32 = 1.5;

/// Corrects depth and deviation, for windows of up to `2 half + 1` px, whose evidence begins `reach` px from the border, where
/// the cut windows see a plane.
pub(super) fn straighten(depth: &mut Array2<f32>, deviation: &mut Array2<f32>, half: usize, reach: usize) {
    for axis in [Axis(1), Axis(0)] {
        for from_end in [false, true] {
            let [mut depth, mut deviation] = [depth.view_mut(), deviation.view_mut()];
            if from_end {
                depth.invert_axis(axis);
                deviation.invert_axis(axis);
            }
            Zip::from(depth.lanes_mut(axis))
                .and(deviation.lanes_mut(axis))
                .for_each(|depth, deviation| straighten_line(depth, deviation, half, half + reach));
        }
    }
}

/// From the border on; windows are whole from `whole` on.
fn straighten_line(
    mut depth: ArrayViewMut1<f32>,
    mut deviation: ArrayViewMut1<f32>,
    half: usize,
    whole: usize,
) {
    if half == 0 || depth.len() <= 2 * whole + half {
        return;
    }
    let [near, far] = [whole, whole + half].map(|at| (depth[at], deviation[at].powi(2)));
    let slope = (far.0 - near.0) / half as f32;
    let of_slope = (far.1 + near.1) / (half * half) as f32;
    for at in 0..whole {
        let off_px = 0.5 * (whole - at) as f32;
        let added = of_slope * off_px * off_px;
        let own = deviation[at].powi(2);
        let from_plane = near.0 - depth[at] - slope * off_px;
        if from_plane.powi(2) <= PLANE.powi(2) * (own + near.1 + added) {
            depth[at] -= slope * off_px;
            deviation[at] = (own + added).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 80;
    const HALF: usize = 10;
    const REACH: usize = 3;

    /// Means of the surface over windows that end `REACH` before the border.
    fn seen(surface: &Array2<f32>, half: usize) -> Array2<f32> {
        let part = |at: usize| at.saturating_sub(half).max(REACH)..(at + half + 1).min(SIDE - REACH);
        Array2::from_shape_fn(surface.dim(), |(y, x)| {
            let window = surface.slice(ndarray::s![part(y), part(x)]);
            window.sum() / window.len() as f32
        })
    }

    fn straightened(seen: &Array2<f32>, sd: f32) -> [Array2<f32>; 2] {
        let (mut depth, mut deviation) = (seen.clone(), Array2::from_elem(seen.dim(), sd));
        straighten(&mut depth, &mut deviation, HALF, REACH);
        [depth, deviation]
    }

    #[test]
    fn a_plane_is_straight_to_the_corners() {
        let plane = Array2::from_shape_fn((SIDE, SIDE), |(y, x)| 900.0 + 0.02 * y as f32 - 0.05 * x as f32);
        let seen = seen(&plane, HALF);
        let [depth, deviation] = straightened(&seen, 0.05);
        assert!((seen[(0, 0)] - plane[(0, 0)]).abs() > 0.15, "{}", seen[(0, 0)]);
        for (at, depth) in depth.indexed_iter() {
            assert!((depth - plane[at]).abs() < 2e-3, "{at:?}: {depth} {}", plane[at]);
        }
        assert_eq!(deviation[(40, 40)], 0.05);
        assert!((0.06..0.12).contains(&deviation[(0, 0)]), "{}", deviation[(0, 0)]);
    }

    /// Small windows and curved surfaces.
    #[test]
    fn what_no_cut_window_of_a_plane_shows_is_kept() {
        let plane = Array2::from_shape_fn((SIDE, SIDE), |(_, x)| 900.0 + 0.05 * x as f32);
        let waves = Array2::from_shape_fn((SIDE, SIDE), |(_, x)| 900.0 + (0.2 * x as f32).sin());
        for surface in [plane, waves] {
            assert_eq!(straightened(&surface, 0.01)[0].column(0), surface.column(0));
        }
        let mut holes = Array2::from_elem((SIDE, SIDE), 900.0);
        holes.column_mut(HALF + REACH).fill(f32::NAN);
        assert_eq!(straightened(&holes, 0.01)[0].column(0), holes.column(0));
    }
}
