//! Exact assignment of rows to columns: truths to reports in the metrics, tracks to detections in
//! the tracker.
//!
//! Frames are sparse: most pairs do not touch at all. The matcher therefore
//! takes only the pairs that do, splits them into groups that cannot influence
//! each other, answers the trivial groups at sight and solves the others by
//! shortest augmenting paths (Jonker and Volgenant, Computing 38, 1987), which
//! costs O(rows² · columns) per group.

/// Pair that may be matched, and its weight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Edge {
    /// Index of the row (truth, track).
    pub row: u32,
    /// Index of the column (report, detection).
    pub col: u32,
    /// Worth of the match; pairs at or below zero are never matched.
    pub weight: f64,
}

const NONE: u32 = u32::MAX;

/// Finds the matching of greatest total weight; keeps its memory between calls.
#[derive(Debug, Default)]
pub struct Matcher {
    parent: Vec<u32>,
    order: Vec<u32>,
    local: Vec<u32>,
    rows: Vec<u32>,
    cols: Vec<u32>,
    cost: Vec<f64>,
    solver: Solver,
}

impl Matcher {
    /// A matcher without any memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The matching of greatest total weight among `rows` rows and `cols`
    /// columns: indices into `edges`, in the order of the rows. Each row and
    /// column is used at most once; several edges for one pair are not allowed.
    /// Among equally good matchings the choice depends only on the order of the
    /// edges.
    pub fn best(&mut self, rows: usize, cols: usize, edges: &[Edge], matched: &mut Vec<u32>) {
        matched.clear();
        self.group(rows, cols, edges);
        let order = std::mem::take(&mut self.order);
        let mut rest = &order[..];
        while let Some(&first) = rest.first() {
            let root = self.parent[edges[first as usize].row as usize];
            let same = |&e: &u32| self.parent[edges[e as usize].row as usize] == root;
            let (group, others) = rest.split_at(rest.iter().take_while(|e| same(e)).count());
            self.solve_group(rows, edges, group, matched);
            rest = others;
        }
        self.order = order;
        matched.sort_unstable_by_key(|&e| edges[e as usize].row);
    }

    /// Fills `order` with the useful edges, those of one group side by side,
    /// and `parent` with the group of each node.
    fn group(&mut self, rows: usize, cols: usize, edges: &[Edge]) {
        self.parent.clear();
        self.parent.extend(0..(rows + cols) as u32);
        self.local.clear();
        self.local.resize(rows + cols, NONE);
        self.order.clear();
        for (e, edge) in edges.iter().enumerate().filter(|(_, edge)| edge.weight > 0.0) {
            self.order.push(e as u32);
            let (a, b) = (self.root(edge.row), self.root(edge.col + rows as u32));
            // The smaller root wins, which keeps the result independent of the order of edges.
            self.parent[a.max(b) as usize] = a.min(b);
        }
        for node in 0..(rows + cols) as u32 {
            self.parent[node as usize] = self.root(node);
        }
        let parent = &self.parent;
        self.order.sort_by_key(|&e| parent[edges[e as usize].row as usize]);
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            let above = self.parent[self.parent[node as usize] as usize];
            // Path halving keeps the trees flat.
            self.parent[node as usize] = above;
            node = above;
        }
        node
    }

    fn solve_group(&mut self, rows: usize, edges: &[Edge], group: &[u32], matched: &mut Vec<u32>) {
        self.number(rows, edges, group);
        if self.rows.len() == 1 || self.cols.len() == 1 {
            matched.extend(heaviest(edges, group));
            return;
        }
        let flipped = self.rows.len() > self.cols.len();
        let wide = self.rows.len().max(self.cols.len());
        let place = |edge: &Edge, local: &[u32]| {
            let (r, c) = (local[edge.row as usize], local[edge.col as usize + rows]);
            if flipped { (c as usize, r as usize) } else { (r as usize, c as usize) }
        };
        self.cost.clear();
        self.cost.resize(self.rows.len() * self.cols.len(), 0.0);
        for edge in group.iter().map(|&e| &edges[e as usize]) {
            let (r, c) = place(edge, &self.local);
            self.cost[r * wide + c] = -edge.weight;
        }
        self.solver.solve(self.rows.len().min(self.cols.len()), wide, &self.cost);
        matched.extend(group.iter().filter(|&&e| {
            let (r, c) = place(&edges[e as usize], &self.local);
            self.solver.row_of[c] == r as u32
        }));
    }

    /// Numbers the rows and columns of a group from zero, in order of appearance.
    fn number(&mut self, rows: usize, edges: &[Edge], group: &[u32]) {
        self.rows.clear();
        self.cols.clear();
        for edge in group.iter().map(|&e| &edges[e as usize]) {
            number(&mut self.local[edge.row as usize], edge.row, &mut self.rows);
            number(&mut self.local[edge.col as usize + rows], edge.col, &mut self.cols);
        }
    }
}

fn number(local: &mut u32, node: u32, list: &mut Vec<u32>) {
    if *local == NONE {
        *local = list.len() as u32;
        list.push(node);
    }
}

/// The heaviest edge of a group, the first of several.
fn heaviest(edges: &[Edge], group: &[u32]) -> Option<u32> {
    let better = |a: u32, b: u32| {
        if edges[b as usize].weight > edges[a as usize].weight { b } else { a }
    };
    group.iter().copied().reduce(better)
}

/// Dense assignment of every row to a column of its own at least total cost: the columns that are
/// cheapest first, then shortest augmenting paths for the rows that are left.
#[derive(Debug, Default)]
struct Solver {
    row_price: Vec<f64>,
    col_price: Vec<f64>,
    /// Row of each column, or `NONE`.
    row_of: Vec<u32>,
    /// Column before each one on the path to it, or `NONE`.
    previous: Vec<u32>,
    /// Cost of the path to each column; NaN once it is final, which is less than nothing.
    distance: Vec<f64>,
    /// Columns whose distance is final.
    settled: Vec<(u32, f64)>,
    open: Vec<u32>,
}

impl Solver {
    /// `rows <= cols`; `cost` is row by row. The answer is in `row_of`.
    fn solve(&mut self, rows: usize, cols: usize, cost: &[f64]) {
        reset(&mut self.row_price, rows, 0.0);
        reset(&mut self.col_price, cols, 0.0);
        reset(&mut self.row_of, cols, NONE);
        reset(&mut self.previous, cols, NONE);
        self.take_cheapest(cols, cost);
        self.reduce(cols, cost);
        for row in std::mem::take(&mut self.open) {
            self.augment(row, &cost[..], cols);
        }
    }

    /// Gives each row its cheapest column while that is free; the others stay open.
    fn take_cheapest(&mut self, cols: usize, cost: &[f64]) {
        self.open.clear();
        for (row, costs) in cost.chunks(cols).enumerate() {
            let least = least(costs);
            let col = place_of(costs, least);
            self.row_price[row] = least;
            match self.row_of[col] {
                NONE => self.row_of[col] = row as u32,
                _ => self.open.push(row as u32),
            }
        }
    }

    /// Lets open rows outbid the holders of their cheapest columns (augmenting row reduction of
    /// Jonker and Volgenant). A column that has a row keeps one, so that free ones cost nothing.
    fn reduce(&mut self, cols: usize, cost: &[f64]) {
        let mut left = Vec::new();
        // A row that is outbid again and again is cheaper to place by a path.
        let mut bids = 2 * self.row_price.len();
        while let Some(row) = self.open.pop() {
            if bids == 0 {
                left.push(row);
                continue;
            }
            bids -= 1;
            let costs = &cost[row as usize * cols..][..cols];
            let (col, first, second) = self.two_cheapest(costs);
            let holder = self.row_of[col];
            if holder != NONE && first >= second {
                left.push(row);
                continue;
            }
            // A column without rivals needs no price.
            if holder != NONE {
                self.col_price[col] -= second - first;
                self.open.push(holder);
            }
            self.row_price[row as usize] = costs[col] - self.col_price[col];
            self.row_of[col] = row;
        }
        left.reverse();
        self.open = left;
    }

    /// Returns the cheapest column at the prices, with its cost and that of the next.
    fn two_cheapest(&self, costs: &[f64]) -> (usize, f64, f64) {
        let mut found = (0, f64::INFINITY, f64::INFINITY);
        for (col, (cost, price)) in costs.iter().zip(&self.col_price).enumerate() {
            let cost = cost - price;
            if cost < found.1 {
                found = (col, cost, found.1);
            } else if cost < found.2 {
                found.2 = cost;
            }
        }
        found
    }

    /// Gives `start` a column along the shortest path (Dijkstra on reduced costs).
    fn augment(&mut self, start: u32, cost: &[f64], cols: usize) {
        reset(&mut self.distance, cols, f64::INFINITY);
        self.settled.clear();
        let (mut row, mut via, mut shift) = (start, NONE, 0.0);
        let (end, reached) = loop {
            self.relax(&cost[row as usize * cols..][..cols], shift, via);
            let reached = least(&self.distance);
            let col = place_of(&self.distance, reached);
            if self.row_of[col] == NONE {
                break (col as u32, reached);
            }
            self.settled.push((col as u32, reached));
            self.distance[col] = f64::NAN;
            (row, via) = (self.row_of[col], col as u32);
            shift = reached - self.row_price[row as usize];
        };
        self.adjust(start, reached);
        self.flip(start, end);
    }

    /// Shortens the distances by the columns that are reached over the column `via`.
    fn relax(&mut self, costs: &[f64], shift: f64, via: u32) {
        let columns = self.distance.iter_mut().zip(&mut self.previous);
        for ((distance, previous), (cost, price)) in columns.zip(costs.iter().zip(&self.col_price))
        {
            let through = cost - price + shift;
            let is_shorter = through < *distance;
            *distance = if is_shorter { through } else { *distance };
            *previous = if is_shorter { via } else { *previous };
        }
    }

    fn adjust(&mut self, start: u32, reached: f64) {
        // Without this step some reduced costs become negative, for which Dijkstra is not valid.
        self.row_price[start as usize] = reached;
        for (col, distance) in &self.settled {
            let slack = reached - distance;
            self.col_price[*col as usize] -= slack;
            self.row_price[self.row_of[*col as usize] as usize] += slack;
        }
    }

    fn flip(&mut self, start: u32, end: u32) {
        let mut col = end as usize;
        while self.previous[col] != NONE {
            let before = self.previous[col] as usize;
            self.row_of[col] = self.row_of[before];
            col = before;
        }
        self.row_of[col] = start;
    }
}

/// Returns the least value; NaN counts as none.
fn least(values: &[f64]) -> f64 {
    // Several minima at once, because a single one is a chain of dependent comparisons.
    let smaller = |a: f64, b: f64| if b < a { b } else { a };
    let chunks = values.chunks_exact(8);
    let rest = chunks.remainder().iter().fold(f64::INFINITY, |a, b| smaller(a, *b));
    let mut lanes = [f64::INFINITY; 8];
    for chunk in chunks {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane = smaller(*lane, *value);
        }
    }
    lanes.into_iter().fold(rest, smaller)
}

/// Returns the first place of a value.
fn place_of(values: &[f64], value: f64) -> usize {
    values.iter().position(|other| *other == value).unwrap_or_default()
}

fn reset<T: Clone>(list: &mut Vec<T>, len: usize, value: T) {
    list.clear();
    list.resize(len, value);
}

#[cfg(test)]
mod tests;
