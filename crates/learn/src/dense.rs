//! Algebra of large matrices for trainers, with `faer` on one thread, so that a fit has the same
//! bytes whatever the number of threads. Processors with other vector instructions may round
//! differently, and therefore pipelines do not use this module. Small matrices of fixed size use
//! `nalgebra`.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::solvers::{Llt, Solve};
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};

/// Normal equations of a least-squares fit, of which only the penalties change between solutions.
///
/// ```
/// # use nalgebra::{DMatrix, DVector};
/// # use tagalong_learn::dense::NormalEquations;
/// let rows = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0]);
/// let targets = DVector::from_vec(vec![1.0, 3.0, 5.0]);
/// let equations = NormalEquations::new(&rows, &targets);
/// let fitted = equations.solve(&[0.0, 0.0], equations.right_side()).unwrap();
/// assert!((fitted[0] - 1.0).abs() < 1e-12 && (fitted[1] - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Products of the columns; only the lower half is computed.
    gram: Mat<f64>,
    right_side: DVector<f64>,
}

impl NormalEquations {
    /// Multiplies the columns of the design matrix, which has a row for each sample, with each
    /// other and with the targets.
    ///
    /// # Panics
    /// If there are not as many targets as rows.
    pub fn new(rows: &DMatrix<f64>, targets: &DVector<f64>) -> Self {
        let columns = rows.ncols();
        let design = MatRef::from_column_major_slice(rows.as_slice(), rows.nrows(), columns);
        let mut gram = Mat::zeros(columns, columns);
        triangular::matmul(
            &mut gram,
            BlockStructure::TriangularLower,
            Accum::Replace,
            design.transpose(),
            BlockStructure::Rectangular,
            design,
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        Self { gram, right_side: transposed_product(rows, targets) }
    }

    /// Returns the products of the columns with the targets.
    pub fn right_side(&self) -> &DVector<f64> {
        &self.right_side
    }

    /// Returns the weights that minimise the squared errors plus, for each weight, its penalty
    /// times its square. `right` is [`Self::right_side`], with the gradient of further terms if
    /// there are any. `None` if the equations are not positive definite.
    ///
    /// # Panics
    /// If there are more penalties, or other than as many numbers on the right side, than columns.
    pub fn solve(&self, penalties: &[f64], right: &DVector<f64>) -> Option<DVector<f64>> {
        let mut normal = self.gram.clone();
        for (i, penalty) in penalties.iter().enumerate() {
            normal[(i, i)] += penalty;
        }
        let factors = Llt::new(normal.as_ref(), Side::Lower).ok()?;
        let mut weights = right.clone();
        let count = weights.len();
        factors.solve_in_place(MatMut::from_column_major_slice_mut(
            weights.as_mut_slice(),
            count,
            1,
        ));
        weights.iter().all(|weight| weight.is_finite()).then_some(weights)
    }
}

/// Returns the products of the columns with a vector that has one element per row.
///
/// # Panics
/// If the vector has another length than the columns.
pub fn transposed_product(rows: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    let design = MatRef::from_column_major_slice(rows.as_slice(), rows.nrows(), rows.ncols());
    let right = MatRef::from_column_major_slice(vector.as_slice(), vector.len(), 1);
    let mut products = DVector::zeros(rows.ncols());
    let out = MatMut::from_column_major_slice_mut(products.as_mut_slice(), rows.ncols(), 1);
    matmul(out, Accum::Replace, design.transpose(), right, 1.0, Par::Seq);
    products
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
        for columns in [1, 7, 40] {
            let rows = DMatrix::from_fn(50, columns, |row, column| number(row * columns + column));
            let targets = DVector::from_fn(50, |row, _| number(10_000 + row));
            let penalties: Vec<f64> = (0..columns).map(|k| 0.1 * k as f64).collect();
            let equations = NormalEquations::new(&rows, &targets);
            let right = rows.transpose() * &targets;
            assert!((equations.right_side() - &right).norm() < 1e-12, "{columns}");
            let fitted = equations.solve(&penalties, equations.right_side()).unwrap();
            let diagonal = DMatrix::from_diagonal(&DVector::from_column_slice(&penalties));
            let expected = (rows.transpose() * &rows + diagonal).lu().solve(&right).unwrap();
            assert!((fitted - expected).norm() < 1e-11, "{columns}");
        }
    }

    #[test]
    fn a_fit_has_the_same_bytes_in_any_thread() {
        let rows = DMatrix::from_fn(300, 33, |row, column| number(row * 33 + column));
        let targets = DVector::from_fn(300, |row, _| number(10_000 + row));
        let expected = fit_rows(&rows, &targets);
        std::thread::scope(|scope| {
            let fits: Vec<_> = (0..4).map(|_| scope.spawn(|| fit_rows(&rows, &targets))).collect();
            for fitted in fits {
                assert_eq!(fitted.join().unwrap(), expected);
            }
        });
    }

    /// Returns the weights of a fit of 33 columns.
    fn fit_rows(rows: &DMatrix<f64>, targets: &DVector<f64>) -> DVector<f64> {
        let equations = NormalEquations::new(rows, targets);
        equations.solve(&[0.1; 33], equations.right_side()).expect("the equations can be solved")
    }

    #[test]
    fn equations_without_one_solution_have_none() {
        let rows = DMatrix::from_fn(9, 2, |row, _| row as f64);
        let normal = NormalEquations::new(&rows, &DVector::zeros(9));
        let right = DVector::from_vec(vec![1.0, 1.0]);
        assert_eq!(normal.solve(&[-1.0, -1.0], &right), None);
        assert!(normal.solve(&[1.0, 1.0], &right).is_some());
        assert_eq!(normal.solve(&[f64::NAN, 1.0], &right), None);
    }
}
