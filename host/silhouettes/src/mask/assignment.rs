//! Minimum-cost assignment by shortest augmenting paths (Jonker and Volgenant, Computing 38, 1987).

use ndarray::{Array2, ArrayView2};

/// The column of every row. Of all ways to pair rows and columns at costs below `limit`, returns one with the
/// most pairs and, among those, the least sum. O(n^3) for the larger side n.
#[must_use]
pub fn assigned(costs: ArrayView2<'_, f64>, limit: f64) -> Vec<Option<usize>> {
    let (rows, columns) = costs.dim();
    let n = rows.max(columns);
    // Square; an impossible pair costs more than all possible ones together.
    let impossible = (limit.abs() + 1.0) * (n + 1) as f64;
    let square = Array2::from_shape_fn((n, n), |(row, column)| match costs.get((row, column)) {
        Some(cost) if *cost < limit => cost.max(0.0),
        _ => impossible,
    });
    let mut row_of = vec![None; n];
    let (mut of_rows, mut of_columns) = (vec![0.0; n], vec![0.0; n]);
    for row in 0..n {
        augment(&square, row, &mut row_of, &mut of_rows, &mut of_columns);
    }
    let mut column_of = vec![None; rows];
    for (column, row) in row_of.into_iter().enumerate() {
        if let Some(row) =
            row.filter(|row| *row < rows && column < columns && square[(*row, column)] < impossible)
        {
            column_of[row] = Some(column);
        }
    }
    column_of
}

/// Gives `row` a column along the cheapest path of changed pairs.
fn augment(
    costs: &Array2<f64>,
    row: usize,
    row_of: &mut [Option<usize>],
    of_rows: &mut [f64],
    of_columns: &mut [f64],
) {
    let n = row_of.len();
    let mut least = vec![f64::INFINITY; n];
    let mut from: Vec<Option<usize>> = vec![None; n];
    let mut done = vec![false; n];
    // The column whose row is examined; none for the new row.
    let mut at: Option<usize> = None;
    let end = loop {
        let here = at.and_then(|column| row_of[column]).unwrap_or(row);
        let mut next = None;
        let mut step = f64::INFINITY;
        for column in (0..n).filter(|&column| !done[column]) {
            let reduced = costs[(here, column)] - of_rows[here] - of_columns[column];
            if reduced < least[column] {
                (least[column], from[column]) = (reduced, at);
            }
            if least[column] < step {
                (step, next) = (least[column], Some(column));
            }
        }
        let Some(next) = next else { return };
        of_rows[row] += step;
        for column in 0..n {
            if done[column] {
                of_columns[column] -= step;
                if let Some(paired) = row_of[column] {
                    of_rows[paired] += step;
                }
            } else {
                least[column] -= step;
            }
        }
        done[next] = true;
        if row_of[next].is_none() {
            break next;
        }
        at = Some(next);
    };
    let mut column = end;
    loop {
        match from[column] {
            Some(before) => {
                row_of[column] = row_of[before];
                column = before;
            }
            None => {
                row_of[column] = Some(row);
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::arr2;
    use proptest::prelude::*;

    fn tried(costs: &Array2<f64>, limit: f64, row: usize, used: &mut Vec<bool>) -> (usize, f64) {
        if row == costs.nrows() {
            return (0, 0.0);
        }
        let mut best = tried(costs, limit, row + 1, used);
        for column in 0..costs.ncols() {
            if used[column] || costs[(row, column)] >= limit {
                continue;
            }
            used[column] = true;
            let (pairs, sum) = tried(costs, limit, row + 1, used);
            used[column] = false;
            let found = (pairs + 1, sum + costs[(row, column)]);
            if found.0 > best.0 || (found.0 == best.0 && found.1 < best.1) {
                best = found;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_other_way_is_cheaper(
            rows in 0_usize..5, columns in 0_usize..5, values in prop::collection::vec(0.0..10.0_f64, 25)
        ) {
            let costs = Array2::from_shape_fn((rows, columns), |(i, k)| values[5 * i + k]);
            let found = assigned(costs.view(), 8.0);
            let pairs: Vec<(usize, usize)> = found.iter().enumerate().filter_map(|(row, column)| Some((row, (*column)?))).collect();
            let sum: f64 = pairs.iter().map(|pair| costs[*pair]).sum();
            let mut columns_used: Vec<usize> = pairs.iter().map(|pair| pair.1).collect();
            columns_used.sort_unstable();
            columns_used.dedup();
            prop_assert_eq!(columns_used.len(), pairs.len());
            let (most, least) = tried(&costs, 8.0, 0, &mut vec![false; columns]);
            prop_assert_eq!(pairs.len(), most);
            prop_assert!((sum - least).abs() < 1e-9, "{} {}", sum, least);
        }
    }

    #[test]
    fn unmatched_items_stay_unassigned() {
        let costs = arr2(&[[1.0, f64::NAN], [f64::INFINITY, 9.0]]);
        assert_eq!(assigned(costs.view(), 5.0), [Some(0), None]);
        assert_eq!(assigned(arr2(&[[3.0], [1.0]]).view(), 5.0), [None, Some(0)]);
        assert!(assigned(Array2::zeros((0, 3)).view(), 5.0).is_empty());
    }
}
