//! Silhouettes along a rotated axis, without image rotation or resampling loss. Only the lower edge of each column and
//! the pixels left of a column are needed. They follow from `x' = x cos b - y sin b`, `y' = x sin b + y cos b` (Li
//! 2014, eq. 8.38) in one pass over the outline per angle.

use farnear_silhouettes::mask::Mask;

/// Outline pixels (set, next to an unset 4-neighbour or the border) and row extents.
#[derive(Clone, Debug)]
pub struct Outline {
    pub points: Vec<[f32; 2]>,
    pub area: usize,
    /// (top, bottom, left, right) of the set pixels.
    pub bounds: (usize, usize, usize, usize),
}

impl Outline {
    /// `None` for an empty mask. One pass.
    pub fn new(mask: &Mask) -> Option<Self> {
        let (height, width) = mask.dim();
        let mut points = Vec::with_capacity(4096);
        let (mut area, mut bounds) = (0_usize, None::<(usize, usize, usize, usize)>);
        let rows = mask.as_slice()?;
        for y in 0..height {
            let row = &rows[y * width..(y + 1) * width];
            let Some((first, last)) = row_extent(row) else { continue };
            bounds =
                Some(bounds.map_or((y, y, first, last), |(t, _, l, r)| (t, y, l.min(first), r.max(last))));
            let above = if y > 0 { &rows[(y - 1) * width..y * width] } else { &[] };
            let below = if y + 1 < height { &rows[(y + 1) * width..(y + 2) * width] } else { &[] };
            for x in first..=last {
                if !row[x] {
                    continue;
                }
                area += 1;
                let inside = x > 0
                    && x + 1 < width
                    && row[x - 1]
                    && row[x + 1]
                    && above.get(x).copied().unwrap_or(false)
                    && below.get(x).copied().unwrap_or(false);
                if !inside {
                    points.push([x as f32, y as f32]);
                }
            }
        }
        bounds.map(|bounds| Self { points, area, bounds })
    }

    /// Largest y' per column x' (empty columns repeat their left neighbour), and the x' of column 0.
    pub fn lower_edge(&self, angle_rad: f32, flip_width: Option<f32>) -> LowerEdge {
        let (sin, cos) = angle_rad.sin_cos();
        let turn = |p: &[f32; 2]| {
            let x = flip_width.map_or(p[0], |width| width - 1.0 - p[0]);
            (x * cos - p[1] * sin, x * sin + p[1] * cos)
        };
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for p in &self.points {
            let x = turn(p).0;
            low = low.min(x);
            high = high.max(x);
        }
        let columns = (high - low) as usize + 1;
        let mut edge = vec![f32::NEG_INFINITY; columns];
        for p in &self.points {
            let (x, y) = turn(p);
            let column = ((x - low) as usize).min(columns - 1);
            edge[column] = edge[column].max(y);
        }
        for i in 1..columns {
            if edge[i] == f32::NEG_INFINITY {
                edge[i] = edge[i - 1];
            }
        }
        LowerEdge { edge, origin: low }
    }
}

#[derive(Clone, Debug)]
pub struct LowerEdge {
    pub edge: Vec<f32>,
    pub origin: f32,
}

impl LowerEdge {
    /// Length and x' of the end of the longest run of negative slope, smoothed (Li 2014, section 8.2.4).
    pub fn rotation_point(&self, window: usize) -> (usize, f32) {
        let n = self.edge.len();
        let (mut best, mut run) = ((0_usize, self.origin), 0_usize);
        let half = (window / 2).max(1);
        for i in 0..n.saturating_sub(1) {
            // The mean gradient over a window is the difference of its ends over its length.
            let (from, to) = (i.saturating_sub(half), (i + half).min(n - 1));
            if self.edge[to] - self.edge[from] < 0.0 {
                run += 1;
                if run > best.0 {
                    best = (run, self.origin + i as f32 + 0.5);
                }
            } else {
                run = 0;
            }
        }
        best
    }
}

/// Clears pixels with `x cos b - y sin b < limit` in `out` and returns their number.
pub fn clear_left_of(out: &mut Mask, angle_rad: f32, limit: f32, flip: bool) -> usize {
    let (sin, cos) = angle_rad.sin_cos();
    let width = out.ncols();
    let mut cleared = 0;
    for (y, mut row) in out.rows_mut().into_iter().enumerate() {
        let Some(row) = row.as_slice_mut() else { continue };
        let Some((first, last)) = row_extent(row) else { continue };
        for (x, pixel) in row.iter_mut().enumerate().take(last + 1).skip(first) {
            let at = if flip { (width - 1 - x) as f32 } else { x as f32 };
            if *pixel && at * cos - y as f32 * sin < limit {
                *pixel = false;
                cleared += 1;
            }
        }
    }
    cleared
}

/// First and last set pixel of a row, if any. Skips 32 empty pixels at a time.
pub(super) fn row_extent(row: &[bool]) -> Option<(usize, usize)> {
    const BLOCK: usize = 32;
    let any = |part: &[bool]| part.iter().fold(false, |found, &set| found | set);
    let first_block = row.chunks(BLOCK).position(any)? * BLOCK;
    let first = first_block + row[first_block..].iter().position(|&set| set)?;
    let last_block = row.chunks(BLOCK).rposition(any)? * BLOCK;
    let last =
        last_block + row[last_block..row.len().min(last_block + BLOCK)].iter().rposition(|&set| set)?;
    Some((first, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_extents_span_blocks() {
        let mut row = [false; 130];
        assert_eq!(row_extent(&row), None);
        row[101] = true;
        assert_eq!(row_extent(&row), Some((101, 101)));
        row[3] = true;
        row[129] = true;
        assert_eq!(row_extent(&row), Some((3, 129)));
    }

    #[test]
    fn an_outline_is_what_has_an_unset_neighbour_or_the_border() {
        let block = Mask::from_shape_fn((7, 9), |(y, x)| (1..=4).contains(&y) && (2..=6).contains(&x));
        let outline = Outline::new(&block).expect("not empty");
        assert_eq!((outline.area, outline.bounds, outline.points.len()), (20, (1, 4, 2, 6), 14));
        assert!(!outline.points.contains(&[3.0, 2.0]) && outline.points.contains(&[2.0, 3.0]));
        let full = Outline::new(&Mask::from_elem((7, 9), true)).expect("not empty");
        assert_eq!((full.area, full.bounds, full.points.len()), (63, (0, 6, 0, 8), 28));
        assert!(Outline::new(&Mask::default((7, 9))).is_none());
    }

    /// Columns 2 to 4 and 7, down to row 5, 7, 3 and 6.
    fn comb() -> Mask {
        Mask::from_shape_fn((10, 12), |(y, x)| {
            y <= [0, 0, 5, 7, 3, 0, 0, 6, 0, 0, 0, 0][x] && [2, 3, 4, 7].contains(&x)
        })
    }

    #[test]
    fn the_lower_edge_is_the_lowest_pixel_of_each_column() {
        let edge = Outline::new(&comb()).expect("not empty").lower_edge(0.0, None);
        assert_eq!((edge.origin, edge.edge), (2.0, vec![5.0, 7.0, 3.0, 3.0, 3.0, 6.0]));
    }

    #[test]
    fn a_flipped_silhouette_is_that_of_the_mirrored_picture() {
        let mask = comb();
        let mirrored = Mask::from_shape_fn(mask.dim(), |(y, x)| mask[[y, 11 - x]]);
        let [plain, other] = [&mask, &mirrored].map(|mask| Outline::new(mask).expect("not empty"));
        for angle in [0.0, 0.7, 2.0] {
            let (flipped, expected) = (plain.lower_edge(angle, Some(12.0)), other.lower_edge(angle, None));
            assert_eq!((flipped.origin, flipped.edge), (expected.origin, expected.edge));
            let [mut left, mut of_mirrored] = [mask.clone(), mirrored.clone()];
            let cleared = clear_left_of(&mut left, angle, 1.5, true);
            assert_eq!(cleared, clear_left_of(&mut of_mirrored, angle, 1.5, false));
            assert_eq!(left, Mask::from_shape_fn(mask.dim(), |(y, x)| of_mirrored[[y, 11 - x]]));
        }
    }

    #[test]
    fn what_is_left_of_a_rotated_limit_is_cleared() {
        let mut left = Mask::from_elem((6, 8), true);
        let (angle, limit) = (0.5_f32, 1.0);
        let cleared = clear_left_of(&mut left, angle, limit, false);
        for ((y, x), left) in left.indexed_iter() {
            assert_eq!(*left, x as f32 * angle.cos() - y as f32 * angle.sin() >= limit, "{x}, {y}");
        }
        assert_eq!(cleared, left.iter().filter(|left| !**left).count());
    }

    #[test]
    fn the_rotation_point_ends_the_longest_fall() {
        let falling = |edge: &[f32]| LowerEdge { edge: edge.to_vec(), origin: 10.0 }.rotation_point(2);
        // Each slope is over the neighbours of a column.
        assert_eq!(falling(&[0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, 1.0, 2.0]), (2, 15.5));
        assert_eq!(falling(&[5.0, 4.0, 5.0, 9.0, 8.0, 7.0, 6.0, 6.0]), (3, 16.5));
        assert_eq!(falling(&[0.0, 1.0, 2.0]), (0, 10.0));
    }
}
