//! Routes around blocks: the shortest one via the corners of blocks.

use nalgebra::Point2;

use super::Block;

/// Distance of corners outside of the margin of routes, m.
const OFF_CORNER_M: f64 = 0.05;

/// The blocks of a scene and the walls of its room.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    blocks: Vec<Block>,
    room_m: [f64; 2],
    /// Distance of routes from blocks, m.
    margin_m: f64,
    /// Points at which a route may turn.
    corners: Vec<Point2<f64>>,
    /// Corners that can be reached from each corner in a straight line, with the distances, m.
    reached: Vec<Vec<(usize, f64)>>,
}

impl Blocks {
    /// Prepares routes that keep a margin from blocks, m.
    pub fn new(blocks: &[Block], room_m: [f64; 2], margin_m: f64) -> Self {
        let mut all = Self { blocks: blocks.to_vec(), room_m, margin_m, ..Self::default() };
        for corner in blocks.iter().flat_map(|block| block.corners(margin_m + OFF_CORNER_M)) {
            let is_inside =
                (0..2).all(|axis| (margin_m..room_m[axis] - margin_m).contains(&corner[axis]));
            if is_inside && blocks.iter().all(|block| block.gap_m(&corner) > margin_m) {
                all.corners.push(corner);
            }
        }
        all.reached = all.corners.iter().map(|corner| all.reached_from(corner)).collect();
        all
    }

    /// Returns true if the scene has no blocks.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Returns the nearest points of the walls of the room and of each block.
    pub fn nearest(&self, place: &Point2<f64>) -> impl Iterator<Item = Point2<f64>> {
        let [x, y] = self.room_m;
        let walls = [
            Point2::new(0.0, place.y),
            Point2::new(x, place.y),
            Point2::new(place.x, 0.0),
            Point2::new(place.x, y),
        ];
        let place = *place;
        walls.into_iter().chain(self.blocks.iter().map(move |block| block.nearest(&place)))
    }

    /// Returns the position, moved out of blocks and into the room for a body of this radius, m.
    pub fn outside(&self, place: &Point2<f64>, radius_m: f64) -> Point2<f64> {
        let mut place = *place;
        for block in &self.blocks {
            place = block.outside(&place, radius_m);
        }
        for axis in 0..2 {
            let most_m = self.room_m[axis] - radius_m;
            place[axis] = place[axis].clamp(radius_m.min(most_m), most_m.max(radius_m));
        }
        place
    }

    /// Returns true if no block is on the straight line between two points.
    pub fn is_free(&self, from: &Point2<f64>, to: &Point2<f64>) -> bool {
        self.blocks.iter().all(|block| {
            // A body pressed against a block, or a goal beside one, is nearer than the margin.
            let nearest_m = block.gap_m(from).min(block.gap_m(to)) - 1e-6;
            !block.is_on_way(from, to, self.margin_m.min(nearest_m))
        })
    }

    /// Returns true if a block is between two points.
    pub fn hides(&self, from: &Point2<f64>, to: &Point2<f64>) -> bool {
        self.blocks.iter().any(|block| block.is_on_way(from, to, 0.0))
    }

    /// Returns the points of the shortest route, including its end but not its start; only the end
    /// if there is no route.
    pub fn route(&self, from: &Point2<f64>, to: &Point2<f64>) -> Vec<Point2<f64>> {
        if self.is_free(from, to) {
            return vec![*to];
        }
        let first = self.reached_from(from);
        let last = self.reached_from(to);
        let mut lengths_m = vec![f64::INFINITY; self.corners.len()];
        let mut before: Vec<Option<usize>> = vec![None; self.corners.len()];
        let mut is_done = vec![false; self.corners.len()];
        for (corner, length_m) in first {
            lengths_m[corner] = length_m;
        }
        loop {
            let open =
                (0..self.corners.len()).filter(|i| !is_done[*i] && lengths_m[*i].is_finite());
            let Some(here) = open.min_by(|a, b| lengths_m[*a].total_cmp(&lengths_m[*b])) else {
                break;
            };
            is_done[here] = true;
            for (next, step_m) in &self.reached[here] {
                let length_m = lengths_m[here] + step_m;
                if length_m < lengths_m[*next] {
                    lengths_m[*next] = length_m;
                    before[*next] = Some(here);
                }
            }
        }
        let best = last
            .iter()
            .map(|(corner, rest_m)| (*corner, lengths_m[*corner] + rest_m))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let mut way = vec![*to];
        let mut corner = best.filter(|(_, whole_m)| whole_m.is_finite()).map(|best| best.0);
        while let Some(here) = corner {
            way.push(self.corners[here]);
            corner = before[here];
        }
        way.reverse();
        way
    }

    /// Returns the corners that can be reached in a straight line from a point, with their
    /// distances, m.
    fn reached_from(&self, from: &Point2<f64>) -> Vec<(usize, f64)> {
        let all = self.corners.iter().enumerate();
        all.filter(|(_, corner)| self.is_free(from, corner))
            .map(|(i, corner)| (i, (corner - from).norm()))
            .collect()
    }
}
