//! Algebra of large matrices for trainers, on one thread, so that a fit has the same bytes on any
//! number of them. Processors with other vector instructions may round otherwise, which is why
//! pipelines do without it.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Normal equations of a least-squares fit, of which only the penalties and the right side change
/// between solutions.
///
/// ```
/// # use nalgebra::{DMatrix, DVector};
/// # use tagalong_learn::dense::NormalEquations;
/// let rows = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0]);
/// let targets = DVector::from_vec(vec![1.0, 3.0, 5.0]);
/// let fitted = NormalEquations::new(&rows).solve(&[0.0, 0.0], &rows.tr_mul(&targets)).unwrap();
/// assert!((fitted[0] - 1.0).abs() < 1e-12 && (fitted[1] - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Products of the columns.
    gram: DMatrix<f64>,
}

impl NormalEquations {
    /// Multiplies the columns of the design matrix, which has a row for each sample.
    pub fn new(rows: &DMatrix<f64>) -> Self {
        // `tr_mul` would take the scalar products one by one.
        Self { gram: rows.transpose() * rows }
    }

    /// Returns the weights that minimise the squared errors plus, for each weight, its penalty
    /// times its square. `right` is the transposed design matrix times the targets. `None` if the
    /// equations are not positive definite.
    pub fn solve(&self, penalties: &[f64], right: &DVector<f64>) -> Option<DVector<f64>> {
        let mut normal = self.gram.clone();
        for (i, penalty) in penalties.iter().enumerate() {
            normal[(i, i)] += penalty;
        }
        let weights = Cholesky::new(normal)?.solve(right);
        weights.iter().all(|weight| weight.is_finite()).then_some(weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1 without a pattern.
    fn number(seed: usize) -> f64 {
        crate::mix(seed as u64) as f64 / u64::MAX as f64 * 2.0 - 1.0
    }

    /// The slow reference: the equations written out, and solved by another factorisation.
    #[test]
    fn weights_are_those_of_the_normal_equations() {
        let rows = DMatrix::from_fn(50, 7, |row, column| number(row * 7 + column));
        let right = rows.transpose() * DVector::from_fn(50, |row, _| number(1000 + row));
        let penalties = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 9.0];
        let fitted = NormalEquations::new(&rows).solve(&penalties, &right).unwrap();
        let diagonal = DMatrix::from_diagonal(&DVector::from_column_slice(&penalties));
        let expected = (rows.transpose() * &rows + diagonal).lu().solve(&right).unwrap();
        assert!((fitted - expected).norm() < 1e-12);
    }

    #[test]
    fn equations_without_one_solution_have_none() {
        let rows = DMatrix::from_fn(9, 2, |row, _| row as f64);
        let normal = NormalEquations::new(&rows);
        let right = DVector::from_vec(vec![1.0, 1.0]);
        assert_eq!(normal.solve(&[-1.0, -1.0], &right), None);
        assert!(normal.solve(&[1.0, 1.0], &right).is_some());
        assert_eq!(normal.solve(&[f64::NAN, 1.0], &right), None);
    }
}
