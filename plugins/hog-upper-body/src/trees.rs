//! Boosted trees of two questions each.

use crate::channels::DEPTH;
use crate::model::SIDE;

/// Cells along a side of a window.
pub(crate) const CELLS: usize = 2 * (SIDE + 1);
/// Numbers of a window.
pub(crate) const CHANNEL_NUMBERS: usize = CELLS * CELLS * DEPTH;
/// Trees after which windows may be given up, and again after as many.
pub const ROUND: usize = 8;
/// Bytes of a tree in a file.
const BYTES: usize = 3 * 6 + 4 * 4;

/// A question, and one more on either side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tree {
    /// Which numbers of a window are looked at: first, if below, if not.
    pub numbers: [u16; 3],
    /// What each of them is compared with.
    pub below: [f32; 3],
    /// What is added: yes and yes, yes and no, no and yes, no and no.
    pub values: [f32; 4],
}

impl Tree {
    fn value(&self, numbers: &[f32]) -> f32 {
        let is_no = |k: usize| numbers[usize::from(self.numbers[k])] >= self.below[k];
        let side = usize::from(is_no(0));
        self.values[2 * side + usize::from(is_no(1 + side))]
    }

    fn to_bytes(self) -> impl Iterator<Item = u8> {
        let numbers = self.numbers.into_iter().flat_map(u16::to_le_bytes);
        numbers.chain(self.below.into_iter().chain(self.values).flat_map(f32::to_le_bytes))
    }

    fn from_bytes(bytes: &[u8]) -> Self {
        let short = |k: usize| u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]]);
        let long = |k: usize| {
            let at = 6 + 4 * k;
            f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        Self {
            numbers: [0, 1, 2].map(short),
            below: [0, 1, 2].map(long),
            values: [3, 4, 5, 6].map(long),
        }
    }
}

/// Trees in rounds, one after the other; after each round, windows are given up.
#[derive(Clone, Debug, PartialEq)]
pub struct Trees {
    /// The trees, [`ROUND`] to a round.
    pub trees: Vec<Tree>,
    /// For each round: a window whose sum is less after it is given up. A person may
    /// have to catch up early, and not late.
    pub least: Vec<f32>,
}

impl Trees {
    /// Trees that give up all windows below the same sum.
    pub fn new(trees: Vec<Tree>, least: f32) -> Self {
        let rounds = trees.len().div_ceil(ROUND);
        Self { trees, least: vec![least; rounds] }
    }

    /// The sum of a window's numbers; minus infinity if the window is given up.
    pub fn sum_of(&self, numbers: &[f32]) -> f32 {
        let mut last = 0.0;
        for (sum, least) in self.on_the_way(numbers).zip(&self.least) {
            last = if sum < *least { return f32::NEG_INFINITY } else { sum };
        }
        last
    }

    /// The sum after each round, whether the window is given up or not.
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

/// Trees of a file.
///
/// # Errors
/// In a sentence, what is wrong with the bytes.
pub(crate) fn from_bytes(bytes: &[u8], least: Vec<f32>) -> Result<Trees, String> {
    let trees: Vec<Tree> = bytes.chunks_exact(BYTES).map(Tree::from_bytes).collect();
    let is_right = |tree: &Tree| {
        let known = tree.numbers.iter().all(|n| usize::from(*n) < CHANNEL_NUMBERS);
        known && !tree.below.iter().any(|v| v.is_nan()) && tree.values.iter().all(|v| v.is_finite())
    };
    if trees.is_empty() || !bytes.len().is_multiple_of(BYTES) || !trees.iter().all(is_right) {
        return Err("its trees are broken".into());
    }
    if least.len() != trees.len().div_ceil(ROUND) {
        return Err(format!("it has {} levels for {} trees", least.len(), trees.len()));
    }
    Ok(Trees { trees, least })
}
