//! The linear assignment problem.

/// A table of costs, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct CostTable {
    columns: usize,
    values: Vec<f64>,
}

impl CostTable {
    /// The costs by row and column.
    pub fn from_fn(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Self {
        let cost = &cost;
        let values = (0..rows).flat_map(|row| (0..columns).map(move |column| cost(row, column))).collect();
        Self { columns, values }
    }

    /// Number of rows; 0 without columns.
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Cost of a pair.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows(), |row, column| self.at(column, row))
    }
}

/// The pairs (row, column) with the least sum of finite costs, sorted by row. Every row or every column occurs once, whichever
/// are fewer.
///
/// Shortest augmenting paths (Crouse, "On implementing 2D rectangular assignment algorithms", 2016). Among assignments of equal
/// cost it returns the one of SciPy's `linear_sum_assignment`.
pub fn linear_sum_assignment(cost: &CostTable) -> Vec<(usize, usize)> {
    if cost.columns < cost.rows() {
        let mut pairs: Vec<_> =
            linear_sum_assignment(&cost.transposed()).into_iter().map(|(column, row)| (row, column)).collect();
        pairs.sort_unstable();
        return pairs;
    }
    let mut search = Search::new(cost);
    for row in 0..cost.rows() {
        search.add(row);
    }
    search.column_of.iter().enumerate().filter_map(|(row, column)| column.map(|column| (row, column))).collect()
}

/// The partial assignment, and the dual prices that prove it optimal.
struct Search<'a> {
    cost: &'a CostTable,
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    column_of: Vec<Option<usize>>,
    row_of: Vec<Option<usize>>,
    shortest: Vec<f64>,
    from: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(cost: &'a CostTable) -> Self {
        let (rows, columns) = (cost.rows(), cost.columns);
        Self {
            cost,
            row_price: vec![0.0; rows],
            column_price: vec![0.0; columns],
            column_of: vec![None; rows],
            row_of: vec![None; columns],
            shortest: vec![0.0; columns],
            from: vec![0; columns],
        }
    }

    /// Assigns a column to one more row, reassigning other rows as needed.
    fn add(&mut self, row: usize) {
        let (mut rows, mut columns) = (vec![false; self.row_price.len()], vec![false; self.column_price.len()]);
        let Some((sink, least)) = self.path(row, &mut rows, &mut columns) else { return };
        self.row_price[row] += least;
        for other in (0..rows.len()).filter(|other| rows[*other] && *other != row) {
            if let Some(column) = self.column_of[other] {
                self.row_price[other] += least - self.shortest[column];
            }
        }
        for column in (0..columns.len()).filter(|column| columns[*column]) {
            self.column_price[column] -= least - self.shortest[column];
        }
        let mut column = sink;
        loop {
            let other = self.from[column];
            self.row_of[column] = Some(other);
            match self.column_of[other].replace(column) {
                Some(next) if other != row => column = next,
                _ => return,
            }
        }
    }

    /// The shortest augmenting path from a row to an unassigned column, and its length; marks the visited rows and columns.
    fn path(&mut self, row: usize, rows: &mut [bool], columns: &mut [bool]) -> Option<(usize, f64)> {
        let mut remaining: Vec<usize> = (0..columns.len()).rev().collect();
        self.shortest.fill(f64::INFINITY);
        let (mut row, mut least) = (row, 0.0);
        loop {
            rows[row] = true;
            let (mut lowest, mut index) = (f64::INFINITY, None);
            for (place, &column) in remaining.iter().enumerate() {
                let through = least + self.cost.at(row, column) - self.row_price[row] - self.column_price[column];
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
            columns[column] = true;
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
    fn least(cost: &CostTable, row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == cost.rows() {
            return 0.0;
        }
        let mut found = f64::INFINITY;
        for column in 0..cost.columns() {
            if !taken[column] {
                taken[column] = true;
                found = found.min(cost.at(row, column) + least(cost, row + 1, taken));
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
            let wide = CostTable::from_fn(rows, rows + extra, |row, column| values[row * (rows + extra) + column]);
            let pairs = linear_sum_assignment(&wide);
            let sum: f64 = pairs.iter().map(|(row, column)| wide.at(*row, *column)).sum();
            assert!(pairs.iter().map(|(row, _)| *row).eq(0..rows));
            assert!((sum - least(&wide, 0, &mut vec![false; rows + extra])).abs() < 1e-12);
            let mut turned: Vec<_> =
                linear_sum_assignment(&wide.transposed()).into_iter().map(|(row, column)| (column, row)).collect();
            turned.sort_unstable();
            assert_eq!(turned, pairs);
        }
        assert!(linear_sum_assignment(&CostTable::from_fn(3, 0, |_, _| 0.0)).is_empty());
    }
}
