//! Boosted trees of depth two.

use crate::channels::DEPTH;
use crate::coverage::{Coverage, SIDE};

/// Number of cells along a side of a window.
pub(crate) const CELLS: usize = 2 * (SIDE + 1);

/// Returns the number of values of a window.
pub(crate) const fn channel_numbers(coverage: Coverage) -> usize {
    CELLS * 2 * coverage.rows() * DEPTH
}

/// Number of trees after which windows may be rejected, and again after as many.
pub const ROUND: usize = 8;
/// Number of bytes of a tree in a file.
const BYTES: usize = 3 * 6 + 4 * 4;

/// A question, and one more on either side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tree {
    /// Indices of the values of a window in the questions: the first, the one if below, the one if
    /// not.
    pub numbers: [u16; 3],
    /// Thresholds of the questions.
    pub below: [f32; 3],
    /// Values of the leaves: yes and yes, yes and no, no and yes, no and no.
    pub values: [f32; 4],
}

impl Tree {
    fn value(&self, numbers: &[f32]) -> f32 {
        let side = usize::from(numbers[usize::from(self.numbers[0])] >= self.below[0]);
        let child = 1 + side;
        let is_no = numbers[usize::from(self.numbers[child])] >= self.below[child];
        self.values[2 * side + usize::from(is_no)]
    }

    fn to_bytes(self) -> impl Iterator<Item = u8> {
        let numbers = self.numbers.into_iter().flat_map(u16::to_le_bytes);
        numbers.chain(self.below.into_iter().chain(self.values).flat_map(f32::to_le_bytes))
    }

    fn from_bytes(bytes: &[u8]) -> Self {
        let [first, second, third, values @ ..]: [f32; 7] = std::array::from_fn(|k| {
            let at = 6 + 4 * k;
            f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        });
        Self {
            numbers: [0, 1, 2].map(|k| u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]])),
            below: [first, second, third],
            values,
        }
    }
}

/// Trees in rounds, one after the other; after each round, windows may be rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct Trees {
    /// The trees, [`ROUND`] to a round.
    pub trees: Vec<Tree>,
    /// For each round: the sum below which a window is rejected after it. A person may have to
    /// catch up early, and not late.
    pub least: Vec<f32>,
}

impl Trees {
    /// Creates trees that reject all windows below the same sum.
    pub fn new(trees: Vec<Tree>, least: f32) -> Self {
        let rounds = trees.len().div_ceil(ROUND);
        Self { trees, least: vec![least; rounds] }
    }

    /// Returns the sum of a window's values; minus infinity if the window is rejected.
    pub fn sum_of(&self, numbers: &[f32]) -> f32 {
        let mut last = 0.0;
        for (sum, least) in self.on_the_way(numbers).zip(&self.least) {
            last = if sum < *least { return f32::NEG_INFINITY } else { sum };
        }
        last
    }

    /// Returns the sum after each round, also after that in which the window is rejected.
    pub(crate) fn on_the_way(&self, numbers: &[f32]) -> impl Iterator<Item = f32> {
        self.trees.chunks(ROUND).scan(0.0, |sum, round| {
            round.iter().for_each(|tree| *sum += tree.value(numbers));
            Some(*sum)
        })
    }
}

pub(crate) fn to_bytes(trees: &[Tree]) -> Vec<u8> {
    trees.iter().flat_map(|tree| tree.to_bytes()).collect()
}

/// Parses the trees of a file.
///
/// # Errors
/// Bytes that are not trees; the message is one sentence.
pub(crate) fn from_bytes(
    bytes: &[u8],
    least: Vec<f32>,
    coverage: Coverage,
) -> Result<Trees, String> {
    let trees = parse(bytes, channel_numbers(coverage))?;
    if least.len() != trees.len().div_ceil(ROUND) {
        return Err(format!("it has {} levels for {} trees", least.len(), trees.len()));
    }
    Ok(Trees { trees, least })
}

/// Parses trees that ask for so many `numbers` of a window.
///
/// # Errors
/// Bytes that are not trees; the message is one sentence.
pub(crate) fn parse(bytes: &[u8], numbers: usize) -> Result<Vec<Tree>, String> {
    let trees: Vec<Tree> = bytes.chunks_exact(BYTES).map(Tree::from_bytes).collect();
    let are_right = trees.iter().all(|tree| {
        let known = tree.numbers.iter().all(|n| usize::from(*n) < numbers);
        known && !tree.below.iter().any(|v| v.is_nan()) && tree.values.iter().all(|v| v.is_finite())
    });
    if trees.is_empty() || !bytes.len().is_multiple_of(BYTES) || !are_right {
        return Err("its trees are broken".into());
    }
    Ok(trees)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TREE: Tree = Tree { numbers: [0, 1, 2], below: [0.5; 3], values: [1.0, 2.0, 3.0, 4.0] };

    #[test]
    fn the_second_question_is_that_of_the_first_answer() {
        fn value(numbers: [f32; 3]) -> f32 {
            TREE.value(&numbers)
        }

        assert_eq!([value([0.0, 0.0, 1.0]), value([0.0, 1.0, 0.0])], [1.0, 2.0]);
        assert_eq!([value([1.0, 1.0, 0.0]), value([1.0, 0.0, 1.0])], [3.0, 4.0]);
        assert_eq!(value([0.5, 0.0, 0.5]), 4.0, "the threshold itself is not below");
    }

    #[test]
    fn a_tree_that_asks_beyond_the_window_is_refused() {
        fn read(number: usize) -> [bool; 2] {
            let tree = Tree { numbers: [number as u16, 0, 0], ..TREE };
            [Coverage::UpperBody, Coverage::WholeBody]
                .map(|coverage| from_bytes(&to_bytes(&[tree]), vec![0.0], coverage).is_ok())
        }

        let [upper, whole] = [Coverage::UpperBody, Coverage::WholeBody].map(channel_numbers);
        assert_eq!([read(upper - 1), read(upper)], [[true, true], [false, true]]);
        assert_eq!([read(whole - 1), read(whole)], [[false, true], [false, false]]);
    }
}
