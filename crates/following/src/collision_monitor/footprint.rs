use nalgebra::{Isometry2, Point2, Vector2};

/// Outline of the robot on the floor: a polygon in the robot frame, m, as Nav2's `footprint`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Footprint {
    corners: Vec<Point2<f64>>,
    /// Distance of the farthest corner from the middle of the robot, m.
    radius_m: f64,
}

impl Footprint {
    /// Creates the outline of these corners, in their order around it.
    pub(crate) fn new(corners: &[[f64; 2]]) -> Self {
        let corners: Vec<Point2<f64>> = corners.iter().copied().map(Point2::from).collect();
        let radius_m = corners.iter().map(|corner| corner.coords.norm()).fold(0.0, f64::max);
        Self { corners, radius_m }
    }

    /// Returns the distance of the farthest corner from the middle of the robot, m.
    pub(crate) fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Returns the foremost point ahead of the middle of the robot, m.
    pub(crate) fn front_m(&self) -> f64 {
        self.corners.iter().map(|corner| corner.x).fold(0.0, f64::max)
    }

    /// Returns the corners, robot frame, m.
    pub(crate) fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// Returns the distance from the outline to a place in the robot frame, m; 0 inside.
    pub(crate) fn distance_m(&self, at: &Point2<f64>) -> f64 {
        let (edge_m, is_inside) = self.edge_distance(at);
        if is_inside { 0.0 } else { edge_m }
    }

    /// Returns how deep within the outline a place in the robot frame is, m; 0 outside.
    pub(crate) fn depth_m(&self, at: &Point2<f64>) -> f64 {
        let (edge_m, is_inside) = self.edge_distance(at);
        if is_inside { edge_m } else { 0.0 }
    }

    /// Returns the distance of a place from the nearest edge, m, and whether it is inside.
    fn edge_distance(&self, at: &Point2<f64>) -> (f64, bool) {
        let mut nearest = f64::INFINITY;
        let mut is_inside = false;
        let mut from = match self.corners.last() {
            Some(last) => *last,
            None => return (at.coords.norm(), false),
        };
        for to in &self.corners {
            let edge: Vector2<f64> = to - from;
            let part = ((at - from).dot(&edge) / edge.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            nearest = nearest.min((at - (from + part * edge)).norm_squared());
            // Even-odd rule: a ray to the right crosses the edge.
            if (from.y > at.y) != (to.y > at.y)
                && at.x < from.x + (at.y - from.y) / (to.y - from.y) * edge.x
            {
                is_inside = !is_inside;
            }
            from = *to;
        }
        (nearest.sqrt(), is_inside)
    }
}

/// Way of the robot from where it is, by one parameter: the distance along an arc, m, or the angle of
/// a turn in place, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Path {
    /// Arc of this curvature, 1/m, positive to the left; backwards where `backwards` is set.
    Arc { curvature: f64, backwards: bool },
    /// Turn in place, to the left or to the right.
    Turn { left: bool },
}

/// Curvature below which a path is straight, 1/m.
const STRAIGHT: f64 = 1e-4;
/// Largest step of a corner between two poses that are looked at, m.
const STEP_M: f64 = 0.05;

impl Path {
    /// Returns the pose of the robot after this much of the path, in its frame at the start.
    pub(crate) fn pose(self, along: f64) -> Isometry2<f64> {
        match self {
            Self::Arc { curvature, backwards } => {
                let way = if backwards { -along } else { along };
                let turn = curvature * way;
                if curvature.abs() < STRAIGHT {
                    return Isometry2::new(Vector2::new(way, 0.0), turn);
                }
                let at = Vector2::new(turn.sin(), 1.0 - turn.cos()) / curvature;
                Isometry2::new(at, turn)
            }
            Self::Turn { left } => Isometry2::rotation(if left { along } else { -along }),
        }
    }

    /// Returns the step of the parameter by which no corner moves farther than [`STEP_M`].
    pub(crate) fn step(self, footprint: &Footprint) -> f64 {
        match self {
            Self::Arc { curvature, .. } => STEP_M / (1.0 + curvature.abs() * footprint.radius_m()),
            Self::Turn { .. } => STEP_M / footprint.radius_m().max(STEP_M),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Footprint {
        Footprint::new(&[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]])
    }

    #[test]
    fn distances_are_those_to_the_edges_and_corners_and_zero_inside() {
        let square = square();
        for (x, y) in [(0.0, 0.0), (0.29, -0.19)] {
            assert_eq!(square.distance_m(&Point2::new(x, y)), 0.0);
        }
        for (x, y, wanted_m, why) in [
            (0.8, 0.1, 0.5, "ahead"),
            (0.0, -0.5, 0.3, "beside"),
            (0.6, 0.6, 0.5, "3-4-5 from the corner"),
        ] {
            let far_m = square.distance_m(&Point2::new(x, y));
            assert!((far_m - wanted_m).abs() < 1e-12, "{why}: {far_m}");
        }
        assert!((square.radius_m() - 0.13_f64.sqrt()).abs() < 1e-12);
        assert_eq!(square.front_m(), 0.3);
        assert!((square.depth_m(&Point2::new(0.25, 0.0)) - 0.05).abs() < 1e-12);
        assert_eq!(square.depth_m(&Point2::new(0.8, 0.0)), 0.0);
    }

    #[test]
    fn a_notch_of_a_footprint_that_is_not_convex_is_outside() {
        let notched =
            Footprint::new(&[[0.4, 0.4], [0.0, 0.0], [0.4, -0.4], [-0.4, -0.4], [-0.4, 0.4]]);
        assert!(notched.distance_m(&Point2::new(0.3, 0.0)) > 0.1);
        assert_eq!(notched.distance_m(&Point2::new(-0.2, 0.1)), 0.0);
    }

    #[test]
    fn poses_lie_on_the_path() {
        let arc = Path::Arc { curvature: 0.5, backwards: false }.pose(std::f64::consts::PI);
        assert!((arc.translation.vector - Vector2::new(2.0, 2.0)).norm() < 1e-9, "{arc}");
        let back = Path::Arc { curvature: 0.0, backwards: true }.pose(0.4);
        assert!((back.translation.vector - Vector2::new(-0.4, 0.0)).norm() < 1e-12);
        let turn = Path::Turn { left: false }.pose(0.3);
        assert!((turn.rotation.angle() + 0.3).abs() < 1e-12);
    }
}
