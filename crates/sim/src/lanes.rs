//! Values of neighbouring pixels, stored together so that one instruction processes several of
//! them.
//!
//! Loops over lanes have one body without branches, which the compiler turns into vector
//! instructions of the target processor. Each lane performs the same operations in the same order
//! as the code for one ray, without fused or reordered arithmetic, and therefore has the same bits
//! on every processor.

use nalgebra::{Matrix3, Point3, Vector3};

/// Number of pixels that are processed together: two vectors of AVX-512, four of AVX2.
pub const LANES: usize = 16;

/// A number for each lane.
pub type Lanes = [f64; LANES];

/// A vector for each lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vectors {
    /// First coordinates.
    pub x: Lanes,
    /// Second coordinates.
    pub y: Lanes,
    /// Third coordinates.
    pub z: Lanes,
}

impl Vectors {
    /// Vectors that are zero.
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    /// Returns the vector of one lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Vector3<f64> {
        Vector3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    /// Sets the vector of one lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, to: &Vector3<f64>) {
        (self.x[lane], self.y[lane], self.z[lane]) = (to.x, to.y, to.z);
    }
}

/// Writes the points at `t` ray lengths from an eye.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn points(eye: &Point3<f64>, rays: &Vectors, t: &Lanes, to: &mut Vectors) {
    for lane in 0..LANES {
        to.x[lane] = eye.x + rays.x[lane] * t[lane];
        to.y[lane] = eye.y + rays.y[lane] * t[lane];
        to.z[lane] = eye.z + rays.z[lane] * t[lane];
    }
}

/// Returns the product of a matrix and a vector, in the order of operations of `nalgebra`, whose
/// loops over rows and columns the compiler does not optimise.
#[inline(always)]
pub fn product(matrix: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let m = matrix;
    Vector3::new(
        m.m11 * v.x + m.m12 * v.y + m.m13 * v.z,
        m.m21 * v.x + m.m22 * v.y + m.m23 * v.z,
        m.m31 * v.x + m.m32 * v.y + m.m33 * v.z,
    )
}

/// Returns the product of a transposed matrix and a vector; see [`product`].
#[inline(always)]
pub fn transposed_product(matrix: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let m = matrix;
    Vector3::new(
        m.m11 * v.x + m.m21 * v.y + m.m31 * v.z,
        m.m12 * v.x + m.m22 * v.y + m.m32 * v.z,
        m.m13 * v.x + m.m23 * v.y + m.m33 * v.z,
    )
}

/// Returns the dot product of two vectors; see [`product`].
#[inline(always)]
pub fn dot(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}
