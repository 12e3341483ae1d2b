//! Layers of convolutional networks, with forward and backward pass, for networks that are small
//! enough to be trained here. Numbers of channels are constants, so that the innermost loops run in
//! registers.

use std::ops::Range;

/// Number of lanes that are summed at once, the width of a register or a fraction of it.
const LANES: usize = 8;

/// Number of adjacent outputs that are computed at once: their sums are independent.
const BLOCK: usize = 4;

/// An image of `CHANNELS` numbers per cell, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map<const CHANNELS: usize> {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// The numbers, cell by cell.
    pub values: Vec<f32>,
}

impl<const CHANNELS: usize> Map<CHANNELS> {
    /// Creates an image of zeros.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns * CHANNELS] }
    }

    /// Returns the numbers of a cell.
    ///
    /// # Panics
    /// Outside of the image.
    #[inline(always)]
    pub fn at(&self, row: usize, column: usize) -> &[f32; CHANNELS] {
        cell(&self.values, row * self.columns + column)
    }

    /// Returns the numbers of a cell, mutably.
    ///
    /// # Panics
    /// Outside of the image.
    #[inline(always)]
    pub fn at_mut(&mut self, row: usize, column: usize) -> &mut [f32; CHANNELS] {
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

/// A convolution of `SIZE` by `SIZE` taps that are `DILATION` cells apart, at every `STRIDE`-th
/// cell: `sum = bias + sum over taps and inputs of weight * input`. Cells outside of the image
/// count as zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Conv<
    const IN: usize,
    const OUT: usize,
    const SIZE: usize,
    const STRIDE: usize = 2,
    const DILATION: usize = 1,
> {
    /// Weights of the outputs, for each tap, row by row, and each input.
    pub weights: Vec<f32>,
    /// Bias of each output.
    pub bias: Vec<f32>,
}

impl<
    const IN: usize,
    const OUT: usize,
    const SIZE: usize,
    const STRIDE: usize,
    const DILATION: usize,
> Default for Conv<IN, OUT, SIZE, STRIDE, DILATION>
{
    fn default() -> Self {
        Self { weights: vec![0.0; SIZE * SIZE * IN * OUT], bias: vec![0.0; OUT] }
    }
}

impl<
    const IN: usize,
    const OUT: usize,
    const SIZE: usize,
    const STRIDE: usize,
    const DILATION: usize,
> Conv<IN, OUT, SIZE, STRIDE, DILATION>
{
    /// Number of inputs of one output, which determines the size of the initial weights.
    pub const INPUTS: usize = SIZE * SIZE * IN;

    /// Returns the weights and the biases.
    pub fn parts(&self) -> [&[f32]; 2] {
        [&self.weights, &self.bias]
    }

    /// Returns the weights and the biases, mutably.
    pub fn parts_mut(&mut self) -> [&mut [f32]; 2] {
        [&mut self.weights, &mut self.bias]
    }

    /// Computes the rectified sums.
    #[inline(always)]
    pub fn forward(&self, input: &Map<IN>, out: &mut Map<OUT>) {
        self.apply(input, out, |_| true, |sum| sum.max(0.0));
    }

    /// Computes the rectified sums in the cells that are `wanted`; all others are zero.
    #[inline(always)]
    pub fn forward_where(&self, input: &Map<IN>, wanted: &[bool], out: &mut Map<OUT>) {
        self.apply(input, out, |cell| wanted[cell], |sum| sum.max(0.0));
    }

    /// Computes the sums without rectification in the cells that are `wanted`; all others are zero.
    #[inline(always)]
    pub fn linear_where(&self, input: &Map<IN>, wanted: &[bool], out: &mut Map<OUT>) {
        self.apply(input, out, |cell| wanted[cell], |sum| sum);
    }

    #[inline(always)]
    fn apply(
        &self,
        input: &Map<IN>,
        out: &mut Map<OUT>,
        wanted: impl Fn(usize) -> bool,
        finish: impl Fn(f32) -> f32,
    ) {
        let full = Self::full_columns(input.columns, out.columns);
        for row in 0..out.rows {
            let mut column = 0;
            while column < out.columns {
                let cells = row * out.columns + column;
                if column >= full.start && column + BLOCK <= full.end {
                    if (cells..cells + BLOCK).any(&wanted) {
                        let sums = self.block(input, [row, column]);
                        for (k, sums) in sums.into_iter().enumerate() {
                            let is_wanted = wanted(cells + k);
                            *out.at_mut(row, column + k) =
                                if is_wanted { sums.map(&finish) } else { [0.0; OUT] };
                        }
                    } else {
                        out.values.as_chunks_mut::<OUT>().0[cells..cells + BLOCK].fill([0.0; OUT]);
                    }
                    column += BLOCK;
                    continue;
                }
                *out.at_mut(row, column) = if wanted(cells) {
                    self.sums(input, [row, column]).map(&finish)
                } else {
                    [0.0; OUT]
                };
                column += 1;
            }
        }
    }

    /// Returns the sums of an output.
    #[inline(always)]
    fn sums(&self, input: &Map<IN>, out: [usize; 2]) -> [f32; OUT] {
        let weights = self.weights.as_chunks::<OUT>().0;
        let mut sums: [f32; OUT] = *cell(&self.bias, 0);
        for up in Self::taps(out[0], input.rows) {
            for across in Self::taps(out[1], input.columns) {
                let (seen, first) = Self::tap(input, out, [up, across]);
                for (value, weights) in seen.iter().zip(&weights[first..first + IN]) {
                    add(&mut sums, weights, *value);
                }
            }
        }
        sums
    }

    /// Returns the sums of an output and of those to its right, all of whose columns are inside of
    /// the image. Additions to the sum of one output depend on each other, but those of several
    /// outputs do not.
    #[inline(always)]
    fn block(&self, input: &Map<IN>, [row, column]: [usize; 2]) -> [[f32; OUT]; BLOCK] {
        let weights = self.weights.as_chunks::<OUT>().0;
        let mut sums: [[f32; OUT]; BLOCK] = [*cell(&self.bias, 0); BLOCK];
        for up in Self::taps(row, input.rows) {
            for across in 0..SIZE {
                let [y, x] = Self::place([row, column], [up, across]);
                let cells = &input.values.as_chunks::<IN>().0[y * input.columns + x..];
                // Spelled out, because `array::from_fn` calls its closure here.
                let seen = [&cells[0], &cells[STRIDE], &cells[2 * STRIDE], &cells[3 * STRIDE]];
                let first = (up * SIZE + across) * IN;
                for (i, weights) in weights[first..first + IN].iter().enumerate() {
                    // By numbers: iterators over arrays would keep the sums out of registers.
                    for k in 0..BLOCK {
                        add(&mut sums[k], weights, seen[k][i]);
                    }
                }
            }
        }
        sums
    }

    /// Returns the columns of outputs whose taps are all inside of an image.
    fn full_columns(seen: usize, columns: usize) -> Range<usize> {
        let mut all = 0..columns;
        let first = all.find(|column| Self::taps(*column, seen) == (0..SIZE)).unwrap_or(columns);
        let end = all.find(|column| Self::taps(*column, seen) != (0..SIZE)).unwrap_or(columns);
        first..end
    }

    /// Adds the gradient of the loss by the weights to `gradient`, and that by the input to
    /// `of_input`, if that is given. `of_out` is the gradient by the output; it has to be zero
    /// where the output is rectified.
    #[inline(always)]
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
                for up in Self::taps(row, input.rows) {
                    for across in Self::taps(column, input.columns) {
                        let (seen, first) = Self::tap(input, [row, column], [up, across]);
                        for (i, value) in seen.iter().enumerate() {
                            // The gradient of a rectified zero is zero.
                            if *value == 0.0 {
                                continue;
                            }
                            add(&mut of_weights[first + i], of_sum, *value);
                            if let Some(of_input) = of_input.as_deref_mut() {
                                let [y, x] = Self::place([row, column], [up, across]);
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
        let [y, x] = Self::place(out, tap);
        (input.at(y, x), (tap[0] * SIZE + tap[1]) * IN)
    }

    /// Returns the taps of an output that are inside an image of this size.
    #[inline(always)]
    fn taps(out: usize, size: usize) -> Range<usize> {
        let reach = DILATION * (SIZE / 2);
        let first = reach.saturating_sub(STRIDE * out).div_ceil(DILATION);
        first..SIZE.min((size + reach - STRIDE * out).div_ceil(DILATION))
    }

    /// Returns the cell of a tap of an output, which is inside the image.
    #[inline(always)]
    fn place(out: [usize; 2], tap: [usize; 2]) -> [usize; 2] {
        let reach = DILATION * (SIZE / 2);
        [STRIDE * out[0] + DILATION * tap[0] - reach, STRIDE * out[1] + DILATION * tap[1] - reach]
    }
}

#[inline(always)]
fn add<const N: usize>(sums: &mut [f32; N], values: &[f32; N], times: f32) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += times * value;
    }
}

#[inline(always)]
fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sums = [0.0; LANES];
    let (a, rest_a) = a.as_chunks::<LANES>();
    let (b, rest_b) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f32 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: f32) -> Vec<f32> {
        (0..count).map(|k| ((k as f32 + seed) * 12.9898).sin()).collect()
    }

    fn conv<const IN: usize, const OUT: usize, const STRIDE: usize, const DILATION: usize>()
    -> Conv<IN, OUT, 3, STRIDE, DILATION> {
        Conv { weights: numbers(9 * IN * OUT, 0.3), bias: numbers(OUT, 0.7) }
    }

    fn input(rows: usize, columns: usize) -> Map<3> {
        let mut map = Map::new(rows, columns);
        map.values = numbers(3 * rows * columns, 0.1);
        map
    }

    /// The definition, cell by cell.
    fn slow<const STRIDE: usize, const DILATION: usize>(
        conv: &Conv<3, 4, 3, STRIDE, DILATION>,
        input: &Map<3>,
        [row, column, out]: [usize; 3],
    ) -> f32 {
        let mut sum = conv.bias[out];
        for up in 0..3 {
            for across in 0..3 {
                let y = (STRIDE * row + DILATION * up) as i64 - DILATION as i64;
                let x = (STRIDE * column + DILATION * across) as i64 - DILATION as i64;
                if y < 0 || x < 0 || y >= input.rows as i64 || x >= input.columns as i64 {
                    continue;
                }
                let seen = input.at(y as usize, x as usize);
                for (i, value) in seen.iter().enumerate() {
                    sum += value * conv.weights[((up * 3 + across) * 3 + i) * 4 + out];
                }
            }
        }
        sum
    }

    fn check<const STRIDE: usize, const DILATION: usize>() {
        let conv = conv::<3, 4, STRIDE, DILATION>();
        for (rows, columns) in [(1, 1), (2, 7), (6, 5), (9, 4), (5, 23)] {
            let input = input(rows, columns);
            let mut out = Map::<4>::new(rows.div_ceil(STRIDE), columns.div_ceil(STRIDE));
            let wanted: Vec<bool> = (0..out.rows * out.columns).map(|k| k % 3 != 1).collect();
            conv.linear_where(&input, &wanted, &mut out);
            for (k, value) in out.values.iter().enumerate() {
                let at = [k / 4 / out.columns, k / 4 % out.columns, k % 4];
                let expected = if wanted[k / 4] { slow(&conv, &input, at) } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{STRIDE} {DILATION} {at:?}");
            }
        }
    }

    #[test]
    fn a_layer_is_what_its_definition_says_whatever_stride_and_dilation() {
        check::<1, 1>();
        check::<1, 2>();
        check::<2, 1>();
        check::<2, 3>();
    }

    #[test]
    fn the_gradient_is_that_of_small_steps_whatever_stride_and_dilation() {
        fn close(slope: f64, found: f32) {
            assert!((slope - f64::from(found)).abs() < 0.02, "{slope} {found}");
        }

        fn loss(conv: &Conv<3, 4, 3, 1, 2>, input: &Map<3>, weigh: &[f32]) -> f64 {
            let mut out = Map::<4>::new(5, 6);
            conv.linear_where(input, &[true; 30], &mut out);
            out.values.iter().zip(weigh).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        }

        let mut conv = conv::<3, 4, 1, 2>();
        let mut input = input(5, 6);
        let weigh = numbers(5 * 6 * 4, 0.9);
        let of_out = Map::<4> { rows: 5, columns: 6, values: weigh.clone() };
        let mut gradient = Conv::default();
        let mut of_input = Map::new(5, 6);
        conv.backward(&input, &of_out, &mut gradient, Some(&mut of_input));
        for k in (0..conv.weights.len()).step_by(7) {
            let before = loss(&conv, &input, &weigh);
            conv.weights[k] += 0.1;
            close((loss(&conv, &input, &weigh) - before) / 0.1, gradient.weights[k]);
            conv.weights[k] -= 0.1;
        }
        for k in (0..input.values.len()).step_by(5) {
            let before = loss(&conv, &input, &weigh);
            input.values[k] += 0.1;
            close((loss(&conv, &input, &weigh) - before) / 0.1, of_input.values[k]);
            input.values[k] -= 0.1;
        }
        let sum: f32 = weigh.chunks(4).map(|cell| cell[1]).sum();
        assert!((gradient.bias[1] - sum).abs() < 1e-4);
    }
}
