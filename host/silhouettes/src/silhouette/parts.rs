//! Silhouettes by parts: the markers of each body part, projected and filled (Li 2014, section 7.2.2). The thesis fills
//! all triplets of a part's markers. Their union is the convex hull, which is faster; tests compare both. [`close`]
//! fills gaps between rigid parts (21 pixels at 167 pixels per metre in the thesis).

use super::capsule::Point3;
use super::raster::{Point, convex_hull, fill_convex, fill_discs_hull};
use super::template::Template;
use super::view::{Canvas, View};
use crate::mask::{Mask, bits::BitMask};
use ndarray::s;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fill {
    #[default]
    Hull,
    /// All triplets, as in the thesis.
    Triplets,
}

crate::named!(Fill, "fill", "hull" => Hull, "triplets" => Triplets);

#[derive(Clone, Debug, PartialEq)]
pub struct PartsSilhouette {
    pub mask: Mask,
    /// Parts without a visible marker, missing in the picture.
    pub missing_parts: Vec<String>,
}

/// Visible template markers of frames in a view, with the parts' thickness, for [`Canvas::fitting`].
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

pub fn draw(
    markers: &HashMap<&str, Point3>,
    template: &Template,
    view: &View,
    canvas: &Canvas,
    fill: Fill,
) -> PartsSilhouette {
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
            // A hull grown by a radius is its union with its edges' capsules.
            let radius = part.thickness_mm / canvas.mm_per_px;
            let hull = convex_hull(&points);
            for (i, &corner) in hull.iter().enumerate() {
                fill_discs_hull(&mut mask, (corner, radius), (hull[(i + 1) % hull.len()], radius));
            }
        }
    }
    PartsSilhouette { mask, missing_parts }
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

/// Morphological closing by a square of `size_px` pixels (odd).
pub fn close(mask: &Mask, size_px: usize) -> Mask {
    let half = size_px / 2;
    if half == 0 {
        return mask.clone();
    }
    // A background border keeps the image's edge unchanged.
    let (height, width) = mask.dim();
    let inner = s![half..half + height, half..half + width];
    let mut wide = Mask::default((height + 2 * half, width + 2 * half));
    wide.slice_mut(inner).assign(mask);
    BitMask::pack(wide.view()).closed(half).unpack().slice(inner).to_owned()
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
}
