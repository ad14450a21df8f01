//! Joint assignment of all confirmed tentative tracks to lost or absent persons, or to new ones.

use crate::math::linear_sum_assignment;

/// Returns for every row its column in the assignment of least total cost, or `None` where the row is left alone, at its cost
/// `alone`. No column is used twice.
pub(super) fn assign(costs: &[Vec<f64>], alone: impl Fn(usize) -> f64) -> Vec<Option<usize>> {
    /// Cost of impossible pairs, which has to be finite.
    const IMPOSSIBLE: f64 = 1e3;
    let (rows, columns) = (costs.len(), costs.first().map_or(0, Vec::len));
    // Each row has an additional column for staying alone.
    let cost = |row: usize, column: usize| costs[row].get(column).map_or(alone(row), |cost| cost.min(IMPOSSIBLE));
    let pairs = linear_sum_assignment(rows, columns + rows, &cost).into_iter();
    pairs.map(|(row, column)| (column < columns && costs[row][column] < alone(row)).then_some(column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_least_and_not_the_first_choice() {
        // A greedy choice would take 1 for the first row and leave 9 to the second.
        assert_eq!(assign(&[vec![1.0, 2.0], vec![1.1, 9.0]], |_| 20.0), [Some(1), Some(0)]);
        assert_eq!(assign(&[vec![1.0, 2.0], vec![1.1, 9.0]], |_| 0.5), [None, None]);
        assert_eq!(assign(&[vec![1.0], vec![0.5]], |_| 2.0), [None, Some(0)]);
        // What is probably nobody does not take the column of somebody.
        assert_eq!(assign(&[vec![1.0], vec![0.5]], |row| [4.0, 1.0][row]), [Some(0), None]);
        assert_eq!(assign(&[vec![]], |_| 2.0), [None]);
        assert!(assign(&[], |_| 2.0).is_empty());
    }
}
