//! The linear assignment problem.

/// The pairs (row, column) with the least sum of finite costs, sorted by row. Every row or every column occurs once, whichever
/// are fewer.
///
/// Shortest augmenting paths (Crouse, "On implementing 2D rectangular assignment algorithms", 2016). Among assignments of equal
/// cost it returns the one of SciPy's `linear_sum_assignment`.
pub fn linear_sum_assignment(rows: usize, columns: usize, cost: &dyn Fn(usize, usize) -> f64) -> Vec<(usize, usize)> {
    if columns < rows {
        let transposed = linear_sum_assignment(columns, rows, &|column, row| cost(row, column));
        let mut pairs: Vec<_> = transposed.into_iter().map(|(column, row)| (row, column)).collect();
        pairs.sort_unstable();
        return pairs;
    }
    let mut search = Search {
        costs: (0..rows).flat_map(|row| (0..columns).map(move |column| cost(row, column))).collect(),
        row_price: vec![0.0; rows],
        column_price: vec![0.0; columns],
        column_of: vec![None; rows],
        row_of: vec![None; columns],
        shortest: vec![0.0; columns],
        from: vec![0; columns],
    };
    for row in 0..rows {
        search.add(row);
    }
    search.column_of.iter().enumerate().filter_map(|(row, column)| column.map(|column| (row, column))).collect()
}

/// The partial assignment, and the dual prices that prove it optimal.
struct Search {
    /// By row and column.
    costs: Vec<f64>,
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    column_of: Vec<Option<usize>>,
    row_of: Vec<Option<usize>>,
    shortest: Vec<f64>,
    from: Vec<usize>,
}

impl Search {
    /// Assigns a column to one more row, reassigning other rows as needed.
    fn add(&mut self, row: usize) {
        let mut visited = Vec::new();
        let Some((mut column, least)) = self.path(row, &mut visited) else { return };
        self.row_price[row] += least;
        for column in visited {
            let ahead = least - self.shortest[column];
            self.column_price[column] -= ahead;
            if let Some(other) = self.row_of[column] {
                self.row_price[other] += ahead;
            }
        }
        loop {
            let other = self.from[column];
            self.row_of[column] = Some(other);
            match self.column_of[other].replace(column) {
                Some(next) if other != row => column = next,
                _ => return,
            }
        }
    }

    /// The unassigned column at the end of the shortest augmenting path from a row, and the path's length; adds the visited columns.
    fn path(&mut self, row: usize, visited: &mut Vec<usize>) -> Option<(usize, f64)> {
        let mut remaining: Vec<usize> = (0..self.column_price.len()).rev().collect();
        self.shortest.fill(f64::INFINITY);
        let (mut row, mut least) = (row, 0.0);
        loop {
            let (mut lowest, mut index) = (f64::INFINITY, None);
            for (place, &column) in remaining.iter().enumerate() {
                let cost = self.costs[row * self.column_price.len() + column];
                let through = least + cost - self.row_price[row] - self.column_price[column];
                if through < self.shortest[column] {
                    self.from[column] = row;
                    self.shortest[column] = through;
                }
                let away = self.shortest[column];
                // Among equals, an unassigned column ends the search.
                if away < lowest || (away == lowest && self.row_of[column].is_none()) {
                    (lowest, index) = (away, Some(place));
                }
            }
            let column = remaining.swap_remove(index.filter(|_| lowest.is_finite())?);
            least = lowest;
            visited.push(column);
            match self.row_of[column] {
                None => return Some((column, least)),
                Some(next) => row = next,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least sum by exhaustive search; there are at most as many rows as columns.
    fn least(cost: &dyn Fn(usize, usize) -> f64, row: usize, rows: usize, taken: &mut Vec<bool>) -> f64 {
        if row == rows {
            return 0.0;
        }
        let mut found = f64::INFINITY;
        for column in 0..taken.len() {
            if !taken[column] {
                taken[column] = true;
                found = found.min(cost(row, column) + least(cost, row + 1, rows, taken));
                taken[column] = false;
            }
        }
        found
    }

    #[test]
    fn no_other_pairs_cost_less() {
        let mut state = 1_u32;
        let mut chance = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        for _ in 0..200 {
            let (rows, extra) = (1 + (chance() * 4.0) as usize, (chance() * 3.0) as usize);
            let values: Vec<f64> = (0..rows * (rows + extra)).map(|_| chance() - 0.5).collect();
            let columns = rows + extra;
            let wide = |row: usize, column: usize| values[row * columns + column];
            let pairs = linear_sum_assignment(rows, columns, &wide);
            let sum: f64 = pairs.iter().map(|(row, column)| wide(*row, *column)).sum();
            assert!(pairs.iter().map(|(row, _)| *row).eq(0..rows));
            assert!((sum - least(&wide, 0, rows, &mut vec![false; columns])).abs() < 1e-12);
            let turned = linear_sum_assignment(columns, rows, &|column, row| wide(row, column));
            let mut turned: Vec<_> = turned.into_iter().map(|(row, column)| (column, row)).collect();
            turned.sort_unstable();
            assert_eq!(turned, pairs);
        }
        assert!(linear_sum_assignment(3, 0, &|_, _| 0.0).is_empty());
    }
}
