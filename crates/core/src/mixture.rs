use nalgebra::{SMatrix, SVector};

/// Returns mean and covariance of a mixture of Gaussians, given as (weight, mean, covariance)
/// with weights that sum to 1 (moment matching).
///
/// ```
/// # use nalgebra::{Vector1, Matrix1};
/// let parts = [(0.5, Vector1::new(-1.0), Matrix1::new(0.1)), (0.5, Vector1::new(1.0), Matrix1::new(0.1))];
/// let (mean, covariance) = tagalong_core::match_moments(&parts);
/// assert_eq!((mean.x, covariance.x), (0.0, 1.1));
/// ```
pub fn match_moments<const N: usize>(
    parts: &[(f64, SVector<f64, N>, SMatrix<f64, N, N>)],
) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mean = parts.iter().fold(SVector::zeros(), |sum, (weight, mean, _)| sum + mean * *weight);
    let covariance = parts.iter().fold(SMatrix::zeros(), |sum, (weight, part, covariance)| {
        let off = part - mean;
        sum + (covariance + off * off.transpose()) * *weight
    });
    (mean, covariance)
}
