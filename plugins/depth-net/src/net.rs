use multiversion::multiversion;
use tagalong_learn::conv::{Conv, Map};

use crate::FloorMap;

/// Channels of the layers, and of the first together with those of the coarse cells.
const WIDE: usize = 16;
const JOINED: usize = WIDE + FloorMap::COARSE;
/// Channels of the answer: log-odds, two offsets of the place, and the height.
const ANSWER: usize = 4;
/// Height of a head to which the answer is relative, m.
pub(crate) const HEAD_M: f32 = 1.5;
/// Log-odds of a network that has learned nothing: people are rare.
#[cfg(feature = "train")]
pub(crate) const RARE: f32 = -4.0;

/// The network: a layer that halves the fine cells, four that look at cells of 10 cm and their
/// neighbours up to 0.8 m away, and a weighted sum for each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Net {
    pub(crate) first: Conv<{ FloorMap::FINE }, WIDE, 3>,
    pub(crate) second: Conv<JOINED, WIDE, 3, 1>,
    pub(crate) third: Conv<WIDE, WIDE, 3, 1, 2>,
    pub(crate) fourth: Conv<WIDE, WIDE, 3, 1, 2>,
    pub(crate) fifth: Conv<WIDE, WIDE, 3, 1>,
    pub(crate) last: Conv<WIDE, ANSWER, 1, 1>,
}

/// Values of the layers for one map.
#[derive(Clone, Debug)]
pub struct Pass {
    first: Map<WIDE>,
    joined: Map<JOINED>,
    second: Map<WIDE>,
    third: Map<WIDE>,
    fourth: Map<WIDE>,
    fifth: Map<WIDE>,
    /// The answer for each coarse cell.
    pub(crate) answer: Map<ANSWER>,
}

impl Default for Pass {
    fn default() -> Self {
        fn map<const CHANNELS: usize>() -> Map<CHANNELS> {
            Map::new(FloorMap::CELLS, FloorMap::CELLS)
        }
        Self {
            first: map(),
            joined: map(),
            second: map(),
            third: map(),
            fourth: map(),
            fifth: map(),
            answer: map(),
        }
    }
}

impl Pass {
    /// Returns the uncalibrated log-odds of a coarse cell.
    pub fn logit(&self, row: usize, column: usize) -> f32 {
        self.answer.at(row, column)[0]
    }

    /// Returns the head of the person in a coarse cell: offset from the centre of the cell on the
    /// floor, and height above the floor, m.
    pub fn head(&self, row: usize, column: usize) -> [f32; 3] {
        let [_, x, y, height] = *self.answer.at(row, column);
        [x, y, HEAD_M + height]
    }

    /// Concatenates the output of the first layer and the coarse cells.
    #[inline(always)]
    fn join(&mut self, map: &FloorMap) {
        let cells = self.joined.values.as_chunks_mut::<JOINED>().0.iter_mut();
        let first = self.first.values.as_chunks::<WIDE>().0;
        let coarse = map.coarse.values.as_chunks::<{ FloorMap::COARSE }>().0;
        for ((cell, first), coarse) in cells.zip(first).zip(coarse) {
            cell[..WIDE].copy_from_slice(first);
            cell[WIDE..].copy_from_slice(coarse);
        }
    }
}

impl Net {
    /// Names of the parts, in the order of [`Self::parts`].
    pub(crate) const PARTS: [&'static str; 12] = [
        "first",
        "first_bias",
        "second",
        "second_bias",
        "third",
        "third_bias",
        "fourth",
        "fourth_bias",
        "fifth",
        "fifth_bias",
        "last",
        "last_bias",
    ];

    /// Inputs of one output of each part; zero for what starts at zero.
    #[cfg(feature = "train")]
    pub(crate) const INPUTS: [usize; 12] =
        [9 * FloorMap::FINE, 0, 9 * JOINED, 0, 9 * WIDE, 0, 9 * WIDE, 0, 9 * WIDE, 0, WIDE, 0];

    /// All numbers that are learned.
    pub(crate) fn parts(&self) -> Vec<&[f32]> {
        let Self { first, second, third, fourth, fifth, last } = self;
        [first.parts(), second.parts(), third.parts(), fourth.parts(), fifth.parts(), last.parts()]
            .concat()
    }

    /// The same, mutably.
    pub(crate) fn parts_mut(&mut self) -> Vec<&mut [f32]> {
        let Self { first, second, third, fourth, fifth, last } = self;
        let layers = [
            first.parts_mut(),
            second.parts_mut(),
            third.parts_mut(),
            fourth.parts_mut(),
            fifth.parts_mut(),
            last.parts_mut(),
        ];
        layers.into_iter().flatten().collect()
    }

    /// Computes the answer for each coarse cell that is in view; all others stay zero.
    pub fn look(&self, map: &FloorMap, pass: &mut Pass) {
        forward(self, map, pass);
    }

    /// Adds to `gradient` how a loss depends on the weights, after [`Self::look`] at the same map.
    /// `of` holds how it depends on the answer, and zeros elsewhere; it is used up.
    #[cfg(feature = "train")]
    pub(crate) fn learn(&self, map: &FloorMap, pass: &Pass, gradient: &mut Self, of: &mut Pass) {
        backward(self, map, pass, gradient, of);
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma", "x86_64+avx2"))]
fn forward(net: &Net, map: &FloorMap, pass: &mut Pass) {
    let cells = &map.in_view;
    net.first.forward_where(&map.fine, cells, &mut pass.first);
    pass.join(map);
    net.second.forward_where(&pass.joined, cells, &mut pass.second);
    net.third.forward_where(&pass.second, cells, &mut pass.third);
    net.fourth.forward_where(&pass.third, cells, &mut pass.fourth);
    net.fifth.forward_where(&pass.fourth, cells, &mut pass.fifth);
    net.last.linear_where(&pass.fifth, cells, &mut pass.answer);
}

#[cfg(feature = "train")]
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2+fma", "x86_64+avx2"))]
fn backward(net: &Net, map: &FloorMap, pass: &Pass, gradient: &mut Net, of: &mut Pass) {
    net.last.backward(&pass.fifth, &of.answer, &mut gradient.last, Some(&mut of.fifth));
    net.fifth.backward(&pass.fourth, &of.fifth, &mut gradient.fifth, Some(&mut of.fourth));
    net.fourth.backward(&pass.third, &of.fourth, &mut gradient.fourth, Some(&mut of.third));
    net.third.backward(&pass.second, &of.third, &mut gradient.third, Some(&mut of.second));
    net.second.backward(&pass.joined, &of.second, &mut gradient.second, Some(&mut of.joined));
    let joined = of.joined.values.as_chunks::<JOINED>().0;
    for (first, joined) in of.first.values.as_chunks_mut::<WIDE>().0.iter_mut().zip(joined) {
        first.copy_from_slice(&joined[..WIDE]);
    }
    net.first.backward(&map.fine, &of.first, &mut gradient.first, None);
}
