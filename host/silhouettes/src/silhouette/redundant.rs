//! Thins a gallery to the least similar silhouettes.

use crate::mask::Mask;
use rayon::prelude::*;

/// Removes one of the two most similar silhouettes, alternately the first and the second, until `keep` remain
/// (Li 2014, eq. 7.3 and 7.4). The printed method removes only the row; here the column too, otherwise it
/// could be removed again. Returns ascending indices. O(N^2 P / 64).
pub fn remove_redundant(masks: &[Mask], keep: usize) -> Vec<usize> {
    let n = masks.len();
    let packed: Vec<Vec<u64>> = masks
        .par_iter()
        .map(|mask| {
            let pixels: Vec<bool> = mask.iter().copied().collect();
            pixels
                .chunks(64)
                .map(|bits| bits.iter().enumerate().fold(0, |word, (i, &b)| word | (u64::from(b) << i)))
                .collect()
        })
        .collect();
    let difference = |a: usize, b: usize| -> u32 {
        let common: u32 = packed[a].iter().zip(&packed[b]).map(|(p, q)| (p ^ q).count_ones()).sum();
        let rest = packed[a].len().abs_diff(packed[b].len()) as u32 * 64;
        common + rest
    };
    let matrix: Vec<Vec<u32>> =
        (0..n).into_par_iter().map(|a| (0..a).map(|b| difference(a, b)).collect()).collect();
    let mut alive = vec![true; n];
    // Nearest lower-numbered remaining silhouette per row; only rows that lose theirs are searched again.
    let nearest = |alive: &[bool], a: usize| (0..a).filter(|&b| alive[b]).min_by_key(|&b| matrix[a][b]);
    let mut best: Vec<Option<usize>> = (0..n).map(|a| nearest(&alive, a)).collect();
    let mut left = n;
    let mut first = true;
    while left > keep.max(1) {
        let pair = (0..n).filter(|&a| alive[a]).filter_map(|a| best[a].map(|b| (matrix[a][b], a, b))).min();
        let Some((_, a, b)) = pair else { break };
        let gone = if first { a } else { b };
        first = !first;
        alive[gone] = false;
        left -= 1;
        for other in gone + 1..n {
            if alive[other] && best[other] == Some(gone) {
                best[other] = nearest(&alive, other);
            }
        }
    }
    (0..n).filter(|&i| alive[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_alike_go_first_and_what_is_left_is_varied() {
        let bar = |at: usize| Mask::from_shape_fn((10, 100), |(_, x)| (at..at + 10).contains(&x));
        let masks: Vec<Mask> = [0, 1, 2, 40, 41, 80].map(bar).into();
        let kept = remove_redundant(&masks, 3);
        assert_eq!(kept.len(), 3);
        assert!(
            kept.iter().any(|&i| i <= 2) && kept.contains(&5) && kept.iter().any(|&i| i == 3 || i == 4),
            "{kept:?}"
        );
        assert_eq!(remove_redundant(&masks, 10).len(), 6);
    }
}
