//! Removal of small patches of disparities that do not fit their surroundings.

/// Finds patches from runs: a run is a part of a row without a jump, and runs of adjacent rows that
/// touch without a jump belong to the same patch.
#[derive(Debug, Default)]
pub struct SpeckleFilter {
    /// First and one past last column of each run, row by row.
    runs: Vec<(u32, u32)>,
    /// Parent of each run; a root is its own parent.
    joined: Vec<u32>,
    /// Number of pixels of the patch, at its root.
    pixels: Vec<u32>,
    /// First run of each row, and one past the last.
    rows: Vec<usize>,
}

impl SpeckleFilter {
    /// Sets patches of fewer than `min_pixels` pixels to NaN, and returns the number of such
    /// pixels. Pixels side by side or above each other are of one patch if their values differ by
    /// at most `step`.
    pub fn apply(&mut self, image: &mut [f32], width: usize, min_pixels: usize, step: f32) -> u64 {
        self.runs.clear();
        self.joined.clear();
        self.rows.clear();
        self.rows.push(0);
        for y in 0..image.len() / width.max(1) {
            self.add_row(image, width, y, step);
        }
        self.count();
        self.erase(image, width, min_pixels)
    }

    fn add_row(&mut self, image: &[f32], width: usize, y: usize, step: f32) {
        let row = &image[y * width..(y + 1) * width];
        let mut x = 0;
        while x < width {
            let from = x;
            x += 1;
            if row[from].is_nan() {
                continue;
            }
            while x < width && (row[x] - row[x - 1]).abs() <= step {
                x += 1;
            }
            self.joined.push(self.runs.len() as u32);
            self.runs.push((from as u32, x as u32));
        }
        self.rows.push(self.runs.len());
        if y > 0 {
            let above = &image[(y - 1) * width..y * width];
            self.join_rows(above, row, y, step);
        }
    }

    /// Joins the runs of row `y` with those of the row above.
    fn join_rows(&mut self, above: &[f32], row: &[f32], y: usize, step: f32) {
        let mut upper = self.rows[y - 1];
        let mut lower = self.rows[y];
        while upper < self.rows[y] && lower < self.rows[y + 1] {
            let a = self.runs[upper];
            let b = self.runs[lower];
            let shared = a.0.max(b.0) as usize..a.1.min(b.1) as usize;
            if shared.start < shared.end {
                let pairs = above[shared.clone()].iter().zip(&row[shared]);
                if pairs.into_iter().any(|(a, b)| (a - b).abs() <= step) {
                    self.join(upper, lower);
                }
            }
            if a.1 <= b.1 {
                upper += 1;
            } else {
                lower += 1;
            }
        }
    }

    fn root(&mut self, mut run: usize) -> usize {
        while self.joined[run] as usize != run {
            // Halving the path keeps later searches short.
            self.joined[run] = self.joined[self.joined[run] as usize];
            run = self.joined[run] as usize;
        }
        run
    }

    fn join(&mut self, a: usize, b: usize) {
        let a = self.root(a);
        let b = self.root(b);
        self.joined[a.max(b)] = a.min(b) as u32;
    }

    fn count(&mut self) {
        self.pixels.clear();
        self.pixels.resize(self.runs.len(), 0);
        for run in 0..self.runs.len() {
            let root = self.root(run);
            self.pixels[root] += self.runs[run].1 - self.runs[run].0;
        }
    }

    fn erase(&mut self, image: &mut [f32], width: usize, min_pixels: usize) -> u64 {
        let mut erased = 0;
        for y in 0..self.rows.len() - 1 {
            for run in self.rows[y]..self.rows[y + 1] {
                let root = self.root(run);
                if (self.pixels[root] as usize) < min_pixels {
                    let (from, to) = self.runs[run];
                    image[y * width + from as usize..y * width + to as usize].fill(f32::NAN);
                    erased += u64::from(to - from);
                }
            }
        }
        erased
    }
}
