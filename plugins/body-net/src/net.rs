use multiversion::multiversion;
use tagalong_learn::conv::{Conv, Map};

use crate::view::NetworkInput;

/// Added to the standard deviation of the intensities before they are divided by it: an even
/// surface has no texture.
const NOISE: f32 = 8.0;

/// Channels of the first layer, and with the two of the depth.
const FIRST: usize = 8;
const JOINED: usize = FIRST + 2;
/// Channels of the last layer, ...
const LAST: usize = 32;
/// ... and its cells: the sides are halved four times, and rounded up.
const CELLS: usize = NetworkInput::GREY[0].div_ceil(16) * NetworkInput::GREY[1].div_ceil(16);

/// The network: four layers of convolutions, each of which halves the image, and a
/// weighted sum. Depth joins after the first, which has its size.
#[derive(Clone, Debug, PartialEq)]
pub struct Net {
    pub(crate) first: Conv<1, FIRST, 5>,
    pub(crate) second: Conv<JOINED, 16, 3>,
    pub(crate) third: Conv<16, LAST, 3>,
    pub(crate) fourth: Conv<LAST, LAST, 3>,
    /// Of each output of the last layer.
    pub(crate) weights: Vec<f32>,
    pub(crate) bias: Vec<f32>,
}

/// Activations of the layers on one view.
#[derive(Clone, Debug)]
pub struct Pass {
    grey: Map<1>,
    first: Map<FIRST>,
    joined: Map<JOINED>,
    second: Map<16>,
    third: Map<LAST>,
    fourth: Map<LAST>,
}

impl Default for Pass {
    fn default() -> Self {
        /// Creates the map of an input that was halved so many times.
        fn halved_map<const CHANNELS: usize>(times: u32) -> Map<CHANNELS> {
            let [rows, columns] = NetworkInput::GREY;
            Map::new(rows.div_ceil(1 << times), columns.div_ceil(1 << times))
        }

        Self {
            grey: halved_map(0),
            first: halved_map(1),
            joined: halved_map(1),
            second: halved_map(2),
            third: halved_map(3),
            fourth: halved_map(4),
        }
    }
}

impl Default for Net {
    fn default() -> Self {
        Self {
            first: Conv::default(),
            second: Conv::default(),
            third: Conv::default(),
            fourth: Conv::default(),
            weights: vec![0.0; CELLS * LAST],
            bias: vec![0.0],
        }
    }
}

impl Net {
    /// Names of the parts, in the order of [`Self::parts`].
    pub(crate) const PARTS: [&'static str; 10] = [
        "first",
        "first_bias",
        "second",
        "second_bias",
        "third",
        "third_bias",
        "fourth",
        "fourth_bias",
        "last",
        "last_bias",
    ];

    /// All numbers that are learned.
    pub(crate) fn parts(&self) -> Vec<&[f32]> {
        let Self { first, second, third, fourth, weights, bias } = self;
        [first.parts(), second.parts(), third.parts(), fourth.parts(), [&weights[..], bias]]
            .concat()
    }

    /// The same, to change them.
    pub(crate) fn parts_mut(&mut self) -> Vec<&mut [f32]> {
        let Self { first, second, third, fourth, weights, bias } = self;
        let layers = [first.parts_mut(), second.parts_mut(), third.parts_mut(), fourth.parts_mut()];
        layers.into_iter().flatten().chain([&mut weights[..], bias]).collect()
    }

    /// Number of inputs of one output of each part; zero for parts that start at zero.
    #[cfg(feature = "train")]
    pub(crate) const INPUTS: [usize; 10] = [
        Conv::<1, FIRST, 5>::INPUTS,
        0,
        Conv::<JOINED, 16, 3>::INPUTS,
        0,
        Conv::<16, LAST, 3>::INPUTS,
        0,
        Conv::<LAST, LAST, 3>::INPUTS,
        0,
        CELLS * LAST,
        0,
    ];

    /// Returns the output of the network on a view; above zero it is rather a person.
    pub fn look(&self, view: &NetworkInput, pass: &mut Pass) -> f32 {
        pass.show(view);
        forward(self, pass)
    }

    /// Adds to `gradient` how a loss depends on the weights, after [`Self::look`];
    /// `of_output` is how it depends on the output.
    #[cfg(feature = "train")]
    pub(crate) fn learn(&self, pass: &Pass, of_output: f32, gradient: &mut Self) {
        backward(self, pass, of_output, gradient, &mut Pass::default());
    }
}

impl Pass {
    /// Intensities of mean zero and a deviation of about one, and the depth.
    fn show(&mut self, view: &NetworkInput) {
        let count = view.grey.len() as f32;
        let mut sum = 0u64;
        let mut squares = 0u64;
        for value in view.grey.iter().map(|value| u64::from(*value)) {
            sum += value;
            squares += value * value;
        }
        let mean = sum as f32 / count;
        let deviation = (squares as f32 / count - mean * mean).max(0.0).sqrt();
        let scale = 1.0 / (deviation + NOISE);
        for (seen, value) in self.grey.values.iter_mut().zip(&view.grey) {
            *seen = (f32::from(*value) - mean) * scale;
        }
        let joined = self.joined.values.as_chunks_mut::<JOINED>().0;
        for (cell, joined) in joined.iter_mut().enumerate() {
            joined[FIRST..].copy_from_slice(&view.depth(cell));
        }
    }

    fn join(&mut self) {
        let first = self.first.values.as_chunks::<FIRST>().0;
        for (joined, first) in self.joined.values.as_chunks_mut::<JOINED>().0.iter_mut().zip(first)
        {
            joined[..FIRST].copy_from_slice(first);
        }
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn forward(net: &Net, pass: &mut Pass) -> f32 {
    net.first.forward(&pass.grey, &mut pass.first);
    pass.join();
    net.second.forward(&pass.joined, &mut pass.second);
    net.third.forward(&pass.second, &mut pass.third);
    net.fourth.forward(&pass.third, &mut pass.fourth);
    let seen = pass.fourth.values.iter().zip(&net.weights);
    net.bias[0] + seen.map(|(value, weight)| value * weight).sum::<f32>()
}

/// `of` has room for how the loss depends on the layers.
#[cfg(feature = "train")]
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn backward(net: &Net, pass: &Pass, of_output: f32, gradient: &mut Net, of: &mut Pass) {
    gradient.bias[0] += of_output;
    for (k, value) in pass.fourth.values.iter().enumerate().filter(|(_, value)| **value != 0.0) {
        gradient.weights[k] += of_output * value;
        of.fourth.values[k] = of_output * net.weights[k];
    }
    net.fourth.backward(&pass.third, &of.fourth, &mut gradient.fourth, Some(&mut of.third));
    net.third.backward(&pass.second, &of.third, &mut gradient.third, Some(&mut of.second));
    net.second.backward(&pass.joined, &of.second, &mut gradient.second, Some(&mut of.joined));
    let joined = of.joined.values.as_chunks::<JOINED>().0;
    for (first, joined) in of.first.values.as_chunks_mut::<FIRST>().0.iter_mut().zip(joined) {
        first.copy_from_slice(&joined[..FIRST]);
    }
    net.first.backward(&pass.grey, &of.first, &mut gradient.first, None);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the cells at 100 and half at 140: a deviation of 20, and 8 more.
    #[test]
    fn a_view_is_shown_by_its_contrast_and_its_depth() {
        let grey = (0..80 * 36).map(|k| if k % 2 == 0 { 100 } else { 140 }).collect();
        let behind = vec![50; 40 * 18];
        let mut pass = Pass::default();
        pass.show(&NetworkInput { grey, behind });
        assert!((pass.grey.values[0] + 20.0 / 28.0).abs() < 1e-5, "{}", pass.grey.values[0]);
        assert!((pass.grey.values[1] - 20.0 / 28.0).abs() < 1e-5);
        let [.., metres, is_known] = pass.joined.values.as_chunks::<JOINED>().0[0];
        assert!((metres - 1.5).abs() < 1e-5 && is_known == 1.0);
    }
}
