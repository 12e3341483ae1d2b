//! A convex program: squares and a linear part to minimise, under equations, bounds and norms.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Iterations after which a program is given up; those here take some fifteen.
const ITERATIONS: u32 = 60;

/// A weighted sum of variables and a constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Sum {
    /// Numbers of the variables, and their factors.
    terms: Vec<(usize, f64)>,
    constant: f64,
}

impl Sum {
    pub(super) fn of(terms: impl IntoIterator<Item = (usize, f64)>) -> Self {
        Self { terms: terms.into_iter().collect(), constant: 0.0 }
    }

    pub(super) fn constant(constant: f64) -> Self {
        Self { terms: Vec::new(), constant }
    }

    /// Returns this sum and `factor` times another one.
    pub(super) fn plus(mut self, factor: f64, other: &Self) -> Self {
        self.terms.extend(other.terms.iter().map(|(variable, of)| (*variable, factor * of)));
        self.constant += factor * other.constant;
        self
    }

    /// Returns the sum of these variables.
    pub(super) fn value(&self, variables: &[f64]) -> f64 {
        let terms = self.terms.iter().map(|(variable, factor)| factor * variables[*variable]);
        self.constant + terms.sum::<f64>()
    }

    pub(super) fn plus_constant(mut self, constant: f64) -> Self {
        self.constant += constant;
        self
    }
}

/// Rows of a matrix, with the sums that they stand for kept in a cone.
#[derive(Default)]
struct Rows {
    sums: Vec<Sum>,
}

/// The program.
pub(super) struct Program {
    /// Entries of the upper triangle of the matrix of squares.
    squares: Vec<(usize, usize, f64)>,
    linear: Vec<f64>,
    /// Sums that are zero.
    zeros: Rows,
    /// Sums that are zero or more.
    positives: Rows,
    /// Groups of three: the first sum is at least the length of the vector of the other two.
    lengths: Rows,
}

impl Program {
    pub(super) fn new(variables: usize) -> Self {
        Self {
            squares: Vec::new(),
            linear: vec![0.0; variables],
            zeros: Rows::default(),
            positives: Rows::default(),
            lengths: Rows::default(),
        }
    }

    /// Adds `weight` times a sum to the cost.
    pub(super) fn cost(&mut self, weight: f64, sum: &Sum) {
        for (variable, factor) in &sum.terms {
            self.linear[*variable] += weight * factor;
        }
    }

    /// Adds `weight` times the square of a sum to the cost.
    pub(super) fn square(&mut self, weight: f64, sum: &Sum) {
        self.cost(2.0 * weight * sum.constant, sum);
        for (a, of_a) in &sum.terms {
            for (b, of_b) in &sum.terms {
                if a <= b {
                    self.squares.push((*a, *b, 2.0 * weight * of_a * of_b));
                }
            }
        }
    }

    /// Demands that a sum is zero.
    pub(super) fn zero(&mut self, sum: Sum) {
        self.zeros.sums.push(sum);
    }

    /// Demands that a sum is zero or more.
    pub(super) fn positive(&mut self, sum: Sum) {
        self.positives.sums.push(sum);
    }

    /// Demands that a sum lies between two values.
    pub(super) fn between(&mut self, sum: &Sum, least: f64, most: f64) {
        self.positive(sum.clone().plus_constant(-least));
        self.positive(Sum::constant(most).plus(-1.0, sum));
    }

    /// Demands that a vector is no longer than a sum.
    pub(super) fn length(&mut self, most: Sum, vector: [Sum; 2]) {
        self.lengths.sums.push(most);
        self.lengths.sums.extend(vector);
    }

    /// Returns the variables at the least cost; `None` if there are none, or the solver fails.
    pub(super) fn solved(&self) -> Option<Vec<f64>> {
        let variables = self.linear.len();
        let (rows, columns, values) = split(self.squares.iter().copied());
        let squares = CscMatrix::new_from_triplets(variables, variables, rows, columns, values);
        // The solver keeps `constants - matrix * variables` in the cones.
        let all = [&self.zeros, &self.positives, &self.lengths].map(|rows| rows.sums.iter());
        let sums: Vec<&Sum> = all.into_iter().flatten().collect();
        let entries = sums.iter().enumerate().flat_map(|(row, sum)| {
            sum.terms.iter().map(move |(variable, factor)| (row, *variable, -factor))
        });
        let (rows, columns, values) = split(entries);
        let matrix = CscMatrix::new_from_triplets(sums.len(), variables, rows, columns, values);
        let constants: Vec<f64> = sums.iter().map(|sum| sum.constant).collect();
        let mut cones = vec![
            SupportedConeT::ZeroConeT(self.zeros.sums.len()),
            SupportedConeT::NonnegativeConeT(self.positives.sums.len()),
        ];
        cones.extend((0..self.lengths.sums.len() / 3).map(|_| SupportedConeT::SecondOrderConeT(3)));
        let settings =
            DefaultSettings { verbose: false, max_iter: ITERATIONS, ..DefaultSettings::default() };
        let mut solver =
            DefaultSolver::new(&squares, &self.linear, &matrix, &constants, &cones, settings)
                .ok()?;
        solver.solve();
        let is_solved =
            matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        let solution = solver.solution.x;
        (is_solved && solution.iter().all(|value| value.is_finite())).then_some(solution)
    }
}

/// Returns the rows, columns and values of entries.
fn split(entries: impl Iterator<Item = (usize, usize, f64)>) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
    let mut rows = Vec::new();
    let mut columns = Vec::new();
    let mut values = Vec::new();
    for (row, column, value) in entries {
        rows.push(row);
        columns.push(column);
        values.push(value);
    }
    (rows, columns, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variable(number: usize) -> Sum {
        Sum::of([(number, 1.0)])
    }

    #[test]
    fn the_nearest_point_of_a_line_and_a_box_is_found() {
        // The point of x + y = 4 nearest to (1, 1) is (2, 2); with x at most 1.5 it is (1.5, 2.5).
        let mut program = Program::new(2);
        program.square(1.0, &variable(0).plus_constant(-1.0));
        program.square(1.0, &variable(1).plus_constant(-1.0));
        program.zero(Sum::of([(0, 1.0), (1, 1.0)]).plus_constant(-4.0));
        let free = program.solved().expect("a solution");
        assert!((free[0] - 2.0).abs() < 1e-6 && (free[1] - 2.0).abs() < 1e-6, "{free:?}");
        program.between(&variable(0), 0.0, 1.5);
        let bounded = program.solved().expect("a solution");
        assert!((bounded[0] - 1.5).abs() < 1e-6 && (bounded[1] - 2.5).abs() < 1e-6, "{bounded:?}");
    }

    #[test]
    fn a_vector_within_a_length_goes_as_far_as_it_may() {
        let mut program = Program::new(2);
        program.cost(-1.0, &Sum::of([(0, 3.0), (1, 4.0)]));
        program.length(Sum::constant(10.0), [variable(0), variable(1)]);
        let found = program.solved().expect("a solution");
        assert!((found[0] - 6.0).abs() < 1e-5 && (found[1] - 8.0).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn a_square_of_several_variables_counts_their_products() {
        // (x + y - 3)^2 + (x - y - 1)^2 is least at (2, 1).
        let mut program = Program::new(2);
        program.square(0.5, &variable(0).plus(1.0, &variable(1)).plus_constant(-3.0));
        program.square(2.0, &variable(0).plus(-1.0, &variable(1)).plus_constant(-1.0));
        program.between(&variable(0), -9.0, 9.0);
        let found = program.solved().expect("a solution");
        assert!((found[0] - 2.0).abs() < 1e-6 && (found[1] - 1.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn what_nothing_satisfies_has_no_solution() {
        let mut program = Program::new(1);
        program.square(1.0, &variable(0));
        program.positive(variable(0).plus_constant(-2.0));
        program.positive(Sum::constant(1.0).plus(-1.0, &variable(0)));
        assert!(program.solved().is_none());
    }
}
