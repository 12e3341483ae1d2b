//! A cascade for rows of windows: features are offsets into sums.

use crate::cascade::{Cascade, Feature, Next, Node, Part, Split, Tree};
use crate::level::Level;

/// Less contrast than this, grey values, and a window is empty.
const LEAST_CONTRAST: f64 = 10.0;

/// The four corners of a rectangle, as offsets from a window's first sum.
pub(crate) type Corners = [usize; 4];

/// A feature of windows anywhere in an image.
#[derive(Clone, Debug)]
enum Look {
    /// Rectangles and weights; the last weight may be 0.
    Haar([(Corners, f32); 3]),
    /// 4x4 corners of 3x3 blocks.
    Binary([usize; 16]),
}

#[derive(Clone, Debug)]
struct Stump {
    parts: [(Corners, f32); 3],
    threshold: f32,
    values: [f32; 2],
}

/// A question about rectangles, and one more on either side.
#[derive(Clone, Debug)]
struct Pair {
    /// The first question, the one if yes, and the one if not.
    parts: [[(Corners, f32); 3]; 3],
    thresholds: [f32; 3],
    /// Yes and yes, yes and no, no and yes, no and no.
    values: [f32; 4],
}

#[derive(Clone, Debug)]
enum Weak {
    /// One question about rectangles.
    Stump(Stump),
    /// Two of them.
    Pair(Box<Pair>),
    Tree(Tree),
}

impl Weak {
    fn new(tree: &Tree, looks: &[Look]) -> Self {
        stump(tree, looks).or_else(|| pair(tree, looks)).unwrap_or_else(|| Self::Tree(tree.clone()))
    }
}

/// The rectangles and the threshold of a node.
fn asked(node: &Node, looks: &[Look]) -> Option<([(Corners, f32); 3], f32)> {
    match (looks.get(node.feature)?, node.split) {
        (Look::Haar(parts), Split::Below(threshold)) => Some((*parts, threshold)),
        _ => None,
    }
}

fn stump(tree: &Tree, looks: &[Look]) -> Option<Weak> {
    let [Node { next: [Next::Leaf(yes), Next::Leaf(no)], .. }] = tree[..] else { return None };
    let (parts, threshold) = asked(&tree[0], looks)?;
    Some(Weak::Stump(Stump { parts, threshold, values: [yes, no] }))
}

/// A leaf where a question could be asks one that everybody answers with yes.
fn pair(tree: &Tree, looks: &[Look]) -> Option<Weak> {
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

/// The windows of a row that are still in question.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Columns, ascending.
    pub columns: Vec<u32>,
    /// One through the contrast of each window.
    contrast: Vec<f32>,
    /// Sums of the current stage.
    pub sums: Vec<f32>,
    /// Scratch: values of features.
    values: [Vec<f32>; 3],
}

/// A cascade whose features are offsets for one length of rows.
#[derive(Clone, Debug, Default)]
pub struct Compiled {
    stride: usize,
    looks: Vec<Look>,
    stages: Vec<Stage>,
    middle: Corners,
    area: f64,
    is_normalised: bool,
}

impl Compiled {
    /// Offsets for rows of `stride` sums; `cascade` was checked.
    pub fn new(cascade: &Cascade, stride: usize) -> Self {
        let look = |feature: &Feature| match feature {
            Feature::Haar(parts) => Look::Haar(rectangles(parts, stride)),
            Feature::Binary(part) => {
                let at = |k: usize| {
                    (part.y + k / 4 * part.height) * stride + part.x + k % 4 * part.width
                };
                Look::Binary(std::array::from_fn(at))
            }
        };
        let looks: Vec<Look> = cascade.features.iter().map(look).collect();
        let weak = |tree: &Tree| Weak::new(tree, &looks);
        let stages = cascade.stages.iter().map(|stage| Stage {
            threshold: stage.threshold,
            weak: stage.trees.iter().map(weak).collect(),
        });
        let stages = stages.collect();
        let middle = cascade.middle();
        Self {
            stride,
            stages,
            looks,
            middle: corners(&middle, stride),
            area: (middle.width * middle.height) as f64,
            is_normalised: cascade.is_normalised(),
        }
    }

    /// Sums in a row that the offsets are for.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Takes `count` windows of row `y`, `step` columns apart from `first` on, and
    /// measures their contrast.
    pub fn start(
        &self,
        level: &Level,
        (first, y): (usize, usize),
        step: usize,
        row: &mut Row,
        count: usize,
    ) {
        let start = y * self.stride + first;
        row.columns.clear();
        row.columns.extend((0..count).map(|i| (first + i * step) as u32));
        row.contrast.clear();
        row.contrast.resize(count, 1.0);
        if self.is_normalised {
            let (sums, squares) = (&level.sums()[start..], &level.squares()[start..]);
            contrasts(sums, squares, &self.middle, self.area, step, &mut row.contrast);
        }
    }

    /// The sums of a stage for all windows of [`Compiled::start`].
    pub fn all(
        &self,
        stage: usize,
        level: &Level,
        (first, y): (usize, usize),
        step: usize,
        row: &mut Row,
    ) {
        let sums = &level.sums()[y * self.stride + first..];
        let count = row.columns.len();
        row.sums.clear();
        row.sums.resize(count, 0.0);
        for weak in &self.stages[stage].weak {
            match weak {
                Weak::Stump(stump) => {
                    let [values, ..] = &mut row.values;
                    fill(values, &stump.parts, sums, step, count);
                    decide(values, &row.contrast, stump, &mut row.sums);
                }
                Weak::Pair(pair) => {
                    for (values, parts) in row.values.iter_mut().zip(&pair.parts) {
                        fill(values, parts, sums, step, count);
                    }
                    decide_pair(&row.values, &row.contrast, pair, &mut row.sums);
                }
                Weak::Tree(tree) => {
                    let windows = row.contrast.iter().zip(&mut row.sums).enumerate();
                    for (i, (contrast, sum)) in windows {
                        *sum += self.leaf(tree, &sums[i * step..], *contrast);
                    }
                }
            }
        }
    }

    /// True if it pays to judge all windows of a row by a stage, so that neighbours
    /// are judged at once, though only `alive` of `count` are still in question.
    pub fn pays(&self, stage: usize, alive: usize, count: usize) -> bool {
        let is_flat = |weak: &Weak| !matches!(weak, Weak::Tree(_));
        self.stages.get(stage).is_some_and(|s| s.weak.iter().all(is_flat)) && 6 * alive > count
    }

    /// True if a window of [`Compiled::start`] is not empty.
    pub fn is_worth_it(row: &Row, window: usize) -> bool {
        row.contrast[window] != 0.0
    }

    /// True if the sum of a window reaches what the stage wants.
    pub fn passes(&self, stage: usize, sum: f32) -> bool {
        sum >= self.stages[stage].threshold
    }

    /// By how much a sum of the last stage is larger than it has to be.
    pub fn margin(&self, sum: f32) -> f32 {
        self.stages.last().map_or(0.0, |stage| sum - stage.threshold)
    }

    /// Keeps the `chosen` windows, and of those the ones that pass all stages from
    /// `stage` on.
    pub fn rest(&self, stage: usize, level: &Level, y: usize, row: &mut Row, chosen: &[usize]) {
        for (to, from) in chosen.iter().enumerate() {
            row.columns[to] = row.columns[*from];
            row.contrast[to] = row.contrast[*from];
            row.sums[to] = row.sums[*from];
        }
        row.truncate(chosen.len());
        let sums = &level.sums()[y * self.stride..];
        for stage in self.stages.iter().skip(stage) {
            if row.columns.is_empty() {
                return;
            }
            row.sums.fill(0.0);
            for weak in &stage.weak {
                self.add_weak(weak, sums, row);
            }
            row.keep(stage.threshold);
        }
    }

    fn add_weak(&self, weak: &Weak, sums: &[u32], row: &mut Row) {
        let windows = row.columns.iter().zip(&row.contrast).zip(&mut row.sums);
        match weak {
            Weak::Stump(Stump { parts, threshold, values }) => {
                for ((column, contrast), sum) in windows {
                    let value = haar(parts, &sums[*column as usize..]) * contrast;
                    *sum += if value < *threshold { values[0] } else { values[1] };
                }
            }
            Weak::Pair(pair) => {
                let Pair { parts, thresholds, values } = &**pair;
                for ((column, contrast), sum) in windows {
                    let sums = &sums[*column as usize..];
                    let is_no = |k: usize| haar(&parts[k], sums) * contrast >= thresholds[k];
                    let side = usize::from(is_no(0));
                    *sum += values[2 * side + usize::from(is_no(1 + side))];
                }
            }
            Weak::Tree(tree) => {
                for ((column, contrast), sum) in windows {
                    *sum += self.leaf(tree, &sums[*column as usize..], *contrast);
                }
            }
        }
    }

    /// Where a window ends up in a tree.
    fn leaf(&self, tree: &Tree, sums: &[u32], contrast: f32) -> f32 {
        let mut at = 0;
        loop {
            let node = &tree[at];
            let yes = match (&self.looks[node.feature], node.split) {
                (Look::Haar(parts), Split::Below(threshold)) => {
                    haar(parts, sums) * contrast < threshold
                }
                (Look::Binary(corners), Split::Among(bits)) => {
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

impl Row {
    fn truncate(&mut self, count: usize) {
        self.columns.truncate(count);
        self.contrast.truncate(count);
        self.sums.truncate(count);
    }

    /// Drops the windows whose sums are below the threshold.
    fn keep(&mut self, threshold: f32) {
        let mut kept = 0;
        for i in 0..self.columns.len() {
            self.columns[kept] = self.columns[i];
            self.contrast[kept] = self.contrast[i];
            self.sums[kept] = self.sums[i];
            kept += usize::from(self.sums[i] >= threshold);
        }
        self.truncate(kept);
    }
}

fn corners(part: &Part, stride: usize) -> Corners {
    let at = |x: usize, y: usize| y * stride + x;
    let (right, bottom) = (part.x + part.width, part.y + part.height);
    [at(part.x, part.y), at(right, part.y), at(part.x, bottom), at(right, bottom)]
}

pub(crate) fn rectangles(parts: &[(Part, f32)], stride: usize) -> [(Corners, f32); 3] {
    let mut out = [([0; 4], 0.0); 3];
    for (out, (part, weight)) in out.iter_mut().zip(parts) {
        *out = (corners(part, stride), *weight);
    }
    out
}

fn sum(sums: &[u32], [a, b, c, d]: &Corners) -> u32 {
    sums[*a].wrapping_sub(sums[*b]).wrapping_sub(sums[*c]).wrapping_add(sums[*d])
}

pub(crate) fn haar(parts: &[(Corners, f32); 3], sums: &[u32]) -> f32 {
    let [first, second, third] = parts;
    let of = |(corners, weight): &(Corners, f32)| weight * sum(sums, corners) as i32 as f32;
    let two = of(first) + of(second);
    if third.1 == 0.0 { two } else { two + of(third) }
}

/// Neighbours clockwise from the upper left, and the middle, as the upper left
/// corners of blocks among 4x4 corners.
const AROUND: [usize; 8] = [0, 1, 2, 6, 10, 9, 8, 4];
const MIDDLE: usize = 5;

fn pattern(corners: &[usize; 16], sums: &[u32]) -> usize {
    let block = |k: usize| sum(sums, &[corners[k], corners[k + 1], corners[k + 4], corners[k + 5]]);
    let middle = block(MIDDLE);
    AROUND.iter().fold(0, |bits, k| bits << 1 | usize::from(block(*k) >= middle))
}

/// Four rows of sums, one for each corner, as many columns as are needed.
fn rows<'a>(sums: &'a [u32], corners: &Corners, columns: usize) -> [&'a [u32]; 4] {
    corners.map(|corner| &sums[corner..corner + columns])
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_part(sums: &[u32], corners: &Corners, weight: f32, step: usize, values: &mut [f32]) {
    let Some(last) = values.len().checked_sub(1) else { return };
    let [a, b, c, d] = rows(sums, corners, last * step + 1);
    let mut add = |i: usize, x: usize| {
        let sum = a[x].wrapping_sub(b[x]).wrapping_sub(c[x]).wrapping_add(d[x]);
        values[i] += weight * sum as i32 as f32;
    };
    match step {
        1 => (0..=last).for_each(|i| add(i, i)),
        2 => (0..=last).for_each(|i| add(i, 2 * i)),
        _ => (0..=last).for_each(|i| add(i, step * i)),
    }
}

/// The values of a feature for a row of windows, before their contrast.
fn fill(
    values: &mut Vec<f32>,
    parts: &[(Corners, f32); 3],
    sums: &[u32],
    step: usize,
    count: usize,
) {
    values.clear();
    values.resize(count, 0.0);
    for (corners, weight) in parts.iter().filter(|(_, weight)| *weight != 0.0) {
        add_part(sums, corners, *weight, step, values);
    }
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn decide_pair(values: &[Vec<f32>; 3], contrast: &[f32], pair: &Pair, sums: &mut [f32]) {
    let Pair { thresholds: [first, yes, no], values: leaves, .. } = pair;
    let [a, b, c] = values;
    let windows = a.iter().zip(b).zip(c).zip(contrast).zip(sums);
    for ((((a, b), c), contrast), sum) in windows {
        let if_yes = if b * contrast < *yes { leaves[0] } else { leaves[1] };
        let if_no = if c * contrast < *no { leaves[2] } else { leaves[3] };
        *sum += if a * contrast < *first { if_yes } else { if_no };
    }
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn decide(values: &[f32], contrast: &[f32], stump: &Stump, sums: &mut [f32]) {
    for ((value, contrast), sum) in values.iter().zip(contrast).zip(sums) {
        let is_below = value * contrast < stump.threshold;
        *sum += if is_below { stump.values[0] } else { stump.values[1] };
    }
}

/// One through the area times the standard deviation of the windows; 0 for empty
/// ones.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn contrasts(
    sums: &[u32],
    squares: &[u32],
    corners: &Corners,
    area: f64,
    step: usize,
    out: &mut [f32],
) {
    let Some(last) = out.len().checked_sub(1) else { return };
    let [a, b, c, d] = rows(sums, corners, last * step + 1);
    let [e, f, g, h] = rows(squares, corners, last * step + 1);
    let difference = |a: u32, b: u32, c: u32, d: u32| {
        f64::from(a.wrapping_sub(b).wrapping_sub(c).wrapping_add(d))
    };
    for (i, out) in out.iter_mut().enumerate() {
        let x = i * step;
        let sum = difference(a[x], b[x], c[x], d[x]);
        let square = difference(e[x], f[x], g[x], h[x]);
        let root = (area * square - sum * sum).max(0.0).sqrt();
        let is_empty = root <= LEAST_CONTRAST * area;
        *out = if is_empty { 0.0 } else { (1.0 / root) as f32 };
    }
}
