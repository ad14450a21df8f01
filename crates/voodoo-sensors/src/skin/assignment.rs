//! One-to-one assignment of unlabelled candidates to sites: shortest augmenting paths (Crouse, "On implementing 2D rectangular
//! assignment algorithms", 2016), between equals in the order of SciPy's `linear_sum_assignment`.

/// A table of costs, row by row.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    pub columns: usize,
    pub values: Vec<f64>,
}

impl Costs {
    pub fn filled(rows: usize, columns: usize, value: f64) -> Self {
        Self { columns, values: vec![value; rows * columns] }
    }

    pub fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.columns + column] = value;
    }

    fn turned(&self) -> Self {
        let (rows, columns) = (self.rows(), self.columns);
        let values = (0..columns).flat_map(|column| (0..rows).map(move |row| self.at(row, column))).collect();
        Self { columns: rows, values }
    }
}

/// Pairs (site, candidate), each used once at most, that lie within the gate: as many as possible, and of those the ones with the
/// least sum of squared distances; a candidate or site without a partner stays alone.
///
/// `alone` is the squared distance at which a site is rather left alone; none: as many pairs as possible. Infinite = impossible.
pub(super) fn assign(cost: &Costs, gate: f64, alone: Option<f64>) -> Vec<(usize, usize)> {
    let (rows, columns) = (cost.rows(), cost.columns);
    if rows == 0 || columns == 0 {
        return Vec::new();
    }
    let squared = |row: usize, column: usize| {
        let value = cost.at(row, column);
        if value <= gate { value * value } else { f64::INFINITY }
    };
    // Beyond the gate a pair is as good as none; the price of none is one no sum within the gate can reach.
    let price = match alone {
        Some(alone) => gate * gate + alone * (rows as f64 + 1.0),
        None => gate * gate * (rows.min(columns) as f64 + 1.0),
    };
    let wide = columns + if alone.is_some() { rows } else { 0 };
    let mut table = Costs::filled(rows, wide, alone.unwrap_or(price));
    for row in 0..rows {
        for column in 0..columns {
            let value = squared(row, column);
            table.set(row, column, if value.is_finite() { value } else { price });
        }
    }
    let mut pairs = cheapest(&table);
    pairs.retain(|(row, column)| *column < columns && squared(*row, *column).is_finite());
    pairs
}

/// The pairs (row, column) with the least sum of finite costs, every row or every column once, by rows.
fn cheapest(cost: &Costs) -> Vec<(usize, usize)> {
    if cost.columns < cost.rows() {
        let mut pairs: Vec<_> = cheapest(&cost.turned()).into_iter().map(|(column, row)| (row, column)).collect();
        pairs.sort_unstable();
        return pairs;
    }
    let mut search = Search::new(cost);
    for row in 0..cost.rows() {
        search.add(row);
    }
    search.column_of.iter().enumerate().filter_map(|(row, column)| column.map(|column| (row, column))).collect()
}

/// Rows and columns given to each other so far, and the prices that show it is the cheapest way.
struct Search<'a> {
    cost: &'a Costs,
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    column_of: Vec<Option<usize>>,
    row_of: Vec<Option<usize>>,
    shortest: Vec<f64>,
    from: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(cost: &'a Costs) -> Self {
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

    /// Gives a column to one more row, for which others may change theirs.
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

    /// The cheapest way from a row to a column that nobody has, and its length; marks rows and columns that were looked at.
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
                // Between equals one that nobody has ends the search.
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

    fn costs(rows: &[&[f64]]) -> Costs {
        Costs { columns: rows.first().map_or(0, |row| row.len()), values: rows.concat() }
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

    /// The least sum of squares with the most pairs, tried out.
    fn best(cost: &Costs, row: usize, taken: &mut Vec<bool>) -> (usize, f64) {
        if row == cost.rows() {
            return (0, 0.0);
        }
        let mut found = best(cost, row + 1, taken);
        for column in 0..cost.columns {
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
            let cost = Costs { columns, values: (0..rows * columns).map(|_| 1.6 * chance()).collect() };
            let pairs = assign(&cost, 1.0, None);
            let sum: f64 = pairs.iter().map(|(row, column)| cost.at(*row, *column).powi(2)).sum();
            let (count, least) = best(&cost, 0, &mut vec![false; columns]);
            assert_eq!(pairs.len(), count);
            assert!((sum - least).abs() < 1e-9);
        }
    }
}
