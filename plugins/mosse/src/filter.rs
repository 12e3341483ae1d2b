use rustfft::num_complex::Complex32;

use crate::fourier::{Fourier, Spectrum};
use crate::patch::{CELLS, SIDE};

/// Cells around the peak that are no sidelobe, to each side: eleven by eleven in the paper.
const PEAK_CELLS: usize = 5;

/// Correlation filter of one person, as numerator and denominator of its conjugate spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    numerator: Spectrum,
    /// Power of each frequency.
    denominator: Vec<f32>,
}

/// Highest place of a correlation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Offset from the middle of the window, cells to the right and down.
    pub offset: [f64; 2],
    /// Height above the mean of the sidelobes, in their standard deviations.
    pub ratio: f64,
}

/// Returns the spectrum of the wanted correlation: a normal curve about the middle cell, whose
/// standard deviation is given in cells.
pub(crate) fn goal(fourier: &Fourier, sigma_cells: f64) -> Spectrum {
    let off = |cell: usize| cell as f64 - (SIDE / 2) as f64;
    let height = |number: usize| {
        let squares = off(number / SIDE).powi(2) + off(number % SIDE).powi(2);
        (-0.5 * squares / (sigma_cells * sigma_cells)).exp() as f32
    };
    let cells: Vec<f32> = (0..CELLS).map(height).collect();
    fourier.spectrum(&cells)
}

impl Filter {
    /// Returns the filter that answers these windows best with the wanted correlation.
    pub(crate) fn new(windows: &[Spectrum], goal: &Spectrum) -> Self {
        let mut filter =
            Self { numerator: vec![Complex32::default(); CELLS], denominator: vec![0.0; CELLS] };
        for (number, window) in windows.iter().enumerate() {
            filter.learn(window, goal, number as f32 / (number + 1) as f32);
        }
        filter
    }

    /// Learns a window: `memory` is the weight of the past.
    pub(crate) fn learn(&mut self, window: &Spectrum, goal: &Spectrum, memory: f32) {
        let kept = self.numerator.iter_mut().zip(&mut self.denominator);
        for ((numerator, denominator), (seen, wanted)) in kept.zip(window.iter().zip(goal)) {
            *numerator = *numerator * memory + wanted * seen.conj() * (1.0 - memory);
            *denominator = memory * *denominator + (1.0 - memory) * seen.norm_sqr();
        }
    }

    /// Returns the correlation with a window, cell by cell. `regularisation` is a part of the mean
    /// power.
    pub(crate) fn correlation(
        &self,
        fourier: &Fourier,
        window: &Spectrum,
        regularisation: f32,
    ) -> Vec<f32> {
        let power = self.denominator.iter().sum::<f32>() / CELLS as f32;
        // A window without texture has no power at all.
        let floor = (regularisation * power).max(1e-6);
        let filter = self.numerator.iter().zip(&self.denominator);
        let product = window.iter().zip(filter);
        fourier.window(product.map(|(seen, (a, b))| seen * a / (b + floor)).collect())
    }
}

impl Peak {
    /// Finds the peak of a correlation.
    pub fn of(correlation: &[f32]) -> Self {
        let highest = correlation.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let (at, height) = highest.map_or((0, 0.0), |(at, height)| (at, f64::from(*height)));
        let (row, column) = (at / SIDE, at % SIDE);
        let (mean, deviation) = sidelobes(correlation, row, column);
        let cell =
            |row: usize, column: usize| f64::from(correlation[row % SIDE * SIDE + column % SIDE]);
        let middle = (SIDE / 2) as f64;
        let across = summit([cell(row, column + SIDE - 1), height, cell(row, column + 1)]);
        let down = summit([cell(row + SIDE - 1, column), height, cell(row + 1, column)]);
        Self {
            offset: [column as f64 - middle + across, row as f64 - middle + down],
            // An even correlation has no peak.
            ratio: if deviation > 1e-9 { (height - mean) / deviation } else { 0.0 },
        }
    }
}

/// Returns mean and standard deviation of the cells that are not near the peak.
fn sidelobes(correlation: &[f32], row: usize, column: usize) -> (f64, f64) {
    let away = |number: &usize| {
        (number / SIDE).abs_diff(row) > PEAK_CELLS || (number % SIDE).abs_diff(column) > PEAK_CELLS
    };
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in (0..CELLS).filter(away).map(|number| f64::from(correlation[number])) {
        (count, sum, squares) = (count + 1.0, sum + value, squares + value * value);
    }
    let mean = sum / count;
    (mean, (squares / count - mean * mean).max(0.0).sqrt())
}

/// Returns where the parabola through three heights, the middle one the highest, has its summit:
/// an offset of at most half a cell.
fn summit([before, at, after]: [f64; 3]) -> f64 {
    let bend = before - 2.0 * at + after;
    if bend < -1e-12 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}
