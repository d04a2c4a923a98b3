//! Silhouettes from markers: every part's markers projected and filled (Li 2014, section 7.2.2).
//!
//! The thesis fills all triplets of a part's markers, so that a hidden marker leaves no hole. The union of all triangles over a set of
//! points is the points' convex hull, so the hull gives the same picture in a fraction of the time. Both are here and are held against
//! each other. Rigid parts leave gaps at joints: [`close`] fills them (21 pixels at 167 pixels per metre in the thesis).

use super::capsule::Point3;
use super::raster::{Point, convex_hull, fill_convex, fill_discs_hull};
use super::template::Template;
use super::view::{Canvas, View};
use crate::mask::Mask;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// How a part is filled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fill {
    /// The convex hull.
    #[default]
    Hull,
    /// All triplets, as printed.
    Triplets,
}

/// A drawn frame.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerSilhouette {
    /// The picture.
    pub mask: Mask,
    /// Parts without a single visible marker: the picture lacks them.
    pub missing_parts: Vec<String>,
}

/// All visible template markers of frames in a view, for [`Canvas::fitting`], with room for the parts' thickness.
pub fn extent(frames: &[HashMap<&str, Point3>], template: &Template, view: &View) -> Vec<Point> {
    let mut points = Vec::new();
    for (frame, part) in frames.iter().flat_map(|frame| template.parts.iter().map(move |part| (frame, part)))
    {
        for p in part.markers.iter().filter_map(|marker| frame.get(marker.as_str())) {
            let [x, z] = view.project(*p);
            points.push([x - part.thickness_mm, z - part.thickness_mm]);
            points.push([x + part.thickness_mm, z + part.thickness_mm]);
        }
    }
    points
}

/// Draws one frame's markers.
pub fn draw(
    markers: &HashMap<&str, Point3>,
    template: &Template,
    view: &View,
    canvas: &Canvas,
    fill: Fill,
) -> MarkerSilhouette {
    let mut mask = canvas.blank();
    let mut missing_parts = Vec::new();
    for part in &template.parts {
        let points: Vec<Point> = part
            .markers
            .iter()
            .filter_map(|marker| markers.get(marker.as_str()))
            .map(|p| canvas.pixel(view.project(*p)))
            .collect();
        if points.is_empty() {
            missing_parts.push(part.name.clone());
            continue;
        }
        match fill {
            Fill::Hull => fill_convex(&mut mask, &convex_hull(&points)),
            Fill::Triplets => fill_triplets(&mut mask, &points),
        }
        if part.thickness_mm > 0.0 {
            // Growing a hull by a radius is the union of its edges' capsules with it.
            let radius = part.thickness_mm / canvas.mm_per_px;
            let hull = convex_hull(&points);
            for (i, &corner) in hull.iter().enumerate() {
                fill_discs_hull(&mut mask, (corner, radius), (hull[(i + 1) % hull.len()], radius));
            }
        }
    }
    MarkerSilhouette { mask, missing_parts }
}

fn fill_triplets(mask: &mut Mask, points: &[Point]) {
    if points.len() < 3 {
        return fill_convex(mask, points);
    }
    for i in 0..points.len() {
        for j in i + 1..points.len() {
            for k in j + 1..points.len() {
                fill_convex(mask, &[points[i], points[j], points[k]]);
            }
        }
    }
}

/// Morphological closing by a square of `size` pixels (odd): gaps narrower than that are filled, the outline stays.
pub fn close(mask: &Mask, size: usize) -> Mask {
    let half = size / 2;
    if half == 0 {
        return mask.clone();
    }
    // A border of background keeps the picture's edge from being eaten or grown.
    let (h, w) = mask.dim();
    let mut wide = Mask::default((h + 2 * half, w + 2 * half));
    wide.slice_mut(ndarray::s![half..half + h, half..half + w]).assign(mask);
    let grown = window(&wide, half, true);
    let closed = window(&grown, half, false);
    closed.slice(ndarray::s![half..half + h, half..half + w]).to_owned()
}

/// Dilation (`any`) or erosion by a square, one axis after the other, by running counts.
fn window(mask: &Mask, half: usize, any: bool) -> Mask {
    let along_rows = |mask: &Mask| {
        let (h, w) = mask.dim();
        let mut out = Mask::default((h, w));
        for (from, mut to) in mask.rows().into_iter().zip(out.rows_mut()) {
            let mut count = from.iter().take(half).filter(|&&set| set).count();
            for x in 0..w {
                count += usize::from(x + half < w && from[x + half]);
                let length = (x + half).min(w - 1) + 1 - x.saturating_sub(half);
                to[x] = if any { count > 0 } else { count == length };
                count -= usize::from(x >= half && from[x - half]);
            }
        }
        out
    };
    let rows = along_rows(mask);
    along_rows(&rows.t().as_standard_layout().to_owned()).t().as_standard_layout().to_owned()
}

/// Which of many similar silhouettes to keep (Li 2014, eq. 7.3 and 7.4): the two most alike are found, one of them goes (in turn
/// the first and the second), until `keep` are left. The printed method only strikes the removed silhouette's row; its column is
/// struck too, else a removed silhouette could be removed again. Gives the kept indices in rising order. O(N^2 P / 64).
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
    // The nearest lower-numbered living silhouette of each row; only rows that lose theirs are searched again.
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
    use crate::mask::area;
    use rand::{Rng, SeedableRng};

    #[test]
    fn triplets_and_hull_draw_the_same_picture() {
        let template = Template::named("thesis").expect("built in");
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let names: Vec<String> = template.parts.iter().flat_map(|p| p.markers.clone()).collect();
        for round in 0..5 {
            let markers: HashMap<&str, Point3> = names
                .iter()
                .filter(|_| rng.random_range(0..10) > 1)
                .map(|n| n.as_str())
                .collect::<Vec<_>>()
                .into_iter()
                .map(|n| (n, std::array::from_fn(|_| rng.random_range(0.0..1000.0))))
                .collect();
            let view = View { gamma_deg: 45.0 * f64::from(round), alpha_deg: 10.0, beta_deg: 0.0 };
            let canvas = Canvas::fitting(&extent(std::slice::from_ref(&markers), &template, &view), 8.0, 2)
                .expect("finite");
            let hull = draw(&markers, &template, &view, &canvas, Fill::Hull);
            let triplets = draw(&markers, &template, &view, &canvas, Fill::Triplets);
            let differing = hull.mask.iter().zip(&triplets.mask).filter(|(a, b)| a != b).count();
            // Rounding along shared edges may move single pixels.
            assert!(differing * 5000 <= area(hull.mask.view()), "{differing} pixels differ");
        }
    }

    #[test]
    fn closing_fills_gaps_and_leaves_the_rest() {
        let mask = Mask::from_shape_fn((40, 60), |(y, x)| {
            (10..30).contains(&y) && (5..55).contains(&x) && !(28..33).contains(&x)
        });
        let closed = close(&mask, 7);
        assert!(closed[[20, 30]] && !closed[[5, 30]] && !closed[[20, 2]]);
        assert_eq!(area(closed.view()), 20 * 50);
        assert_eq!(close(&mask, 3), mask, "a gap of five stays with a window of three");
    }

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
