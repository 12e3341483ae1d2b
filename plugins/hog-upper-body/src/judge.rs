//! Classifiers in the form in which they are run: on neighbouring windows of an image at one scale.

use crate::Spans;
use crate::channels::{Channels, DEPTH, Planes};
use crate::coverage::SIDE;
use crate::hog::{BLOCK, Blocks};
use crate::model::{Machine, Model};
use crate::trees::{CELLS, ROUND, Tree, Trees};

/// Number of windows or values that are processed at once.
pub(crate) const LANES: usize = 8;
/// Number of separate sums of products, so that no addition waits for another.
const MANY: usize = 4 * LANES;
/// Number of values in a row of blocks of a window, rounded up to full lanes.
const ROW: usize = (SIDE * BLOCK).next_multiple_of(MANY);

/// A machine and its input.
#[derive(Clone, Debug)]
pub(crate) enum Judge {
    Linear(Linear),
    Trees(Forest),
}

impl Judge {
    pub(crate) fn new(model: &Model) -> Self {
        match &model.machine {
            Machine::Linear { weights, bias } => Self::Linear(Linear::new(weights, *bias)),
            Machine::Trees(trees) => Self::Trees(Forest::new(trees)),
        }
    }

    /// Computes the input from another image (see [`Blocks::fill`]).
    pub(crate) fn fill(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        match self {
            Self::Linear(linear) => linear.blocks.fill(pixels, width, spans),
            Self::Trees(forest) => forest.fill(pixels, width, spans),
        }
    }

    /// Computes the sums of neighbouring windows, as many as there are `sums`; the first one begins
    /// at cell (x, y), of 8 pixels.
    pub(crate) fn sums(&self, (x, y): (usize, usize), sums: &mut [f32]) {
        match self {
            Self::Linear(linear) => linear.sums((x, y), sums),
            Self::Trees(forest) => forest.sums((x, y), sums),
        }
    }
}

/// Weighted sum of blocks.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    blocks: Blocks,
    /// Weights, with zeros for the values that fill the last lanes of a row: those belong to the
    /// block behind the window.
    weights: Vec<[f32; ROW]>,
    bias: f32,
}

impl Linear {
    fn new(weights: &[f32], bias: f32) -> Self {
        fn padded(row: &[f32]) -> [f32; ROW] {
            let mut padded = [0.0; ROW];
            padded[..SIDE * BLOCK].copy_from_slice(row);
            padded
        }
        let weights = weights.chunks_exact(SIDE * BLOCK).map(padded).collect();
        Self { blocks: Blocks::default(), weights, bias }
    }

    fn sums(&self, (x, y): (usize, usize), sums: &mut [f32]) {
        for (sum, x) in sums.iter_mut().zip(x..) {
            let rows = std::array::from_fn(|row| self.blocks.from(x, y + row));
            *sum = product(&self.weights, rows) + self.bias;
        }
    }
}

/// Returns the product of the weights with a window that begins with the first block of each row.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn product(weights: &[[f32; ROW]], rows: [&[f32]; SIDE]) -> f32 {
    let mut lanes = [0.0_f32; MANY];
    for (weights, row) in weights.iter().zip(rows) {
        let row = &row[..ROW];
        for at in (0..ROW).step_by(MANY) {
            for lane in 0..MANY {
                lanes[lane] += weights[at + lane] * row[at + lane];
            }
        }
    }
    lanes.iter().sum()
}

/// Trees that refer to places in planes.
#[derive(Clone, Debug)]
pub(crate) struct Forest {
    trees: Trees,
    channels: Channels,
    planes: Planes,
    /// Places of each tree's values for the layout of the planes, relative to a window's first
    /// cell.
    places: Vec<[u32; 3]>,
    layout: usize,
}

impl Forest {
    fn new(trees: &Trees) -> Self {
        let trees = trees.clone();
        let places = Vec::new();
        Self { trees, channels: Channels::default(), planes: Planes::default(), places, layout: 0 }
    }

    fn fill(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        self.channels.fill(pixels, width, spans);
        self.channels.planes(&mut self.planes);
        // Places depend on the layout only, which rarely changes from one image to the next.
        if self.layout != self.planes.layout() {
            self.places.clear();
            for tree in &self.trees.trees {
                self.places.push(tree.numbers.map(|number| {
                    let cell = usize::from(number) / DEPTH;
                    let k = usize::from(number) % DEPTH;
                    self.planes.place(cell % CELLS, cell / CELLS, k) as u32
                }));
            }
            self.layout = self.planes.layout();
        }
    }

    fn sums(&self, (x, y): (usize, usize), sums: &mut [f32]) {
        for (sums, x) in sums.chunks_mut(LANES).zip((x..).step_by(LANES)) {
            let mut lanes = [0.0; LANES];
            // A cell of 8 pixels is two cells of the channels.
            let cells = &self.planes.values()[self.planes.place(2 * x, 2 * y, 0)..];
            add_trees(&self.trees, &self.places, cells, &mut lanes);
            sums.copy_from_slice(&lanes[..sums.len()]);
        }
    }
}

/// Computes the sums of neighbouring windows; see [`Trees::sum_of`].
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_trees(trees: &Trees, places: &[[u32; 3]], cells: &[f32], sums: &mut [f32; LANES]) {
    let rounds = trees.trees.chunks(ROUND).zip(places.chunks(ROUND)).zip(&trees.least);
    for ((trees, places), least) in rounds {
        for (tree, [a, b, c]) in trees.iter().zip(places) {
            let Tree { below: [first, yes, no], values, .. } = *tree;
            let [yes_yes, yes_no, no_yes, no_no] = values;
            let a = &cells[*a as usize..][..LANES];
            let b = &cells[*b as usize..][..LANES];
            let c = &cells[*c as usize..][..LANES];
            for lane in 0..LANES {
                // Both answers are selected without a branch, so that the loop can use vector
                // instructions.
                let if_yes = if b[lane] < yes { yes_yes } else { yes_no };
                let if_no = if c[lane] < no { no_yes } else { no_no };
                sums[lane] += if a[lane] < first { if_yes } else { if_no };
            }
        }
        let mut alive = false;
        for sum in &mut *sums {
            let is_hopeless = *sum < *least;
            *sum = if is_hopeless { f32::NEG_INFINITY } else { *sum };
            alive |= !is_hopeless;
        }
        if !alive {
            break;
        }
    }
}
