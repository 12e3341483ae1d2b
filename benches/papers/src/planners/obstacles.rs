use nalgebra::{Point2, Vector2};
use tagalong_core::Scene;

/// Radius of a person, m.
pub(super) const PERSON_M: f64 = 0.3;
/// Readings of the laser within this distance of the followed person's centre are of the person, m.
const OF_TARGET_M: f64 = PERSON_M + 0.2;
/// Which readings are a cluster (DBSCAN).
#[derive(Clone, Copy, Debug)]
pub(super) struct Clusters {
    /// Distance within which two readings are neighbours, m.
    pub(super) neighbour_m: f64,
    /// Least number of neighbours, itself included, of a reading within a cluster.
    pub(super) least: usize,
}

/// A rectangle around readings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    pub(super) centre: Point2<f64>,
    /// Direction of the first side.
    pub(super) along: Vector2<f64>,
    /// Halves of the sides, m.
    pub(super) half_m: [f64; 2],
}

/// Returns the readings of the laser that are not of the followed person, robot frame, m.
pub(super) fn readings(scene: &Scene<'_>, target: &Point2<f64>) -> Vec<Point2<f64>> {
    let Some(scan) = scene.frame.laser() else { return Vec::new() };
    let places = scan.points.iter().map(|point| point.xy());
    places.filter(|at| nalgebra::distance(at, target) > OF_TARGET_M).collect()
}

/// Returns the places of all other people, robot frame, m.
pub(super) fn others(scene: &Scene<'_>) -> Vec<Point2<f64>> {
    let target = scene.target.map(|track| track.id);
    let others = scene.tracks.iter().filter(|track| Some(track.id) != target);
    let places = others.map(|track| track.estimate.person.position.xy());
    places.filter(|at| at.iter().all(|value| value.is_finite())).collect()
}

impl Clusters {
    /// Returns the smallest rectangles around clusters of readings.
    pub(super) fn rectangles(self, readings: &[Point2<f64>]) -> Vec<Rectangle> {
        self.of(readings).iter().map(|cluster| rectangle(cluster)).collect()
    }

    /// Returns the clusters by DBSCAN; readings with too few neighbours belong to none.
    fn of(self, readings: &[Point2<f64>]) -> Vec<Vec<Point2<f64>>> {
        let mut is_taken = vec![false; readings.len()];
        let mut clusters = Vec::new();
        for first in 0..readings.len() {
            if is_taken[first] || self.neighbours(readings, first).len() < self.least {
                continue;
            }
            let mut cluster = Vec::new();
            let mut open = vec![first];
            is_taken[first] = true;
            while let Some(reading) = open.pop() {
                cluster.push(readings[reading]);
                let neighbours = self.neighbours(readings, reading);
                // A reading at the border of a cluster belongs to it, but leads no further.
                if neighbours.len() < self.least {
                    continue;
                }
                for neighbour in neighbours {
                    if !is_taken[neighbour] {
                        is_taken[neighbour] = true;
                        open.push(neighbour);
                    }
                }
            }
            clusters.push(cluster);
        }
        clusters
    }

    /// Returns the indices of the readings around one, with its own.
    fn neighbours(self, readings: &[Point2<f64>], a: usize) -> Vec<usize> {
        (0..readings.len())
            .filter(|b| nalgebra::distance(&readings[a], &readings[*b]) <= self.neighbour_m)
            .collect()
    }
}

/// Returns the rectangle of the smallest area, which lies along an edge of the convex hull.
fn rectangle(points: &[Point2<f64>]) -> Rectangle {
    let hull = hull(points);
    let point = Rectangle { centre: points[0], along: Vector2::x(), half_m: [0.0; 2] };
    let mut best = (f64::INFINITY, point);
    for (at, from) in hull.iter().enumerate() {
        let to = hull[(at + 1) % hull.len()];
        let Some(along) = (to - from).try_normalize(1e-9) else { continue };
        let across = Vector2::new(-along.y, along.x);
        let [along_m, across_m] = [along, across].map(|axis| span(&hull, &axis));
        let area = (along_m[1] - along_m[0]) * (across_m[1] - across_m[0]);
        if area < best.0 {
            let half_m = [along_m, across_m].map(|ends| 0.5 * (ends[1] - ends[0]));
            let [along_m, across_m] = [along_m, across_m].map(|ends| 0.5 * (ends[0] + ends[1]));
            let centre = Point2::from(along * along_m + across * across_m);
            best = (area, Rectangle { centre, along, half_m });
        }
    }
    best.1
}

fn span(points: &[Point2<f64>], axis: &Vector2<f64>) -> [f64; 2] {
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for point in points {
        let along = point.coords.dot(axis);
        ends = [ends[0].min(along), ends[1].max(along)];
    }
    ends
}

/// Returns the convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut lower = half_hull(sorted.iter());
    let mut upper = half_hull(sorted.iter().rev());
    // The last of each half is the first of the other one.
    lower.pop();
    upper.pop();
    lower.extend(upper);
    if lower.is_empty() { sorted } else { lower }
}

fn half_hull<'p>(sorted: impl Iterator<Item = &'p Point2<f64>>) -> Vec<Point2<f64>> {
    let mut half: Vec<Point2<f64>> = Vec::new();
    for point in sorted {
        while let [.., a, b] = half[..]
            && (b - a).perp(&(point - b)) <= 0.0
        {
            half.pop();
        }
        half.push(*point);
    }
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_and_a_pillar_have_a_centre_each_and_a_lone_reading_has_none() {
        let wall = (0..=10).map(|i| Point2::new(2.0, 0.2 * f64::from(i)));
        let pillar = [[-1.0, 0.0], [-1.2, 0.0], [-1.0, 0.2], [-1.2, 0.2]].map(Point2::from);
        let readings: Vec<_> = wall.chain(pillar).chain([Point2::new(-4.0, -4.0)]).collect();
        let found = Clusters { neighbour_m: 0.5, least: 3 }.rectangles(&readings);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].centre - Point2::new(2.0, 1.0)).norm() < 1e-9, "{found:?}");
        assert!((found[1].centre - Point2::new(-1.1, 0.1)).norm() < 1e-9, "{found:?}");
        // The wall has a length and no thickness.
        let wall_m = found[0].half_m;
        assert!(wall_m[0].min(wall_m[1]) < 1e-9 && (wall_m[0].max(wall_m[1]) - 1.0).abs() < 1e-9);
        // Of readings that are farther apart than neighbours there is nothing.
        assert!(Clusters { neighbour_m: 0.1, least: 3 }.rectangles(&readings).is_empty());
    }

    #[test]
    fn the_smallest_rectangle_may_lie_askew() {
        // A square on its corner: the rectangle along the axes has twice its area and its centre.
        let diamond = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [0.5, 0.5]];
        let askew = rectangle(&diamond.map(Point2::from));
        assert!(
            askew.centre.coords.norm() < 1e-9 && (askew.half_m[0] - 0.5_f64.sqrt()).abs() < 1e-9
        );
        // Of a right angle the rectangle along the legs is as large as that along the hypotenuse.
        let corner = [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]].map(Point2::from);
        let centre = rectangle(&corner).centre;
        assert!((centre - Point2::new(1.0, 0.5)).norm() < 1e-9, "{centre}");
    }
}
