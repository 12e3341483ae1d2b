//! Detector of people in a laser scan: two segments side by side that are as wide as legs.

use nalgebra::{Matrix3, Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, Input, Inputs, LaserScan, Query, Result,
};

/// Settings of `legs`.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Distance between the points of neighbouring rays that ends a segment, m.
    jump_m: f64,
    /// Width of a leg, m.
    leg_m: [f64; 2],
    /// Distance of the two legs of a person, m.
    stride_m: [f64; 2],
}

impl Default for Config {
    fn default() -> Self {
        Self { jump_m: 0.13, leg_m: [0.05, 0.25], stride_m: [0.1, 0.6] }
    }
}

/// Detector of pairs of segments that are as wide as legs.
pub struct Legs(pub Config);

impl Legs {
    /// Returns the middles of segments that are as wide as a leg.
    fn legs(&self, scan: &LaserScan) -> Vec<Point2<f64>> {
        let apart = |a: &Point3<f64>, b: &Point3<f64>| (a - b).norm();
        let segments = scan.points.chunk_by(|a, b| apart(a, b) < self.0.jump_m);
        let [least, most] = self.0.leg_m;
        let is_leg = |segment: &&[Point3<f64>]| {
            let width = apart(&segment[0], &segment[segment.len() - 1]);
            segment.len() >= 3 && (least..most).contains(&width)
        };
        let middle = |s: &[Point3<f64>]| nalgebra::center(&s[0], &s[s.len() - 1]).xy();
        segments.filter(is_leg).map(middle).collect()
    }
}

impl Detector for Legs {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Input::Laser);
        Capabilities { inputs, discovers: true, ..Capabilities::default() }
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        _: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        // It only discovers, and finds no tracked person again.
        if matches!(query, Query::Track(_)) {
            return Ok(Vec::new());
        }
        let legs = self.legs(frame.scan()?);
        let [least, most] = self.0.stride_m;
        let pairs =
            legs.windows(2).filter(|pair| (least..most).contains(&(pair[0] - pair[1]).norm()));
        let detection = |pair: &[Point2<f64>]| {
            let at = nalgebra::center(&pair[0], &pair[1]);
            // Legs contain no information on a person's height.
            let covariance = Matrix3::from_diagonal(&[0.01, 0.01, 1e3].into());
            let position = Point3::new(at.x, at.y, 1.6);
            Detection { image: None, position, covariance, score: 1.5, source: "legs" }
        };
        Ok(pairs.map(detection).collect())
    }
}
