//! Who a believed stranger is, all of them at once: somebody who was lost or away, or somebody new.

use crate::math::{CostTable, linear_sum_assignment};

/// For every row the column that it is given, so that the costs add up to the least; `None` where its own cost, `alone`, is less. No
/// column is given twice.
pub(super) fn assign(costs: &[Vec<f64>], alone: f64) -> Vec<Option<usize>> {
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    // Everybody may stay alone: a column of their own. What is impossible still has a finite cost.
    let table = CostTable::from_fn(rows, columns + rows, |row, column| {
        costs[row].get(column).map_or(alone, |cost| cost.min(10.0 * alone))
    });
    let mut given = vec![None; rows];
    for (row, column) in linear_sum_assignment(&table) {
        given[row] = (column < columns && costs[row][column] < alone).then_some(column);
    }
    given
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
