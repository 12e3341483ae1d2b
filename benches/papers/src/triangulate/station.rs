use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Vector4};

/// A fixed camera, as far as it matters for bearings: its height does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Where it hangs in the room, m.
    pub at: Point2<f64>,
    /// Where it looks, rad from the X axis towards Y.
    pub heading_rad: f64,
    /// Pitch downwards, rad.
    pub pitch_down_rad: f64,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// The middle of the image, pixels.
    pub centre_px: Point2<f64>,
}

impl Station {
    /// Returns the bearing of a pixel's ray in the room, rad.
    pub fn bearing(&self, pixel: &Point2<f64>) -> f64 {
        let right = (pixel.x - self.centre_px.x) / self.focal_px;
        let down = (pixel.y - self.centre_px.y) / self.focal_px;
        let (sine, cosine) = self.pitch_down_rad.sin_cos();
        wrapped(self.heading_rad - right.atan2(cosine - down * sine))
    }

    /// The bearing in the room of a place as seen from here, rad.
    pub fn towards(&self, place: &Point2<f64>) -> f64 {
        let way = place - self.at;
        way.y.atan2(way.x)
    }

    /// Returns the calibrated parameters: place (m), heading (rad), and focal length in units of
    /// `unit_px`, so that all numbers are of like size. The pitch is not among them: bearings to a
    /// hat that is always equally high fit any pitch, with another place.
    pub(crate) fn parameters(&self, unit_px: f64) -> Vector4<f64> {
        Vector4::new(self.at.x, self.at.y, self.heading_rad, self.focal_px / unit_px)
    }

    /// The same camera with other parameters.
    pub(crate) fn with(&self, parameters: &Vector4<f64>, unit_px: f64) -> Self {
        Self {
            at: Point2::new(parameters[0], parameters[1]),
            heading_rad: parameters[2],
            focal_px: (parameters[3] * unit_px).max(1.0),
            ..*self
        }
    }
}

/// An angle from -pi to pi.
pub(crate) fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}
