//! Fixed cameras in the room: an external measurement system, as a laboratory would build it from
//! webcams.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tagalong_core::{RgbImage, settings};
use tagalong_geometry::{Camera, Pinhole};

use crate::render::draw;
use crate::sensor::{Exposure, Moment};
use crate::world::World;

settings! {
    /// A camera at a fixed position.
    pub struct WebcamSettings {
        /// Position, m.
        pub at: [f64; 2] = [0.1, 0.1],
        /// Height above the floor, m.
        pub height_m: f64 = 2.2,
        /// Heading, degrees.
        pub heading_deg: f64 = 45.0,
        /// Pitch, degrees downwards.
        pub pitch_down_deg: f64 = 15.0,
        /// Horizontal field of view, degrees.
        #[schemars(range(min = 10.0, max = 150.0))]
        pub field_of_view_deg: f64 = 80.0,
        /// Columns.
        #[schemars(range(min = 8, max = 4096))]
        pub width: usize = 320,
        /// Rows.
        #[schemars(range(min = 8, max = 4096))]
        pub height: usize = 240,
        /// Images per second.
        #[schemars(range(min = 0.1, max = 100.0))]
        pub rate_hz: f64 = 3.0,
    }
}

impl WebcamSettings {
    /// Returns the camera; its `robot_from_camera` is its pose in the **world**.
    pub fn camera(&self) -> Camera {
        let f = 0.5 * self.width as f64 / (0.5 * self.field_of_view_deg.to_radians()).tan();
        let lens = Pinhole::centred(f, self.width, self.height);
        let down = self.pitch_down_deg.to_radians();
        let camera = Camera::mounted(lens, self.width, self.height, self.height_m, down, 0.0);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading_deg.to_radians());
        let place = Isometry3::from_parts(
            Translation3::new(self.at[0], self.at[1], 0.0),
            UnitQuaternion::from_rotation_matrix(&turn),
        );
        Camera { robot_from_camera: place * camera.robot_from_camera, ..camera }
    }
}

/// A running camera at a fixed position.
#[derive(Clone, Debug)]
pub(crate) struct Webcam {
    camera: Camera,
    rate_hz: f64,
    exposure: Exposure,
    shots: u64,
    threads: usize,
}

impl Webcam {
    /// Creates the camera; `threads` is the number of threads that render its images.
    pub(crate) fn new(settings: &WebcamSettings, threads: usize) -> Self {
        let exposure = Exposure::new(threads);
        Self { camera: settings.camera(), rate_hz: settings.rate_hz, exposure, shots: 0, threads }
    }

    pub(crate) fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns true once for each image.
    pub(crate) fn due(&mut self, now_ns: u64) -> bool {
        let due = now_ns >= (self.shots as f64 * 1e9 / self.rate_hz) as u64;
        self.shots += u64::from(due);
        due
    }

    /// Renders an image; `seed` determines its noise.
    pub(crate) fn shoot(&mut self, world: &World, seed: u64) -> RgbImage {
        let seen = draw(world, &self.camera, &Isometry3::identity(), self.threads);
        let seed = seed ^ (self.shots << 2);
        self.exposure.colour(&seen, &Moment { seed, smear_px: 0.0, gain: 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn a_webcam_looks_where_it_is_told() {
        let settings =
            WebcamSettings { at: [1.0, 2.0], heading_deg: 90.0, ..WebcamSettings::default() };
        let camera = settings.camera();
        let down = 3.0 * settings.pitch_down_deg.to_radians().tan();
        let pixel = camera.project(&Point3::new(1.0, 5.0, settings.height_m - down)).unwrap();
        assert!((pixel.x - 159.5).abs() < 1e-6 && (pixel.y - 119.5).abs() < 1e-6, "{pixel}");
        let left = camera.project(&Point3::new(0.5, 5.0, 1.4)).unwrap();
        assert!(left.x < 150.0, "what is in negative X is on the left of one that looks along Y");
    }

    #[test]
    fn images_come_at_the_rate() {
        let mut webcam = Webcam::new(&WebcamSettings::default(), 1);
        let due = (0..100).filter(|step| webcam.due(step * 20_000_000)).count();
        assert_eq!(due, 6);
    }
}
