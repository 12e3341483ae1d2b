//! Global assignment with gates.
//!
//! Shortest augmenting paths with potentials (Jonker and Volgenant, "A Shortest Augmenting Path
//! Algorithm for Dense and Sparse Linear Assignment Problems", Computing 38, 1987). A row may stay
//! unassigned: each row has a private column that stands for it.

/// Assigns rows (tracks) to columns (detections) so that the sum of costs is minimal. `cost(row,
/// column)` is `None` for a forbidden pair; a row without a column costs `miss[row]`. Returns the
/// column of each row. Among equally good assignments the choice depends on the order of rows and
/// columns only. Costs must be finite.
///
/// ```
/// use tagalong_assignment::assign;
/// let cost = [[Some(1.0), Some(2.0)], [Some(1.5), None]];
/// assert_eq!(assign(2, &[9.0, 9.0], |r, c| cost[r][c]), [Some(1), Some(0)]);
/// assert_eq!(assign(2, &[0.5, 9.0], |r, c| cost[r][c]), [None, Some(0)]);
/// ```
pub fn assign(
    columns: usize,
    miss: &[f64],
    cost: impl Fn(usize, usize) -> Option<f64>,
) -> Vec<Option<usize>> {
    let padded = |row: usize, column: usize| {
        if column < columns {
            cost(row, column).unwrap_or(f64::INFINITY)
        } else if column - columns == row {
            // The private column of the row, which stands for no assignment.
            miss[row]
        } else {
            f64::INFINITY
        }
    };
    let mut search = Search::new(miss.len(), columns + miss.len());
    for row in 0..miss.len() {
        search.augment(row, &padded);
    }
    search.columns_of_rows().map(|column| column.filter(|c| *c < columns)).collect()
}

struct Search {
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
    row_of_column: Vec<Option<usize>>,
}

impl Search {
    fn new(rows: usize, columns: usize) -> Self {
        Self {
            row_potential: vec![0.0; rows],
            column_potential: vec![0.0; columns],
            row_of_column: vec![None; columns],
        }
    }

    /// Assigns a column to `start` along the shortest alternating path (Dijkstra on reduced costs).
    /// A path always exists, because each row can stay unassigned.
    fn augment(&mut self, start: usize, cost: &impl Fn(usize, usize) -> f64) {
        let columns = self.row_of_column.len();
        let mut distance = vec![f64::INFINITY; columns];
        let mut before: Vec<Option<usize>> = vec![None; columns];
        let mut settled: Vec<usize> = Vec::new();
        let mut open: Vec<usize> = (0..columns).collect();
        let (mut row, mut reached, mut via) = (start, 0.0, None);
        let end = loop {
            for &column in &open {
                let reduced =
                    cost(row, column) - self.row_potential[row] - self.column_potential[column]
                        + reached;
                if reduced < distance[column] {
                    distance[column] = reduced;
                    before[column] = via;
                }
            }
            let Some(place) = nearest_column(&open, &distance) else { return };
            let column = open.remove(place);
            reached = distance[column];
            match self.row_of_column[column] {
                None => break column,
                Some(next) => {
                    settled.push(column);
                    (row, via) = (next, Some(column));
                }
            }
        };
        self.adjust(start, &settled, &distance, reached);
        self.flip(start, end, &before);
    }

    fn adjust(&mut self, start: usize, settled: &[usize], distance: &[f64], reached: f64) {
        // Without this step some reduced costs become negative, for which Dijkstra is not valid.
        self.row_potential[start] += reached;
        for &column in settled {
            let slack = reached - distance[column];
            self.column_potential[column] -= slack;
            if let Some(row) = self.row_of_column[column] {
                self.row_potential[row] += slack;
            }
        }
    }

    fn flip(&mut self, start: usize, end: usize, before: &[Option<usize>]) {
        let mut column = end;
        while let Some(previous) = before[column] {
            self.row_of_column[column] = self.row_of_column[previous];
            column = previous;
        }
        self.row_of_column[column] = Some(start);
    }

    fn columns_of_rows(&self) -> impl Iterator<Item = Option<usize>> {
        let mut columns = vec![None; self.row_potential.len()];
        for (column, row) in self.row_of_column.iter().enumerate() {
            if let Some(row) = row {
                columns[*row] = Some(column);
            }
        }
        columns.into_iter()
    }
}

fn nearest_column(open: &[usize], distance: &[f64]) -> Option<usize> {
    let place = (0..open.len()).min_by(|a, b| distance[open[*a]].total_cmp(&distance[open[*b]]))?;
    distance[open[place]].is_finite().then_some(place)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn total(cost: &[Vec<Option<f64>>], miss: &[f64], columns: &[Option<usize>]) -> Option<f64> {
        let mut sum = 0.0;
        for (row, column) in columns.iter().enumerate() {
            sum += match column {
                Some(column) => cost[row][*column]?,
                None => miss[row],
            };
        }
        Some(sum)
    }

    /// Tries all ways to assign different columns or none to the rows.
    fn best_of_all(cost: &[Vec<Option<f64>>], miss: &[f64], taken: &mut Vec<Option<usize>>) -> f64 {
        if taken.len() == miss.len() {
            return total(cost, miss, taken).unwrap_or(f64::INFINITY);
        }
        let columns = cost.first().map_or(0, Vec::len);
        let mut best = f64::INFINITY;
        for choice in std::iter::once(None).chain((0..columns).map(Some)) {
            if choice.is_none() || !taken.contains(&choice) {
                taken.push(choice);
                best = best.min(best_of_all(cost, miss, taken));
                taken.pop();
            }
        }
        best
    }

    fn problem() -> impl Strategy<Value = (Vec<Vec<Option<f64>>>, Vec<f64>)> {
        (1..6usize, 0..6usize).prop_flat_map(|(rows, columns)| {
            let pair = prop_oneof![1 => Just(None), 3 => (-5.0..20.0f64).prop_map(Some),
                                   1 => (0..3u8).prop_map(|c| Some(f64::from(c)))];
            (
                prop::collection::vec(prop::collection::vec(pair, columns), rows),
                prop::collection::vec(0.0..15.0f64, rows),
            )
        })
    }

    proptest! {
        #[test]
        fn it_is_as_good_as_the_best_of_all_assignments((cost, miss) in problem()) {
            let columns = cost[0].len();
            let found = assign(columns, &miss, |r, c| cost[r][c]);
            let mut used: Vec<_> = found.iter().flatten().collect();
            used.sort();
            used.dedup();
            prop_assert_eq!(used.len(), found.iter().flatten().count(), "a column twice");
            let sum = total(&cost, &miss, &found);
            let best = best_of_all(&cost, &miss, &mut Vec::new());
            prop_assert!(sum.is_some_and(|s| (s - best).abs() < 1e-9), "{sum:?} {best}");
        }
    }

    #[test]
    fn nothing_to_assign() {
        assert_eq!(assign(3, &[], |_, _| None), []);
        assert_eq!(assign(0, &[1.0, 2.0], |_, _| None), [None, None]);
    }

    #[test]
    fn a_large_problem_is_solved() {
        let n = 256;
        let miss = vec![1e6; n];
        let found = assign(4 * n, &miss, |r, c| Some(((r * 7919 + c * 104_729) % 1009) as f64));
        assert!(found.iter().all(Option::is_some));
    }
}
