use nalgebra::Point2;
use tagalong_core::{DepthImage, GreyImage};
use tagalong_geometry::Rect;

use crate::Picture;
use crate::picture::{Distance, SIDE, Shows, brightness, nearest};

/// Less contrast than this, grey values, is noise.
const LEAST_CONTRAST: f32 = 2.0;

/// The part of an image in which a picture is looked for, in cells of its size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strip {
    columns: usize,
    rows: usize,
    /// Brightness, row by row.
    grey: Vec<f32>,
    /// 1 in the image and not behind something nearer, otherwise 0.
    shown: Vec<f32>,
    /// 1 where there is depth, otherwise 0.
    known: Vec<f32>,
}

/// Goodness of fit of a picture at one place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fit {
    /// Normalised cross-correlation, -1 to 1, over the visible part of the body; 0 where the
    /// picture or the image has no contrast.
    pub correlation: f64,
    /// The part of the body that is not behind something nearer, 0 to 1.
    pub shown: f64,
    /// The part of it that has depth, 0 to 1.
    pub known: f64,
}

/// Where the cells of a strip are in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    /// The upper left corner, pixels.
    pub(crate) corner: Point2<f64>,
    /// From cell to cell, pixels.
    pub(crate) step: f64,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

impl Lattice {
    /// Cells of the size of those of a picture in `square`, and so many more on each side.
    pub(crate) fn around(square: &Rect, aside: i64, down: i64) -> Self {
        fn more(cells: i64) -> usize {
            SIDE + 2 * cells as usize
        }

        let step = square.width / SIDE as f64;
        let corner = [square.x - step * aside as f64, square.y - step * down as f64].into();
        Self { corner, step, columns: more(aside), rows: more(down) }
    }

    /// The middles of the cells, row by row.
    pub(crate) fn middles(self) -> impl Iterator<Item = Point2<f64>> {
        let Self { corner, step, columns, rows } = self;
        (0..columns * rows).map(move |cell| {
            let column = (cell % columns) as f64 + 0.5;
            let row = (cell / columns) as f64 + 0.5;
            Point2::new(corner.x + step * column, corner.y + step * row)
        })
    }
}

/// Sums over cells, one of each a column.
type Lanes = [f32; SIDE];

/// Returns the values of a row of cells from a place on.
#[inline]
fn lanes_from(values: &[f32], from: usize) -> Lanes {
    std::array::from_fn(|i| values[from..from + SIDE][i])
}

impl Strip {
    /// Reads an image and its depth; memory is used again.
    pub(crate) fn read(
        &mut self,
        grey: &GreyImage,
        depth: &DepthImage,
        lattice: &Lattice,
        distance: &Distance,
    ) {
        let Lattice { columns, rows, .. } = *lattice;
        (self.columns, self.rows) = (columns, rows);
        for values in [&mut self.grey, &mut self.shown, &mut self.known] {
            values.clear();
            values.reserve(columns * rows);
        }
        for at in lattice.middles() {
            let value = brightness(grey, at);
            let shows = nearest(depth, at).map_or(Shows::Nothing, |m| distance.shows(m));
            self.grey.push(value.unwrap_or_default());
            self.shown.push(f32::from(value.is_some() && shows != Shows::Nearer));
            self.known.push(f32::from(shows != Shows::Nothing));
        }
    }

    #[cfg(test)]
    pub(crate) fn cells(&self) -> [&[f32]; 3] {
        [&self.grey, &self.shown, &self.known]
    }

    /// Columns and rows in which a picture can be laid.
    pub fn places(&self) -> (usize, usize) {
        ((self.columns + 1).saturating_sub(SIDE), (self.rows + 1).saturating_sub(SIDE))
    }

    /// Computes the fit of a picture with its upper left corner at a cell.
    ///
    /// # Panics Outside of [`Strip::places`].
    pub fn fit(&self, picture: &Picture, column: usize, row: usize) -> Fit {
        let [mut n, mut known, mut a, mut b, mut aa, mut bb, mut ab] = [[0.0; SIDE]; 7];
        for (line, own) in picture.grey.as_chunks::<SIDE>().0.iter().enumerate() {
            let body: &Lanes = &picture.body.as_chunks::<SIDE>().0[line];
            let from = (row + line) * self.columns + column;
            let seen = lanes_from(&self.grey, from);
            let shown = lanes_from(&self.shown, from);
            let has = lanes_from(&self.known, from);
            for i in 0..SIDE {
                let counts = body[i] * shown[i];
                n[i] += counts;
                known[i] += counts * has[i];
                a[i] += counts * own[i];
                b[i] += counts * seen[i];
                aa[i] += counts * own[i] * own[i];
                bb[i] += counts * seen[i] * seen[i];
                ab[i] += counts * own[i] * seen[i];
            }
        }
        let [n, known, a, b, aa, bb, ab] =
            [n, known, a, b, aa, bb, ab].map(|lanes| lanes.iter().sum::<f32>());
        let least = n * LEAST_CONTRAST * LEAST_CONTRAST;
        let own = aa - a * a / n;
        let seen = bb - b * b / n;
        let both = ab - a * b / n;
        let has_contrast = n > 0.0 && own > least && seen > least;
        Fit {
            correlation: if has_contrast { f64::from(both / (own * seen).sqrt()) } else { 0.0 },
            shown: f64::from(n / picture.count),
            known: f64::from(known / picture.count),
        }
    }
}
