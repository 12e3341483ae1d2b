use proptest::prelude::*;

use super::*;

/// Returns the greatest total weight, by trying everything.
fn best_total(row: u32, rows: u32, edges: &[Edge], taken: &mut Vec<u32>) -> f64 {
    if row == rows {
        return 0.0;
    }
    let mut best = best_total(row + 1, rows, edges, taken);
    for edge in edges.iter().filter(|edge| edge.row == row && edge.weight > 0.0) {
        if !taken.contains(&edge.col) {
            taken.push(edge.col);
            best = best.max(edge.weight + best_total(row + 1, rows, edges, taken));
            taken.pop();
        }
    }
    best
}

/// Rows, columns, and edges with some equal weights.
fn problem() -> impl Strategy<Value = (u32, u32, Vec<Edge>)> {
    (1..7u32, 1..7u32).prop_flat_map(|(rows, cols)| {
        let weight = prop_oneof![
            2 => Just(0.0), 3 => -2.0..9.0f64, 2 => (0..3u8).prop_map(f64::from)
        ];
        let edges =
            prop::collection::vec(weight, (rows * cols) as usize).prop_map(move |weights| {
                weights
                    .into_iter()
                    .enumerate()
                    .map(|(i, weight)| Edge { row: i as u32 / cols, col: i as u32 % cols, weight })
                    .collect()
            });
        (Just(rows), Just(cols), edges)
    })
}

/// Returns the total weight of a matching, after a look that it is one.
fn total(edges: &[Edge], matched: &[u32]) -> f64 {
    let chosen: Vec<Edge> = matched.iter().map(|e| edges[*e as usize]).collect();
    for (i, a) in chosen.iter().enumerate() {
        assert!(chosen[..i].iter().all(|b| a.row < b.row || b.row < a.row && a.col != b.col));
    }
    chosen.iter().map(|edge| edge.weight).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn no_matching_weighs_more((rows, cols, edges) in problem()) {
        let mut matched = Vec::new();
        Matcher::new().best(rows as usize, cols as usize, &edges, &mut matched);
        let best = best_total(0, rows, &edges, &mut Vec::new());
        prop_assert!((total(&edges, &matched) - best).abs() < 1e-9, "{best}");
    }

    #[test]
    fn no_matching_of_a_matrix_weighs_more((rows, cols, edges) in problem()) {
        let weights: Vec<f64> = edges.iter().map(|edge| edge.weight).collect();
        let found = Matcher::new().best_of_matrix(rows as usize, cols as usize, &weights);
        let pairs = found.iter().enumerate().filter_map(|(row, col)| Some((row, (*col)?)));
        let matched: Vec<u32> = pairs.map(|(row, col)| (row * cols as usize + col) as u32).collect();
        let best = best_total(0, rows, &edges, &mut Vec::new());
        prop_assert!((total(&edges, &matched) - best).abs() < 1e-9, "{best}");
    }

    #[test]
    fn a_matrix_is_matched_as_well_by_its_groups_as_at_once(
        rows in 20usize..40, cols in 20usize..40, few in 1u64..40, seed in 0u64..1000,
    ) {
        let mut weights = vec![0.0; rows * cols];
        for (i, weight) in (0..).zip(&mut weights) {
            let mixed = (i + seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
            if mixed.is_multiple_of(few) {
                *weight = (mixed % 1009) as f64 + 1.0;
            }
        }
        let mut groups = vec![None; rows];
        let mut whole = vec![None; rows];
        let mut matcher = Matcher::new();
        matcher.match_groups(rows, cols, &weights, &mut groups);
        matcher.match_all(rows, cols, &weights, &mut whole);
        let best = sum_of_matches(&whole, &weights, cols);
        prop_assert_eq!(sum_of_matches(&groups, &weights, cols), best);
        let auto = matcher.best_of_matrix(rows, cols, &weights);
        prop_assert_eq!(sum_of_matches(&auto, &weights, cols), best);
    }

    /// Prices prove it: with all reduced costs at least 0, those of the pairs 0 and free columns
    /// without a price, no other assignment costs less.
    #[test]
    fn prices_prove_that_a_large_answer_is_best(
        rows in 1usize..40, more in 0usize..20, seed in 0u64..1000, levels in 2u64..100_000,
    ) {
        let cols = rows + more;
        let mut cost = Vec::new();
        for i in 0..(rows * cols) as u64 {
            let mixed = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(seed);
            let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 33;
            cost.push((mixed % levels) as f64);
        }
        let mut solver = Solver::default();
        solver.solve(rows, cols, &cost);
        let Solver { row_price, col_price, row_of, .. } = solver;
        let mut placed: Vec<u32> = row_of.iter().copied().filter(|row| *row != NONE).collect();
        placed.sort_unstable();
        prop_assert_eq!(placed, (0..rows as u32).collect::<Vec<_>>());
        for (i, cost) in cost.iter().enumerate() {
            let row = i / cols;
            let col = i % cols;
            let reduced = cost - row_price[row] - col_price[col];
            prop_assert!(reduced > -1e-6, "{}", reduced);
            prop_assert!(row_of[col] != row as u32 || reduced < 1e-6, "{}", reduced);
            prop_assert!(col_price[col] <= 0.0 && (row_of[col] != NONE || col_price[col] == 0.0));
        }
    }
}

/// Sums the weights of the columns that the rows have got.
fn sum_of_matches(found: &[Option<usize>], weights: &[f64], cols: usize) -> f64 {
    found.iter().enumerate().filter_map(|(row, col)| Some(weights[row * cols + (*col)?])).sum()
}

#[test]
fn the_least_of_many_is_found_beside_nan() {
    let mut values: Vec<f64> = (0..21).map(|i| f64::from((i * 7) % 21) + 3.0).collect();
    values[0] = f64::NAN;
    assert_eq!(least(&values), (3, 3.0));
    values[3] = f64::NAN;
    assert_eq!(least(&values), (6, 3.0));
    assert_eq!(least(&[5.0; 40]), (0, 5.0));
}
