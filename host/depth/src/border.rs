//! Image borders: reflected without repeating the edge pixel.

pub(crate) fn reflect(i: isize, n: usize) -> usize {
    let period = (2 * (n as isize - 1)).max(1);
    let j = i.rem_euclid(period);
    (if j < n as isize { j } else { period - j }) as usize
}
