//! Exact assignment: which truth goes with which report.
//!
//! Frames are sparse: most pairs do not touch at all. The matcher therefore
//! takes only the pairs that do, splits them into groups that cannot influence
//! each other, answers the trivial groups at sight and solves the others by
//! shortest augmenting paths (Jonker and Volgenant, Computing 38, 1987), which
//! costs O(rows² · columns) per group.

/// Pair that may be matched, and its weight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Edge {
    /// Index of the row (truth).
    pub row: u32,
    /// Index of the column (report).
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
            self.solver.row_of[c + 1] == r + 1
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

/// Dense assignment of every row to a column of its own at least total cost.
#[derive(Debug, Default)]
struct Solver {
    row_price: Vec<f64>,
    col_price: Vec<f64>,
    /// 1-based row of each 1-based column, 0 = free; entry 0 is the row to place.
    row_of: Vec<usize>,
    previous: Vec<usize>,
    slack: Vec<f64>,
    done: Vec<bool>,
}

impl Solver {
    /// `rows <= cols`; `cost` is row by row. The answer is in `row_of`.
    fn solve(&mut self, rows: usize, cols: usize, cost: &[f64]) {
        reset(&mut self.row_price, rows + 1, 0.0);
        reset(&mut self.col_price, cols + 1, 0.0);
        reset(&mut self.row_of, cols + 1, 0);
        reset(&mut self.previous, cols + 1, 0);
        for row in 1..=rows {
            self.place(row, cols, cost);
        }
    }

    fn place(&mut self, row: usize, cols: usize, cost: &[f64]) {
        reset(&mut self.slack, cols + 1, f64::INFINITY);
        reset(&mut self.done, cols + 1, false);
        self.row_of[0] = row;
        let mut col = 0;
        while self.row_of[col] != 0 {
            self.done[col] = true;
            let (next, step) = self.nearest(col, cols, cost);
            self.raise(step);
            col = next;
        }
        while col != 0 {
            let before = self.previous[col];
            self.row_of[col] = self.row_of[before];
            col = before;
        }
    }

    /// Relaxes from the row at `col`; the nearest open column and its distance.
    fn nearest(&mut self, col: usize, cols: usize, cost: &[f64]) -> (usize, f64) {
        let row = self.row_of[col];
        let costs = &cost[(row - 1) * cols..row * cols];
        let price = self.row_price[row];
        let mut best = (0, f64::INFINITY);
        for c in (1..=cols).filter(|&c| !self.done[c]) {
            let reduced = costs[c - 1] - price - self.col_price[c];
            if reduced < self.slack[c] {
                self.slack[c] = reduced;
                self.previous[c] = col;
            }
            if self.slack[c] < best.1 {
                best = (c, self.slack[c]);
            }
        }
        best
    }

    fn raise(&mut self, step: f64) {
        for c in 0..self.done.len() {
            if self.done[c] {
                self.row_price[self.row_of[c]] += step;
                self.col_price[c] -= step;
            } else {
                self.slack[c] -= step;
            }
        }
    }
}

fn reset<T: Clone>(list: &mut Vec<T>, len: usize, value: T) {
    list.clear();
    list.resize(len, value);
}
