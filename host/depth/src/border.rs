//! Borders of images: reflected without repeating the edge pixel.

/// Index of a pixel beyond the border: reflected without repeating the edge pixel, as often as needed.
pub(crate) fn reflect(i: isize, n: usize) -> usize {
    let period = (2 * (n as isize - 1)).max(1);
    let j = i.rem_euclid(period);
    (if j < n as isize { j } else { period - j }) as usize
}
