use nalgebra::Point2;

use super::CollisionMonitorSettings;
use super::footprint::Footprint;
use super::sweep::{Hazard, HazardKind};

/// Size of a bin, m.
const BIN_M: f64 = 0.05;
/// Depth within the footprint from which on a reading is of the robot itself, m: what touches it may
/// be measured a little inside.
const ITSELF_M: f64 = 0.1;

/// Hazards of a frame: points of sensors in bins, each with the point nearest to the robot.
#[derive(Default)]
pub(super) struct BinnedHazards {
    hazards: Vec<Hazard>,
    /// Number of the hazard in each bin, plus one.
    bins: Vec<u32>,
    side: usize,
    reach_m: f64,
    footprint: Option<Footprint>,
    /// Hazards that are falls of the floor, which stay as they are.
    drops: Vec<bool>,
}

impl BinnedHazards {
    /// Begins a frame.
    pub(super) fn begin(&mut self, settings: &CollisionMonitorSettings, footprint: &Footprint) {
        let reach_m = settings.people_range_m + footprint.radius_m();
        let side = 2 * (reach_m / BIN_M).ceil() as usize + 2;
        if side != self.side {
            self.bins = vec![0; side * side];
            self.side = side;
            self.reach_m = reach_m;
            self.footprint = Some(footprint.clone());
        }
        self.clear();
    }

    /// Removes all hazards.
    pub(super) fn clear(&mut self) {
        for hazard in &self.hazards {
            if let Some(bin) = bin(self.side, self.reach_m, &hazard.at) {
                self.bins[bin] = 0;
            }
        }
        self.hazards.clear();
        self.drops.clear();
    }

    /// Returns the number of hazards.
    pub(super) fn len(&self) -> usize {
        self.hazards.len()
    }

    /// Returns all hazards.
    pub(super) fn all(&self) -> &[Hazard] {
        &self.hazards
    }

    /// Adds a reading, whose kind is judged later; one beyond the reach or of the robot itself is
    /// left out.
    pub(super) fn add(&mut self, at: Point2<f64>, points: u32, is_drop: bool) {
        let Some(bin) = bin(self.side, self.reach_m, &at) else { return };
        if let Some(known) = (self.bins[bin] as usize).checked_sub(1) {
            let hazard = &mut self.hazards[known];
            hazard.points = hazard.points.saturating_add(points);
            if at.coords.norm_squared() < hazard.at.coords.norm_squared() {
                hazard.at = at;
            }
            return;
        }
        let hazard = Hazard { at, points, kind: HazardKind::Still };
        if self.push(hazard, is_drop) {
            self.bins[bin] = self.hazards.len() as u32;
        }
    }

    /// Adds a hazard of its own; returns false for one of the robot itself.
    pub(super) fn push(&mut self, hazard: Hazard, is_drop: bool) -> bool {
        let Some(footprint) = &self.footprint else { return false };
        // Positive comparison, so that a place that is no number is left out.
        let counts =
            footprint.distance_m(&hazard.at) > 0.0 || footprint.depth_m(&hazard.at) < ITSELF_M;
        if counts {
            self.hazards.push(hazard);
            self.drops.push(is_drop);
        }
        counts
    }

    /// Sets the kind of the hazards from number `first` on, and closes their bins. A fall stays as it
    /// is.
    pub(super) fn judge_since(&mut self, first: usize, kind: impl Fn(&Point2<f64>) -> HazardKind) {
        for at in first..self.hazards.len() {
            let hazard = &mut self.hazards[at];
            if let Some(bin) = bin(self.side, self.reach_m, &hazard.at) {
                self.bins[bin] = 0;
            }
            if !self.drops[at] {
                hazard.kind = kind(&hazard.at);
            }
        }
    }
}

/// Returns the bin of a place; `None` beyond the reach.
fn bin(side: usize, reach_m: f64, at: &Point2<f64>) -> Option<usize> {
    let is_near = at.x.abs() < reach_m && at.y.abs() < reach_m;
    if !is_near {
        return None;
    }
    let column = ((at.x + reach_m) / BIN_M) as usize;
    let row = ((at.y + reach_m) / BIN_M) as usize;
    Some(column * side + row)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hazards() -> BinnedHazards {
        let mut hazards = BinnedHazards::default();
        let footprint = Footprint::new(&crate::RobotSettings::default().footprint);
        hazards.begin(&CollisionMonitorSettings::default(), &footprint);
        hazards
    }

    #[test]
    fn points_of_a_bin_add_up_at_the_nearest_of_them() {
        let mut hazards = hazards();
        for (x, y) in [(1.01, 0.01), (1.0001, 0.02), (1.02, 0.03), (1.2, 0.0)] {
            hazards.add(Point2::new(x, y), 2, false);
        }
        let found: Vec<(f64, u32)> = hazards.all().iter().map(|h| (h.at.x, h.points)).collect();
        assert_eq!(found, [(1.0001, 6), (1.2, 2)]);
    }

    #[test]
    fn readings_of_the_robot_itself_and_beyond_the_reach_are_left_out() {
        let mut hazards = hazards();
        for (x, y) in [(0.0, 0.0), (0.12, 0.0), (99.0, 0.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)]
        {
            hazards.add(Point2::new(x, y), 9, false);
        }
        assert_eq!(hazards.len(), 0);
        hazards.add(Point2::new(0.2, 0.0), 9, false);
        assert_eq!(hazards.len(), 1, "it touches the front");
    }

    #[test]
    fn a_fall_is_not_judged_and_a_new_frame_is_empty() {
        let mut hazards = hazards();
        hazards.add(Point2::new(1.0, 0.0), 9, true);
        hazards.add(Point2::new(1.5, 0.0), 9, false);
        hazards.judge_since(0, |_| HazardKind::Moves(1.0));
        let kinds: Vec<HazardKind> = hazards.all().iter().map(|hazard| hazard.kind).collect();
        assert_eq!(kinds, [HazardKind::Still, HazardKind::Moves(1.0)]);
        hazards.clear();
        hazards.add(Point2::new(1.0, 0.0), 1, false);
        assert_eq!(hazards.all()[0].points, 1);
    }
}
