//! One-to-one assignment of unlabeled candidates to sites.

use voodoo_core::math::{CostTable, linear_sum_assignment};

/// Returns pairs (site, candidate), each index at most once, within the gate: as many pairs as possible, and among those the ones
/// with the least sum of squared distances. Sites and candidates may stay unassigned.
///
/// `alone` is the cost of an unassigned site as a squared distance; `None` maximizes the number of pairs. Infinite distances are
/// forbidden.
pub(super) fn assign(cost: &CostTable, gate: f64, alone: Option<f64>) -> Vec<(usize, usize)> {
    let (rows, columns) = (cost.rows(), cost.columns());
    if rows == 0 || columns == 0 {
        return Vec::new();
    }
    let squared = |row: usize, column: usize| {
        let value = cost.at(row, column);
        if value <= gate { value * value } else { f64::INFINITY }
    };
    // A pair outside the gate gets the cost of no pair, which exceeds every possible sum within the gate.
    let price = match alone {
        Some(alone) => gate * gate + alone * (rows as f64 + 1.0),
        None => gate * gate * (rows.min(columns) as f64 + 1.0),
    };
    let wide = columns + if alone.is_some() { rows } else { 0 };
    let mut pairs = linear_sum_assignment(&CostTable::from_fn(rows, wide, |row, column| match alone {
        Some(alone) if column >= columns => alone,
        _ => Some(squared(row, column)).filter(|value| value.is_finite()).unwrap_or(price),
    }));
    pairs.retain(|(row, column)| *column < columns && squared(*row, *column).is_finite());
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(rows: &[&[f64]]) -> CostTable {
        CostTable::from_fn(rows.len(), rows.first().map_or(0, |row| row.len()), |row, column| rows[row][column])
    }

    #[test]
    fn as_many_as_possible_and_of_those_the_nearest() {
        let cost = costs(&[&[0.05, 0.09], &[0.06, 0.5], &[f64::NAN, f64::INFINITY]]);
        assert_eq!(assign(&cost, 0.2, None), [(0, 1), (1, 0)], "both get one, although 0 likes 0 best");
        assert_eq!(assign(&cost, 0.055, None), [(0, 0)]);
        assert!(assign(&costs(&[&[], &[], &[]]), 1.0, None).is_empty());
    }

    #[test]
    fn a_site_may_rather_be_alone() {
        let cost = costs(&[&[0.9, f64::INFINITY], &[0.1, f64::INFINITY]]);
        assert_eq!(assign(&cost, 1.0, Some(0.8)), [(1, 0)]);
        assert_eq!(assign(&costs(&[&[0.95]]), 1.0, Some(0.8)), []);
        assert_eq!(assign(&costs(&[&[0.85]]), 1.0, Some(0.8)), [(0, 0)]);
    }

    /// The least sum of squares with the most pairs, by exhaustive search.
    fn best(cost: &CostTable, row: usize, taken: &mut Vec<bool>) -> (usize, f64) {
        if row == cost.rows() {
            return (0, 0.0);
        }
        let mut found = best(cost, row + 1, taken);
        for column in 0..cost.columns() {
            if !taken[column] && cost.at(row, column) <= 1.0 {
                taken[column] = true;
                let (count, sum) = best(cost, row + 1, taken);
                taken[column] = false;
                let with = (count + 1, sum + cost.at(row, column).powi(2));
                if with.0 > found.0 || (with.0 == found.0 && with.1 < found.1) {
                    found = with;
                }
            }
        }
        found
    }

    #[test]
    fn no_other_pairs_are_better() {
        let mut state = 1_u32;
        let mut chance = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        for _ in 0..300 {
            let (rows, columns) = (1 + (chance() * 4.0) as usize, 1 + (chance() * 5.0) as usize);
            let values: Vec<f64> = (0..rows * columns).map(|_| 1.6 * chance()).collect();
            let cost = CostTable::from_fn(rows, columns, |row, column| values[row * columns + column]);
            let pairs = assign(&cost, 1.0, None);
            let sum: f64 = pairs.iter().map(|(row, column)| cost.at(*row, *column).powi(2)).sum();
            let (count, least) = best(&cost, 0, &mut vec![false; columns]);
            assert_eq!(pairs.len(), count);
            assert!((sum - least).abs() < 1e-9);
        }
    }
}
