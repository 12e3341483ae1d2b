//! Exact assignment of rows to columns: ground truth to reported people in the metrics, tracks to
//! detections in the tracker.
//!
//! Frames are sparse: most pairs do not overlap at all. The matcher therefore takes only the pairs
//! that do, splits them into independent groups, solves the trivial groups directly and the others
//! by shortest augmenting paths (Jonker and Volgenant, Computing 38, 1987), which costs O(rows² ·
//! columns) per group.

/// Pair that may be matched, and its weight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Edge {
    /// Index of the row (truth, track).
    pub row: u32,
    /// Index of the column (report, detection).
    pub col: u32,
    /// Benefit of the match; pairs at or below zero are never matched.
    pub weight: f64,
}

const NONE: u32 = u32::MAX;

/// Number of pairs up to which solving the whole matrix is faster than finding its groups.
const FEW_PAIRS: usize = 600;

/// Finds the matching of greatest total weight; reuses its buffers between calls.
#[derive(Debug, Default)]
pub struct Matcher {
    parent: Vec<u32>,
    order: Vec<u32>,
    local: Vec<u32>,
    rows: Vec<u32>,
    cols: Vec<u32>,
    cost: Vec<f64>,
    edges: Vec<Edge>,
    solver: Solver,
}

impl Matcher {
    /// Creates a matcher with empty buffers.
    pub fn new() -> Self {
        Self::default()
    }

    /// Fills `matched` with the matching of greatest total weight between `rows` rows and `cols`
    /// columns: indices into `edges`, in the order of the rows. Each row and column is used at most
    /// once; there must not be several edges for one pair. Which of several equally good matchings
    /// is returned depends only on the order of the edges.
    pub fn best(&mut self, rows: usize, cols: usize, edges: &[Edge], matched: &mut Vec<u32>) {
        matched.clear();
        self.group(rows, cols, edges);
        let order = std::mem::take(&mut self.order);
        let mut rest = &order[..];
        while let Some(&first) = rest.first() {
            let root = group_of(&self.parent, edges, first);
            let same = rest.iter().take_while(|&&e| group_of(&self.parent, edges, e) == root);
            let (group, others) = rest.split_at(same.count());
            self.solve_group(rows, edges, group, matched);
            rest = others;
        }
        self.order = order;
        matched.sort_unstable_by_key(|&e| edges[e as usize].row);
    }

    /// Does the same for a matrix of weights, row by row: fills in the column of each row. Pairs at
    /// or below zero are never matched; otherwise see [`Matcher::best`].
    ///
    /// ```
    /// use tagalong_math::matching::Matcher;
    /// let weights = [3.0, 2.0, 2.5, 0.0];
    /// assert_eq!(Matcher::new().best_of_matrix(2, 2, &weights), [Some(1), Some(0)]);
    /// ```
    pub fn best_of_matrix(
        &mut self,
        rows: usize,
        cols: usize,
        weights: &[f64],
    ) -> Vec<Option<usize>> {
        let useful = weights.iter().filter(|weight| **weight > 0.0).count();
        let mut col_of = vec![None; rows];
        if weights.len() > FEW_PAIRS && 2 * useful < weights.len() {
            self.match_groups(rows, cols, weights, &mut col_of);
        } else if useful > 0 {
            self.match_all(rows, cols, weights, &mut col_of);
        }
        col_of
    }

    /// Solves a sparse matrix group by group.
    fn match_groups(
        &mut self,
        rows: usize,
        cols: usize,
        weights: &[f64],
        col_of: &mut [Option<usize>],
    ) {
        let mut edges = std::mem::take(&mut self.edges);
        edges.clear();
        for (row, weights) in (0..).zip(weights.chunks(cols)) {
            for (col, weight) in (0..).zip(weights).filter(|(_, weight)| **weight > 0.0) {
                edges.push(Edge { row, col, weight: *weight });
            }
        }
        let mut matched = Vec::new();
        self.best(rows, cols, &edges, &mut matched);
        for edge in matched.into_iter().map(|e| edges[e as usize]) {
            col_of[edge.row as usize] = Some(edge.col as usize);
        }
        self.edges = edges;
    }

    /// Solves a matrix as a whole, without looking for groups.
    fn match_all(
        &mut self,
        rows: usize,
        cols: usize,
        weights: &[f64],
        col_of: &mut [Option<usize>],
    ) {
        let flipped = rows > cols;
        self.cost.clear();
        if flipped {
            self.cost.extend(
                (0..cols)
                    .flat_map(|col| weights[col..].iter().step_by(cols))
                    .map(|weight| -weight.max(0.0)),
            );
        } else {
            self.cost.extend(weights.iter().map(|weight| -weight.max(0.0)));
        }
        self.solver.solve(rows.min(cols), rows.max(cols), &self.cost);
        for (wide, narrow) in self.solver.row_of.iter().enumerate().filter(|(_, n)| **n != NONE) {
            let narrow = *narrow as usize;
            let (row, col) = if flipped { (wide, narrow) } else { (narrow, wide) };
            if weights[row * cols + col] > 0.0 {
                col_of[row] = Some(col);
            }
        }
    }

    /// Fills `order` with the useful edges, grouped, and `parent` with the group of each node.
    fn group(&mut self, rows: usize, cols: usize, edges: &[Edge]) {
        reset(&mut self.local, rows + cols, NONE);
        self.order.clear();
        let useful = (0..).zip(edges).filter(|(_, edge)| edge.weight > 0.0);
        self.order.extend(useful.map(|(e, _)| e));
        self.parent.clear();
        // With an edge for every pair there is only one group.
        if self.order.len() == rows * cols {
            self.parent.resize(rows + cols, 0);
            return;
        }
        self.parent.extend(0..(rows + cols) as u32);
        for edge in edges.iter().filter(|edge| edge.weight > 0.0) {
            let row = edge.row;
            let col = edge.col + rows as u32;
            if self.parent[row as usize] == self.parent[col as usize] {
                continue;
            }
            let a = self.root(row);
            let b = self.root(col);
            // The smaller root wins, which keeps the result independent of the order of edges.
            self.parent[a.max(b) as usize] = a.min(b);
        }
        for node in 0..(rows + cols) as u32 {
            self.parent[node as usize] = self.root(node);
        }
        let parent = &self.parent;
        if !self.order.is_sorted_by_key(|&e| group_of(parent, edges, e)) {
            self.order.sort_by_key(|&e| group_of(parent, edges, e));
        }
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
        let wide = self.rows.len().max(self.cols.len());
        self.cost.clear();
        self.cost.resize(self.rows.len() * self.cols.len(), 0.0);
        for edge in group.iter().map(|&e| &edges[e as usize]) {
            let (r, c) = self.place_in_group(edge, rows);
            self.cost[r * wide + c] = -edge.weight;
        }
        self.solver.solve(self.rows.len().min(self.cols.len()), wide, &self.cost);
        matched.extend(group.iter().filter(|&&e| {
            let (r, c) = self.place_in_group(&edges[e as usize], rows);
            self.solver.row_of[c] == r as u32
        }));
    }

    /// Returns the row and the column of an edge in the matrix of its group, transposed if that has
    /// more rows than columns.
    #[inline]
    fn place_in_group(&self, edge: &Edge, rows: usize) -> (usize, usize) {
        let r = self.local[edge.row as usize] as usize;
        let c = self.local[edge.col as usize + rows] as usize;
        if self.rows.len() > self.cols.len() { (c, r) } else { (r, c) }
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

/// Returns the group of an edge, by its representative node.
#[inline]
fn group_of(parent: &[u32], edges: &[Edge], edge: u32) -> u32 {
    parent[edges[edge as usize].row as usize]
}

fn number(local: &mut u32, node: u32, list: &mut Vec<u32>) {
    if *local == NONE {
        *local = list.len() as u32;
        list.push(node);
    }
}

/// Returns the heaviest edge of a group, the first of several.
fn heaviest(edges: &[Edge], group: &[u32]) -> Option<u32> {
    group
        .iter()
        .copied()
        .reduce(|a, b| if edges[b as usize].weight > edges[a as usize].weight { b } else { a })
}

/// Dense assignment of every row to a different column at minimum total cost: rows first take their
/// cheapest columns, then shortest augmenting paths place the remaining rows.
#[derive(Debug, Default)]
struct Solver {
    row_price: Vec<f64>,
    col_price: Vec<f64>,
    /// Row of each column, or `NONE`.
    row_of: Vec<u32>,
    /// Predecessor of each column on the path to it, or `NONE`; of the same width as the distances,
    /// because vector instructions convert slowly between widths.
    previous: Vec<u64>,
    /// Cost of the path to each column; NaN once it is final, because no comparison with NaN is
    /// true.
    distance: Vec<f64>,
    /// Columns whose distance is final.
    settled: Vec<(u32, f64)>,
    open: Vec<u32>,
    left: Vec<u32>,
}

impl Solver {
    /// Solves a matrix with `rows <= cols`; `cost` is row by row. The result is in `row_of`.
    fn solve(&mut self, rows: usize, cols: usize, cost: &[f64]) {
        reset(&mut self.row_price, rows, 0.0);
        reset(&mut self.col_price, cols, 0.0);
        reset(&mut self.row_of, cols, NONE);
        reset(&mut self.previous, cols, u64::from(NONE));
        self.take_cheapest(cols, cost);
        self.reduce(cols, cost);
        let open = std::mem::take(&mut self.open);
        open.iter().for_each(|row| self.augment(*row, cost, cols));
        self.open = open;
    }

    /// Gives each row its cheapest column if that is still free; the other rows stay unassigned.
    fn take_cheapest(&mut self, cols: usize, cost: &[f64]) {
        self.open.clear();
        for (row, costs) in cost.chunks(cols).enumerate() {
            let (col, least) = least(costs);
            self.row_price[row] = least;
            match self.row_of[col] {
                NONE => self.row_of[col] = row as u32,
                _ => self.open.push(row as u32),
            }
        }
    }

    /// Lets unassigned rows outbid the holders of their cheapest columns (augmenting row reduction
    /// of Jonker and Volgenant). A column that has a row keeps one, so that the price of a free
    /// column stays 0.
    fn reduce(&mut self, cols: usize, cost: &[f64]) {
        self.left.clear();
        // A row that is outbid repeatedly is cheaper to place by a path.
        let mut bids = 2 * self.row_price.len();
        while let Some(row) = self.open.pop() {
            if bids == 0 {
                self.left.push(row);
                continue;
            }
            bids -= 1;
            let costs = &cost[row as usize * cols..][..cols];
            let (col, first, second) = two_cheapest(costs, &self.col_price);
            let holder = self.row_of[col];
            if holder != NONE && first >= second {
                self.left.push(row);
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
        self.left.reverse();
        std::mem::swap(&mut self.open, &mut self.left);
    }

    /// Gives `start` a column along the shortest path (Dijkstra on reduced costs).
    fn augment(&mut self, start: u32, cost: &[f64], cols: usize) {
        reset(&mut self.distance, cols, f64::INFINITY);
        self.settled.clear();
        let mut row = start;
        let mut via = NONE;
        let mut shift = 0.0;
        let (end, reached) = loop {
            let Self { distance, previous, col_price, .. } = self;
            let costs = &cost[row as usize * cols..][..cols];
            relax(costs, col_price, shift, u64::from(via), distance, previous);
            let (col, reached) = least(distance);
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
        while self.previous[col] != u64::from(NONE) {
            let before = self.previous[col] as usize;
            self.row_of[col] = self.row_of[before];
            col = before;
        }
        self.row_of[col] = start;
    }
}

/// Number of minima that are computed at once: a single one would be a chain of dependent
/// comparisons.
const LANES: usize = 8;

/// Returns the column that is cheapest at these prices (the first of several), its cost, and the
/// cost of the second cheapest.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn two_cheapest(costs: &[f64], prices: &[f64]) -> (usize, f64, f64) {
    let (chunks, rest) = costs.as_chunks::<LANES>();
    let (prices_of, prices_of_rest) = prices.as_chunks::<LANES>();
    let mut firsts = [f64::INFINITY; LANES];
    let mut seconds = [f64::INFINITY; LANES];
    for (costs, prices) in chunks.iter().zip(prices_of) {
        for lane in 0..LANES {
            add_cost(costs[lane] - prices[lane], &mut firsts[lane], &mut seconds[lane]);
        }
    }
    // The lanes are compared in halves until one is left.
    let mut half = if chunks.is_empty() { 0 } else { LANES / 2 };
    while half > 0 {
        for lane in 0..half {
            let first = firsts[lane + half];
            let second = seconds[lane + half];
            let less = if second < seconds[lane] { second } else { seconds[lane] };
            seconds[lane] = less;
            add_cost(first, &mut firsts[lane], &mut seconds[lane]);
        }
        half /= 2;
    }
    let ([mut first, ..], [mut second, ..]) = (firsts, seconds);
    for (cost, price) in rest.iter().zip(prices_of_rest) {
        add_cost(cost - price, &mut first, &mut second);
    }
    let mut chunk = 0;
    while chunk < chunks.len() && !any(|lane| chunks[chunk][lane] - prices_of[chunk][lane] == first)
    {
        chunk = chunk.wrapping_add(1);
    }
    let from = chunk.wrapping_mul(LANES);
    let mut columns = costs[from..].iter().zip(&prices[from..]);
    let place = columns.position(|(cost, price)| cost - price == first).unwrap_or_default();
    (from.wrapping_add(place), first, second)
}

/// Updates the two lowest costs so far.
#[inline(always)]
fn add_cost(cost: f64, first: &mut f64, second: &mut f64) {
    let more = if cost < *first { *first } else { cost };
    *second = if more < *second { more } else { *second };
    *first = if cost < *first { cost } else { *first };
}

/// Returns true if a test holds in any lane; it has no early exit, so that it becomes vector
/// instructions.
#[inline(always)]
fn any(test: impl Fn(usize) -> bool) -> bool {
    let mut found = 0;
    for lane in 0..LANES {
        found |= u8::from(test(lane));
    }
    found != 0
}

/// Shortens the distances of the columns that are reached through the column `via`.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn relax(
    costs: &[f64],
    prices: &[f64],
    shift: f64,
    via: u64,
    distances: &mut [f64],
    previous: &mut [u64],
) {
    let columns = distances.iter_mut().zip(previous);
    for ((distance, previous), (cost, price)) in columns.zip(costs.iter().zip(prices)) {
        let through = cost - price + shift;
        let is_shorter = through < *distance;
        *distance = if is_shorter { through } else { *distance };
        *previous = if is_shorter { via } else { *previous };
    }
}

/// Returns the least value and its first index; NaN is ignored.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn least(values: &[f64]) -> (usize, f64) {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut lanes = [f64::INFINITY; LANES];
    for chunk in chunks {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane = if *value < *lane { *value } else { *lane };
        }
    }
    let all = lanes.iter().chain(rest);
    let least = all.fold(f64::INFINITY, |least, value| if *value < least { *value } else { least });
    let mut chunk = 0;
    while chunk < chunks.len() && !any(|lane| chunks[chunk][lane] == least) {
        chunk = chunk.wrapping_add(1);
    }
    let from = chunk.wrapping_mul(LANES);
    let place = values[from..].iter().position(|value| *value == least).unwrap_or_default();
    (from.wrapping_add(place), least)
}

fn reset<T: Clone>(list: &mut Vec<T>, len: usize, value: T) {
    list.clear();
    list.resize(len, value);
}

#[cfg(test)]
mod tests;
