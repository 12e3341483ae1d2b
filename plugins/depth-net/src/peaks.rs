use nalgebra::{Point2, Point3};

use crate::model::Views;
use crate::{FloorMap, Pass};

/// A cell whose neighbours up to this many cells away are not more likely is a peak.
const REACH: usize = 2;

/// A place of the map where a person is most likely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Centre of the head in the robot frame, m.
    pub head: Point3<f64>,
    /// Uncalibrated log-odds.
    pub logit: f64,
}

impl Peak {
    /// Returns the distance on the floor, m.
    pub fn distance_m(&self, floor: &Point2<f64>) -> f64 {
        (self.head.xy() - floor).norm()
    }
}

/// Returns the peaks with log-odds above `least`, the likeliest first; those nearer than
/// `separation_m` to a likelier one are left out.
pub fn peaks(map: &FloorMap, pass: &Pass, least: f64, separation_m: f64) -> Vec<Peak> {
    let side = FloorMap::CELLS;
    let found: Vec<Peak> = (0..side * side)
        .filter(|cell| map.in_view[*cell])
        .map(|cell| (cell / side, cell % side))
        .filter(|(row, column)| {
            let logit = pass.logit(*row, *column);
            f64::from(logit) > least && is_highest(map, pass, [*row, *column])
        })
        .map(|(row, column)| peak(pass, row, column))
        .collect();
    apart(found, separation_m)
}

/// Returns the peaks without those nearer than `separation_m` to a likelier one, the likeliest first.
fn apart(mut found: Vec<Peak>, separation_m: f64) -> Vec<Peak> {
    found.sort_by(|a, b| b.logit.total_cmp(&a.logit));
    let mut kept: Vec<Peak> = Vec::new();
    for peak in found {
        if kept.iter().all(|other| other.distance_m(&peak.head.xy()) >= separation_m) {
            kept.push(peak);
        }
    }
    kept
}

/// Directions beside the middle of a view that are its own, rad: a little more than an eighth of a
/// turn, because a person at its edge is a bit aside in the view beside it.
const OWN_RAD: f64 = 0.9;

/// Returns the peaks of all views of a frame, as [`peaks`].
pub(crate) fn peaks_of(views: &Views, passes: &[Pass], least: f64, separation_m: f64) -> Vec<Peak> {
    let mut all = Vec::new();
    for ((quarter, map), pass) in views.maps.iter().zip(passes) {
        let found = peaks(map, pass, least, separation_m);
        let own = found.into_iter().filter(|peak| {
            views.beams.is_none() || peak.head.y.atan2(peak.head.x).abs() <= OWN_RAD
        });
        all.extend(own.map(|peak| Peak { head: quarter.robot_of(peak.head), ..peak }));
    }
    apart(all, separation_m)
}

fn is_highest(map: &FloorMap, pass: &Pass, [row, column]: [usize; 2]) -> bool {
    fn near(at: usize) -> std::ops::Range<usize> {
        at.saturating_sub(REACH)..(at + REACH + 1).min(FloorMap::CELLS)
    }
    let own = pass.logit(row, column);
    !near(row).any(|y| {
        near(column).any(|x| map.in_view[y * FloorMap::CELLS + x] && pass.logit(y, x) > own)
    })
}

fn peak(pass: &Pass, row: usize, column: usize) -> Peak {
    let [x, y, height_m] = pass.head(row, column).map(f64::from);
    let centre = FloorMap::centre(row, column);
    Peak {
        head: Point3::new(centre.x + x, centre.y + y, height_m),
        logit: f64::from(pass.logit(row, column)),
    }
}

#[cfg(test)]
mod tests {
    use tagalong_learn::conv::Map;

    use super::*;

    #[test]
    fn peaks_come_in_order_and_apart_from_each_other() {
        let mut pass = Pass::default();
        let map = FloorMap {
            fine: Map::new(128, 128),
            coarse: Map::new(64, 64),
            in_view: (0..64 * 64).map(|cell| cell % 64 < 60 && cell / 64 < 60).collect(),
        };
        pass.answer.values.as_chunks_mut::<4>().0.iter_mut().for_each(|cell| cell[0] = -9.0);
        for (row, column, logit) in [
            (10, 10, 1.0),
            (10, 11, 2.0),
            (10, 14, 1.5),
            (30, 30, 3.0),
            (40, 62, 5.0),
            (50, 5, -1.0),
            (59, 20, 2.5),
            (60, 20, 4.0),
        ] {
            *pass.answer.at_mut(row, column) = [logit, 0.02, -0.03, 0.25];
        }
        let found = peaks(&map, &pass, 0.0, 0.35);
        let logits: Vec<f64> = found.iter().map(|peak| peak.logit).collect();
        assert_eq!(logits, [3.0, 2.5, 2.0], "beside, near, out of view, too low are none");
        let head = found[0].head - Point3::new(0.2 + 3.05 + 0.02, -3.2 + 3.05 - 0.03, 1.75);
        assert!(head.norm() < 1e-6, "{head}");
        assert_eq!(peaks(&map, &pass, 0.0, 0.25).len(), 4);
    }
}
