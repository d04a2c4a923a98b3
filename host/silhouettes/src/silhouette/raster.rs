//! Fills convex shapes: pixels with their centre in the shape, edges included.

use crate::mask::Mask;

/// (x, y) in pixels, y down.
pub type Point = [f64; 2];

/// Twice the signed area of the triangle a, b, c.
fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Andrew's monotone chain, in order around the hull; ignores non-finite points. O(n log n).
pub fn convex_hull(points: &[Point]) -> Vec<Point> {
    let mut sorted: Vec<Point> =
        points.iter().copied().filter(|p| p[0].is_finite() && p[1].is_finite()).collect();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let half = |points: &mut dyn Iterator<Item = Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for point in points {
            while chain.len() >= 2 && cross(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0.0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Either orientation, clipped to the mask. One or two corners set the nearest pixels.
pub fn fill_convex(mask: &mut Mask, polygon: &[Point]) {
    /// Tolerance, so that shared edges leave no seam.
    const EDGE_PX: f64 = 1e-9;
    let (height, width) = mask.dim();
    if polygon.is_empty() || height == 0 || width == 0 {
        return;
    }
    if polygon.len() < 3 {
        return draw_line(mask, polygon[0], polygon[polygon.len() - 1]);
    }
    let top = polygon.iter().fold(f64::INFINITY, |m, p| m.min(p[1]));
    let bottom = polygon.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[1]));
    let first = (top - EDGE_PX).ceil().max(0.0);
    let last = (bottom + EDGE_PX).floor().min(height as f64 - 1.0);
    if first.is_nan() || last.is_nan() || first > last {
        return;
    }
    for row in first as usize..=last as usize {
        let y = row as f64;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            if y < low[1] - EDGE_PX || y > high[1] + EDGE_PX {
                continue;
            }
            if high[1] - low[1] <= EDGE_PX {
                left = left.min(a[0].min(b[0]));
                right = right.max(a[0].max(b[0]));
            } else {
                let x = low[0] + (high[0] - low[0]) * ((y - low[1]) / (high[1] - low[1])).clamp(0.0, 1.0);
                left = left.min(x);
                right = right.max(x);
            }
        }
        let from = (left - EDGE_PX).ceil().max(0.0);
        let to = (right + EDGE_PX).floor().min(width as f64 - 1.0);
        if from <= to {
            mask.slice_mut(ndarray::s![row, from as usize..=to as usize]).fill(true);
        }
    }
}

pub fn draw_line(mask: &mut Mask, a: Point, b: Point) {
    let (height, width) = mask.dim();
    let steps = (b[0] - a[0]).abs().max((b[1] - a[1]).abs()).ceil();
    if !steps.is_finite() {
        return;
    }
    // A line far outside is followed only near the mask.
    let steps = steps.min(8.0 * (height + width) as f64);
    for step in 0..=steps as usize {
        let t = if steps > 0.0 { step as f64 / steps } else { 0.0 };
        let (x, y) = ((a[0] + t * (b[0] - a[0])).round(), (a[1] + t * (b[1] - a[1])).round());
        if x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64 {
            mask[[y as usize, x as usize]] = true;
        }
    }
}

/// Sets the image of a capsule: the hull of two discs (centre, radius in pixels).
pub fn fill_discs_hull(mask: &mut Mask, a: (Point, f64), b: (Point, f64)) {
    /// A 24-gon lies within 0.9 % of the radius of the circle.
    const CORNERS: usize = 24;
    let mut points = Vec::with_capacity(2 * CORNERS);
    for (centre, radius) in [a, b] {
        for corner in 0..CORNERS {
            let angle = std::f64::consts::TAU * corner as f64 / CORNERS as f64;
            points.push([centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()]);
        }
    }
    fill_convex(mask, &convex_hull(&points));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::area;

    #[test]
    fn hull_drops_inner_points_and_keeps_corners() {
        let hull =
            convex_hull(&[[0.0, 0.0], [4.0, 0.0], [2.0, 1.0], [4.0, 4.0], [0.0, 4.0], [f64::NAN, 1.0]]);
        assert_eq!(hull.len(), 4);
        assert!(!hull.contains(&[2.0, 1.0]));
    }

    #[test]
    fn a_square_and_its_two_triangles_set_the_same_pixels() {
        let (a, b, c, d) = ([2.3, 1.7], [17.9, 3.1], [16.2, 15.5], [1.2, 12.8]);
        let mut whole = Mask::default((20, 20));
        fill_convex(&mut whole, &[a, b, c, d]);
        let mut halves = Mask::default((20, 20));
        fill_convex(&mut halves, &[a, b, c]);
        fill_convex(&mut halves, &[a, c, d]);
        assert_eq!(whole, halves);
    }

    #[test]
    fn a_disc_has_the_area_of_a_disc_and_shapes_outside_are_ignored() {
        let mut mask = Mask::default((101, 101));
        fill_discs_hull(&mut mask, ([50.0, 50.0], 30.0), ([50.0, 50.0], 30.0));
        // The 24-gon's area is 0.9886 of the circle's.
        let expected = 0.9886 * std::f64::consts::PI * 900.0;
        assert!((area(mask.view()) as f64 - expected).abs() < 0.01 * expected);
        let mut none = Mask::default((10, 10));
        fill_convex(&mut none, &[[-9.0, -9.0], [-5.0, -9.0], [-5.0, -5.0]]);
        fill_convex(&mut none, &[[f64::NAN; 2]; 3]);
        assert_eq!(area(none.view()), 0);
    }
}
