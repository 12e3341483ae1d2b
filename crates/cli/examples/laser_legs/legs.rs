//! Detector of people in a laser scan: two segments side by side that are as wide as legs.

use nalgebra::{Matrix3, Point3, center};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
};

/// Detector of pairs of segments that are as wide as legs, with its settings.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Legs {
    /// Distance between the points of neighbouring rays that ends a segment, m.
    jump_m: f64,
    /// Least and largest width of a leg, m.
    leg_m: [f64; 2],
    /// Least and largest distance between the legs of a person, m.
    stride_m: [f64; 2],
}

impl Default for Legs {
    fn default() -> Self {
        Self { jump_m: 0.13, leg_m: [0.05, 0.25], stride_m: [0.1, 0.6] }
    }
}

impl Detector for Legs {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Input::Laser);
        Capabilities::new(inputs).discovering()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        _: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        fn apart(a: &Point3<f64>, b: &Point3<f64>) -> f64 {
            (a - b).norm()
        }

        fn within([least, most]: [f64; 2], width_m: f64) -> bool {
            least <= width_m && width_m < most
        }

        // It only discovers, and finds no tracked person again.
        if matches!(query, Query::Track(_)) {
            return Ok(Vec::new());
        }
        let points = &frame.scan()?.points;
        let segments = points.chunk_by(|a, b| apart(a, b) < self.jump_m).filter(|s| s.len() >= 3);
        let ends = segments.map(|segment| (segment[0], segment[segment.len() - 1]));
        let legs = ends.filter(|(first, last)| within(self.leg_m, apart(first, last)));
        let legs: Vec<Point3<f64>> = legs.map(|(first, last)| center(&first, &last)).collect();
        let pairs = legs.windows(2).filter(|p| within(self.stride_m, apart(&p[0], &p[1])));
        Ok(pairs
            .map(|pair| {
                let at = center(&pair[0], &pair[1]);
                // Legs contain no information on a person's height.
                let covariance = Matrix3::from_diagonal(&[0.01, 0.01, 1e3].into());
                let position = Point3::new(at.x, at.y, 1.6);
                Detection::new("legs", position, covariance, 1.5)
            })
            .collect())
    }
}
