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

#[derive(Clone, Debug)]
enum Weak {
    /// One question about rectangles, the usual case.
    Stump(Stump),
    Tree(Tree),
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
    /// Scratch: values of a feature.
    values: Vec<f32>,
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
        let weak = |tree: &Tree| match (&tree[..], looks.get(tree[0].feature)) {
            (
                [Node { split: Split::Below(t), next: [Next::Leaf(a), Next::Leaf(b)], .. }],
                Some(Look::Haar(parts)),
            ) => Weak::Stump(Stump { parts: *parts, threshold: *t, values: [*a, *b] }),
            _ => Weak::Tree(tree.clone()),
        };
        let stages = cascade.stages.iter().map(|stage| Stage {
            threshold: stage.threshold,
            weak: stage.trees.iter().map(weak).collect(),
        });
        let middle = cascade.middle();
        Self {
            stride,
            stages: stages.collect(),
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
                    row.values.clear();
                    row.values.resize(count, 0.0);
                    let used = stump.parts.iter().filter(|(_, weight)| *weight != 0.0);
                    for (corners, weight) in used {
                        add_part(sums, corners, *weight, step, &mut row.values);
                    }
                    decide(&row.values, &row.contrast, stump, &mut row.sums);
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
        let is_stump = |weak: &Weak| matches!(weak, Weak::Stump(_));
        self.stages.get(stage).is_some_and(|s| s.weak.iter().all(is_stump)) && 6 * alive > count
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
