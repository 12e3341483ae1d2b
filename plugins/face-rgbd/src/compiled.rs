//! A cascade prepared for neighbouring windows: features are offsets into integral images.

use crate::cascade::{Cascade, Feature, Next, Node, Part, Split, Tree};
use crate::level::Level;

/// Number of neighbouring windows that are classified together.
pub(crate) const LANES: usize = 16;
/// Number of remaining windows from which these are classified one by one.
const FEW: u32 = 2;
/// Least standard deviation of a window's grey values; a window with less is empty.
const LEAST_CONTRAST: f64 = 10.0;

/// Four corners of a rectangle, as offsets from a window's first sum.
pub(crate) type Corners = [u32; 4];
/// Rectangles of a feature and their weights; the last weight may be 0.
pub(crate) type Haar = [(Corners, f32); 3];

/// A feature of windows anywhere in an image.
#[derive(Clone, Debug)]
enum WindowFeature {
    Haar(Haar),
    /// 4x4 corners of 3x3 blocks.
    Binary([u32; 16]),
}

/// A question about rectangles, and one more on either side.
#[derive(Clone, Debug)]
struct Pair {
    /// Features of the first question, the one if yes, and the one if no.
    parts: [Haar; 3],
    thresholds: [f32; 3],
    /// Values for yes and yes, yes and no, no and yes, no and no.
    values: [f32; 4],
}

#[derive(Clone, Debug)]
enum Weak {
    /// One question about rectangles.
    Stump {
        parts: Haar,
        threshold: f32,
        values: [f32; 2],
    },
    /// Two such questions in a row.
    Pair(Box<Pair>),
    Tree(Tree),
}

impl Weak {
    fn new(tree: &Tree, looks: &[WindowFeature]) -> Self {
        stump(tree, looks).or_else(|| pair(tree, looks)).unwrap_or_else(|| Self::Tree(tree.clone()))
    }
}

/// Returns the rectangles and the threshold of a node.
fn asked(node: &Node, looks: &[WindowFeature]) -> Option<(Haar, f32)> {
    match (looks.get(node.feature)?, node.split) {
        (WindowFeature::Haar(parts), Split::Below(threshold)) => Some((*parts, threshold)),
        _ => None,
    }
}

fn stump(tree: &Tree, looks: &[WindowFeature]) -> Option<Weak> {
    let [Node { next: [Next::Leaf(yes), Next::Leaf(no)], .. }] = tree[..] else { return None };
    let (parts, threshold) = asked(&tree[0], looks)?;
    Some(Weak::Stump { parts, threshold, values: [yes, no] })
}

/// Converts a tree of depth two; a leaf in place of a question becomes one that is always answered
/// with yes.
fn pair(tree: &Tree, looks: &[WindowFeature]) -> Option<Weak> {
    let (first, threshold) = asked(tree.first()?, looks)?;
    let mut pair = Pair {
        parts: [first; 3],
        thresholds: [threshold, f32::INFINITY, f32::INFINITY],
        values: [0.0; 4],
    };
    for (side, next) in tree[0].next.iter().enumerate() {
        let leaves = match next {
            Next::Leaf(value) => [*value; 2],
            Next::Node(to) => {
                let node = &tree[*to];
                let [Next::Leaf(yes), Next::Leaf(no)] = node.next else { return None };
                (pair.parts[1 + side], pair.thresholds[1 + side]) = asked(node, looks)?;
                [yes, no]
            }
        };
        pair.values[2 * side..2 * side + 2].copy_from_slice(&leaves);
    }
    Some(Weak::Pair(Box::new(pair)))
}

#[derive(Clone, Debug)]
struct Stage {
    threshold: f32,
    weak: Vec<Weak>,
}

/// A cascade with features as offsets for one layout of sums.
#[derive(Clone, Debug)]
pub struct Compiled {
    layout: (usize, usize, usize),
    looks: Vec<WindowFeature>,
    stages: Vec<Stage>,
    middle: Corners,
    area: f64,
    is_normalised: bool,
    is_tilted: bool,
}

/// Neighbouring windows, and those of them that are not rejected yet.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Offset of the first window's sums.
    start: usize,
    /// Reciprocal of the area times the contrast of each window; 0 for empty ones.
    contrast: [f32; LANES],
    /// Sums of the current stage.
    sums: [f32; LANES],
    /// One bit per window that is not rejected.
    pub alive: u32,
}

impl Compiled {
    /// Computes the offsets for the sums of a level; `cascade` was checked.
    pub fn new(cascade: &Cascade, level: &Level) -> Self {
        let mut looks = Vec::with_capacity(cascade.features.len());
        for feature in &cascade.features {
            looks.push(match feature {
                Feature::Haar(parts) => {
                    WindowFeature::Haar(rectangles(parts, |part| corners(part, level)))
                }
                Feature::Tilted(parts) => {
                    WindowFeature::Haar(rectangles(parts, |part| tilted_corners(part, level)))
                }
                Feature::Binary(part) => WindowFeature::Binary(std::array::from_fn(|k: usize| {
                    let x = part.x + k % 4 * part.width;
                    let y = part.y + k / 4 * part.height;
                    level.offset(x, y) as u32
                })),
            });
        }
        let stages = cascade.stages.iter().map(|stage| Stage {
            threshold: stage.threshold,
            weak: stage.trees.iter().map(|tree| Weak::new(tree, &looks)).collect(),
        });
        let stages = stages.collect();
        let middle = cascade.middle();
        Self {
            layout: level.layout(),
            stages,
            looks,
            middle: corners(&middle, level),
            area: (middle.width * middle.height) as f64,
            is_normalised: cascade.is_normalised(),
            is_tilted: cascade.is_tilted(),
        }
    }

    /// Returns true if features read the tilted sums of a level.
    pub fn is_tilted(&self) -> bool {
        self.is_tilted
    }

    /// Returns true if the offsets are those of a level's sums.
    pub fn fits(&self, level: &Level) -> bool {
        self.layout == level.layout()
    }

    /// Starts the windows from (x, y) on, with their sums of the first stage; none are rejected
    /// yet. `x` is a column at which a window can begin.
    pub fn start(&self, level: &Level, (x, y): (usize, usize)) -> Block {
        let start = level.offset(x, y);
        let mut block = Block {
            start,
            contrast: [1.0; LANES],
            sums: [0.0; LANES],
            alive: u32::MAX >> (32 - LANES),
        };
        if self.is_normalised {
            let sums = &level.sums()[start..];
            let squares = &level.squares()[start..];
            contrasts(sums, squares, &self.middle, self.area, &mut block.contrast);
        }
        self.judge(0, level, &mut block);
        block
    }

    /// Returns true if a window is not empty.
    pub fn is_worth_it(block: &Block, lane: usize) -> bool {
        block.contrast[lane] != 0.0
    }

    /// Returns true if a window's sum reaches the threshold of the stage.
    pub fn passes(&self, stage: usize, block: &Block, lane: usize) -> bool {
        block.sums[lane] >= self.stages[stage].threshold
    }

    /// Returns the excess of a window's sum over the threshold of the last stage.
    pub fn margin(&self, block: &Block, lane: usize) -> f32 {
        self.stages.last().map_or(0.0, |stage| block.sums[lane] - stage.threshold)
    }

    /// Rejects the windows that do not pass all stages but the first.
    pub fn finish(&self, level: &Level, block: &mut Block) {
        let mut stage = 1;
        // A stage for all windows costs the same however few remain, so the last ones are
        // classified one by one.
        while stage < self.stages.len() && block.alive.count_ones() > FEW {
            self.judge(stage, level, block);
            block.keep(|block, lane| self.passes(stage, block, lane));
            stage += 1;
        }
        if stage < self.stages.len() {
            let sums = &level.sums()[block.start..];
            block.keep(|block, lane| {
                let sum = self.alone(stage, &sums[lane..], block.contrast[lane]);
                sum.map(|sum| block.sums[lane] = sum).is_some()
            });
        }
    }

    /// Computes the sums of a stage for all windows of a block.
    fn judge(&self, stage: usize, level: &Level, block: &mut Block) {
        let sums = &level.sums()[block.start..];
        block.sums = [0.0; LANES];
        for weak in &self.stages[stage].weak {
            match weak {
                Weak::Stump { parts, threshold, values } => {
                    add_stump(parts, *threshold, *values, sums, &block.contrast, &mut block.sums);
                }
                Weak::Pair(pair) => add_pair(pair, sums, &block.contrast, &mut block.sums),
                Weak::Tree(tree) => {
                    for (lane, sum) in block.sums.iter_mut().enumerate() {
                        *sum += self.leaf(tree, &sums[lane..], block.contrast[lane]);
                    }
                }
            }
        }
    }

    /// Returns the sum of the last stage for one window; `None` if it fails a stage from `first`
    /// on.
    fn alone(&self, first: usize, sums: &[u32], contrast: f32) -> Option<f32> {
        let mut last = 0.0;
        for stage in &self.stages[first..] {
            last = stage.weak.iter().map(|weak| self.value(weak, sums, contrast)).sum();
            if last < stage.threshold {
                return None;
            }
        }
        Some(last)
    }

    fn value(&self, weak: &Weak, sums: &[u32], contrast: f32) -> f32 {
        match weak {
            Weak::Stump { parts, threshold, values } => {
                values[usize::from(haar(parts, sums) * contrast >= *threshold)]
            }
            Weak::Pair(pair) => {
                let Pair { parts, thresholds, values } = &**pair;
                let side = usize::from(haar(&parts[0], sums) * contrast >= thresholds[0]);
                let child = 1 + side;
                let is_no = haar(&parts[child], sums) * contrast >= thresholds[child];
                values[2 * side + usize::from(is_no)]
            }
            Weak::Tree(tree) => self.leaf(tree, sums, contrast),
        }
    }

    /// Returns the value of the leaf that a window reaches in a tree.
    fn leaf(&self, tree: &Tree, sums: &[u32], contrast: f32) -> f32 {
        let mut at = 0;
        loop {
            let node = &tree[at];
            let yes = match (&self.looks[node.feature], node.split) {
                (WindowFeature::Haar(parts), Split::Below(threshold)) => {
                    haar(parts, sums) * contrast < threshold
                }
                (WindowFeature::Binary(corners), Split::Among(bits)) => {
                    let pattern = pattern(corners, sums);
                    bits[pattern >> 5] >> (pattern & 31) & 1 == 1
                }
                _ => false,
            };
            match node.next[usize::from(!yes)] {
                Next::Leaf(value) => return value,
                Next::Node(to) => at = to,
            }
        }
    }
}

impl Block {
    /// Returns the windows that are not rejected, from left to right.
    pub fn lanes(&self) -> impl Iterator<Item = usize> + use<> {
        let alive = self.alive;
        (0..LANES).filter(move |lane| alive >> lane & 1 == 1)
    }

    /// Rejects windows that fail a test.
    pub fn keep(&mut self, mut is_good: impl FnMut(&mut Self, usize) -> bool) {
        for lane in self.lanes() {
            if !is_good(self, lane) {
                self.alive &= !(1 << lane);
            }
        }
    }
}

pub(crate) fn corners(part: &Part, level: &Level) -> Corners {
    let right = part.x + part.width;
    let bottom = part.y + part.height;
    [(part.x, part.y), (right, part.y), (part.x, bottom), (right, bottom)]
        .map(|(x, y)| level.offset(x, y) as u32)
}

/// Returns the corners of a rectangle that is turned by 45 degrees: the uppermost, left, right and
/// lowest one, whose sums add up with the same signs as those of an upright rectangle.
fn tilted_corners(part: &Part, level: &Level) -> Corners {
    let Part { x, y, width, height } = *part;
    [
        (x, y),
        (x - height, y + height),
        (x + width, y + width),
        (x + width - height, y + width + height),
    ]
    .map(|(x, y)| level.tilted_offset(x, y) as u32)
}

pub(crate) fn rectangles(parts: &[(Part, f32)], corners: impl Fn(&Part) -> Corners) -> Haar {
    let mut out = [([0; 4], 0.0); 3];
    for (out, (part, weight)) in out.iter_mut().zip(parts) {
        *out = (corners(part), *weight);
    }
    out
}

fn sum(sums: &[u32], corners: &Corners) -> u32 {
    let [a, b, c, d] = corners.map(|corner| sums[corner as usize]);
    // The corners are sums modulo 2^32, and wrapping differences of them are exact.
    a.wrapping_sub(b).wrapping_sub(c).wrapping_add(d)
}

pub(crate) fn haar(parts: &Haar, sums: &[u32]) -> f32 {
    let [first, second, third] = parts;
    let two = weighted_sum(first, sums) + weighted_sum(second, sums);
    if third.1 == 0.0 { two } else { two + weighted_sum(third, sums) }
}

/// Returns the sum of a rectangle times its weight.
#[inline]
fn weighted_sum((corners, weight): &(Corners, f32), sums: &[u32]) -> f32 {
    // Sums over a window fit into i32, which vector instructions convert to f32 directly.
    weight * sum(sums, corners) as i32 as f32
}

/// Neighbours clockwise from the upper left, and the middle, as the upper left corners of blocks
/// among 4x4 corners.
const AROUND: [usize; 8] = [0, 1, 2, 6, 10, 9, 8, 4];
const MIDDLE: usize = 5;

fn pattern(corners: &[u32; 16], sums: &[u32]) -> usize {
    let middle = block_sum(corners, sums, MIDDLE);
    AROUND.iter().fold(0, |bits, k| bits << 1 | usize::from(block_sum(corners, sums, *k) >= middle))
}

/// Returns the sum of the block from this corner on, of corners in rows of four.
#[inline]
fn block_sum(corners: &[u32; 16], sums: &[u32], k: usize) -> u32 {
    sum(sums, &[corners[k], corners[k + 1], corners[k + 4], corners[k + 5]])
}

/// Returns the sums over a rectangle of neighbouring windows. Written as loops, because closures in
/// `map` and the like are not compiled for the instructions of the caller.
#[inline(always)]
fn sums_beside(sums: &[u32], corners: &Corners) -> [u32; LANES] {
    let [a, b, c, d] = corners;
    let a = &sums[*a as usize..][..LANES];
    let b = &sums[*b as usize..][..LANES];
    let c = &sums[*c as usize..][..LANES];
    let d = &sums[*d as usize..][..LANES];
    let mut out = [0; LANES];
    for i in 0..LANES {
        out[i] = a[i].wrapping_sub(b[i]).wrapping_sub(c[i]).wrapping_add(d[i]);
    }
    out
}

/// Computes [`haar`] for neighbouring windows.
#[inline(always)]
fn haar_beside(parts: &Haar, sums: &[u32]) -> [f32; LANES] {
    let mut values = [0.0; LANES];
    for (corners, weight) in parts {
        if *weight != 0.0 {
            let sums = sums_beside(sums, corners);
            for lane in 0..LANES {
                values[lane] += weight * sums[lane] as i32 as f32;
            }
        }
    }
    values
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_pair(pair: &Pair, sums: &[u32], contrast: &[f32; LANES], to: &mut [f32; LANES]) {
    let [first, yes, no] = pair.thresholds;
    let [yes_yes, yes_no, no_yes, no_no] = pair.values;
    let a = haar_beside(&pair.parts[0], sums);
    let b = haar_beside(&pair.parts[1], sums);
    let c = haar_beside(&pair.parts[2], sums);
    for lane in 0..LANES {
        let if_yes = if b[lane] * contrast[lane] < yes { yes_yes } else { yes_no };
        let if_no = if c[lane] * contrast[lane] < no { no_yes } else { no_no };
        to[lane] += if a[lane] * contrast[lane] < first { if_yes } else { if_no };
    }
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_stump(
    parts: &Haar,
    threshold: f32,
    [yes, no]: [f32; 2],
    sums: &[u32],
    contrast: &[f32; LANES],
    to: &mut [f32; LANES],
) {
    let values = haar_beside(parts, sums);
    for lane in 0..LANES {
        to[lane] += if values[lane] * contrast[lane] < threshold { yes } else { no };
    }
}

/// Computes the reciprocal of the area times the standard deviation of the windows; 0 for empty
/// ones.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn contrasts(sums: &[u32], squares: &[u32], corners: &Corners, area: f64, out: &mut [f32; LANES]) {
    let sums = sums_beside(sums, corners);
    let squares = sums_beside(squares, corners);
    for lane in 0..LANES {
        // In f64, because the difference of two large products is small.
        let sum = f64::from(sums[lane]);
        let square = f64::from(squares[lane]);
        let root = (area * square - sum * sum).max(0.0).sqrt();
        let is_empty = root <= LEAST_CONTRAST * area;
        out[lane] = if is_empty { 0.0 } else { (1.0 / root) as f32 };
    }
}
