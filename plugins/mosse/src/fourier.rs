//! Two-dimensional transforms of windows.

use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use crate::patch::{CELLS, SIDE};

/// Spectrum of a window: one number per pair of frequencies, row by row.
pub type Spectrum = Vec<Complex32>;

/// Transforms windows of [`SIDE`] by [`SIDE`] cells.
pub struct Fourier {
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Default for Fourier {
    fn default() -> Self {
        let mut planner = FftPlanner::new();
        Self { forward: planner.plan_fft_forward(SIDE), inverse: planner.plan_fft_inverse(SIDE) }
    }
}

impl Fourier {
    /// Returns the spectrum of a window.
    pub fn spectrum(&self, cells: &[f32]) -> Spectrum {
        let mut values = cells.iter().map(|value| Complex32::new(*value, 0.0)).collect();
        along_both(&*self.forward, &mut values);
        values
    }

    /// Returns the window with this spectrum; what is not real of it is left out.
    pub fn window(&self, mut spectrum: Spectrum) -> Vec<f32> {
        along_both(&*self.inverse, &mut spectrum);
        spectrum.iter().map(|value| value.re / CELLS as f32).collect()
    }
}

/// Transforms all rows, then all columns.
fn along_both(fft: &dyn Fft<f32>, values: &mut Spectrum) {
    for _ in 0..2 {
        fft.process(values);
        transpose(values);
    }
}

fn transpose(values: &mut Spectrum) {
    for row in 0..SIDE {
        for column in row + 1..SIDE {
            values.swap(row * SIDE + column, column * SIDE + row);
        }
    }
}
