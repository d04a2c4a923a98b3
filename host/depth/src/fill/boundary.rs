//! Moore-neighbour tracing of a region's outer boundary.

use ndarray::ArrayView2;

/// Clockwise from the left (rows grow downwards).
const NEIGHBOURS: [(isize, isize); 8] =
    [(0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1)];

/// Clockwise outer boundary, (row, column), of the 8-connected region of `mask` whose first pixel in reading order is
/// `start`. Parts one pixel wide appear once per side. Ends by Jacob's criterion. O(boundary).
///
/// # Panics
/// If `start` lies outside the mask or is not set.
pub fn trace_boundary(mask: ArrayView2<bool>, start: (usize, usize)) -> Vec<(usize, usize)> {
    assert!(mask[start], "the start must belong to the region");
    let step = |(y, x): (usize, usize), direction: usize| {
        let (dy, dx) = NEIGHBOURS[direction];
        let next = (y.checked_add_signed(dy)?, x.checked_add_signed(dx)?);
        mask.get(next).copied().unwrap_or(false).then_some(next)
    };
    // In reading order the pixel left of the start is background, so the search begins there.
    let mut boundary = vec![start];
    let mut pixel = start;
    let mut from = 0;
    let mut first_move = None;
    loop {
        let Some((direction, next)) =
            (0..8).map(|i| (from + i) % 8).find_map(|direction| Some((direction, step(pixel, direction)?)))
        else {
            return boundary;
        };
        if first_move == Some((pixel, direction)) {
            boundary.pop();
            return boundary;
        }
        first_move.get_or_insert((pixel, direction));
        boundary.push(next);
        pixel = next;
        // The last background pixel from the new one: straight moves turn back two eighths, diagonal ones three.
        from = (direction + if direction % 2 == 0 { 6 } else { 5 }) % 8;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn mask(rows: &[&str]) -> Array2<bool> {
        Array2::from_shape_fn((rows.len(), rows[0].len()), |(y, x)| rows[y].as_bytes()[x] == b'#')
    }

    fn start(mask: &Array2<bool>) -> (usize, usize) {
        mask.indexed_iter().find(|(_, set)| **set).unwrap().0
    }

    #[test]
    fn a_square_has_a_border() {
        let mask = mask(&[".....", ".###.", ".###.", ".###.", "....."]);
        let boundary = trace_boundary(mask.view(), start(&mask));
        assert_eq!(boundary, [(1, 1), (1, 2), (1, 3), (2, 3), (3, 3), (3, 2), (3, 1), (2, 1)]);
    }

    #[test]
    fn a_single_pixel_a_line_and_the_border_of_the_mask() {
        let single = mask(&["...", ".#.", "..."]);
        assert_eq!(trace_boundary(single.view(), (1, 1)), [(1, 1)]);
        let line = mask(&["###"]);
        assert_eq!(trace_boundary(line.view(), (0, 0)), [(0, 0), (0, 1), (0, 2), (0, 1)]);
    }

    /// Every boundary pixel has a 4-neighbour outside, and every such pixel of a region without holes is visited.
    #[test]
    fn the_boundary_is_that_of_the_definition() {
        for shape in [
            mask(&["..##..", ".####.", "######", ".####.", "..##.."]),
            mask(&["#....#", "##..##", ".####.", "..##..", ".#..#."]),
            mask(&["......", ".#.#..", ".###..", "...##.", "....#."]),
        ] {
            let boundary = trace_boundary(shape.view(), start(&shape));
            let outside = |y: isize, x: isize| {
                let at = (y.try_into().unwrap_or(usize::MAX), x.try_into().unwrap_or(usize::MAX));
                !shape.get(at).copied().unwrap_or(false)
            };
            for ((y, x), set) in shape.indexed_iter() {
                let [sy, sx] = [y as isize, x as isize];
                let border = *set
                    && [(0, 1), (0, -1), (1, 0), (-1, 0)].iter().any(|(dy, dx)| outside(sy + dy, sx + dx));
                assert_eq!(border, boundary.contains(&(y, x)), "({x}, {y})");
            }
        }
    }
}
