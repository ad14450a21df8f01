//! Who a believed stranger is, all of them at once: somebody who was lost or away, or somebody new.

use pathfinding::kuhn_munkres::kuhn_munkres_min;
use pathfinding::matrix::Matrix;

/// The library counts in whole numbers: so many to one.
const GRAIN: f64 = 1e4;

/// For every row the column that it is given, so that the costs add up to the least; `None` where its own cost, `alone`, is less. No
/// column is given twice.
pub(super) fn assign(costs: &[Vec<f64>], alone: f64) -> Vec<Option<usize>> {
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    if rows == 0 {
        return Vec::new();
    }
    let whole = |cost: f64| (cost.min(10.0 * alone) * GRAIN).round() as i64;
    // Everybody may stay alone: a column of their own.
    let matrix = Matrix::from_fn(rows, columns + rows, |(row, column)| {
        if column < columns {
            whole(costs[row][column])
        } else if column - columns == row {
            whole(alone)
        } else {
            whole(10.0 * alone)
        }
    });
    let (_, given) = kuhn_munkres_min(&matrix);
    given
        .into_iter()
        .enumerate()
        .map(|(row, column)| (column < columns && costs[row][column] < alone).then_some(column))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_least_and_not_the_first_choice() {
        // Greedy would take 1 for the first row and leave 9 to the second.
        assert_eq!(assign(&[vec![1.0, 2.0], vec![1.1, 9.0]], 20.0), [Some(1), Some(0)]);
        assert_eq!(assign(&[vec![1.0, 2.0], vec![1.1, 9.0]], 0.5), [None, None]);
        assert_eq!(assign(&[vec![1.0], vec![0.5]], 2.0), [None, Some(0)]);
        assert_eq!(assign(&[vec![]], 2.0), [None]);
        assert!(assign(&[], 2.0).is_empty());
    }
}
