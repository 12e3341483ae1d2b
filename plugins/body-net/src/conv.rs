//! A layer of the network, forwards and backwards.

use std::ops::Range;

/// Weights are summed in so many parts at once, a register's width or a part of one.
#[cfg(feature = "train")]
const LANES: usize = 8;

/// An image of `CHANNELS` numbers a cell, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map<const CHANNELS: usize> {
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f32>,
}

impl<const CHANNELS: usize> Map<CHANNELS> {
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns * CHANNELS] }
    }

    /// The numbers of a cell.
    #[inline(always)]
    fn at(&self, row: usize, column: usize) -> &[f32; CHANNELS] {
        cell(&self.values, row * self.columns + column)
    }

    #[inline(always)]
    fn at_mut(&mut self, row: usize, column: usize) -> &mut [f32; CHANNELS] {
        cell_mut(&mut self.values, row * self.columns + column)
    }
}

#[inline(always)]
fn cell<const N: usize>(values: &[f32], index: usize) -> &[f32; N] {
    &values.as_chunks::<N>().0[index]
}

#[inline(always)]
fn cell_mut<const N: usize>(values: &mut [f32], index: usize) -> &mut [f32; N] {
    &mut values.as_chunks_mut::<N>().0[index]
}

/// Convolution of `SIZE` by `SIZE` cells at every second cell, followed by a rectifier: `out =
/// max(0, bias + sum over taps and inputs of weight * input)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Conv<const IN: usize, const OUT: usize, const SIZE: usize> {
    /// Of each tap, row by row, of each input: the weights of the outputs.
    pub weights: Vec<f32>,
    /// Of each output.
    pub bias: Vec<f32>,
}

impl<const IN: usize, const OUT: usize, const SIZE: usize> Default for Conv<IN, OUT, SIZE> {
    fn default() -> Self {
        Self { weights: vec![0.0; SIZE * SIZE * IN * OUT], bias: vec![0.0; OUT] }
    }
}

impl<const IN: usize, const OUT: usize, const SIZE: usize> Conv<IN, OUT, SIZE> {
    /// Inputs of one output, which decide how large weights are at the start.
    #[cfg(feature = "train")]
    pub const INPUTS: usize = SIZE * SIZE * IN;

    /// The image of half the size.
    #[inline(always)]
    pub fn forward(&self, input: &Map<IN>, out: &mut Map<OUT>) {
        let weights = self.weights.as_chunks::<OUT>().0;
        for row in 0..out.rows {
            for column in 0..out.columns {
                let mut sums: [f32; OUT] = *cell(&self.bias, 0);
                let (up, across) =
                    (taps::<SIZE>(row, input.rows), taps::<SIZE>(column, input.columns));
                for up in up {
                    for across in across.clone() {
                        let (seen, first) = Self::tap(input, [row, column], [up, across]);
                        let weights = &weights[first..first + IN];
                        for (value, weights) in seen.iter().zip(weights) {
                            for (sum, weight) in sums.iter_mut().zip(weights) {
                                *sum += value * weight;
                            }
                        }
                    }
                }
                *out.at_mut(row, column) = sums.map(|sum| sum.max(0.0));
            }
        }
    }

    /// Adds how the loss depends on the weights to `gradient`, and how it depends on the
    /// input to `of_input`, if that is asked for. `of_out` is how it depends on the
    /// output; where the output is cut off, it has to be zero.
    #[inline(always)]
    #[cfg(feature = "train")]
    pub fn backward(
        &self,
        input: &Map<IN>,
        of_out: &Map<OUT>,
        gradient: &mut Self,
        mut of_input: Option<&mut Map<IN>>,
    ) {
        let weights = self.weights.as_chunks::<OUT>().0;
        let of_weights = gradient.weights.as_chunks_mut::<OUT>().0;
        for row in 0..of_out.rows {
            for column in 0..of_out.columns {
                let of_sum = of_out.at(row, column);
                if of_sum.iter().all(|value| *value == 0.0) {
                    continue;
                }
                add(cell_mut(&mut gradient.bias, 0), of_sum, 1.0);
                for up in taps::<SIZE>(row, input.rows) {
                    for across in taps::<SIZE>(column, input.columns) {
                        let (seen, first) = Self::tap(input, [row, column], [up, across]);
                        for (i, value) in seen.iter().enumerate() {
                            // The gradient of a rectified zero is zero.
                            if *value == 0.0 {
                                continue;
                            }
                            add(&mut of_weights[first + i], of_sum, *value);
                            if let Some(of_input) = of_input.as_deref_mut() {
                                let [y, x] = place::<SIZE>([row, column], [up, across]);
                                of_input.at_mut(y, x)[i] += dot(&weights[first + i], of_sum);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Returns the inputs of an output through a tap, and the first of the tap's weights.
    #[inline(always)]
    fn tap(input: &Map<IN>, out: [usize; 2], tap: [usize; 2]) -> (&[f32; IN], usize) {
        let [y, x] = place::<SIZE>(out, tap);
        (input.at(y, x), (tap[0] * SIZE + tap[1]) * IN)
    }
}

/// The taps of an output that are inside an image of this size.
#[inline(always)]
fn taps<const SIZE: usize>(out: usize, size: usize) -> Range<usize> {
    (SIZE / 2).saturating_sub(2 * out)..SIZE.min(size + SIZE / 2 - 2 * out)
}

/// The cell that an output sees through a tap inside the image.
#[inline(always)]
fn place<const SIZE: usize>(out: [usize; 2], tap: [usize; 2]) -> [usize; 2] {
    [2 * out[0] + tap[0] - SIZE / 2, 2 * out[1] + tap[1] - SIZE / 2]
}

#[cfg(feature = "train")]
#[inline(always)]
fn add<const N: usize>(sums: &mut [f32; N], values: &[f32; N], times: f32) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += times * value;
    }
}

#[cfg(feature = "train")]
#[inline(always)]
fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sums = [0.0; LANES];
    let (a, b) = (a.as_chunks::<LANES>().0, b.as_chunks::<LANES>().0);
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}
