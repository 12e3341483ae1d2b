//! Parts of an island that are needed, because windows seldom fill the rectangle around them.

use std::ops::Range;

use crate::hog::CELL;

/// Needed columns of cells in each row of cells, of 8 pixels, of a resampled part of an image. The
/// part has one pixel more on each side, for gradients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans(Vec<Range<usize>>);

impl Spans {
    /// Returns spans of all cells in `width` by `height` pixels.
    pub fn whole(width: usize, height: usize) -> Self {
        let [across, down] = [width, height].map(|length| length.saturating_sub(2) / CELL);
        Self(vec![0..across; down])
    }

    /// Computes the spans of rectangles of `wide` by `tall` cells that begin at `places`, in `rows`
    /// rows.
    pub(crate) fn fill(
        &mut self,
        places: impl Iterator<Item = (usize, usize)>,
        (wide, tall): (usize, usize),
        rows: usize,
    ) {
        self.0.clear();
        self.0.resize(rows, 0..0);
        for (x, y) in places {
            for span in &mut self.0[y..y + tall] {
                *span = union(span, &(x..x + wide));
            }
        }
    }

    /// Returns the columns of cells in each row of cells.
    pub(crate) fn cells(&self) -> &[Range<usize>] {
        &self.0
    }

    /// Returns the columns of cells in a row of cells, none outside.
    fn cells_in_row(&self, index: usize) -> Range<usize> {
        self.0.get(index).cloned().unwrap_or_default()
    }

    /// Returns the columns of pixels in the `index`th 8 rows of pixels: those of the cells there
    /// and in the row above, and one more on each side.
    pub(crate) fn pixels(&self, index: usize) -> Range<usize> {
        let above = index.checked_sub(1).map_or(0..0, |above| self.cells_in_row(above));
        let cells = union(&above, &self.cells_in_row(index));
        if cells.is_empty() { 0..0 } else { cells.start * CELL..cells.end * CELL + 2 }
    }
}

/// Returns the smallest span that contains both.
fn union(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b.clone(),
        (_, true) => a.clone(),
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}
