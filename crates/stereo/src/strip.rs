//! Matching of a strip of rows, the unit of work of a thread.

use tagalong_core::GreyImage;

use crate::cost::Features;
use crate::paths::{Excess, Penalties};
use crate::winner::{FromRight, RowWinners, Winners};
use crate::{Dropped, Method, StereoSettings, cost, paths, window};

/// Number of rows above a strip from which the paths into it start.
const RUN_UP: usize = 16;

/// Buffers for the rows of a strip.
#[derive(Debug, Default)]
pub struct Strip {
    left: Features,
    right: Features,
    costs: Vec<u8>,
    sums: Vec<u8>,
    winners: Winners,
    from_right: FromRight,
    /// Excess costs of the paths from above left, above and above right.
    excess: [Excess; 3],
    /// Costs of the rows in the window, and their sums over each column.
    ring: Vec<Vec<u8>>,
    columns: Vec<u8>,
    /// Number of dropped pixels, by reason.
    pub dropped: Dropped,
}

/// Inputs that all strips of a pair have in common.
pub struct Pair<'a> {
    pub left: &'a GreyImage,
    pub right: &'a GreyImage,
    pub settings: &'a StereoSettings,
    pub penalties: &'a Penalties,
}

/// Output rows of a strip.
pub struct Output<'a> {
    pub first_row: usize,
    pub disparities: &'a mut [f32],
    pub confidences: &'a mut [u8],
}

impl Strip {
    /// Fills the rows of a strip.
    pub fn fill<const D: usize>(&mut self, pair: &Pair<'_>, output: &mut Output<'_>) {
        let width = pair.left.width();
        self.sums.resize(width * D, 0);
        self.winners.resize(width);
        self.dropped = Dropped::default();
        match pair.settings.method {
            Method::Block => self.block::<D>(pair, output),
            Method::SemiGlobal => self.semi_global::<D>(pair, output),
        }
    }

    fn semi_global<const D: usize>(&mut self, pair: &Pair<'_>, output: &mut Output<'_>) {
        let width = pair.left.width();
        self.costs.resize(width * D, 0);
        self.excess.iter_mut().for_each(|e| e.reset::<D>(width));
        let rows = output.disparities.len() / width;
        for y in output.first_row.saturating_sub(RUN_UP)..output.first_row + rows {
            self.blended_costs::<D>(pair, y);
            let grey = (pair.left.row(y), pair.left.row(y.saturating_sub(1)));
            let costs = self.costs.as_chunks::<D>().0;
            let sums = self.sums.as_chunks_mut::<D>().0;
            paths::sums(costs, grey, pair.penalties, &mut self.excess, sums);
            if y >= output.first_row {
                self.decide::<D>(pair, y - output.first_row, output);
            }
        }
    }

    fn block<const D: usize>(&mut self, pair: &Pair<'_>, output: &mut Output<'_>) {
        let width = pair.left.width();
        let height = pair.left.height();
        let side = pair.settings.window;
        let radius = side / 2;
        // A sum over 9x9 pixels with 24 bits each is at most 1944, and 121 after the shift.
        let shift = u32::from(side > 3) + 2 * u32::from(side > 7) + u32::from(side > 5);
        self.columns.clear();
        self.columns.resize(width * D, 0);
        self.ring.resize_with(side, Vec::new);
        for row in &mut self.ring {
            row.clear();
            row.resize(width * D, 0);
        }
        let rows = output.disparities.len() / width;
        for step in 0..rows + 2 * radius {
            let y = (output.first_row + step).saturating_sub(radius).min(height - 1);
            self.left.census(pair.left, y, pair.settings.noise, None);
            self.right.census(pair.right, y, pair.settings.noise, Some(D));
            let row = self.ring[step % side].as_chunks_mut::<D>().0;
            let columns = self.columns.as_chunks_mut::<D>().0;
            cost::bits(&self.left, &self.right, row, columns);
            if step >= 2 * radius {
                let sums = self.sums.as_chunks_mut::<D>().0;
                window::slide_along(columns, radius, shift, sums);
                self.decide::<D>(pair, step - 2 * radius, output);
            }
        }
    }

    fn blended_costs<const D: usize>(&mut self, pair: &Pair<'_>, y: usize) {
        let noise = pair.settings.noise;
        self.left.all(pair.left, y, noise, None);
        self.right.all(pair.right, y, noise, Some(D));
        cost::blend(&self.left, &self.right, self.costs.as_chunks_mut::<D>().0);
    }

    /// Writes the disparities of a row that pass the tests.
    fn decide<const D: usize>(&mut self, pair: &Pair<'_>, row: usize, output: &mut Output<'_>) {
        let place = row * pair.left.width()..(row + 1) * pair.left.width();
        let disparities = &mut output.disparities[place.clone()];
        let confidences = &mut output.confidences[place];
        let settings = pair.settings;
        self.winners.find(self.sums.as_chunks::<D>().0);
        let mut found = RowWinners { disparities, confidences };
        let refused = self.winners.judge(settings.uniqueness as f32, &mut found);
        let tolerance = settings.left_right;
        let buffers = &mut self.from_right;
        let disagree = self.winners.look_from_right(tolerance, buffers, found.disparities);
        self.dropped.outside += u64::from(refused.outside);
        self.dropped.not_unique += u64::from(refused.not_unique);
        self.dropped.left_right += u64::from(disagree);
    }
}
