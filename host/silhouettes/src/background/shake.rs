//! Camera shake: whole pixels by which a frame is shifted against the background.

use ndarray::{Array, Array2, ArrayBase, Axis, Data, Dimension, Ix2, Ix3, RemoveAxis};

use super::Frame;
use super::light::Relit;

/// Largest shift, pixels.
pub const REACH_PX: isize = 6;
/// Mean difference of an unshifted frame, grey levels.
pub const STILL: f32 = 6.0;
/// A shift must reduce the difference to this share.
pub const BETTER: f32 = 0.7;
/// Limit of a difference, so that a person does not decide.
pub const MOST: f32 = 40.0;

/// Rows down and columns to the right.
pub type Shift = (isize, isize);

/// Moves a frame back by its shift; repeats its edge.
pub fn moved_back(frame: Frame<'_>, shift: Shift) -> Relit {
    match frame {
        Frame::Grey(pixels) => Relit::Grey(moved::<_, Ix2>(&pixels, shift)),
        Frame::Rgb(pixels) => Relit::Rgb(moved::<_, Ix3>(&pixels, shift)),
    }
}

fn moved<S, D>(pixels: &ArrayBase<S, D>, (down, right): Shift) -> Array<u8, D>
where
    S: Data<Elem = u8>,
    D: Dimension + RemoveAxis,
{
    let from = |size: usize, by: isize| -> Vec<usize> {
        (0..size as isize).map(|at| (at + by).clamp(0, size as isize - 1) as usize).collect()
    };
    let rows = pixels.select(Axis(0), &from(pixels.shape()[0], down));
    rows.select(Axis(1), &from(pixels.shape()[1], right))
}

/// Moves a mask or labels to the frame's own place; pixels from outside are `empty`.
pub fn moved_forth<T: Copy>(mask: &Array2<T>, (down, right): Shift, empty: T) -> Array2<T> {
    let (height, width) = mask.dim();
    Array2::from_shape_fn((height, width), |(row, column)| {
        let place = (row as isize - down, column as isize - right);
        let inside = (0..height as isize).contains(&place.0) && (0..width as isize).contains(&place.1);
        if inside { mask[[place.0 as usize, place.1 as usize]] } else { empty }
    })
}
