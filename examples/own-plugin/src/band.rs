//! A detector: whatever is as wide as a person in a band at the height of the shoulders.

use nalgebra::{Matrix3, Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_geometry::{Camera, ImageBox};

/// Settings of `own-band`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Lower and upper edge of the band above the floor, m.
    pub band_m: [f64; 2],
    /// Least and largest width of a person, m.
    pub width_m: [f64; 2],
    /// Distance between neighbouring columns that ends a segment, m.
    pub jump_m: f64,
    /// Height of the head above the floor, which the band does not show, m.
    pub head_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { band_m: [1.1, 1.4], width_m: [0.2, 0.8], jump_m: 0.2, head_m: 1.6 }
    }
}

/// Distance from the chest to the vertical line through the head, m.
const CHEST_M: f64 = 0.1;

/// Detector by the width of segments.
pub struct OwnBand(pub Config);

impl OwnBand {
    /// Returns the nearest point of each column within the band, in the robot frame.
    fn nearest(&self, depth: &DepthImage, camera: &Camera) -> Vec<Point3<f64>> {
        let [low, high] = self.0.band_m;
        let nearest = (0..depth.width()).filter_map(|x| {
            let points = (0..depth.height()).step_by(4).map(|y| {
                let metres = depth.get(x as i64, y as i64).unwrap_or(f32::NAN);
                camera.back_project(Point2::new(x as f64, y as f64), f64::from(metres))
            });
            // Points without a reading are NaN, and in no band.
            let inside = points.filter(|point| (low..high).contains(&point.z));
            inside.min_by(|a, b| a.xy().coords.norm().total_cmp(&b.xy().coords.norm()))
        });
        nearest.collect()
    }

    /// Returns the person that a segment of neighbouring columns shows.
    fn person(&self, segment: &[Point3<f64>], camera: &Camera) -> Option<Detection> {
        let first = segment.first()?.xy();
        let last = segment.last()?.xy();
        let [least, most] = self.0.width_m;
        if !(least..most).contains(&(last - first).norm()) {
            return None;
        }
        let surface = segment.iter().map(|p| p.coords.xy()).sum::<nalgebra::Vector2<f64>>()
            / segment.len() as f64;
        let at = surface + CHEST_M * surface.try_normalize(1e-6)?;
        let position = Point3::new(at.x, at.y, self.0.head_m);
        let image = Some(ImageBox::upper_body(camera.upper_body(&position)));
        // The height is assumed, and people differ by a decimetre.
        let covariance = Matrix3::from_diagonal(&[0.01, 0.01, 0.01].into());
        Some(Detection::new("own-band", position, covariance, 1.0).with_image(image))
    }
}

impl Detector for OwnBand {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Input::Depth);
        Capabilities::new(inputs).discovering()
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
        let points = self.nearest(frame.depth()?, &frame.camera);
        let segments = points.chunk_by(|a, b| (a.xy() - b.xy()).norm() < self.0.jump_m);
        Ok(segments.filter_map(|segment| self.person(segment, &frame.camera)).collect())
    }
}
