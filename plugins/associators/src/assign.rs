use std::cell::RefCell;

use tagalong_math::matching::Matcher;

thread_local! {
    /// Kept for its memory alone: with few people more time would go into asking for that than
    /// into the search.
    static MATCHER: RefCell<Matcher> = RefCell::new(Matcher::new());
}

/// Assigns rows (tracks) to columns (detections) so that the sum of costs is minimal. `cost(row,
/// column)` is `None` for a forbidden pair; a row without a column costs `miss[row]`. Returns the
/// column of each row. Among equally good assignments the choice depends on the order of rows and
/// columns only; a pair that costs as much as the miss is not formed. Costs must be finite.
///
/// ```
/// use tagalong_associators::assign;
/// let cost = [[Some(1.0), Some(2.0)], [Some(1.5), None]];
/// assert_eq!(assign(2, &[9.0, 9.0], |r, c| cost[r][c]), [Some(1), Some(0)]);
/// assert_eq!(assign(2, &[0.5, 9.0], |r, c| cost[r][c]), [None, Some(0)]);
/// ```
pub fn assign(
    columns: usize,
    miss: &[f64],
    cost: impl Fn(usize, usize) -> Option<f64>,
) -> Vec<Option<usize>> {
    let mut weights = Vec::with_capacity(columns * miss.len());
    for (row, miss) in miss.iter().enumerate() {
        // The gain of a pair is the miss that it saves.
        weights.extend((0..columns).map(|col| cost(row, col).map_or(0.0, |cost| miss - cost)));
    }
    MATCHER.with_borrow_mut(|matcher| matcher.best_of_matrix(miss.len(), columns, &weights))
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
